//! Fact C1: facing of one triangle, and which arithmetic gets its sign right.

use super::build::Rng;
use cullmark::math::DVec3;

fn coord(p: DVec3) -> robust::Coord3D<f64> {
    robust::Coord3D { x: p.x, y: p.y, z: p.z }
}

/// Sign of the exact facing determinant: positive is front.
pub fn exact_facing(corners: [DVec3; 3], eye: DVec3) -> f64 {
    let [a, b, c] = corners.map(coord);
    -robust::orient3d(a, b, c, coord(eye))
}

#[test]
fn a_front_facing_triangle_has_a_negative_orient3d() {
    // Counter-clockwise seen from +z.
    let corners = [DVec3::ZERO, DVec3::X, DVec3::Y];
    assert!(exact_facing(corners, DVec3::new(0.2, 0.2, 1.0)) > 0.0);
    assert!(exact_facing(corners, DVec3::new(0.2, 0.2, -1.0)) < 0.0);
    assert_eq!(exact_facing(corners, DVec3::new(7.0, 3.0, 0.0)), 0.0, "edge-on is not front");
    let mut rng = Rng::new(51);
    for _ in 0..1000 {
        let (a, b, c, e) = (rng.cube(5.0), rng.cube(5.0), rng.cube(5.0), rng.cube(50.0));
        let plain = (b - a).cross(c - a).dot(e - a);
        assert_eq!(exact_facing([a, b, c], e) > 0.0, plain > 0.0);
    }
}

/// C1.1: with f32 normals, `n.e + d` cancels far from the origin, `n.(e - v)` does not.
#[test]
fn the_plane_form_errs_far_out_and_the_difference_form_does_not() {
    let mut rng = Rng::new(52);
    let count = 200_000;
    let mut rates = Vec::new();
    for k in [4, 5, 6] {
        let offset = DVec3::new(0.7, -0.6, 0.4) * 10f64.powi(k);
        let (mut plane_wrong, mut difference_wrong) = (0, 0);
        for _ in 0..count {
            // Vertices that f32 holds too, so that only the form differs.
            let centre = offset + rng.cube(8.0);
            let corners = [0; 3].map(|_| (centre + rng.cube(2.0)).as_vec3().as_dvec3());
            let eye = (offset + rng.cube(8.0)).as_vec3().as_dvec3();
            let front = exact_facing(corners, eye) > 0.0;
            let [a, b, c] = corners;
            let n64 = (b - a).cross(c - a).normalize_or_zero();
            if n64.dot(eye - a) == 0.0 {
                continue;
            }
            let n = n64.as_vec3();
            let d = -n64.dot(a) as f32;
            plane_wrong += u32::from((n.dot(eye.as_vec3()) + d > 0.0) != front);
            difference_wrong += u32::from((n.dot(eye.as_vec3() - a.as_vec3()) > 0.0) != front);
        }
        rates.push((f64::from(plane_wrong) / f64::from(count), f64::from(difference_wrong) / f64::from(count)));
    }
    println!("wrong facing signs at 1e4, 1e5, 1e6 (plane form, difference form): {rates:?}");
    assert!(rates.iter().all(|r| r.1 <= 1e-5), "{rates:?}");
    // A decade more errors a decade farther out.
    assert!((1e-6..2e-4).contains(&rates[0].0), "{rates:?}");
    assert!((3e-5..1e-3).contains(&rates[1].0), "{rates:?}");
    assert!((5e-4..1e-2).contains(&rates[2].0), "{rates:?}");
    assert!(rates[2].0 > 4.0 * rates[1].0, "{rates:?}");
}
