//! Through which part of the faces between cells one can look (for a portal-octree).
//!
//! A ray that crosses a face is stopped there only by a triangle that lies exactly in
//! the plane of the face, is an occluder, and shows its front to where the ray comes
//! from (or has no back). Each face carries a mask of texels; a texel is *closed* only
//! if such triangles certainly cover all of it, and the opening is the bounding
//! rectangle of all others. What stands free inside a cell stops nothing, which is
//! conservative.
//!
//! Covering is decided without areas and tolerances. An edge of a blocker is a *rim*
//! unless another blocker lies along it on the other side of the line: the same two
//! end points, or for edges along an axis any common stretch, so that T-junctions of
//! walls leave no rim. A texel whose inside no rim meets and whose centre is in a blocker
//! is covered: a way inside it to a point outside of all blockers would leave the last
//! of them through an edge that is no rim, and so enter another one. Comparisons are
//! of the coordinates themselves and of exact orientations (Shewchuk 1997); rims that
//! lie inside a third blocker count all the same, which opens too much.

use crate::hierarchy::portals::{CLOSED, Opening, across, texel_line, touching};
use crate::math::DVec2;
use crate::scene::Scene;
use rayon::prelude::*;

/// A triangle of a plane, counter-clockwise in the axes [`across`] it.
pub type Blocker = [DVec2; 3];
/// Part of an edge beyond which nothing is known to block.
pub type Rim = [DVec2; 2];

/// By axis and cell (x fastest, 2^`bits` to an axis), as `Portals::openings`.
pub fn openings(scene: &Scene, planes: &[Vec<f64>; 3], bits: u32, texels: u32) -> [Vec<[Opening; 2]>; 3] {
    [0, 1, 2].map(|axis| across_axis(scene, planes, bits, texels, axis))
}

fn across_axis(scene: &Scene, planes: &[Vec<f64>; 3], bits: u32, texels: u32, axis: usize) -> Vec<[Opening; 2]> {
    let side = 1usize << bits;
    let inner = &planes[axis][1..side];
    let mut blockers: Vec<[Vec<Blocker>; 2]> = vec![Default::default(); inner.len()];
    for t in (0..scene.len() as u32).filter(|t| scene.occluder[*t as usize]) {
        let corners = scene.corners(t);
        let at = corners[0][axis];
        if corners.iter().any(|c| c[axis] != at) {
            continue;
        }
        let first = inner.partition_point(|p| *p < at);
        for plane in (first..inner.len()).take_while(|p| inner[*p] == at) {
            let [u, v] = across(axis);
            let flat = corners.map(|c| DVec2::new(c[u], c[v]) + 0.0);
            for (direction, blocker) in [facing(&flat, false), facing(&flat, true)].into_iter().enumerate() {
                // The one that faces down stops what comes from below.
                let two_sided = scene.two_sided[t as usize];
                let either = || facing(&flat, direction == 0);
                blockers[plane][direction].extend(blocker.or_else(|| two_sided.then(either).flatten()));
            }
        }
    }
    let layers: Vec<Vec<(usize, usize, Opening)>> = blockers
        .par_iter()
        .enumerate()
        .map(|(plane, both)| {
            let closed = both.iter().enumerate().flat_map(|(direction, blockers)| {
                let faces = Layer::new(planes, bits, texels, axis).openings(blockers);
                faces.into_iter().map(move |(j, k, opening)| (direction, j, k, opening))
            });
            let [u, v] = across(axis);
            let number =
                |j: usize, k: usize| (plane << (axis as u32 * bits)) | j << (u as u32 * bits) | k << (v as u32 * bits);
            closed.map(|(direction, j, k, opening)| (number(j, k), direction, opening)).collect()
        })
        .collect();
    let whole = [0, 0, texels as u8, texels as u8];
    let outer = |cell: usize| cell >> (axis as u32 * bits) & (side - 1) == side - 1;
    let mut all: Vec<[Opening; 2]> =
        (0..1usize << (3 * bits)).map(|cell| [if outer(cell) { CLOSED } else { whole }; 2]).collect();
    layers.into_iter().flatten().for_each(|(cell, direction, opening)| all[cell][direction] = opening);
    all
}

