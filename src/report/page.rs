//! The page: one HTML file that asks nothing of any network.

use super::charts;
use super::claims::{Judged, Verdict};
use super::figure::Figure;
use super::findings::findings;
use super::font;
use super::format::{capital, count, html};
use super::labels::Grid;
use super::rates;
use super::repeatability::Repeatability;
use super::style::DARK;
use super::sweeps::Chart;
use super::table::Table;
use crate::results::{RunStatus, StudyResults};
use base64::Engine;
use std::fmt::Write;

pub struct Content<'a> {
    pub grid: &'a Grid<'a>,
    pub judged: &'a [Judged<'a>],
    pub figures: &'a [Figure],
    /// The figures as SVG without background, in the same order.
    pub svgs: &'a [String],
    pub tables: &'a [Table],
    /// Charts of errors against stressors, or why there is none.
    pub sweeps: &'a [Result<Chart<'a>, String>],
    /// What several measurements of the study say together.
    pub again: Option<&'a Repeatability<'a>>,
}

fn style_sheet() -> String {
    let mut css = String::new();
    for (weight, bytes) in [(400, font::REGULAR_WOFF2), (600, font::BOLD_WOFF2)] {
        let data = base64::engine::general_purpose::STANDARD.encode(bytes);
        let _ = writeln!(
            css,
            "@font-face {{ font-family:Inter; font-weight:{weight}; font-display:swap; src:url(data:font/woff2;base64,{data}) format('woff2') }}"
        );
    }
    css += include_str!("page.css");
    // Charts are drawn in light colours; a style sheet outranks their attributes.
    css += "@media (prefers-color-scheme: dark) {\n";
    for (light, dark) in DARK {
        let _ = writeln!(
            css,
            "svg [fill=\"#{light:06X}\"] {{ fill:#{dark:06X} }} svg [stroke=\"#{light:06X}\"] {{ stroke:#{dark:06X} }}"
        );
    }
    css + "}\n@media print { figure svg { min-width:0 } }\n"
}

pub fn document(content: &Content) -> String {
    let results = content.grid.results;
    let mut out = format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'; font-src data:; img-src data:\">\n\
         <meta name=\"generator\" content=\"cullmark {}\">\n<title>{}</title>\n<style>\n{}</style>\n</head>\n<body>\n\
         <a class=\"skip\" href=\"#main\">Skip to the content</a>\n",
        env!("CARGO_PKG_VERSION"),
        html(title(results)),
        style_sheet(),
    );
    out += &header(content);
    out += "<main id=\"main\">\n";
    out += &section("findings", "Key findings", &findings_html(content));
    if !content.judged.is_empty() {
        out += &section("claims-section", "Published claims", &claims_html(content));
    }
    let problems = [table(content, "problems"), table(content, "excluded")].concat();
    if !problems.is_empty() {
        out += &section("gaps", "What is missing, and why", &problems);
    }
    // Where a study asks for them they are what it is about.
    if !content.sweeps.is_empty() {
        out += &section("sweeps-section", "Errors against stressors", &sweeps_html(content));
    }
    let time = ["total-time-modelled", "total-time", "time-per-frame", "triangles-per-frame"];
    out += &section("times-section", "Time and work", &(figures(content, &time) + &table(content, "times")));
    out += &section(
        "rates-section",
        &format!("{}, and time against triangles", rates::title(content.grid)),
        &rates_html(content),
    );
    let front = ["time-against-error-modelled", "time-against-error", "time-against-over-submission"];
    let body = figures(content, &front);
    if !body.is_empty() {
        let body = format!("<p>{FRONTIER}</p>\n{body}{}", table(content, "frontier"));
        out += &section("frontier-section", "Run time against error", &body);
    }
    let advice = table(content, "advice");
    if !advice.is_empty() {
        out += &section("advice-section", "Advice, and what following it costs", &advice);
    }
    out += &section("errors-section", "Errors", &table(content, "errors"));
    let body = figures(content, &["memory"]) + &table(content, "memory");
    out += &section("memory-section", "Memory", &body);
    let body = figures(content, &["build-time"]) + &table(content, "build") + &table(content, "scenes");
    out += &section("build-section", "Structures", &body);
    if let Some(again) = content.again {
        out += &section("repeatability-section", "Measured again", &again_html(content, again));
    }
    out += &section("methods", "Methods", &methods(content));
    out += "</main>\n<footer><p>Written by cullmark. Charts as SVG and PNG are in <code>charts/</code>, tables as CSV, \
            Markdown and LaTeX in <code>tables/</code>. Type: Inter, SIL Open Font License 1.1.</p></footer>\n</body>\n</html>\n";
    out
}

