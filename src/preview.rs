//! A small deferred software renderer for looking at scenes: z-buffer, sun with
//! shadows, flat shading, stable colours a material. For pictures only: nothing
//! here judges or measures anything (the oracle has its own, exact, buffers).

use crate::error::{Error, Result};
use crate::math::{Aabb, Camera, DVec3, Pose, Projection, View};
use crate::scene::Scene;
use rayon::prelude::*;
use std::path::Path;

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

const NONE: u32 = u32::MAX;
/// Rows a task rasterises.
const BAND: usize = 32;

/// A triangle on the screen: pixels and, linear in screen space, `q` (reciprocal
/// depth in perspective, minus depth otherwise) and world height times that weight.
#[derive(Clone, Copy)]
struct Projected {
    id: u32,
    x: [f64; 3],
    y: [f64; 3],
    q: [f64; 3],
    height: [f64; 3],
    back: bool,
    ghost: bool,
}

struct Buffers {
    /// Larger is nearer.
    q: Vec<f32>,
    /// Triangle, or [`NONE`]; the top bit says that its back is seen.
    id: Vec<u32>,
}

const BACK_BIT: u32 = 1 << 31;

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
    let palette: Vec<DVec3> =
        (0..scene.material_names.len().max(1) as u32).map(|m| material_colour(scene, m)).collect();
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

fn rgb(c: [u8; 3]) -> DVec3 {
    DVec3::new(f64::from(c[0]), f64::from(c[1]), f64::from(c[2])) / 255.0
}

/// Towards the sun; any unit vector that lights tops, one long and one short side.
const SUN: DVec3 = DVec3::new(0.397_779, -0.530_372, 0.748_825);

fn rasterise(scene: &Scene, view: &View, w: usize, h: usize, style: &Style, looks: &[Look]) -> Buffers {
    let cull = style.cull_back_faces && style.cut_above_m.is_none();
    let cut = style.cut_above_m.unwrap_or(f64::INFINITY);
    let projected: Vec<Projected> = (0..scene.len() as u32)
        .into_par_iter()
        .filter(|t| looks[*t as usize] != Look::Hidden)
        .flat_map_iter(|t| project(scene, view, w, h, t, cull, looks[t as usize] == Look::Ghost))
        .collect();
    let bands = h.div_ceil(BAND);
    let mut bins: Vec<Vec<u32>> = vec![Vec::new(); bands];
    for (i, p) in projected.iter().enumerate() {
        let lo = p.y.iter().copied().fold(f64::INFINITY, f64::min).max(0.0);
        let hi = p.y.iter().copied().fold(f64::NEG_INFINITY, f64::max).min(h as f64 - 1.0);
        if lo <= hi {
            for bin in &mut bins[lo as usize / BAND..=hi as usize / BAND] {
                bin.push(i as u32);
            }
        }
    }
    let mut buffers = Buffers { q: vec![f32::NEG_INFINITY; w * h], id: vec![NONE; w * h] };
    let rows = buffers.q.par_chunks_mut(w * BAND).zip(buffers.id.par_chunks_mut(w * BAND));
    rows.zip(&bins).enumerate().for_each(|(band, ((q, id), bin))| {
        for p in bin {
            fill(&projected[*p as usize], band * BAND, w, q, id, cut, view.is_perspective());
        }
    });
    buffers
}

