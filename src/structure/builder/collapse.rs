//! Collapse of a binary tree into one with up to 8 children a node (Wald,
//! Benthin & Boulos 2008 do this for BVHs): a node adopts the children of the
//! largest child until it is full. Leaves, their order and their boxes stay.

use crate::hierarchy::{LANES, NONE};
use crate::structure::builder::Node;

/// Nodes of the wide tree, children side by side and after their parent.
pub fn collapse(binary: &[Node]) -> Vec<Node> {
    let mut wide = vec![binary[0]];
    // Binary node behind each wide one.
    let mut origin = vec![0usize];
    let mut at = 0;
    while at < wide.len() {
        let family = adopt(binary, origin[at]);
        wide[at].first_child = if family.is_empty() { NONE } else { wide.len() as u32 };
        wide[at].child_count = family.len() as u8;
        for &i in &family {
            wide.push(Node { level: wide[at].level + 1, ..binary[i] });
        }
        origin.extend(family);
        at += 1;
    }
    wide
}

/// Up to 8 descendants that together are node `i`, in the order of entries.
fn adopt(binary: &[Node], i: usize) -> Vec<usize> {
    let mut family: Vec<usize> = binary[i].children().collect();
    while !family.is_empty() && family.len() < LANES {
        let area = |i: &usize| binary[*i].bounds.half_area();
        let inner = (0..family.len()).filter(|k| !binary[family[*k]].is_leaf());
        // The first of equals, so that the tree depends on the boxes alone.
        let Some(largest) = inner.rev().max_by(|a, b| area(&family[*a]).total_cmp(&area(&family[*b]))) else { break };
        family.splice(largest..=largest, binary[family[largest]].children());
    }
    family
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_binary_tree_of_three_levels_becomes_one_group_of_eight() {
        let unit = crate::math::Box32 { lo: crate::math::Vec3::ZERO, hi: crate::math::Vec3::ONE };
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
}
