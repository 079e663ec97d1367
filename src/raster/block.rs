//! Triangles that are set up: 16 side by side, as structure of arrays.
//!
//! A row of samples of a triangle is one run of pixels, from the larger of two left bounds
//! to the smaller of two right bounds; each bound is linear in the row.

/// A vertex on the image.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[repr(C, align(16))]
pub struct Corner {
    /// In 1 / 65536 px; `i32::MIN` if it is before the near plane or far off the image.
    pub x: i32,
    pub y: i32,
    /// Nearness, or what stands for it (`vertices::Lens`), rounded to nearest.
    pub n: f32,
    /// On which sides of the image it lies: near 1, left 2, right 4, top 8, bottom 16.
    pub code: u32,
}

pub const OFF: i32 = i32::MIN;

pub const LANES: usize = 16;

/// Columns of a block. Bounds are in pixels from `X0`, at the row `Y0 & !3`, with the half
/// pixel that turns truncation into "the first sample beyond".
pub const LEFT: usize = 0;
pub const LEFT_STEP: usize = 1;
pub const LEFT2: usize = 2;
pub const LEFT2_STEP: usize = 3;
pub const RIGHT: usize = 4;
pub const RIGHT_STEP: usize = 5;
pub const RIGHT2: usize = 6;
pub const RIGHT2_STEP: usize = 7;
/// Pixels across, as f32.
pub const ACROSS: usize = 8;
/// Lower bound of nearness in the subtile at (`X0 & !31`, `Y0 & !3`), and what it grows by
/// from subtile to subtile across and down; never below `LEAST`.
pub const NEAR: usize = 9;
pub const NEAR_ACROSS: usize = 10;
pub const NEAR_DOWN: usize = 11;
pub const LEAST: usize = 12;
pub const COLUMNS: usize = 13;

#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C, align(64))]
pub struct Block {
    pub f: [[f32; LANES]; COLUMNS],
    /// Pixels `x0..x1`, rows `y0..y1`.
    pub x0: [i32; LANES],
    pub x1: [i32; LANES],
    pub y0: [i32; LANES],
    pub y1: [i32; LANES],
}

impl Block {
    pub const EMPTY: Block =
        Block { f: [[0.0; LANES]; COLUMNS], x0: [0; LANES], x1: [0; LANES], y0: [0; LANES], y1: [0; LANES] };
}
