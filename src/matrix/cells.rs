//! Cells before they are runs: small numbers in place of specs, so that ten
//! thousand of them compare and hash quickly.

use crate::claim::{Selection, Selector};
use crate::culling::mailbox;
use crate::error::Error;
use crate::manifest::axes::{AXES, AxisValue};
use crate::manifest::source::Mistakes;
use crate::manifest::{Include, Manifest};
use crate::registry::{Spec, Value};
use std::collections::{BTreeMap, HashMap, HashSet};

/// One cell: scene and path by number, axis values by number in the [`Pool`].
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Cell {
    pub scene: usize,
    pub path: usize,
    /// By position in [`AXES`].
    pub values: Vec<u32>,
}

/// Every axis value met, each once.
#[derive(Default)]
pub struct Pool {
    values: Vec<(usize, AxisValue, Vec<u32>)>,
    numbers: HashMap<(usize, String), u32>,
    autos: HashMap<(u32, u32), u32>,
    /// What an axis (by position) is beside a culling, where that leaves no choice.
    settled: HashMap<(u32, usize), Option<u32>>,
}

/// Position of the axis `culling`.
const CULLING: usize = 1;

impl Pool {
    fn number(&mut self, axis: usize, value: &AxisValue) -> u32 {
        let text = crate::registry::format_sum(value);
        if let Some(n) = self.numbers.get(&(axis, text.clone())) {
            return *n;
        }
        let parts = (AXES[axis].parts)();
        let revision = |s: &Spec| parts.iter().find(|p| p.name == s.kind).map_or(0, |p| p.revision);
        let n = self.values.len() as u32;
        self.values.push((axis, value.clone(), value.iter().map(revision).collect()));
        self.numbers.insert((axis, text), n);
        n
    }

    pub fn value(&self, number: u32) -> &AxisValue {
        &self.values[number as usize].1
    }

    pub fn revisions(&self, number: u32) -> &[u32] {
        &self.values[number as usize].2
    }

    /// `auto` made concrete beside the cell's structure; an axis that the cell's
    /// culling does not take gets its usual value.
    fn settle(&mut self, cell: &mut Cell) {
        for (i, axis) in AXES.iter().enumerate() {
            let Some(auto) = axis.auto else { continue };
            let given = cell.values[i];
            if self.value(given).first().is_none_or(|s| s.kind != "auto") {
                continue;
            }
            let structure = cell.values[0];
            cell.values[i] = match self.autos.get(&(structure, given)) {
                Some(n) => *n,
                None => {
                    let value = vec![auto(&self.value(structure)[0])];
                    let n = self.number(i, &value);
                    self.autos.insert((structure, given), n);
                    n
                }
            };
        }
        let culling = cell.values[CULLING];
        for (i, axis) in AXES.iter().enumerate() {
            let Some(settled) = axis.settled else { continue };
            let known = self.settled.get(&(culling, i)).copied();
            let only = known.unwrap_or_else(|| {
                let only = settled(self.value(culling)).map(|spec| self.number(i, &vec![spec]));
                self.settled.insert((culling, i), only);
                only
            });
            cell.values[i] = only.unwrap_or(cell.values[i]);
        }
    }

    /// What the axis holds where a selection leaves the matrix: a help sentence.
    pub fn nearest(&self, manifest: &Manifest, selection: &Selection, cells: &HashSet<Cell>) -> String {
        let compiled = Compiled::new(manifest, selection);
        let specs = |cell: &Cell, axis: &str| compiled.value(self, cell, axis);
        for (axis, selectors) in &compiled.selectors {
            if cells.iter().any(|c| selectors.iter().any(|s| s.matches(&specs(c, axis)))) {
                continue;
            }
            let mut held: Vec<String> = cells.iter().map(|c| super::labels::label(axis, &specs(c, axis))).collect();
            held.sort();
            held.dedup();
            let more = if held.len() > 8 { format!(" and {} more", held.len() - 8) } else { String::new() };
            held.truncate(8);
            return format!("`{axis}` holds {}{more}", held.join(", "));
        }
        "each axis alone matches, but no cell has all of them: correct one, or remove the rule".to_string()
    }
}

fn parse(selection: &Selection) -> BTreeMap<&str, Vec<Selector>> {
    let parsed = |texts: &[String]| texts.iter().filter_map(|t| Selector::parse(t).ok()).collect();
    selection.iter().map(|(axis, texts)| (axis.as_str(), parsed(texts))).collect()
}

