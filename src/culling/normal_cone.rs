//! `normal_cone`: back-face culling of nodes by a cone of normals (Shirmun &
//! Abi-Ezzi 1993), with the rules of the meshoptimizer library. **Conservative**.
//!
//! A node has an axis, the half angle `a` of the cone around it that holds all normals
//! below, and a sphere `(c, R)`. With `d = c - e`, `L = |d|` and `b` the angle between
//! `d` and the axis, every normal turns away from every point of the sphere iff
//! `L cos(a + b) >= R`. Parameter `form`:
//!
//! - `sphere`: `d.axis >= L sin a + R`, meshoptimizer's rule without a square root of its
//!   own. It implies the above where `a + b <= 90 degrees`, and it implies that too.
//! - `tight`: the above as it stands, `cos a (d.axis) - sin a |d x axis| >= R`.
//! - `apex`: in place of the sphere the apex of a cone that lies behind every triangle's
//!   plane, where `R` is 0 but for rounding.
//!
//! What we changed: guards. The axis is rounded to f32 *before* the angle is measured from
//! it, `sin a`, `R` are rounded up, everything else is f64, and the test asks for
//! `16u (L + R)` more. A node with a two-sided triangle, a sliver, a triangle without area,
//! or normals over 84 degrees from the axis has no cone, and no node above it: that is to
//! cones what `saturation` is to masks, and always on. The axis is the centre of a small
//! ball around the normals, found by the iteration of Badoiu & Clarkson (2003).

use super::facing_columns::trusted_normal;
use super::frustum_planes::up;
use super::*;
use crate::hierarchy::{LANES, NONE};
use crate::math::DVec3;
use rayon::prelude::*;

pub const ENTRY: Entry<dyn Test> = Entry {
    name: "normal_cone",
    about: "skip nodes whose cone of normals turns away from the eye (Shirmun & Abi-Ezzi 1993)",
    revision: 2,
    params: &[Param {
        name: "form",
        default: Allowed::Choice(&["sphere", "tight", "apex"]),
        about: "what bounds the place of a node: a sphere (cheap or tight rule), or the apex of a cone behind it",
    }],
    make: |spec| {
        Box::new(NormalCone::new(match spec.text("form") {
            "sphere" => Form::Sphere,
            "tight" => Form::Tight,
            _ => Form::Apex,
        }))
    },
};

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    Sphere,
    Tight,
    Apex,
}

/// Cosine of the widest cone that is worth keeping.
const LEAST_COSINE: f64 = 0.1;
/// Guard relative to distances: 16u.
const GUARD: f64 = 16.0 / (1u32 << 24) as f64;
/// Share of world coordinates by which a fragment may lie off its plane: some ulps of f64.
pub(super) const ULPS: f64 = 1.0 / (1u64 << 44) as f64;

/// Cones of 8 siblings. No cone: `sin_angle` is infinite.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C, align(64))]
pub struct ConeBlock {
    pub axis: [[f32; LANES]; 3],
    pub centre: [[f32; LANES]; 3],
    pub sin_angle: [f32; LANES],
    pub radius_m: [f32; LANES],
}

const EMPTY: ConeBlock = ConeBlock {
    axis: [[0.0; LANES]; 3],
    centre: [[0.0; LANES]; 3],
    sin_angle: [f32::INFINITY; LANES],
    radius_m: [0.0; LANES],
};

/// The test. Columns: a cone a node, and a bit where any node below has one.
pub struct NormalCone {
    form: Form,
    cones: Vec<ConeBlock>,
    below: Vec<u8>,
    eye: DVec3,
    /// Direction of parallel rays.
    parallel: Option<DVec3>,
}

impl NormalCone {
    pub fn new(form: Form) -> NormalCone {
        NormalCone { form, cones: Vec::new(), below: Vec::new(), eye: DVec3::ZERO, parallel: None }
    }
}

impl Test for NormalCone {
    fn class(&self) -> Class {
        Class::Conservative
    }

    fn removes(&self) -> Removes {
        Removes { back_facing: true, ..Default::default() }
    }

    fn prepare(&mut self, scene: &Scene, hierarchy: &Hierarchy) -> usize {
        let normals: Vec<Option<DVec3>> = hierarchy
            .entries
            .par_iter()
            .with_min_len(4096)
            .map(|t| trusted_normal(&scene.corners(*t)).filter(|_| !scene.two_sided[*t as usize]).map(DVec3::normalize))
            .collect();
        let (mut cones, mut below) = (vec![EMPTY; hierarchy.links.len()], vec![0u8; hierarchy.links.len()]);
        super::descent::bottom_up(hierarchy, |block, lane| {
            let links = &hierarchy.links[block];
            let child = links.child[lane];
            if child != NONE {
                let (child, live) = (child as usize, hierarchy.links[child as usize].live);
                let has_cone = |l: usize| cones[child].sin_angle[l].is_finite();
                let with_cone = (0..LANES).fold(0u8, |m, l| m | u8::from(has_cone(l)) << l);
                below[block] |= u8::from((with_cone | below[child]) & live != 0) << lane;
                // What spreads too far below spreads too far here.
                if with_cone & live != live {
                    return;
                }
            }
            let range = links.first[lane]..links.end[lane];
            let own: Option<Vec<DVec3>> = normals[range.start as usize..range.end as usize].iter().copied().collect();
            if let Some((axis, sin_angle)) = own.as_deref().and_then(cone) {
                let (centre, radius_m) = match self.form {
                    Form::Apex => apex(scene, hierarchy, range, own.as_deref().unwrap_or(&[]), axis),
                    _ => sphere(scene, hierarchy, block, lane),
                };
                let out = &mut cones[block];
                for i in 0..3 {
                    out.axis[i][lane] = axis[i];
                    out.centre[i][lane] = centre[i];
                }
                (out.sin_angle[lane], out.radius_m[lane]) = (sin_angle, radius_m);
            }
        });
        (self.cones, self.below) = (cones, below);
        size_of_val(&self.cones[..]) + size_of_val(&self.below[..])
    }

