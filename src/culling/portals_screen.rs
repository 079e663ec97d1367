//! Rectangles of the screen that certainly hold what is seen of a face or a box.
//!
//! Coordinates are whole, [`UNITS`] from the middle of the screen to its edge, rounded
//! outward: four of them are 8 bytes, and whoever unites rectangles for long enough
//! comes to an end.
//!
//! Only what lies beyond the near plane counts, as nothing nearer hides or is seen.
//! A camera coordinate is a sum of three products of differences, so its error is
//! below 6u (|dx| + |dy| + |dz|); `SLACK` allows 32u, for the rounding of the view's
//! own axes and of whoever looks at the picture. A face is cut at a depth that much
//! before the near plane, so that what is cut off is certainly nearer; the cut point
//! is on the edge to within the same bound, wherever along it rounding puts it.

use crate::math::{Aabb, DVec3, View};

/// Units from the middle of the screen to its edge.
pub const UNITS: i16 = 1 << 14;

const SLACK: f64 = 32.0 * f64::EPSILON / 2.0;

/// Closed; `[x low, y low, x high, y high]`, empty if a low is above its high.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Rect(pub [i16; 4]);

impl Rect {
    pub const FULL: Rect = Rect([-UNITS, -UNITS, UNITS, UNITS]);
    pub const EMPTY: Rect = Rect([i16::MAX, i16::MAX, i16::MIN, i16::MIN]);

    #[inline]
    pub fn is_empty(self) -> bool {
        self.0[0] > self.0[2] || self.0[1] > self.0[3]
    }

    #[inline]
    pub fn meet(self, o: Rect) -> Rect {
        let ([a, b, c, d], [e, f, g, h]) = (self.0, o.0);
        Rect([a.max(e), b.max(f), c.min(g), d.min(h)])
    }

    #[inline]
    pub fn join(self, o: Rect) -> Rect {
        let ([a, b, c, d], [e, f, g, h]) = (self.0, o.0);
        Rect([a.min(e), b.min(f), c.max(g), d.max(h)])
    }
}

/// A point in camera coordinates: right, up, depth.
type Point = [f64; 3];

/// The view's projection.
pub struct Screen {
    eye: DVec3,
    axes: [DVec3; 3],
    perspective: bool,
    near_m: f64,
    far_m: f64,
    /// Units a unit of the image plane.
    scale: [f64; 2],
}

impl Screen {
    pub fn new(view: &View) -> Screen {
        let units = f64::from(UNITS);
        Screen {
            eye: view.eye,
            axes: [view.right, view.up, view.forward],
            perspective: view.is_perspective(),
            near_m: view.camera.near_m,
            far_m: view.camera.far_m.unwrap_or(f64::INFINITY),
            scale: [units / view.half_width, units / view.half_height],
        }
    }

    /// What is seen of the rectangle in the plane `axis` = `at`, between `lo` and `hi`
    /// on the two axes after it. Empty if no view ray can cross it beyond the near plane.
    pub fn face(&self, axis: usize, at: f64, [lo, hi]: [[f64; 2]; 2]) -> Rect {
        let [b, c] = [(axis + 1) % 3, (axis + 2) % 3];
        let d =
            [at - self.eye[axis], lo[0] - self.eye[b], hi[0] - self.eye[b], lo[1] - self.eye[c], hi[1] - self.eye[c]];
        let slack = SLACK * (d[0].abs() + d[1].abs().max(d[2].abs()) + d[3].abs().max(d[4].abs()));
        let point = |db: f64, dc: f64| -> Point {
            [0, 1, 2].map(|k| d[0] * self.axes[k][axis] + db * self.axes[k][b] + dc * self.axes[k][c])
        };
        self.polygon([point(d[1], d[3]), point(d[2], d[3]), point(d[2], d[4]), point(d[1], d[4])], slack)
    }

