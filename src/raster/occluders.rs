//! The triangles that hide, by position in the order of a hierarchy's entries.
//!
//! They are kept in batches of up to 128 in a row: a few vertices in fixed point about
//! the batch's own origin, and four bytes a triangle. A step of the fixed point is
//! a power of two, so vertices on a grid are kept as they are; how far the others move is measured.

use super::pairs;
use super::vertices::Batch;
use crate::math::DVec3;
use crate::scene::Scene;
use rayon::prelude::*;
use std::collections::HashMap;
use std::sync::Arc;

/// What a position hides with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Seen through: hides nothing.
    Clear,
    /// Its front hides; seen from behind it is not drawn.
    OneSided,
    TwoSided,
}

impl Kind {
    /// Of a triangle of a scene.
    pub fn of(scene: &Scene, triangle: u32) -> Kind {
        match (scene.occluder[triangle as usize], scene.two_sided[triangle as usize]) {
            (false, _) => Kind::Clear,
            (true, false) => Kind::OneSided,
            (true, true) => Kind::TwoSided,
        }
    }
}

const MOST: usize = 128;
const ENOUGH: usize = 16;
const MOST_VERTICES: usize = 256;

/// Occluders about a common origin. A clone shares them.
#[derive(Debug, Clone, Default)]
pub struct Occluders {
    store: Arc<Store>,
}

#[derive(Debug, Default)]
pub(super) struct Store {
    batches: Vec<Place>,
    /// Batch of every position that is a multiple of 64, or one before it.
    near_batch: Vec<u32>,
    x: Vec<i32>,
    y: Vec<i32>,
    z: Vec<i32>,
    /// Corners in the batch and kind of a position; 16 spare ones, so that wide loads may start at the last.
    words: Vec<u32>,
    /// See `pairs`.
    partners: Vec<i8>,
    /// Of positions before this one, how many hide.
    hiding: Vec<u32>,
    /// Bounds of all that hides.
    lo: DVec3,
    hi: DVec3,
}

#[derive(Debug, Clone, Copy)]
struct Place {
    first: u32,
    vertices: u32,
    count: u32,
    origin: DVec3,
    step_m: f64,
    off_m: f64,
}

impl Occluders {
    /// Of `count` positions with world-space `corners` and `kind`. `starts` are positions,
    /// ascending, at which ranges that are drawn usually begin (the leaves); triangles pair
    /// between two of them only, so that a leaf drawn whole is drawn alike however calls are cut.
    pub fn new(
        count: u32,
        origin: DVec3,
        corners: impl Fn(u32) -> [DVec3; 3] + Sync,
        kind: impl Fn(u32) -> Kind + Sync,
        starts: &[u32],
    ) -> Occluders {
        let cuts = cut(count, starts);
        let corners = |p: u32| corners(p).map(|c| c - origin);
        let far_m = origin.abs().max_element();
        let make = |w: &[u32]| Made::all(w[0], w[1], &corners, &kind, far_m);
        let made: Vec<Made> = cuts.par_windows(2).flat_map_iter(make).collect();
        let mut s = Store { lo: DVec3::INFINITY, hi: DVec3::NEG_INFINITY, hiding: vec![0], ..Default::default() };
        for mut m in made {
            m.part(starts);
            s.near_batch.resize((m.place.first as usize).div_ceil(64), s.batches.len().saturating_sub(1) as u32);
            let vertices = s.x.len() as u32;
            s.batches.push(Place { vertices, ..m.place });
            let padded = m.vertices.len().div_ceil(8) * 8;
            for (column, axis) in [(&mut s.x, 0), (&mut s.y, 1), (&mut s.z, 2)] {
                column.extend(m.vertices.iter().map(|v| v[axis]));
                column.resize(vertices as usize + padded, 0);
            }
            for word in m.words {
                s.hiding.push(s.hiding.last().unwrap_or(&0) + u32::from(word >> 24 != 0));
                s.words.push(word);
            }
            s.partners.extend(m.partners);
            (s.lo, s.hi) = (s.lo.min(m.lo), s.hi.max(m.hi));
        }
        s.near_batch.resize((count as usize).div_ceil(64) + 1, s.batches.len().saturating_sub(1) as u32);
        s.words.resize(count as usize + 16, 0);
        Occluders { store: Arc::new(s) }
    }

