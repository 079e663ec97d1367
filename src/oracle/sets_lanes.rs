//! The exact sets, four vertices and four triangles at a time.
//!
//! Out-codes and the filtered determinant of facing are evaluated in lanes by the
//! operations of [`out_code`] and [`Predicates::facing`] in their order, so every
//! bit, and every count of fallbacks, is that of the scalar form. A triangle that
//! codes or filter leave open goes through the scalar functions.

use super::lanes::{Kernel, LANES, Lanes, Plain, dot, gather, minus, splat3};
use super::sets::{Standing, faces_eye};
use super::volume::{self, DISTANCE_ERROR, Meets, OutCode, out_code};
use crate::math::predicates::{FILTER, Facing, Predicates, TRUSTED_PERMANENT};
use crate::math::{DVec3, View};
use crate::scene::Scene;
use rayon::prelude::*;

/// Vertices or triangles a task.
const CHUNK: usize = 8192;

pub(super) fn standings_on(kernel: Kernel, scene: &Scene, view: &View) -> (Vec<Standing>, Predicates) {
    let mut codes = vec![OutCode::default(); scene.positions.len()];
    codes
        .par_chunks_mut(CHUNK)
        .zip(scene.positions.par_chunks(CHUNK))
        .for_each(|(codes, positions)| vertex_codes(kernel, view, positions, codes));
    let mut standings = vec![Standing { meets: Meets::Certainly, faces: true }; scene.len()];
    let frame = Frame { scene, view, codes: &codes };
    let predicates =
        standings.par_chunks_mut(CHUNK).enumerate().map(|(chunk, out)| frame.chunk(kernel, chunk * CHUNK, out)).reduce(
            Predicates::default,
            |a, b| Predicates { calls: a.calls + b.calls, fallbacks: a.fallbacks + b.fallbacks },
        );
    (standings, predicates)
}

