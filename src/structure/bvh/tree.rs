//! A binary tree in 32 bytes a node, as the builders of this folder leave it.

use crate::hierarchy::NONE;
use crate::math::Box32;
#[cfg(test)]
use crate::structure::builder::Node;

/// Children lie side by side and after their parent; the entries of the left one come
/// first. So counts alone tell which entries belong to a node.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Slim {
    pub bounds: Box32,
    /// First of two children; [`NONE`] for a leaf.
    pub child: u32,
    /// Entries of the subtree.
    pub count: u32,
}

const _: () = assert!(size_of::<Slim>() == 32);

impl Slim {
    pub const UNBORN: Slim = Slim { bounds: Box32::EMPTY, child: NONE, count: 0 };

    pub fn is_leaf(&self) -> bool {
        self.child == NONE
    }
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
                    nodes.into_iter().map(|n| Slim { child: if n.is_leaf() { NONE } else { n.child + base }, ..n });
                out[slot] = moved.next().expect("a part has a root");
                out.extend(moved);
            }
            Tree::Fork(bounds, sides) => {
                let child = out.len();
                out.extend([Slim::UNBORN; 2]);
                let [left, right] = *sides;
                left.lay(out, child);
                right.lay(out, child + 1);
                let count = out[child].count + out[child + 1].count;
                out[slot] = Slim { bounds, child: child as u32, count };
            }
        }
    }
}

/// The tree in the form that all builders share: the twin of `lay` starts from it.
#[cfg(test)]
pub fn nodes(slim: &[Slim]) -> Vec<Node> {
    let mut nodes: Vec<Node> = Vec::with_capacity(slim.len());
    nodes.extend(slim.iter().map(|s| Node { bounds: s.bounds, ..Node::new(0, s.count, 0) }));
    for (i, s) in slim.iter().enumerate().filter(|(_, s)| !s.is_leaf()) {
        let (first, end, level) = (nodes[i].first, nodes[i].end, nodes[i].level + 1);
        let child = s.child as usize;
        let middle = first + slim[child].count;
        (nodes[i].first_child, nodes[i].child_count, nodes[i].own_end) = (s.child, 2, first);
        for (c, first, end) in [(child, first, middle), (child + 1, middle, end)] {
            nodes[c] = Node { bounds: slim[c].bounds, ..Node::new(first, end, level) };
        }
    }
    nodes
}