    fn polygon(&self, corners: [Point; 4], slack: f64) -> Rect {
        let (nearest, farthest) =
            corners.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), p| (a.min(p[2]), b.max(p[2])));
        if farthest < self.near_m - slack || nearest > self.far_m + slack {
            return Rect::EMPTY;
        }
        let cut = self.near_m - 4.0 * slack;
        if self.perspective && self.near_m < 16.0 * slack {
            return Rect::FULL;
        }
        let mut rect = Bounds::EMPTY;
        if nearest >= cut {
            corners.iter().for_each(|p| rect.take(self, *p, slack));
            return rect.outward();
        }
        for i in 0..4 {
            let (p, q) = (corners[i], corners[(i + 1) % 4]);
            if p[2] >= cut {
                rect.take(self, p, slack);
            }
            if (p[2] >= cut) != (q[2] >= cut) {
                let share = (cut - p[2]) / (q[2] - p[2]);
                let [x, y] = [0, 1].map(|k| p[k] + (q[k] - p[k]) * share);
                rect.take(self, [x, y, cut], 2.0 * slack);
            }
        }
        rect.outward()
    }

    /// What is seen of a box; everything if it reaches before the near plane.
    pub fn solid(&self, b: &Aabb) -> Rect {
        let (corners, slack) = self.corners(b);
        let nearest = corners.iter().fold(f64::INFINITY, |m, p| m.min(p[2]));
        if self.perspective && nearest < (self.near_m * 0.5).max(16.0 * slack) {
            return Rect::FULL;
        }
        let mut rect = Bounds::EMPTY;
        corners.iter().for_each(|p| rect.take(self, *p, slack));
        rect.outward()
    }

    /// What the near window shows of the part of a box that touches it.
    pub fn on_near_window(&self, b: &Aabb) -> Rect {
        let (corners, slack) = self.corners(b);
        let mut rect = Bounds::EMPTY;
        let [mut nearest, mut farthest] = [f64::INFINITY, f64::NEG_INFINITY];
        for p in corners {
            (nearest, farthest) = (nearest.min(p[2]), farthest.max(p[2]));
            rect.take(self, [p[0], p[1], self.near_m], slack);
        }
        if nearest > self.near_m + slack || farthest < self.near_m - slack {
            return Rect::EMPTY;
        }
        if self.perspective && self.near_m < 16.0 * slack { Rect::FULL } else { rect.outward() }
    }

    fn corners(&self, b: &Aabb) -> ([Point; 8], f64) {
        let (lo, hi) = (b.lo - self.eye, b.hi - self.eye);
        let far = lo.abs().max(hi.abs());
        let corner = |i: usize| {
            let pick = |axis: usize| if i >> axis & 1 == 1 { hi[axis] } else { lo[axis] };
            let d = DVec3::new(pick(0), pick(1), pick(2));
            self.axes.map(|a| a.dot(d))
        };
        (std::array::from_fn(corner), SLACK * (far.x + far.y + far.z))
    }
}

/// A rectangle in units, not yet whole.
struct Bounds([f64; 4]);

impl Bounds {
    const EMPTY: Bounds = Bounds([f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY]);

    /// Takes in a point known to within `slack` in every coordinate; its depth is
    /// larger than that by far.
    #[inline]
    fn take(&mut self, screen: &Screen, p: Point, slack: f64) {
        // Depth is at least 11 slacks, and of a slack of 32u the coordinates use 6u.
        let (over, grow) = if screen.perspective { (1.0 / p[2], 1.0) } else { (1.0, 0.0) };
        for (k, x) in p[..2].iter().enumerate() {
            let at = x * over;
            let error = 1.1 * slack * (1.0 + grow * at.abs()) * over;
            self.0[k] = self.0[k].min((at - error) * screen.scale[k]);
            self.0[k + 2] = self.0[k + 2].max((at + error) * screen.scale[k]);
        }
    }

