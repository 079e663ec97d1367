//! `[matrix]`, `[[include]]` and `[[exclude]]`: values of the axes and rules
//! about cells. Selections are checked here as far as names go; whether they
//! select anything is known once the matrix is expanded.

use super::axes::{AXES, Axis, AxisValues, axis, axis_names, default_values, unknown_axis};
use super::entries::read_values;
use super::fields::Fields;
use super::scenes::{Names, unknown_name};
use super::selections;
use super::source::{Mistakes, Place};
use super::tree::Node;
use crate::claim::{Selection, Selector};
use crate::error::{Error, did_you_mean};
use crate::math::Camera;
use crate::record::{PathSpec, SceneSpec};
use crate::registry::Spec;

/// A rule and where it stands, for errors that expansion finds.
#[derive(Debug, Clone)]
pub struct Rule<T> {
    pub value: T,
    /// `exclude.0`.
    pub key: String,
    pub place: Place,
}

/// Axes that advance together, as numbers: 0 is `scene`, `i + 1` is `AXES[i]`.
#[derive(Debug, Clone)]
pub struct Zip {
    pub axes: Vec<usize>,
    pub place: Place,
}

/// Cells beside the product: what it fixes, and the matrix' values for the rest.
pub type Include = Rule<Partial>;

#[derive(Debug, Clone)]
pub struct Partial {
    pub scenes: Option<Vec<usize>>,
    pub paths: Option<Vec<String>>,
    /// By position in [`AXES`].
    pub axes: Vec<Option<AxisValues>>,
}

/// Cells of the product that are not run, and why.
pub type Exclude = Rule<Reasoned>;

#[derive(Debug, Clone)]
pub struct Reasoned {
    pub selection: Selection,
    pub why: String,
}

pub struct Matrix {
    pub axes: Vec<AxisValues>,
    pub scene_axis: Vec<usize>,
    pub zip: Vec<Zip>,
    pub place: Place,
    paths: Option<(Vec<String>, Place)>,
}

impl Matrix {
    /// The paths that the `path` axis keeps. A scene left without one is a mistake.
    pub fn keep_paths(&self, m: &Mistakes, mut paths: Vec<Vec<PathSpec>>, scenes: &[SceneSpec]) -> Vec<Vec<PathSpec>> {
        let Some((keep, place)) = &self.paths else { return paths };
        for (i, (scene, list)) in scenes.iter().zip(&mut paths).enumerate() {
            list.retain(|p| keep.contains(&p.name));
            if list.is_empty() && m.is_empty() && self.scene_axis.contains(&i) {
                let e = Error::new(format!("leaves the scene `{}` without a path", scene.name));
                m.note(place, "matrix.path", e.help("name a path that applies to it, or leave the scene out"));
            }
        }
        paths
    }
}

pub fn matrix(top: &mut Fields, names: &Names, section: &Camera) -> Option<Matrix> {
    let Some(mut f) = top.table("matrix") else {
        if !top.has("matrix") {
            top.missing("matrix", "add [matrix] with structure = [\"list\", \"octree\"] and culling = [\"frustum\"]");
        }
        return None;
    };
    let scene_axis = match f.one_or_more("scene") {
        None => (0..names.here).collect(),
        Some(nodes) => scenes_named(&f, nodes, names),
    };
    let paths = f.one_or_more("path").map(|nodes| {
        let place = nodes.first().map_or(f.place.clone(), |n| n.place.clone());
        let kept = named(&f, "path", nodes, &names.paths);
        (kept.into_iter().map(|i| names.paths[i].clone()).collect(), place)
    });
    for name in ["scene", "path"] {
        let empty = f.get(name).filter(|n| n.array().is_some_and(<[Node]>::is_empty));
        if let Some(node) = empty {
            f.note(&node.place, name, empty_axis(name));
        }
    }
    let mut axes = Vec::new();
    for axis in AXES {
        axes.push(axis_values(&mut f, axis, section).unwrap_or_else(|| default_values(axis, section)));
    }
    let zip = zips(&mut f, &axes, scene_axis.len());
    let place = f.place.clone();
    f.finish();
    Some(Matrix { axes, scene_axis, zip, place, paths })
}

fn empty_axis(name: &str) -> Error {
    Error::new("is an empty list, so nothing would run").help(format!("give at least one {name}, or remove the key"))
}

fn axis_values(f: &mut Fields, axis: &'static Axis, section: &Camera) -> Option<AxisValues> {
    let nodes = f.one_or_more(axis.name)?;
    let key = f.key(axis.name);
    if nodes.is_empty() {
        let place = f.get(axis.name).map_or(f.place.clone(), |n| n.place.clone());
        f.note(&place, axis.name, empty_axis(axis.name));
    }
    Some(read_values(f.mistakes, &key, axis, nodes, section))
}

/// Numbers of the scenes or paths that `nodes` name, `*` allowed; each once.
/// Optional scenes that are not here are no mistake.
fn scenes_named(f: &Fields, nodes: &[Node], names: &Names) -> Vec<usize> {
    let mut found = named(f, "scene", nodes, &names.scenes);
    found.retain(|i| *i < names.here);
    found
}