    fn begin(&mut self, view: &View, hierarchy: &Hierarchy) {
        self.eye = view.eye - hierarchy.origin;
        self.parallel = (!view.is_perspective()).then_some(view.forward);
    }

    fn initial_carry(&self) -> u8 {
        1
    }

    fn judge(&mut self, _: &Hierarchy, block: u32, live: u8, _carry: u8, tally: &mut Tally) -> Verdict {
        tally.lane_tests += u64::from(live.count_ones());
        let cones = &self.cones[block as usize];
        let mut verdict = Verdict { outside: 0, carry: [0; LANES] };
        for lane in 0..LANES {
            verdict.outside |= u8::from(self.is_averted(cones, lane)) << lane;
            verdict.carry[lane] = self.below[block as usize] >> lane & 1;
        }
        verdict.outside &= live;
        verdict
    }
}

impl NormalCone {
    /// Written so that NaN, and the infinite sine of no cone, keep the node.
    fn is_averted(&self, cones: &ConeBlock, lane: usize) -> bool {
        let vector = |rows: &[[f32; LANES]; 3]| DVec3::from_array([0, 1, 2].map(|i| f64::from(rows[i][lane])));
        let (axis, sin_angle) = (vector(&cones.axis), f64::from(cones.sin_angle[lane]));
        if let Some(direction) = self.parallel {
            return direction.dot(axis) >= sin_angle + GUARD;
        }
        let d = vector(&cones.centre) - self.eye;
        let (along, length, radius) = (d.dot(axis), d.length(), f64::from(cones.radius_m[lane]));
        let needed = radius + GUARD * (length + radius);
        if self.form == Form::Tight {
            // Not sqrt(L^2 - along^2): the rounded axis is no unit vector, and near it that cancels.
            let across = d.cross(axis).length();
            along > 0.0 && (1.0 - sin_angle * sin_angle).sqrt() * along - sin_angle * across >= needed
        } else {
            along >= sin_angle * length + needed
        }
    }
}

/// Axis, rounded, and the sine of the angle around it that holds all normals, rounded up.
fn cone(normals: &[DVec3]) -> Option<([f32; 3], f32)> {
    let mut centre = *normals.first()?;
    for step in 1..=16 {
        let away = |n: &&DVec3| (**n - centre).length_squared();
        let farthest = normals.iter().max_by(|a, b| away(a).total_cmp(&away(b)))?;
        centre += (*farthest - centre) / f64::from(step + 1);
    }
    let axis = centre.try_normalize()?.as_vec3();
    let unit = axis.as_dvec3().normalize();
    let cosine = normals.iter().fold(1f64, |m, n| m.min(n.dot(unit)));
    let sine = (1.0 - cosine * cosine).max(0.0).sqrt() as f32;
    (cosine > LEAST_COSINE).then_some((axis.to_array(), sine.next_up()))
}

/// A sphere that holds a point of every piece below: around the box's centre, through
/// the farthest corner of a piece or of the box, whichever is nearer.
fn sphere(scene: &Scene, hierarchy: &Hierarchy, block: usize, lane: usize) -> ([f32; 3], f32) {
    let bounds = hierarchy.bounds[block].get(lane);
    let (lo, hi) = (bounds.lo.as_dvec3(), bounds.hi.as_dvec3());
    let centre = ((lo + hi) * 0.5).as_vec3();
    let c = centre.as_dvec3();
    let box_radius = (c - lo).abs().max((hi - c).abs()).length();
    let links = &hierarchy.links[block];
    let pieces = (links.first[lane]..links.end[lane]).flat_map(|p| hierarchy.piece(scene, p));
    let piece_radius = pieces.fold(0f64, |m, p| m.max((p - hierarchy.origin - c).length()));
    let slack = (hierarchy.origin.abs().max_element() + lo.abs().max(hi.abs()).max_element()) * ULPS;
    (centre.to_array(), up(box_radius.min(piece_radius) + slack))
}

/// A point behind the planes of all triangles of `range`, on the axis through the middle of
/// their first corners, and by how much rounding fails that.
fn apex(
    scene: &Scene,
    hierarchy: &Hierarchy,
    range: std::ops::Range<u32>,
    normals: &[DVec3],
    axis: [f32; 3],
) -> ([f32; 3], f32) {
    let corner = |position: u32| scene.corners(hierarchy.entries[position as usize])[0] - hierarchy.origin;
    let axis = DVec3::from_array(axis.map(f64::from));
    let middle = range.clone().map(corner).sum::<DVec3>() / normals.len() as f64;
    let planes = || range.clone().map(corner).zip(normals);
    let back = planes().fold(0f64, |m, (v, n)| m.max(n.dot(middle - v) / n.dot(axis)));
    let apex = (middle - axis * back).as_vec3();
    let short = planes().fold(0f64, |m, (v, n)| m.max(n.dot(apex.as_dvec3() - v)));
    let slack = (hierarchy.origin.abs().max_element() + middle.abs().max_element() + back) * ULPS;
    // A normal is known within 2^-29: beside the distance of its corner that shows.
    let tilt = planes().fold(0f64, |m, (v, _)| m.max((v - apex.as_dvec3()).length())) * (-29f64).exp2();
    (apex.to_array(), up(short + slack + tilt))
}
