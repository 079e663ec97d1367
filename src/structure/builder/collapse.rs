//! Collapse of a binary tree into one with up to 8 children a node (Wald,
//! Benthin & Boulos 2008 do this for BVHs): a node adopts the children of the
//! largest child until it is full. Leaves, their order and their boxes stay.

use crate::hierarchy::{LANES, NONE};
use crate::math::Box32;
use crate::structure::builder::Node;
use std::ops::Range;

/// A binary tree in an array.
pub trait Binary {
    /// Empty for a leaf.
    fn children(&self, i: usize) -> Range<usize>;
    fn bounds(&self, i: usize) -> Box32;
}

impl Binary for [Node] {
    fn children(&self, i: usize) -> Range<usize> {
        self[i].children()
    }

    fn bounds(&self, i: usize) -> Box32 {
        self[i].bounds
    }
}

/// Nodes of the wide tree, children side by side and after their parent.
pub fn collapse(binary: &[Node]) -> Vec<Node> {
    let mut wide = Vec::with_capacity(binary.len());
    wide.push(binary[0]);
    // Binary node behind each wide one.
    let mut origin = Vec::with_capacity(binary.len());
    origin.push(0u32);
    let mut at = 0;
    while at < wide.len() {
        let family = Family::of(binary, origin[at] as usize, LANES);
        let members = family.members();
        let level = wide[at].level + 1;
        wide[at].first_child = if members.is_empty() { NONE } else { wide.len() as u32 };
        wide[at].child_count = members.len() as u8;
        wide.extend(members.iter().map(|i| Node { level, ..binary[*i as usize] }));
        origin.extend(members);
        at += 1;
    }
    wide
}

/// Up to `width` descendants that together are one node, in the order of entries.
pub struct Family {
    members: [u32; LANES],
    /// Surface of each, as a number in the total order of f32; below every other for a
    /// leaf, which has no children to adopt.
    areas: [i32; LANES],
    count: usize,
}

impl Family {
    /// # Panics
    /// If a node has more than two children: the tree is not binary.
    pub fn of<T: Binary + ?Sized>(tree: &T, i: usize, width: usize) -> Family {
        let mut family = Family { members: [0; LANES], areas: [LEAF_AREA; LANES], count: 0 };
        if tree.children(i).is_empty() {
            return family;
        }
        family.adopt(tree, 0, i);
        while family.count < width {
            // The first of equals, so that the tree depends on the boxes alone.
            let (mut largest, mut area) = (0, family.areas[0]);
            for k in 1..family.count {
                if family.areas[k] > area {
                    (largest, area) = (k, family.areas[k]);
                }
            }
            if area == LEAF_AREA {
                break;
            }
            family.adopt(tree, largest, family.members[largest] as usize);
        }
        family
    }

    pub fn members(&self) -> &[u32] {
        &self.members[..self.count]
    }

    /// Puts the children of node `i` where member `at` was, if there was any.
    fn adopt<T: Binary + ?Sized>(&mut self, tree: &T, at: usize, i: usize) {
        let children = tree.children(i);
        let more = children.len() - 1;
        assert!(more <= 1 && self.count + more <= LANES, "the tree is binary");
        for k in (at + 1..self.count).rev() {
            (self.members[k + more], self.areas[k + more]) = (self.members[k], self.areas[k]);
        }
        self.count = self.count.max(1) + more;
        for (k, child) in (at..).zip(children) {
            self.members[k] = child as u32;
            self.areas[k] = if tree.children(child).is_empty() { LEAF_AREA } else { rank(tree.bounds(child)) };
        }
    }
}

const LEAF_AREA: i32 = i32::MIN;

/// The area of a box, so that whole numbers compare as [`f32::total_cmp`] does.
fn rank(bounds: Box32) -> i32 {
    let bits = bounds.half_area().to_bits() as i32;
    bits ^ ((bits >> 31) as u32 >> 1) as i32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_binary_tree_of_three_levels_becomes_one_group_of_eight() {
        let unit = Box32 { lo: crate::math::Vec3::ZERO, hi: crate::math::Vec3::ONE };
        let mut binary: Vec<Node> = (0..15).map(|i| Node { bounds: unit, ..Node::new(i, i + 1, 0) }).collect();
        for (i, node) in binary.iter_mut().enumerate().take(7) {
            node.first_child = 2 * i as u32 + 1;
            node.child_count = 2;
        }
        let wide = collapse(&binary);
        assert_eq!(wide.len(), 9);
        assert_eq!(wide[0].children(), 1..9);
        assert_eq!(wide[1..].iter().map(|n| n.first).collect::<Vec<_>>(), (7..15).collect::<Vec<_>>());
        assert!(wide[1..].iter().all(Node::is_leaf));
    }

    #[test]
    fn a_family_is_what_plain_lists_make_of_it() {
        use rand_chacha::rand_core::{RngCore, SeedableRng};
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(8);
        for nodes in (1..60).chain([400]) {
            // Few sizes, so that many areas are equal.
            let mut node = |first: u32| {
                let hi = crate::math::Vec3::splat((rng.next_u32() % 4) as f32);
                Node { bounds: Box32 { lo: crate::math::Vec3::ZERO, hi }, ..Node::new(first, first + 1, 0) }
            };
            let mut binary = vec![node(0)];
            while binary.len() < nodes {
                let (at, first) = (binary.len() * 7 / 11, binary.len() as u32);
                let leaf = (at..binary.len()).find(|i| binary[*i].is_leaf()).expect("the last is a leaf");
                let children = if first.is_multiple_of(5) { 1 } else { 2 };
                (binary[leaf].first_child, binary[leaf].child_count) = (first, children);
                (0..u32::from(children)).for_each(|c| binary.push(node(first + c)));
            }
            for (i, width) in (0..binary.len()).flat_map(|i| [(i, 2), (i, LANES)]) {
                let mut plain: Vec<usize> = binary[i].children().collect();
                while plain.len() < width {
                    let area = |k: &usize| binary[plain[*k]].bounds.half_area();
                    let inner = (0..plain.len()).filter(|k| !binary[plain[*k]].is_leaf());
                    // The first of the largest: the last from behind.
                    let Some(k) = inner.rev().max_by(|a, b| area(a).total_cmp(&area(b))) else { break };
                    plain.splice(k..=k, binary[plain[k]].children());
                }
                let family = Family::of(&binary[..], i, width);
                assert!(family.members().iter().map(|m| *m as usize).eq(plain), "{nodes} nodes, of {i}");
            }
        }
    }
}
