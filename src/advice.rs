//! Which combination of structure, culling and walk to use for a scene and a path.
//!
//! Every candidate is first counted on a *sample* of the scene ([`sample`]): its work on
//! the frames of a probe, times what each piece of work costs ([`cost`]), plus what it
//! submits times what drawing costs. That needs no clock, so the same question gets the
//! same short list everywhere. The short list is then built over the whole scene and
//! timed on the probe, taking turns ([`probe`]); the fastest is the advice. Silva (2009)
//! found another winner in every world and left the choice to the reader.
//!
//! The measure of an adviser is its regret: how much slower its choice is than the best
//! of the full matrix (`cullmark advise --study`).

pub mod candidates;
pub mod cost;
pub mod features;
pub mod probe;
pub mod sample;

use crate::culling::{self, Class};
use crate::error::{Error, Result};
use crate::math::{Camera, Pose, View};
use crate::record::TimeModel;
use crate::registry::{Spec, format_sum};
use crate::scene::Scene;
use features::Features;
use probe::{Built, Counts, Timing};
use serde::Serialize;

/// What is to be least.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Objective {
    /// Culling, indices and draw calls: the frame as the model has it.
    #[default]
    Frame,
    /// Culling alone.
    Cull,
}

/// One cell of a matrix without its scene.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Combination {
    pub structure: Spec,
    pub culling: Vec<Spec>,
    pub walk: Spec,
}

impl Combination {
    /// `octree:depth=5 × frustum+back_face`, the walk only where it is not the usual one.
    pub fn label(&self) -> String {
        let part = |kind: &str, spec: &Spec| match kind {
            "structure" => crate::structure::ALL.iter().find(|e| e.name == spec.kind).map(|e| spec.label(e.params)),
            _ => culling::TESTS.iter().find(|e| e.name == spec.kind).map(|e| spec.label(e.params)),
        };
        let own = |kind, spec: &Spec| part(kind, spec).unwrap_or_else(|| spec.to_string());
        let tests: Vec<String> = self.culling.iter().map(|s| own("culling", s)).collect();
        let tests = if tests.is_empty() { format_sum(&[]) } else { tests.join("+") };
        let walk = culling::WALKS.iter().find(|e| e.name == self.walk.kind).map(|e| self.walk.label(e.params));
        let usual = matches!(self.walk.kind.as_str(), "flat" | "depth_first" | "portals") && self.walk_is_plain();
        let walk = walk.filter(|_| !usual).map(|w| format!(" × {w}")).unwrap_or_default();
        format!("{} × {tests}{walk}", own("structure", &self.structure))
    }

    fn walk_is_plain(&self) -> bool {
        let entry = culling::WALKS.iter().find(|e| e.name == self.walk.kind);
        entry.is_some_and(|e| self.walk.label(e.params) == self.walk.kind)
    }
}

/// The question.
pub struct Question<'a> {
    pub scene: &'a Scene,
    pub poses: &'a [Pose],
    pub camera: Camera,
    pub model: TimeModel,
    pub objective: Objective,
    pub candidates: Vec<Combination>,
    /// Methods that may lose visible triangles are candidates too.
    pub aggressive: bool,
    /// How many are built over the whole scene and timed.
    pub short_list: usize,
    /// Frames of the probe, and how often the short list takes its turn.
    pub probe_frames: usize,
    pub turns: usize,
}

impl Question<'_> {
    /// What a nanosecond of culling counts, and what drawing adds.
    fn parts(&self, draw_ns: f64) -> (f64, f64) {
        match self.objective {
            Objective::Frame => (self.model.cull_scale, draw_ns),
            Objective::Cull => (1.0, 0.0),
        }
    }
}

/// A candidate and what became of it.
#[derive(Debug, Clone, Serialize)]
pub struct Considered {
    pub combination: Combination,
    pub label: String,
    /// Why it was not counted, if it was not.
    pub left_out: Option<String>,
    pub class: Option<Class>,
    /// On the sample, scaled to the scene; a frame's mean.
    pub predicted: Option<Counts>,
    pub predicted_ns: Option<f64>,
    /// On the whole scene, for those of the short list.
    pub timed: Option<Timing>,
}

/// The answer; `considered` from the best predicted to the worst, then those left out.
#[derive(Debug, Clone, Serialize)]
pub struct Advice {
    pub objective: Objective,
    pub features: Features,
    /// Triangles of the sample, and of how many it takes one.
    pub sample_triangles: usize,
    pub one_in: u32,
    /// Frames on which all were counted, and those on which the short list was timed.
    pub probe: Vec<u32>,
    pub timed: Vec<u32>,
    pub considered: Vec<Considered>,
    /// Index in `considered`.
    pub chosen: usize,
    /// Sentences.
    pub why: Vec<String>,
}

