//! Normal masks (fact C3) and octant masks (fact C4).

use super::build::{Rng, camera, list, tree, view_along};
use super::facing::exact_facing;
use super::walks::{Method, triangles};
use crate::common::soup;
use cullmark::culling::normal_mask::Cells;
use cullmark::math::{Camera, DVec3, Pose, Projection, View};
use cullmark::scene::Scene;

/// Some point of the triangle is certainly in the view volume, by clipping it in f64.
pub fn meets(view: &View, corners: [DVec3; 3]) -> bool {
    let mut polygon: Vec<DVec3> = corners.map(|c| c - view.eye).to_vec();
    for plane in &view.planes {
        let at = |p: DVec3| plane.normal.dot(p) + plane.offset_m - 1e-9;
        let mut clipped = Vec::new();
        for (i, p) in polygon.iter().enumerate() {
            let q = polygon[(i + 1) % polygon.len()];
            if at(*p) >= 0.0 {
                clipped.push(*p);
            }
            if (at(*p) >= 0.0) != (at(q) >= 0.0) {
                clipped.push(*p + (q - *p) * (at(*p) / (at(*p) - at(q))));
            }
        }
        polygon = clipped;
        if polygon.is_empty() {
            return false;
        }
    }
    true
}

pub fn is_front(view: &View, corners: [DVec3; 3]) -> bool {
    // Orthographic: as seen from infinitely far behind.
    if view.is_perspective() {
        exact_facing(corners, view.eye) > 0.0
    } else {
        (corners[1] - corners[0]).cross(corners[2] - corners[0]).dot(view.forward) < 0.0
    }
}

/// Per-triangle facing of a scene under a mask test: (front kept, front lost, back kept, back
/// lost), of the triangles that meet the view.
fn census(scene: &Scene, culling: &str, views: &[View]) -> [u32; 4] {
    let h = list(scene, 1);
    let mut method = Method::new(scene, &h, culling, "flat");
    let mut census = [0; 4];
    for view in views {
        let kept = triangles(&h, &method.frame(view).0);
        for t in (0..scene.len() as u32).filter(|t| meets(view, scene.corners(*t))) {
            let back = !is_front(view, scene.corners(t));
            census[2 * usize::from(back) + usize::from(!kept[t as usize])] += 1;
        }
    }
    census
}

/// C3.1: whatever the field of view, nothing that is skipped shows its front in the view.
#[test]
fn normal_masks_lose_no_front_face_at_any_field_of_view() {
    let mut rng = Rng::new(61);
    let scene = soup(61, 1500, 20.0, 2.0);
    let ortho = Camera { projection: Projection::Orthographic { height_m: 30.0 }, ..Camera::default() };
    let fovs = [0.01, 1.0, 10.0, 30.0, 60.0, 90.0, 120.0, 150.0, 179.0];
    for camera in fovs.map(|f| camera(f, 1.5)).into_iter().chain([ortho]) {
        let views: Vec<View> = (0..4).map(|_| View::new(&camera, &rng.pose(30.0))).collect();
        for culling in ["normal_mask:cells=1", "normal_mask", "normal_mask:cells=18"] {
            let [_, front_lost, ..] = census(&scene, culling, &views);
            assert_eq!(front_lost, 0, "{culling} at {camera:?}");
        }
    }
}

#[test]
fn a_narrow_view_removes_most_back_faces() {
    let mut rng = Rng::new(62);
    let scene = soup(62, 3000, 20.0, 1.0);
    let views: Vec<View> = (0..20)
        .map(|_| {
            let away = rng.direction();
            view_along(away * -80.0, away, &camera(10.0, 1.0))
        })
        .collect();
    let [front_kept, _, back_kept, back_lost] = census(&scene, "normal_mask", &views);
    assert!(front_kept > 1000 && back_lost > back_kept, "{front_kept} {back_kept} {back_lost}");
}

