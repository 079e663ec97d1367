//! `[study]`, `[camera]`, `[measure]`, `[accuracy]`, `[model]`.

use super::fields::Fields;
use super::tree::Data;
use super::{Study, Timing};
use crate::error::Error;
use crate::math::{Camera, Projection};
use crate::record::cameras::FOV_Y_DEG;
use crate::record::{Accuracy, RepeatPolicy, TimeModel};
use std::path::Path;

pub fn study(top: &mut Fields, path: &Path) -> Option<Study> {
    let stem = path.file_stem().map_or_else(|| "study".into(), |s| s.to_string_lossy().into_owned());
    let Some(mut f) = top.table("study") else {
        if !top.has("study") {
            top.missing("study", format!("begin with [study] and name = \"{stem}\""));
        }
        return None;
    };
    let name = f.name("name", &format!("name the study, such as name = \"{stem}\""));
    let title = f.text("title").unwrap_or_default().trim().to_string();
    let description = f.text("description").unwrap_or_default().trim().to_string();
    f.finish();
    let name = name?;
    let title = if title.is_empty() { name.clone() } else { title };
    Some(Study { name, title, description })
}

fn positive(x: f64) -> bool {
    x > 0.0 && x.is_finite()
}

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Perspective,
    Orthographic,
}

pub fn camera(top: &mut Fields) -> Option<Camera> {
    let mut camera = Camera::default();
    let Some(mut f) = top.table("camera") else { return (!top.has("camera")).then_some(camera) };
    let kinds = [("perspective", Kind::Perspective), ("orthographic", Kind::Orthographic)];
    let kind = f.choice("projection", &kinds).unwrap_or(Kind::Perspective);
    let fov = f.number("fov_y_deg", "degrees from 0.01 to 179", |x| FOV_Y_DEG.contains(&x));
    let height = f.number("height_m", "metres above 0", positive);
    let misplaced = match kind {
        Kind::Perspective => ("height_m", "orthographic", "fov_y_deg"),
        Kind::Orthographic => ("fov_y_deg", "perspective", "height_m"),
    };
    if let Some(node) = f.get(misplaced.0) {
        let e = Error::new(format!("belongs to an {} camera", misplaced.1).replace("an perspective", "a perspective"));
        f.note(&node.place, misplaced.0, e.help(format!("use {} or projection = \"{}\"", misplaced.2, misplaced.1)));
    }
    match kind {
        Kind::Perspective => {
            let fov_y_rad = fov.unwrap_or(60.0).to_radians();
            camera.projection = Projection::Perspective { fov_y_rad };
        }
        Kind::Orthographic if f.has("height_m") => {
            camera.projection = Projection::Orthographic { height_m: height.unwrap_or(1.0) };
        }
        Kind::Orthographic => f.missing("height_m", "give the full height of the view volume, such as height_m = 20.0"),
    }
    camera.aspect = aspect(&mut f).unwrap_or(camera.aspect);
    camera.near_m = f.number("near_m", "metres above 0", positive).unwrap_or(camera.near_m);
    camera.far_m = far(&mut f);
    if let Some(far_m) = camera.far_m
        && far_m <= camera.near_m
        && let Some(node) = f.get("far_m")
    {
        let e = Error::new(format!("is {far_m}, which is not beyond near_m = {}", camera.near_m));
        f.note(&node.place, "far_m", e.help("give a larger far_m, or \"inf\""));
    }
    f.finish();
    Some(camera)
}

/// `"16:9"` or a number, width over height.
fn aspect(f: &mut Fields) -> Option<f64> {
    let node = f.get("aspect")?;
    let parse = |s: &str| {
        let (w, h) = s.split_once(':')?;
        let (w, h): (f64, f64) = (w.trim().parse().ok()?, h.trim().parse().ok()?);
        (positive(w) && positive(h)).then_some(w / h)
    };
    if let Data::Text(s) = &node.data {
        if let Some(ratio) = parse(s).filter(|r| (0.01..=100.0).contains(r)) {
            return Some(ratio);
        }
        f.note(&node.place, "aspect", Error::new(format!("\"{s}\" is no aspect")).help("write \"16:9\" or 1.78"));
        return None;
    }
    f.number("aspect", "width over height, such as \"16:9\" or 1.78", |x| (0.01..=100.0).contains(&x))
}

