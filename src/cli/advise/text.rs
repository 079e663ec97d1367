//! An advice for people.

use crate::advice::{Advice, Considered, Objective};
use crate::report::format::count;

/// The whole of it; without `all` the twelve best predicted.
pub fn of(advice: &Advice, scene: &str, path: &str, frames: usize, all: bool) -> String {
    let f = &advice.features;
    let percent = |x: f64| format!("{:.0} %", 100.0 * x);
    let mut out = format!(
        "{scene}: {} triangles, {path}: {}, {} of them counted and {} timed\n\
         {} of the area is axis-aligned, {:.1} front faces behind a pixel, {} of the triangles in view \
         ({} of those face the eye), normals of 64 neighbours fill {} of a mask, {:.2} octree cells a triangle\n",
        f.triangles,
        count(frames as u64, "frame", "frames"),
        advice.probe.len(),
        advice.timed.len(),
        percent(f.axis_aligned),
        f.depth_complexity,
        percent(f.in_view),
        percent(f.facing),
        percent(f.mask_fill),
        f.straddling,
    );
    out += &match advice.one_in {
        1 => "predicted from counts on the scene itself\n\n".to_string(),
        n => format!("predicted from counts on {} triangles, one in {n}\n\n", advice.sample_triangles),
    };
    let of = match advice.objective {
        Objective::Frame => "modelled us",
        Objective::Cull => "timed us",
    };
    out += &format!(
        "{:<54} {:>12} {:>11} {:>9} {:>10} {:>7} {:>9} {:>8}\n",
        "combination", "predicted us", of, "culled us", "triangles", "calls", "build ms", "MiB"
    );
    let us = |ns: f64| format!("{:.1}", ns / 1e3);
    let shown = if all { advice.considered.len() } else { 12 };
    for (i, c) in advice.considered.iter().enumerate().filter(|(_, c)| c.predicted_ns.is_some()).take(shown) {
        out += &row(c, i == advice.chosen, &us);
    }
    let left: Vec<&Considered> = advice.considered.iter().filter(|c| c.left_out.is_some()).collect();
    if !left.is_empty() {
        out += "\nleft out:\n";
        let mut told: Vec<(String, usize, &str)> = Vec::new();
        for c in left {
            let why = c.left_out.as_deref().unwrap_or_default();
            match told.iter_mut().find(|(_, _, w)| *w == why) {
                Some((_, more, _)) => *more += 1,
                None => told.push((c.label.clone(), 0, why)),
            }
        }
        for (label, more, why) in told {
            let more = if more > 0 { format!(" and {more} more") } else { String::new() };
            out += &format!("  {label}{more}: {why}\n");
        }
    }
    let chosen = &advice.considered[advice.chosen];
    out += &format!("\nuse {}\n", chosen.label);
    advice.why.iter().for_each(|w| out += &format!("  {w}\n"));
    out
}

fn row(c: &Considered, chosen: bool, us: &dyn Fn(f64) -> String) -> String {
    let mark = if chosen { "*" } else { " " };
    let predicted = c.predicted_ns.map(us).unwrap_or_default();
    let (timed, cull, triangles, calls, build, mib) = match (&c.timed, &c.predicted) {
        (Some(t), _) => (
            us(t.objective_ns),
            us(t.cull_ns),
            format!("{:.0}", t.counts.entries),
            format!("{:.0}", t.counts.draw_calls),
            format!("{:.1}", t.build_ns / 1e6),
            format!("{:.1}", t.bytes as f64 / (1 << 20) as f64),
        ),
        (None, Some(p)) => (
            String::new(),
            String::new(),
            format!("{:.0}", p.entries),
            format!("{:.0}", p.draw_calls),
            String::new(),
            String::new(),
        ),
        (None, None) => Default::default(),
    };
    format!(
        "{mark} {:<52} {predicted:>12} {timed:>11} {cull:>9} {triangles:>10} {calls:>7} {build:>9} {mib:>8}\n",
        c.label
    )
}