fn title(results: &StudyResults) -> &str {
    if results.title.is_empty() { &results.name } else { &results.title }
}

fn section(id: &str, heading: &str, body: &str) -> String {
    format!(
        "<section id=\"{id}\" aria-labelledby=\"h-{id}\">\n<h2 id=\"h-{id}\">{}</h2>\n{body}</section>\n",
        html(heading)
    )
}

fn header(content: &Content) -> String {
    let results = content.grid.results;
    let with = |s: RunStatus| results.runs.iter().filter(|r| r.status == s).count();
    let mut out = format!(
        "<header>\n<p class=\"kicker\">cullmark study <code>{}</code>{}</p>\n<h1>{}</h1>\n<p>{}</p>\n<dl class=\"facts\">",
        html(&results.name),
        if results.created_utc.is_empty() { String::new() } else { format!(", {}", html(&results.created_utc)) },
        html(title(results)),
        html(&what_was_run(content.grid)),
    );
    let mut fact = |name: &str, n: usize, bad: bool| {
        let class = if bad && n > 0 { " class=\"bad\"" } else { "" };
        let _ = write!(out, "<div{class}><dt>{name}</dt><dd>{}</dd></div>", super::format::grouped(&n.to_string()));
    };
    fact("scenes", content.grid.places.len(), false);
    fact("combinations", content.grid.combinations.len(), false);
    fact("runs done", with(RunStatus::Done), false);
    for (status, bad) in [(RunStatus::Pending, false), (RunStatus::Failed, true), (RunStatus::Wrong, true)] {
        if with(status) > 0 {
            fact(status.word(), with(status), bad);
        }
    }
    fact("trials", results.runs.iter().map(|r| r.trials.len()).sum(), false);
    out += "</dl>\n<nav aria-label=\"Contents\"><ul>";
    let mut links = vec![("findings", "Key findings")];
    if !content.judged.is_empty() {
        links.push(("claims-section", "Claims"));
    }
    if !content.sweeps.is_empty() {
        links.push(("sweeps-section", "Stressors"));
    }
    links.extend([
        ("times-section", "Time and work"),
        ("rates-section", rates::title(content.grid)),
        ("frontier-section", "Time against error"),
    ]);
    if !content.grid.results.advice.is_empty() {
        links.push(("advice-section", "Advice"));
    }
    links.push(("errors-section", "Errors"));
    links.extend([("memory-section", "Memory"), ("build-section", "Structures")]);
    if content.again.is_some() {
        links.push(("repeatability-section", "Measured again"));
    }
    links.push(("methods", "Methods"));
    for (id, name) in links {
        let _ = write!(out, "<li><a href=\"#{id}\">{name}</a></li>");
    }
    out + "</ul></nav>\n</header>\n"
}

/// "3 scenes × 4 combinations of structure and culling, 2000 frames, 5 repeats, on ...".
fn what_was_run(grid: &Grid) -> String {
    let machines: Vec<String> =
        grid.results.environments.values().map(|e| format!("{} ({} cores)", e.cpu, e.cores)).collect();
    let on = if machines.is_empty() { String::new() } else { format!(" Measured on {}.", machines.join(" and on ")) };
    format!(
        "{} × {} of structure and culling; {}.{on}",
        count(grid.places.len() as u64, "scene", "scenes"),
        count(grid.combinations.len() as u64, "combination", "combinations"),
        charts::basis(grid),
    )
}