    pub fn len(&self) -> usize {
        self.store.hiding.len().saturating_sub(1)
    }

    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    pub fn bytes(&self) -> usize {
        let s = &self.store;
        12 * s.x.len()
            + s.partners.len()
            + 4 * (s.words.len() + s.hiding.len() + s.near_batch.len())
            + s.batches.len() * size_of::<Place>()
    }

    /// Corners relative to the origin, as they are kept: to 2^-31 of their batch's extent.
    pub fn corners(&self, position: u32) -> [DVec3; 3] {
        let b = self.store.batch_of(position);
        let (batch, _) = self.store.batch(b);
        self.store.fixed(b, position).map(|q| batch.origin + DVec3::from_array(q.map(f64::from)) * batch.step_m)
    }

    pub fn kind(&self, position: u32) -> Kind {
        match self.store.words[position as usize] >> 24 {
            0 => Kind::Clear,
            1 => Kind::OneSided,
            _ => Kind::TwoSided,
        }
    }

    /// How many of a range hide.
    pub fn hiding(&self, first: u32, end: u32) -> u32 {
        if first >= end { 0 } else { self.store.hiding[end as usize] - self.store.hiding[first as usize] }
    }

    /// Bounds of all that hides, relative to the origin.
    pub fn bounds(&self) -> (DVec3, DVec3) {
        (self.store.lo, self.store.hi)
    }

    pub(super) fn store(&self) -> &Arc<Store> {
        &self.store
    }
}

impl Store {
    pub fn batch_of(&self, position: u32) -> usize {
        let mut b = self.near_batch[position as usize / 64] as usize;
        while b + 1 < self.batches.len() && self.batches[b + 1].first <= position {
            b += 1;
        }
        b
    }

    /// A batch and its positions.
    pub fn batch(&self, b: usize) -> (Batch<'_>, std::ops::Range<u32>) {
        let p = &self.batches[b];
        let end = self.batches.get(b + 1).map_or(self.hiding.len() as u32 - 1, |next| next.first);
        let range = p.vertices as usize..p.vertices as usize + (p.count as usize).div_ceil(8) * 8;
        let (x, y, z) = (&self.x[range.clone()], &self.y[range.clone()], &self.z[range]);
        (Batch { x, y, z, origin: p.origin, step_m: p.step_m, off_m: p.off_m }, p.first..end)
    }

    /// Corners of a position in its batch's fixed point.
    pub fn fixed(&self, b: usize, position: u32) -> [[i32; 3]; 3] {
        let (first, word) = (self.batches[b].vertices as usize, self.words[position as usize]);
        std::array::from_fn(|k| {
            let i = first + (word >> (8 * k) & 0xff) as usize;
            [self.x[i], self.y[i], self.z[i]]
        })
    }

    /// Of those of `count` positions from `first` on whose partners are in `range`: lanes
    /// of the first of two, and of both.
    pub fn pairs(&self, first: u32, count: u32, range: std::ops::Range<u32>) -> (u32, u32) {
        let (mut firsts, mut both) = (0, 0);
        for (i, p) in (first..first + count).enumerate() {
            let step = i64::from(self.partners[p as usize]);
            let partner = i64::from(p) + step;
            if step != 0 && i64::from(range.start) <= partner && partner < i64::from(range.end) {
                both |= 1 << i;
                firsts |= u32::from(step > 0) << i;
            }
        }
        (firsts, both)
    }

    /// Corners of a position and its partner, of the two together.
    pub fn fixed_pair(&self, b: usize, position: u32) -> Option<[[i32; 3]; 4]> {
        let first = self.batches[b].vertices as usize;
        let corners = |p: u32| std::array::from_fn(|k| (self.words[p as usize] >> (8 * k) & 0xff) as usize);
        let partner = position.checked_add_signed(i32::from(self.partners[position as usize]))?;
        let quad = pairs::joined(corners(position), corners(partner))?;
        Some(quad.map(|i| [self.x[first + i], self.y[first + i], self.z[first + i]]))
    }

    pub fn words(&self) -> &[u32] {
        &self.words
    }
}

/// Positions at which batches begin, and `count`: at a start if enough are together, else at the most.
fn cut(count: u32, starts: &[u32]) -> Vec<u32> {
    let mut cuts = vec![0];
    let mut starts = starts.iter().copied().filter(|s| *s < count).peekable();
    let mut at = 0;
    while at < count {
        let mut end = at + MOST as u32;
        while let Some(start) = starts.next_if(|s| *s <= at + MOST as u32) {
            if start >= at + ENOUGH as u32 {
                end = start;
                break;
            }
        }
        at = end.min(count);
        cuts.push(at);
    }
    cuts
}

