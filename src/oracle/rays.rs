//! Witness rays: aimed at every triangle that no sample sees, they find what is
//! visible between the samples. Also: which surfaces tie at one place.
//!
//! All rays of a view are points of the image plane, so what a ray meets is looked
//! up in a tree over the rectangles of the occluders on the image (medians, as in
//! a kd-tree), with the nearest depth below every node.
//!
//! A ray is a witness only if with certainty (bounds of [`super::outline`]) it
//! passes inside the triangle, between the clip planes, and no occluder can be
//! nearer by more than [`TIE`]. Triangles that may be equally near are named with
//! it: neither can be proved lost while another of them is submitted. As in the
//! item buffer the smallest index stands for all.
//!
//! Aims are spread by a golden-ratio sequence (Roberts, "The Unreasonable
//! Effectiveness of Quasirandom Sequences", 2018) shifted by a hash of the triangle
//! (SplitMix64: Steele, Lea & Flood 2014): the same on every machine and at any
//! number of threads.

use super::item_buffer::TIE;
use super::outline::{Outline, Rect, Screen};
use crate::math::{DVec3, View};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// A triangle that a ray sees, and those that may be seen in its place.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Witness {
    pub triangle: u32,
    /// Ascending; all larger than `triangle`.
    pub tied: Vec<u32>,
}

/// Aims `rays` rays at each candidate (an outline and its corners in camera
/// space); those that are seen, in the order given.
pub fn witnesses(
    screen: &Screen,
    view: &View,
    index: &Index,
    candidates: &[(&Outline, [DVec3; 3])],
    rays: u32,
) -> Vec<Witness> {
    let found: Vec<Option<Witness>> = candidates
        .par_iter()
        .map_init(Vec::new, |stack, (outline, corners)| {
            let aims = Aims::new(screen, view, outline.triangle, corners)?;
            (0..rays).find_map(|i| index.sees(screen, outline, aims.at(i), stack))
        })
        .collect();
    found.into_iter().flatten().collect()
}

/// A tree over the occluders of a frame.
pub struct Index<'a> {
    outlines: &'a [Outline],
    nodes: Vec<Node>,
    /// Indices into `outlines`, by leaf.
    items: Vec<u32>,
}

#[derive(Clone, Copy)]
struct Node {
    rect: Rect,
    key_max: f64,
    /// Leaf: items `first..first + count`; else children `first` and `first + 1`.
    first: u32,
    count: u32,
}

const LEAF: usize = 6;

