//! From a manifest to its runs: product, zip, include, exclude. Pure: no I/O,
//! the same manifest and setting give the same runs in the same order.

mod cells;
mod labels;
pub mod plan;
mod sweeps;

use crate::claim::{Claim, Relation, selects};
use crate::culling::knows_arithmetic;
use crate::error::Error;
use crate::manifest::Manifest;
use crate::manifest::axes::AXES;
use crate::manifest::source::Mistakes;
use crate::math::{Arithmetic, arithmetic};
use crate::record::{Protocol, RunSpec, cameras};
use crate::registry::Spec;
use crate::results::Excluded;
use cells::{Block, Cell, Compiled, Pool};
pub use labels::{Labels, labels};
use std::collections::{BTreeMap, BTreeSet};

/// What the machine and the caller add to every run.
#[derive(Debug, Clone, PartialEq)]
pub struct Setting {
    /// Core to pin trials to.
    pub pin_core: Option<u32>,
    /// `release`, `dist` or `dev`.
    pub build_profile: String,
    pub isa: String,
    pub threads: u32,
    /// 0 unless measured again on purpose.
    pub series: u32,
}

impl Default for Setting {
    fn default() -> Self {
        let build_profile = if cfg!(debug_assertions) { "dev" } else { "release" };
        Setting { pin_core: None, build_profile: build_profile.into(), isa: "scalar".into(), threads: 1, series: 0 }
    }
}

#[derive(Debug, Clone)]
pub struct Matrix {
    /// In order: scene by scene, path by path, then the axes as written.
    pub runs: Vec<RunSpec>,
    /// By cell without its scene, with the number of runs saved.
    pub excluded: Vec<Excluded>,
    /// The excluded runs, each with its number in the manifest's excludes.
    pub excluded_runs: Vec<(RunSpec, usize)>,
    /// Cells and axis values that were written more than once and run once.
    pub duplicates: u64,
}

/// More cells than this are a slip of the pen, not a study.
pub const MAX_CELLS: u64 = 1_000_000;

/// How many cells the matrix of `manifest` has before anything is excluded: at once, where
/// [`expand`] makes them all.
pub fn count(manifest: &Manifest) -> u64 {
    let mut pool = Pool::default();
    let product = Block::product(manifest, &mut pool);
    let more = manifest.include.iter().map(|i| product.with(manifest, i, &mut pool).count(manifest));
    more.fold(product.count(manifest), u64::saturating_add)
}

/// All runs of `manifest`.
///
/// # Errors
/// Every impossible cell and every rule that selects nothing, each placed in the
/// manifest; an empty matrix and one beyond [`MAX_CELLS`].
pub fn expand(manifest: &Manifest, setting: &Setting) -> Result<Matrix, Vec<Error>> {
    let mistakes = Mistakes::new(manifest.sources.clone());
    let mut pool = Pool::default();
    let product = Block::product(manifest, &mut pool);
    let includes: Vec<Block> = manifest.include.iter().map(|i| product.with(manifest, i, &mut pool)).collect();
    let total: u64 = includes.iter().fold(product.count(manifest), |n, block| n.saturating_add(block.count(manifest)));
    if total > MAX_CELLS {
        let e = Error::new(format!("has {total} cells, more than {MAX_CELLS}"));
        mistakes.note(&manifest.matrix_place, "matrix", e.help("shorten lists and ranges, or zip axes"));
        return Err(mistakes.into_errors().1);
    }

    let mut duplicates: u64 = manifest.axes.iter().map(|a| a.repeated as u64).sum();
    let mut seen = std::collections::HashSet::new();
    let mut matched = vec![false; manifest.exclude.len()];
    let excludes: Vec<_> = manifest.exclude.iter().map(|r| Compiled::new(manifest, &r.value.selection)).collect();
    let mut kept: Vec<Cell> = Vec::new();
    let mut excluded: Vec<(Cell, usize)> = Vec::new();
    product.each(manifest, &mut pool, |pool, cell| {
        if !seen.insert(cell.clone()) {
            duplicates += 1;
            return;
        }
        let mut by = None;
        for (i, rule) in excludes.iter().enumerate() {
            if rule.selects(pool, &cell) {
                matched[i] = true;
                by = by.or(Some(i));
            }
        }
        match by {
            Some(rule) => excluded.push((cell, rule)),
            None => kept.push(cell),
        }
    });
    // Compared with what runs, so that an include may bring back single excluded cells.
    let mut running: std::collections::HashSet<Cell> = kept.iter().cloned().collect();
    for (rule, block) in manifest.include.iter().zip(&includes) {
        let mut added = 0;
        block.each(manifest, &mut pool, |_, cell| {
            if running.insert(cell.clone()) {
                added += 1;
                excluded.retain(|(c, _)| *c != cell);
                kept.push(cell);
            } else {
                duplicates += 1;
            }
        });
        if added == 0 {
            let e = Error::new("adds no cell: all of its cells are in the matrix already");
            mistakes.note(&rule.place, &rule.key, e.help("remove it, or correct the axes it fixes"));
        }
    }
    for (rule, matched) in manifest.exclude.iter().zip(&matched) {
        if !matched {
            let e = Error::new("selects no cell of the matrix");
            mistakes.note(&rule.place, &rule.key, e.help(pool.nearest(manifest, &rule.value.selection, &seen)));
        }
    }
    if kept.is_empty() && mistakes.is_empty() {
        mistakes.note(&manifest.matrix_place, "matrix", empty(manifest, excluded.len()));
    }
    cells::impossible(manifest, &pool, &kept, &mistakes);

    // Ties between an include and the product keep the order of the file.
    kept.sort_by_key(|c| (c.scene, c.path));
    let runs: Vec<RunSpec> = kept.iter().map(|c| build(manifest, setting, &pool, c)).collect();
    if mistakes.is_empty() {
        check_claims(manifest, &runs, &mistakes);
        sweeps::check(manifest, &runs, &mistakes);
    }
    let (_, errors) = mistakes.into_errors();
    if !errors.is_empty() {
        return Err(errors);
    }
    let excluded_runs: Vec<(RunSpec, usize)> =
        excluded.iter().map(|(c, rule)| (build(manifest, setting, &pool, c), *rule)).collect();
    let mut left_out = summary(manifest, &excluded_runs);
    // As many as one of the scenes that are there has, before anything is excluded.
    let count = product.count(manifest) / manifest.scenes.len().max(1) as u64;
    left_out.extend(manifest.absent.iter().map(|(cell, why)| Excluded { cell: cell.clone(), why: why.clone(), count }));
    Ok(Matrix { runs, excluded: left_out, excluded_runs, duplicates })
}

