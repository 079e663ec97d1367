//! Does a triangle reach into a closed box?

use crate::math::{Aabb, DVec3};

/// Separating-axis test of a triangle and a closed box (Akenine-Möller 2001).
///
/// Never says "apart" because of rounding: an axis separates only by more than
/// the error of its own evaluation. So touching counts as overlapping, also at
/// large offsets, and a pair within about 16 roundings may count as touching.
pub fn triangle_overlaps(corners: &[DVec3; 3], cell: &Aabb) -> bool {
    let bounds = Aabb::of_points(corners);
    if !bounds.overlaps(cell) {
        return false;
    }
    // Wholly in the cell: no axis can separate. Most triangles, and exact.
    if bounds.lo.cmpge(cell.lo).all() && bounds.hi.cmple(cell.hi).all() {
        return true;
    }
    let size = bounds.lo.abs().max(bounds.hi.abs()).max(cell.lo.abs()).max(cell.hi.abs()).max_element();
    let centre = cell.centre();
    let half = cell.size() * 0.5 + DVec3::splat(16.0 * f64::EPSILON * size);
    let v = corners.map(|p| p - centre);
    let edges = [corners[1] - corners[0], corners[2] - corners[1], corners[0] - corners[2]];

    let (e, f) = (edges[0], edges[1]);
    let normal = e.cross(f);
    let (ea, fa) = (e.abs(), f.abs());
    let permanent = DVec3::new(ea.y * fa.z + ea.z * fa.y, ea.z * fa.x + ea.x * fa.z, ea.x * fa.y + ea.y * fa.x);
    let error = 8.0 * f64::EPSILON * permanent.dot(v[0].abs() + half);
    if normal.dot(v[0]).abs() > normal.abs().dot(half) + error {
        return false;
    }
    edges.iter().all(|e| {
        // Cross products of the edge with the three axes.
        [DVec3::new(0.0, -e.z, e.y), DVec3::new(e.z, 0.0, -e.x), DVec3::new(-e.y, e.x, 0.0)].iter().all(|axis| {
            let s = v.map(|p| axis.dot(p));
            let reach = axis.abs().dot(half);
            s[0].min(s[1]).min(s[2]) <= reach && s[0].max(s[1]).max(s[2]) >= -reach
        })
    })
}

#[cfg(test)]
mod tests {
    use super::super::cut::octants;
    use super::*;
    use proptest::prelude::*;

    /// The naive twin: what clipping at the six faces leaves (Sutherland & Hodgman 1974).
    fn clipped(corners: &[DVec3; 3], cell: &Aabb) -> Vec<DVec3> {
        let mut polygon = corners.to_vec();
        for (axis, sign, at) in (0..3).flat_map(|a| [(a, 1.0, cell.lo[a]), (a, -1.0, cell.hi[a])]) {
            let depth = |p: DVec3| (p[axis] - at) * sign;
            let mut kept = Vec::new();
            for i in 0..polygon.len() {
                let (p, q) = (polygon[i], polygon[(i + 1) % polygon.len()]);
                if depth(p) >= 0.0 {
                    kept.push(p);
                }
                if depth(p) * depth(q) < 0.0 {
                    let mut x = p + (q - p) * (depth(p) / (depth(p) - depth(q)));
                    x[axis] = at;
                    kept.push(x);
                }
            }
            polygon = kept;
        }
        polygon
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]
        #[test]
        fn the_axis_test_agrees_with_clipping(
            p in prop::array::uniform3(prop::array::uniform3(-2.0..2.0f64)), round in any::<bool>(), far in prop::sample::select(vec![0.0, 65536.0]),
        ) {
            // Rounded to halves, corners, edges and faces often touch the unit cube;
            // halves and the shift are exact.
            let corners = p.map(|v| DVec3::from(v.map(|x| far + if round { (x * 2.0).round() * 0.5 } else { x })));
            let cell = Aabb { lo: DVec3::splat(far), hi: DVec3::splat(far + 1.0) };
            let naive = clipped(&corners, &cell);
            let says = triangle_overlaps(&corners, &cell);
            if !naive.is_empty() {
                prop_assert!(says, "clipping leaves {naive:?}");
            } else if round {
                // Clipping rounds where it cuts at thirds: forgive a hair.
                let shrunk = Aabb { lo: cell.lo - 1e-9, hi: cell.hi + 1e-9 };
                prop_assert!(!says || !clipped(&corners, &shrunk).is_empty(), "{corners:?}");
            } else {
                prop_assert!(!says);
            }
        }
    }

    #[test]
    fn a_triangle_in_a_shared_face_is_in_both_cells() {
        let t = [DVec3::new(0.5, 0.2, 0.2), DVec3::new(0.5, 0.8, 0.2), DVec3::new(0.5, 0.2, 0.4)];
        let [low, high, ..] = octants(&Aabb { lo: DVec3::ZERO, hi: DVec3::ONE }, DVec3::splat(0.5));
        assert!(triangle_overlaps(&t, &low) && triangle_overlaps(&t, &high));
    }
}
