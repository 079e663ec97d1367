//! The picture of an inspected frame: what the camera shows of the submitted set
//! on the left, a plan with the view volume's outline on the right.

use crate::error::Result;
use crate::math::{Aabb, DVec3, View};
use crate::oracle::{BitSet, Losses};
use crate::preview::{Image, Look, Style, draw_line, plan, render, write_png};
use crate::scene::Scene;
use std::path::Path;

const HEIGHT: u32 = 720;
const GAP: u32 = 8;
const LOST: [u8; 3] = [226, 28, 28];
/// Not the colours of materials: some of those are red.
const SUBMITTED: [u8; 3] = [118, 156, 196];
const HIDDEN: [u8; 3] = [214, 130, 20];
const OUTLINE: [u8; 3] = [24, 32, 72];

/// Submitted triangles blue, lost ones red; on the plan what was
/// not submitted is pale, and boxes of hidden nodes are framed.
pub fn write(
    file: &Path,
    scene: &Scene,
    view: &View,
    submitted: &BitSet,
    losses: &Losses,
    hidden: &[Aabb],
) -> Result<()> {
    let mut lost = BitSet::new(scene.len());
    losses.seen.iter().chain(&losses.hidden).for_each(|t| lost.insert(*t));
    let look = |t: u32, rest: Look| {
        if lost.contains(t) {
            Look::Tint(LOST)
        } else if submitted.contains(t) {
            Look::Tint(SUBMITTED)
        } else {
            rest
        }
    };
    let camera_look = |t| look(t, Look::Hidden);
    let plan_look = |t| look(t, Look::Ghost);
    let width = (f64::from(HEIGHT) * view.camera.aspect).round().clamp(1.0, 4096.0) as u32;
    let style = Style { shadows: false, look: Some(&camera_look), ..Style::default() };
    let left = render(scene, view, width, HEIGHT, &style);

    let bounds = scene.bounds().with(view.eye);
    let above = plan(&bounds, 1.0);
    // Rooms are looked into from above the eye; open ground keeps its heights.
    let cut_above_m = (view.eye.z + 1.0 < bounds.hi.z).then_some(view.eye.z + 1.0);
    let style = Style { shadows: false, look: Some(&plan_look), cut_above_m, ..Style::default() };
    let mut right = render(scene, &above, HEIGHT, HEIGHT, &style);
    for b in hidden {
        let corner = |x: f64, y: f64| level(DVec3::new(x, y, 0.0), &bounds);
        let ring = [
            corner(b.lo.x, b.lo.y),
            corner(b.hi.x, b.lo.y),
            corner(b.hi.x, b.hi.y),
            corner(b.lo.x, b.hi.y),
            corner(b.lo.x, b.lo.y),
        ];
        draw_line(&mut right, &above, &ring, HIDDEN);
    }
    outline(&mut right, &above, view, &bounds);
    write_png(file, &beside(&left, &right))
}

/// The footprint of the view volume, from near to far or the end of the plan.
fn outline(image: &mut Image, above: &View, view: &View, bounds: &Aabb) {
    let far = view.camera.far_m.unwrap_or(f64::INFINITY).min(bounds.size().length() * 1.5);
    let corner = |depth: f64, x: f64, y: f64| {
        let spread = if view.is_perspective() { depth } else { 1.0 };
        let aside = view.right * (x * view.half_width) + view.up * (y * view.half_height);
        level(view.eye + view.forward * depth + aside * spread, bounds)
    };
    for y in [-1.0, 1.0] {
        let near = view.camera.near_m;
        let ring = [corner(far, -1.0, y), corner(near, -1.0, y), corner(near, 1.0, y), corner(far, 1.0, y)];
        draw_line(image, above, &ring, OUTLINE);
    }
    // A cross at the eye, two hundredths of the plan wide.
    let arm = above.half_height * 0.02;
    for axis in [DVec3::X, DVec3::Y] {
        let ends = [view.eye - axis * arm, view.eye + axis * arm].map(|p| level(p, bounds));
        draw_line(image, above, &ends, LOST);
    }
}

/// Lines are drawn at the top of the scene: those above the plan's camera would be
/// cut away.
fn level(p: DVec3, bounds: &Aabb) -> DVec3 {
    DVec3::new(p.x, p.y, bounds.hi.z)
}

fn beside(left: &Image, right: &Image) -> Image {
    let width = left.width + GAP + right.width;
    let mut rgba = Vec::with_capacity((width * left.height * 4) as usize);
    for y in 0..left.height as usize {
        let row = |image: &Image| y * image.width as usize * 4..(y + 1) * image.width as usize * 4;
        rgba.extend_from_slice(&left.rgba[row(left)]);
        rgba.extend(std::iter::repeat_n(255, GAP as usize * 4));
        rgba.extend_from_slice(&right.rgba[row(right)]);
    }
    Image { width, height: left.height, rgba }
}
