//! Facing kernels for x86-64: AVX2 (8 triangles at once) and AVX-512 (16).
//!
//! Explicit intrinsics throughout, and none that fuses: the operations and their
//! order are those of the scalar twins in `facing_kernels`. One macro writes both
//! widths, which differ in nothing but the names of the instructions.

use super::facing_columns::*;
use super::facing_kernels::each_block;
use std::arch::x86_64::*;

pub fn has_avx2() -> bool {
    is_x86_feature_detected!("avx2")
}

pub fn has_avx512() -> bool {
    has_avx2() && is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512dq")
}

#[target_feature(enable = "avx2")]
#[inline]
fn less_256(a: __m256, b: __m256) -> u64 {
    _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LT_OQ>(a, b)) as u64
}

#[target_feature(enable = "avx2")]
#[inline]
fn at_most_256(a: __m256, b: __m256) -> u64 {
    _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(a, b)) as u64
}

#[target_feature(enable = "avx2")]
#[inline]
fn less_256d(a: __m256d, b: __m256d) -> u64 {
    _mm256_movemask_pd(_mm256_cmp_pd::<_CMP_LT_OQ>(a, b)) as u64
}

#[target_feature(enable = "avx2")]
#[inline]
fn abs_256(a: __m256) -> __m256 {
    _mm256_andnot_ps(_mm256_set1_ps(-0.0), a)
}

#[target_feature(enable = "avx2")]
#[inline]
fn abs_256d(a: __m256d) -> __m256d {
    _mm256_andnot_pd(_mm256_set1_pd(-0.0), a)
}

#[target_feature(enable = "avx512f,avx512dq")]
#[inline]
fn less_512(a: __m512, b: __m512) -> u64 {
    u64::from(_mm512_cmp_ps_mask::<_CMP_LT_OQ>(a, b))
}

#[target_feature(enable = "avx512f,avx512dq")]
#[inline]
fn at_most_512(a: __m512, b: __m512) -> u64 {
    u64::from(_mm512_cmp_ps_mask::<_CMP_LE_OQ>(a, b))
}

#[target_feature(enable = "avx512f,avx512dq")]
#[inline]
fn less_512d(a: __m512d, b: __m512d) -> u64 {
    u64::from(_mm512_cmp_pd_mask::<_CMP_LT_OQ>(a, b))
}