const FRONTIER: &str = "Speed is worth what it costs in error. Each point is one run; the lower left corner is where \
    everybody wants to be. On the front is what no other run of the scene beats in both coordinates; what lies behind it by \
    less than the intervals can tell is hollow, not faded. Methods that must not lose visible triangles stand at zero or are \
    not drawn at all: there, an error is a bug and no point. The pointer on a point names its run, which the table below lists.";

const SWEEPS: &str = "What a method loses as one thing gets harder and all else stays. Both axes are logarithmic where the \
    manifest asks for it, so that a power law is a straight line; exact zeros stand in a bin of their own, since a logarithm has \
    no place for them. The dashed line is the growth that theory expects, and the table gives the growth that was measured.";

fn sweeps_html(content: &Content) -> String {
    let mut out = format!("<p>{SWEEPS}</p>\n");
    for chart in content.sweeps {
        match chart {
            Ok(chart) => {
                let id = format!("sweep-{}", chart.sweep.id);
                out += &figures(content, &[&id]);
                out += &table(content, &format!("{id}-growth"));
                let points = table(content, &id);
                let _ = writeln!(out, "<details><summary>The numbers</summary>\n{points}</details>");
            }
            Err(why) => {
                let _ = writeln!(out, "<p class=\"note\">Not drawn: {}</p>", html(why));
            }
        }
    }
    out
}

fn rates_html(content: &Content) -> String {
    let mut out = format!("<p>{}</p>\n{}", html(&rates::words(content.grid)), table(content, "rates-best"));
    out += &figures(content, &["triangles-against-time"]);
    let all = table(content, "rates");
    if !all.is_empty() {
        let runs = count(content.grid.results.runs.len() as u64, "run", "runs");
        let _ =
            writeln!(out, "<details><summary>All {runs}, the fastest of each scene first</summary>\n{all}</details>");
    }
    out
}

fn again_html(content: &Content, again: &Repeatability) -> String {
    let mut out = String::from(
        "<p>The same study, measured more than once on purpose. Times should come again within their intervals; what is \
         counted, and what is submitted, must come again to the last triangle.</p>\n<ul class=\"findings\">\n",
    );
    for finding in again.findings() {
        let _ = writeln!(out, "<li>{}</li>", html(&finding));
    }
    out += "</ul>\n";
    out += &table(content, "repeatability-differences");
    out += &table(content, "repeatability");
    let pairs = table(content, "repeatability-pairs");
    let _ = writeln!(out, "<details><summary>Every number of every pair</summary>\n{pairs}</details>");
    out
}

fn findings_html(content: &Content) -> String {
    let mut out = String::from("<ul class=\"findings\">\n");
    for finding in findings(content.grid, content.judged) {
        let _ = writeln!(out, "<li>{}</li>", html(&finding));
    }
    out += "</ul>\n<p class=\"note\">Computed from the data below. Brackets: 95 % bootstrap interval over repeats. \
            “Modelled” times are derived, not measured; † may lose visible triangles by design.";
    if let Some(words) = charts::coverage(content.grid) {
        let _ = write!(out, " {}", html(&words));
    }
    out + "</p>\n" + &table(content, "best")
}

fn claims_html(content: &Content) -> String {
    let mut out = String::from("<ul class=\"claims\">\n");
    for j in content.judged {
        let class = match j.verdict {
            Verdict::Reproduced => "reproduced",
            Verdict::ModelOnly => "model",
            Verdict::Undecided => "undecided",
            Verdict::Contradicted => "contradicted",
        };
        let _ = writeln!(
            out,
            "<li><p><span class=\"v {class}\">{}</span> <b>{}</b></p><p class=\"note\"><code>{}</code>, {}. {}.</p></li>",
            html(j.verdict.word()),
            html(&j.claim.text),
            html(&j.claim.id),
            html(&j.claim.source),
            html(&capital(&j.summary)),
        );
    }
    out += "</ul>\n";
    out += &figures(content, &["claims"]);
    out + &table(content, "claims")
}

/// Charts that are higher than some screens are folded: of hundreds of rows one looks up a few.
const TALL: f64 = 2200.0;

