//! `degenerate`: a cloud of boxes whose file is damaged. Among the good faces lie
//! some without area, with NaN, infinite, huge and subnormal coordinates; most of
//! them are left out on the way in, and the load report counts them.

use super::boxes::random_box;
use super::soup::Soup;
use super::{HOLLOW, RADIUS, SEED, Shell};
use crate::math::DVec3;
use crate::registry::{Default, Entry, Param, Spec};
use crate::scene::Scene;
use crate::scene::generate::Generator;
use crate::scene::generate::random::Random;

pub const ENTRY: Entry<dyn Generator> = Entry {
    name: "degenerate",
    about: "stress: boxes among faces without area, NaN, infinite, huge and subnormal ones",
    revision: 1,
    params: &[
        Param {
            name: "boxes",
            default: Default::Int { value: 2000, min: 1, max: 100_000 },
            about: "number of boxes, 12 good triangles each",
        },
        Param {
            name: "share",
            default: Default::Float { value: 0.01, min: 0.0, max: 0.9 },
            about: "bad faces, of all faces in the source",
        },
        Param {
            name: "kind",
            default: Default::Choice(&["mixed", "zero_area", "not_a_number", "infinite", "huge", "subnormal"]),
            about: "what is bad; huge is 1e30 m, and faces with subnormal heights are kept",
        },
        RADIUS,
        HOLLOW,
        SEED,
    ],
    make: |spec| Box::new(Degenerate::new(spec)),
};

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    ZeroArea,
    Nan,
    Infinite,
    Huge,
    Subnormal,
}

const KINDS: [(&str, Kind); 5] = [
    ("zero_area", Kind::ZeroArea),
    ("not_a_number", Kind::Nan),
    ("infinite", Kind::Infinite),
    ("huge", Kind::Huge),
    ("subnormal", Kind::Subnormal),
];
const SIZE_M: f64 = 2.0;

struct Degenerate {
    boxes: usize,
    share: f64,
    /// None: all kinds in turn.
    kind: Option<Kind>,
    shell: Shell,
    seed: u64,
}

impl Degenerate {
    fn new(spec: &Spec) -> Degenerate {
        Degenerate {
            boxes: spec.int("boxes") as usize,
            share: spec.float("share"),
            kind: KINDS.iter().find(|k| k.0 == spec.text("kind")).map(|k| k.1),
            shell: Shell::of(spec),
            seed: spec.int("seed") as u64,
        }
    }
}

impl Generator for Degenerate {
    fn generate(&self) -> Scene {
        let mut soup = Soup::new("degenerate");
        // Streams of their own: the good boxes are the same at every share.
        let (mut good, mut bad) = (Random::part(self.seed, 15), Random::part(self.seed, 16));
        let per_good = self.share / (1.0 - self.share);
        let mut made = 0;
        for done in 1..=self.boxes {
            soup.paint_one_of("box", &mut good);
            let first = soup.block(&random_box(SIZE_M, true, &self.shell, &mut good));
            let due = (done as f64 * 12.0 * per_good).round() as usize;
            for k in made..due {
                let kind = self.kind.unwrap_or(KINDS[k % KINDS.len()].1);
                bad_face(&mut soup, first, kind, k, &self.shell, &mut bad);
            }
            made = due;
        }
        soup.finish()
    }
}

/// One bad face at the box whose corners begin at `first`, as an exporter would leave it.
fn bad_face(soup: &mut Soup, first: u32, kind: Kind, k: usize, shell: &Shell, rng: &mut Random) {
    let corner = soup.scene.positions[first as usize];
    let sign = if rng.chance(0.5) { 1.0 } else { -1.0 };
    let axis = DVec3::AXES[rng.below(3)];
    // One coordinate of one corner is wrong.
    let spoilt = |value: f64| corner * (DVec3::ONE - axis) + axis.map(|a| if a == 0.0 { 0.0 } else { value });
    let third = match kind {
        // Twice the same corner, or three on a line.
        Kind::ZeroArea if k.is_multiple_of(2) => {
            soup.face([first, first + 1, first]);
            return;
        }
        Kind::ZeroArea => {
            // From the origin through a point and its double: exact, so exactly on a line.
            let v = soup.vertices(&[corner * 0.5, corner, corner * 2.0]);
            soup.face([v, v + 1, v + 2]);
            return;
        }
        Kind::Subnormal => {
            let at = shell.point_on_disc(1.0, rng);
            let mut height = || f64::from_bits(1 + rng.bits() % (1 << 51));
            let corners = [at, at + DVec3::X, at + DVec3::Y].map(|p| p.with_z(height()));
            let v = soup.vertices(&corners);
            soup.face([v, v + 1, v + 2]);
            return;
        }
        Kind::Nan => spoilt(f64::NAN),
        Kind::Infinite => spoilt(sign * f64::INFINITY),
        Kind::Huge => spoilt(sign * 1e30),
    };
    let v = soup.vertices(&[third]);
    soup.face([first, first + 1, v]);
}