/// The triangle counter-clockwise, if its front is towards the upper (or lower) side
/// and its coordinates are such that orientations are exact.
fn facing(flat: &Blocker, up: bool) -> Option<Blocker> {
    if !flat.iter().all(|p| exact(p.x) && exact(p.y)) {
        return None;
    }
    let [a, b, c] = *flat;
    let turn = orientation(a, b, c);
    (turn != 0.0 && (turn > 0.0) == up).then_some(if up { [a, b, c] } else { [a, c, b] })
}

/// Far from where products of two coordinates lose digits at the ends of f64.
fn exact(x: f64) -> bool {
    x == 0.0 || (1e-40..1e60).contains(&x.abs())
}

fn orientation(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    let coord = |p: DVec2| robust::Coord { x: p.x, y: p.y };
    robust::orient2d(coord(a), coord(b), coord(c))
}

/// The faces of one plane.
struct Layer<'a> {
    lines: [&'a [f64]; 2],
    texels: u32,
}

impl<'a> Layer<'a> {
    fn new(planes: &'a [Vec<f64>; 3], bits: u32, texels: u32, axis: usize) -> Layer<'a> {
        debug_assert_eq!(planes[axis].len(), (1 << bits) + 1);
        Layer { lines: across(axis).map(|a| &planes[a][..]), texels }
    }

    /// Faces that are not wholly open, and their openings.
    fn openings(&self, blockers: &[Blocker]) -> Vec<(usize, usize, Opening)> {
        if blockers.is_empty() {
            return Vec::new();
        }
        let rims = rims(blockers);
        let side = [self.lines[0].len() - 1, self.lines[1].len() - 1];
        let mut of_face: Vec<(Vec<u32>, Vec<u32>)> = vec![Default::default(); side[0] * side[1]];
        let reach = |points: &[DVec2]| {
            [0, 1].map(|i| {
                let (lo, hi) =
                    points.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |r, p| (r.0.min(p[i]), r.1.max(p[i])));
                touching(self.lines[i], lo, hi)
            })
        };
        for (i, b) in (0u32..).zip(blockers) {
            let [us, vs] = reach(b);
            us.flat_map(|j| vs.clone().map(move |k| k * side[0] + j)).for_each(|f| of_face[f].0.push(i));
        }
        for (i, r) in (0u32..).zip(&rims) {
            let [us, vs] = reach(r);
            us.flat_map(|j| vs.clone().map(move |k| k * side[0] + j)).for_each(|f| of_face[f].1.push(i));
        }
        let opening = |(face, (b, r)): (usize, &(Vec<u32>, Vec<u32>))| {
            let at = [face % side[0], face / side[0]];
            let of = |texels: u32| {
                [0, 1].map(|i| -> Vec<f64> {
                    let (lo, hi) = (self.lines[i][at[i]], self.lines[i][at[i] + 1]);
                    (0..=texels).map(|t| texel_line(lo, hi, t, texels)).collect()
                })
            };
            let b: Vec<Blocker> = b.iter().map(|i| blockers[*i as usize]).collect();
            let r: Vec<Rim> = r.iter().map(|i| rims[*i as usize]).collect();
            // Most faces are covered by one wall, or beside it: as a single texel.
            let texels = self.texels as u8;
            let whole = if open_texels(&of(1), &b, &[])[0] { [0, 0, texels, texels] } else { CLOSED };
            let [us, vs] = of(1);
            let (lo, hi) = (DVec2::new(us[0], vs[0]), DVec2::new(us[1], vs[1]));
            let mixed = r.iter().any(|r| enters(r, lo, hi));
            (
                at[0],
                at[1],
                if mixed { bounding(&open_texels(&of(self.texels), &b, &r), self.texels as usize) } else { whole },
            )
        };
        of_face.par_iter().enumerate().filter(|(_, f)| !f.0.is_empty()).map(opening).collect()
    }
}