impl<'a> Index<'a> {
    pub fn new(screen: &Screen, outlines: &'a [Outline]) -> Index<'a> {
        let items = (0..outlines.len() as u32).filter(|i| outlines[*i as usize].occluder).collect();
        let mut index = Index { outlines, nodes: Vec::new(), items };
        let empty = Node { rect: Rect::EVERYTHING, key_max: f64::NEG_INFINITY, first: 0, count: 0 };
        index.nodes.push(empty);
        let mut pending = vec![(0usize, 0usize, index.items.len())];
        while let Some((node, first, end)) = pending.pop() {
            index.fill(screen, node, first, end);
            if end - first <= LEAF {
                continue;
            }
            let rect = index.nodes[node].rect;
            let wide = rect.x[1] - rect.x[0] >= rect.y[1] - rect.y[0];
            let middle = |i: &u32| {
                let c = outlines[*i as usize].rect.meet(&screen.image).centre();
                if wide { c[0] } else { c[1] }
            };
            let half = (first + end) / 2;
            index.items[first..end]
                .select_nth_unstable_by(half - first, |a, b| middle(a).total_cmp(&middle(b)).then(a.cmp(b)));
            let children = index.nodes.len();
            index.nodes.extend([empty; 2]);
            (index.nodes[node].first, index.nodes[node].count) = (children as u32, 0);
            pending.extend([(children, first, half), (children + 1, half, end)]);
        }
        index
    }

    fn fill(&mut self, screen: &Screen, node: usize, first: usize, end: usize) {
        let of = |i: &u32| &self.outlines[*i as usize];
        let items = &self.items[first..end];
        let rect = items.iter().map(|i| of(i).rect.meet(&screen.image)).reduce(|a, b| a.join(&b));
        let key_max = items.iter().map(|i| of(i).key_max).fold(f64::NEG_INFINITY, f64::max);
        let rect = rect.unwrap_or(Rect::EVERYTHING);
        self.nodes[node] = Node { rect, key_max, first: first as u32, count: (end - first) as u32 };
    }

    /// Visits the occluders that may hold the point and come as near as `key`,
    /// nearer subtrees first, until `visit` says stop.
    fn visit(&self, at: [f64; 2], key: f64, stack: &mut Vec<u32>, mut visit: impl FnMut(&Outline) -> bool) {
        stack.clear();
        stack.push(0);
        while let Some(node) = stack.pop() {
            let node = &self.nodes[node as usize];
            if node.key_max < key || !node.rect.holds(at) {
                continue;
            }
            if node.count == 0 && node.first > 0 {
                let (a, b) = (node.first, node.first + 1);
                let a_first = self.nodes[a as usize].key_max >= self.nodes[b as usize].key_max;
                stack.extend(if a_first { [b, a] } else { [a, b] });
                continue;
            }
            for i in &self.items[node.first as usize..(node.first + node.count) as usize] {
                let o = &self.outlines[*i as usize];
                if o.key_max >= key && !o.misses(at) && !visit(o) {
                    return;
                }
            }
        }
    }

    /// Whether the ray through `at` is a witness of `t`.
    fn sees(&self, screen: &Screen, t: &Outline, at: [f64; 2], stack: &mut Vec<u32>) -> Option<Witness> {
        if !t.covers(at) || !screen.image.holds(at) {
            return None;
        }
        let [low, high] = t.key_at(at);
        if high > screen.key_clear() || low < screen.key_far + 1e-12 * screen.key_far.abs() {
            return None;
        }
        let (mut seen, mut tied) = (true, Vec::new());
        // Twice the tie leaves room for the rounding of the item buffer's own keys.
        self.visit(at, low - 2.0 * TIE * low.abs(), stack, |o| {
            if o.triangle == t.triangle {
                return true;
            }
            let [o_low, o_high] = o.key_at(at);
            // Cut away by the near plane.
            if o_low > screen.key_near + 1e-12 * screen.key_near.abs() {
                return true;
            }
            if o_high < low - 2.0 * TIE * low.abs() {
                return true;
            }
            if o_high > low + 0.5 * TIE * low.abs() || !t.occluder || o.triangle < t.triangle {
                seen = false;
                return false;
            }
            tied.push(o.triangle);
            true
        });
        tied.sort_unstable();
        seen.then_some(Witness { triangle: t.triangle, tied })
    }

    /// Occluders that may be as near as `t` is at a point, `t` itself left out, by
    /// a generous measure: to be read as "perhaps these, certainly no others".
    pub fn ties(&self, t: &Outline, at: [f64; 2], stack: &mut Vec<u32>, tied: &mut Vec<u32>) {
        let [low, high] = t.key_at(at);
        let slack = 8.0 * TIE * low.abs().max(high.abs());
        self.visit(at, low - slack, stack, |o| {
            if o.triangle != t.triangle && o.key_at(at)[0] <= high + slack && o.key_at(at)[1] >= low - slack {
                tied.push(o.triangle);
            }
            true
        });
    }
}

/// Points of the visible part of one triangle's plane: its image cut to the view
/// volume, as a fan of triangles with running areas.
struct Aims {
    corners: Vec<[f64; 2]>,
    areas: Vec<f64>,
    shift: [f64; 3],
}

impl Aims {
    fn new(screen: &Screen, view: &View, triangle: u32, corners: &[DVec3; 3]) -> Option<Aims> {
        let mut polygon = corners.to_vec();
        let depth = |c: DVec3| if screen.perspective { c.z } else { 1.0 };
        let far = view.camera.far_m.unwrap_or(f64::INFINITY);
        // A little inside: aims on the border could not be told to be inside.
        let (w, h) = (view.half_width * (1.0 - 1e-9), view.half_height * (1.0 - 1e-9));
        let near = screen.near_m * (1.0 + 1e-9);
        polygon = cut(&polygon, |c| c.z - near);
        if far.is_finite() {
            polygon = cut(&polygon, |c| far * (1.0 - 1e-9) - c.z);
        }
        polygon = cut(&polygon, |c| w * depth(c) - c.x);
        polygon = cut(&polygon, |c| w * depth(c) + c.x);
        polygon = cut(&polygon, |c| h * depth(c) - c.y);
        polygon = cut(&polygon, |c| h * depth(c) + c.y);
        let corners: Vec<[f64; 2]> = polygon.iter().map(|c| [c.x / depth(*c), c.y / depth(*c)]).collect();
        let mut sum = 0.0;
        let areas = (2..corners.len()).map(|i| {
            let [a, b, c] = [corners[0], corners[i - 1], corners[i]];
            sum += ((b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1])).abs();
            sum
        });
        let areas: Vec<f64> = areas.collect();
        if areas.last().is_none_or(|a| *a <= 0.0) {
            return None;
        }
        let mut state = u64::from(triangle);
        let shift = [0; 3].map(|_| unit(&mut state));
        Some(Aims { corners, areas, shift })
    }

    /// Aim `i`, spread evenly over the image of the triangle.
    fn at(&self, i: u32) -> [f64; 2] {
        // Powers of the inverse of the root of g^4 = g + 1.
        const STEPS: [f64; 3] = [0.819_172_513_396_164_4, 0.671_043_606_703_789_2, 0.549_700_477_901_970_3];
        let [pick, mut u, mut v] = [0, 1, 2].map(|k| (self.shift[k] + f64::from(i) * STEPS[k]).fract());
        let total = self.areas[self.areas.len() - 1];
        let fan = self.areas.partition_point(|a| *a < pick * total).min(self.areas.len() - 1);
        let [a, b, c] = [self.corners[0], self.corners[fan + 1], self.corners[fan + 2]];
        if u + v > 1.0 {
            (u, v) = (1.0 - u, 1.0 - v);
        }
        [0, 1].map(|k| a[k] + (b[k] - a[k]) * u + (c[k] - a[k]) * v)
    }
}

/// The part of a convex polygon where `distance` is not negative (Sutherland & Hodgman 1974).
fn cut(polygon: &[DVec3], distance: impl Fn(DVec3) -> f64) -> Vec<DVec3> {
    let mut out = Vec::with_capacity(polygon.len() + 1);
    for (i, a) in polygon.iter().enumerate() {
        let b = polygon[(i + 1) % polygon.len()];
        let (da, db) = (distance(*a), distance(b));
        if da >= 0.0 {
            out.push(*a);
        }
        if (da >= 0.0) != (db >= 0.0) {
            out.push(*a + (b - *a) * (da / (da - db)));
        }
    }
    out
}

/// SplitMix64 as a number in 0..1.
fn unit(state: &mut u64) -> f64 {
    *state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
    let mut z = *state;
    z = (z ^ z >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ z >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
    ((z ^ z >> 31) >> 11) as f64 / (1u64 << 53) as f64
}
