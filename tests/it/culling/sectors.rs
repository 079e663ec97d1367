//! `look_at` (fact C2) and `sector` (fact C4): what they lose and what they remove.

use super::build::{Rng, camera, list, view_along};
use super::masks::is_front;
use super::walks::{Method, triangles};
use crate::common::soup;
use cullmark::math::{Camera, DVec3, Pose, Projection, View};
use cullmark::scene::Scene;

#[derive(Clone, Copy)]
enum Normals {
    Isotropic,
    /// Elevation up to so many degrees.
    Walls(f64),
}

/// Small triangles all over the screen of `view`, with normals as wanted.
fn field(rng: &mut Rng, view: &View, count: usize, normals: Normals) -> Scene {
    let mut scene = soup(rng.bits(), count, 1.0, 1.0);
    for t in 0..count {
        let (x, y) = (rng.range(-0.999, 0.999) * view.half_width, rng.range(-0.999, 0.999) * view.half_height);
        let at = match view.is_perspective() {
            true => view.eye + (view.forward + view.right * x + view.up * y) * rng.range(5.0, 50.0),
            false => view.eye + view.forward * rng.range(5.0, 50.0) + view.right * x + view.up * y,
        };
        let n = match normals {
            Normals::Isotropic => rng.direction(),
            Normals::Walls(slope_deg) => {
                let (turn, up) = (rng.range(0.0, std::f64::consts::TAU), rng.range(-slope_deg, slope_deg));
                let up = up.to_radians();
                DVec3::new(turn.cos() * up.cos(), turn.sin() * up.cos(), up.sin())
            }
        };
        let u = n.any_orthonormal_vector();
        let v = n.cross(u);
        for (k, vertex) in scene.triangles[t].into_iter().enumerate() {
            let (sin, cos) = (k as f64 * std::f64::consts::TAU / 3.0).sin_cos();
            scene.positions[vertex as usize] = at + (u * cos + v * sin) * 1e-3;
        }
    }
    scene.anchor();
    scene
}

/// Looking anywhere, with a pitch within 20 degrees.
fn level(rng: &mut Rng, camera: &Camera) -> View {
    let (yaw, pitch) = (rng.range(0.0, std::f64::consts::TAU), rng.range(-20.0, 20.0f64).to_radians());
    let forward = DVec3::new(yaw.cos() * pitch.cos(), yaw.sin() * pitch.cos(), pitch.sin());
    View::new(camera, &Pose { eye: rng.cube(10.0), forward, up: DVec3::Z })
}

/// Shares (of front faces lost, of back faces removed) over many views.
fn shares(rng: &mut Rng, camera: &Camera, normals: Normals, culling: &str, views: usize) -> [f64; 2] {
    let mut sum = [0f64; 4];
    for _ in 0..views {
        let view = level(rng, camera);
        let scene = field(rng, &view, 1000, normals);
        let h = list(&scene, 64);
        let kept = triangles(&h, &Method::new(&scene, &h, culling, "flat").frame(&view).0);
        for t in 0..scene.len() {
            let back = !is_front(&view, scene.corners(t as u32));
            sum[2 * usize::from(back) + usize::from(!kept[t])] += 1.0;
        }
    }
    [sum[1] / (sum[0] + sum[1]), sum[3] / (sum[2] + sum[3])]
}

/// C2.1: share of truly front-facing triangles that the look-at test drops.
#[test]
fn look_at_drops_the_published_share_of_front_faces() {
    let table = [
        (30.0, 4.0 / 3.0, 0.074),
        (45.0, 4.0 / 3.0, 0.111),
        (60.0, 4.0 / 3.0, 0.148),
        (60.0, 16.0 / 9.0, 0.172),
        (90.0, 16.0 / 9.0, 0.249),
    ];
    let mut rng = Rng::new(101);
    for (fov, aspect, published) in table {
        let [lost, removed] = shares(&mut rng, &camera(fov, aspect), Normals::Isotropic, "look_at", 16);
        println!(
            "C2.1 {fov} deg {aspect:.2}: drops {:.1} % of front faces (published {:.1} %)",
            lost * 100.0,
            published * 100.0
        );
        // 8000 front faces: three standard errors are 1.5 points at most.
        assert!((lost - published).abs() < 0.015, "{fov}: {lost} for {published}");
        assert!((removed - (1.0 - lost)).abs() < 0.02, "as many back faces are missed: {removed}");
    }
}

// C2.2.
#[test]
fn look_at_is_right_under_parallel_rays() {
    let mut rng = Rng::new(102);
    let camera = Camera { projection: Projection::Orthographic { height_m: 20.0 }, ..Camera::default() };
    let [lost, removed] = shares(&mut rng, &camera, Normals::Isotropic, "look_at", 10);
    assert_eq!((lost, removed), (0.0, 1.0));
}

