//! A Hi-Z pyramid: for each 2^k x 2^k block of pixels the farthest of what they are known to
//! hide (Greene, Kass & Miller 1993, "Hierarchical Z-Buffer Visibility"), as engines build
//! it after the first of two passes.
//!
//! Two traps of public code, avoided: the image is padded to powers of two with "infinitely
//! near", so that the last row and column of an odd size go into a level like all others; and the
//! level is chosen so that at most two by two of its texels hold the whole rectangle.

use super::project::{Place, Rect, Screen};
use crate::math::Box32;

#[derive(Debug, Clone, Default)]
pub struct Pyramid {
    screen: Screen,
    /// A texel of level 0 is 2^k pixels wide and high.
    shift: [u32; 2],
    /// Size, and nearness of each texel, row-major, of level 0 and on.
    levels: Vec<Level>,
}

#[derive(Debug, Clone)]
struct Level {
    width: usize,
    nearness: Vec<f32>,
}

impl Pyramid {
    /// Of an image of nearness, row-major, as large as the screen.
    pub fn new(screen: &Screen, nearness: &[f32]) -> Pyramid {
        Pyramid::over(screen, [0, 0], nearness)
    }

    /// Of the farthest nearness in each cell of 2^k pixels width and height, row-major; those
    /// at the right and bottom may reach beyond the image.
    pub fn over(screen: &Screen, shift: [u32; 2], nearness: &[f32]) -> Pyramid {
        let cells = |pixels: f64, shift: u32| (pixels as usize).div_ceil(1 << shift);
        let (width, height) = (cells(screen.width_px, shift[0]), cells(screen.height_px, shift[1]));
        assert_eq!(nearness.len(), width * height, "as many cells as cover the screen");
        let (w, h) = (width.next_power_of_two(), height.next_power_of_two());
        let mut first = vec![f32::INFINITY; w * h];
        for y in 0..height {
            first[y * w..][..width].copy_from_slice(&nearness[y * width..][..width]);
        }
        let mut levels = vec![Level { width: w, nearness: first }];
        let (mut w, mut h) = (w, h);
        while w > 1 || h > 1 {
            let below = levels.last().expect("level 0");
            let (across, down) = (w.min(2), h.min(2));
            (w, h) = (w / across, h / down);
            let farthest = |i: usize| {
                let (x, y) = (i % w * across, i / w * down);
                let at = |dx: usize, dy: usize| below.nearness[(y + dy) * below.width + x + dx];
                at(0, 0).min(at(across - 1, 0)).min(at(0, down - 1)).min(at(across - 1, down - 1))
            };
            let nearness = (0..w * h).map(farthest).collect();
            levels.push(Level { width: w, nearness });
        }
        Pyramid { screen: screen.clone(), shift, levels }
    }

    pub fn bytes(&self) -> usize {
        self.levels.iter().map(|l| size_of_val(&l.nearness[..])).sum()
    }

    /// Whether anything of the box may show. A box that the near plane cuts does.
    pub fn shows(&self, b: &Box32) -> bool {
        match self.screen.place(b) {
            Place::Outside => false,
            Place::Near => true,
            Place::Rect(rect, nearness) => self.shows_rect(rect, nearness),
        }
    }

    /// Whether something of this nearness may show in a rectangle of the image.
    pub fn shows_rect(&self, r: Rect, nearness: f32) -> bool {
        let [across, down] = self.shift;
        let r =
            Rect { x0: r.x0 >> across, x1: ((r.x1 - 1) >> across) + 1, y0: r.y0 >> down, y1: ((r.y1 - 1) >> down) + 1 };
        let level = self.level(r);
        let l = &self.levels[level];
        let (x0, x1) = (r.x0 as usize >> level, (r.x1 as usize - 1) >> level);
        let (y0, y1) = (r.y0 as usize >> level, (r.y1 as usize - 1) >> level);
        // Beyond the last level along one axis a texel holds all of it.
        let rows = l.nearness.len() / l.width;
        let at = |x: usize, y: usize| l.nearness[y.min(rows - 1) * l.width + x.min(l.width - 1)];
        !([at(x0, y0), at(x1, y0), at(x0, y1), at(x1, y1)].into_iter().all(|n| nearness < n))
    }

    /// Of a rectangle in texels of level 0, the finest level of which at most two by two texels hold the rectangle.
    fn level(&self, r: Rect) -> usize {
        let across = |a: u32, b: u32, level: u32| ((b - 1) >> level) - (a >> level);
        let fits = |level: u32| across(r.x0, r.x1, level) <= 1 && across(r.y0, r.y1, level) <= 1;
        // A rectangle of 2^k pixels touches up to three texels of 2^(k - 1), and two of 2^k.
        let size = (r.x1 - r.x0).max(r.y1 - r.y0);
        let level = size.next_power_of_two().trailing_zeros();
        let level = if level > 0 && fits(level - 1) { level - 1 } else { level };
        (level as usize).min(self.levels.len() - 1)
    }
}
