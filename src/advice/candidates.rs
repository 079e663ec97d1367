//! The combinations that an advice chooses among where none are given.

use super::Combination;
use super::features::Features;
use crate::culling::{self, mailbox, usual_walk};
use crate::error::Result;
use crate::registry::{Spec, parse_sum};
use crate::structure;

/// Structures worth a look: flat ones, trees of several depths, and what Silva (2009) and
/// Serpa & Rodrigues (2014) left to be tried.
pub const STRUCTURES: &[&str] = &[
    "list",
    "list:leaf_size=16",
    "octree:depth=3",
    "octree:depth=4",
    "octree:depth=5",
    "octree:depth=6",
    "bvh",
    "bvh:leaf_size=16",
    "kd_tree",
    "kd_tree:leaf_size=16",
    "uniform_grid",
    "irregular_grid",
    "nested_grid",
    "bsp",
    "bsp:heuristic=surface",
    "hybrid",
    "portal_octree:planes=walls,depth=4",
    "portal_octree:planes=walls,depth=5",
];

/// All of them conservative.
pub const CULLINGS: &[&str] =
    &["none", "frustum", "frustum+normal_cone", "frustum+back_face", "frustum+normal_cone+back_face"];

/// Every structure with every culling.
///
/// # Errors
/// Never for the lists above; a caller's own may hold names that are unknown.
pub fn product<T: AsRef<str>>(structures: &[T], cullings: &[T]) -> Result<Vec<Combination>> {
    let mut out = Vec::new();
    for structure in structures {
        let structure = structure::make(&Spec::parse(structure.as_ref())?)?.1;
        for culling in cullings {
            let culling = culling::make_tests(&parse_sum(culling.as_ref())?)?.1;
            out.push(Combination { walk: usual_walk(&structure), structure: structure.clone(), culling });
        }
    }
    Ok(out)
}

/// What of `all` runs over copies of triangles, and how to draw each copy once.
pub fn with_mailboxes(all: &[Combination]) -> Vec<Combination> {
    let asked = |c: &Combination| !c.culling.is_empty() && c.culling.iter().all(|t| t.kind != mailbox::NAME);
    let once = |c: &Combination| {
        // What judges single triangles has fewer of them to judge after it.
        let by_triangle = |t: &Spec| matches!(t.kind.as_str(), "back_face" | "look_at" | "sector");
        let mut culling = c.culling.clone();
        let at = culling.iter().position(by_triangle).unwrap_or(culling.len());
        culling.insert(at, Spec::new(mailbox::NAME));
        Combination { culling, ..c.clone() }
    };
    all.iter().filter(|c| mailbox::has_copies(&c.structure) && asked(c)).map(once).collect()
}

/// Scenes with more triangles are not cut into pieces to find out whether that pays.
const PIECES_MAX: usize = 500_000;

/// Why `combination` cannot win on a scene like this, so that it is not even counted.
pub fn pointless(combination: &Combination, features: &Features) -> Option<String> {
    let kind = combination.structure.kind.as_str();
    if kind == "portal_octree" && features.axis_aligned < 0.3 {
        return Some(format!(
            "its portals close at walls parallel to the axes, which are {:.0} % of the area",
            100.0 * features.axis_aligned
        ));
    }
    if kind == "portal_octree" && features.depth_complexity < 1.5 {
        return Some(format!("there is little to hide: {:.1} surfaces behind a pixel", features.depth_complexity));
    }
    if kind == "portal_octree" && features.triangles > PIECES_MAX {
        return Some(format!("it would be built over all {} triangles only to be counted", features.triangles));
    }
    None
}
