//! The portal-octree: cells, the leaves in them, and what is open between them.

use super::{build, scene_of, scenes};
use crate::common::soup;
use cullmark::hierarchy::portals::{CLOSED, across};
use cullmark::hierarchy::{Hierarchy, LANES, NONE, Portals};
use cullmark::math::{Aabb, DVec3};
use cullmark::scene::Scene;
use cullmark::structure::builder::cut::triangle_overlaps;

fn portals(h: &Hierarchy) -> &Portals {
    h.portals.as_ref().expect("a portal_octree has the column")
}

/// A rectangle of two triangles across `axis`, its front up or down, or both.
pub fn pane(axis: usize, at: f64, lo: [f64; 2], hi: [f64; 2], up: bool) -> [[DVec3; 3]; 2] {
    let corner = |u: f64, v: f64| {
        let mut p = DVec3::ZERO;
        (p[axis], p[across(axis)[0]], p[across(axis)[1]]) = (at, u, v);
        p
    };
    let [a, b, c, d] = [corner(lo[0], lo[1]), corner(hi[0], lo[1]), corner(hi[0], hi[1]), corner(lo[0], hi[1])];
    if up { [[a, b, c], [a, c, d]] } else { [[a, c, b], [a, d, c]] }
}

/// Corners of the box 0..8 on each axis, as specks; and what is given.
fn in_a_box(given: &[[DVec3; 3]]) -> Scene {
    let speck = |at: DVec3, s: f64| [at, at + DVec3::new(s, s * 0.5, s * 0.25), at + DVec3::new(s * 0.5, s, s * 0.75)];
    let mut all = vec![speck(DVec3::ZERO, 0.01), speck(DVec3::splat(8.0), -0.01)];
    all.extend_from_slice(given);
    scene_of("box", &all)
}

/// Every cell's leaf holds exactly the triangles that reach into the cell (A0.3).
#[test]
fn a_cell_holds_what_reaches_into_it() {
    for scene in [soup(31, 500, 10.0, 1.5), in_a_box(&pane(0, 4.0, [1.0, 1.0], [7.0, 7.0], true))] {
        for text in ["portal_octree:depth=3", "portal_octree:depth=2,planes=middle"] {
            let h = build(text, &scene);
            let p = portals(&h);
            assert_eq!(p.root(), scene.bounds());
            for (number, node) in p.node.iter().enumerate() {
                let cell = p.bounds(p.at(number));
                let mut want: Vec<u32> =
                    (0..scene.len() as u32).filter(|t| triangle_overlaps(&scene.corners(*t), &cell)).collect();
                let mut got: Vec<u32> = Vec::new();
                if *node != NONE {
                    let links = &h.links[*node as usize / LANES];
                    let lane = *node as usize % LANES;
                    got.extend(&h.entries[links.first[lane] as usize..links.end[lane] as usize]);
                }
                want.sort_unstable();
                got.sort_unstable();
                assert_eq!(got, want, "{text} on {}: cell {number}", scene.name);
            }
        }
    }
}

#[test]
fn halves_of_the_box_make_the_replicated_octree() {
    for scene in scenes() {
        for depth in [1, 4] {
            let a = build(&format!("portal_octree:depth={depth},planes=middle"), &scene);
            let b = build(&format!("octree:depth={depth},policy=R"), &scene);
            assert!(a.entries == b.entries && a.bounds == b.bounds && a.links == b.links, "{depth} {}", scene.name);
            assert_eq!(a.stats, b.stats);
        }
    }
}

/// Openings of the face that holds a point, upwards and downwards.
fn face_at(p: &Portals, axis: usize, at: DVec3) -> [[u8; 4]; 2] {
    let cell = [0, 1, 2].map(|a| p.touching(a, at[a], at[a]).start);
    p.openings[axis][p.cell(cell)]
}

#[test]
fn a_wall_closes_faces_only_towards_its_front() {
    for axis in 0..3 {
        for up in [false, true] {
            let mut scene = in_a_box(&pane(axis, 4.0, [-1.0, -1.0], [9.0, 9.0], up));
            // A wall that reaches out of the box would move the root: cut to it.
            scene.positions.iter_mut().for_each(|p| *p = p.clamp(DVec3::ZERO, DVec3::splat(8.0)));
            let at = DVec3::splat(3.0) + DVec3::AXES[axis];
            let whole = [0, 0, 8, 8];
            let faces = |scene: &Scene, planes: &str| {
                let h = build(&format!("portal_octree:depth=3,texels=8,planes={planes}"), scene);
                face_at(portals(&h), axis, at)
            };
            // A front that faces down stops what goes up.
            let want = if up { [whole, CLOSED] } else { [CLOSED, whole] };
            assert_eq!(faces(&scene, "walls"), want, "axis {axis}, up {up}");
            assert_eq!(faces(&scene, "middle"), want, "4 is the middle");
            scene.two_sided.fill(true);
            assert_eq!(faces(&scene, "walls"), [CLOSED; 2]);
            scene.occluder.fill(false);
            assert_eq!(faces(&scene, "walls"), [whole; 2]);
        }
    }
}

