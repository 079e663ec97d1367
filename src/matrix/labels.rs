//! Short names of a run's parts, without parameters that have their default.

use crate::claim::axis_value;
use crate::manifest::axes::{AXES, axis};
use crate::record::{RunSpec, cameras};
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
    /// Values of further axes by name, the usual ones too.
    further: Vec<(&'static str, String)>,
    /// Those that are not usual: `f64`.
    special: Vec<String>,
}

impl Labels {
    /// `octree × frustum`, the walk and further axes only where they are not the usual ones.
    pub fn cell(&self) -> String {
        let walk = if self.walk_is_special { format!(" × {}", self.walk) } else { String::new() };
        let special: String = self.special.iter().map(|s| format!(" × {s}")).collect();
        format!("{} × {}{walk}{special}", self.structure, self.culling)
    }

    /// By axis name; an unknown axis has no label.
    pub fn of(&self, axis: &str) -> String {
        match axis {
            "scene" => &self.scene,
            "path" => &self.path,
            "structure" => &self.structure,
            "culling" => &self.culling,
            "walk" => &self.walk,
            _ => {
                return self.further.iter().find(|(name, _)| *name == axis).map(|(_, l)| l.clone()).unwrap_or_default();
            }
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
        further: AXES[3..].iter().map(|a| (a.name, label(a.name, &axis_value(run, a.name)))).collect(),
        special: run.further(),
    }
}

/// A value of an axis, short; no parts are `none`.
pub fn label(axis: &str, value: &[Spec]) -> String {
    if value.is_empty() {
        return "none".to_string();
    }
    if axis == cameras::AXIS {
        return value.iter().map(cameras::label).collect::<Vec<_>>().join("+");
    }
    let parts = AXES.iter().find(|a| a.name == axis).map(|a| (a.parts)()).unwrap_or_default();
    let short = |s: &Spec| match parts.iter().find(|p| p.name == s.kind) {
        Some(part) => s.label(part.params),
        None => s.to_string(),
    };
    value.iter().map(short).collect::<Vec<_>>().join("+")
}
