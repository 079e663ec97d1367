//! Manifests: what a study is, in TOML, checked before anything runs. The
//! reference of every key is `docs/MANIFEST.md`.
//!
//! Reading goes text -> tree with places -> layers (`extends`, `--set`) ->
//! typed [`Manifest`]. It never stops at the first mistake.

pub mod axes;
mod claims;
mod entries;
mod families;
mod fields;
mod lab;
mod layers;
mod ranges;
pub mod reach;
mod rules;
mod scenes;
mod sections;
mod selections;
pub mod source;
pub mod sweeps;
mod tree;

use crate::claim::Claim;
use crate::error::Error;
use crate::math::Camera;
use crate::record::{Accuracy, PathSpec, RepeatPolicy, SceneSpec, TimeModel};
use crate::sweep::Sweep;
use axes::AxisValues;
use fields::Fields;
use reach::Reach;
pub use rules::{Exclude, Include, Rule, Zip};
use source::{Mistakes, Place, Sources};
use std::path::Path;

/// A checked manifest: every name known, every number in range, every file there.
#[derive(Debug, Clone)]
pub struct Manifest {
    pub study: Study,
    pub camera: Camera,
    pub repeat: RepeatPolicy,
    pub timing: Timing,
    pub accuracy: Accuracy,
    pub model: TimeModel,
    /// In the order of the file.
    pub scenes: Vec<SceneSpec>,
    /// Walkthroughs of scene `i`, fingerprinted over that scene.
    pub paths: Vec<Vec<PathSpec>>,
    /// Optional scenes that are not there: name and reason.
    pub absent: Vec<(String, String)>,
    /// Values of every axis of `[matrix]`, in the order of [`axes::AXES`]; before
    /// them the scenes, by number.
    pub axes: Vec<AxisValues>,
    pub scene_axis: Vec<usize>,
    pub zip: Vec<Zip>,
    pub include: Vec<Include>,
    pub exclude: Vec<Exclude>,
    pub claims: Vec<Rule<Claim>>,
    pub sweeps: Vec<Rule<sweeps::Drawn>>,
    /// The manifest after `extends` and `--set`, as TOML.
    pub source_text: String,
    /// Texts behind the places of the rules, for errors found later.
    pub sources: Sources,
    /// Where `[matrix]` is.
    pub matrix_place: Place,
}

#[derive(Debug, Clone, PartialEq)]
pub struct Study {
    /// Names the study in the database and its folder.
    pub name: String,
    pub title: String,
    pub description: String,
}

/// How a trial is timed, and how curves are drawn.
#[derive(Debug, Clone, PartialEq)]
pub struct Timing {
    pub passes: u32,
    pub warmup_passes: u32,
    /// Frames a point when curves are consolidated.
    pub consolidate_frames: u32,
}

impl Manifest {
    /// Reads `path`, lays `sets` (`key=value`) over it and checks everything
    /// that can be known before the matrix is expanded.
    ///
    /// # Errors
    /// Every mistake, in the order of the text, each with file, line, column,
    /// key and a suggestion.
    pub fn load(path: &Path, sets: &[String]) -> Result<Manifest, Vec<Error>> {
        Manifest::parse(layers::text(path).map_err(|e| vec![e])?, path, sets)
    }

    /// [`Manifest::load`] of a text at hand; what it names lies beside `path`.
    ///
    /// # Errors
    /// Those of [`Manifest::load`].
    pub fn parse(text: String, path: &Path, sets: &[String]) -> Result<Manifest, Vec<Error>> {
        Manifest::parse_within(text, path, sets, Reach::Anywhere)
    }

    /// [`Manifest::parse`] of a text that may name some files only.
    ///
    /// # Errors
    /// Those of [`Manifest::load`], and for files out of reach.
    pub fn parse_within(text: String, path: &Path, sets: &[String], reach: Reach) -> Result<Manifest, Vec<Error>> {
        let mut mistakes = Mistakes::new(Sources { reach, ..Sources::default() });
        let table = layers::read(&mut mistakes, text, path, sets);
        let Some(table) = table else { return Err(mistakes.into_errors().1) };
        let manifest = decode(&mistakes, &table, path);
        let plain = mistakes.sources.texts.len() == 1;
        let (sources, errors) = mistakes.into_errors();
        match manifest {
            Some(mut manifest) if errors.is_empty() => {
                manifest.source_text = if plain {
                    sources.texts[0].text.clone()
                } else {
                    let layers: Vec<String> = sources.texts.iter().map(|s| sources.reach.shown(&s.name)).collect();
                    format!("# Merged from {}.\n\n{}", layers.join(", ").replace('\n', " "), tree::to_toml(&table))
                };
                manifest.sources = sources;
                Ok(manifest)
            }
            _ if errors.is_empty() => unreachable!("a manifest that does not decode notes why"),
            _ => Err(errors),
        }
    }

    pub fn claims(&self) -> Vec<Claim> {
        self.claims.iter().map(|rule| rule.value.clone()).collect()
    }

    pub fn sweeps(&self) -> Vec<Sweep> {
        self.sweeps.iter().map(|rule| rule.value.sweep.clone()).collect()
    }
}

/// `None` when something is missing that the rest cannot do without; that is noted.
fn decode(mistakes: &Mistakes, table: &tree::Table, path: &Path) -> Option<Manifest> {
    let top = Place { source: 0, span: 0..0 };
    let mut fields = Fields::new(mistakes, "", &top, table);
    let study = sections::study(&mut fields, path);
    let camera = sections::camera(&mut fields);
    let (repeat, timing) = sections::measure(&mut fields);
    let accuracy = sections::accuracy(&mut fields);
    let model = sections::model(&mut fields);
    let scenes::Scenes { scenes, paths, names, absent } = scenes::read(&mut fields);
    // A section with mistakes stops the manifest; its default lets the rest be checked.
    let section = camera.unwrap_or_default();
    let matrix = rules::matrix(&mut fields, &names, &section);
    let include = rules::includes(&mut fields, &names, &section);
    let exclude = rules::excludes(&mut fields, &names);
    let claims = claims::read(&mut fields, &names);
    let sweeps = sweeps::read(&mut fields);
    fields.known("extends");
    fields.finish();
    let matrix = matrix?;
    // Which paths a scene has may be narrowed by the matrix.
    let paths = matrix.keep_paths(mistakes, paths, &scenes);
    Some(Manifest {
        study: study?,
        camera: camera?,
        repeat,
        timing,
        accuracy,
        model,
        scenes,
        paths,
        absent,
        axes: matrix.axes,
        scene_axis: matrix.scene_axis,
        zip: matrix.zip,
        include,
        exclude,
        claims,
        sweeps,
        source_text: String::new(),
        sources: Sources::default(),
        matrix_place: matrix.place,
    })
}