/// C4.1: a sector equal to the look-at's is seldom wrong, and removes little.
#[test]
fn equal_sectors_lose_and_remove_the_published_shares() {
    let cameras = [camera(45.0, 4.0 / 3.0), camera(60.0, 16.0 / 9.0), camera(90.0, 16.0 / 9.0)];
    let table = [
        ("isotropic", Normals::Isotropic, [0.006, 0.010, 0.022]),
        ("walls", Normals::Walls(0.0), [0.0, 0.0, 0.003]),
        ("walls within 20 deg", Normals::Walls(20.0), [0.0002, 0.0007, 0.007]),
    ];
    let mut rng = Rng::new(103);
    for (name, normals, published) in table {
        for (camera, published) in cameras.iter().zip(published) {
            let [lost, removed] = shares(&mut rng, camera, normals, "sector", 40);
            println!(
                "C4.1 {name}: drops {:.2} % of front faces (published {:.2} %), removes {:.1} % of back faces",
                lost * 100.0,
                published * 100.0,
                removed * 100.0
            );
            // 20,000 front faces of 40 views: views differ more than triangles do.
            assert!((lost - published).abs() <= 0.0015 + published * 0.35, "{name}: {lost} for {published}");
            assert!((0.18..0.32).contains(&removed), "about a quarter: {removed}");
        }
    }
}

/// C4.1: fewer sectors remove more and err more.
#[test]
fn the_number_of_sectors_trades_removal_for_errors() {
    let mut rng = Rng::new(104);
    let camera = camera(60.0, 16.0 / 9.0);
    let of = [4, 8, 16].map(|r| shares(&mut rng, &camera, Normals::Isotropic, &format!("sector:sectors={r}"), 40));
    println!("C4.1 (lost, removed) with 4, 8, 16 sectors: {of:.4?} (removed, published: 47 %, 25 %, 12 %)");
    for ([_, removed], published) in of.iter().zip([0.47, 0.25, 0.12]) {
        assert!((removed - published).abs() < 0.04, "{of:?}");
    }
    assert!((0.03..0.08).contains(&of[0][0]) && of[0][0] > of[1][0] && of[1][0] > of[2][0], "{of:?}");
}

/// C4.2 by triangle.
#[test]
fn averted_sectors_are_octant_masks_by_triangle() {
    let scene = soup(105, 2000, 20.0, 1.0);
    let h = list(&scene, 1);
    let mut rng = Rng::new(105);
    for sectors in [4, 8, 16] {
        let mut octants = Method::new(&scene, &h, &format!("octant_mask:sectors={sectors}"), "flat");
        let mut averted = Method::new(&scene, &h, &format!("sector:rule=averted,sectors={sectors}"), "flat");
        for _ in 0..8 {
            let view = View::new(&camera(60.0, 1.5), &rng.pose(20.0));
            assert_eq!(triangles(&h, &octants.frame(&view).0), triangles(&h, &averted.frame(&view).0));
        }
    }
    let cameras = [camera(45.0, 4.0 / 3.0), camera(90.0, 16.0 / 9.0)];
    for (name, normals, lost_in) in
        [("isotropic", Normals::Isotropic, [0.05, 0.15]), ("walls", Normals::Walls(0.0), [0.02, 0.11])]
    {
        for (camera, published) in cameras.iter().zip(lost_in) {
            let [lost, removed] = shares(&mut rng, camera, normals, "sector:rule=averted", 40);
            println!(
                "C4.2 {name}: drops {:.1} % (published {:.0} %), removes {:.1} %",
                lost * 100.0,
                published * 100.0,
                removed * 100.0
            );
            assert!((lost - published).abs() < 0.02 + published * 0.2, "{name}: {lost} for {published}");
            assert!((0.57..0.76).contains(&removed), "60-73 %: {removed}");
        }
    }
}

#[test]
fn safe_sectors_lose_no_front_face() {
    let mut rng = Rng::new(106);
    let parallel = Camera { projection: Projection::Orthographic { height_m: 20.0 }, ..Camera::default() };
    let cameras = [1.0, 20.0, 45.0, 75.0, 120.0].map(|f| camera(f, 1.4));
    for camera in cameras.iter().chain([&parallel]) {
        for normals in [Normals::Isotropic, Normals::Walls(0.0), Normals::Walls(10.0), Normals::Walls(20.0)] {
            for sectors in [4, 8, 16] {
                let [lost, _] = shares(&mut rng, camera, normals, &format!("sector:rule=safe,sectors={sectors}"), 3);
                assert_eq!(lost, 0.0, "{camera:?}");
            }
        }
    }
    // C6: averted sectors of 8, by the greatest elevation, at 58 and 91.5 degrees across.
    for (elevation_deg, published) in [(10.0, [1.51, 0.75]), (20.0, [1.30, 0.54])] {
        for (camera, published) in [camera(45.0, 4.0 / 3.0), camera(60.0, 16.0 / 9.0)].iter().zip(published) {
            let normals = Normals::Walls(elevation_deg);
            let removed: f64 = (0..60)
                .map(|_| {
                    let yaw = rng.range(0.0, std::f64::consts::TAU);
                    let view = view_along(DVec3::ZERO, DVec3::new(yaw.cos(), yaw.sin(), 0.0), camera);
                    let scene = field(&mut rng, &view, 300, normals);
                    let h = list(&scene, 64);
                    let mut method = Method::new(&scene, &h, "sector:rule=safe", "flat");
                    1.0 - method.frame(&view).0.entry_count() as f64 / 300.0
                })
                .sum();
            let averted = removed / 60.0 * 8.0;
            println!("C6 averted sectors of 8 within {elevation_deg} deg: {averted:.2} (published {published:.2})");
            assert!((averted - published).abs() < 0.3, "{averted} for {published}");
        }
    }
}