fn empty(manifest: &Manifest, excluded: usize) -> Error {
    if excluded > 0 {
        return Error::new("is empty: every cell is excluded").help("narrow one [[exclude]]");
    }
    let missing: Vec<&str> = manifest.axes.iter().filter(|a| a.values.is_empty()).map(|a| a.axis).collect();
    match missing.first() {
        Some(axis) => Error::new(format!("is empty: no {axis} is given")).help(format!(
            "add {axis} = [\"{}\"]",
            AXES.iter().find(|a| a.name == *axis).and_then(|a| (a.parts)().first().map(|p| p.name)).unwrap_or("...")
        )),
        None => Error::new("is empty").help("add a [[scene]] and a [[path]]"),
    }
}

fn build(manifest: &Manifest, setting: &Setting, pool: &Pool, cell: &Cell) -> RunSpec {
    let mut revisions = BTreeMap::new();
    let mut others = BTreeMap::new();
    let mut named: BTreeMap<&str, &Vec<Spec>> = BTreeMap::new();
    for (axis, id) in AXES.iter().zip(&cell.values) {
        let value = pool.value(*id);
        named.insert(axis.name, value);
        let known = matches!(axis.name, "structure" | "culling" | "walk");
        if !known && is_usual(manifest, axis.name, value) {
            continue;
        }
        if !known && let Some(spec) = value.first() {
            others.insert(axis.name.to_string(), spec.clone());
        }
        // A camera is part of the answer by its numbers.
        for (spec, revision) in value.iter().zip(pool.revisions(*id)).filter(|_| axis.name != cameras::AXIS) {
            revisions.insert(format!("{}.{}", axis.name, spec.kind), *revision);
        }
    }
    for arithmetic in named["culling"].iter().filter_map(stated_arithmetic) {
        revisions.insert(format!("{}.{arithmetic}", arithmetic::NAME), arithmetic.revision());
    }
    // The usual arithmetic is not named either; its first revision is in no id.
    let usual = Arithmetic::default();
    let takes_usual = |part: &&Spec| knows_arithmetic(part) && stated_arithmetic(part).is_none();
    if usual.revision() > 1
        && !others.contains_key(arithmetic::NAME)
        && named["culling"].iter().any(|p| takes_usual(&p))
    {
        revisions.insert(format!("{}.{usual}", arithmetic::NAME), usual.revision());
    }
    let camera = match others.get(cameras::AXIS) {
        Some(spec) => cameras::camera_of(spec).expect("the manifest checked its cameras"),
        None => manifest.camera,
    };
    let one = |name: &str| named[name].first().cloned().expect("a plain axis has one part");
    RunSpec {
        scene: manifest.scenes[cell.scene].clone(),
        path: manifest.paths[cell.scene][cell.path].clone(),
        camera,
        structure: one("structure"),
        culling: named["culling"].clone(),
        walk: one("walk"),
        axes: others,
        revisions,
        accuracy: manifest.accuracy.clone(),
        protocol: Protocol {
            passes: manifest.timing.passes,
            warmup_passes: manifest.timing.warmup_passes,
            pin_core: setting.pin_core,
            build_profile: setting.build_profile.clone(),
            isa: setting.isa.clone(),
            threads: setting.threads,
        },
        series: setting.series,
        model: manifest.model,
    }
}

