//! Vertices of occluders: fixed point about the origin of their batch, projected in f64,
//! snapped to 1/65536 px. Where rounding could have moved a corner is bounded here.

use super::block::{Corner, OFF};
use super::code::Codes;
use super::project::Screen;
use super::{Coverage, Settings};
use crate::math::DVec3;

/// Corners snap to this part of a pixel.
pub const SUBPIXELS: f64 = 65536.0;
/// Corners farther than this from the image's origin are not snapped.
const FAR_SUBPIXELS: f64 = ((1 << 30) - 64) as f64;
/// Triangles up to so many pixels across have differences that f32 holds exactly.
pub const SMALL_PX: i32 = 252;

/// Vertices that share an origin: `origin + step * (x, y, z)` is at most `off_m` from the
/// source along each axis. Columns are padded to a multiple of eight.
#[derive(Debug, Clone, Copy)]
pub struct Batch<'a> {
    pub x: &'a [i32],
    pub y: &'a [i32],
    pub z: &'a [i32],
    pub origin: DVec3,
    pub step_m: f64,
    pub off_m: f64,
}

/// What a frame needs of camera and image.
#[derive(Debug, Clone)]
pub struct Lens {
    pub screen: Screen,
    /// Parallel rays: nearness is kept as `ahead - depth`, which lies between the range of
    /// depths and twice that for all that hides.
    pub ahead: f64,
    pub inner: bool,
    pub width: i32,
    pub height: i32,
    /// Pixels at unit depth, or a metre.
    pub focal: f64,
    /// No corner of a small triangle that meets the image is farther from its centre.
    reach: f64,
    pub codes: Codes,
}

impl Lens {
    /// Of occluders of which none is farther than `farthest`.
    pub fn new(screen: Screen, settings: Settings, farthest: f64) -> Lens {
        let range = (farthest - screen.near_m).max(1.0);
        let codes = if screen.perspective {
            Codes::logarithmic((1.0 / screen.near_m) as f32)
        } else {
            Codes::even((range * 0.999_999) as f32)
        };
        let ahead = farthest + range;
        Lens {
            ahead,
            inner: settings.coverage == Coverage::Inner,
            width: settings.width_px as i32,
            height: settings.height_px as i32,
            focal: screen.rows[0].length().max(screen.rows[1].length()),
            reach: 0.5 * screen.width_px.max(screen.height_px) + 2.0 * f64::from(SMALL_PX),
            codes,
            screen,
        }
    }

    /// Nearness as it is kept.
    pub fn key(&self, nearness: f64) -> f64 {
        if self.screen.perspective { nearness } else { nearness + self.ahead }
    }
}

/// A lens about a batch.
#[derive(Debug, Clone)]
pub struct BatchView {
    pub perspective: bool,
    /// Camera coordinates of a vertex: `to_camera * (x, y, z) + offset`, in the lens's units.
    pub to_camera: [[f64; 3]; 3],
    pub offset: [f64; 3],
    pub near: f64,
    /// Corners beyond are beyond the near plane wherever they truly are.
    pub near_snap: f64,
    pub ahead: f64,
    pub half: [f64; 2],
    /// By this a vertex may be off, in metres of camera space.
    pub off_m: f64,
    pub inner: bool,
    pub width: i32,
    pub height: i32,
    /// By so much an edge moves inward: `inset + inset_per_n * greatest nearness` pixels.
    pub inset: f32,
    pub inset_per_n: f32,
    /// By this nearness at a corner is off: constant, per nearness, per its square.
    pub doubt: [f32; 3],
}

impl BatchView {
    pub fn new(lens: &Lens, batch: &Batch) -> BatchView {
        let s = &lens.screen;
        let to_origin = batch.origin - s.eye;
        let extent = batch.step_m * 4_294_967_296.0;
        // A rotation turns an error along each axis into sqrt(3) as much along one at
        // most; f64 rounds the sums below by a few units of the largest term.
        let off_m = 1.7321 * (batch.off_m + 2e-15 * (to_origin.abs().element_sum() + extent));
        // Corners snap by half a subpixel; a metre is focal * nearness pixels beside the
        // axis, and along it the distance from the image's centre times nearness. A point
        // of a convex polygon that is farther from its boundary than sqrt(2) times what each
        // coordinate of its corners may be off stays inside while they move there: no
        // edge passes it. The pixel's own half is for inner coverage, where the
        // whole pixel has to be inside: as far again as its support along the normal.
        let half_px = if lens.inner { 0.5 } else { 0.0 };
        let (each, each_n) = if s.perspective {
            (0.5 / SUBPIXELS + 1e-9, off_m * (lens.focal + lens.reach))
        } else {
            (0.5 / SUBPIXELS + 1e-9 + off_m * lens.focal, 0.0)
        };
        let (even, linear, square) =
            if s.perspective { (0.0, 1.2e-7, 1.01 * off_m) } else { (1.01 * off_m, 1.2e-7, 0.0) };
        BatchView {
            perspective: s.perspective,
            to_camera: std::array::from_fn(|r| (s.rows[r] * batch.step_m).to_array()),
            offset: std::array::from_fn(|r| to_origin.dot(s.rows[r])),
            near: s.near_m.max(1e-30),
            near_snap: s.near_m.max(1e-30) + 2.0 * off_m,
            ahead: lens.ahead,
            half: [s.width_px * 0.5, s.height_px * 0.5],
            off_m,
            inner: lens.inner,
            width: lens.width,
            height: lens.height,
            inset: (half_px + 1.4144 * each) as f32,
            inset_per_n: (1.4144 * each_n) as f32,
            doubt: [even as f32, linear as f32, square as f32],
        }
    }

    /// Camera coordinates.
    pub fn camera(&self, q: [i32; 3]) -> [f64; 3] {
        let q = q.map(f64::from);
        std::array::from_fn(|r| {
            let m = &self.to_camera[r];
            ((m[0] * q[0] + m[1] * q[1]) + m[2] * q[2]) + self.offset[r]
        })
    }

    pub fn corner(&self, q: [i32; 3]) -> Corner {
        let [x, y, z] = self.camera(q);
        let (scale, n) = if self.perspective { (1.0 / z, 1.0 / z) } else { (1.0, self.ahead - z) };
        let (w, h) = if self.perspective { (self.half[0] * z, self.half[1] * z) } else { (self.half[0], self.half[1]) };
        let px = (x * scale + self.half[0]) * SUBPIXELS;
        let py = (y * scale + self.half[1]) * SUBPIXELS;
        let near = z < self.near_snap;
        let snapped = z >= self.near_snap && px.abs() < FAR_SUBPIXELS && py.abs() < FAR_SUBPIXELS;
        let snap = |v: f64| if snapped { v.round_ties_even() as i32 } else { OFF };
        let code = u32::from(near)
            | u32::from(x < -w) << 1
            | u32::from(x > w) << 2
            | u32::from(y < -h) << 3
            | u32::from(y > h) << 4;
        Corner { x: snap(px), y: snap(py), n: n as f32, code }
    }
}

pub const FAR: f64 = FAR_SUBPIXELS;
