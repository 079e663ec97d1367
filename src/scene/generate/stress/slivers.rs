//! `slivers`: closed solids with triangles as thin as one likes, whose normals
//! vanish in f32: needles, prisms, and boxes with a hairline seam around them.

use super::soup::Soup;
use super::{Axes, HOLLOW, RADIUS, SEED, Shell};
use crate::math::DVec3;
use crate::registry::{Default, Entry, Param, Spec};
use crate::scene::Scene;
use crate::scene::generate::Generator;
use crate::scene::generate::random::Random;

pub const ENTRY: Entry<dyn Generator> = Entry {
    name: "slivers",
    about: "stress: closed solids of sliver triangles, for normals and their clusters",
    revision: 1,
    params: &[
        Param {
            name: "slivers",
            default: Default::Int { value: 1500, min: 1, max: 100_000 },
            about: "number of solids, 4 to 28 triangles each",
        },
        Param {
            name: "aspect",
            default: Default::Float { value: 1e4, min: 1.0, max: 1e9 },
            about: "length over width of the thin triangles",
        },
        Param {
            name: "length_m",
            default: Default::Float { value: 4.0, min: 0.01, max: 100.0 },
            about: "length of the thin triangles",
        },
        Param {
            name: "shape",
            default: Default::Choice(&["mixed", "needle", "prism", "seam"]),
            about: "needles and prisms are thin themselves; a seam is a thin strip around a box",
        },
        RADIUS,
        HOLLOW,
        SEED,
    ],
    make: |spec| Box::new(Slivers::new(spec)),
};

const SHAPES: [&str; 3] = ["needle", "prism", "seam"];
const TETRAHEDRON: [[u32; 3]; 4] = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];

struct Slivers {
    slivers: usize,
    length_m: f64,
    width_m: f64,
    /// One of [`SHAPES`]; none is all of them.
    shape: Option<usize>,
    shell: Shell,
    seed: u64,
}

impl Slivers {
    fn new(spec: &Spec) -> Slivers {
        let length_m = spec.float("length_m");
        Slivers {
            slivers: spec.int("slivers") as usize,
            length_m,
            width_m: length_m / spec.float("aspect"),
            shape: SHAPES.iter().position(|s| *s == spec.text("shape")),
            shell: Shell::of(spec),
            seed: spec.int("seed") as u64,
        }
    }
}

impl Generator for Slivers {
    fn generate(&self) -> Scene {
        let mut soup = Soup::new("slivers");
        let mut rng = Random::part(self.seed, 13);
        let (l, w) = (self.length_m, self.width_m);
        // Once around an equilateral triangle of edge w, at height z.
        let ring = |z: f64| {
            let low = -w * 3f64.sqrt() / 6.0;
            [(-0.5 * w, low), (0.5 * w, low), (0.0, -2.0 * low)].map(|(x, y)| DVec3::new(x, y, z))
        };
        for _ in 0..self.slivers {
            let shape = self.shape.unwrap_or_else(|| rng.below(SHAPES.len()));
            let axes = Axes::random(&mut rng);
            let at = self.shell.point(l, &mut rng);
            let (corners, faces) = match shape {
                0 => ([&ring(-0.5 * l)[..], &[DVec3::new(0.0, 0.0, 0.5 * l)]].concat(), TETRAHEDRON.to_vec()),
                1 => tube(&[ring(-0.5 * l), ring(0.5 * l)]),
                _ => {
                    let square = |z: f64| {
                        let h = 0.5 * l;
                        [(-h, -h), (h, -h), (h, h), (-h, h)].map(|(x, y)| DVec3::new(x, y, z))
                    };
                    let seam = rng.range(-0.3, 0.3) * l;
                    tube(&[square(-0.5 * l), square(seam), square(seam + w), square(0.5 * l + w)])
                }
            };
            soup.paint(["red_needle", "blue_prism", "grey_box"][shape]);
            let placed: Vec<DVec3> = corners.iter().map(|p| axes.place(at, *p)).collect();
            soup.solid(&placed, &faces);
        }
        soup.finish()
    }
}

/// Rings joined in a row, closed at both ends; counter-clockwise seen from the last one.
fn tube<const N: usize>(rings: &[[DVec3; N]]) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let n = N as u32;
    let last = (rings.len() as u32 - 1) * n;
    let mut faces = Vec::new();
    for i in 1..n - 1 {
        faces.push([0, i + 1, i]);
        faces.push([last, last + i, last + i + 1]);
    }
    for below in (0..last).step_by(N) {
        for i in 0..n {
            let (a, b) = (below + i, below + (i + 1) % n);
            faces.push([a, b, b + n]);
            faces.push([a, b + n, a + n]);
        }
    }
    (rings.concat(), faces)
}