fn named(f: &Fields, what: &'static str, nodes: &[Node], known: &[String]) -> Vec<usize> {
    let mut out = Vec::new();
    for node in nodes {
        let Some(text) = node.text() else {
            let e = Error::new(format!("must be the name of a {what}, not {}", node.noun()));
            f.note(&node.place, what, e.help(format!("{what}s: {}", known.join(", "))));
            continue;
        };
        let selector = Selector::parse(text).ok();
        let fits = |name: &String| selector.as_ref().is_some_and(|s| s.matches(&[Spec::new(name)]));
        let found: Vec<usize> = (0..known.len()).filter(|i| fits(&known[*i])).collect();
        if found.is_empty() {
            f.note(&node.place, what, unknown_name(what, text, known));
        }
        for i in found {
            if !out.contains(&i) {
                out.push(i);
            }
        }
    }
    out
}

fn zips(f: &mut Fields, axes: &[AxisValues], scenes: usize) -> Vec<Zip> {
    let help = "write zip = [[\"structure\", \"culling\"]]";
    let mut out: Vec<Zip> = Vec::new();
    let Some(node) = f.get("zip") else { return out };
    let Some(groups) = node.array() else {
        f.note(&node.place, "zip", Error::new(format!("must be a list of lists, not {}", node.noun())).help(help));
        return out;
    };
    for group in groups {
        let Some(members) = group.array().filter(|a| a.len() >= 2) else {
            f.note(&group.place, "zip", Error::new("pairs at least two axes").help(help));
            continue;
        };
        let mut zip = Zip { axes: Vec::new(), place: group.place.clone() };
        for member in members {
            let name = member.text().unwrap_or_default();
            let number =
                if name == "scene" { Some(0) } else { AXES.iter().position(|a| a.name == name).map(|i| i + 1) };
            let Some(number) = number else {
                let e = if name == "path" {
                    Error::new("paths belong to their scene and cannot be zipped").help("zip `scene` instead")
                } else {
                    unknown_axis(name)
                };
                f.note(&member.place, "zip", e);
                continue;
            };
            if zip.axes.contains(&number) || out.iter().any(|z| z.axes.contains(&number)) {
                let e = Error::new(format!("`{name}` is zipped twice"));
                f.note(&member.place, "zip", e.help("put every axis into one group at most"));
                continue;
            }
            zip.axes.push(number);
        }
        let length = |n: usize| if n == 0 { scenes } else { axes[n - 1].values.len() };
        let lengths: Vec<usize> = zip.axes.iter().map(|n| length(*n)).collect();
        // Values that did not parse are told already and would make any count wrong.
        if f.mistakes.is_empty() && lengths.iter().any(|l| *l != lengths[0]) {
            let name = |n: usize| if n == 0 { "scene" } else { AXES[n - 1].name };
            let said: Vec<String> =
                zip.axes.iter().zip(&lengths).map(|(n, l)| format!("{} has {l}", name(*n))).collect();
            let e = Error::new(format!("zipped axes must be equally long: {}", said.join(", ")));
            f.note(
                &group.place,
                "zip",
                e.help("make the lists equally long (lists and ranges inside entries count expanded)"),
            );
        }
        out.push(zip);
    }
    out
}

pub fn includes(top: &mut Fields, names: &Names, section: &Camera) -> Vec<Include> {
    let mut out = Vec::new();
    for mut f in top.tables("include") {
        let scenes = f.one_or_more("scene").map(|nodes| scenes_named(&f, nodes, names));
        let paths = f
            .one_or_more("path")
            .map(|nodes| named(&f, "path", nodes, &names.paths).into_iter().map(|i| names.paths[i].clone()).collect());
        let axes: Vec<Option<AxisValues>> = AXES.iter().map(|axis| axis_values(&mut f, axis, section)).collect();
        let (key, place) = (f.path.clone(), f.place.clone());
        if f.entries().is_empty() {
            let e = Error::new("fixes no axis, so it adds nothing");
            f.note(&place, "", e.help("give the cells to add, such as structure = \"octree:depth=6\""));
        }
        unknown_axes(f);
        out.push(Rule { value: Partial { scenes, paths, axes }, key, place });
    }
    out
}

pub fn excludes(top: &mut Fields, names: &Names) -> Vec<Exclude> {
    let mut out = Vec::new();
    for mut f in top.tables("exclude") {
        let why = f.sentence("why", "say why, such as why = \"needs 40 GiB\": the report prints it");
        let mut selection = Selection::new();
        for (name, node) in f.entries().iter().filter(|(k, _)| k.name != "why") {
            selections::read_axis(f.mistakes, &f.path, name, node, names, &mut selection);
        }
        let (key, place) = (f.path.clone(), f.place.clone());
        if f.entries().iter().all(|(k, _)| k.name == "why") {
            let e = Error::new("names no axis, so it would exclude everything");
            f.note(&place, "", e.help("say which cells, such as structure = \"bsp\" and culling = \"none\""));
        }
        if let Some(why) = why {
            out.push(Rule { value: Reasoned { selection, why }, key, place });
        }
    }
    out
}

/// Keys of an include are axes, and a slip is told as such.
fn unknown_axes(f: Fields) {
    for (key, _) in f.entries() {
        if key.name != "scene" && key.name != "path" && axis(&key.name).is_none() {
            let near = did_you_mean(&key.name, axis_names());
            let mut e = unknown_axis(&key.name);
            e.help = near.map(|n| format!("did you mean `{n}`?")).or(e.help);
            f.note(&key.place, &key.name, e);
        }
    }
}
