//! The octree and its policies for straddling triangles: facts A0.1 to A0.5, A4.1.

use super::{OCTREES, REPLICATED, SPLIT, build, leaves, nodes, scene_of, scenes};
use crate::common::soup;
use cullmark::hierarchy::Hierarchy;
use cullmark::math::{Aabb, DVec3};
use cullmark::scene::Scene;
use cullmark::structure::octree::{Octree, Policy};

fn sorted(mut v: Vec<u32>) -> Vec<u32> {
    v.sort_unstable();
    v
}

fn area(t: &[DVec3; 3]) -> f64 {
    (t[1] - t[0]).cross(t[2] - t[0]).length() * 0.5
}

/// Seeded numbers in 0..1.
pub fn random(seed: u64) -> impl FnMut() -> f64 {
    use rand_chacha::rand_core::{RngCore, SeedableRng};
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    move || (rng.next_u64() >> 11) as f64 / (1u64 << 53) as f64
}

// A0.1
#[test]
fn loose_and_enclosing_octrees_hold_every_triangle_once() {
    for scene in scenes() {
        for text in OCTREES {
            let h = build(text, &scene);
            assert_eq!(sorted(h.entries), (0..scene.len() as u32).collect::<Vec<_>>(), "{text} on {}", scene.name);
        }
    }
}

/// Area of every triangle's fragments against its own (A0.2 and A5.2).
pub fn assert_area_is_kept(h: &Hierarchy, scene: &Scene, what: &str) {
    let mut pieces = vec![0.0; scene.len()];
    for position in 0..h.entries.len() as u32 {
        let piece = h.piece(scene, position);
        let t = h.entries[position as usize];
        let whole = scene.triangle_aabb(t);
        assert!(piece.iter().all(|p| whole.contains(*p)), "{what}: a fragment leaves its triangle");
        pieces[t as usize] += area(&piece);
    }
    for (t, sum) in pieces.iter().enumerate() {
        let corners = scene.corners(t as u32);
        let (whole, longest) = (area(&corners), corners[0].distance(corners[1]).max(corners[0].distance(corners[2])));
        // A sliver is as wide as a few roundings of its coordinates: those, too.
        let rounding = longest * corners[0].abs().max_element() * 1e-13;
        assert!((sum - whole).abs() <= whole * 1e-5 + rounding, "{what}: triangle {t}: {sum} of {whole}");
    }
}

// A0.2
#[test]
fn splitting_keeps_the_area_of_every_triangle() {
    for scene in scenes() {
        for text in SPLIT {
            assert_area_is_kept(&build(text, &scene), &scene, &format!("{text} on {}", scene.name));
        }
    }
}

/// What a closed box leaves of a triangle, by clipping at its faces.
fn touches(corners: &[DVec3; 3], cell: &Aabb) -> bool {
    let mut polygon = corners.to_vec();
    for (axis, sign, at) in (0..3).flat_map(|a| [(a, 1.0, cell.lo[a]), (a, -1.0, cell.hi[a])]) {
        let depth = |p: DVec3| (p[axis] - at) * sign;
        let mut kept = Vec::new();
        for (i, p) in polygon.iter().enumerate() {
            let q = polygon[(i + 1) % polygon.len()];
            if depth(*p) >= 0.0 {
                kept.push(*p);
            }
            if depth(*p) * depth(q) < 0.0 {
                let mut x = *p + (q - *p) * (depth(*p) / (depth(*p) - depth(q)));
                x[axis] = at;
                kept.push(x);
            }
        }
        polygon = kept;
    }
    !polygon.is_empty()
}

/// The cells of all leaves in the order of the tree, by halving.
fn cells(cell: Aabb, depth: u32, out: &mut Vec<Aabb>) {
    if depth == 0 {
        return out.push(cell);
    }
    let middle = cell.centre();
    for octant in 0..8 {
        let mut c = cell;
        for axis in 0..3 {
            if octant >> axis & 1 == 1 { c.lo[axis] = middle[axis] } else { c.hi[axis] = middle[axis] }
        }
        cells(c, depth - 1, out);
    }
}

