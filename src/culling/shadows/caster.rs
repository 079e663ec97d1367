//! An occluder as a view sees it: the lines around its shadow, and the plane behind which
//! things must lie to be in it.

use super::MARGIN;
use super::image::Image;
use super::outline::Line;
use super::polygons::{Polygon, Polygons, UNSHARED};
use crate::math::DVec3;

/// Least cosine between an occluder's normal and the way to the eye, beside what rounding
/// and unevenness ask for.
const LEAST_COSINE: f64 = 1e-6;
/// An occluder that is steeper at some corner, or has an image with more acute angles
/// (cosine between the normals of neighbouring edges), shares no edges: within rounding of
/// one, the other need not be what hides.
const SHARING_COSINE: f64 = 2e-2;
const ACUTE: f64 = -0.9998;
/// Of the farthest corner: how far behind the plane things are certainly behind.
const BEHIND: f64 = 1e-6;

/// The shadow is at distance `at` or more from `line`.
#[derive(Debug, Clone, Copy)]
pub struct Side {
    pub line: Line,
    pub at: f64,
    edge: u64,
    /// The line was turned round, so that the shadow is where it is positive.
    turned: bool,
}

#[derive(Debug, Clone)]
pub struct Caster {
    pub sides: Vec<Side>,
    /// Towards the eye.
    pub normal: DVec3,
    /// Points `p` relative to the eye with `normal . p` below are behind all of it.
    pub behind_m: f64,
    shares: bool,
}

impl Caster {
    /// `None` if it hides nothing in this view, or too little to be sure.
    pub fn new(image: &Image, polygons: &Polygons, polygon: &Polygon) -> Option<Caster> {
        let corners = polygons.corners(polygon);
        let fits = |wrong: f64| wrong * MARGIN <= image.guard;
        // At the near plane, where also what lies before or behind moves on the image.
        let wide = 1.0 + image.half[0] + image.half[1];
        let slack = polygon.slack_m * if image.perspective { wide / image.near_m } else { 1.0 };
        if slack > 0.5 * image.guard {
            return None;
        }
        let from_eye = |p: DVec3| p - image.eye;
        // The least cosine of a corner, and of all that lies between corners: the height
        // above a plane is linear, the distance convex.
        let cosine = |normal: DVec3| match image.perspective {
            true => corners.iter().fold(1.0f64, |m, c| m.min(-normal.dot(from_eye(c.at).normalize_or_zero()))),
            false => -normal.dot(image.axes[2]),
        };
        let least = polygon.spread + LEAST_COSINE;
        let (normal, seen) = match cosine(polygon.normal) {
            front if front >= least => (polygon.normal, front),
            _ if polygon.two_sided => (-polygon.normal, cosine(-polygon.normal)),
            _ => return None,
        };
        if seen < least {
            return None;
        }
        let mut caster = Caster { sides: Vec::with_capacity(corners.len() + 1), normal, behind_m: 0.0, shares: false };
        let points: Vec<DVec3> = corners.iter().map(|c| image.camera(from_eye(c.at))).collect();
        let inner = image.camera(from_eye(polygon.centroid));
        let mut turns = Vec::with_capacity(corners.len());
        for (i, corner) in corners.iter().enumerate() {
            let (a, b) = (points[i], points[(i + 1) % points.len()]);
            let [a, b] = if corner.ascending { [a, b] } else { [b, a] };
            let (line, wrong) = if image.perspective { through_eye(a, b) } else { through(a, b) };
            if !fits(wrong) {
                return None;
            }
            let turned = line.dot(if image.perspective { inner } else { inner.with_z(1.0) }) < 0.0;
            let line = if turned { -line } else { line };
            turns.push(line.truncate().normalize_or_zero());
            caster.side(image, line, corner.edge, turned)?;
        }
        let round = turns.iter().zip(turns.iter().cycle().skip(1));
        let shapely = round.fold(1.0f64, |m, (a, b)| m.min(a.dot(*b))) >= ACUTE;

        let heights = corners.iter().map(|c| -normal.dot(from_eye(c.at)));
        let (low_m, high_m) = heights.fold((f64::INFINITY, 0.0f64), |(lo, hi), h| (lo.min(h), hi.max(h)));
        let reach_m = corners.iter().fold(0.0f64, |m, c| m.max(from_eye(c.at).length()));
        caster.behind_m = -high_m - BEHIND * reach_m;
        // What is nearer than the near plane hides nothing.
        let mut whole = true;
        if points.iter().any(|p| p.z < image.near_m * (1.0 + 1e-6)) {
            let n = image.camera(normal);
            let line = match image.perspective {
                true => n + DVec3::Z * (low_m / (image.near_m * (1.0 + 1e-6))),
                false => DVec3::new(n.x, n.y, low_m - image.near_m * n.z.abs()),
            };
            let before = caster.sides.len();
            caster.side(image, line, UNSHARED, false)?;
            whole = caster.sides.len() == before;
        }
        caster.shares = shapely && whole && seen >= SHARING_COSINE.max(least) && fits(slack);
        Some(caster)
    }

