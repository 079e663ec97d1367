//! Facing of many triangles, a bit each: the scalar twins and the choice of kernels.
//!
//! `keep` comes in with the bits of the positions that are asked about and goes out
//! without those that turn their back; blocks without such a bit are not read.
//! The operations and their order are those of `facing_columns`.

use super::facing_columns::*;

pub type PlaneKernel = fn(&Eye32, &[PlaneBlock], &mut [u64]);
pub type PointKernel = fn(&Eye32, &[PointBlock], &mut [u64]);
pub type SplitKernel = fn(&Eye32, &[PointBlock], &mut [u64], &mut [u64]);
pub type DoubleKernel = fn(&Eye64, &[DoubleBlock], &mut [u64]);

/// One instruction set's kernels; all give the same bits.
#[derive(Debug, Clone, Copy)]
pub struct Kernels {
    pub name: &'static str,
    /// Plane form, not guarded.
    pub plane: PlaneKernel,
    /// Difference form, not guarded.
    pub difference: PointKernel,
    /// Difference form, guarded.
    pub guarded: PointKernel,
    /// The same; the second word goes out with the kept bits that are not proved to
    /// show their front.
    pub split: SplitKernel,
    /// Double precision, guarded.
    pub double: DoubleKernel,
}

/// What this processor can run, the widest first, the scalar twin last.
pub fn kernels() -> Vec<Kernels> {
    let mut found = Vec::new();
    #[cfg(target_arch = "x86_64")]
    {
        use super::facing_x86 as x86;
        if x86::has_avx512() {
            found.push(Kernels {
                name: "avx512",
                plane: x86::plane_avx512,
                difference: x86::difference_avx512,
                guarded: x86::guarded_avx512,
                split: x86::split_avx512,
                double: x86::double_avx512,
            });
        }
        if x86::has_avx2() {
            found.push(Kernels {
                name: "avx2",
                plane: x86::plane_avx2,
                difference: x86::difference_avx2,
                guarded: x86::guarded_avx2,
                split: x86::split_avx2,
                double: x86::double_avx2,
            });
        }
    }
    found.push(Kernels { name: "scalar", plane, difference, guarded, split, double });
    found
}

/// Calls `judge(block)` for the blocks of `lanes` positions that hold a set bit of
/// `keep`, and takes out the bits that it answers.
#[inline(always)]
pub(super) fn each_block<B>(lanes: usize, blocks: &[B], keep: &mut [u64], mut judge: impl FnMut(usize, &B) -> u64) {
    let per_word = 64 / lanes;
    let some = !0u64 >> (64 - lanes);
    for (w, (blocks, word)) in blocks.chunks_exact(per_word).zip(keep).enumerate() {
        for (i, block) in blocks.iter().enumerate() {
            if *word >> (i * lanes) & some != 0 {
                *word &= !(judge(w * per_word + i, block) << (i * lanes));
            }
        }
    }
}

/// Bit a lane.
fn bits<const N: usize>(lane: impl Fn(usize) -> bool) -> u64 {
    (0..N).fold(0, |m, l| m | u64::from(lane(l)) << l)
}

pub fn plane(eye: &Eye32, blocks: &[PlaneBlock], keep: &mut [u64]) {
    let ([x, y, z], k) = (eye.eye, eye.scale);
    each_block(BLOCK, blocks, keep, |_, b| {
        let [nx, ny, nz] = &b.normal;
        let s: [f32; BLOCK] = std::array::from_fn(|l| ((nx[l] * x + ny[l] * y) + nz[l] * z) + b.d[l] * k);
        // Not a number: kept.
        bits::<BLOCK>(|l| s[l] <= 0.0)
    });
}

/// Value, sum of `|a_i|` and sum of `|c_i|` of one lane of the difference form.
#[inline(always)]
pub fn value(eye: &Eye32, b: &PointBlock, l: usize) -> (f32, f32, f32) {
    let c: [f32; 3] = std::array::from_fn(|i| b.point[i][l] * eye.scale);
    let a: [f32; 3] = std::array::from_fn(|i| (c[i] - eye.eye[i]) - eye.rest[i]);
    let s = (b.normal[0][l] * a[0] + b.normal[1][l] * a[1]) + b.normal[2][l] * a[2];
    ((s), (a[0].abs() + a[1].abs()) + a[2].abs(), (c[0].abs() + c[1].abs()) + c[2].abs())
}

/// The guard that belongs to it.
#[inline(always)]
pub fn guard(a: f32, c: f32) -> f32 {
    (a * 4.0 + c) * GUARD + TINY
}

pub fn difference(eye: &Eye32, blocks: &[PointBlock], keep: &mut [u64]) {
    each_block(BLOCK, blocks, keep, |_, b| {
        let s: [f32; BLOCK] = std::array::from_fn(|l| value(eye, b, l).0);
        bits::<BLOCK>(|l| s[l] >= 0.0)
    });
}

pub fn guarded(eye: &Eye32, blocks: &[PointBlock], keep: &mut [u64]) {
    each_block(BLOCK, blocks, keep, |_, b| {
        let back: [bool; BLOCK] = std::array::from_fn(|l| {
            let (s, a, c) = value(eye, b, l);
            s > guard(a, c)
        });
        bits::<BLOCK>(|l| back[l])
    });
}

pub fn split(eye: &Eye32, blocks: &[PointBlock], keep: &mut [u64], open: &mut [u64]) {
    open.copy_from_slice(keep);
    each_block(BLOCK, blocks, keep, |i, b| {
        let values: [(f32, f32); BLOCK] = std::array::from_fn(|l| {
            let (s, a, c) = value(eye, b, l);
            (s, guard(a, c))
        });
        let back = bits::<BLOCK>(|l| values[l].0 > values[l].1);
        let front = bits::<BLOCK>(|l| values[l].0 < -values[l].1);
        open[i / 4] &= !((back | front) << (i % 4 * BLOCK));
        back
    });
}

pub fn double(eye: &Eye64, blocks: &[DoubleBlock], keep: &mut [u64]) {
    let (e, k) = (eye.eye, eye.scale);
    each_block(BLOCK64, blocks, keep, |_, b| {
        let back: [bool; BLOCK64] = std::array::from_fn(|l| {
            let a: [f64; 3] = std::array::from_fn(|i| b.point[i][l] * k - e[i]);
            let s = (b.normal[0][l] * a[0] + b.normal[1][l] * a[1]) + b.normal[2][l] * a[2];
            s > b.bound[l] * ((a[0].abs() + a[1].abs()) + a[2].abs()) + TINY64
        });
        bits::<BLOCK64>(|l| back[l])
    });
}
