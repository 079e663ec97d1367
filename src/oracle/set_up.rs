//! Triangles to footprints, four at a time.
//!
//! Most triangles of a distant view hold no sample at all: their sample bounds
//! say so before anything else is computed. Of those left, a triangle whose
//! bounds hold a handful of samples is asked about each at once and leaves only
//! the samples inside ([`Speck`]); the rest become [`Footprint`]s for the tiles.
//! [`Footprint::new`] is the scalar twin.

use super::footprint::{Bounds, Footprint, Lens};
use super::lanes::{Kernel, LANES, Lanes, Plain, cross, dot, gather, minus, splat3};
use super::sets::Standing;
use crate::math::View;
use crate::scene::Scene;

/// A triangle of at most so many candidate samples is drawn here.
const SPECK_SAMPLES: u32 = 8;

/// One sample inside a small triangle that hides.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Speck {
    pub key: f64,
    /// Triangle + 1.
    pub id: u32,
    pub tile: u32,
    /// Index of the sample in its tile, row-major.
    pub at: u32,
}

/// What a chunk of triangles leaves to draw, ascending.
#[derive(Debug, Default)]
pub struct Part {
    pub footprints: Vec<Footprint>,
    pub specks: Vec<Speck>,
}

pub struct SetUp<'a> {
    pub scene: &'a Scene,
    pub view: &'a View,
    pub standings: &'a [Standing],
    pub lens: &'a Lens,
}

/// Values of four triangles, stored for the lanes to be taken one by one.
struct Four {
    edges: [[[f64; LANES]; 3]; 3],
    key: [[f64; LANES]; 3],
    key_min: [f64; LANES],
    key_max: [f64; LANES],
    bounds: [[f64; LANES]; 4],
}

impl SetUp<'_> {
    /// The drawable ones of `triangles`.
    pub fn chunk(&self, kernel: Kernel, triangles: std::ops::Range<usize>) -> Part {
        match kernel {
            #[cfg(target_arch = "x86_64")]
            // SAFETY: `Kernel::Avx2` is given only where the processor has it.
            Kernel::Avx2 => unsafe { self.chunk_avx2(triangles) },
            _ => self.chunk_on::<Plain>(triangles),
        }
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn chunk_avx2(&self, triangles: std::ops::Range<usize>) -> Part {
        self.chunk_on::<super::lanes::Avx2>(triangles)
    }

    #[inline(always)]
    fn chunk_on<L: Lanes>(&self, triangles: std::ops::Range<usize>) -> Part {
        let mut part = Part::default();
        let (mut four, mut count) = ([0; LANES], 0);
        for t in triangles {
            four[count] = t;
            count += usize::from(self.standings[t].drawable());
            if count == LANES {
                self.four::<L>(&four, LANES, &mut part);
                count = 0;
            }
        }
        if count > 0 {
            four[count..].fill(0);
            self.four::<L>(&four, count, &mut part);
        }
        part
    }

    #[inline(always)]
    fn four<L: Lanes>(&self, four: &[usize; LANES], count: usize, part: &mut Part) {
        let lens = self.lens;
        let (eye, axes) = (splat3(self.view.eye), [self.view.right, self.view.up, self.view.forward]);
        let mut p = [[L::splat(0.0); 3]; 3];
        for (k, p) in p.iter_mut().enumerate() {
            let corner = |i: usize| self.scene.positions[self.scene.triangles[four[i]][k] as usize];
            let d = minus(gather::<L>([corner(0), corner(1), corner(2), corner(3)]), eye);
            *p = [dot(d, splat3(axes[0])), dot(d, splat3(axes[1])), dot(d, splat3(axes[2]))];
        }

        // Sample bounds, as `Footprint::new` has them for triangles in front.
        let (mut lo, mut hi) = ([L::splat(f64::INFINITY); 2], [L::splat(f64::NEG_INFINITY); 2]);
        let mut in_front = (1u32 << count) - 1;
        let wanted = in_front;
        for c in &p {
            let at = match lens.perspective {
                true => {
                    in_front &= c[2].ge(L::splat(0.5 * lens.near_m));
                    let w = L::splat(1.0) / c[2];
                    [c[0] * w, c[1] * w]
                }
                false => [c[0], c[1]],
            };
            for axis in 0..2 {
                lo[axis] = lo[axis].min(at[axis]);
                hi[axis] = hi[axis].max(at[axis]);
            }
        }
        let [x0, x1, y0, y1] = bounds_of(lens, lo, hi);
        let holds = x1.ge(x0) & y1.ge(y0);
        for (i, &t) in four.iter().enumerate() {
            if (wanted & !in_front) >> i & 1 == 1 {
                let corners = self.scene.triangles[t].map(|v| self.view.to_camera(self.scene.positions[v as usize]));
                part.footprints.extend(Footprint::new(lens, t as u32 + 1, self.scene.occluder[t], corners));
            }
        }
        let live = in_front & holds;
        if live == 0 {
            return;
        }
        let (values, valid) = edges_and_key(lens, p, [x0, x1, y0, y1]);
        let mut live = live & valid;
        while live != 0 {
            let i = live.trailing_zeros() as usize;
            live &= live - 1;
            self.emit(four[i], &values, i, part);
        }
    }

    /// Lane `i`: its samples if they are few, else itself.
    #[inline(always)]
    fn emit(&self, triangle: usize, values: &Four, i: usize, part: &mut Part) {
        let (lens, id, occluder) = (self.lens, triangle as u32 + 1, self.scene.occluder[triangle]);
        let bounds: Bounds = values.bounds.map(|b| b[i] as u32);
        let edges = values.edges.map(|e| e.map(|c| c[i]));
        let key = values.key.map(|c| c[i]);
        let f = Footprint::of(id, occluder, edges, key, [values.key_min[i], values.key_max[i]], bounds);
        let [x0, x1, y0, y1] = bounds;
        if !occluder || u64::from(x1 - x0 + 1) * u64::from(y1 - y0 + 1) > u64::from(SPECK_SAMPLES) {
            part.footprints.push(f);
            return;
        }
        for y in y0..=y1 {
            for x in x0..=x1 {
                let at = [lens.xs[x as usize], lens.ys[y as usize]];
                if f.inside(at) {
                    let key = f.key_at(at[0], f.key_row(at[1]));
                    let (tile, at) = lens.grid.place(x, y);
                    part.specks.push(Speck { key, id, tile, at });
                }
            }
        }
    }
}

