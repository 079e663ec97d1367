//! Axis-aligned boxes: f64 for sources, f32 rounded outward for hot data.

use glam::{DVec3, Vec3};

/// A box in f64, closed. `EMPTY` has `lo > hi` and is the identity of `union`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Aabb {
    pub lo: DVec3,
    pub hi: DVec3,
}

impl Aabb {
    pub const EMPTY: Aabb = Aabb { lo: DVec3::INFINITY, hi: DVec3::NEG_INFINITY };

    pub fn of_points<'a>(points: impl IntoIterator<Item = &'a DVec3>) -> Aabb {
        points.into_iter().fold(Aabb::EMPTY, |b, p| b.with(*p))
    }

    pub fn with(self, p: DVec3) -> Aabb {
        Aabb { lo: self.lo.min(p), hi: self.hi.max(p) }
    }

    pub fn union(self, o: Aabb) -> Aabb {
        Aabb { lo: self.lo.min(o.lo), hi: self.hi.max(o.hi) }
    }

    pub fn is_empty(&self) -> bool {
        !(self.lo.cmple(self.hi).all())
    }

    pub fn centre(&self) -> DVec3 {
        (self.lo + self.hi) * 0.5
    }

    pub fn size(&self) -> DVec3 {
        self.hi - self.lo
    }

    /// Closed overlap: boxes that only touch overlap.
    pub fn overlaps(&self, o: &Aabb) -> bool {
        self.lo.cmple(o.hi).all() && o.lo.cmple(self.hi).all()
    }

    pub fn contains(&self, p: DVec3) -> bool {
        self.lo.cmple(p).all() && p.cmple(self.hi).all()
    }

    /// The box as f32 offsets from `origin`, each bound rounded outward, so that
    /// the result contains every point of `self`.
    pub fn relative_to(&self, origin: DVec3) -> Box32 {
        if self.is_empty() {
            return Box32::EMPTY;
        }
        Box32 { lo: round_down(self.lo, origin), hi: round_up(self.hi, origin) }
    }
}

/// A box of f32 offsets from a scene origin, rounded outward.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Box32 {
    pub lo: Vec3,
    pub hi: Vec3,
}

impl Box32 {
    pub const EMPTY: Box32 = Box32 { lo: Vec3::INFINITY, hi: Vec3::NEG_INFINITY };

    pub fn union(self, o: Box32) -> Box32 {
        Box32 { lo: self.lo.min(o.lo), hi: self.hi.max(o.hi) }
    }

    pub fn is_empty(&self) -> bool {
        !(self.lo.cmple(self.hi).all())
    }

    /// Half of the surface; 0 if empty. A large box is the likeliest to be asked about
    /// without being decided.
    pub fn half_area(&self) -> f32 {
        let s = (self.hi - self.lo).max(Vec3::ZERO);
        s.x * s.y + s.y * s.z + s.z * s.x
    }

    pub fn contains_box(&self, o: &Box32) -> bool {
        o.is_empty() || (self.lo.cmple(o.lo).all() && o.hi.cmple(self.hi).all())
    }
}

/// `p - origin` rounded towards minus infinity to f32, per axis. The f64
/// difference itself may round, so its error term (Knuth's two-sum) decides ties.
pub fn round_down(p: DVec3, origin: DVec3) -> Vec3 {
    let f = |a: f64, o: f64| {
        let d = a - o;
        let o_virtual = a - d;
        let error = (a - (d + o_virtual)) + (o_virtual - o);
        let r = d as f32;
        if f64::from(r) < d || (f64::from(r) == d && error >= 0.0) { r } else { r.next_down() }
    };
    Vec3::new(f(p.x, origin.x), f(p.y, origin.y), f(p.z, origin.z))
}

/// `p - origin` rounded towards plus infinity to f32, per axis.
pub fn round_up(p: DVec3, origin: DVec3) -> Vec3 {
    -round_down(-p, -origin)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn outward_rounding_contains_the_source(a in -(1i64 << 53)..(1i64 << 53), o in -(1i64 << 53)..(1i64 << 53)) {
            // Multiples of 2^-29, so that the exact difference is an integer count of them.
            let unit = (-29f64).exp2();
            let (p, origin) = (DVec3::splat(a as f64 * unit), DVec3::splat(o as f64 * unit));
            let exact = i128::from(a) - i128::from(o);
            let lo = f64::from(round_down(p, origin).x) / unit;
            let hi = f64::from(round_up(p, origin).x) / unit;
            prop_assert!(lo.ceil() as i128 <= exact && exact <= hi.floor() as i128);
            prop_assert!(hi - lo <= exact.abs() as f64 * 3e-7);
        }
    }

    #[test]
    fn representable_offsets_stay_exact() {
        assert_eq!(round_down(DVec3::splat(3.5), DVec3::splat(1.0)).x, 2.5);
        assert_eq!(round_up(DVec3::splat(3.5), DVec3::splat(1.0)).x, 2.5);
    }
}
