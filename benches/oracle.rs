//! What ground truth costs: `cargo bench --no-default-features --bench oracle`.
//! The item buffer and exact sets of single frames on one thread, over the real
//! scenes where `$CULLMARK_SCENES` names them, else over generated ones.

use cullmark::math::{Camera, Pose};
use cullmark::oracle;
use cullmark::record::{Accuracy, PathSource, PathSpec, SceneSource, Up, Winding};
use cullmark::registry::Spec;
use cullmark::scene::{Scene, generate, load, walkthrough};
use cullmark::stats::{median, quantile};
use std::path::{Path, PathBuf};
use std::time::Instant;

fn main() -> cullmark::Result<()> {
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global().expect("the first pool");
    println!("{:<16} {:>10} {:>12} {:>8}  ms a frame [least .. most]", "scene", "triangles", "pixels", "samples");
    if let Some(folder) = std::env::var_os("CULLMARK_SCENES").map(PathBuf::from) {
        for (name, file, up, scale) in [
            ("q3_ons_reborn", "q3_ons_reborn.obj", Up::Z, 0.0254),
            ("stk_candela_city", "stk_candela_city.glb", Up::Y, 1.0),
            ("city_1m", "city_1m.glb", Up::Y, 1.0),
        ] {
            let (scene, poses) = read(&folder.join(name), name, file, up, scale)?;
            measure(name, &scene, &poses);
        }
        return Ok(());
    }
    for spec in ["arena:map=gold_rush", "rooms:world=2"] {
        let scene = generate::make(&Spec::parse(spec)?)?.0.generate();
        let poses = walkthrough::generate::make(&Spec::parse("walk:frames=300")?)?.0.walk(&scene)?;
        measure(spec, &scene, &poses);
    }
    Ok(())
}

fn read(folder: &Path, name: &str, file: &str, up: Up, scale: f64) -> cullmark::Result<(Scene, Vec<Pose>)> {
    let spec = load::describe(name, SceneSource::File(folder.join(file)), Winding::Ccw, Some(up), scale, false)?;
    let scene = load::load(&spec)?;
    let source = PathSource::File(folder.join(format!("{name}_path1.csv")));
    let fingerprint = walkthrough::fingerprint(&source, &spec.fingerprint)?;
    let path = PathSpec { name: name.into(), source, frames: None, stride: 1, fingerprint };
    let poses = walkthrough::load(&path, &spec, &scene)?;
    Ok((scene, poses))
}

fn measure(name: &str, scene: &Scene, poses: &[Pose]) {
    for (width_px, height_px, samples) in [(960, 540, 2), (1920, 1080, 1)] {
        let accuracy = Accuracy { frames: 6, width_px, height_px, samples, ..Accuracy::default() };
        let judged = oracle::judged_frames(poses.len() as u32, &accuracy);
        let times: Vec<f64> = judged
            .iter()
            .map(|f| {
                let start = Instant::now();
                let truth = oracle::truth(scene, &Camera::default(), &[(*f, poses[*f as usize])], &accuracy);
                std::hint::black_box(truth);
                start.elapsed().as_secs_f64() * 1e3
            })
            .collect();
        let (low, high) = (quantile(&times, 0.0), quantile(&times, 1.0));
        let size = format!("{width_px} x {height_px}");
        let (triangles, middle) = (scene.len(), median(&times));
        println!("{name:<16} {triangles:>10} {size:>12} {samples:>6}^2  {middle:.1} [{low:.1} .. {high:.1}]");
    }
}
