//! Depth of occluders, and whether a box shows behind them.
//!
//! A [`DepthBuffer`] holds, for every pixel of an image of its own size, how near the
//! occluders drawn so far are, never nearer than they truly are. *Nearness* grows towards
//! the eye: `1 / depth` for perspective cameras, `-depth` for parallel rays; both are
//! linear on the image plane. Pixel (0, 0) is at the top left; a sample is a pixel's centre.
//!
//! What a query answers is an upper bound: a box of which it says 0 pixels shows at no
//! sample ([`Coverage::Samples`]), or nowhere at all ([`Coverage::Inner`]).

pub mod items;
pub mod occluders;
pub mod plain;
pub mod project;

pub use occluders::{Kind, Occluders};

use crate::math::{Box32, DVec3, View};
use project::{Place, Screen};

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

pub struct DepthBuffer {
    settings: Settings,
    screen: Screen,
    plain: plain::Plain,
}

impl DepthBuffer {
    pub fn new(settings: Settings) -> DepthBuffer {
        DepthBuffer { settings, screen: Screen::default(), plain: plain::Plain::new(settings) }
    }

    pub fn settings(&self) -> Settings {
        self.settings
    }

    /// Starts an image: nothing hides anything. `origin` is that of occluders and boxes.
    pub fn begin(&mut self, view: &View, origin: DVec3) {
        self.screen = Screen::new(view, origin, self.settings);
        self.plain.clear();
    }

    /// Draws the occluders at positions `first..end`; returns how many triangles that are.
    /// Later queries see them.
    pub fn draw(&mut self, occluders: &Occluders, first: u32, end: u32) -> u32 {
        self.plain.draw(&self.screen, occluders, first, end)
    }

    /// At most so many pixels show something of the box; 0 if it is hidden or outside of
    /// the image. A box that the near plane cuts shows everywhere.
    pub fn pixels(&mut self, b: &Box32) -> u32 {
        match self.screen.place(b) {
            Place::Outside => 0,
            Place::Near => self.settings.width_px * self.settings.height_px,
            Place::Rect(rect, nearness) => self.plain.pixels(rect, nearness),
        }
    }

    /// Whether anything of the box may show: [`DepthBuffer::pixels`] is not 0.
    pub fn shows(&mut self, b: &Box32) -> bool {
        match self.screen.place(b) {
            Place::Outside => false,
            Place::Near => true,
            Place::Rect(rect, nearness) => self.plain.shows(rect, nearness),
        }
    }

    /// Lower bound of nearness, pixel by pixel, row-major from the top left; negative
    /// infinity where nothing was drawn.
    pub fn image(&mut self) -> Vec<f32> {
        self.plain.image().to_vec()
    }

    pub fn bytes(&self) -> usize {
        size_of_val(self.plain.image())
    }
}
