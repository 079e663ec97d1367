//! What `inspect` prints of a frame: lines for people, one document for programs.

use super::Method;
use super::nodes::Nodes;
use crate::culling::{Class, DrawList, Removes, Tally};
use crate::math::{Pose, View};
use crate::oracle::{Effort, FrameTruth, Losses};
use crate::record::SceneSpec;
use crate::registry::format_sum;
use crate::runner::Setup;

/// All that is printed.
pub struct Report<'a> {
    pub scene: &'a SceneSpec,
    pub frame_count: usize,
    pub method: &'a Method,
    pub setup: &'a Setup,
    pub view: &'a View,
    pub list: &'a DrawList,
    pub tally: Tally,
    pub nodes: &'a Nodes,
    pub truth: &'a FrameTruth,
    pub losses: &'a Losses,
    pub wrong: Option<&'a str>,
    pub observed: Option<Class>,
    pub effort: &'a Effort,
}

impl Report<'_> {
    fn draw_calls(&self) -> (u64, u64) {
        (self.list.draw_calls(&self.setup.hierarchy), self.list.ranges.len() as u64)
    }

    fn pose(&self) -> Pose {
        Pose { eye: self.view.eye, forward: self.view.forward, up: self.view.up }
    }

    pub fn text(&self) -> String {
        let (e, n) = (&self.losses.errors, self.setup.scene.len() as u64);
        let (calls, calls_any) = self.draw_calls();
        let dropped = self.setup.scene.report.dropped();
        let pose = self.pose();
        let at = |v: crate::math::DVec3| format!("({:.3}, {:.3}, {:.3})", v.x, v.y, v.z);
        let mut lines = vec![
            format!("scene      {}: {} triangles, {} left out", self.scene.name, group(n), group(dropped)),
            format!(
                "frame      {} of {}: eye {}, forward {}",
                e.frame,
                self.frame_count,
                at(pose.eye),
                at(pose.forward)
            ),
            format!("structure  {}", self.method.structure),
            format!(
                "culling    {}, walk {}: {}",
                format_sum(&self.method.culling),
                self.method.walk,
                class_name(self.setup.class)
            ),
            String::new(),
            format!(
                "submitted  {} triangles ({:.2} % of the scene), {} entries, {} draw {} ({} ignoring materials)",
                group(e.submitted),
                100.0 * e.submitted as f64 / n as f64,
                group(e.submitted_entries),
                group(calls),
                if calls == 1 { "call" } else { "calls" },
                group(calls_any)
            ),
        ];
        let done = self.tally.named().into_iter().filter(|(_, _, value)| *value != 0);
        let work: Vec<String> =
            done.map(|(name, _, value)| format!("{} {}", group(value), name.replace('_', " "))).collect();
        lines.push(format!("work       {}", if work.is_empty() { "none".into() } else { work.join(", ") }));
        let nodes = self.nodes;
        lines.push(format!(
            "nodes      {} drawn, {} entered, {} outside, {} hidden, {} not reached",
            group(nodes.drawn),
            group(nodes.entered),
            group(nodes.outside),
            group(nodes.hidden),
            group(nodes.not_reached)
        ));
        lines.push(format!("owed       {} triangles {}", group(e.potential), owed(self.setup.removes)));
        let grid = self.truth.grid;
        lines.push(format!(
            "visible    {} triangles, seen by {}x{} samples in each of {} x {} pixels ({} show anything)",
            group(self.truth.visible.len() as u64),
            grid.samples,
            grid.samples,
            grid.width_px,
            grid.height_px,
            group(e.covered_pixels)
        ));
        lines.extend(self.bracket());
        if e.visible > 0 {
            lines.push(format!("over       {:.2} submitted a visible triangle", e.over_submission()));
        }
        lines.push(match e.false_culls {
            0 => "lost       nothing that a sample sees".to_string(),
            lost => format!(
                "lost       {} visible triangles in {} pixels, the largest hole {} pixels{}",
                group(lost),
                group(e.false_cull_pixels),
                group(e.largest_blob_px),
                match e.false_culls_by_ray {
                    0 => String::new(),
                    n => format!("; {} of them seen by rays alone", group(n)),
                }
            ),
        });
        if !self.losses.hidden.is_empty() {
            lines.push(format!(
                "           {} owed triangles that no sample sees",
                group(self.losses.hidden.len() as u64)
            ));
        }
        if !e.lost_ids.is_empty() {
            let ids = e.lost_ids.iter().map(u32::to_string).collect::<Vec<_>>().join(", ");
            lines.push(format!("           source ids {ids}{}", if self.more_ids() { ", ..." } else { "" }));
        }
        lines.push(match (self.wrong, self.setup.class) {
            (Some(why), class) => format!("verdict    WRONG for a {} method: {why}", class_name(class)),
            (None, Class::Aggressive | Class::Approximate) => {
                format!("verdict    {}: errors are data", class_name(self.setup.class))
            }
            (None, class) => format!("verdict    right for a {} method", class_name(class)),
        });
        lines.extend(self.setup.scene.report.warnings.iter().map(|w| format!("warning    {w}")));
        lines.join("\n") + "\n"
    }

    /// What rays and proofs of hiding add; nothing where neither was asked for.
    fn bracket(&self) -> Vec<String> {
        let (e, effort) = (&self.losses.errors, self.effort);
        if effort.witness_rays == 0 && effort.hiding_cells == 0 {
            return Vec::new();
        }
        let by_ray = self.truth.bracket.witnesses.len() as u64;
        vec![
            format!(
                "bracket    {} to {} visible: {} more seen by rays ({} a triangle), {} proved hidden ({} cells a side)",
                group(e.visible),
                group(e.visible_hi),
                group(by_ray),
                group(effort.witness_rays.into()),
                group(self.truth.bracket.hidden(self.setup.scene.len()).count()),
                group(effort.hiding_cells.into())
            ),
            format!(
                "in vain    {} to {} of what is submitted",
                group(e.submitted_invisible),
                group(e.submitted_unseen)
            ),
        ]
    }

    fn more_ids(&self) -> bool {
        self.losses.seen.len() + self.losses.hidden.len() > self.losses.errors.lost_ids.len()
    }

    pub fn json(&self) -> serde_json::Value {
        let source = |ids: &[u32]| ids.iter().map(|t| self.setup.scene.source_triangle_id[*t as usize]).collect();
        let (seen, hidden): (Vec<u32>, Vec<u32>) = (source(&self.losses.seen), source(&self.losses.hidden));
        let (calls, calls_any) = self.draw_calls();
        let counters: serde_json::Map<_, _> =
            self.tally.named().iter().map(|(name, _, value)| (name.to_string(), (*value).into())).collect();
        serde_json::json!({
            "scene": self.scene,
            "scene_triangles": self.setup.scene.len(),
            "load": self.setup.scene.report,
            "frame": self.losses.errors.frame,
            "frame_count": self.frame_count,
            "pose": self.pose(),
            "camera": self.view.camera,
            "structure": self.method.structure.to_string(),
            "culling": format_sum(&self.method.culling),
            "walk": self.method.walk.to_string(),
            "class": self.setup.class,
            "removes": self.setup.removes,
            "build": self.setup.hierarchy.stats,
            "draw_calls": calls,
            "draw_calls_any_material": calls_any,
            "counters": counters,
            "nodes": {
                "drawn": self.nodes.drawn,
                "entered": self.nodes.entered,
                "outside": self.nodes.outside,
                "hidden": self.nodes.hidden,
                "not_reached": self.nodes.not_reached,
            },
            "samples": self.truth.grid.samples,
            "uncertain_triangles": self.truth.uncertain,
            "witness_rays": self.effort.witness_rays,
            "hiding_cells": self.effort.hiding_cells,
            "observed_class": self.observed,
            "duplicates": self.losses.errors.duplicates(),
            "errors": self.losses.errors,
            "lost_visible_ids": seen,
            "lost_hidden_ids": hidden,
            "wrong": self.wrong,
        })
    }
}

fn class_name(class: Class) -> String {
    serde_json::to_value(class).ok().and_then(|v| v.as_str().map(|s| s.replace('_', " "))).unwrap_or_default()
}

/// What bounds the set that the method must keep.
fn owed(removes: Removes) -> &'static str {
    match (removes.occluded, removes.back_facing, removes.outside_frustum) {
        (true, ..) => "meet the view volume and face the eye (hidden ones may go)",
        (_, true, _) => "meet the view volume and face the eye",
        (_, _, true) => "meet the view volume",
        _ => "(the whole scene: nothing may be removed)",
    }
}

/// 1234567 as 1,234,567.
fn group(n: u64) -> String {
    let digits = n.to_string();
    let mut out = String::new();
    for (i, d) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            out.push(',');
        }
        out.push(d);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_grouped_by_thousands() {
        assert_eq!([0, 999, 1000, 1234567].map(group), ["0", "999", "1,000", "1,234,567"]);
    }
}