/// C3.2: share of all isotropic directions that one mask for the whole frustum removes.
#[test]
fn the_share_that_a_frustum_wide_mask_removes_is_the_published_one() {
    // fov_y, aspect, ideal, S = 16, S = 4, S = 2, in percent.
    let table = [
        (10.0, 1.0, 44.5, 41.6, 32.7, 22.9),
        (45.0, 4.0 / 3.0, 23.9, 21.2, 13.6, 7.0),
        (60.0, 16.0 / 9.0, 14.7, 12.4, 6.5, 2.8),
        (90.0, 16.0 / 9.0, 6.9, 5.3, 1.2, 0.0),
    ];
    let mut rng = Rng::new(63);
    let directions: Vec<DVec3> = (0..4000).map(|_| rng.direction()).collect();
    let rays: Vec<DVec3> = (0..60).map(|_| rng.direction()).collect();
    for (fov, aspect, ideal, s16, s4, s2) in table {
        let mut removed = [0.0; 5];
        for forward in &rays {
            let corner = view_along(DVec3::ZERO, *forward, &camera(fov, aspect)).corner_rays();
            let share = |averts: &dyn Fn(&DVec3) -> bool| {
                directions.iter().filter(|n| averts(n)).count() as f64 / directions.len() as f64 * 100.0
            };
            removed[0] += share(&|n| corner.iter().all(|r| n.dot(*r) >= 0.0));
            for (i, per_edge) in [16, 4, 2, 1].into_iter().enumerate() {
                let cells = Cells { per_edge };
                let averted: Vec<bool> = (0..cells.count()).map(|c| cells.is_averted(c, &corner)).collect();
                removed[i + 1] += share(&|n| averted[cells.of_direction(*n)]);
            }
        }
        let removed = removed.map(|r| r / rays.len() as f64);
        println!("{fov} deg {aspect:.2}: ideal, S = 16, 4, 2, 1 remove {removed:.1?} %");
        let near = |got: f64, want: f64, by: f64| assert!((got - want).abs() <= by, "{fov}: {got} for {want}");
        near(removed[0], ideal, 0.6);
        near(removed[1], s16, 0.8);
        near(removed[2], s4, 1.5);
        near(removed[3], s2, 3.0);
        assert!(removed.windows(2).all(|w| w[0] >= w[1]), "finer cells remove more");
    }
}

/// C3.3: the more normals a node holds, the less often it is skipped.
#[test]
fn node_masks_saturate() {
    let scene = soup(64, 4000, 20.0, 0.5);
    let mut rng = Rng::new(64);
    let views: Vec<View> = (0..20).map(|_| View::new(&camera(45.0, 4.0 / 3.0), &rng.pose(40.0))).collect();
    let share = [1, 2, 4, 64].map(|leaf| {
        let h = list(&scene, leaf);
        let mut method = Method::new(&scene, &h, "normal_mask", "flat");
        let kept: u64 = views.iter().map(|v| method.frame(v).0.entry_count()).sum();
        1.0 - kept as f64 / (views.len() * scene.len()) as f64
    });
    println!("removed with 1, 2, 4, 64 triangles a node: {share:.4?}");
    assert!((0.10..0.18).contains(&share[0]), "the table's 13.6 %: {share:?}");
    assert!(share[1] < 0.4 * share[0] && share[2] < 0.2 * share[0] && share[3] == 0.0, "{share:?}");
}

#[test]
fn deep_and_flat_walks_agree_for_masks() {
    let mut scene = soup(65, 2500, 30.0, 1.0);
    // Slabs of like normals, so that whole nodes can be skipped.
    for t in 0..scene.len() {
        let flip = scene.corners(t as u32)[0].x > 0.0;
        let n = scene.normal(t as u32);
        if (n.x > 0.0) != flip {
            scene.triangles[t].swap(1, 2);
        }
    }
    let mut rng = Rng::new(65);
    for culling in ["normal_mask", "octant_mask", "octant_mask:sectors=16", "frustum+normal_mask"] {
        for h in [tree(&scene, 4, 0), tree(&scene, 4, 2)] {
            let mut deep = Method::new(&scene, &h, culling, "depth_first");
            let mut flat = Method::new(&scene, &h, culling, "flat");
            let mut skipped = 0;
            for _ in 0..12 {
                let view = View::new(&camera(30.0, 1.0), &rng.pose(40.0));
                let (a, b) = (triangles(&h, &deep.frame(&view).0), triangles(&h, &flat.frame(&view).0));
                if culling.starts_with("frustum") {
                    assert!(a.iter().zip(&b).all(|(a, b)| !a || *b));
                } else {
                    assert_eq!(a, b, "masks of subsets are exact: {culling}");
                }
                skipped += a.iter().filter(|k| !**k).count();
            }
            assert!(skipped > 0, "{culling} skips something");
        }
    }
}

#[test]
fn composing_submits_what_both_parts_keep() {
    let scene = soup(66, 2000, 30.0, 0.5);
    let h = list(&scene, 1);
    let mut rng = Rng::new(66);
    for _ in 0..10 {
        let view = View::new(&camera(40.0, 1.3), &rng.pose(30.0));
        let run = |culling| triangles(&h, &Method::new(&scene, &h, culling, "flat").frame(&view).0);
        let (frustum, mask) = (run("frustum"), run("normal_mask"));
        let both: Vec<bool> = frustum.iter().zip(&mask).map(|(a, b)| *a && *b).collect();
        assert_eq!(run("frustum+normal_mask"), both);
        assert_eq!(run("normal_mask+frustum"), both);
    }
}