/// A number, or `"inf"`.
fn far(f: &mut Fields) -> Option<f64> {
    let node = f.get("far_m")?;
    if node.text() == Some("inf") {
        return None;
    }
    f.number("far_m", "metres above 0, or \"inf\"", |x| x > 0.0).filter(|x| x.is_finite())
}

pub fn measure(top: &mut Fields) -> (RepeatPolicy, Timing) {
    let mut repeat = RepeatPolicy {
        repeats: 5,
        relative_ci: None,
        max_repeats: 30,
        timeout_s: 600.0,
        memory_limit_mib: None,
        seed: 1,
    };
    let mut timing = Timing { passes: 3, warmup_passes: 1, consolidate_frames: 20 };
    let Some(mut f) = top.table("measure") else { return (repeat, timing) };
    repeat.repeats = f.u32("repeats", 1..=10_000).unwrap_or(repeat.repeats);
    repeat.relative_ci = f.number("relative_ci", "a share above 0 and below 1, such as 0.02", |x| x > 0.0 && x < 1.0);
    let max_repeats = f.u32("max_repeats", 1..=10_000);
    repeat.max_repeats = max_repeats.unwrap_or(repeat.max_repeats.max(repeat.repeats));
    repeat.timeout_s = f.number("timeout_s", "seconds above 0", positive).unwrap_or(repeat.timeout_s);
    repeat.memory_limit_mib = f.int("memory_limit_mib", 16..=i64::MAX).map(|i| i as u64);
    repeat.seed = f.int("seed", 0..=i64::MAX).map_or(repeat.seed, |i| i as u64);
    timing.passes = f.u32("passes", 1..=1000).unwrap_or(timing.passes);
    timing.warmup_passes = f.u32("warmup_passes", 0..=1000).unwrap_or(timing.warmup_passes);
    timing.consolidate_frames = f.u32("consolidate_frames", 1..=1_000_000).unwrap_or(timing.consolidate_frames);
    if let Some(node) = f.get("max_repeats").filter(|_| max_repeats.is_some_and(|m| m < repeat.repeats)) {
        let e = Error::new(format!("is {}, fewer than repeats = {}", repeat.max_repeats, repeat.repeats));
        f.note(&node.place, "max_repeats", e.help(format!("give at least {}", repeat.repeats)));
    }
    f.finish();
    (repeat, timing)
}

/// Rays a triangle, and cells to a side: beyond these a frame takes hours.
const MOST_RAYS: u32 = 100_000;
const MOST_CELLS: u32 = 16_384;

pub fn accuracy(top: &mut Fields) -> Accuracy {
    let mut accuracy = Accuracy::default();
    let Some(mut f) = top.table("accuracy") else { return accuracy };
    accuracy.frames = f.u32("frames", 0..=1_000_000).unwrap_or(accuracy.frames);
    accuracy.width_px = f.u32("width_px", 1..=16_384).unwrap_or(accuracy.width_px);
    accuracy.height_px = f.u32("height_px", 1..=16_384).unwrap_or(accuracy.height_px);
    accuracy.samples = f.u32("samples", 1..=16).unwrap_or(accuracy.samples);
    accuracy.witness_rays = f.u32("witness_rays", 0..=MOST_RAYS).unwrap_or(accuracy.witness_rays);
    accuracy.hiding_cells = f.u32("hiding_cells", 0..=MOST_CELLS).unwrap_or(accuracy.hiding_cells);
    f.finish();
    accuracy
}

pub fn model(top: &mut Fields) -> TimeModel {
    let mut model = TimeModel::default();
    let Some(mut f) = top.table("model") else { return model };
    let fits = |x: f64| x >= 0.0 && x.is_finite();
    model.index_ns = f.number("index_ns", "nanoseconds, 0 or more", fits).unwrap_or(model.index_ns);
    model.draw_call_ns = f.number("draw_call_ns", "nanoseconds, 0 or more", fits).unwrap_or(model.draw_call_ns);
    model.frame_ns = f.number("frame_ns", "nanoseconds, 0 or more", fits).unwrap_or(model.frame_ns);
    model.cull_scale = f.number("cull_scale", "a factor, 0 or more", fits).unwrap_or(model.cull_scale);
    f.finish();
    model
}