fn figures(content: &Content, ids: &[&str]) -> String {
    let mut out = String::new();
    for (figure, svg) in content.figures.iter().zip(content.svgs).filter(|(f, _)| ids.contains(&f.id.as_str())) {
        let id = &figure.id;
        let tall = figure.height > TALL;
        if tall {
            let _ = writeln!(out, "<details class=\"tall\"><summary>{}</summary>", html(&figure.title));
        }
        let _ = writeln!(
            out,
            "<figure id=\"{id}\">\n<div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"{}\">\n{svg}</div>\n\
             <figcaption><b>{}.</b> {} <a href=\"charts/{id}.svg\">SVG</a> <a href=\"charts/{id}.png\">PNG</a></figcaption>\n</figure>",
            html(&figure.title),
            html(&figure.title),
            html(&figure.caption),
        );
        if tall {
            out += "</details>\n";
        }
    }
    out
}

/// The table with links to its files; nothing when it has no rows.
fn table(content: &Content, id: &str) -> String {
    let Some(table) = content.tables.iter().find(|t| t.id == id && !t.rows.is_empty()) else { return String::new() };
    format!(
        "{}<p class=\"note\"><a href=\"tables/{id}.csv\">CSV</a> <a href=\"tables/{id}.md\">Markdown</a> <a href=\"tables/{id}.tex\">LaTeX</a></p>\n",
        table.html()
    )
}

fn methods(content: &Content) -> String {
    let grid = content.grid;
    let mut out = String::new();
    let mut paragraph = |text: &str| {
        let _ = writeln!(out, "<p>{}</p>", html(text));
    };
    paragraph(
        "A trial is one repeat: a child process of its own that loads the scene, builds the structure, warms up and walks \
         the path. The trials of a scene are interleaved by a recorded shuffle. The bootstrap resamples trials, never \
         frames: frames of one walk depend on each other. Of medians its interval is computed over all resamples, of ratios \
         drawn from 10,000 of them, with a fixed seed.",
    );
    for protocol in protocols(grid) {
        paragraph(&protocol);
    }
    paragraph(&format!(
        "{} Modelled numbers are always labelled so; everything else is measured, counted, or judged against the truth.",
        charts::model_words(grid)
    ));
    paragraph(
        "Answers are judged apart from timing, on the same submitted sets. A run is wrong when it breaks the promise of \
         its declared class: a conservative method with a proved false cull has its times withheld, while the errors of \
         an aggressive one are its data.",
    );
    out += &table(content, "environment");
    if !grid.results.manifest_toml.trim().is_empty() {
        let _ = writeln!(
            out,
            "<h3>How to reproduce</h3>\n<p>Save the manifest as <code>{name}.toml</code> and run \
             <code>cullmark run {name}.toml</code>.</p>\n<details><summary>Manifest</summary>\n<pre tabindex=\"0\"><code>{}</code></pre></details>",
            html(&grid.results.manifest_toml),
            name = html(&super::format::slug(&grid.results.name)),
        );
    }
    out
}

/// One sentence for each protocol in use.
fn protocols(grid: &Grid) -> Vec<String> {
    let mut out: Vec<String> = Vec::new();
    for run in grid.runs() {
        let (p, a) = (&run.spec.protocol, &run.spec.accuracy);
        let pinned = p.pin_core.map_or_else(|| "not pinned".into(), |c| format!("pinned to core {c}"));
        let judged = if a.frames == 0 {
            "no frame is judged".to_string()
        } else {
            let frames = count(a.frames.into(), "frame", "frames");
            format!(
                "{frames} judged at {} × {} pixels with {} samples each",
                a.width_px,
                a.height_px,
                a.samples * a.samples
            )
        };
        let sentence = format!(
            "Each trial makes {} after {}, {pinned}, {}; a frame's time is the smallest of its passes. Of each path {judged}.",
            count(p.passes.into(), "timed pass", "timed passes"),
            count(p.warmup_passes.into(), "warm-up pass", "warm-up passes"),
            count(p.threads.into(), "thread", "threads"),
        );
        if !out.contains(&sentence) {
            out.push(sentence);
        }
    }
    out
}