/// The separating-axis test in whole numbers: coordinates twice as large, so that
/// cells of size 1 have whole centres.
fn touches_exactly(corners: &[DVec3; 3], cell: &Aabb) -> bool {
    let whole = |v: DVec3| (v * 2.0).round().to_array().map(|x| x as i64);
    let (centre, half) = (whole(cell.centre()), whole(cell.size() * 0.5));
    let v = corners.map(|p| [0, 1, 2].map(|i| whole(p)[i] - centre[i]));
    let sub = |a: [i64; 3], b: [i64; 3]| [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    let cross =
        |a: [i64; 3], b: [i64; 3]| [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    let units = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
    let edges = [sub(v[1], v[0]), sub(v[2], v[1]), sub(v[0], v[2])];
    let mut axes = units.to_vec();
    axes.push(cross(edges[0], edges[1]));
    axes.extend(edges.iter().flat_map(|e| units.map(|u| cross(*e, u))));
    axes.iter().all(|axis| {
        let dot = |p: [i64; 3]| (0..3).map(|i| axis[i] * p[i]).sum::<i64>();
        let reach: i64 = (0..3).map(|i| axis[i].abs() * half[i]).sum();
        let s = v.map(dot);
        s.iter().min().unwrap() <= &reach && s.iter().max().unwrap() >= &-reach
    })
}

// A0.3
#[test]
fn a_replicated_leaf_holds_exactly_the_triangles_that_overlap_its_cell() {
    let mut unit = random(11);
    // Whole coordinates 0..8 with cells of size 1: faces, edges and corners touch.
    let mut whole: Vec<[DVec3; 3]> = (0..150)
        .map(|_| {
            let mut v = || DVec3::new(unit() * 8.99, unit() * 8.99, unit() * 8.99).floor();
            [v(), v(), v()]
        })
        .collect();
    whole.push([DVec3::ZERO, DVec3::splat(8.0), DVec3::new(8.0, 0.0, 0.0)]);
    whole.push([DVec3::new(4.0, 0.0, 0.0), DVec3::new(4.0, 8.0, 0.0), DVec3::new(4.0, 0.0, 8.0)]);
    type Overlaps = fn(&[DVec3; 3], &Aabb) -> bool;
    let cases: [(Scene, Overlaps); 3] = [
        (scene_of("whole", &whole), touches_exactly),
        (soup(12, 500, 10.0, 2.0), touches),
        (soup(13, 40, 1.0, 3.0), touches),
    ];
    for (scene, overlaps) in cases {
        let h = build("octree:policy=R,depth=3", &scene);
        let octree = Octree { depth: 3, policy: Policy::Replicate, cube: false, leaf_limit: 0 };
        let mut all = Vec::new();
        cells(octree.root_cell(&scene), 3, &mut all);
        let expected: Vec<Vec<u32>> = all
            .iter()
            .map(|cell| (0..scene.len() as u32).filter(|t| overlaps(&scene.corners(*t), cell)).collect::<Vec<u32>>())
            .filter(|list| !list.is_empty())
            .collect();
        let found: Vec<Vec<u32>> =
            leaves(&h).into_iter().map(|(a, b)| sorted(h.entries[a as usize..b as usize].to_vec())).collect();
        assert_eq!(found.len(), expected.len(), "{}: leaves", scene.name);
        for (leaf, (found, expected)) in found.iter().zip(&expected).enumerate() {
            assert_eq!(found, expected, "{}: leaf {leaf}", scene.name);
        }
    }
}

/// Triangles with two edges of one length from a common corner, anywhere in the
/// unit cube, any way round.
fn confetti(count: usize, edge: f64) -> Scene {
    let mut unit = random(14);
    let mut direction = move || {
        loop {
            let v = DVec3::new(unit(), unit(), unit()) * 2.0 - 1.0;
            if (0.01..=1.0).contains(&v.length_squared()) {
                return v.normalize();
            }
        }
    };
    let mut unit = random(17);
    let triangles: Vec<[DVec3; 3]> = (0..count)
        .map(|_| {
            let corner = DVec3::new(unit(), unit(), unit());
            [corner, corner + direction() * edge, corner + direction() * edge]
        })
        .collect();
    scene_of("confetti", &triangles)
}

// A0.4
#[test]
fn replication_and_enclosing_levels_match_the_published_shares() {
    // Edge, replication by boxes and by formula, share at the root and in leaves under E.
    for (edge, boxes, formula, at_root, in_leaves) in
        [(0.005, 1.21, 1.22, 0.012, 0.82), (0.02, 1.99, 2.05, 0.051, 0.41)]
    {
        let scene = confetti(30_000, edge);
        let root = scene.bounds();
        let cell = root.size() / 16.0;
        let (mut by_boxes, mut by_formula) = (0.0, 0.0);
        for t in 0..scene.len() as u32 {
            let b = scene.triangle_aabb(t);
            let at = |p: DVec3| ((p - root.lo) / cell).floor().min(DVec3::splat(15.0));
            let span = at(b.hi) - at(b.lo) + 1.0;
            by_boxes += span.x * span.y * span.z;
            let f = b.size() / cell + 1.0;
            by_formula += f.x * f.y * f.z;
        }
        let n = scene.len() as f64;
        let close = |x: f64, y: f64, what: &str| assert!((x - y).abs() <= 0.06 * y, "edge {edge}, {what}: {x} for {y}");
        close(by_boxes / n, boxes, "replication by boxes");
        close(by_formula / n, formula, "replication by the formula");
        let exact = build("octree:policy=R", &scene).entries.len() as f64 / n;
        assert!(1.0 < exact && exact < by_boxes / n, "a triangle overlaps fewer cells than its box: {exact}");

        let h = build("octree:policy=E", &scene);
        let mut share = [0.0; 5];
        for (block, lane, level) in nodes(&h) {
            let links = &h.links[block as usize];
            share[level as usize] += f64::from(links.own_end[lane] - links.first[lane]) / n;
        }
        assert!((share.iter().sum::<f64>() - 1.0).abs() < 1e-9);
        assert!((share[0] - at_root).abs() <= 0.2 * at_root, "edge {edge}: {share:?} at the root");
        assert!((share[4] - in_leaves).abs() <= 0.08 * in_leaves, "edge {edge}: {share:?} in leaves");
    }
}

// A0.5
#[test]
fn under_every_policy_the_leaves_reach_every_point_of_every_triangle() {
    let mut unit = random(15);
    for scene in scenes() {
        let size = scene.positions.iter().fold(1.0, |m: f64, p| m.max(p.abs().max_element()));
        for text in OCTREES.iter().chain(REPLICATED).chain(SPLIT) {
            let h = build(text, &scene);
            let mut held = vec![Vec::new(); scene.len()];
            for (block, lane, _) in nodes(&h) {
                let (links, b) = (&h.links[block as usize], h.bounds[block as usize].get(lane));
                let world = Aabb { lo: b.lo.as_dvec3() + h.origin, hi: b.hi.as_dvec3() + h.origin };
                for position in links.first[lane]..links.own_end[lane] {
                    held[h.entries[position as usize] as usize].push((position, world));
                }
            }
            for t in (0..scene.len() as u32).step_by(1 + scene.len() / 200) {
                let [a, b, c] = scene.corners(t);
                let (u, v) = (unit(), unit());
                let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
                let p = a + (b - a) * u + (c - a) * v;
                let near = |q: &Aabb| Aabb { lo: q.lo - size * 1e-15, hi: q.hi + size * 1e-15 }.contains(p);
                let covered = held[t as usize].iter().any(|(position, node)| {
                    near(node) && (h.fragments.is_none() || lies_in(p, &h.piece(&scene, *position), size * 1e-12))
                });
                assert!(covered, "{text} on {}: triangle {t} at {p}", scene.name);
            }
        }
    }
}

/// Is `p`, a point of the same plane, within `margin_m` of the triangle?
fn lies_in(p: DVec3, [a, b, c]: &[DVec3; 3], margin_m: f64) -> bool {
    let normal = (*b - *a).cross(*c - *a);
    if normal.length_squared() < 1e-30 {
        return Aabb::of_points(&[*a, *b, *c]).lo.cmple(p + 1e-6).all();
    }
    [(a, b), (b, c), (c, a)].iter().all(|(p0, p1)| {
        let inward = normal.cross(**p1 - **p0).normalize_or_zero();
        inward.dot(p - **p0) >= -margin_m.max(1e-12 * p0.distance(**p1))
    })
}

// A4.1
#[test]
fn an_octree_of_depth_4_has_at_most_4096_leaves_and_4681_nodes() {
    for scene in scenes() {
        for text in ["octree", "octree:policy=E", "octree:policy=R", "octree:policy=S", "octree:root=cube"] {
            let h = build(text, &scene);
            let s = h.stats;
            assert!(s.leaves <= 4096 && s.nodes <= 4681 && s.depth <= 4, "{text} on {}: {s:?}", scene.name);
            assert_eq!(s.nodes as usize, h.node_count(), "{text} on {}", scene.name);
        }
    }
    let dense = soup(16, 80_000, 10.0, 0.1);
    let s = build("octree", &dense).stats;
    assert_eq!((s.leaves, s.nodes, s.depth), (4096, 4681, 4), "a dense scene reaches both");
}