/// The five kernels of a width of `$n` f32, each with a safe door before it.
macro_rules! width {
    ($feature:literal, $has:ident, $n:literal, $v:ident, $v64:ident,
     ps: $load:ident $set:ident $zero:ident $add:ident $sub:ident $mul:ident $abs:ident $less:ident $at_most:ident,
     pd: $load64:ident $set64:ident $add64:ident $sub64:ident $mul64:ident $abs64:ident $less64:ident,
     $plane:ident $plane_in:ident, $difference:ident $difference_in:ident, $guarded:ident $guarded_in:ident,
     $split:ident $split_in:ident, $double:ident $double_in:ident, $value:ident $row:ident $guard:ident $row64:ident) => {
        #[target_feature(enable = $feature)]
        #[inline]
        fn $row(row: &[f32; BLOCK], part: usize) -> $v {
            debug_assert!(part < BLOCK / $n);
            // SAFETY: rows are 64 bytes, 64-byte aligned in their block, and `part` is within.
            unsafe { $load(row.as_ptr().add(part * $n)) }
        }

        #[target_feature(enable = $feature)]
        #[inline]
        fn $row64(row: &[f64; BLOCK64], part: usize) -> $v64 {
            debug_assert!(part < 2 * BLOCK64 / $n);
            // SAFETY: as above.
            unsafe { $load64(row.as_ptr().add(part * $n / 2)) }
        }

        /// Value, sum of `|a_i|` and sum of `|c_i|`.
        #[target_feature(enable = $feature)]
        #[inline]
        fn $value(eye: &[$v; 3], rest: &[$v; 3], k: $v, b: &PointBlock, part: usize) -> ($v, $v, $v) {
            let cx = $mul($row(&b.point[0], part), k);
            let cy = $mul($row(&b.point[1], part), k);
            let cz = $mul($row(&b.point[2], part), k);
            let ax = $sub($sub(cx, eye[0]), rest[0]);
            let ay = $sub($sub(cy, eye[1]), rest[1]);
            let az = $sub($sub(cz, eye[2]), rest[2]);
            let xy = $add($mul($row(&b.normal[0], part), ax), $mul($row(&b.normal[1], part), ay));
            let s = $add(xy, $mul($row(&b.normal[2], part), az));
            (s, $add($add($abs(ax), $abs(ay)), $abs(az)), $add($add($abs(cx), $abs(cy)), $abs(cz)))
        }

        #[target_feature(enable = $feature)]
        #[inline]
        fn $guard(a: $v, c: $v) -> $v {
            $add($mul($add($mul(a, $set(4.0)), c), $set(GUARD)), $set(TINY))
        }

        #[target_feature(enable = $feature)]
        fn $plane_in(eye: &Eye32, blocks: &[PlaneBlock], keep: &mut [u64]) {
            let [x, y, z] = eye.eye.map(|e| $set(e));
            let k = $set(eye.scale);
            each_block(BLOCK, blocks, keep, |_, b| {
                let mut back = 0;
                for part in 0..BLOCK / $n {
                    let xy = $add($mul($row(&b.normal[0], part), x), $mul($row(&b.normal[1], part), y));
                    let xyz = $add(xy, $mul($row(&b.normal[2], part), z));
                    let s = $add(xyz, $mul($row(&b.d, part), k));
                    back |= $at_most(s, $zero()) << (part * $n);
                }
                back
            });
        }

        #[target_feature(enable = $feature)]
        fn $difference_in(eye: &Eye32, blocks: &[PointBlock], keep: &mut [u64]) {
            let (e, rest, k) = (eye.eye.map(|e| $set(e)), eye.rest.map(|e| $set(e)), $set(eye.scale));
            each_block(BLOCK, blocks, keep, |_, b| {
                let mut back = 0;
                for part in 0..BLOCK / $n {
                    let (s, ..) = $value(&e, &rest, k, b, part);
                    back |= $at_most($zero(), s) << (part * $n);
                }
                back
            });
        }

        #[target_feature(enable = $feature)]
        fn $guarded_in(eye: &Eye32, blocks: &[PointBlock], keep: &mut [u64]) {
            let (e, rest, k) = (eye.eye.map(|e| $set(e)), eye.rest.map(|e| $set(e)), $set(eye.scale));
            each_block(BLOCK, blocks, keep, |_, b| {
                let mut back = 0;
                for part in 0..BLOCK / $n {
                    let (s, a, c) = $value(&e, &rest, k, b, part);
                    back |= $less($guard(a, c), s) << (part * $n);
                }
                back
            });
        }

        #[target_feature(enable = $feature)]
        fn $split_in(eye: &Eye32, blocks: &[PointBlock], keep: &mut [u64], open: &mut [u64]) {
            open.copy_from_slice(keep);
            let (e, rest, k) = (eye.eye.map(|e| $set(e)), eye.rest.map(|e| $set(e)), $set(eye.scale));
            each_block(BLOCK, blocks, keep, |i, b| {
                let (mut back, mut front) = (0, 0);
                for part in 0..BLOCK / $n {
                    let (s, a, c) = $value(&e, &rest, k, b, part);
                    let g = $guard(a, c);
                    back |= $less(g, s) << (part * $n);
                    front |= $less(s, $sub($zero(), g)) << (part * $n);
                }
                open[i / 4] &= !((back | front) << (i % 4 * BLOCK));
                back
            });
        }

        #[target_feature(enable = $feature)]
        fn $double_in(eye: &Eye64, blocks: &[DoubleBlock], keep: &mut [u64]) {
            let (e, k) = (eye.eye.map(|e| $set64(e)), $set64(eye.scale));
            each_block(BLOCK64, blocks, keep, |_, b| {
                let mut back = 0;
                for part in 0..2 * BLOCK64 / $n {
                    let ax = $sub64($mul64($row64(&b.point[0], part), k), e[0]);
                    let ay = $sub64($mul64($row64(&b.point[1], part), k), e[1]);
                    let az = $sub64($mul64($row64(&b.point[2], part), k), e[2]);
                    let xy = $add64($mul64($row64(&b.normal[0], part), ax), $mul64($row64(&b.normal[1], part), ay));
                    let s = $add64(xy, $mul64($row64(&b.normal[2], part), az));
                    let sum = $add64($add64($abs64(ax), $abs64(ay)), $abs64(az));
                    let g = $add64($mul64($row64(&b.bound, part), sum), $set64(TINY64));
                    back |= $less64(g, s) << (part * $n / 2);
                }
                back
            });
        }

        /// See `facing_kernels::plane`.
        ///
        /// # Panics
        /// If the processor lacks the instructions.
        pub fn $plane(eye: &Eye32, blocks: &[PlaneBlock], keep: &mut [u64]) {
            assert!($has());
            // SAFETY: the processor has the features, as just asserted.
            unsafe { $plane_in(eye, blocks, keep) }
        }

        /// See `facing_kernels::difference`.
        ///
        /// # Panics
        /// If the processor lacks the instructions.
        pub fn $difference(eye: &Eye32, blocks: &[PointBlock], keep: &mut [u64]) {
            assert!($has());
            // SAFETY: the processor has the features, as just asserted.
            unsafe { $difference_in(eye, blocks, keep) }
        }

        /// See `facing_kernels::guarded`.
        ///
        /// # Panics
        /// If the processor lacks the instructions.
        pub fn $guarded(eye: &Eye32, blocks: &[PointBlock], keep: &mut [u64]) {
            assert!($has());
            // SAFETY: the processor has the features, as just asserted.
            unsafe { $guarded_in(eye, blocks, keep) }
        }

        /// See `facing_kernels::split`.
        ///
        /// # Panics
        /// If the processor lacks the instructions.
        pub fn $split(eye: &Eye32, blocks: &[PointBlock], keep: &mut [u64], open: &mut [u64]) {
            assert!($has());
            // SAFETY: the processor has the features, as just asserted.
            unsafe { $split_in(eye, blocks, keep, open) }
        }

        /// See `facing_kernels::double`.
        ///
        /// # Panics
        /// If the processor lacks the instructions.
        pub fn $double(eye: &Eye64, blocks: &[DoubleBlock], keep: &mut [u64]) {
            assert!($has());
            // SAFETY: the processor has the features, as just asserted.
            unsafe { $double_in(eye, blocks, keep) }
        }
    };
}

