//! What portals save and what a door does: facts A8.2, A8.3 and D8.1.

use super::portals::{STRUCTURES, WALKS, awkward, build, cameras, facing, poses, scene};
use super::walks::{Method, triangles};
use crate::common::soup;
use crate::structures::portal_octree::pane;
use cullmark::culling::{Class, make_walk, promise};
use cullmark::math::{Camera, DVec3, Pose, View};
use cullmark::registry::Spec;
use cullmark::scene::Scene;

/// Triangles submitted, summed over views.
struct Sums {
    vfc: usize,
    lite: usize,
    full: usize,
}

/// A8.2 on every frame; returns the sums.
fn chain(scene: &Scene, structure: &str, views: &[View]) -> Sums {
    let h = build(structure, scene);
    let mut methods = ["depth_first", "portals:clip=false", "portals"].map(|w| Method::new(scene, &h, "frustum", w));
    let mut sums = [0; 3];
    for view in views {
        let sets = methods.each_mut().map(|m| triangles(&h, &m.frame(view).0));
        for (t, _) in sets[2].iter().enumerate() {
            assert!(!sets[2][t] || sets[1][t], "{structure}: PO-full alone submits {t} at {view:?}");
            assert!(!sets[1][t] || sets[0][t], "{structure}: PO-lite alone submits {t} at {view:?}");
        }
        (0..3).for_each(|i| sums[i] += sets[i].iter().filter(|s| **s).count());
    }
    Sums { vfc: sums[0], lite: sums[1], full: sums[2] }
}

// A8.2
#[test]
fn clipped_portals_submit_less_than_the_flood_and_that_less_than_the_frustum() {
    for name in ["rooms", "blocks", "arena:triangles=14000"] {
        let scene = scene(name);
        let [inside, outside] =
            ["inside", "outside"].map(|eyes| poses(&format!("random:frames=30,eyes={eyes},aim=any"), &scene));
        for structure in STRUCTURES {
            let h = build(structure, &scene);
            for camera in cameras(12.0) {
                let poses = [awkward(&h, &scene, &inside), outside.clone()].concat();
                let views: Vec<View> = poses.iter().map(|p| View::new(&camera, p)).collect();
                let sums = chain(&scene, structure, &views);
                // Walls close something, and what is clipped closes more.
                if name == "rooms" && structure.contains("walls") {
                    assert!(sums.full < sums.lite && sums.lite < sums.vfc, "{structure} {camera:?}");
                }
            }
        }
    }
}

// A8.3
#[test]
fn portals_pay_in_closed_rooms_and_less_outdoors() {
    let on_a_walk = |name: &str, planes: &str| {
        let scene = scene(name);
        let views: Vec<View> =
            poses("walk:frames=60,speed_m=3", &scene).iter().map(|p| View::new(&Camera::default(), p)).collect();
        let sums = chain(&scene, &format!("portal_octree:depth=5,planes={planes}"), &views);
        let mean = |n: usize| n as f64 / views.len() as f64;
        println!(
            "{name}, {planes}: VFC {:.0}, lite {:.0}, full {:.0} triangles",
            mean(sums.vfc),
            mean(sums.lite),
            mean(sums.full)
        );
        sums
    };
    for name in ["rooms:world=1", "rooms:world=4"] {
        let sums = on_a_walk(name, "walls");
        assert!(sums.full * 2 < sums.vfc, "{name}: {} of {}", sums.full, sums.vfc);
    }
    // Planes that know nothing of walls close nothing. Along the fronts of houses a
    // part is hidden even outdoors.
    for name in ["blocks", "rooms:world=1"] {
        let blind = on_a_walk(name, "middle");
        assert!(blind.full * 100 > blind.vfc * 98, "{name}: {} of {}", blind.full, blind.vfc);
    }
    // The fact says "about nothing" of open space; our houses are solid, and hide.
    let outdoors = on_a_walk("blocks", "walls");
    assert!(outdoors.full * 10 > outdoors.vfc * 3 && outdoors.full < outdoors.lite, "outdoors");
}