/// Answers the question. Reads the clock: who calls sees to a quiet, pinned core.
///
/// # Errors
/// When the scene or the path is empty, or no candidate is left.
pub fn advise(question: &Question) -> Result<Advice> {
    if question.scene.is_empty() || question.poses.is_empty() {
        let what = if question.scene.is_empty() { "scene has no triangles" } else { "path has no frames" };
        return Err(Error::new(format!("there is nothing to advise on: the {what}")));
    }
    let probe = probe::frames(question.poses.len(), question.probe_frames);
    let views: Vec<View> = probe.iter().map(|f| View::new(&question.camera, &question.poses[*f as usize])).collect();
    let features = Features::of(question.scene, &views);
    let sample = sample::Sample::of(question.scene);
    let mut considered: Vec<Considered> = question.candidates.iter().map(blank).collect();
    predict(question, &features, &sample, &views, &mut considered);
    considered.sort_by(|a, b| {
        let key = |c: &Considered| c.predicted_ns.unwrap_or(f64::INFINITY);
        key(a).total_cmp(&key(b))
    });
    let short = short_list(&considered, question.short_list);
    if short.is_empty() {
        let mut why = considered.iter().find_map(|c| c.left_out.clone()).unwrap_or_default();
        if why == LOSSY {
            why += "; `--aggressive` lets such methods take part";
        }
        return Err(Error::new("no candidate is left to advise on").help(why));
    }
    let mut built = Vec::new();
    for i in short {
        match Built::new(question.scene, &considered[i].combination) {
            Ok(b) => built.push((i, b)),
            Err(e) => considered[i].left_out = Some(e.to_string()),
        }
    }
    let timed = probe::frames(question.poses.len(), probe::TIMED * question.probe_frames);
    let views: Vec<View> = timed.iter().map(|f| View::new(&question.camera, &question.poses[*f as usize])).collect();
    probe::time(&mut built, &views, question, &mut considered);
    let best = |c: &&(usize, Built)| considered[c.0].timed.as_ref().map_or(f64::INFINITY, |t| t.objective_ns);
    let chosen = built.iter().min_by(|a, b| best(a).total_cmp(&best(b))).map(|b| b.0);
    let Some(chosen) = chosen.filter(|i| considered[*i].timed.is_some()) else {
        return Err(Error::new("no structure of the short list could be built"));
    };
    let why = reasons(question, &considered, chosen);
    Ok(Advice {
        objective: question.objective,
        features,
        sample_triangles: sample.scene.len(),
        one_in: sample.scale.one_in,
        probe,
        timed,
        considered,
        chosen,
        why,
    })
}

fn blank(combination: &Combination) -> Considered {
    Considered {
        combination: combination.clone(),
        label: combination.label(),
        left_out: None,
        class: None,
        predicted: None,
        predicted_ns: None,
        timed: None,
    }
}

/// Counts every candidate on the sample, each structure built once.
fn predict(
    question: &Question,
    features: &Features,
    sample: &sample::Sample,
    views: &[View],
    considered: &mut [Considered],
) {
    let mut order: Vec<usize> = (0..considered.len()).collect();
    order.sort_by_key(|i| considered[*i].combination.structure.to_string());
    let mut last: Option<(Spec, Result<Built>)> = None;
    for i in order {
        let c = &mut considered[i];
        if let Some(why) = candidates::pointless(&c.combination, features) {
            c.left_out = Some(why);
            continue;
        }
        if question.objective == Objective::Cull && c.combination.culling.is_empty() {
            c.left_out = Some("removes nothing: that takes no time, and is no culling".into());
            continue;
        }
        // What looks through walls needs all of them.
        let (scene, scale) = match c.combination.structure.kind.as_str() {
            "portal_octree" => (question.scene, sample::Scale::WHOLE),
            _ => (&sample.scene, sample.scale),
        };
        let scaled = sample::scaled(&c.combination.structure, scale.one_in);
        let same = last.as_ref().is_some_and(|(spec, _)| *spec == scaled);
        if !same {
            let own = Combination { structure: scaled.clone(), ..c.combination.clone() };
            last = Some((scaled, Built::new(scene, &own)));
        }
        let outcome = match last.as_mut() {
            Some((_, Ok(built))) => built.count(scene, &c.combination, views),
            Some((_, Err(e))) => Err(Error::new(e.to_string())),
            None => continue,
        };
        match outcome {
            Err(e) => c.left_out = Some(e.to_string()),
            Ok((class, _)) if class > Class::Conservative && !question.aggressive => {
                c.class = Some(class);
                c.left_out = Some(LOSSY.into());
            }
            Ok((class, counts)) => {
                let counts = counts.scaled(scale);
                let (culled, drawn) = question.parts(counts.draw_ns(&question.model));
                c.class = Some(class);
                c.predicted_ns = Some(culled * cost::cull_ns(&counts) + drawn);
                c.predicted = Some(counts);
            }
        }
    }
}

