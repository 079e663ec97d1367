//! `cullmark submit`: a study to a server.

use super::client::{Client, Server, escape};
use super::watch;
use crate::error::{Error, Result};
use crate::manifest::{Manifest, reach};
use crate::record::{PathSource, SceneSource};
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

#[derive(clap::Args)]
#[command(after_help = "A token, where the server wants one, is read from CULLMARK_TOKEN.")]
pub struct Args {
    /// TOML manifest of the study
    manifest: PathBuf,
    #[command(flatten)]
    server: Server,
    /// Lay key=value over the manifest, such as measure.repeats=3 (repeatable)
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Send the scene and path files that the manifest names, too
    #[arg(long)]
    upload: bool,
    /// Measure again under the next number, or go on with a given one
    #[arg(long, value_name = "next|N")]
    series: Option<String>,
    /// -100 to 100, higher first
    #[arg(long, default_value_t = 0, allow_negative_numbers = true)]
    priority: i64,
    /// Try again what failed before
    #[arg(long)]
    retry_failed: bool,
    /// Only check it, and print the plan's counts
    #[arg(long)]
    validate_only: bool,
    /// Watch it until it is finished; exit status 1 if a run failed or is wrong
    #[arg(long)]
    watch: bool,
    /// Print the server's answer as JSON
    #[arg(long)]
    json: bool,
}

pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let client = args.server.client()?;
    let mut text = std::fs::read_to_string(&args.manifest)
        .map_err(|e| Error::io(&args.manifest, "cannot read the manifest", &e))?;
    if args.upload {
        text = with_uploads(&client, &args.manifest, &args.set)?;
    }
    let body = json!({
        "manifest": text, "set": args.set, "series": args.series, "priority": args.priority,
        "retry_failed": args.retry_failed, "validate_only": args.validate_only,
    });
    let answer = client.post("/studies", &body)?;
    if args.json {
        println!("{answer:#}");
    } else {
        say(&answer);
    }
    match answer["study"]["ref"].as_str().filter(|_| args.watch) {
        Some(study) => watch::until_finished(&client, study, args.json),
        None => Ok(ExitCode::SUCCESS),
    }
}

fn say(answer: &Value) {
    for note in answer["notes"].as_array().into_iter().flatten().filter_map(Value::as_str) {
        eprintln!("note: {note}");
    }
    let counts = |of: &Value, names: &[&str]| {
        let some = names.iter().filter_map(|n| of[*n].as_u64().filter(|c| *c > 0).map(|c| format!("{c} {n}")));
        some.collect::<Vec<_>>().join(", ")
    };
    if let Some(study) = answer["study"]["ref"].as_str() {
        let s = &answer["submitted"];
        println!("{study}: {} runs ({})", s["runs"], counts(s, &["new", "resumed", "done", "failed", "wrong"]));
    } else {
        let p = &answer["plan"];
        let what = counts(p, &["new", "partial", "rerun", "rejudge", "done", "failed"]);
        let estimate = p["estimate_s"].as_f64().unwrap_or(0.0);
        println!("ok: {} runs ({what}), about {}", p["rows_total"], super::progress::duration(estimate.ceil() as u64));
    }
}

/// Sends every file that the manifest names and writes their uploads in their place.
fn with_uploads(client: &Client, path: &Path, sets: &[String]) -> anyhow::Result<String> {
    let manifest = Manifest::load(path, sets).map_err(|errors| {
        let text: Vec<String> = errors.iter().map(ToString::to_string).collect();
        anyhow::anyhow!("{}", text.join("\n"))
    })?;
    let mut files: BTreeSet<(&str, PathBuf)> = BTreeSet::new();
    for scene in &manifest.scenes {
        if let SceneSource::File(file) = &scene.source {
            files.insert(("scene", file.clone()));
        }
    }
    for walk in manifest.paths.iter().flatten() {
        if let PathSource::File(file) = &walk.source {
            files.insert(("path", file.clone()));
        }
    }
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut text = manifest.source_text.clone();
    for (kind, file) in &files {
        let id = send(client, kind, file)?;
        let named = file.strip_prefix(folder).unwrap_or(file).display().to_string();
        let upload = format!("\"upload:{id}\"");
        let quoted =
            text.split('"').skip(1).step_by(2).find(|t| **t == named || reach::expanded(t).is_ok_and(|p| p == *file));
        let Some(quoted) = quoted.map(|t| format!("\"{t}\"")) else {
            return Err(Error::new(format!("`{named}` was sent, but is not written so in the manifest"))
                .help("write its path in double quotes, without escapes")
                .into());
        };
        text = text.replace(&quoted, &upload);
    }
    Ok(text)
}

fn send(client: &Client, kind: &str, file: &Path) -> Result<String> {
    let name = file.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let open = std::fs::File::open(file).map_err(|e| Error::io(file, "cannot be read", &e))?;
    let sent = client.upload(&format!("/uploads?kind={kind}&name={}", escape(&name)), open);
    let answer = sent.map_err(|e| e.in_file(file))?;
    eprintln!("sent {name} ({} bytes)", answer["bytes"]);
    Ok(answer["id"].as_str().unwrap_or_default().to_string())
}
