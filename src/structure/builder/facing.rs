//! Leaves divided by where their triangles face, below any division of space.
//!
//! Serpa & Rodrigues (2014) blame the weak gain of back-face masks on the mixture of
//! directions in a node and propose subdivision that minds the masks. Here a leaf
//! becomes a node with up to seven leaves of its own: one for each face of the cube map
//! that normals fall in (the cells of `normal_mask` at one cell a face), and one for
//! triangles without a trustworthy back. Seven siblings are one block, so the price is
//! one more block of tests where the leaf is not outside, and more material runs.
//!
//! Every triangle stays in its leaf's subtree, so nothing changes for other tests.

use super::Node;
use crate::scene::Scene;
use rayon::prelude::*;

/// Leaves with fewer triangles cost less to draw than to test in parts.
const LEAF_MIN: u32 = 16;
/// Six faces of the cube map, and what has no back.
const GROUPS: usize = 7;

/// Group of a triangle: the axis that its normal is nearest to, by sign.
fn group(scene: &Scene, triangle: u32) -> u8 {
    let n = scene.normal(triangle);
    let a = n.abs();
    if scene.two_sided[triangle as usize] || !n.is_finite() || n == crate::math::DVec3::ZERO {
        return 6;
    }
    let axis = if a.x >= a.y && a.x >= a.z { 0 } else { 1 + usize::from(a.z > a.y) };
    2 * axis as u8 + u8::from(n[axis] < 0.0)
}

/// Gives every leaf of mixed facing children of one facing each. Entries of a group
/// keep their order; bounds are the caller's, as for other nodes.
pub fn split_leaves(scene: &Scene, nodes: &mut Vec<Node>, entries: &mut [u32]) {
    let groups: Vec<u8> = (0..scene.len() as u32).into_par_iter().with_min_len(4096).map(|t| group(scene, t)).collect();
    let mut sorted = Vec::new();
    for i in 0..nodes.len() {
        let Node { first, end, level, .. } = nodes[i];
        if !nodes[i].is_leaf() || end - first < LEAF_MIN {
            continue;
        }
        let own = &mut entries[first as usize..end as usize];
        let mut counts = [0u32; GROUPS];
        own.iter().for_each(|t| counts[usize::from(groups[*t as usize])] += 1);
        if counts.iter().filter(|c| **c > 0).count() < 2 {
            continue;
        }
        sorted.clear();
        sorted.extend_from_slice(own);
        sorted.sort_by_key(|t| groups[*t as usize]);
        own.copy_from_slice(&sorted);
        let child = nodes.len() as u32;
        let mut at = first;
        for count in counts.into_iter().filter(|c| *c > 0) {
            nodes.push(Node::new(at, at + count, level + 1));
            at += count;
        }
        let count = (nodes.len() as u32 - child) as u8;
        let node = &mut nodes[i];
        (node.own_end, node.first_child, node.child_count) = (first, child, count);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::DVec3;

    #[test]
    fn a_cube_of_six_sides_becomes_six_leaves() {
        let mut scene = Scene::default();
        for i in 0..24u32 {
            let axis = (i % 6 / 2) as usize;
            let sign = if i % 2 == 0 { 1.0 } else { -1.0 };
            let (u, v) = (DVec3::AXES[(axis + 1) % 3] * sign, DVec3::AXES[(axis + 2) % 3]);
            scene.positions.extend([DVec3::ZERO, u, v]);
            scene.triangles.push([3 * i, 3 * i + 1, 3 * i + 2]);
            scene.two_sided.push(i == 23);
        }
        let mut nodes = vec![Node::new(0, 24, 0)];
        let mut entries: Vec<u32> = (0..24).collect();
        split_leaves(&scene, &mut nodes, &mut entries);
        assert_eq!(nodes[0].children(), 1..8, "six sides and one triangle without a back");
        assert_eq!(entries[..4], [0, 6, 12, 18], "those that face +x come first, in order");
        assert_eq!(entries[23], 23);
        let sizes: Vec<u32> = nodes[1..].iter().map(|n| n.end - n.first).collect();
        assert_eq!(sizes, [4, 4, 4, 4, 4, 3, 1]);
        let mut few = vec![Node::new(0, 15, 0)];
        split_leaves(&scene, &mut few, &mut entries[..15]);
        assert_eq!(few.len(), 1);
    }
}