/// Clips triangle `t` against the near plane and projects what is left.
fn project(scene: &Scene, view: &View, w: usize, h: usize, t: u32, cull: bool, ghost: bool) -> Vec<Projected> {
    let world = scene.corners(t);
    let normal = scene.normal(t);
    let back =
        if view.is_perspective() { normal.dot(view.eye - world[0]) <= 0.0 } else { normal.dot(view.forward) >= 0.0 };
    if back && cull && !scene.two_sided[t as usize] {
        return Vec::new();
    }
    let near = view.camera.near_m;
    let points: Vec<(DVec3, f64)> = world.iter().map(|p| (view.to_camera(*p), p.z)).collect();
    let mut polygon: Vec<(DVec3, f64)> = Vec::with_capacity(4);
    for i in 0..3 {
        let (a, b) = (points[i], points[(i + 1) % 3]);
        if a.0.z >= near {
            polygon.push(a);
        }
        if (a.0.z >= near) != (b.0.z >= near) {
            let s = (near - a.0.z) / (b.0.z - a.0.z);
            polygon.push((a.0 + (b.0 - a.0) * s, a.1 + (b.1 - a.1) * s));
        }
    }
    let screen = |(p, z): (DVec3, f64)| {
        let q = if view.is_perspective() { 1.0 / p.z } else { -p.z };
        let weight = if view.is_perspective() { q } else { 1.0 };
        let x = (p.x * weight / view.half_width * 0.5 + 0.5) * w as f64;
        let y = (0.5 - p.y * weight / view.half_height * 0.5) * h as f64;
        (x, y, q, z * weight)
    };
    let corners: Vec<_> = polygon.into_iter().map(screen).collect();
    (2..corners.len())
        .map(|i| {
            let c = [corners[0], corners[i - 1], corners[i]];
            let (x, y) = (c.map(|c| c.0), c.map(|c| c.1));
            Projected { id: t, x, y, q: c.map(|c| c.2), height: c.map(|c| c.3), back, ghost }
        })
        .collect()
}

fn fill(p: &Projected, top: usize, w: usize, q: &mut [f32], id: &mut [u32], cut: f64, perspective: bool) {
    let rows = q.len() / w;
    let area = (p.x[1] - p.x[0]) * (p.y[2] - p.y[0]) - (p.x[2] - p.x[0]) * (p.y[1] - p.y[0]);
    if area.abs() < 1e-12 {
        return;
    }
    let (lo_x, hi_x) = extent(&p.x, w as f64);
    let y0 = (p.y.iter().copied().fold(f64::INFINITY, f64::min) - 0.5).ceil().max(top as f64);
    let y1 = (p.y.iter().copied().fold(f64::NEG_INFINITY, f64::max) - 0.5).floor().min((top + rows - 1) as f64);
    let (mut y, mark) = (y0, p.id | if p.back { BACK_BIT } else { 0 });
    while y <= y1 {
        for x in lo_x..hi_x {
            let (px, py) = (x as f64 + 0.5, y + 0.5);
            let b1 = ((px - p.x[0]) * (p.y[2] - p.y[0]) - (p.x[2] - p.x[0]) * (py - p.y[0])) / area;
            let b2 = ((p.x[1] - p.x[0]) * (py - p.y[0]) - (px - p.x[0]) * (p.y[1] - p.y[0])) / area;
            let b0 = 1.0 - b1 - b2;
            if b0 < 0.0 || b1 < 0.0 || b2 < 0.0 {
                continue;
            }
            let here = b0 * p.q[0] + b1 * p.q[1] + b2 * p.q[2];
            let at = (y as usize - top) * w + x;
            if (here as f32) <= q[at] || (p.ghost && (x ^ y as usize) & 1 == 1) {
                continue;
            }
            let height = b0 * p.height[0] + b1 * p.height[1] + b2 * p.height[2];
            if (if perspective { height / here } else { height }) > cut {
                continue;
            }
            q[at] = here as f32;
            id[at] = mark;
        }
        y += 1.0;
    }
}

/// Pixel columns whose centres may lie within.
fn extent(x: &[f64; 3], w: f64) -> (usize, usize) {
    let lo = (x.iter().copied().fold(f64::INFINITY, f64::min) - 0.5).ceil().clamp(0.0, w);
    let hi = (x.iter().copied().fold(f64::NEG_INFINITY, f64::max) + 0.5).floor().clamp(0.0, w);
    (lo as usize, hi as usize)
}

