//! What counted work costs, for the adviser's model (`src/advice/cost.rs`): `cargo bench
//! --no-default-features --bench costs [-- SCENE.obj|.glb PATH.csv ...]`.
//!
//! Every candidate is counted and timed on generated scenes, and on the files named, taking
//! turns; non-negative least squares with relative weights give nanoseconds a counter.
//! Every other measurement is held out, and says what the model is worth.

use cullmark::advice::probe::{Built, Counts};
use cullmark::advice::{candidates, cost, probe};
use cullmark::math::{Camera, View};
use cullmark::record::{SceneSource, Up, Winding};
use cullmark::registry::Spec;
use cullmark::scene::{Scene, generate, load, walkthrough};
use cullmark::stats;

const TURNS: usize = 9;
const SCENES: &[&str] =
    &["blocks:world=6", "rooms:world=1", "rooms:world=2", "arena:map=ravine", "arena:map=gold_rush"];

fn main() {
    let args: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with('-')).collect();
    let mut rows: Vec<(String, Counts, f64)> = Vec::new();
    for name in SCENES {
        let scene = generate::make(&Spec::parse(name).expect("a spec")).expect("a generator").0.generate();
        let spec = Spec::parse("walk:frames=1000,seed=7").expect("a spec");
        let poses = walkthrough::generate::make(&spec).expect("a walk").0.walk(&scene).expect("free space");
        measure(name, &scene, &poses, &mut rows);
    }
    for pair in args.chunks_exact(2) {
        let source = SceneSource::File(pair[0].clone().into());
        let spec = load::describe(&pair[0], source, Winding::Ccw, Some(Up::Z), 1.0, false).expect("a scene");
        let scene = load::load(&spec).expect("a scene");
        let source = cullmark::record::PathSource::File(pair[1].clone().into());
        let path = cullmark::record::PathSpec {
            name: pair[1].clone(),
            source,
            frames: None,
            stride: 1,
            fingerprint: String::new(),
        };
        let poses = walkthrough::load(&path, &spec, &scene).expect("a path");
        measure(&pair[0], &scene, &poses, &mut rows);
    }
    let names: Vec<&str> = cost::COSTS.iter().map(|c| c.0).collect();
    let of = |counts: &Counts| names.iter().map(|n| counts.of(n)).collect::<Vec<f64>>();
    // Relative: each row and its time over the time.
    let relative = |keep: &dyn Fn(usize) -> bool| -> (Vec<Vec<f64>>, Vec<f64>) {
        let kept = rows.iter().enumerate().filter(|(i, _)| keep(*i)).map(|(_, r)| r);
        kept.map(|(_, c, ns)| (of(c).iter().map(|x| x / ns).collect::<Vec<f64>>(), 1.0)).unzip()
    };
    let (half, ones) = relative(&|i| i % 2 == 0);
    let fitted = stats::nnls(&half, &ones);
    let error = |costs: &[f64], keep: &dyn Fn(usize) -> bool| {
        let off = rows.iter().enumerate().filter(|(i, _)| keep(*i)).map(|(_, (_, c, ns))| {
            let predicted: f64 = of(c).iter().zip(costs).map(|(x, c)| x * c).sum();
            (predicted / ns - 1.0).abs()
        });
        stats::median(&off.collect::<Vec<_>>())
    };
    println!("\n{} measurements; median relative error:", rows.len());
    println!(
        "  fitted half {:.1} %, held-out half {:.1} %",
        100.0 * error(&fitted, &|i| i % 2 == 0),
        100.0 * error(&fitted, &|i| i % 2 == 1)
    );
    let now: Vec<f64> = cost::COSTS.iter().map(|c| c.1).collect();
    println!("  with the costs of this build {:.1} %", 100.0 * error(&now, &|_| true));
    let (all, ones) = relative(&|_| true);
    println!("fitted to all:");
    names.iter().zip(stats::nnls(&all, &ones)).for_each(|(name, ns)| println!("    (\"{name}\", {ns:.3}),"));
}

fn measure(name: &str, scene: &Scene, poses: &[cullmark::math::Pose], rows: &mut Vec<(String, Counts, f64)>) {
    let frames = probe::frames(poses.len(), 64);
    let views: Vec<View> = frames.iter().map(|f| View::new(&Camera::default(), &poses[*f as usize])).collect();
    let mut all = candidates::product(candidates::STRUCTURES, candidates::CULLINGS).expect("known names");
    all.extend(candidates::with_mailboxes(&all));
    for structure in candidates::STRUCTURES {
        let spec = cullmark::structure::make(&Spec::parse(structure).expect("a spec")).expect("a structure").1;
        let mine: Vec<_> = all.iter().filter(|c| c.structure == spec).collect();
        let mut built: Vec<Built> = mine.iter().filter_map(|c| Built::new(scene, c).ok()).collect();
        let counts: Vec<Counts> = built.iter_mut().map(|b| b.pass(&views)).collect();
        let mut times = vec![Vec::new(); built.len()];
        for _ in 0..TURNS {
            built.iter_mut().zip(&mut times).for_each(|(b, t)| t.push(b.time(&views)));
        }
        for ((c, counts), times) in mine.iter().zip(counts).zip(times) {
            let ns = stats::median(&times);
            println!("{name:<22} {:<60} {:>9.0} ns, model {:>9.0}", c.label(), ns, cost::cull_ns(&counts));
            rows.push((format!("{name} {}", c.label()), counts, ns));
        }
    }
}
