//! Precomputed visibility of real maps as a second judge, which shares nothing with the
//! oracle: the map's compiler found by its own BSP and portals what cannot be seen from
//! anywhere in a cell, so that nothing of it may be seen from one place there.
//!
//! A few frames of every path; `CULLMARK_THOROUGH=1` takes more.

mod map;

use cullmark::culling::{self, DrawList, Tally, Test, WALKS, Walk, make_tests, make_walk};
use cullmark::hierarchy::Hierarchy;
use cullmark::math::{Camera, View};
use cullmark::oracle::footprint::Lens;
use cullmark::oracle::image::{ANY, BACKGROUND, Grid};
use cullmark::oracle::volume::Meets;
use cullmark::oracle::{BitSet, Effort, FrameTruth, judged_frames};
use cullmark::record::Accuracy;
use cullmark::registry::{Entry, Spec, parse_sum};
use cullmark::structure;
use map::{Map, UNIT_M};

/// Frames before a judged one, so that walks that remember have something to remember.
const BEFORE: u32 = 3;
const STRUCTURES: [&str; 3] = ["bvh", "octree", "portal_octree"];

fn accuracy() -> Accuracy {
    let thorough = std::env::var_os("CULLMARK_THOROUGH").is_some_and(|v| v != "0");
    let (frames, witness_rays) = if thorough { (40, 8) } else { (3, 2) };
    Accuracy { frames, width_px: 960, height_px: 540, samples: 1, witness_rays, hiding_cells: 0 }
}

/// One way to cull, and how much of what the map excludes it still submits.
struct Method {
    name: String,
    hierarchy: usize,
    tests: Vec<Box<dyn Test>>,
    walk: Box<dyn Walk>,
    list: DrawList,
    submitted: u64,
    /// Of them, what the map excludes though it meets the view volume.
    excluded: u64,
}

impl Method {
    /// `walk` over the first of `built` that it does not refuse.
    fn new(map: &Map, built: &[Hierarchy], walk: &str) -> Method {
        let mut tests = make_tests(&parse_sum("frustum").unwrap()).unwrap().0;
        let mut made = make_walk(&Spec::new(walk)).unwrap().0;
        let hierarchy = built.iter().position(|h| made.refuses(h).is_none()).expect("a structure for every walk");
        tests.iter_mut().for_each(|t| _ = t.prepare(&map.scene, &built[hierarchy]));
        made.prepare(&map.scene, &built[hierarchy]);
        let list = DrawList::default();
        Method { name: walk.into(), hierarchy, tests, walk: made, list, submitted: 0, excluded: 0 }
    }

    fn cull(&mut self, built: &[Hierarchy], view: &View) {
        let h = &built[self.hierarchy];
        culling::cull(view, h, &mut self.tests, self.walk.as_mut(), &mut self.list, &mut Tally::default());
    }

    fn count(&mut self, built: &[Hierarchy], excluded: &BitSet) {
        let mut drawn = BitSet::new(excluded.len());
        self.list.positions().for_each(|p| drawn.insert(built[self.hierarchy].entries[p as usize]));
        self.submitted += drawn.count();
        self.excluded += drawn.iter().filter(|t| excluded.contains(*t)).count() as u64;
    }
}

/// What became of one map.
#[derive(Debug, Default)]
struct Findings {
    frames: u64,
    /// Frames whose eye is in solid or outside.
    skipped: u64,
    seen: u64,
    by_ray: u64,
    /// Excluded by the map, but seen: triangles and samples.
    violations: u64,
    samples: u64,
    /// The same, read with the bits of every byte mirrored.
    mirrored: u64,
    /// In the view volume and excluded by the map.
    excluded: u64,
    in_volume: u64,
}

