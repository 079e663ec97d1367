//! The buffer: subtiles of 8 x 4 pixels in strips of 32 columns, a strip's rows of four
//! subtiles one after another.
//!
//! A subtile keeps, of Hasselgren, Andersson & Akenine-Moeller 2016 ("Masked Software
//! Occlusion Culling"), the nearness that all of its pixels reach (`floor`) and a mask of those
//! that a working layer covers. Where they keep one nearness for all of the mask and
//! throw a layer away when two do not suffice, we keep a 16-bit one for each pixel (a `line`),
//! which is one AVX-512 register. Lines are touched only at outlines of
//! occluders and valid only under the mask, so nothing clears them. When the mask
//! is full its least pixel becomes the floor, and what is not above it leaves the mask.

use super::code::Codes;
use super::lanes::Lanes;
use super::project::Rect;

pub const LINE: usize = 32;

#[derive(Debug, Clone, Copy)]
#[repr(C, align(64))]
pub struct Line(pub [u16; LINE]);

#[derive(Debug, Clone)]
pub struct Tiles {
    pub width: u32,
    pub height: u32,
    pub strips: usize,
    /// Subtiles of a strip; three rows are spare, so that wide loads may start at the last one.
    pub per_strip: usize,
    pub floors: Vec<f32>,
    pub known: Vec<u32>,
    pub lines: Vec<Line>,
}

impl Tiles {
    pub fn new(width: u32, height: u32) -> Tiles {
        let strips = width.div_ceil(32) as usize;
        let per_strip = (height.div_ceil(4) as usize + 3) * 4;
        let count = strips * per_strip;
        let line = Line([0; LINE]);
        let mut t = Tiles {
            width,
            height,
            strips,
            per_strip,
            floors: vec![0.0; count],
            known: vec![0; count],
            lines: vec![line; count],
        };
        t.clear();
        t
    }

    pub fn clear(&mut self) {
        self.floors.fill(0.0);
        self.known.fill(0);
        // Pixels beyond the image count as covered, or the subtiles at its edges never were.
        let edge_x = (!self.width.is_multiple_of(8)).then_some(self.width / 8);
        let edge_y = (!self.height.is_multiple_of(4)).then_some(self.height / 4);
        let (across, down) = (self.width.div_ceil(8), self.height.div_ceil(4));
        if let Some(c) = edge_x {
            (0..down).for_each(|r| self.close(c, r));
        }
        if let Some(r) = edge_y {
            (0..across).for_each(|c| self.close(c, r));
        }
    }

    fn close(&mut self, column: u32, row: u32) {
        let i = self.index(column, row);
        let beyond = |p: u32| column * 8 + p % 8 >= self.width || row * 4 + p / 8 >= self.height;
        self.known[i] = (0..32).map(|p| u32::from(beyond(p)) << p).sum();
        self.lines[i] = Line(std::array::from_fn(|p| if beyond(p as u32) { u16::MAX } else { 0 }));
    }

    /// Of the subtile at a column and a row of subtiles.
    pub fn index(&self, column: u32, row: u32) -> usize {
        (column / 4) as usize * self.per_strip + (row * 4 + column % 4) as usize
    }

    pub fn view(&mut self, codes: Codes) -> TilesView {
        TilesView {
            floors: self.floors.as_mut_ptr(),
            known: self.known.as_mut_ptr(),
            lines: self.lines.as_mut_ptr(),
            per_strip: self.per_strip,
            codes,
        }
    }

    /// Nearness pixel by pixel, 0 where nothing was drawn.
    pub fn image(&self, codes: Codes) -> Vec<f32> {
        let at = |x: u32, y: u32| {
            let (i, p) = (self.index(x / 8, y / 4), y % 4 * 8 + x % 8);
            let line = if self.known[i] >> p & 1 == 0 { 0 } else { self.lines[i].0[p as usize] };
            codes.value(line).max(self.floors[i])
        };
        (0..self.height).flat_map(|y| (0..self.width).map(move |x| at(x, y))).collect()
    }

    pub fn bytes(&self) -> usize {
        self.floors.len() * (8 + size_of::<Line>())
    }
}

/// A buffer that threads may share strip by strip.
#[derive(Debug, Clone, Copy)]
pub struct TilesView {
    pub floors: *mut f32,
    pub known: *mut u32,
    pub lines: *mut Line,
    pub per_strip: usize,
    pub codes: Codes,
}

// SAFETY: whoever shares views sees to it that threads write to different strips.
unsafe impl Send for TilesView {}
// SAFETY: as above.
unsafe impl Sync for TilesView {}

impl TilesView {
    /// Prefetches the first two by two subtiles of a rectangle.
    ///
    /// # Safety
    /// The kernel's features are there.
    #[inline(always)]
    pub unsafe fn prefetch<L: Lanes>(&self, x0: i32, y0: i32) {
        let at = (x0 >> 5) as usize * self.per_strip + (y0 as usize & !3) + (x0 as usize >> 3 & 3);
        // SAFETY: only addresses are made, and they may be wrong.
        unsafe {
            L::prefetch(self.lines.wrapping_add(at));
            L::prefetch(self.lines.wrapping_add(at + 1));
            L::prefetch(self.lines.wrapping_add(at + 4));
            L::prefetch(self.lines.wrapping_add(at + 5));
            L::prefetch(self.floors.wrapping_add(at));
            L::prefetch(self.known.wrapping_add(at));
        }
    }

