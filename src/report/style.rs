//! How a combination looks: the same colour, marker and dash in every chart.

use super::labels::Names;

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

/// Nobody looks up more markers than this.
const MOST_LISTED: usize = 16;

/// On and off lengths in pixels; empty is solid.
const DASHES: [&[f64]; 6] =
    [&[], &[7.0, 3.0], &[2.0, 2.5], &[9.0, 2.5, 2.0, 2.5], &[13.0, 4.0], &[6.0, 2.0, 2.0, 2.0, 2.0, 2.0]];

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
    fn nth(i: usize) -> Look {
        Look { colour: PALETTE[i % 7], shape: SHAPES[i % 6], dash: DASHES[i % 4] }
    }
}

#[derive(Debug, Clone)]
pub struct Entry {
    pub label: String,
    pub look: Look,
    /// Index in [`Legend::variants`].
    pub variant: usize,
}

/// The combinations of a study in the order of the matrix, with their looks.
#[derive(Debug, Clone, Default)]
pub struct Legend {
    pub entries: Vec<Entry>,
    /// Structures, with whatever else but culling sets combinations apart.
    pub variants: Vec<String>,
    pub cullings: Vec<String>,
    /// Colour means culling and shape means structure; else every combination
    /// has a look of its own, because there are too many of either.
    pub systematic: bool,
}

impl Legend {
    pub fn of(names: &[Names]) -> Legend {
        let mut legend = Legend::default();
        let at = |list: &mut Vec<String>, name: &str| match list.iter().position(|n| n == name) {
            Some(i) => i,
            None => {
                list.push(name.to_string());
                list.len() - 1
            }
        };
        let mut cells = Vec::new();
        for n in names {
            let variant = at(&mut legend.variants, &n.variant);
            let culling = at(&mut legend.cullings, &n.culling);
            if !legend.entries.iter().any(|e| e.label == n.combination) {
                let look = Look::nth(legend.entries.len());
                legend.entries.push(Entry { label: n.combination.clone(), look, variant });
                cells.push(culling);
            }
        }
        legend.systematic = legend.variants.len() <= SHAPES.len()
            && legend.cullings.iter().filter(|c| *c != IDLE).count() <= PALETTE.len();
        if legend.systematic {
            let colours: Vec<Colour> = legend.cullings.iter().map(|c| legend.culling_colour(c)).collect();
            for (entry, culling) in legend.entries.iter_mut().zip(cells) {
                let (shape, dash) = (SHAPES[entry.variant], DASHES[entry.variant]);
                entry.look = Look { colour: colours[culling], shape, dash };
            }
        }
        legend
    }

    /// Of the entries these alone, each with a look of its own: for charts that cannot show all.
    pub fn few(&self, keep: &[usize]) -> Legend {
        let look = |(i, c): (usize, &usize)| Entry { look: Look::nth(i), ..self.entries[*c].clone() };
        Legend { entries: keep.iter().enumerate().map(look).collect(), ..Legend::default() }
    }

    /// The kind of structure of an entry: its label up to the first parameter.
    pub fn family(label: &str) -> &str {
        label.split([':', ' ']).next().unwrap_or(label)
    }

    /// Families of these entries, each with a look of its own: for charts of more
    /// combinations than a reader tells apart.
    pub fn families(&self, keep: &[usize]) -> Legend {
        let mut legend = Legend::default();
        keep.iter().for_each(|c| legend.add(Legend::family(&self.entries[*c].label)));
        legend
    }

    /// More combinations than a legend can list.
    pub fn overflows(&self) -> bool {
        !self.systematic && self.entries.len() > MOST_LISTED
    }

    /// An entry with a look of its own, for what is no combination.
    pub fn add(&mut self, label: &str) {
        if !self.entries.iter().any(|e| e.label == label) {
            let look = Look::nth(self.entries.len());
            self.entries.push(Entry { label: label.into(), look, variant: 0 });
        }
    }

    /// Grey for whoever culls nothing, the palette for the rest in order.
    pub fn culling_colour(&self, culling: &str) -> Colour {
        if culling == IDLE {
            return MUTED;
        }
        let i = self.cullings.iter().filter(|c| *c != IDLE).position(|c| c == culling);
        PALETTE[i.unwrap_or(0) % PALETTE.len()]
    }

    pub fn variant_look(&self, variant: usize) -> Look {
        Look { colour: INK, shape: SHAPES[variant % SHAPES.len()], dash: DASHES[variant % DASHES.len()] }
    }

    pub fn look(&self, label: &str) -> Look {
        let found = self.entries.iter().find(|e| e.label == label);
        found.map_or(Look { colour: MUTED, shape: Shape::Circle, dash: &[] }, |e| e.look)
    }
}

/// Label of a culling sum without terms.
pub const IDLE: &str = "none";
