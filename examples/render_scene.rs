//! Renders a generated scene to a PNG:
//! `render_scene SPEC OUT.png [over AZIMUTH ELEVATION | plan | eye X Y Z YAW PITCH] [cut HEIGHT]`, degrees and metres.

use cullmark::math::{Camera, DVec3, Pose, View};
use cullmark::preview::{Style, overview, plan, render, write_png};
use cullmark::registry::Spec;
use cullmark::scene::generate;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [spec, out, rest @ ..] = &args[..] else {
        return Err("usage: render_scene SPEC OUT.png [over AZ EL | plan | eye X Y Z YAW PITCH] [cut HEIGHT]".into());
    };
    let started = std::time::Instant::now();
    let scene = generate::make(&Spec::parse(spec)?)?.0.generate();
    let bounds = scene.bounds();
    println!(
        "{}: {} triangles, size {:.1} m, {} ms",
        scene.name,
        scene.len(),
        bounds.size(),
        started.elapsed().as_millis()
    );
    let number = |i: usize| rest.get(i).and_then(|t| t.parse::<f64>().ok()).ok_or("a number is missing");
    let mut style = Style::default();
    if let Some(i) = rest.iter().position(|w| w == "cut") {
        style.cut_above_m = Some(number(i + 1)?);
    }
    let view = match rest.first().map(String::as_str) {
        Some("plan") => plan(&bounds, 16.0 / 9.0),
        Some("eye") => {
            let (yaw, pitch) = (number(4)?.to_radians(), number(5)?.to_radians());
            let forward = DVec3::new(yaw.cos() * pitch.cos(), yaw.sin() * pitch.cos(), pitch.sin());
            let camera =
                Camera { projection: cullmark::math::Projection::Perspective { fov_y_rad: 1.2 }, ..Camera::default() };
            View::new(&camera, &Pose { eye: DVec3::new(number(1)?, number(2)?, number(3)?), forward, up: DVec3::Z })
        }
        Some("over") => overview(&bounds, number(1)?.to_radians(), number(2)?.to_radians(), 16.0 / 9.0),
        _ => overview(&bounds, -1.0, 0.7, 16.0 / 9.0),
    };
    write_png(std::path::Path::new(out), &render(&scene, &view, 1280, 720, &style))?;
    Ok(())
}