/// What is left of the blockers' edges where none meets another from the other side.
pub fn rims(blockers: &[Blocker]) -> Vec<Rim> {
    // End points in order, and whether the blocker lies to the left.
    let mut edges: Vec<(DVec2, DVec2, bool)> = Vec::with_capacity(3 * blockers.len());
    for b in blockers {
        for i in 0..3 {
            let (p, q) = (b[i], b[(i + 1) % 3]);
            let ahead = before(p, q).is_lt();
            // Counter-clockwise: it lies to the left of p -> q.
            edges.push(if ahead { (p, q, true) } else { (q, p, false) });
        }
    }
    let (along, slanted): (Vec<_>, Vec<_>) = edges.into_iter().partition(|(p, q, _)| p.x == q.x || p.y == q.y);
    let mut rims = Vec::new();
    let mut slanted = slanted;
    slanted.sort_by(|a, b| before(a.0, b.0).then(before(a.1, b.1)));
    for same in slanted.chunk_by(|a, b| a.0 == b.0 && a.1 == b.1) {
        if same.iter().all(|e| e.2 == same[0].2) {
            rims.push([same[0].0, same[0].1]);
        }
    }
    for axis in 0..2 {
        // Vertical lines first: those of equal x, along y.
        let mut here: Vec<_> = along.iter().filter(|(p, q, _)| p[axis] == q[axis]).collect();
        here.sort_by(|a, b| a.0[axis].total_cmp(&b.0[axis]));
        for line in here.chunk_by(|a, b| a.0[axis] == b.0[axis]) {
            one_sided(line.iter().map(|(p, q, left)| (p[1 - axis], q[1 - axis], *left)), |from, to| {
                let point = |x: f64| if axis == 0 { DVec2::new(line[0].0.x, x) } else { DVec2::new(x, line[0].0.y) };
                rims.push([point(from), point(to)]);
            });
        }
    }
    rims
}

fn before(p: DVec2, q: DVec2) -> std::cmp::Ordering {
    p.x.total_cmp(&q.x).then(p.y.total_cmp(&q.y))
}

/// Stretches of a line that intervals of one side cover and those of the other do not.
fn one_sided(intervals: impl Iterator<Item = (f64, f64, bool)>, mut each: impl FnMut(f64, f64)) {
    let mut events: Vec<(f64, bool, i32)> = intervals.flat_map(|(a, b, left)| [(a, left, 1), (b, left, -1)]).collect();
    events.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut depth = [0; 2];
    let mut from = None;
    for here in events.chunk_by(|a, b| a.0 == b.0) {
        here.iter().for_each(|(_, left, step)| depth[usize::from(*left)] += step);
        let rim = (depth[0] > 0) != (depth[1] > 0);
        match from {
            None if rim => from = Some(here[0].0),
            Some(start) if !rim => {
                each(start, here[0].0);
                from = None;
            }
            _ => {}
        }
    }
}