fn unproject(view: &View, w: usize, h: usize, x: usize, y: usize, q: f64) -> DVec3 {
    let sx = ((x as f64 + 0.5) / w as f64 * 2.0 - 1.0) * view.half_width;
    let sy = (1.0 - (y as f64 + 0.5) / h as f64 * 2.0) * view.half_height;
    if view.is_perspective() {
        view.eye + (view.forward + view.right * sx + view.up * sy) / q
    } else {
        view.eye + view.right * sx + view.up * sy - view.forward * q
    }
}

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

/// A colour that stays with the material: by a word in its name if we know one,
/// else from a wheel of muted tones.
fn material_colour(scene: &Scene, material: u32) -> DVec3 {
    const KNOWN: &[(&str, [u8; 3])] = &[
        ("grass", [128, 148, 92]),
        ("dirt", [166, 138, 104]),
        ("snow", [228, 233, 238]),
        ("rock", [142, 132, 122]),
        ("sand", [205, 182, 140]),
        ("water", [92, 138, 158]),
        ("asphalt", [98, 100, 106]),
        ("pavement", [176, 174, 168]),
        ("concrete", [178, 174, 166]),
        ("brick", [164, 96, 78]),
        ("plaster", [222, 210, 188]),
        ("wood", [150, 112, 74]),
        ("plank", [172, 134, 92]),
        ("metal", [126, 138, 148]),
        ("rust", [158, 104, 70]),
        ("roof", [122, 76, 66]),
        ("slate", [88, 98, 112]),
        ("glass", [150, 190, 205]),
        ("foliage", [84, 118, 74]),
        ("pine", [66, 98, 78]),
        ("frosted", [158, 182, 176]),
        ("road", [182, 152, 114]),
        ("bark", [104, 80, 62]),
        ("red", [184, 74, 64]),
        ("blue", [82, 116, 164]),
        ("coal", [58, 56, 58]),
        ("tile", [196, 188, 176]),
        ("carpet", [140, 92, 96]),
        ("paper", [236, 230, 214]),
        ("lamp", [246, 226, 160]),
        ("trim", [112, 92, 74]),
        ("hay", [212, 180, 98]),
        ("fabric", [116, 136, 120]),
        ("black", [52, 54, 58]),
        ("gold", [214, 172, 72]),
        ("white", [232, 230, 224]),
        ("paint", [138, 154, 138]),
    ];
    let name = scene.material_names.get(material as usize).map(|n| n.to_lowercase()).unwrap_or_default();
    // The first word that we know says what it is made of: `snow_roof` is white.
    let known = KNOWN.iter().filter_map(|(word, c)| Some((name.find(word)?, usize::MAX - word.len(), c)));
    if let Some((_, _, c)) = known.min() {
        return rgb(*c);
    }
    // Steps by the golden angle: neighbours in number are far apart in hue.
    let hue = f64::from(material) * 2.399_963;
    let wave = |shift: f64| 0.62 + 0.16 * libm::cos(hue + shift);
    DVec3::new(wave(0.0), wave(-2.094), wave(2.094))
}

/// A perspective bird's-eye view that shows all of `bounds`: from the compass
/// direction `azimuth_rad` (0 = from +x, counter-clockwise), `elevation_rad` above the horizon.
pub fn overview(bounds: &Aabb, azimuth_rad: f64, elevation_rad: f64, aspect: f64) -> View {
    let fov_y_rad = 35f64.to_radians();
    let camera = Camera { projection: Projection::Perspective { fov_y_rad }, aspect, near_m: 0.01, far_m: None };
    let back = DVec3::new(
        libm::cos(azimuth_rad) * libm::cos(elevation_rad),
        libm::sin(azimuth_rad) * libm::cos(elevation_rad),
        libm::sin(elevation_rad),
    );
    let up = if elevation_rad.abs() > 1.5 { DVec3::Y } else { DVec3::Z };
    let size = bounds.size();
    let corners: Vec<DVec3> = (0..8)
        .map(|i| {
            let pick = |bit: u32, s: f64| if i >> bit & 1 == 1 { s * 0.5 } else { -s * 0.5 };
            bounds.centre() + DVec3::new(pick(0, size.x), pick(1, size.y), pick(2, size.z))
        })
        .collect();
    // From far enough, then nearer by turns: move so that the picture of the box is
    // in the middle, and up to where it just fits.
    let mut eye = bounds.centre() + back * (size.length() * 2.0 + 1e-3);
    for _ in 0..12 {
        let view = View::new(&camera, &Pose { eye, forward: -back, up });
        let seen: Vec<DVec3> = corners.iter().map(|c| view.to_camera(*c)).collect();
        let fold = |f: &dyn Fn(&DVec3) -> f64| {
            seen.iter().map(f).fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)))
        };
        let (x, y) = (fold(&|c| c.x / c.z / view.half_width), fold(&|c| c.y / c.z / view.half_height));
        let depth = fold(&|c| c.z).0;
        let fill = ((x.1 - x.0) * 0.5).max((y.1 - y.0) * 0.5) / 0.96;
        let shift =
            view.right * ((x.0 + x.1) * 0.5 * view.half_width) + view.up * ((y.0 + y.1) * 0.5 * view.half_height);
        eye += (shift + view.forward * ((1.0 - fill) * 0.7)) * depth;
    }
    View::new(&camera, &Pose { eye, forward: -back, up })
}