width!("avx2", has_avx2, 8, __m256, __m256d,
    ps: _mm256_load_ps _mm256_set1_ps _mm256_setzero_ps _mm256_add_ps _mm256_sub_ps _mm256_mul_ps abs_256 less_256 at_most_256,
    pd: _mm256_load_pd _mm256_set1_pd _mm256_add_pd _mm256_sub_pd _mm256_mul_pd abs_256d less_256d,
    plane_avx2 plane_256, difference_avx2 difference_256, guarded_avx2 guarded_256,
    split_avx2 split_256, double_avx2 double_256, value_256 row_256 guard_256 row_256d);

width!("avx512f,avx512dq", has_avx512, 16, __m512, __m512d,
    ps: _mm512_load_ps _mm512_set1_ps _mm512_setzero_ps _mm512_add_ps _mm512_sub_ps _mm512_mul_ps _mm512_abs_ps less_512 at_most_512,
    pd: _mm512_load_pd _mm512_set1_pd _mm512_add_pd _mm512_sub_pd _mm512_mul_pd _mm512_abs_pd less_512d,
    plane_avx512 plane_512, difference_avx512 difference_512, guarded_avx512 guarded_512,
    split_avx512 split_512, double_avx512 double_512, value_512 row_512 guard_512 row_512d);