const LOSSY: &str = "may lose visible triangles";

/// The best predicted, but nothing twice: a test that removes nothing more than a shorter
/// sum does not earn its place, and all but one are not left to one structure.
fn short_list(considered: &[Considered], count: usize) -> Vec<usize> {
    let count = count.max(1);
    let most = count.div_ceil(2).max(1);
    let close = |a: f64, b: f64| (a - b).abs() <= 0.005 * a.max(b);
    let idle = |c: &Considered| {
        let Some(own) = &c.predicted else { return true };
        considered.iter().any(|other| {
            let (a, b) = (&other.combination, &c.combination);
            let kin = a.structure == b.structure && a.walk == b.walk && a.culling.len() < b.culling.len();
            let dearer = other.predicted_ns > c.predicted_ns.map(|ns| 1.005 * ns);
            let same = |p: &Counts| close(p.entries, own.entries) && close(p.draw_calls, own.draw_calls);
            kin && !dearer && other.predicted.as_ref().is_some_and(same)
        })
    };
    let mut chosen: Vec<usize> = Vec::new();
    let mut later = Vec::new();
    for i in (0..considered.len()).filter(|i| considered[*i].predicted.is_some()) {
        let c = &considered[i];
        let kin = chosen.iter().filter(|j| considered[**j].combination.structure == c.combination.structure);
        if kin.count() >= most || idle(c) {
            later.push(i);
        } else if chosen.len() < count {
            chosen.push(i);
        }
    }
    let missing = count - chosen.len();
    chosen.extend(later.into_iter().take(missing));
    chosen.sort_unstable();
    chosen
}

/// What speaks for the choice, in figures of the timed frames.
fn reasons(question: &Question, considered: &[Considered], chosen: usize) -> Vec<String> {
    let us = |ns: f64| format!("{:.1} us", ns / 1e3);
    let Some(own) = &considered[chosen].timed else { return Vec::new() };
    let modelled = match question.objective {
        Objective::Frame => format!(": {} a frame as modelled", us(own.objective_ns)),
        Objective::Cull => String::new(),
    };
    let mut out = vec![format!(
        "it culls a frame in {}, and submits {:.0} triangles of {} in {:.0} draw {}{modelled}",
        us(own.cull_ns),
        own.counts.entries,
        question.scene.len(),
        own.counts.draw_calls,
        if own.counts.draw_calls.round() == 1.0 { "call" } else { "calls" },
    )];
    let rivals =
        considered.iter().enumerate().filter(|(i, _)| *i != chosen).filter_map(|(_, c)| Some((c, c.timed.as_ref()?)));
    for (rival, t) in rivals {
        let ratio = t.objective_ns / own.objective_ns;
        let (scale, drawn) = question.parts(t.draw_ns - own.draw_ns);
        let culling = (scale * (t.cull_ns - own.cull_ns)).abs() > drawn.abs();
        // Of the turns, and of the places that were looked at.
        let spread = question.parts(probe::spread_ns(t, own)).1;
        let tie = t.low_ns <= own.high_ns + spread && own.low_ns <= t.high_ns + spread;
        let close = if tie { ", within the noise of the probe" } else { "" };
        let cause = match (question.objective, culling) {
            (Objective::Cull, _) => format!(" ({} against {})", us(t.cull_ns), us(own.cull_ns)),
            (_, true) => format!(", mostly for culling ({} against {})", us(t.cull_ns), us(own.cull_ns)),
            (_, false) => format!(", mostly for drawing ({} against {})", us(t.draw_ns), us(own.draw_ns)),
        };
        let modelled = if question.objective == Objective::Frame { " as modelled" } else { "" };
        out.push(format!("{} takes {ratio:.2} times as long{modelled}{close}{cause}", rival.label));
    }
    out
}
