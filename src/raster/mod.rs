//! Depth of occluders, and whether a box shows behind them.
//!
//! A [`DepthBuffer`] holds, for every pixel of an image of its own size, how near the
//! occluders drawn so far are, never nearer than they truly are. *Nearness* grows towards
//! the eye: `1 / depth` for perspective cameras, `-depth` for parallel rays; both are
//! linear on the image plane. Pixel (0, 0) is at the top left; a sample is a pixel's centre.
//!
//! What a query answers is an upper bound: a box of which it says 0 pixels shows at no
//! sample ([`Coverage::Samples`]), or nowhere at all ([`Coverage::Inner`]).
//!
//! The way of a triangle: `occluders` (fixed point, in batches), `vertices` (projected
//! in f64, snapped), `set_up` (many at a time; `large` what is not small), `fill` (rows to
//! subtiles), `tiles` (the buffer). `lanes` is what these are written in, `kernel`
//! what they are compiled for, `queue` who draws when.

// "Not above" is said so that what is no number is not above either.
#![allow(clippy::neg_cmp_op_on_partial_ord)]

mod block;
mod code;
mod fill;
pub mod items;
mod kernel;
mod lanes;
#[cfg(target_arch = "x86_64")]
mod lanes_avx2;
#[cfg(target_arch = "x86_64")]
mod lanes_avx512;
mod lanes_scalar;
mod large;
pub mod occluders;
mod pairs;
pub mod plain;
pub mod project;
pub mod pyramid;
mod queue;
mod set_up;
mod tiles;
mod vertices;

pub use kernel::Kernel;
pub use occluders::{Kind, Occluders};

use crate::math::{Box32, DVec3, View};
use project::{Place, Rect, Screen, f32_above, f32_below};
use pyramid::Pyramid;
use queue::Queue;
use tiles::Tiles;
use vertices::Lens;

/// Which pixels an occluder fills.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Coverage {
    /// Those whose sample it covers: nothing that the same samples see is ever hidden.
    #[default]
    Samples,
    /// Those that lie in it as a whole: nothing visible is ever hidden.
    Inner,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Settings {
    pub width_px: u32,
    pub height_px: u32,
    pub coverage: Coverage,
}

/// Images are at most this wide and high.
pub const MOST_PX: u32 = 8192;

pub struct DepthBuffer {
    settings: Settings,
    kernel: Kernel,
    screen: Screen,
    /// Made when the first occluders come: parallel rays need to know how far these reach.
    lens: Option<Lens>,
    tiles: Tiles,
    queue: Queue,
}

impl DepthBuffer {
    pub fn new(settings: Settings) -> DepthBuffer {
        DepthBuffer::with_kernel(settings, Kernel::best())
    }

    /// # Panics
    /// If the processor lacks the kernel, or the image is empty or larger than [`MOST_PX`].
    pub fn with_kernel(settings: Settings, kernel: Kernel) -> DepthBuffer {
        assert!(kernel.present(), "this processor has no {kernel:?}");
        let (w, h) = (settings.width_px, settings.height_px);
        assert!(w > 0 && h > 0 && w <= MOST_PX && h <= MOST_PX, "no depth buffer of {w} x {h} px");
        DepthBuffer {
            settings,
            kernel,
            screen: Screen::default(),
            lens: None,
            tiles: Tiles::new(w, h),
            queue: Queue::default(),
        }
    }

    pub fn settings(&self) -> Settings {
        self.settings
    }

    pub fn kernel(&self) -> Kernel {
        self.kernel
    }

    /// Starts an image: nothing hides anything. `origin` is that of occluders and boxes.
    pub fn begin(&mut self, view: &View, origin: DVec3) {
        self.screen = Screen::new(view, origin, self.settings);
        self.lens = None;
        self.queue.clear();
        self.tiles.clear();
    }