/// Members of `excluded` that `truth` sees closer than `reach_m`, and at how many samples.
fn seen_though(map: &Map, view: &View, truth: &FrameTruth, excluded: &BitSet, reach_m: f64) -> (Vec<u32>, u64) {
    let mut seen = BitSet::new(map.scene.len());
    let (lens, mut samples) = (Lens::new(view, truth.grid), 0);
    for (index, tile) in (0u32..).zip(&truth.tiles) {
        tile.for_each(truth.grid.tile(index), |run| {
            let Some(t) = run.winner.checked_sub(1).filter(|t| excluded.contains(*t)) else { return };
            // Where surfaces lie in one plane, another may be what is seen.
            if run.alternate == ANY || run.alternate != BACKGROUND && !excluded.contains(run.alternate - 1) {
                return;
            }
            let [a, b, c] = map.scene.corners(t).map(|p| view.to_camera(p));
            let normal = (b - a).cross(c - a);
            for x in run.x..run.x + run.len {
                let (origin, direction) = lens.ray(x, run.y);
                let along = normal.dot(a - origin) / normal.dot(direction);
                if (direction * along).length() < reach_m {
                    samples += 1;
                    seen.insert(t);
                }
            }
        });
    }
    let near = |t: u32| map.scene.corners(t).iter().all(|p| p.distance(view.eye) < reach_m);
    let witnessed =
        truth.bracket.witnesses.iter().filter(|w| {
            excluded.contains(w.triangle) && w.tied.iter().all(|t| excluded.contains(*t)) && near(w.triangle)
        });
    witnessed.for_each(|w| seen.insert(w.triangle));
    (seen.iter().collect(), samples)
}

/// Judges the oracle and every walk by the map's own word, at `frames` of every path and
/// of views around the players' starts (as path 0). `reach`: units to which it holds.
fn second_judge(
    name: &str,
    lids: bool,
    reach: f64,
    frames: u32,
    walks: &[Entry<dyn Walk>],
) -> Option<(Findings, Vec<Method>)> {
    let map = Map::read(name, lids)?;
    let made = STRUCTURES.map(|s| structure::make(&Spec::new(s)).unwrap().0);
    let built: Vec<Hierarchy> = made.iter().map(|s| s.build(&map.scene).unwrap()).collect();
    let mut methods: Vec<Method> = walks.iter().map(|w| Method::new(&map, &built, w.name)).collect();
    let (accuracy, camera) = (Accuracy { frames, ..accuracy() }, Camera::default());
    let effort = Effort::new(&map.scene, &accuracy);
    let mut found = Findings::default();
    for number in 0..=3 {
        let poses = if number == 0 { map.starts() } else { map.path(number) };
        for frame in judged_frames(poses.len() as u32, &accuracy) {
            let Some(cluster) = map.cluster(poses[frame as usize].eye / UNIT_M) else {
                found.skipped += 1;
                continue;
            };
            let views = (frame.saturating_sub(BEFORE)..=frame).map(|f| View::new(&camera, &poses[f as usize]));
            let views: Vec<View> = views.collect();
            let view = views.last().unwrap();
            let truth = FrameTruth::with(&map.scene, view, frame, Grid::of(&accuracy), &effort);
            let own = |t: &u32| (*t as usize) < map.own;
            found.frames += 1;
            found.seen += truth.visible.iter().filter(|(t, _)| own(t)).count() as u64;
            found.by_ray += truth.bracket.witnesses.iter().filter(|w| own(&w.triangle)).count() as u64;
            let excluded = map.excluded(cluster, false);
            let (violations, samples) = seen_though(&map, view, &truth, &excluded, reach * UNIT_M);
            if !violations.is_empty() {
                let ids: Vec<u32> =
                    violations.iter().take(8).map(|t| map.scene.source_triangle_id[*t as usize]).collect();
                println!("{name} path {number} frame {frame}: {} at {samples} samples, ids {ids:?}", violations.len());
            }
            found.violations += violations.len() as u64;
            found.samples += samples;
            let mirrored = map.excluded(cluster, true);
            found.mirrored += seen_though(&map, view, &truth, &mirrored, reach * UNIT_M).0.len() as u64;
            // What the walks could have left out.
            let near = |t: u32| map.scene.corners(t).iter().all(|p| p.distance(view.eye) < reach * UNIT_M);
            let mut left = BitSet::new(map.scene.len());
            for (t, _) in (0u32..).zip(truth.standings()).filter(|(_, s)| s.meets != Meets::CertainlyNot) {
                found.in_volume += u64::from(own(&t));
                if excluded.contains(t) && near(t) {
                    left.insert(t);
                }
            }
            found.excluded += left.count();
            for method in &mut methods {
                let remembered = if method.walk.remembers() { 0 } else { views.len() - 1 };
                views[remembered..].iter().for_each(|v| method.cull(&built, v));
                method.count(&built, &left);
            }
        }
    }
    Some((found, methods))
}