/// A batch as it is made.
struct Made {
    place: Place,
    vertices: Vec<[i32; 3]>,
    words: Vec<u32>,
    partners: Vec<i8>,
    lo: DVec3,
    hi: DVec3,
}

impl Made {
    /// Of a range, halved until a byte can name its vertices.
    fn all(
        first: u32,
        end: u32,
        corners: &impl Fn(u32) -> [DVec3; 3],
        kind: &impl Fn(u32) -> Kind,
        far_m: f64,
    ) -> Vec<Made> {
        let made = Made::new(first, end, corners, kind, far_m);
        if made.vertices.len() <= MOST_VERTICES {
            return vec![made];
        }
        let middle = first + (end - first) / 2;
        let mut halves = Made::all(first, middle, corners, kind, far_m);
        halves.extend(Made::all(middle, end, corners, kind, far_m));
        halves
    }

    fn new(
        first: u32,
        end: u32,
        corners: &impl Fn(u32) -> [DVec3; 3],
        kind: &impl Fn(u32) -> Kind,
        far_m: f64,
    ) -> Made {
        let corners: Vec<[DVec3; 3]> = (first..end).map(corners).collect();
        // What is no place in space hides nothing.
        let sane = |c: &[DVec3; 3]| c.iter().all(|p| p.is_finite() && p.abs().max_element() < 1e15);
        let hides = |i: usize| kind(first + i as u32) != Kind::Clear && sane(&corners[i]);
        let used = || (0..corners.len()).filter(|i| hides(*i)).flat_map(|i| corners[i]);
        let lo = used().fold(DVec3::INFINITY, DVec3::min);
        let hi = used().fold(DVec3::NEG_INFINITY, DVec3::max);
        let empty = lo.x > hi.x;
        let (origin, extent) = if empty { (DVec3::ZERO, 0.0) } else { ((lo + hi) * 0.5, (hi - lo).max_element()) };
        // A little more than half the extent on either side of the origin; the origin is on the grid.
        let step_m = power_of_two_above((extent * 0.5000001 / f64::from(i32::MAX)).max(1e-30));
        let origin = (origin / step_m).round() * step_m;
        let mut vertices: Vec<[i32; 3]> = Vec::new();
        let mut known: HashMap<[u64; 3], u32> = HashMap::new();
        let mut off_m = 0.0f64;
        let mut words = vec![0; corners.len()];
        for i in (0..corners.len()).filter(|i| hides(*i)) {
            let mut word = (kind(first + i as u32) as u32) << 24;
            for (k, p) in corners[i].iter().enumerate() {
                let id = *known.entry(p.to_array().map(f64::to_bits)).or_insert_with(|| {
                    let q = ((*p - origin) / step_m).round();
                    let fixed = q.to_array().map(|q| q as i32);
                    let kept = origin + DVec3::from_array(fixed.map(f64::from)) * step_m;
                    off_m = off_m.max((kept - *p).abs().max_element());
                    vertices.push(fixed);
                    vertices.len() as u32 - 1
                });
                word |= id << (8 * k);
            }
            words[i] = word;
        }
        // f64 itself rounds by 1 of these; corners of split triangles are off their edges by 256.
        let size = if empty { 0.0 } else { lo.abs().max(hi.abs()).max_element() };
        let off_m = off_m + (size + far_m) * (512.0 * f64::EPSILON);
        let place = Place { first, vertices: 0, count: vertices.len() as u32, origin, step_m, off_m };
        let partners = if vertices.len() <= MOST_VERTICES { pairs::of(&words, &corners) } else { Vec::new() };
        Made { place, vertices, words, partners, lo, hi }
    }

    /// Parts what a start lies between.
    fn part(&mut self, starts: &[u32]) {
        let leaf = |i: usize| starts.partition_point(|s| *s <= self.place.first + i as u32);
        for i in 0..self.partners.len() {
            let on = self.partners[i];
            if on > 0 && leaf(i) != leaf(i + on as usize) {
                (self.partners[i], self.partners[i + on as usize]) = (0, 0);
            }
        }
    }
}

fn power_of_two_above(x: f64) -> f64 {
    let floor = f64::from_bits(x.to_bits() & !((1 << 52) - 1));
    if floor < x { floor * 2.0 } else { floor }
}