/// Whether an axis has its usual value, which is not stored: runs keep the ids that
/// they had before the axis came.
fn is_usual(manifest: &Manifest, axis: &str, value: &[Spec]) -> bool {
    match (axis, value) {
        (arithmetic::NAME, [spec]) => spec.kind == Arithmetic::default().name(),
        (cameras::AXIS, [spec]) => *spec == cameras::spec_of(&manifest.camera),
        _ => false,
    }
}

/// The arithmetic that a part states itself.
fn stated_arithmetic(part: &Spec) -> Option<Arithmetic> {
    part.params.get(arithmetic::NAME).and_then(|value| Arithmetic::named(&value.to_string()))
}

/// Excluded cells without their scene, in order, with how many runs each saves.
fn summary(manifest: &Manifest, runs: &[(RunSpec, usize)]) -> Vec<Excluded> {
    let mut out: Vec<(usize, Excluded)> = Vec::new();
    for (run, rule) in runs {
        let cell = labels(run).cell();
        match out.iter_mut().find(|(r, e)| r == rule && e.cell == cell) {
            Some((_, e)) => e.count += 1,
            None => {
                let why = manifest.exclude[*rule].value.why.clone();
                out.push((*rule, Excluded { cell, why, count: 1 }));
            }
        }
    }
    out.into_iter().map(|(_, e)| e).collect()
}

/// Both selections of a claim must meet in at least one group.
fn check_claims(manifest: &Manifest, runs: &[RunSpec], mistakes: &Mistakes) {
    for rule in &manifest.claims {
        let claim = &rule.value;
        let pick = |s| runs.iter().filter(|r| selects(s, r)).collect::<Vec<_>>();
        let (over, under) = (pick(&claim.numerator), pick(&claim.denominator));
        let mut empty = false;
        for (name, side) in [("numerator", &over), ("denominator", &under)] {
            if side.is_empty() && !(claim.relation.is_own() && name == "denominator") {
                empty = true;
                let e = Error::new("selects no run of the matrix");
                let key = format!("{}.{name}", rule.key);
                mistakes.note(&rule.place, &key, e.help("correct the selection, or add the runs to [matrix]"));
            }
        }
        if empty {
            continue;
        }
        if claim.relation == Relation::Best
            && let Some((key, e)) = best_of_nothing(claim, &under)
        {
            mistakes.note(&rule.place, &format!("{}{key}", rule.key), e);
            continue;
        }
        let Some(axis) = claim.for_each.as_deref() else { continue };
        let group = |r: &RunSpec| labels(r).of(axis);
        let groups: Vec<String> = over.iter().map(|r| group(r)).collect();
        if !claim.relation.is_own() && !under.iter().any(|r| groups.contains(&group(r))) {
            let e = Error::new(format!("compares nothing: no {axis} has runs of both selections"));
            mistakes.note(&rule.place, &rule.key, e.help(format!("correct for_each = \"{axis}\" or the selections")));
        }
        for name in claim.published_for.keys().filter(|n| !groups.contains(n)) {
            let e = Error::new(format!("no {axis} of the claim is `{name}`"));
            let key = format!("{}.published.{name}", rule.key);
            mistakes.note(&rule.place, &key, e.help(format!("{axis}s of the claim: {}", distinct(&groups).join(", "))));
        }
    }
}

/// Who is to be the best of many must be one of them, not all, and all of one scene and path.
fn best_of_nothing(claim: &Claim, among: &[&RunSpec]) -> Option<(&'static str, Error)> {
    let named = among.iter().filter(|r| selects(&claim.numerator, r)).count();
    if named == 0 {
        let e = Error::new("selects no run that the denominator selects");
        return Some((
            ".numerator",
            e.help("the denominator selects all that compete, the numerator who of them is best"),
        ));
    }
    if named == among.len() {
        let e = Error::new("selects no run beside those of the numerator");
        return Some((".denominator", e.help("widen it to all that compete, such as { structure = \"octree\" }")));
    }
    let group = |r: &RunSpec| claim.for_each.as_deref().map(|axis| labels(r).of(axis));
    let places: BTreeSet<_> = among.iter().map(|r| (group(r), &r.scene.name, &r.path.name)).collect();
    let groups: BTreeSet<_> = among.iter().map(|r| group(r)).collect();
    // For each scene stands for each of its paths.
    let several = places.len() > groups.len() && claim.for_each.as_deref() != Some("scene");
    several.then(|| {
        let e = Error::new("\"best\" compares runs of one scene and path, and a group holds several");
        (".relation", e.help("add for_each = \"scene\", or name the scene and path in both selections"))
    })
}

fn distinct(names: &[String]) -> Vec<&str> {
    let mut out: Vec<&str> = Vec::new();
    for name in names {
        if !out.contains(&name.as_str()) {
            out.push(name);
        }
    }
    out
}
