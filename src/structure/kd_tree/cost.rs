//! The surface area heuristic: what a plane is expected to cost a ray.

use crate::math::DVec3;

#[derive(Debug, Clone, Copy)]
pub struct Cost {
    pub traversal: f64,
    pub triangle: f64,
    pub empty_bonus: f64,
}

impl Cost {
    pub fn leaf(&self, triangles: usize) -> f64 {
        self.triangle * triangles as f64
    }

    pub fn split(&self, shares: [f64; 2], counts: [usize; 2]) -> f64 {
        let expected = shares[0] * counts[0] as f64 + shares[1] * counts[1] as f64;
        let cost = self.traversal + self.triangle * expected;
        if counts.contains(&0) { cost * (1.0 - self.empty_bonus) } else { cost }
    }
}

/// How likely a ray through a box of size `whole` meets one of size `part` in it: by
/// area, in a line by length.
pub fn share(part: DVec3, whole: DVec3) -> f64 {
    let area = |s: DVec3| s.x * s.y + s.y * s.z + s.z * s.x;
    let of = area(whole);
    if of > 0.0 {
        return area(part) / of;
    }
    let of = whole.element_sum();
    if of > 0.0 { part.element_sum() / of } else { 1.0 }
}