/// Closed sample bounds x0, x1, y0, y1 of what spans `lo..hi` on the image plane.
#[inline(always)]
fn bounds_of<L: Lanes>(lens: &Lens, lo: [L; 2], hi: [L; 2]) -> [L; 4] {
    let (x, y) = (L::splat(lens.xs[0]), L::splat(lens.ys[0]));
    let (across, down) = (L::splat(lens.per_step[0]), L::splat(lens.per_step[1]));
    let slack = L::splat(super::footprint::BOUND_SLACK);
    let (last_x, last_y) = (f64::from(lens.grid.columns() - 1), f64::from(lens.grid.rows() - 1));
    [
        ((lo[0] - x) * across - slack).ceil().max(L::splat(0.0)),
        ((hi[0] - x) * across + slack).floor().min(L::splat(last_x)),
        ((y - hi[1]) * down - slack).ceil().max(L::splat(0.0)),
        ((y - lo[1]) * down + slack).floor().min(L::splat(last_y)),
    ]
}

/// As in `Footprint::new`, and the lanes that have an inside within the clip range.
#[inline(always)]
fn edges_and_key<L: Lanes>(lens: &Lens, mut p: [[L; 3]; 3], bounds: [L; 4]) -> (Four, u32) {
    let (zero, one) = (L::splat(0.0), L::splat(1.0));
    let normal = cross(minus(p[1], p[0]), minus(p[2], p[0]));
    let scale = if lens.perspective { dot(normal, p[0]) } else { normal[2] };
    let (second, third) = (p[1], p[2]);
    for axis in 0..3 {
        p[1][axis] = L::select(scale, third[axis], second[axis]);
        p[2][axis] = L::select(scale, second[axis], third[axis]);
    }
    // No closures over lanes: each would be a function of its own, without AVX2.
    let turned = [-normal[0], -normal[1], -normal[2]];
    let mut turn = [scale; 3];
    for axis in 0..3 {
        turn[axis] = L::select(scale, turned[axis], normal[axis]);
    }
    let normal = turn;
    let scale = scale.abs();
    let mut valid = scale.gt(zero);
    let key = match lens.perspective {
        true => [normal[0] / scale, normal[1] / scale, normal[2] / scale],
        false => [normal[0] / scale, normal[1] / scale, -dot(normal, p[0]) / scale],
    };
    for k in key {
        valid &= L::splat(f64::MAX).ge(k.abs());
    }
    let (near, far) = (p[0][2].min(p[1][2]).min(p[2][2]), p[0][2].max(p[1][2]).max(p[2][2]));
    // In front of the eye: both depths are positive.
    let (key_min, key_max) = if lens.perspective { (one / far, one / near) } else { (-far, -near) };
    valid &= key_max.ge(L::splat(lens.key_far)) & L::splat(lens.key_near).ge(key_min);
    let mut q = p;
    if !lens.perspective {
        // Parallel rays: the same with every corner at unit depth.
        (q[0][2], q[1][2], q[2][2]) = (one, one, one);
    }
    let edges = [cross(q[1], q[2]), cross(q[2], q[0]), cross(q[0], q[1])];
    let mut four = Four {
        edges: [[[0.0; LANES]; 3]; 3],
        key: [[0.0; LANES]; 3],
        key_min: [0.0; LANES],
        key_max: [0.0; LANES],
        bounds: [[0.0; LANES]; 4],
    };
    for (to, edge) in four.edges.iter_mut().zip(edges) {
        for (to, c) in to.iter_mut().zip(edge) {
            c.store(to);
        }
    }
    for (to, k) in four.key.iter_mut().zip(key) {
        k.store(to);
    }
    key_min.store(&mut four.key_min);
    key_max.store(&mut four.key_max);
    for (to, b) in four.bounds.iter_mut().zip(bounds) {
        b.store(to);
    }
    (four, valid)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{Camera, DVec3, Pose, Projection};
    use crate::oracle::image::Grid;
    use proptest::prelude::*;

    /// The twin: every triangle through [`Footprint::new`], every sample asked.
    fn one_by_one(set_up: &SetUp) -> Part {
        let mut part = Part::default();
        let (scene, lens) = (set_up.scene, set_up.lens);
        for t in (0..scene.len()).filter(|t| set_up.standings[*t].drawable()) {
            let corners = scene.corners(t as u32).map(|p| set_up.view.to_camera(p));
            let Some(f) = Footprint::new(lens, t as u32 + 1, scene.occluder[t], corners) else { continue };
            let few = (f.x1 - f.x0 + 1) * (f.y1 - f.y0 + 1) <= SPECK_SAMPLES;
            let crosses = lens.perspective && corners.iter().any(|c| c.z < 0.5 * lens.near_m);
            if !few || crosses || !f.occluder {
                part.footprints.push(f);
                continue;
            }
            for (y, x) in (f.y0..=f.y1).flat_map(|y| (f.x0..=f.x1).map(move |x| (y, x))) {
                let at = [lens.xs[x as usize], lens.ys[y as usize]];
                if f.inside(at) {
                    let (tile, place) = lens.grid.place(x, y);
                    part.specks.push(Speck { key: f.key_at(at[0], f.key_row(at[1])), id: f.id, tile, at: place });
                }
            }
        }
        // Those that cross the near plane come first among their four.
        part.footprints.sort_by_key(|f| f.id);
        part
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn four_at_a_time_is_one_at_a_time(
            coordinates in proptest::collection::vec(-4i32..5, 9 * 13),
            size in prop_oneof![Just(0.02), Just(0.3), Just(2.0)],
            seed in 0usize..64,
        ) {
            use crate::oracle::sets::standings;
            let mut scene = Scene::default();
            for (i, c) in coordinates.chunks(9).enumerate() {
                // Small whole coordinates: repeated corners, slivers and edge-on triangles too.
                let centre = DVec3::new(3.0 + (i % 4) as f64, f64::from(c[0]) * 0.5, f64::from(c[1]) * 0.4);
                let corner = |k: usize| centre + DVec3::new(f64::from(c[k]), f64::from(c[k + 1]), f64::from(c[k + 2])) * size;
                let v = scene.positions.len() as u32;
                scene.positions.extend([corner(0), corner(3), corner(6)]);
                scene.triangles.push([v, v + 1, v + 2]);
                scene.two_sided.push((seed + i) % 3 != 0);
                scene.occluder.push((seed + i) % 5 != 0);
            }
            let pose = Pose { eye: DVec3::new(0.1, 0.0, 0.0), forward: DVec3::X, up: DVec3::Z };
            let ortho = Projection::Orthographic { height_m: 6.0 };
            for camera in [
                Camera { near_m: 1.5, ..Camera::default() },
                Camera { far_m: Some(5.0), ..Camera::default() },
                Camera { projection: ortho, near_m: 1.0, ..Camera::default() },
            ] {
                let view = View::new(&camera, &pose);
                let lens = Lens::new(&view, Grid { width_px: 64 + seed as u32, height_px: 48, samples: 1 });
                let (standings, _) = standings(&scene, &view);
                let set_up = SetUp { scene: &scene, view: &view, standings: &standings, lens: &lens };
                let twin = one_by_one(&set_up);
                for kernel in [Kernel::Plain, Kernel::best()] {
                    let mut part = set_up.chunk(kernel, 0..scene.len());
                    part.footprints.sort_by_key(|f| f.id);
                    prop_assert_eq!(&part.footprints, &twin.footprints);
                    prop_assert_eq!(&part.specks, &twin.specks);
                }
            }
        }
    }
}
