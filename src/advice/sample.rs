//! A sample of a scene on which candidates are counted: every k-th triangle, with
//! whatever a structure counts in triangles scaled by k.
//!
//! A leaf of 64 triangles of the scene is a leaf of 64 / k of the sample, in about the
//! same place, so nodes and ranges come out alike and triangles k times fewer. Files keep
//! neighbours together, so every k-th triangle is spread over the scene.

use crate::hierarchy::LANES;
use crate::registry::{Spec, Value};
use crate::scene::Scene;

/// Scenes of up to so many triangles are their own sample.
const TRIANGLES_MAX: usize = 1 << 15;

pub struct Sample {
    pub scene: Scene,
    pub scale: Scale,
}

/// How a sample stands to the scene.
#[derive(Debug, Clone, Copy)]
pub struct Scale {
    /// Of how many triangles it takes one.
    pub one_in: u32,
    /// How many more changes of material there are within the leaves of the scene than
    /// within those of the sample; each is a draw call.
    pub material_changes: f64,
}

impl Sample {
    pub fn of(scene: &Scene) -> Sample {
        let one_in = scene.len().div_ceil(TRIANGLES_MAX).max(1);
        let chosen: Vec<u32> = (0..scene.len() as u32).step_by(one_in).collect();
        let mut sample = Sample { scene: scene.part(&chosen), scale: Scale { one_in: one_in as u32, ..Scale::WHOLE } };
        if one_in > 1 {
            let of = |scene: &Scene, one_in: u32| changes(scene, one_in).max(1.0);
            sample.scale.material_changes = (of(scene, 1) / of(&sample.scene, one_in as u32)).max(1.0);
        }
        sample
    }
}

impl Scale {
    /// Of the scene as its own sample.
    pub const WHOLE: Scale = Scale { one_in: 1, material_changes: 1.0 };
}

/// Changes of material within the clusters of a list.
fn changes(scene: &Scene, one_in: u32) -> f64 {
    let spec = Spec::new("list").with("leaf_size", Value::Int(i64::from((LEAF / one_in).max(1))));
    let list = crate::structure::make(&spec).and_then(|(list, _)| list.build(scene));
    let Ok(h) = list else { return 0.0 };
    let inside = |(first, end): (u32, u32)| f64::from(h.material_runs(first, end) - 1);
    let lanes =
        h.links.iter().flat_map(|l| (0..LANES).filter(|i| l.live >> i & 1 == 1).map(|i| (l.first[i], l.end[i])));
    lanes.map(inside).sum()
}

/// Triangles of a usual leaf.
const LEAF: u32 = 64;

/// `structure` for a sample of one triangle in `one_in`.
pub fn scaled(structure: &Spec, one_in: u32) -> Spec {
    let mut out = structure.clone();
    for (name, value) in &mut out.params {
        let new = match (name.as_str(), &*value) {
            // 0 means "no limit" where it is allowed at all.
            ("leaf_size" | "min_leaf" | "leaf_limit" | "dense", Value::Int(n)) if *n > 0 => {
                Value::Int((n / i64::from(one_in)).max(1))
            }
            // Cells go with the number of triangles, in a nested grid with its power 0.6.
            ("density", Value::Float(x)) => {
                let power = if structure.kind == "nested_grid" { 0.6 } else { 1.0 };
                Value::Float((x * libm::pow(f64::from(one_in), power)).min(1000.0))
            }
            _ => continue,
        };
        *value = new;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_counted_in_triangles_is_scaled() {
        let spec = |text: &str| Spec::parse(text).unwrap();
        assert_eq!(scaled(&spec("bvh:leaf_size=64,bins=16"), 10), spec("bvh:leaf_size=6,bins=16"));
        assert_eq!(scaled(&spec("bsp:min_leaf=200"), 1000), spec("bsp:min_leaf=1"));
        assert_eq!(scaled(&spec("octree:depth=4,leaf_limit=0"), 10), spec("octree:depth=4,leaf_limit=0"));
        assert_eq!(scaled(&spec("uniform_grid:density=4.0"), 10), spec("uniform_grid:density=40.0"));
    }
}
