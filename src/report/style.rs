//! How a combination looks: the same colour, marker and dash in every chart.

use crate::results::StudyResults;

/// 0xRRGGBB.
pub type Colour = u32;

pub const INK: Colour = 0x1F2430;
pub const MUTED: Colour = 0x667085;
pub const GRID: Colour = 0xE6E8EE;
pub const FRAME: Colour = 0xB4BAC6;
pub const PAPER: Colour = 0xFFFFFF;
/// Background of a cell without a usable value.
pub const SHADE: Colour = 0xF3F4F7;
/// Colour of "wrong" and "failed": marks and words, never colour alone.
pub const ALARM: Colour = 0xA4133C;

/// Okabe and Ito (2008), distinguishable with the common colour-vision
/// deficiencies. Their yellow is left out: it has no contrast on white.
pub const PALETTE: [Colour; 7] = [0x0072B2, 0xD55E00, 0x009E73, 0xCC79A7, 0xE69F00, 0x56B4E9, 0x000000];

/// What each colour becomes on a dark page, in the order light, dark.
pub const DARK: [(Colour, Colour); 14] = [
    (INK, 0xE8EAF0),
    (MUTED, 0x9AA3B5),
    (GRID, 0x2C3240),
    (FRAME, 0x566074),
    (PAPER, 0x171B24),
    (SHADE, 0x212735),
    (ALARM, 0xFF7A93),
    (0x0072B2, 0x4BA3E3),
    (0xD55E00, 0xFF8A3D),
    (0x009E73, 0x2CC295),
    (0xCC79A7, 0xE39BC4),
    (0xE69F00, 0xF2B632),
    (0x56B4E9, 0x8FD0F7),
    (0x000000, 0xFFFFFF),
];

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shape {
    Circle,
    Square,
    Diamond,
    Up,
    Down,
    Cross,
    /// A slanted cross: not the marker of any combination, but of what failed.
    Times,
}

const SHAPES: [Shape; 6] = [Shape::Circle, Shape::Square, Shape::Diamond, Shape::Up, Shape::Down, Shape::Cross];

/// On and off lengths in pixels; empty is solid.
const DASHES: [&[f64]; 4] = [&[], &[7.0, 3.0], &[2.0, 2.5], &[9.0, 2.5, 2.0, 2.5]];

/// Looks of one combination.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Look {
    pub colour: Colour,
    pub shape: Shape,
    pub dash: &'static [f64],
}

impl Look {
    /// 7 colours, 6 shapes and 4 dashes: 7 and 6 as well as 7 and 4 have no common
    /// divisor, so 28 combinations differ in lines and 42 in markers.
    pub fn nth(i: usize) -> Look {
        Look { colour: PALETTE[i % 7], shape: SHAPES[i % 6], dash: DASHES[i % 4] }
    }
}

/// The combinations of a study in the order of the matrix, with their looks.
#[derive(Debug, Clone)]
pub struct Legend {
    pub entries: Vec<(String, Look)>,
}

impl Legend {
    pub fn of(results: &StudyResults) -> Legend {
        let mut legend = Legend { entries: Vec::new() };
        for run in &results.runs {
            let label = super::labels::combination(results, run);
            if !legend.entries.iter().any(|(l, _)| *l == label) {
                let look = Look::nth(legend.entries.len());
                legend.entries.push((label, look));
            }
        }
        legend
    }

    pub fn look(&self, label: &str) -> Look {
        let found = self.entries.iter().find(|(l, _)| l == label);
        found.map_or(Look { colour: MUTED, shape: Shape::Circle, dash: &[] }, |(_, look)| *look)
    }
}