/// Two rooms of 8 x 8 x 4 m beside each other along x, walls 0.2 m thick, with a door
/// between them that may be shut; a speck in each. Fronts face the rooms.
fn two_rooms(shut: bool) -> Scene {
    let mut all = Vec::new();
    for (x0, x1, wall, up) in [(0.0, 8.0, 8.0, false), (8.2, 16.2, 8.2, true)] {
        for (axis, at, lo, hi, up) in [
            (1, 0.0, [0.0, x0], [4.0, x1], true),
            (1, 8.0, [0.0, x0], [4.0, x1], false),
            (2, 0.0, [x0, 0.0], [x1, 8.0], true),
            (2, 4.0, [x0, 0.0], [x1, 8.0], false),
            (0, x0 + x1 - wall, [0.0, 0.0], [8.0, 4.0], !up),
            // Around the door: y from 3 to 4, z to 2.
            (0, wall, [0.0, 0.0], [3.0, 4.0], up),
            (0, wall, [4.0, 0.0], [8.0, 4.0], up),
            (0, wall, [3.0, 2.0], [4.0, 4.0], up),
        ] {
            all.extend(pane(axis, at, lo, hi, up));
        }
    }
    if shut {
        all.extend(pane(0, 8.0, [3.0, 0.0], [4.0, 2.0], false));
    }
    for x in [4.0, 12.0] {
        let at = DVec3::new(x, 3.5, 1.0);
        all.push([at, at + DVec3::new(0.0, 0.1, 0.0), at + DVec3::new(0.0, 0.05, 0.1)]);
    }
    crate::structures::scene_of("two rooms", &all)
}

// D8.1
#[test]
fn a_closed_door_removes_the_room() {
    let inside = facing(DVec3::new(1.0, 3.5, 1.5), DVec3::new(1.0, 0.0, -0.05));
    for walk in WALKS {
        // The last two triangles are the specks; the second room has 16 before them.
        let seen = |shut: bool, pose: Pose| {
            let scene = two_rooms(shut);
            let h = build("portal_octree:depth=3", &scene);
            let view = View::new(&Camera::default(), &pose);
            let set = triangles(&h, &Method::new(&scene, &h, "none", walk).frame(&view).0);
            let n = scene.len();
            assert!(set[n - 2], "the speck of this room");
            (set[n - 1], set.iter().filter(|s| **s).count())
        };
        let (open, shut) = (seen(false, inside), seen(true, inside));
        assert!(open.0 && !shut.0, "{walk}: the other room's speck, {open:?} {shut:?}");
        // All that is left is this room: 16 triangles of walls, the speck and the door.
        assert!(shut.1 == 19 && open.1 > 24, "{walk}: {open:?} {shut:?}");
        // The near plane cuts the door away.
        let nose = Pose { eye: DVec3::new(7.95, 3.5, 1.5), ..inside };
        let scene = two_rooms(true);
        let h = build("portal_octree:depth=3", &scene);
        let through = |camera: Camera| {
            let view = View::new(&camera, &nose);
            triangles(&h, &Method::new(&scene, &h, "none", walk).frame(&view).0)[scene.len() - 1]
        };
        assert!(through(Camera::default()), "{walk}: nearer than the near plane nothing hides");
        assert!(!through(Camera { near_m: 0.01, ..Camera::default() }), "{walk}");
    }
    // Past the door frame: only a clipped view knows that the speck is behind the wall.
    let scene = two_rooms(false);
    let h = build("portal_octree:depth=3", &scene);
    let aside = facing(DVec3::new(7.0, 0.5, 1.0), DVec3::new(1.0, 1.0, 0.0));
    let view = View::new(&Camera::default(), &aside);
    let [full, lite] =
        WALKS.map(|w| triangles(&h, &Method::new(&scene, &h, "none", w).frame(&view).0)[scene.len() - 1]);
    assert!(!full && lite);
}

#[test]
fn the_walk_refuses_what_has_no_cells_and_says_what_it_removes() {
    let scene = soup(42, 100, 5.0, 1.0);
    let h = build("octree", &scene);
    let walk = make_walk(&Spec::new("portals")).unwrap().0;
    assert!(walk.refuses(&h).unwrap().contains("portal_octree"));
    assert!(!walk.remembers());
    let (class, removes) = promise(&[], walk.as_ref());
    assert!(class == Class::Conservative && removes.occluded && removes.outside_frustum && !removes.back_facing);
    let plain = make_walk(&Spec::new("flat")).unwrap().0;
    assert_eq!(promise(&[], plain.as_ref()), (Class::Conservative, Default::default()));
    // Nothing to see, no cells to see it in.
    let empty = Scene::default();
    let h = build("portal_octree", &empty);
    let view = View::new(&Camera::default(), &facing(DVec3::ZERO, DVec3::X));
    assert!(Method::new(&empty, &h, "frustum", "portals").frame(&view).0.ranges.is_empty());
}