    /// Raises N rows of a strip, from the row of subtiles `y / 4` on, to `z` at pixels `from..to`
    /// less `skipped`.
    ///
    /// # Safety
    /// The strip is one of the view's, `y` a row of the image; the kernel's features are there.
    #[inline(always)]
    pub unsafe fn raise<L: Lanes>(&self, strip: i32, y: i32, from: L::I, to: L::I, skipped: i32, z: L::F) {
        // SAFETY: as the caller promises; rows past the image are spare.
        unsafe {
            let at = strip as usize * self.per_strip + (y as usize & !3);
            let floors = self.floors.add(at);
            let floor = L::load_f(floors);
            let nearer = L::bits(L::gt(z, floor));
            if nearer == 0 {
                return;
            }
            let skipped = L::i(skipped);
            let cover = L::to_subtiles(L::run(L::sub_i(from, skipped), L::sub_i(to, skipped)));
            let nearer = nearer & !L::bits(L::eq_i(cover, L::i(0)));
            if nearer == 0 {
                return;
            }
            let full = nearer & L::bits(L::eq_i(cover, L::i(-1)));
            if full != 0 {
                L::store_f(floors, L::pick_f(L::mask(full), z, floor));
            }
            let mut part = nearer & !full;
            if part == 0 {
                return;
            }
            let (mut covers, mut codes) = ([0u32; 16], [0u32; 16]);
            L::store_i(covers.as_mut_ptr().cast(), cover);
            L::store_i(codes.as_mut_ptr().cast(), L::codes(z, self.codes));
            while part != 0 {
                let i = part.trailing_zeros() as usize & 15;
                part &= part - 1;
                let (line, known) = (self.lines.add(at + i).cast::<u16>(), self.known.add(at + i));
                let least = L::raise(line, *known, covers[i], codes[i] as u16);
                *known |= covers[i];
                if *known == !0 {
                    self.settle::<L>(at + i, least);
                }
            }
        }
    }

    /// All pixels of a subtile are known to be at `least` or above it.
    #[inline(always)]
    unsafe fn settle<L: Lanes>(&self, i: usize, least: u16) {
        // SAFETY: as the caller promises.
        unsafe {
            let (floor, reached) = (self.floors.add(i), self.codes.value(least));
            if reached > *floor {
                *floor = reached;
            }
            *self.known.add(i) = L::above(self.lines.add(i).cast(), self.codes.of(*floor));
        }
    }

    /// Raises a strip to what another buffer of the same image holds.
    ///
    /// # Safety
    /// Nobody else uses this strip of either; the kernel's features are there.
    #[inline(always)]
    pub unsafe fn join<L: Lanes>(&self, other: &TilesView, strip: usize) {
        for i in strip * self.per_strip..(strip + 1) * self.per_strip {
            // SAFETY: as the caller promises.
            unsafe {
                if *other.floors.add(i) > *self.floors.add(i) {
                    *self.floors.add(i) = *other.floors.add(i);
                }
                let (known, more) = (*self.known.add(i), *other.known.add(i));
                if more != 0 {
                    let least = L::join(self.lines.add(i).cast(), known, other.lines.add(i).cast(), more);
                    *self.known.add(i) = known | more;
                    if known | more == !0 {
                        self.settle::<L>(i, least);
                    }
                }
            }
        }
    }

    /// How many pixels of the rectangle are not nearer than `nearness`; if `any`, 1 as soon
    /// as there is one.
    ///
    /// # Safety
    /// The rectangle lies in the image; the kernel's features are there.
    #[inline(always)]
    pub unsafe fn count<L: Lanes>(&self, r: Rect, nearness: f32, any: bool) -> u32 {
        let code = self.codes.of(nearness);
        let mut shown = 0;
        for strip in r.x0 / 32..=(r.x1 - 1) / 32 {
            let columns = between(r.x0.max(strip * 32) - strip * 32, r.x1.min(strip * 32 + 32) - strip * 32);
            let touched = (0..4).fold(0, |t, c| t | u32::from(columns >> (8 * c) & 0xff != 0) << c) * 0x1111;
            let mut y = r.y0 & !3;
            while y < r.y1 {
                let at = strip as usize * self.per_strip + y as usize;
                // Four at once, as long as nothing is open.
                if y + 4 * L::N as u32 <= r.y1 {
                    // SAFETY: as the caller promises.
                    let open = unsafe {
                        let floor = |i: usize| L::load_f(self.floors.add(at + i * L::N));
                        let least = L::min(L::min(floor(0), floor(1)), L::min(floor(2), floor(3)));
                        L::bits(L::ge(L::f(nearness), least))
                    };
                    if open & touched == 0 {
                        y += 4 * L::N as u32;
                        continue;
                    }
                }
                let rows = (r.y1 - y).div_ceil(4).min(L::N as u32 / 4);
                // SAFETY: as the caller promises; rows past the image are spare.
                let open = unsafe { L::bits(L::ge(L::f(nearness), L::load_f(self.floors.add(at)))) };
                let mut open = open & touched & between(0, rows * 4);
                while open != 0 {
                    let i = open.trailing_zeros();
                    open &= open - 1;
                    let top = y + i / 4 * 4;
                    let rows = between((r.y0.max(top) - top) * 8, (r.y1.min(top + 4) - top) * 8);
                    let wanted = ((columns >> (8 * (i % 4)) & 0xff) * 0x0101_0101) & rows;
                    // SAFETY: as above; a line is read under its mask only.
                    let hidden = unsafe {
                        let known = *self.known.add(at + i as usize);
                        if known == 0 { 0 } else { known & L::above(self.lines.add(at + i as usize).cast(), code) }
                    };
                    let open = (wanted & !hidden).count_ones();
                    if any && open != 0 {
                        return 1;
                    }
                    shown += open;
                }
                y += L::N as u32;
            }
        }
        shown
    }
}

/// Bits `from..to`.
#[inline(always)]
pub fn between(from: u32, to: u32) -> u32 {
    let below = |n: u32| ((1u64 << n) - 1) as u32;
    below(to) & !below(from)
}