    /// Draws the occluders at positions `first..end`; returns how many triangles that are.
    /// Later queries see them.
    pub fn draw(&mut self, occluders: &Occluders, first: u32, end: u32) -> u32 {
        let hiding = occluders.hiding(first, end);
        if hiding != 0 {
            let lens = self.lens.get_or_insert_with(|| {
                let (lo, hi) = occluders.bounds();
                Lens::new(self.screen.clone(), self.settings, self.screen.farthest(lo, hi))
            });
            self.queue.draw(self.kernel, lens, &mut self.tiles, occluders, first, end);
        }
        hiding
    }

    /// Draws what waits.
    pub fn flush(&mut self) {
        if let Some(lens) = &self.lens {
            self.queue.flush(self.kernel, lens, &mut self.tiles);
        }
    }

    /// At most so many pixels show something of the box; 0 if it is hidden or outside of
    /// the image. A box that the near plane cuts shows everywhere.
    pub fn pixels(&mut self, b: &Box32) -> u32 {
        match self.screen.place(b) {
            Place::Outside => 0,
            Place::Near => self.settings.width_px * self.settings.height_px,
            Place::Rect(rect, nearness) => self.pixels_of_rect(rect, nearness),
        }
    }

    /// Whether anything of the box may show: [`DepthBuffer::pixels`] is not 0.
    pub fn shows(&mut self, b: &Box32) -> bool {
        match self.screen.place(b) {
            Place::Outside => false,
            Place::Near => true,
            Place::Rect(rect, nearness) => self.shows_rect(rect, nearness),
        }
    }

    /// At how many pixels of the rectangle something of this nearness may show.
    pub fn pixels_of_rect(&mut self, rect: Rect, nearness: f32) -> u32 {
        self.count(rect, nearness, false)
    }

    /// Whether something of this nearness may show in the rectangle.
    pub fn shows_rect(&mut self, rect: Rect, nearness: f32) -> bool {
        self.count(rect, nearness, true) != 0
    }

    fn count(&mut self, rect: Rect, nearness: f32, any: bool) -> u32 {
        self.flush();
        let rect = Rect { x1: rect.x1.min(self.settings.width_px), y1: rect.y1.min(self.settings.height_px), ..rect };
        if rect.x0 >= rect.x1 || rect.y0 >= rect.y1 {
            return 0;
        }
        let all = (rect.x1 - rect.x0) * (rect.y1 - rect.y0);
        let Some(lens) = &self.lens else { return all };
        // What is behind all that could ever hide it counts as just there.
        let key = if self.screen.perspective { nearness } else { f32_above(lens.key(f64::from(nearness))) };
        if key.is_nan() {
            return all;
        }
        // SAFETY: the rectangle lies in the image, and nobody else draws.
        unsafe { kernel::count(self.kernel, &self.tiles.view(lens.codes), rect, key.max(0.0), any) }
    }

    /// Lower bound of nearness, pixel by pixel, row-major from the top left; negative
    /// infinity where nothing was drawn.
    pub fn image(&mut self) -> Vec<f32> {
        self.flush();
        let codes = self.lens.as_ref().map_or_else(Default::default, |l| l.codes);
        self.tiles.image(codes).into_iter().map(|key| self.nearness(key)).collect()
    }

    /// A pyramid over all that was drawn; its finest texels are subtiles of 8 x 4 pixels.
    pub fn pyramid(&mut self) -> Pyramid {
        self.flush();
        let (across, down) = (self.settings.width_px.div_ceil(8), self.settings.height_px.div_ceil(4));
        let cell = |row, column| self.nearness(self.tiles.floors[self.tiles.index(column, row)]);
        let cells: Vec<f32> =
            (0..down).flat_map(|row| (0..across).map(move |column| (row, column))).map(|(r, c)| cell(r, c)).collect();
        Pyramid::over(&self.screen, [3, 2], &cells)
    }

    /// What a key of the tiles stands for; 0 is nothing.
    fn nearness(&self, key: f32) -> f32 {
        let ahead = self.lens.as_ref().map_or(0.0, |l| l.ahead);
        match key {
            0.0 => f32::NEG_INFINITY,
            _ if self.screen.perspective => key,
            _ => f32_below(f64::from(key) - ahead),
        }
    }

    pub fn bytes(&self) -> usize {
        self.tiles.bytes() + self.queue.bytes()
    }
}
