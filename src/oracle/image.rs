//! Item images: the triangle that every sample sees, run-length coded by tile.
//!
//! A tile is a square of whole pixels, about 64 samples wide, so that an image
//! of any resolution is made, stored and read one small piece at a time.

use crate::record::Accuracy;
use serde::{Deserialize, Serialize};

/// Nothing was hit.
pub const BACKGROUND: u32 = 0;
/// As an alternate: three or more surfaces lie at the same depth, so that this
/// sample proves nothing.
pub const ANY: u32 = u32::MAX;

/// How a frame is cut into samples and tiles.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Grid {
    pub width_px: u32,
    pub height_px: u32,
    /// s x s samples a pixel, in a regular sub-grid.
    pub samples: u32,
}

/// Sample coordinates, half-open: columns `x0..x1`, rows `y0..y1` from the top.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TileRect {
    pub x0: u32,
    pub y0: u32,
    pub x1: u32,
    pub y1: u32,
}

impl TileRect {
    pub fn width(&self) -> usize {
        (self.x1 - self.x0) as usize
    }

    pub fn height(&self) -> usize {
        (self.y1 - self.y0) as usize
    }
}

impl Grid {
    /// The samples that `accuracy` asks for.
    pub fn of(accuracy: &Accuracy) -> Grid {
        Grid { width_px: accuracy.width_px, height_px: accuracy.height_px, samples: accuracy.samples }
    }

    pub fn columns(&self) -> u32 {
        self.width_px * self.samples
    }

    pub fn rows(&self) -> u32 {
        self.height_px * self.samples
    }

    /// Samples along a side of a full tile.
    pub fn tile_side(&self) -> u32 {
        (64 / self.samples).max(1) * self.samples
    }

    pub fn tiles_across(&self) -> u32 {
        self.columns().div_ceil(self.tile_side())
    }

    pub fn tile_count(&self) -> u32 {
        self.tiles_across() * self.rows().div_ceil(self.tile_side())
    }

    pub fn tile(&self, index: u32) -> TileRect {
        let side = self.tile_side();
        let (x0, y0) = (index % self.tiles_across() * side, index / self.tiles_across() * side);
        TileRect { x0, y0, x1: (x0 + side).min(self.columns()), y1: (y0 + side).min(self.rows()) }
    }

    /// Tile of a sample, and its index there, row-major.
    #[inline]
    pub fn place(&self, x: u32, y: u32) -> (u32, u32) {
        let side = self.tile_side();
        let (i, j) = (x / side, y / side);
        let width = side.min(self.columns() - i * side);
        (j * self.tiles_across() + i, (y - j * side) * width + x - i * side)
    }

    /// Pixel index of a sample.
    pub fn pixel(&self, x: u32, y: u32) -> usize {
        (y / self.samples * self.width_px + x / self.samples) as usize
    }
}

/// A stretch of samples in one row that see the same. Ids are triangle + 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Run {
    pub x: u32,
    pub y: u32,
    pub len: u32,
    /// Id of the nearest triangle that hides; the smallest among equally near ones. [`BACKGROUND`] if none.
    pub winner: u32,
    /// Id of another triangle at the same depth within rounding; [`BACKGROUND`] if none, or [`ANY`].
    pub alternate: u32,
}

/// A stretch of samples in one row that see a triangle which does not hide what
/// is behind it (an alpha-masked leaf, a pane).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Veil {
    pub x: u32,
    pub y: u32,
    pub len: u32,
    /// Triangle + 1.
    pub id: u32,
}

/// One tile: `(winner, alternate)` runs in row-major order of the tile, coded.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct TileRuns {
    coded: Vec<u8>,
    pub veils: Vec<Veil>,
}

impl TileRuns {
    /// Codes the samples of a tile; both slices are row-major and as long as the tile.
    pub fn encode(winners: &[u32], alternates: &[u32]) -> TileRuns {
        let mut coded = Vec::new();
        let mut previous = 0u32;
        let mut at = 0;
        while at < winners.len() {
            let (winner, alternate) = (winners[at], alternates[at]);
            let same = |i: &usize| winners[*i] == winner && alternates[*i] == alternate;
            let len = (at..winners.len()).take_while(same).count();
            // Neighbouring runs hold neighbouring ids, and alternates are rare:
            // the difference to the last id and one flag bit keep a run short.
            let step = i64::from(winner) - i64::from(previous);
            put(&mut coded, (step << 1 ^ step >> 63) as u64);
            put(&mut coded, (len as u64) << 1 | u64::from(alternate != BACKGROUND));
            if alternate != BACKGROUND {
                put(&mut coded, u64::from(alternate));
            }
            previous = winner;
            at += len;
        }
        TileRuns { coded, veils: Vec::new() }
    }

