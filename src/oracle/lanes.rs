//! Four f64 at once: one kernel source for every instruction set.
//!
//! A kernel is generic over [`Lanes`] and compiled twice, with plain arrays and
//! with AVX2. Both do the same IEEE operations lane by lane (no fused products),
//! so the bits do not depend on the processor. The plain form is the twin.

use std::ops::{Add, Div, Mul, Neg, Sub};

/// Lanes of a vector.
pub const LANES: usize = 4;

/// Four f64. Comparisons give one bit a lane.
pub trait Lanes:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> + Neg<Output = Self>
{
    fn splat(v: f64) -> Self;
    fn of(v: [f64; LANES]) -> Self;
    /// Of the first four.
    fn load(from: &[f64]) -> Self;
    /// To the first four.
    fn store(self, to: &mut [f64]);
    /// `self < o ? self : o`, as `minpd`.
    fn min(self, o: Self) -> Self;
    /// `self > o ? self : o`, as `maxpd`.
    fn max(self, o: Self) -> Self;
    fn abs(self) -> Self;
    fn ceil(self) -> Self;
    fn floor(self) -> Self;
    fn ge(self, o: Self) -> u32;
    fn gt(self, o: Self) -> u32;
    /// Where `sign` has its sign bit set `a`, else `b`.
    fn select(sign: Self, a: Self, b: Self) -> Self;
}

/// `a . b` in the order of `glam`.
#[inline(always)]
pub fn dot<L: Lanes>(a: [L; 3], b: [L; 3]) -> L {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// `a x b` in the order of `glam`.
#[inline(always)]
pub fn cross<L: Lanes>(a: [L; 3], b: [L; 3]) -> [L; 3] {
    [a[1] * b[2] - b[1] * a[2], a[2] * b[0] - b[2] * a[0], a[0] * b[1] - b[0] * a[1]]
}

#[inline(always)]
pub fn minus<L: Lanes>(a: [L; 3], b: [L; 3]) -> [L; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
pub fn splat3<L: Lanes>(v: glam::DVec3) -> [L; 3] {
    [L::splat(v.x), L::splat(v.y), L::splat(v.z)]
}

/// Four points as coordinates.
#[inline(always)]
pub fn gather<L: Lanes>(p: [glam::DVec3; LANES]) -> [L; 3] {
    [
        L::of([p[0].x, p[1].x, p[2].x, p[3].x]),
        L::of([p[0].y, p[1].y, p[2].y, p[3].y]),
        L::of([p[0].z, p[1].z, p[2].z, p[3].z]),
    ]
}

/// Which form of the kernels runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kernel {
    Plain,
    /// Only where [`Kernel::best`] gave it.
    Avx2,
}

impl Kernel {
    pub fn best() -> Kernel {
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") {
            return Kernel::Avx2;
        }
        Kernel::Plain
    }
}

#[derive(Clone, Copy)]
pub struct Plain([f64; LANES]);

macro_rules! lanewise {
    ($($op:ident $f:ident),*) => { $(
        impl $op for Plain {
            type Output = Plain;
            #[inline(always)]
            fn $f(self, o: Plain) -> Plain {
                Plain(std::array::from_fn(|i| self.0[i].$f(o.0[i])))
            }
        }
    )* };
}
lanewise!(Add add, Sub sub, Mul mul, Div div);

impl Neg for Plain {
    type Output = Plain;
    #[inline(always)]
    fn neg(self) -> Plain {
        Plain(self.0.map(|v| -v))
    }
}

impl Lanes for Plain {
    #[inline(always)]
    fn splat(v: f64) -> Plain {
        Plain([v; LANES])
    }
    #[inline(always)]
    fn of(v: [f64; LANES]) -> Plain {
        Plain(v)
    }
    #[inline(always)]
    fn load(from: &[f64]) -> Plain {
        Plain(*from.first_chunk().expect("four values"))
    }
    #[inline(always)]
    fn store(self, to: &mut [f64]) {
        to[..LANES].copy_from_slice(&self.0);
    }
    #[inline(always)]
    fn min(self, o: Plain) -> Plain {
        Plain(std::array::from_fn(|i| if self.0[i] < o.0[i] { self.0[i] } else { o.0[i] }))
    }
    #[inline(always)]
    fn max(self, o: Plain) -> Plain {
        Plain(std::array::from_fn(|i| if self.0[i] > o.0[i] { self.0[i] } else { o.0[i] }))
    }
    #[inline(always)]
    fn abs(self) -> Plain {
        Plain(self.0.map(f64::abs))
    }
    #[inline(always)]
    fn ceil(self) -> Plain {
        Plain(self.0.map(f64::ceil))
    }
    #[inline(always)]
    fn floor(self) -> Plain {
        Plain(self.0.map(f64::floor))
    }
    #[inline(always)]
    fn ge(self, o: Plain) -> u32 {
        (0..LANES).fold(0, |bits, i| bits | u32::from(self.0[i] >= o.0[i]) << i)
    }
    #[inline(always)]
    fn gt(self, o: Plain) -> u32 {
        (0..LANES).fold(0, |bits, i| bits | u32::from(self.0[i] > o.0[i]) << i)
    }
    #[inline(always)]
    fn select(sign: Plain, a: Plain, b: Plain) -> Plain {
        Plain(std::array::from_fn(|i| if sign.0[i].is_sign_negative() { a.0[i] } else { b.0[i] }))
    }
}

