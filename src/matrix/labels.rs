//! Short names of a run's parts, without parameters that have their default.

use crate::claim::axis_value;
use crate::manifest::axes::{AXES, axis};
use crate::record::RunSpec;
use crate::registry::Spec;

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Labels {
    pub scene: String,
    pub path: String,
    pub structure: String,
    pub culling: String,
    pub walk: String,
    /// The walk is not the structure's own.
    pub walk_is_special: bool,
    pub arithmetic: String,
    /// The arithmetic is not the default.
    pub arithmetic_is_special: bool,
}

impl Labels {
    /// `octree × frustum`, walk and arithmetic only where they are not the usual ones.
    pub fn cell(&self) -> String {
        let walk = if self.walk_is_special { format!(" × {}", self.walk) } else { String::new() };
        let arithmetic = if self.arithmetic_is_special { format!(" × {}", self.arithmetic) } else { String::new() };
        format!("{} × {}{walk}{arithmetic}", self.structure, self.culling)
    }

    /// By axis name; an unknown axis has no label.
    pub fn of(&self, axis: &str) -> String {
        match axis {
            "scene" => &self.scene,
            "path" => &self.path,
            "structure" => &self.structure,
            "culling" => &self.culling,
            "walk" => &self.walk,
            "arithmetic" => &self.arithmetic,
            _ => return String::new(),
        }
        .clone()
    }
}

pub fn labels(run: &RunSpec) -> Labels {
    let walk = label("walk", std::slice::from_ref(&run.walk));
    let usual = axis("walk").and_then(|a| a.auto).map(|auto| auto(&run.structure));
    Labels {
        scene: run.scene.name.clone(),
        path: run.path.name.clone(),
        structure: label("structure", std::slice::from_ref(&run.structure)),
        culling: label("culling", &run.culling),
        walk,
        walk_is_special: usual.as_ref() != Some(&run.walk),
        arithmetic: label("arithmetic", &axis_value(run, "arithmetic")),
        arithmetic_is_special: run.axes.contains_key("arithmetic"),
    }
}

/// A value of an axis, short; no parts are `none`.
pub fn label(axis: &str, value: &[Spec]) -> String {
    if value.is_empty() {
        return "none".to_string();
    }
    let parts = AXES.iter().find(|a| a.name == axis).map(|a| (a.parts)()).unwrap_or_default();
    let short = |s: &Spec| match parts.iter().find(|p| p.name == s.kind) {
        Some(part) => s.label(part.params),
        None => s.to_string(),
    };
    value.iter().map(short).collect::<Vec<_>>().join("+")
}
