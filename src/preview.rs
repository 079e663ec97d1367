//! A small deferred software renderer for looking at scenes: z-buffer, sun with
//! shadows, flat shading, stable colours a material. For pictures only: nothing
//! here judges or measures anything (the oracle has its own, exact, buffers).

mod depth;
mod palette;
mod raster;
mod views;

use crate::error::{Error, Result};
use crate::math::{Camera, DVec3, Pose, Projection, View};
use crate::scene::Scene;
use palette::material_colour;
use raster::{BACK_BIT, Buffers, NONE, rasterise, unproject};
use rayon::prelude::*;
use std::path::Path;

pub use depth::depth;
pub use views::{draw_line, overview, plan};

/// 8-bit RGBA, rows from the top.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Image {
    pub width: u32,
    pub height: u32,
    pub rgba: Vec<u8>,
}

/// How one triangle is to look.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Look {
    /// Colour of its material.
    Plain,
    /// Not drawn.
    Hidden,
    /// Half transparent and pale: what was not submitted.
    Ghost,
    /// In this colour, shaded: what was lost, say.
    Tint([u8; 3]),
}

pub struct Style<'a> {
    /// Back faces of single-sided triangles are not drawn.
    pub cull_back_faces: bool,
    /// Nothing above this height (metres) is drawn; what it cuts open shows dark.
    pub cut_above_m: Option<f64>,
    pub shadows: bool,
    /// s x s samples a pixel.
    pub samples: u32,
    pub sky: [u8; 3],
    /// Look of a triangle (index into the scene); all plain if absent.
    pub look: Option<&'a (dyn Fn(u32) -> Look + Sync)>,
}

impl Default for Style<'_> {
    fn default() -> Self {
        Style { cull_back_faces: true, cut_above_m: None, shadows: true, samples: 2, sky: [206, 222, 235], look: None }
    }
}

/// Renders `scene` as `view` sees it.
pub fn render(scene: &Scene, view: &View, width: u32, height: u32, style: &Style) -> Image {
    let s = style.samples.clamp(1, 8);
    let (w, h) = ((width * s) as usize, (height * s) as usize);
    let looks: Vec<Look> = match style.look {
        Some(f) => (0..scene.len() as u32).into_par_iter().map(f).collect(),
        None => vec![Look::Plain; scene.len()],
    };
    let buffers = rasterise(scene, view, w, h, style, &looks);
    let sun = style.shadows.then(|| Sun::new(scene, style, &looks));
    let palette = palette(scene);
    let bounds = scene.bounds();
    let shade = |x: usize, y: usize| -> DVec3 {
        let i = y * w + x;
        if buffers.id[i] == NONE {
            // A sky that pales towards the horizon keeps far silhouettes readable.
            let t = y as f64 / h as f64;
            return rgb(style.sky) * (0.82 + 0.18 * t);
        }
        let id = buffers.id[i] & !BACK_BIT;
        let back = buffers.id[i] & BACK_BIT != 0;
        let p = unproject(view, w, h, x, y, f64::from(buffers.q[i]));
        let mut normal = scene.normal(id).normalize();
        if back {
            if style.cut_above_m.is_some() && !scene.two_sided[id as usize] {
                return DVec3::splat(0.18);
            }
            normal = -normal;
        }
        let base = match looks[id as usize] {
            Look::Tint(c) => rgb(c),
            Look::Ghost => DVec3::splat(0.85),
            _ => palette.get(scene.material_id[id as usize] as usize).copied().unwrap_or(DVec3::splat(0.7)),
        };
        let lit = sun.as_ref().map_or(1.0, |s| s.light(p + normal * 0.05));
        let lambert = normal.dot(SUN).max(0.0) * (0.1 + 0.9 * lit);
        let sky_light = 0.5 + 0.5 * normal.z;
        let fill = normal.dot(DVec3::new(-0.5, 0.4, 0.2)).max(0.0);
        let rise = if bounds.size().z > 0.0 { (p.z - bounds.lo.z) / bounds.size().z } else { 0.5 };
        let light = 0.36 + 0.20 * sky_light + 0.14 * fill + 0.58 * lambert;
        base * light * (0.94 + 0.10 * rise)
    };
    let contact = |x: usize, y: usize| -> f64 {
        // Darkens hollows, a poor man's ambient occlusion: `q` is linear over a plane,
        // so opposite neighbours that are nearer on average mean a concave place.
        let at = |x: usize, y: usize| f64::from(buffers.q[y * w + x]);
        let (q, reach) = (at(x, y), s as usize * 3);
        if x < reach || y < reach || x + reach >= w || y + reach >= h {
            return 1.0;
        }
        let hollow = |a: f64, b: f64| {
            let rise = (a + b) * 0.5 - q;
            let relative = if view.is_perspective() { rise / q.max(1e-9) * 12.0 } else { rise };
            // Much nearer neighbours are another thing in front, not a corner.
            if !relative.is_finite() || relative <= 0.0 { 0.0 } else { relative.min(0.25 / relative).min(0.5) * 2.0 }
        };
        let across = hollow(at(x - reach, y), at(x + reach, y));
        let along = hollow(at(x, y - reach), at(x, y + reach));
        1.0 - 0.22 * across.max(along)
    };
    let mut rgba = vec![255u8; (width * height * 4) as usize];
    rgba.par_chunks_mut(width as usize * 4).enumerate().for_each(|(y, row)| {
        for x in 0..width as usize {
            let mut sum = DVec3::ZERO;
            for sy in 0..s as usize {
                for sx in 0..s as usize {
                    let (px, py) = (x * s as usize + sx, y * s as usize + sy);
                    let solid = buffers.id[py * w + px] != NONE;
                    sum += shade(px, py) * if solid { contact(px, py) } else { 1.0 };
                }
            }
            let c = (sum / f64::from(s * s)).clamp(DVec3::ZERO, DVec3::ONE) * 255.0;
            row[x * 4..x * 4 + 3].copy_from_slice(&[c.x as u8, c.y as u8, c.z as u8]);
        }
    });
    Image { width, height, rgba }
}