/// By texel, v-major: not certainly covered. `lines` are those between the texels.
pub fn open_texels(lines: &[Vec<f64>; 2], blockers: &[Blocker], rims: &[Rim]) -> Vec<bool> {
    let [us, vs] = [lines[0].len() - 1, lines[1].len() - 1];
    let mut open = vec![false; us * vs];
    let usable = |l: &[f64]| l.iter().all(|x| exact(*x)) && l.windows(2).all(|w| w[0] < w[1]);
    if !usable(&lines[0]) || !usable(&lines[1]) {
        open.fill(true);
        return open;
    }
    let corners =
        |i: usize, j: usize| (DVec2::new(lines[0][i], lines[1][j]), DVec2::new(lines[0][i + 1], lines[1][j + 1]));
    // Rims on the border of a texel leave it whole, but not alike with its neighbour.
    let mut touched = vec![false; us * vs];
    for rim in rims {
        let (lo, hi) = (rim[0].min(rim[1]), rim[0].max(rim[1]));
        for j in touching(&lines[1], lo.y, hi.y) {
            for i in touching(&lines[0], lo.x, hi.x) {
                let (a, b) = corners(i, j);
                touched[j * us + i] = true;
                open[j * us + i] |= enters(rim, a, b);
            }
        }
    }
    let crossed = open.clone();
    let covered = |i: usize, j: usize| {
        let (a, b) = corners(i, j);
        let centre = DVec2::new(a.x + (b.x - a.x) * 0.5, a.y + (b.y - a.y) * 0.5).clamp(a, b);
        blockers.iter().any(|t| (0..3).all(|k| orientation(t[k], t[(k + 1) % 3], centre) >= 0.0))
    };
    for j in 0..vs {
        for i in (0..us).filter(|i| !crossed[j * us + i]) {
            let at = j * us + i;
            // No rim lies between two that none touches: they agree.
            open[at] = if i > 0 && !touched[at] && !touched[at - 1] {
                open[at - 1]
            } else if j > 0 && !touched[at] && !touched[at - us] {
                open[at - us]
            } else {
                !covered(i, j)
            };
        }
    }
    open
}

/// Whether the rim has a point inside of the open rectangle.
fn enters([p, q]: &Rim, a: DVec2, b: DVec2) -> bool {
    let (lo, hi) = (p.min(*q), p.max(*q));
    let overlaps = lo.x < b.x && hi.x > a.x && lo.y < b.y && hi.y > a.y;
    let crosses = || {
        let turns = [a, DVec2::new(b.x, a.y), b, DVec2::new(a.x, b.y)].map(|c| orientation(*p, *q, c));
        !(turns.iter().all(|t| *t >= 0.0) || turns.iter().all(|t| *t <= 0.0))
    };
    overlaps && (p.x == q.x || p.y == q.y || crosses())
}