#[test]
fn an_opening_is_the_rectangle_of_what_is_not_covered() {
    // A window of 1 x 0.5 in a wall of four panes; cells of 4 m, texels of 0.25 m.
    let [x0, y0, x1, y1] = [1.1, 2.0, 2.1, 2.5];
    let wall: Vec<[DVec3; 3]> = [
        pane(2, 4.0, [0.0, 0.0], [8.0, y0], true),
        pane(2, 4.0, [0.0, y0], [x0, y1], true),
        pane(2, 4.0, [x1, y0], [8.0, y1], true),
        pane(2, 4.0, [0.0, y1], [8.0, 8.0], true),
    ]
    .concat();
    let scene = in_a_box(&wall);
    let h = build("portal_octree:depth=1,texels=16,planes=middle", &scene);
    let p = portals(&h);
    // Across z the axes are x and y. The rims at y = 2 and 2.5 lie on texel lines.
    assert_eq!(face_at(p, 2, DVec3::new(1.0, 1.0, 4.0)), [[0, 0, 16, 16], [4, 8, 9, 10]]);
    assert_eq!(face_at(p, 2, DVec3::new(5.0, 1.0, 4.0)), [[0, 0, 16, 16], CLOSED]);
    let rect = p.rectangle(2, [0, 0, 0], [4, 8, 9, 10]);
    assert_eq!(rect, [[1.0, 2.0], [2.25, 2.5]]);
    // The other way round nothing stops the view, and tilted by an ulp neither.
    let mut tilted = scene.clone();
    tilted.positions.iter_mut().filter(|p| p.z == 4.0 && p.x == 0.0).for_each(|p| p.z = 4.0f64.next_up());
    let h = build("portal_octree:depth=1,texels=16,planes=middle", &tilted);
    assert_eq!(face_at(portals(&h), 2, DVec3::new(1.0, 1.0, 4.0))[1], [0, 0, 16, 16]);
}

/// Random walls in the planes: no point of a closed part of a face is free.
#[test]
fn whatever_is_outside_of_an_opening_is_covered() {
    let mut random = super::policies::random(77);
    let (mut closed, mut free) = (0, 0);
    for case in 0..30 {
        let mut walls = Vec::new();
        for _ in 0..30 {
            let axis = (random() * 3.0) as usize;
            let mut number = |n: f64| (random() * n).floor();
            let (at, a, b) = (2.0 * (1.0 + number(3.0)), [number(8.0), number(8.0)], [number(8.0), number(8.0)]);
            let lo = [a[0].min(b[0]), a[1].min(b[1])];
            let hi = [a[0].max(b[0]) + 1.0, a[1].max(b[1]) + 1.0];
            walls.extend(pane(axis, at, lo, hi, number(2.0) > 0.0));
        }
        let scene = in_a_box(&walls);
        let h = build(&format!("portal_octree:depth=2,texels={},planes=middle", [5, 8, 32][case % 3]), &scene);
        let p = portals(&h);
        for axis in (0..900).map(|i| i % 3) {
            let at = DVec3::new(random() * 8.0, random() * 8.0, random() * 8.0);
            let cell = [0, 1, 2].map(|a| p.touching(a, at[a], at[a]).start);
            if cell[axis] == 3 {
                continue;
            }
            let mut q = at;
            q[axis] = p.planes[axis][cell[axis] + 1];
            for (direction, opening) in p.openings[axis][p.cell(cell)].into_iter().enumerate() {
                let [lo, hi] = p.rectangle(axis, cell, opening);
                let [u, v] = across(axis).map(|a| q[a]);
                if opening != CLOSED && lo[0] <= u && u <= hi[0] && lo[1] <= v && v <= hi[1] {
                    free += 1;
                    continue;
                }
                let covers = |t: u32| {
                    let corners = scene.corners(t);
                    let bounds = Aabb::of_points(&corners);
                    let front = scene.normal(t)[axis] > 0.0;
                    // Panes are whole rectangles; the triangle's sides are decided by areas.
                    let area = |a: DVec3, b: DVec3| (b - a).cross(q - a)[axis];
                    let turns = [0, 1, 2].map(|i| area(corners[i], corners[(i + 1) % 3]));
                    bounds.contains(q)
                        && bounds.lo[axis] == bounds.hi[axis]
                        && front == (direction == 1)
                        && (turns.iter().all(|t| *t >= 0.0) || turns.iter().all(|t| *t <= 0.0))
                };
                assert!((0..scene.len() as u32).any(covers), "case {case}: {q} is free");
                closed += 1;
            }
        }
    }
    assert!(closed > 1000 && free > 1000, "{closed} closed, {free} free");
}