/// Colour of every material, 8 bits a channel; of a scene that names none, of the one it has.
pub fn material_colours(scene: &Scene) -> Vec<[u8; 3]> {
    let byte = |x: f64| (x.clamp(0.0, 1.0) * 255.0).round() as u8;
    palette(scene).iter().map(|c| c.to_array().map(byte)).collect()
}

fn palette(scene: &Scene) -> Vec<DVec3> {
    (0..scene.material_names.len().max(1) as u32).map(|m| material_colour(scene, m)).collect()
}

fn rgb(c: [u8; 3]) -> DVec3 {
    DVec3::new(f64::from(c[0]), f64::from(c[1]), f64::from(c[2])) / 255.0
}

/// Towards the sun; any unit vector that lights tops, one long and one short side.
const SUN: DVec3 = DVec3::new(0.397_779, -0.530_372, 0.748_825);

/// What the sun sees.
struct Sun {
    view: View,
    buffers: Buffers,
    size: usize,
}

impl Sun {
    fn new(scene: &Scene, style: &Style, looks: &[Look]) -> Sun {
        let size = 4096;
        let bounds = scene.bounds();
        let (centre, reach) = (bounds.centre(), bounds.size().length().max(1e-3));
        let camera =
            Camera { projection: Projection::Orthographic { height_m: reach }, aspect: 1.0, near_m: 0.0, far_m: None };
        let view = View::new(&camera, &Pose { eye: centre + SUN * reach, forward: -SUN, up: DVec3::Z });
        let style = Style { cull_back_faces: false, cut_above_m: style.cut_above_m, ..Style::default() };
        Sun { buffers: rasterise(scene, &view, size, size, &style, looks), view, size }
    }

    /// Share of the texels about a point that the sun reaches.
    fn light(&self, p: DVec3) -> f64 {
        let c = self.view.to_camera(p);
        let x = (c.x / self.view.half_width * 0.5 + 0.5) * self.size as f64 - 0.5;
        let y = (0.5 - c.y / self.view.half_height * 0.5) * self.size as f64 - 0.5;
        let texel = 2.0 * self.view.half_height / self.size as f64;
        let reached = |dx: f64, dy: f64| {
            let (x, y) = ((x.floor() + dx) as usize, (y.floor() + dy) as usize);
            let within = x < self.size && y < self.size;
            f64::from(!within || f64::from(self.buffers.q[y * self.size + x]) < -c.z + 2.5 * texel)
        };
        let (s, t) = (x - x.floor(), y - y.floor());
        let low = reached(0.0, 0.0) * (1.0 - s) + reached(1.0, 0.0) * s;
        let high = reached(0.0, 1.0) * (1.0 - s) + reached(1.0, 1.0) * s;
        low * (1.0 - t) + high * t
    }
}

/// # Errors
/// When the file cannot be written; the message names it.
pub fn write_png(path: &Path, image: &Image) -> Result<()> {
    let file = std::fs::File::create(path).map_err(|e| Error::io(path, "cannot create the image", &e))?;
    encode(std::io::BufWriter::new(file), image).map_err(|e| e.in_file(path).help("is the disk full?"))
}

/// The image as the bytes of a PNG file.
///
/// # Errors
/// When it has no pixels.
pub fn encode_png(image: &Image) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    encode(&mut bytes, image)?;
    Ok(bytes)
}

fn encode(to: impl std::io::Write, image: &Image) -> Result<()> {
    let write = || {
        let mut encoder = png::Encoder::new(to, image.width, image.height);
        encoder.set_color(png::ColorType::Rgba);
        encoder.set_depth(png::BitDepth::Eight);
        let mut writer = encoder.write_header()?;
        writer.write_image_data(&image.rgba)?;
        writer.finish()
    };
    write().map_err(|e: png::EncodingError| Error::new(format!("cannot write the image: {e}")))
}