fn bounding(open: &[bool], texels: usize) -> Opening {
    let mut found = [u8::MAX, u8::MAX, 0, 0];
    for at in (0..open.len()).filter(|at| open[*at]) {
        let (i, j) = ((at % texels) as u8, (at / texels) as u8);
        found = [found[0].min(i), found[1].min(j), found[2].max(i + 1), found[3].max(j + 1)];
    }
    if found[2] == 0 { CLOSED } else { found }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::{RngCore, SeedableRng};

    fn lines(n: u32) -> Vec<f64> {
        (0..=n).map(|k| texel_line(0.0, 4.0, k, n)).collect()
    }

    fn open(blockers: &[Blocker], n: u32) -> Vec<bool> {
        open_texels(&[lines(n), lines(n)], blockers, &rims(blockers))
    }

    fn at(x: f64, y: f64) -> DVec2 {
        DVec2::new(x, y)
    }

    fn quad(x0: f64, y0: f64, x1: f64, y1: f64) -> [Blocker; 2] {
        [[at(x0, y0), at(x1, y0), at(x1, y1)], [at(x0, y0), at(x1, y1), at(x0, y1)]]
    }

    #[test]
    fn one_quad_closes_the_texels_that_lie_inside_it() {
        assert!(open(&quad(-1.0, -1.0, 5.0, 5.0), 8).iter().all(|o| !o));
        let half = open(&quad(-1.0, -1.0, 2.2, 5.0), 8);
        // Texels of 0.5: the rim at 2.2 lies in the fifth column.
        assert!((0..64).all(|i| half[i] == (i % 8 >= 4)), "{half:?}");
        // On the line between two columns it parts them, and on the border it is nothing.
        let line = open(&quad(0.0, 0.0, 2.0, 4.0), 8);
        assert!((0..64).all(|i| line[i] == (i % 8 >= 4)), "{line:?}");
        assert_eq!(bounding(&half, 8), [4, 0, 8, 8]);
        assert_eq!(bounding(&[false; 64], 8), CLOSED);
    }

    #[test]
    fn walls_that_meet_in_t_junctions_leave_no_rim_and_a_gap_of_an_ulp_does() {
        let gap = |right: f64| {
            let mut wall = quad(-1.0, -1.0, 1.7, 5.0).to_vec();
            wall.extend(quad(right, -1.0, 5.0, 2.3));
            wall.extend(quad(right, 2.3, 5.0, 5.0));
            open(&wall, 16)
        };
        assert!(gap(1.7).iter().all(|o| !o));
        assert_eq!(gap(1.7f64.next_up()).iter().filter(|o| **o).count(), 16, "one column");
    }

    #[test]
    fn triangles_of_the_same_side_do_not_close_each_other() {
        let [lower, _] = quad(-1.0, -1.0, 5.0, 5.0);
        let twice = open(&[lower, lower], 8);
        assert!((0..64).all(|i| twice[i] == (i / 8 >= i % 8)), "{twice:?}");
        assert!(open(&[], 8).iter().all(|o| *o));
    }

    /// Points of closed texels lie in some blocker, by a test of single points.
    #[test]
    fn no_point_of_a_closed_texel_is_free() {
        let mut rng = ChaCha8Rng::seed_from_u64(8);
        let mut unit = move || (rng.next_u64() >> 11) as f64 / (1u64 << 53) as f64;
        let (mut closed, mut mixed) = (0, 0);
        for case in 0..400 {
            let snap = [0.0, 0.5, 0.25][case % 3];
            let mut point = || {
                let p = at(unit() * 8.0 - 2.0, unit() * 8.0 - 2.0);
                if snap > 0.0 { (p / snap).round() * snap } else { p }
            };
            let mut blockers = Vec::new();
            for _ in 0..1 + case % 5 {
                let (p, q, r) = (point(), point(), point());
                match case % 4 {
                    0 => blockers.extend([[p, q, r], [q, p, r], [p, q, p]]),
                    1 => blockers.extend(quad(p.x.min(q.x), p.y.min(q.y), p.x.max(q.x), p.y.max(q.y))),
                    // Fans around a point share their edges.
                    2 => (0..4).for_each(|_| blockers.push([r, point(), point()])),
                    _ => {
                        let ring = [at(-3.0, -3.0), at(7.0, -3.0), at(7.0, 7.0), at(-3.0, 7.0)];
                        blockers.extend((0..4).map(|i| [ring[i], ring[(i + 1) % 4], p.clamp(ring[0], ring[2])]));
                    }
                }
            }
            let up = |b: &Blocker| facing(b, true).or(facing(b, false));
            let blockers: Vec<Blocker> = blockers.iter().filter_map(up).collect();
            let n = [4, 7, 16][case % 3];
            let texels = open(&blockers, n);
            let inside =
                |p: DVec2| blockers.iter().any(|t| (0..3).all(|k| orientation(t[k], t[(k + 1) % 3], p) >= 0.0));
            let of = lines(n);
            for (i, _) in texels.iter().enumerate().filter(|(_, open)| !**open) {
                let (u, v) = (i % n as usize, i / n as usize);
                for _ in 0..40 {
                    let within = |l: &[f64], k: usize, share: f64| (l[k] + (l[k + 1] - l[k]) * share).min(l[k + 1]);
                    let p = at(within(&of, u, unit()), within(&of, v, unit()));
                    assert!(inside(p), "case {case}: {p} of texel {u} {v} is free of {blockers:?}");
                }
                closed += 1;
            }
            mixed += usize::from(texels.iter().any(|o| *o) && !texels.iter().all(|o| *o));
        }
        assert!(closed > 2000 && mixed > 50, "{closed} closed texels, {mixed} mixed faces");
    }
}