#[cfg(target_arch = "x86_64")]
pub use avx2::Avx2;

#[cfg(target_arch = "x86_64")]
mod avx2 {
    use super::{LANES, Lanes};
    use std::arch::x86_64::*;
    use std::ops::{Add, Div, Mul, Neg, Sub};

    /// Values exist only inside kernels that were entered after AVX2 was found;
    /// that is what every `unsafe` below rests on.
    #[derive(Clone, Copy)]
    pub struct Avx2(__m256d);

    macro_rules! lanewise {
        ($($op:ident $f:ident $intrinsic:ident),*) => { $(
            impl $op for Avx2 {
                type Output = Avx2;
                #[inline(always)]
                fn $f(self, o: Avx2) -> Avx2 {
                    // SAFETY: see the type.
                    Avx2(unsafe { $intrinsic(self.0, o.0) })
                }
            }
        )* };
    }
    lanewise!(Add add _mm256_add_pd, Sub sub _mm256_sub_pd, Mul mul _mm256_mul_pd, Div div _mm256_div_pd);

    impl Neg for Avx2 {
        type Output = Avx2;
        #[inline(always)]
        fn neg(self) -> Avx2 {
            // SAFETY: see the type.
            Avx2(unsafe { _mm256_xor_pd(self.0, _mm256_set1_pd(-0.0)) })
        }
    }

    impl Lanes for Avx2 {
        #[inline(always)]
        fn splat(v: f64) -> Avx2 {
            // SAFETY: see the type.
            Avx2(unsafe { _mm256_set1_pd(v) })
        }
        #[inline(always)]
        fn of(v: [f64; LANES]) -> Avx2 {
            // SAFETY: see the type.
            Avx2(unsafe { _mm256_set_pd(v[3], v[2], v[1], v[0]) })
        }
        #[inline(always)]
        fn load(from: &[f64]) -> Avx2 {
            let from: &[f64; LANES] = from.first_chunk().expect("four values");
            // SAFETY: see the type; the array has four values, and any alignment will do.
            Avx2(unsafe { _mm256_loadu_pd(from.as_ptr()) })
        }
        #[inline(always)]
        fn store(self, to: &mut [f64]) {
            let to: &mut [f64; LANES] = to.first_chunk_mut().expect("four values");
            // SAFETY: as in `load`.
            unsafe { _mm256_storeu_pd(to.as_mut_ptr(), self.0) }
        }
        #[inline(always)]
        fn min(self, o: Avx2) -> Avx2 {
            // SAFETY: see the type.
            Avx2(unsafe { _mm256_min_pd(self.0, o.0) })
        }
        #[inline(always)]
        fn max(self, o: Avx2) -> Avx2 {
            // SAFETY: see the type.
            Avx2(unsafe { _mm256_max_pd(self.0, o.0) })
        }
        #[inline(always)]
        fn abs(self) -> Avx2 {
            // SAFETY: see the type.
            Avx2(unsafe { _mm256_andnot_pd(_mm256_set1_pd(-0.0), self.0) })
        }
        #[inline(always)]
        fn ceil(self) -> Avx2 {
            // SAFETY: see the type.
            Avx2(unsafe { _mm256_ceil_pd(self.0) })
        }
        #[inline(always)]
        fn floor(self) -> Avx2 {
            // SAFETY: see the type.
            Avx2(unsafe { _mm256_floor_pd(self.0) })
        }
        #[inline(always)]
        fn ge(self, o: Avx2) -> u32 {
            // SAFETY: see the type.
            unsafe { _mm256_movemask_pd(_mm256_cmp_pd::<_CMP_GE_OQ>(self.0, o.0)) as u32 }
        }
        #[inline(always)]
        fn gt(self, o: Avx2) -> u32 {
            // SAFETY: see the type.
            unsafe { _mm256_movemask_pd(_mm256_cmp_pd::<_CMP_GT_OQ>(self.0, o.0)) as u32 }
        }
        #[inline(always)]
        fn select(sign: Avx2, a: Avx2, b: Avx2) -> Avx2 {
            // SAFETY: see the type.
            Avx2(unsafe { _mm256_blendv_pd(b.0, a.0, sign.0) })
        }
    }
}
