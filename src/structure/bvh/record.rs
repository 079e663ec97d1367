//! What a build moves about: the box of a triangle, its number and its material in 32
//! bytes, one AVX register.
//!
//! The lower corner is kept negated, so that the union of two boxes is one `max` of
//! all lanes and twice the centroid is one difference of the halves. Zeros are made
//! positive in both halves: `max` of zeros with two signs would depend on the processor.

use super::kernel::Kernel;
use super::pages::Arena;
use crate::math::{Box32, Vec3};
use crate::scene::Scene;
use rayon::prelude::*;

/// `-lo`, a word, `hi`, a word.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C, align(32))]
pub struct Record(pub [f32; 8]);

/// A box in the same form; its two words mean nothing, and no word of a triangle gets there.
pub type Span = Record;

/// Lane of the triangle's number.
const TRIANGLE: usize = 3;
/// Lane of its material.
const MATERIAL: usize = 7;

impl Record {
    pub const EMPTY: Span = {
        const NONE: f32 = f32::NEG_INFINITY;
        Record([NONE, NONE, NONE, 0.0, NONE, NONE, NONE, 0.0])
    };

    pub fn new(bounds: Box32, triangle: u32, material: u32) -> Record {
        let (lo, hi) = (bounds.lo, bounds.hi);
        // `0 - x` and `x + 0` are never the negative zero.
        let n = [0.0 - lo.x, 0.0 - lo.y, 0.0 - lo.z];
        let p = [hi.x + 0.0, hi.y + 0.0, hi.z + 0.0];
        Record([n[0], n[1], n[2], f32::from_bits(triangle), p[0], p[1], p[2], f32::from_bits(material)])
    }

    pub fn triangle(&self) -> u32 {
        self.0[TRIANGLE].to_bits()
    }

    /// Orders a leaf: by material, ties by number.
    pub fn key(&self) -> u64 {
        u64::from(self.0[MATERIAL].to_bits()) << 32 | u64::from(self.triangle())
    }

    /// The box alone.
    #[inline]
    pub fn bare(mut self) -> Span {
        (self.0[TRIANGLE], self.0[MATERIAL]) = (0.0, 0.0);
        self
    }

    /// Twice the centre of the box on one axis.
    #[inline]
    pub fn centre2(&self, axis: usize) -> f32 {
        self.0[4 + axis] - self.0[axis]
    }

    #[inline]
    pub fn union(self, o: Record) -> Span {
        let (a, b) = (self.0, o.0);
        Record(std::array::from_fn(|i| larger(a[i], b[i])))
    }

    pub fn bounds(&self) -> Box32 {
        let v = &self.0;
        Box32 { lo: Vec3::new(-v[0], -v[1], -v[2]), hi: Vec3::new(v[4], v[5], v[6]) }
    }

    /// Whether this is the box of nothing, or not known yet.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.0[0] == f32::NEG_INFINITY
    }

    /// Half the surface of a box that is not empty.
    #[inline]
    pub fn half_area(&self) -> f32 {
        let e = |axis: usize| self.0[4 + axis] + self.0[axis];
        (e(0) * e(1) + e(1) * e(2)) + e(2) * e(0)
    }
}

/// `max` as the instruction has it: the second operand unless the first is larger.
#[inline]
pub fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// Records of all triangles, in scene order.
pub fn records(scene: &Scene, kernel: Kernel) -> Arena {
    let mut all = Arena::zeroed(scene.len());
    all.par_chunks_mut(CHUNK).enumerate().for_each(|(i, chunk)| kernel.records(scene, (i * CHUNK) as u32, chunk));
    all
}

/// Records that a task makes.
const CHUNK: usize = 1 << 13;

/// The records of the triangles from `first` on.
pub fn make(scene: &Scene, first: u32, out: &mut [Record]) {
    for (t, out) in (first..).zip(out) {
        *out = Record::new(scene.triangle_box(t), t, scene.material_id[t as usize]);
    }
}

/// Writes the keys of a leaf's records in order: by material, ties by number.
pub fn seal(leaf: &[Record], sealed: &mut [u64]) {
    sealed.iter_mut().zip(leaf).for_each(|(key, r)| *key = r.key());
    sort(sealed);
}

/// Puts the keys of a leaf in order.
pub fn sort(keys: &mut [u64]) {
    if !keys.is_sorted() {
        keys.sort_unstable();
    }
}
