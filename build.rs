//! Records what this binary is: compiler, commit and profile travel with every trial.

use std::process::Command;

fn output(program: &str, args: &[&str]) -> Option<String> {
    let out = Command::new(program).args(args).output().ok()?;
    out.status.success().then(|| String::from_utf8_lossy(&out.stdout).trim().to_string())
}

fn main() {
    let rustc = std::env::var("RUSTC").unwrap_or_else(|_| "rustc".into());
    let set = |name: &str, value: Option<String>| {
        println!("cargo:rustc-env={name}={}", value.unwrap_or_else(|| "unknown".into()));
    };
    set("CULLMARK_RUSTC", output(&rustc, &["--version"]));
    set("CULLMARK_COMMIT", output("git", &["rev-parse", "--short=12", "HEAD"]));
    // OUT_DIR is target/<profile>/build/<crate>/out: the folder names the profile,
    // which PROFILE does not (it says release for every profile that inherits it).
    let profile = std::env::var("OUT_DIR").ok().and_then(|dir| {
        std::path::Path::new(&dir).ancestors().nth(3)?.file_name().map(|n| n.to_string_lossy().into_owned())
    });
    set("CULLMARK_PROFILE", profile);
    // A source tree without git history keeps "unknown".
    if let Some(log) = output("git", &["rev-parse", "--git-path", "logs/HEAD"]) {
        println!("cargo:rerun-if-changed={log}");
    }
    println!("cargo:rerun-if-changed=build.rs");
    // `sqlx::migrate!` embeds the folder; a new file in it changes no source.
    println!("cargo:rerun-if-changed=migrations");
}
