//! The image plane of a view, and where the boxes of a hierarchy fall on it.

use super::outline::Outline;
use super::{GUARD, MARGIN};
use crate::math::{Box32, DVec3, View};

/// What the camera sees of a box.
#[allow(clippy::large_enum_variant)] // Made to be matched at once.
#[derive(Debug, Clone, Copy)]
pub enum Sight {
    /// Nothing: it is outside of the view volume.
    Outside,
    /// It reaches in front of the near plane, or rounding leaves its outline open.
    Open,
    /// Its outline within the image.
    Outline(Outline),
}

/// Corners of the outline of a box, by the side that the eye is of it on each axis: of
/// axis `k` digit `k`, to base 3, is 0 below, 1 within, 2 above.
type Table = [([u8; 6], u8); 27];

pub struct Image {
    pub perspective: bool,
    /// Right, up, forward.
    pub axes: [DVec3; 3],
    pub eye: DVec3,
    pub near_m: f64,
    far_m: Option<f64>,
    pub half: [f64; 2],
    pub guard: f64,
    /// Of the boxes, relative to the eye.
    origin: DVec3,
    hair_m: f64,
    table: &'static Table,
}

impl Image {
    /// `reach_m`: no box about `origin` has a coordinate beyond.
    pub fn new(view: &View, origin: DVec3, reach_m: f64) -> Image {
        let span = view.eye.abs().max_element() + origin.abs().max_element() + reach_m;
        Image {
            perspective: view.is_perspective(),
            axes: [view.right, view.up, view.forward],
            eye: view.eye,
            near_m: view.camera.near_m,
            far_m: view.camera.far_m,
            half: [view.half_width, view.half_height],
            guard: GUARD * view.half_width.max(view.half_height),
            origin: origin - view.eye,
            hair_m: 8.0 * f64::EPSILON * span,
            table: table(),
        }
    }

    /// Camera coordinates of a point relative to the eye.
    #[inline]
    pub fn camera(&self, p: DVec3) -> DVec3 {
        DVec3::new(self.axes[0].dot(p), self.axes[1].dot(p), self.axes[2].dot(p))
    }

    /// The box relative to the eye, wider by what rounding may do: the same for all, so
    /// that boxes in boxes stay so.
    #[inline]
    pub fn relative(&self, b: &Box32) -> [DVec3; 2] {
        let hair = DVec3::splat(self.hair_m);
        [b.lo.as_dvec3() + self.origin - hair, b.hi.as_dvec3() + self.origin + hair]
    }

    #[inline]
    pub fn sight(&self, [lo, hi]: [DVec3; 2]) -> Sight {
        // Per axis of the camera and of the world, what a box's corner adds.
        let rows = self.axes.map(|axis| [axis * lo, axis * hi]);
        let [near, far] = [rows[2][0].min(rows[2][1]), rows[2][0].max(rows[2][1])].map(|d| d.element_sum());
        if far < self.near_m - self.hair_m || self.far_m.is_some_and(|f| near > f + self.hair_m) {
            return Sight::Outside;
        }
        let reach = lo.abs().max(hi.abs()).length();
        // Rounding of a corner's coordinates on the image.
        let steepest = if self.perspective { (reach / near) * (reach / near) } else { reach };
        let wrong = 8.0 * f64::EPSILON * steepest;
        if !(near > self.near_m + self.hair_m && wrong * MARGIN <= self.guard) {
            return Sight::Open;
        }
        let digit = |k: usize| match self.perspective {
            true => usize::from(lo[k] <= 0.0) + usize::from(hi[k] < 0.0),
            false => usize::from(self.axes[2][k] <= 0.0) + usize::from(self.axes[2][k] < 0.0),
        };
        let (corners, count) = &self.table[digit(0) + 3 * digit(1) + 9 * digit(2)];
        let mut out = Outline::EMPTY;
        let mut sides = [true; 4];
        let [x, y] = self.half.map(|h| h + self.guard);
        let mut inside = true;
        for corner in &corners[..usize::from(*count)] {
            let pick = |row: &[DVec3; 2]| {
                let side = |k: usize| row[usize::from(corner >> k & 1)][k];
                side(0) + side(1) + side(2)
            };
            let scale = if self.perspective { 1.0 / pick(&rows[2]) } else { 1.0 };
            let p = [pick(&rows[0]) * scale, pick(&rows[1]) * scale];
            let beyond = [p[0] < -x, p[0] > x, p[1] < -y, p[1] > y];
            (0..4).for_each(|i| sides[i] &= beyond[i]);
            inside &= !(beyond[0] | beyond[1] | beyond[2] | beyond[3]);
            out.push(p);
        }
        if sides.contains(&true) {
            return Sight::Outside;
        }
        if !inside {
            for line in [[1.0, 0.0, x], [-1.0, 0.0, x], [0.0, 1.0, y], [0.0, -1.0, y]] {
                // Six corners and four cuts: there is room.
                out = out.above(&line, 0.0).expect("ten corners at most");
            }
        }
        if out.corners().is_empty() { Sight::Outside } else { Sight::Outline(out) }
    }
}

/// The edges between a face that the eye sees and one that it does not, as a loop.
fn table() -> &'static Table {
    static TABLE: std::sync::OnceLock<Table> = std::sync::OnceLock::new();
    TABLE.get_or_init(|| {
        std::array::from_fn(|code| {
            let digit = |axis: usize| code / 3usize.pow(axis as u32) % 3;
            let seen = |axis: usize, side: usize| digit(axis) == 2 * side;
            let mut edges = Vec::new();
            for axis in 0..3 {
                let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                for (su, sv) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                    if seen(u, su) != seen(v, sv) {
                        let from = su << u | sv << v;
                        edges.push((from as u8, (from | 1 << axis) as u8));
                    }
                }
            }
            let mut corners = [0; 6];
            let count = edges.len() as u8;
            if let Some((first, second)) = edges.pop() {
                (corners[0], corners[1]) = (first, second);
                for i in 2..usize::from(count) {
                    let at = corners[i - 1];
                    let next = edges.iter().position(|(a, b)| *a == at || *b == at).expect("edges form a loop");
                    let (a, b) = edges.swap_remove(next);
                    corners[i] = if a == at { b } else { a };
                }
            }
            (corners, count)
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outlines_have_four_corners_face_on_and_six_else() {
        for (code, (corners, count)) in table().iter().enumerate() {
            let within = (0..3).filter(|k| code / 3usize.pow(*k) % 3 == 1).count();
            assert_eq!(usize::from(*count), [6, 6, 4, 0][within], "{code}");
            let mut distinct = corners[..usize::from(*count)].to_vec();
            distinct.sort_unstable();
            distinct.dedup();
            assert_eq!(distinct.len(), usize::from(*count));
            let round =
                corners[..usize::from(*count)].iter().zip(corners[..usize::from(*count)].iter().cycle().skip(1));
            assert!(round.into_iter().all(|(a, b)| (a ^ b).count_ones() == 1), "edge by edge");
        }
    }
}