/// A selection ready for many cells.
pub struct Compiled<'a> {
    manifest: &'a Manifest,
    selectors: BTreeMap<&'a str, Vec<Selector>>,
}

impl<'a> Compiled<'a> {
    pub fn new(manifest: &'a Manifest, selection: &'a Selection) -> Self {
        Compiled { manifest, selectors: parse(selection) }
    }

    pub fn selects(&self, pool: &Pool, cell: &Cell) -> bool {
        self.selectors.iter().all(|(axis, s)| {
            let value = self.value(pool, cell, axis);
            s.iter().any(|s| s.matches(&value))
        })
    }

    fn value(&self, pool: &Pool, cell: &Cell, axis: &str) -> AxisValue {
        match axis {
            "scene" => vec![Spec::new(&self.manifest.scenes[cell.scene].name)],
            "path" => vec![Spec::new(&self.manifest.paths[cell.scene][cell.path].name)],
            _ => {
                AXES.iter().position(|a| a.name == axis).map(|i| pool.value(cell.values[i]).clone()).unwrap_or_default()
            }
        }
    }
}

/// A product of axes, some of which advance together.
pub struct Block {
    scenes: Vec<usize>,
    paths: Option<Vec<String>>,
    /// By position in [`AXES`], as numbers in the pool.
    values: Vec<Vec<u32>>,
    /// Axes that share a dimension: 0 is `scene`, `i + 1` is `AXES[i]`.
    dimensions: Vec<Vec<usize>>,
}

impl Block {
    pub fn product(manifest: &Manifest, pool: &mut Pool) -> Block {
        let number = |(i, axis): (usize, &crate::manifest::axes::AxisValues)| {
            axis.values.iter().map(|v| pool.number(i, v)).collect::<Vec<u32>>()
        };
        let values = manifest.axes.iter().enumerate().map(number).collect();
        let mut dimensions: Vec<Vec<usize>> = Vec::new();
        for axis in 0..=AXES.len() {
            match manifest.zip.iter().find(|z| z.axes.contains(&axis)) {
                // A zipped dimension stands where its first axis would.
                Some(zip) if zip.axes.iter().min() == Some(&axis) => dimensions.push(zip.axes.clone()),
                Some(_) => {}
                None => dimensions.push(vec![axis]),
            }
        }
        Block { scenes: manifest.scene_axis.clone(), paths: None, values, dimensions }
    }

    /// The cells of `include`: what it fixes in place of the matrix' values.
    pub fn with(&self, manifest: &Manifest, include: &Include, pool: &mut Pool) -> Block {
        let fixed = &include.value;
        let mut touched = vec![fixed.scenes.is_some()];
        let mut values = Vec::new();
        for (i, own) in fixed.axes.iter().enumerate() {
            touched.push(own.is_some());
            values.push(match own {
                Some(own) => own.values.iter().map(|v| pool.number(i, v)).collect(),
                None if manifest.axes[i].values.is_empty() => {
                    AXES[i].default.iter().map(|text| pool.number(i, &vec![Spec::new(text)])).collect()
                }
                None => self.values[i].clone(),
            });
        }
        // A zip that the include breaks open becomes a product.
        let mut dimensions = Vec::new();
        for group in &self.dimensions {
            if group.len() > 1 && group.iter().any(|a| touched[*a]) {
                dimensions.extend(group.iter().map(|a| vec![*a]));
            } else {
                dimensions.push(group.clone());
            }
        }
        let scenes = fixed.scenes.clone().unwrap_or_else(|| self.scenes.clone());
        Block { scenes, paths: fixed.paths.clone(), values, dimensions }
    }

    fn length(&self, dimension: &[usize]) -> usize {
        let length = |axis: &usize| if *axis == 0 { self.scenes.len() } else { self.values[*axis - 1].len() };
        dimension.iter().map(length).min().unwrap_or(0)
    }

    /// Cells with every path counted, before duplicates go.
    pub fn count(&self, manifest: &Manifest) -> u64 {
        let paths = manifest.paths.iter().map(Vec::len).max().unwrap_or(0) as u64;
        self.dimensions.iter().fold(paths, |n, d| n.saturating_mul(self.length(d) as u64))
    }