    /// The runs of the tile at `rect`, cut at the ends of rows.
    ///
    /// # Panics
    /// If the code is not one that [`TileRuns::encode`] wrote for `rect`.
    pub fn for_each(&self, rect: TileRect, mut visit: impl FnMut(Run)) {
        let (mut coded, mut previous) = (&self.coded[..], 0i64);
        let (mut x, mut y) = (rect.x0, rect.y0);
        while !coded.is_empty() {
            let step = get(&mut coded);
            previous += (step >> 1) as i64 ^ -((step & 1) as i64);
            let head = get(&mut coded);
            let alternate = if head & 1 == 1 { get(&mut coded) as u32 } else { BACKGROUND };
            let mut len = (head >> 1) as u32;
            while len > 0 {
                let here = len.min(rect.x1 - x);
                visit(Run { x, y, len: here, winner: previous as u32, alternate });
                len -= here;
                x += here;
                if x == rect.x1 {
                    (x, y) = (rect.x0, y + 1);
                }
            }
        }
        assert!((x, y) == (rect.x0, rect.y1), "runs fill the tile");
    }

    pub fn bytes(&self) -> usize {
        self.coded.len() + size_of_val(&self.veils[..])
    }
}

/// LEB128.
fn put(out: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}

fn get(from: &mut &[u8]) -> u64 {
    let mut value = 0;
    for shift in (0..64).step_by(7) {
        let (byte, rest) = from.split_first().expect("a number ends inside its code");
        *from = rest;
        value |= u64::from(byte & 0x7f) << shift;
        if byte & 0x80 == 0 {
            break;
        }
    }
    value
}

/// Codes a sequence of bytes with long repetitions.
pub(super) fn encode_bytes(bytes: impl Iterator<Item = u8>) -> Vec<u8> {
    let mut coded = Vec::new();
    let mut run: Option<(u8, u64)> = None;
    for byte in bytes {
        match &mut run {
            Some((value, len)) if *value == byte => *len += 1,
            _ => {
                if let Some((value, len)) = run.replace((byte, 1)) {
                    coded.push(value);
                    put(&mut coded, len);
                }
            }
        }
    }
    if let Some((value, len)) = run {
        coded.push(value);
        put(&mut coded, len);
    }
    coded
}

/// Runs of [`encode_bytes`]: value and length.
pub(super) fn decode_bytes(mut coded: &[u8]) -> impl Iterator<Item = (u8, usize)> + '_ {
    std::iter::from_fn(move || {
        let (value, rest) = coded.split_first()?;
        coded = rest;
        Some((*value, get(&mut coded) as usize))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_tile_reads_back(
            cells in proptest::collection::vec((0u32..4, 0u32..3), 35),
            base in prop_oneof![Just(0), Just(u32::MAX - 8)],
        ) {
            let rect = TileRect { x0: 10, y0: 20, x1: 17, y1: 25 };
            let winners: Vec<u32> = cells.iter().map(|c| base + c.0).collect();
            let alternates: Vec<u32> = cells.iter().map(|c| if c.1 == 2 { ANY } else { c.1 }).collect();
            let (mut w, mut a) = (Vec::new(), Vec::new());
            TileRuns::encode(&winners, &alternates).for_each(rect, |r| {
                assert_eq!(((r.y - 20) * 7 + r.x - 10) as usize, w.len());
                w.extend(std::iter::repeat_n(r.winner, r.len as usize));
                a.extend(std::iter::repeat_n(r.alternate, r.len as usize));
            });
            prop_assert_eq!(w, winners);
            prop_assert_eq!(a, alternates);
        }

        #[test]
        fn bytes_read_back(bytes in proptest::collection::vec(0u8..3, 0..60)) {
            let coded = encode_bytes(bytes.iter().copied());
            let back: Vec<u8> = decode_bytes(&coded).flat_map(|(b, n)| std::iter::repeat_n(b, n)).collect();
            prop_assert_eq!(back, bytes);
        }
    }

    #[test]
    fn tiles_cover_every_sample_once() {
        for (width_px, height_px, samples) in [(960, 540, 2), (65, 3, 1), (7, 9, 3), (5, 5, 100)] {
            let grid = Grid { width_px, height_px, samples };
            let area: usize = (0..grid.tile_count()).map(|t| grid.tile(t).width() * grid.tile(t).height()).sum();
            assert_eq!(area, (grid.columns() * grid.rows()) as usize);
            assert_eq!(grid.tile_side() % samples, 0, "tiles are whole pixels");
        }
    }
}