    /// Adds a side, unless all of the image is on the right side of it; `None` if all is on
    /// the wrong one.
    fn side(&mut self, image: &Image, line: DVec3, edge: u64, turned: bool) -> Option<()> {
        let across = line.x.abs() * image.half[0] + line.y.abs() * image.half[1];
        let length = line.truncate().length();
        let at = image.guard * length;
        // Twice the guard: outlines reach beyond the image by one.
        if line.z - across >= 4.0 * at {
            return Some(());
        }
        if line.z + across <= at || length == 0.0 {
            return None;
        }
        let line = (line / length).to_array();
        self.sides.push(Side { line, at: image.guard, edge, turned });
        Some(())
    }

    /// Whether all of a box relative to the eye is behind; nothing of it, if `None`.
    #[inline]
    pub fn hides(&self, [lo, hi]: [DVec3; 2]) -> Option<bool> {
        let (a, b) = (self.normal * lo, self.normal * hi);
        let farthest = a.min(b).element_sum();
        if farthest >= self.behind_m {
            return None;
        }
        Some(a.max(b).element_sum() < self.behind_m)
    }
}

/// The plane through the eye and two points as a line, and by what it may be wrong between
/// them.
fn through_eye(a: DVec3, b: DVec3) -> (DVec3, f64) {
    let line = a.cross(b);
    (line, 16.0 * f64::EPSILON * a.length() * b.length() / line.length())
}

/// The same for parallel rays.
fn through(a: DVec3, b: DVec3) -> (DVec3, f64) {
    let (a, b) = (a.with_z(1.0), b.with_z(1.0));
    let line = a.cross(b);
    let reach = a.length().max(b.length());
    // Points that coincide on the image have no line.
    let short = line.truncate().length() < 1e-9 * reach;
    (line, if short { f64::INFINITY } else { 32.0 * f64::EPSILON * reach })
}

/// Takes the guard off edges that exactly two casters share from either side.
pub fn share_edges(casters: &mut [Caster]) {
    let mut edges: Vec<(u64, bool, usize, usize)> = Vec::new();
    for (i, caster) in casters.iter().enumerate().filter(|(_, c)| c.shares) {
        let named = caster.sides.iter().enumerate().filter(|(_, s)| s.edge != UNSHARED);
        edges.extend(named.map(|(j, s)| (s.edge, s.turned, i, j)));
    }
    edges.sort_unstable();
    for same in edges.chunk_by(|a, b| a.0 == b.0) {
        if let [(_, s, i, j), (_, t, k, l)] = *same
            && s != t
        {
            casters[i].sides[j].at = 0.0;
            casters[k].sides[l].at = 0.0;
        }
    }
}
