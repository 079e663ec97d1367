//! A depth for every pixel, f64 arithmetic, one triangle after another: what faster
//! buffers are held against.

use super::occluders::{Kind, Occluders};
use super::project::{HAIR_PX, Rect, Screen, f32_below};
use super::{Coverage, Settings};
use crate::math::DVec3;

#[derive(Debug, Clone)]
pub struct Plain {
    settings: Settings,
    nearness: Vec<f32>,
}

impl Plain {
    pub fn new(settings: Settings) -> Plain {
        let pixels = settings.width_px as usize * settings.height_px as usize;
        Plain { settings, nearness: vec![f32::NEG_INFINITY; pixels] }
    }

    pub fn clear(&mut self) {
        self.nearness.fill(f32::NEG_INFINITY);
    }

    pub fn image(&self) -> &[f32] {
        &self.nearness
    }

    pub fn draw(&mut self, screen: &Screen, occluders: &Occluders, first: u32, end: u32) -> u32 {
        let drawn = (first..end).filter(|p| occluders.kind(*p) != Kind::Clear);
        drawn.map(|p| self.triangle(screen, occluders.corners(p), occluders.kind(p) == Kind::TwoSided)).count() as u32
    }

    pub fn pixels(&self, rect: Rect, nearness: f32) -> u32 {
        self.rows(rect).map(|row| row.iter().filter(|n| nearness >= **n).count() as u32).sum()
    }

    pub fn shows(&self, rect: Rect, nearness: f32) -> bool {
        self.rows(rect).any(|row| row.iter().any(|n| nearness >= *n))
    }

    fn rows(&self, r: Rect) -> impl Iterator<Item = &[f32]> {
        let width = self.settings.width_px as usize;
        (r.y0..r.y1).map(move |y| &self.nearness[y as usize * width..][r.x0 as usize..r.x1 as usize])
    }

    /// A triangle with corners relative to the screen's origin.
    pub fn triangle(&mut self, screen: &Screen, corners: [DVec3; 3], two_sided: bool) {
        let c = corners.map(|p| screen.camera(p));
        let polygon = in_front(screen, &c);
        if polygon.len() < 3 {
            return;
        }
        let points: Vec<DVec3> = polygon.iter().map(|c| screen.pixel(*c)).collect();
        let area: f64 = (1..points.len() - 1).map(|i| cross(points[0], points[i], points[i + 1])).sum();
        // y points down: a front face turns clockwise on the image.
        if !(area.abs() > 1e-9) || (area > 0.0 && !two_sided) {
            return;
        }
        let turn = area.signum();
        let least = points.iter().fold(f64::INFINITY, |m, p| m.min(p.z));
        // Nearness is linear on the image; a sliver's slope is not to be trusted.
        let slope = plane(&points);
        let half = if self.settings.coverage == Coverage::Inner { 0.5 } else { 0.0 };
        let lo = points.iter().fold(DVec3::INFINITY, |m, p| m.min(*p));
        let hi = points.iter().fold(DVec3::NEG_INFINITY, |m, p| m.max(*p));
        let pixel = |v: f64, size: u32| v.clamp(0.0, f64::from(size)) as u32;
        let (width, height) = (self.settings.width_px, self.settings.height_px);
        for y in pixel(lo.y.floor(), height)..pixel(hi.y.ceil(), height) {
            for x in pixel(lo.x.floor(), width)..pixel(hi.x.ceil(), width) {
                let at = DVec3::new(f64::from(x) + 0.5, f64::from(y) + 0.5, 0.0);
                let inside = (0..points.len()).all(|i| {
                    let (a, b) = (points[i], points[(i + 1) % points.len()]);
                    let side = turn * cross(a, b, at);
                    let reach = half * ((b.x - a.x).abs() + (b.y - a.y).abs());
                    let hair = HAIR_PX * ((b.x - a.x).abs() + (b.y - a.y).abs());
                    side - reach > hair
                });
                if !inside {
                    continue;
                }
                let nearness = slope.map_or(least, |[gx, gy, g]| {
                    let worst = half * (gx.abs() + gy.abs());
                    let value = gx * (at.x - points[0].x) + gy * (at.y - points[0].y) + g - worst;
                    let doubt = 1e-9 * (gx.abs() + gy.abs()) + 1e-12 * value.abs();
                    (value - doubt).max(least)
                });
                let n = &mut self.nearness[(y * width + x) as usize];
                *n = n.max(f32_below(nearness));
            }
        }
    }
}

/// Twice the signed area.
fn cross(a: DVec3, b: DVec3, c: DVec3) -> f64 {
    (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x)
}

/// Slopes of nearness along x and y and its value at the first point.
fn plane(p: &[DVec3]) -> Option<[f64; 3]> {
    // The largest of the fan's triangles.
    let i = (1..p.len() - 1)
        .max_by(|i, j| cross(p[0], p[*i], p[*i + 1]).abs().total_cmp(&cross(p[0], p[*j], p[*j + 1]).abs()))?;
    let (a, b, c) = (p[0], p[i], p[i + 1]);
    let area = cross(a, b, c);
    if area.abs() < 1e-6 {
        return None;
    }
    let gx = ((b.z - a.z) * (c.y - a.y) - (c.z - a.z) * (b.y - a.y)) / area;
    let gy = ((c.z - a.z) * (b.x - a.x) - (b.z - a.z) * (c.x - a.x)) / area;
    Some([gx, gy, a.z])
}

/// The part of the triangle beyond the near plane (Sutherland & Hodgman 1974).
fn in_front(screen: &Screen, c: &[DVec3; 3]) -> Vec<DVec3> {
    // Parallel rays see what lies beyond the near plane, too, and nothing before it.
    let near = screen.near_m;
    let mut out = Vec::with_capacity(4);
    for i in 0..3 {
        let (a, b) = (c[i], c[(i + 1) % 3]);
        if a.z >= near {
            out.push(a);
        }
        if (a.z >= near) != (b.z >= near) {
            out.push(a + (b - a) * ((near - a.z) / (b.z - a.z)));
        }
    }
    out
}
