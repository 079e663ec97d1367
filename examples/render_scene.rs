//! Renders a generated scene or a scene file (metres, `up z` unless said) to a PNG:
//! `render_scene SPEC|FILE OUT.png [over AZIMUTH ELEVATION | plan | eye X Y Z YAW PITCH | walk FRAME] [cut HEIGHT] [up y] [scale S]`,
//! degrees and metres. `walk` on its own with `plan` or `over` draws the way.
//! Without arguments: the arena `gorge` to `target/scene.png`.

use cullmark::math::{Camera, DVec3, Pose, Projection, View};
use cullmark::preview::{Style, draw_line, overview, plan, render, write_png};
use cullmark::record::{SceneSource, SceneSpec, Up, Winding};
use cullmark::registry::Spec;
use cullmark::scene::{generate, load, walkthrough};
use std::time::Instant;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut args: Vec<String> = std::env::args().skip(1).collect();
    if args.is_empty() {
        args = vec!["arena:map=gorge".into(), "target/scene.png".into()];
    }
    let [spec, out, rest @ ..] = &args[..] else {
        return Err("usage: render_scene SPEC OUT.png [over AZ EL | plan | eye X Y Z YAW PITCH | walk FRAME]".into());
    };
    let started = Instant::now();
    let number = |i: usize| rest.get(i).and_then(|t| t.parse::<f64>().ok()).ok_or("a number is missing");
    let place = |word: &str| rest.iter().position(|w| w == word);
    let scene = if std::path::Path::new(spec).exists() {
        let up = place("up").filter(|i| rest.get(i + 1).is_some_and(|w| w == "y")).map_or(Up::Z, |_| Up::Y);
        let (source, scale) = (SceneSource::File(spec.into()), place("scale").map_or(Ok(1.0), |i| number(i + 1))?);
        let (name, winding) = (spec.clone(), Winding::Ccw);
        load::load(&SceneSpec {
            name,
            source,
            winding,
            up,
            scale,
            weld: false,
            offset_m: [0.0; 3],
            fingerprint: String::new(),
        })?
    } else {
        generate::make(&Spec::parse(spec)?)?.0.generate()
    };
    let (bounds, took) = (scene.bounds(), started.elapsed().as_millis());
    println!("{}: {} triangles, size {:.1} m, {took} ms", scene.name, scene.len(), bounds.size());
    let mut style = Style::default();
    if let Some(i) = place("cut") {
        style.cut_above_m = Some(number(i + 1)?);
    }
    let camera = Camera { projection: Projection::Perspective { fov_y_rad: 1.1 }, ..Camera::default() };
    let mut poses = Vec::new();
    if place("walk").is_some() {
        let started = Instant::now();
        poses = walkthrough::generate::make(&Spec::parse("walk")?)?.0.walk(&scene)?;
        println!("walk of {} frames, {} ms", poses.len(), started.elapsed().as_millis());
    }
    let view = match rest.first().map(String::as_str) {
        Some("plan") => plan(&bounds, 16.0 / 9.0),
        Some("eye") => {
            let (yaw, pitch) = (number(4)?.to_radians(), number(5)?.to_radians());
            let forward = DVec3::new(yaw.cos() * pitch.cos(), yaw.sin() * pitch.cos(), pitch.sin());
            View::new(&camera, &Pose { eye: DVec3::new(number(1)?, number(2)?, number(3)?), forward, up: DVec3::Z })
        }
        Some("walk") => View::new(&camera, &poses[number(1)? as usize]),
        Some("over") => overview(&bounds, number(1)?.to_radians(), number(2)?.to_radians(), 16.0 / 9.0),
        _ => overview(&bounds, -1.0, 0.7, 16.0 / 9.0),
    };
    let mut image = render(&scene, &view, 1280, 720, &style);
    if rest.first().is_some_and(|w| w != "walk") {
        let way: Vec<DVec3> = poses.iter().map(|p| p.eye).collect();
        draw_line(&mut image, &view, &way, [214, 40, 90]);
    }
    Ok(write_png(std::path::Path::new(out), &image)?)
}