fn report(name: &str, reach: f64) {
    let Some((found, methods)) = second_judge(name, true, reach, accuracy().frames, WALKS) else { return };
    println!("{name}: {found:?}");
    let share = |name: &str| {
        let method = methods.iter().find(|m| m.name == name)?;
        Some(method.excluded as f64 / found.excluded as f64)
    };
    for m in &methods {
        let percent = 100.0 * share(&m.name).unwrap();
        println!(
            "{name}: {} over {} submits {} and so {} = {percent:.2} % of the {} that the map excludes in the frustum",
            m.name, STRUCTURES[m.hierarchy], m.submitted, m.excluded, found.excluded
        );
    }
    assert!(found.frames > 5 && found.skipped * 4 <= found.frames, "eyes are in the open");
    assert!(found.seen > 50 * found.frames && found.excluded > 0);
    assert_eq!((found.violations, found.samples), (0, 0), "{name}: seen, though the map excludes it");
    assert!(found.mirrored > 0, "a wrong reading of the bits is noticed");
    // The frustum knows nothing of what hides.
    assert_eq!(share("depth_first"), Some(1.0));
    assert_eq!(share("flat"), Some(1.0));
    // Better walks leave out more of it; each joins as soon as it is registered.
    let better = ["depth_first", "chc_pp", "fast_v"].into_iter().filter_map(|w| Some((w, share(w)?)));
    let better: Vec<(&str, f64)> = better.collect();
    // On the map with fog so little is left within reach that the order is chance.
    for pair in better.windows(2).filter(|_| found.excluded > 10_000) {
        assert!(pair[0].1 > pair[1].1, "{name}: the share does not fall from {:?} to {:?}", pair[0], pair[1]);
    }
}

#[test]
fn a_map_s_own_visibility_agrees_with_the_oracle_accident() {
    report("q3_accident", f64::INFINITY);
}

#[test]
fn a_map_s_own_visibility_agrees_with_the_oracle_aneurysm() {
    report("q3_aneurysm_hi", f64::INFINITY);
}

#[test]
fn a_map_s_own_visibility_agrees_with_the_oracle_czest3ctf() {
    report("q3_czest3ctf", f64::INFINITY);
}

/// Its compiler gave up beyond 3072 units, where fog hides the rest.
#[test]
fn a_map_s_own_visibility_agrees_with_the_oracle_ons_reborn() {
    report("q3_ons_reborn", 3072.0);
}

#[test]
fn without_the_sky_s_lids_the_map_s_word_does_not_hold() {
    let Some((found, _)) = second_judge("q3_accident", false, f64::INFINITY, 25, &[]) else { return };
    println!("q3_accident without lids: {found:?}");
    assert!(found.violations > 0, "sight over the walls is noticed");
}

#[test]
fn players_start_in_cells_that_see_themselves() {
    for name in ["q3_accident", "q3_aneurysm_hi", "q3_czest3ctf", "q3_ons_reborn"] {
        let Some(map) = Map::read(name, false) else { return };
        let clusters: Vec<usize> = map.spawns.iter().filter_map(|s| map.cluster(*s)).collect();
        assert_eq!(clusters.len(), map.spawns.len(), "{name}: a player starts in solid");
        assert!(clusters.iter().all(|c| *c < map.clusters && map.may_see(*c, *c)), "{name}");
        assert!(map.spawns.iter().all(|s| map.is_within_its_leaf(*s)), "{name}");
    }
}