/// An orthographic plan from straight above, +y up the page.
pub fn plan(bounds: &Aabb, aspect: f64) -> View {
    let size = bounds.size();
    let height_m = size.y.max(size.x / aspect).max(1e-3) * 1.03;
    let projection = Projection::Orthographic { height_m };
    let camera = Camera { projection, aspect, near_m: 0.0, far_m: None };
    let eye = bounds.centre() + DVec3::Z * (size.z * 0.5 + 1.0);
    View::new(&camera, &Pose { eye, forward: -DVec3::Z, up: DVec3::Y })
}

/// Draws a polyline over `image`, unhidden by the scene: a walk on its map.
pub fn draw_line(image: &mut Image, view: &View, points: &[DVec3], colour: [u8; 3]) {
    let (w, h) = (f64::from(image.width), f64::from(image.height));
    let pixel = |p: DVec3| {
        let c = view.to_camera(p);
        let weight = if view.is_perspective() { 1.0 / c.z } else { 1.0 };
        let x = (c.x * weight / view.half_width * 0.5 + 0.5) * w;
        let y = (0.5 - c.y * weight / view.half_height * 0.5) * h;
        (c.z > view.camera.near_m).then_some((x, y))
    };
    for pair in points.windows(2) {
        let (Some(a), Some(b)) = (pixel(pair[0]), pixel(pair[1])) else { continue };
        let steps = (b.0 - a.0).abs().max((b.1 - a.1).abs()).ceil().clamp(1.0, w + h);
        for i in 0..=steps as u32 {
            let t = f64::from(i) / steps;
            let (x, y) = (a.0 + (b.0 - a.0) * t, a.1 + (b.1 - a.1) * t);
            for (dx, dy) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)] {
                let (x, y) = (x + dx, y + dy);
                if x >= 0.0 && y >= 0.0 && x < w && y < h {
                    let at = (y as usize * image.width as usize + x as usize) * 4;
                    image.rgba[at..at + 3].copy_from_slice(&colour);
                }
            }
        }
    }
}

/// # Errors
/// When the file cannot be written; the message names it.
pub fn write_png(path: &Path, image: &Image) -> Result<()> {
    let file = std::fs::File::create(path).map_err(|e| Error::io(path, "cannot create the image", &e))?;
    let mut encoder = png::Encoder::new(std::io::BufWriter::new(file), image.width, image.height);
    encoder.set_color(png::ColorType::Rgba);
    encoder.set_depth(png::BitDepth::Eight);
    let mut writer = encoder.write_header().map_err(|e| fault(path, &e))?;
    writer.write_image_data(&image.rgba).map_err(|e| fault(path, &e))?;
    writer.finish().map_err(|e| fault(path, &e))
}

fn fault(path: &Path, e: &png::EncodingError) -> Error {
    Error::new(format!("cannot write the image: {e}")).in_file(path).help("is the disk full?")
}