    /// Every cell, the first dimension slowest, paths just inside the scene.
    pub fn each(&self, manifest: &Manifest, pool: &mut Pool, mut visit: impl FnMut(&Pool, Cell)) {
        let lengths: Vec<usize> = self.dimensions.iter().map(|d| self.length(d)).collect();
        if lengths.contains(&0) {
            return;
        }
        let mut at = vec![0usize; lengths.len()];
        loop {
            let mut scene = 0;
            let mut values = vec![0u32; AXES.len()];
            for (dimension, i) in self.dimensions.iter().zip(&at) {
                for axis in dimension {
                    match axis {
                        0 => scene = self.scenes[*i],
                        _ => values[axis - 1] = self.values[axis - 1][*i],
                    }
                }
            }
            let wanted = |name: &str| self.paths.as_ref().is_none_or(|p| p.iter().any(|n| n == name));
            for (path, spec) in manifest.paths[scene].iter().enumerate() {
                if wanted(&spec.name) {
                    let mut cell = Cell { scene, path, values: values.clone() };
                    pool.settle(&mut cell);
                    visit(pool, cell);
                }
            }
            let Some(next) = (0..at.len()).rev().find(|d| at[*d] + 1 < lengths[*d]) else { return };
            at[next] += 1;
            at[next + 1..].fill(0);
        }
    }
}

/// A combination that cannot be what it says, known before anything is built.
struct Impossible {
    /// Of structure, culling and walk: an exclude that would leave such cells out, if this is one.
    strikes: fn(&Spec, &[Spec], &Spec) -> Option<String>,
    why: &'static str,
    help: &'static str,
}

static IMPOSSIBLE: &[Impossible] = &[
    Impossible {
        strikes: |structure, culling, _| {
            let by_plane = |s: &&Spec| matches!(s.params.get("node_test"), Some(Value::Text(t)) if t != "box");
            let part = culling.iter().find(by_plane).filter(|_| structure.kind != "bsp")?;
            Some(format!("structure = \"{}\", culling = \"{}:node_test!=box+*\"", structure.kind, part.kind))
        },
        why: "only `bsp` has partition planes for `node_test` to judge by",
        help: "keep node_test = \"box\" for other structures",
    },
    Impossible {
        strikes: |structure, culling, _| {
            let strikes = culling.iter().any(|t| t.kind == mailbox::NAME) && !mailbox::has_copies(structure);
            strikes.then(|| format!("structure = \"{}\", culling = \"{}+*\"", structure.kind, mailbox::NAME))
        },
        why: "it holds each triangle once, so that `mailbox` has no copies to leave out",
        help: "give `mailbox` to `portal_octree` and to policy \"R\" alone, in an [[include]]",
    },
    Impossible {
        strikes: |structure, _, walk| {
            let strikes = walk.kind == "portals" && structure.kind != "portal_octree";
            strikes.then(|| format!("structure = \"{}\", walk = \"portals\"", structure.kind))
        },
        why: "only `portal_octree` has portals to look through",
        help: "give the walk to it alone, in an [[include]], or leave it to `walk = \"auto\"`",
    },
];

/// Notes every kind of impossible cell once, with an exclude that would silence it.
pub fn impossible(manifest: &Manifest, pool: &Pool, cells: &[Cell], mistakes: &Mistakes) {
    let position = |name: &str| AXES.iter().position(|a| a.name == name).expect("a known axis");
    let (s, c, w) = (position("structure"), position("culling"), position("walk"));
    for rule in IMPOSSIBLE {
        let value = |cell: &Cell, i: usize| pool.value(cell.values[i]).clone();
        let strike = |cell: &Cell| (rule.strikes)(&value(cell, s)[0], &value(cell, c), &value(cell, w)[0]);
        let struck: Vec<(&Cell, String)> = cells.iter().filter_map(|cell| Some((cell, strike(cell)?))).collect();
        let Some((first, exclude)) = struck.first() else { continue };
        let label = |axis: &str, i: usize| super::labels::label(axis, &value(first, i));
        let cell = format!("{} × {} × {}", label("structure", s), label("culling", c), label("walk", w));
        let many =
            if struck.len() == 1 { "an impossible cell".into() } else { format!("{} impossible cells", struck.len()) };
        let e = Error::new(format!("has {many}, such as {cell}: {}", rule.why));
        mistakes.note(
            &manifest.matrix_place,
            "matrix",
            e.help(format!("{}; or add [[exclude]] with {exclude} and why = \"...\"", rule.help)),
        );
    }
}
