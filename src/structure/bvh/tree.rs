//! A binary tree in 32 bytes a node, as the builders of this folder leave it.

use crate::hierarchy::NONE;
use crate::math::Box32;
#[cfg(test)]
use crate::structure::builder::Node;

/// Children lie side by side and after their parent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Slim {
    pub bounds: Box32,
    /// First entry of a leaf, first child of an inner node.
    pub first: u32,
    /// Entries of a leaf; 0 for an inner node.
    pub count: u32,
}

const _: () = assert!(size_of::<Slim>() == 32);

impl Slim {
    pub const UNBORN: Slim = Slim { bounds: Box32::EMPTY, first: NONE, count: 0 };
}

/// A tree whose parts grew in tasks of their own.
pub enum Tree {
    /// Node 0 is the root.
    Part(Vec<Slim>),
    Fork(Box32, Box<[Tree; 2]>),
}

impl Tree {
    /// All parts in one array.
    pub fn join(self) -> Vec<Slim> {
        match self {
            Tree::Part(nodes) => nodes,
            fork => {
                let mut out = Vec::with_capacity(fork.len());
                out.push(Slim::UNBORN);
                fork.lay(&mut out, 0);
                out
            }
        }
    }

    fn len(&self) -> usize {
        match self {
            Tree::Part(nodes) => nodes.len(),
            Tree::Fork(_, sides) => 1 + sides[0].len() + sides[1].len(),
        }
    }

    fn lay(self, out: &mut Vec<Slim>, slot: usize) {
        match self {
            Tree::Part(nodes) => {
                // Node 0 goes to the slot, the others behind what is there.
                let base = out.len() as u32 - 1;
                let mut moved =
                    nodes.into_iter().map(|n| Slim { first: if n.count == 0 { n.first + base } else { n.first }, ..n });
                out[slot] = moved.next().expect("a part has a root");
                out.extend(moved);
            }
            Tree::Fork(bounds, sides) => {
                let first = out.len();
                out[slot] = Slim { bounds, first: first as u32, count: 0 };
                out.extend([Slim::UNBORN; 2]);
                let [left, right] = *sides;
                left.lay(out, first);
                right.lay(out, first + 1);
            }
        }
    }
}

/// The tree in the form that all builders share: the twin of `lay` starts from it.
#[cfg(test)]
pub fn nodes(slim: &[Slim]) -> Vec<Node> {
    let mut nodes: Vec<Node> = Vec::with_capacity(slim.len());
    nodes
        .extend(slim.iter().map(|s| Node { bounds: s.bounds, ..Node::new(s.first, s.first.wrapping_add(s.count), 0) }));
    for (i, s) in slim.iter().enumerate().filter(|(_, s)| s.count == 0) {
        let level = nodes[i].level + 1;
        nodes[i].first_child = s.first;
        nodes[i].child_count = 2;
        nodes[s.first as usize].level = level;
        nodes[s.first as usize + 1].level = level;
    }
    for i in (0..slim.len()).rev().filter(|i| slim[*i].count == 0) {
        let child = slim[i].first as usize;
        let (first, end) = (nodes[child].first, nodes[child + 1].end);
        (nodes[i].first, nodes[i].own_end, nodes[i].end) = (first, first, end);
    }
    nodes
}