#[test]
fn triangles_without_a_back_or_a_normal_are_never_skipped() {
    let mut scene = soup(67, 600, 20.0, 1.0);
    for t in 0..600 {
        let [a, b, c] = scene.triangles[t].map(|v| v as usize);
        match t % 4 {
            0 => scene.two_sided[t] = true,
            1 => scene.positions[c] = scene.positions[b],
            2 => scene.positions[c] = scene.positions[a] + (scene.positions[b] - scene.positions[a]) * (1.0 + 1e-13),
            _ => scene.positions[a].z = f64::MAX,
        }
    }
    scene.positions.iter_mut().for_each(|p| *p = p.clamp(DVec3::splat(-1e6), DVec3::splat(1e6)));
    let h = list(&scene, 1);
    let mut rng = Rng::new(67);
    let mut method = Method::new(&scene, &h, "normal_mask:cells=8", "flat");
    for _ in 0..10 {
        let kept = triangles(&h, &method.frame(&View::new(&camera(5.0, 1.0), &rng.pose(30.0))).0);
        assert!((0..600).filter(|t| t % 4 != 3).all(|t| kept[t]));
    }
}

#[test]
fn every_direction_lies_in_the_cell_it_is_given() {
    let mut rng = Rng::new(68);
    for per_edge in [1, 2, 4, 7, 18] {
        let cells = Cells { per_edge };
        for i in 0..4000 {
            let mut n = rng.direction() * rng.range(1e-6, 1e6);
            if i % 5 == 0 {
                // On cell borders and cube edges.
                n = n.normalize();
                n = (n * 4.0).round();
                if n == DVec3::ZERO {
                    continue;
                }
            }
            let cell = cells.of_direction(n);
            assert!(cell < cells.count());
            // Inside the pyramid of the four corners: on the inner side of each edge plane.
            let q = cells.corners(cell);
            let centre = q.iter().sum::<DVec3>();
            for k in 0..4 {
                let side = q[k].cross(q[(k + 1) % 4]);
                let side = side * side.dot(centre).signum();
                assert!(side.dot(n) >= -1e-12 * n.length(), "{n} outside cell {cell} of {per_edge}");
            }
        }
    }
}

/// C4.2: by triangle, octant masks remove most back faces and drop front faces too.
#[test]
fn octant_masks_drop_front_faces_at_the_published_rate() {
    let mut rng = Rng::new(69);
    let mut rates = |walls: bool, fov: f64, aspect: f64| {
        let mut scene = soup(69, 4000, 30.0, 0.2);
        if walls {
            // Every third corner straight above the first: horizontal normals.
            for t in 0..scene.len() {
                let [a, _, c] = scene.triangles[t].map(|v| v as usize);
                scene.positions[c] = scene.positions[a] + DVec3::Z * 0.3;
            }
        }
        let views: Vec<View> = (0..40)
            .map(|_| {
                let (yaw, pitch) = (rng.range(0.0, 6.3), rng.range(-20.0, 20.0f64).to_radians());
                let level = DVec3::new(yaw.cos(), yaw.sin(), 0.0);
                let forward = level * pitch.cos() + DVec3::Z * pitch.sin();
                View::new(&camera(fov, aspect), &Pose { eye: rng.cube(15.0), forward, up: DVec3::Z })
            })
            .collect();
        let [front_kept, front_lost, back_kept, back_lost] = census(&scene, "octant_mask", &views).map(f64::from);
        (back_lost / (back_kept + back_lost), front_lost / (front_kept + front_lost))
    };
    let published = [(45.0, 4.0 / 3.0), (60.0, 16.0 / 9.0), (90.0, 16.0 / 9.0)];
    let isotropic = published.map(|(f, a)| rates(false, f, a));
    let walls = published.map(|(f, a)| rates(true, f, a));
    println!("octant masks, (back faces removed, front faces dropped): isotropic {isotropic:.3?}, walls {walls:.3?}");
    assert!(isotropic.iter().all(|r| (0.57..0.76).contains(&r.0)), "60-73 %: {isotropic:?}");
    assert!((0.03..0.08).contains(&isotropic[0].1) && (0.08..0.19).contains(&isotropic[2].1), "{isotropic:?}");
    assert!((0.005..0.04).contains(&walls[0].1) && (0.04..0.15).contains(&walls[2].1), "{walls:?}");
}

#[test]
fn floors_and_cameras_without_an_azimuth_are_spared() {
    let mut scene = soup(70, 300, 10.0, 1.0);
    scene.positions.iter_mut().enumerate().for_each(|(i, p)| p.z = (i / 3) as f64 * 0.1);
    let h = list(&scene, 1);
    for sectors in [4, 8, 16] {
        let culling = format!("octant_mask:sectors={sectors}");
        let mut method = Method::new(&scene, &h, &culling, "flat");
        for forward in [DVec3::X, DVec3::NEG_Y, DVec3::Z] {
            let (out, _) = method.frame(&view_along(DVec3::ZERO, forward, &Camera::default()));
            assert_eq!(out.entry_count(), 300, "{culling} along {forward}");
        }
    }
}