    /// The last roundings of a value within the screen are below a billionth of a unit.
    fn outward(&self) -> Rect {
        let edge = f64::from(UNITS) + 1.0;
        // Baseline x86-64 has no instruction for `floor`; truncation it has.
        let below = |x: f64| {
            let x = (x - 1e-9).clamp(-edge, edge);
            let whole = x as i32;
            (whole - i32::from(x < f64::from(whole))) as i16
        };
        let [x0, y0, x1, y1] = self.0;
        Rect([below(x0), below(y0), -below(-x1), -below(-y1)])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{Camera, Pose, Projection};
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(3000))]
        /// Any point of a face or a box that is seen beyond the near plane lies in its
        /// rectangle, by plain projection of that point.
        #[test]
        fn what_is_seen_lies_in_the_rectangle(
            p in prop::array::uniform3(-8.0..8.0f64),
            size in prop::array::uniform3(0.0..6.0f64),
            shares in prop::collection::vec(prop::array::uniform3(0.0..=1.0f64), 24),
            yaw in 0.0..6.3f64, pitch in -1.4..1.4f64,
            axis in 0..3usize, orthographic in any::<bool>(), far in prop_oneof![Just(0.0), Just(1e6)],
            near_m in prop_oneof![Just(0.1), Just(1e-9), Just(3.0)],
        ) {
            let projection = if orthographic { Projection::Orthographic { height_m: 5.0 } } else { Camera::default().projection };
            let camera = Camera { projection, near_m, far_m: Some(9.0), ..Camera::default() };
            let forward = DVec3::new(yaw.cos() * pitch.cos(), yaw.sin() * pitch.cos(), pitch.sin());
            let view = View::new(&camera, &Pose { eye: DVec3::splat(far), forward, up: DVec3::Z });
            let screen = Screen::new(&view);
            let lo = DVec3::from(p) + far;
            let hi = lo + DVec3::from(size);
            let solid = screen.solid(&Aabb { lo, hi });
            let [b, c] = [(axis + 1) % 3, (axis + 2) % 3];
            let face = screen.face(axis, lo[axis], [[lo[b], lo[c]], [hi[b], hi[c]]]);
            let ends = shares.iter().enumerate().map(|(i, s)| if i % 3 == 0 { s.map(f64::round) } else { *s });
            for share in ends {
                let mut q = (lo + (hi - lo) * DVec3::from(share)).min(hi);
                for (rect, flat) in [(solid, false), (face, true)] {
                    if flat {
                        q[axis] = lo[axis];
                    }
                    let seen = view.to_camera(q);
                    if seen.z < near_m || seen.z > 9.0 {
                        continue;
                    }
                    let over = if orthographic { 1.0 } else { seen.z };
                    let at = [seen.x / over / view.half_width, seen.y / over / view.half_height].map(|x| x * f64::from(UNITS));
                    if at.iter().all(|x| x.abs() <= f64::from(UNITS)) {
                        let holds = |k: usize| f64::from(rect.0[k]) <= at[k] && at[k] <= f64::from(rect.0[k + 2]);
                        prop_assert!(holds(0) && holds(1), "{at:?} is not in {rect:?}, flat {flat}");
                    }
                }
            }
        }
    }

    #[test]
    fn a_face_before_the_near_plane_or_beyond_the_far_one_shows_nothing() {
        let camera = Camera { far_m: Some(9.0), ..Camera::default() };
        let view = View::new(&camera, &Pose { eye: DVec3::ZERO, forward: DVec3::X, up: DVec3::Z });
        let screen = Screen::new(&view);
        let face = |x: f64| screen.face(0, x, [[-1.0, -1.0], [1.0, 1.0]]);
        assert!([-1.0, 0.0, 0.09, 9.1].iter().all(|x| face(*x).is_empty()));
        assert_eq!(face(0.1).meet(Rect::FULL), Rect::FULL);
        // 60 degrees: a face of 2 m at its own distance from the edge of the screen.
        let Rect([x0, y0, x1, y1]) = face(2.0 / view.half_height);
        assert!((y1 - UNITS / 2).abs() <= 1 && y0 == -y1 && x0 == -x1 && x1 < y1, "{x1} {y1}");
        // To the right is -y, seen from far to the side.
        assert!(screen.face(0, 5.0, [[30.0, -1.0], [31.0, 1.0]]).meet(Rect::FULL).is_empty());
        assert!(screen.face(1, -0.5, [[-3.0, -3.0], [3.0, 3.0]]).0[0] > 0);
    }
}