fn vertex_codes(kernel: Kernel, view: &View, positions: &[DVec3], codes: &mut [OutCode]) {
    match kernel {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: `Kernel::Avx2` is given only where the processor has it.
        Kernel::Avx2 => unsafe { vertex_codes_avx2(view, positions, codes) },
        _ => vertex_codes_on::<Plain>(view, positions, codes),
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn vertex_codes_avx2(view: &View, positions: &[DVec3], codes: &mut [OutCode]) {
    vertex_codes_on::<super::lanes::Avx2>(view, positions, codes);
}

#[inline(always)]
fn vertex_codes_on<L: Lanes>(view: &View, positions: &[DVec3], codes: &mut [OutCode]) {
    let eye = splat3::<L>(view.eye);
    let (points, rest) = positions.as_chunks::<LANES>();
    for (points, codes) in points.iter().zip(codes.chunks_exact_mut(LANES)) {
        let p = minus(gather::<L>(*points), eye);
        let size = [p[0].abs(), p[1].abs(), p[2].abs()];
        let (mut certainly_out, mut maybe_out) = (0u32, 0u32);
        for (k, plane) in view.planes.iter().enumerate() {
            let distance = dot(splat3(plane.normal), p) + L::splat(plane.offset_m);
            let scale = dot(splat3(plane.normal.abs()), size) + L::splat(plane.offset_m.abs());
            let error = L::splat(DISTANCE_ERROR) * scale + L::splat(1e-300);
            certainly_out |= spread((-error).gt(distance)) << k;
            maybe_out |= spread(error.ge(distance)) << k;
        }
        let (certainly_out, maybe_out) = (certainly_out.to_le_bytes(), maybe_out.to_le_bytes());
        for (i, code) in codes.iter_mut().enumerate() {
            *code = OutCode { certainly_out: certainly_out[i], maybe_out: maybe_out[i] };
        }
    }
    let done = positions.len() - rest.len();
    for (p, code) in rest.iter().zip(&mut codes[done..]) {
        *code = out_code(&view.planes, *p - view.eye);
    }
}

/// Bit i of four to the lowest bit of byte i.
#[inline(always)]
fn spread(mask: u32) -> u32 {
    mask.wrapping_mul(0x0020_4081) & 0x0101_0101
}

struct Frame<'a> {
    scene: &'a Scene,
    view: &'a View,
    codes: &'a [OutCode],
}

impl Frame<'_> {
    /// Standings of the triangles from `first` on.
    fn chunk(&self, kernel: Kernel, first: usize, out: &mut [Standing]) -> Predicates {
        match kernel {
            #[cfg(target_arch = "x86_64")]
            // SAFETY: `Kernel::Avx2` is given only where the processor has it.
            Kernel::Avx2 => unsafe { self.chunk_avx2(first, out) },
            _ => self.chunk_on::<Plain>(first, out),
        }
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn chunk_avx2(&self, first: usize, out: &mut [Standing]) -> Predicates {
        self.chunk_on::<super::lanes::Avx2>(first, out)
    }

    #[inline(always)]
    fn chunk_on<L: Lanes>(&self, first: usize, out: &mut [Standing]) -> Predicates {
        let mut predicates = Predicates::default();
        let last = first + out.len() - 1;
        for (block, out) in out.chunks_mut(LANES).enumerate() {
            let t = first + block * LANES;
            // The last block may be short: its idle lanes repeat the last triangle.
            let triangles = [t, (t + 1).min(last), (t + 2).min(last), (t + 3).min(last)];
            let (certain, front) = self.filter::<L>(triangles);
            for (i, out) in out.iter_mut().enumerate() {
                let vertices = self.scene.triangles[t + i];
                let codes = [
                    self.codes[vertices[0] as usize],
                    self.codes[vertices[1] as usize],
                    self.codes[vertices[2] as usize],
                ];
                let meets = volume::by_codes(codes).unwrap_or_else(|| self.clip(t + i, codes));
                let faces = if self.scene.two_sided[t + i] {
                    true
                } else if certain >> i & 1 == 1 {
                    predicates.calls += 1;
                    front >> i & 1 == 1
                } else {
                    faces_eye(self.view, &self.scene.corners((t + i) as u32), &mut predicates) == Facing::Front
                };
                *out = Standing { meets, faces };
            }
        }
        predicates
    }

    #[cold]
    fn clip(&self, triangle: usize, codes: [OutCode; 3]) -> Meets {
        let relative = self.scene.corners(triangle as u32).map(|p| p - self.view.eye);
        volume::meets(&self.view.planes, &relative, codes)
    }

    /// The quick step of the facing predicate: lanes that it decides, and those of
    /// them that face the eye.
    #[inline(always)]
    fn filter<L: Lanes>(&self, triangles: [usize; LANES]) -> (u32, u32) {
        let mut corners = [[L::splat(0.0); 3]; 3];
        for (k, corner) in corners.iter_mut().enumerate() {
            let mut points = [DVec3::ZERO; LANES];
            for (point, t) in points.iter_mut().zip(triangles) {
                *point = self.scene.positions[self.scene.triangles[t][k] as usize];
            }
            *corner = gather(points);
        }
        let [v0, v1, v2] = corners;
        let [a, b, c] = match self.view.is_perspective() {
            true => {
                let eye = splat3(self.view.eye);
                [minus(v0, eye), minus(v1, eye), minus(v2, eye)]
            }
            false => [minus(v1, v0), minus(v2, v0), splat3(self.view.forward)],
        };
        let (bxcy, cxby) = (b[0] * c[1], c[0] * b[1]);
        let (cxay, axcy) = (c[0] * a[1], a[0] * c[1]);
        let (axby, bxay) = (a[0] * b[1], b[0] * a[1]);
        let det = a[2] * (bxcy - cxby) + b[2] * (cxay - axcy) + c[2] * (axby - bxay);
        let permanent = (bxcy.abs() + cxby.abs()) * a[2].abs()
            + (cxay.abs() + axcy.abs()) * b[2].abs()
            + (axby.abs() + bxay.abs()) * c[2].abs();
        let trusted = permanent.ge(L::splat(TRUSTED_PERMANENT.start)) & L::splat(TRUSTED_PERMANENT.end).gt(permanent);
        let certain = det.abs().gt(L::splat(FILTER) * permanent) & trusted;
        (certain, L::splat(0.0).gt(det))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{Camera, Pose, Projection};
    use proptest::prelude::*;

    /// The twin: one triangle after another through the scalar functions.
    fn one_by_one(scene: &Scene, view: &View) -> (Vec<Standing>, Predicates) {
        let mut predicates = Predicates::default();
        let standing = |t: usize| {
            let corners = scene.corners(t as u32);
            let meets = volume::triangle_meets(view, &corners);
            let faces = scene.two_sided[t] || faces_eye(view, &corners, &mut predicates) == Facing::Front;
            Standing { meets, faces }
        };
        ((0..scene.len()).map(standing).collect(), predicates)
    }

    proptest! {
        #[test]
        fn lanes_agree_with_one_triangle_after_another(
            coordinates in proptest::collection::vec(-4i32..5, 3 * 21),
            corners in proptest::collection::vec(0u32..21, 3 * 37),
            scale in prop_oneof![Just(1.0), Just(1e-70), Just(1e60)],
            offset in prop_oneof![Just(0.0), Just(1e6 + 0.1)],
            nudge in 0u64..3,
        ) {
            // Whole coordinates put many corners exactly on planes, and the eye in
            // many planes; a nudge of single units of rounding is the hard case.
            let point = |c: &[i32]| {
                let p = DVec3::new(f64::from(c[0]), f64::from(c[1]), f64::from(c[2])) + offset;
                DVec3::new(f64::from_bits(p.x.to_bits() + nudge), p.y, p.z) * scale
            };
            let triangles: Vec<[u32; 3]> = corners.chunks(3).map(|c| [c[0], c[1], c[2]]).collect();
            let scene = Scene {
                positions: coordinates.chunks(3).map(point).collect(),
                two_sided: (0..triangles.len()).map(|t| t % 4 == 3).collect(),
                occluder: vec![true; triangles.len()],
                triangles,
                ..Scene::default()
            };
            let pose = Pose { eye: DVec3::splat(offset * scale), forward: DVec3::X, up: DVec3::Z };
            let ortho = Projection::Orthographic { height_m: 4.0 * scale };
            for camera in [
                Camera { near_m: scale, ..Camera::default() },
                Camera { near_m: scale, far_m: Some(3.0 * scale), ..Camera::default() },
                Camera { projection: ortho, near_m: scale, ..Camera::default() },
            ] {
                let view = View::new(&camera, &pose);
                let twin = one_by_one(&scene, &view);
                for kernel in [Kernel::Plain, Kernel::best()] {
                    prop_assert_eq!(&standings_on(kernel, &scene, &view), &twin);
                }
            }
        }
    }
}
