//! One tile of the item buffer: triangles against samples.
//!
//! Of the triangles inside which a sample lies, within the clip range, the
//! nearest has key B. The sample sees every one whose key exceeds B less the
//! [`TIE`]; `winner` is the smallest id of these, `alternate` the other of two,
//! or [`ANY`]. That does not depend on the order of drawing, so triangles come in
//! whatever order is quick: nearest first, and single samples last.

use super::footprint::{Footprint, Lens};
use super::image::{ANY, BACKGROUND, TileRect, TileRuns, Veil};
use super::lanes::{Kernel, LANES, Lanes, Plain};
use super::set_up::Speck;

/// Depth keys closer than this share of each other are equal: far above the
/// rounding of the key (about 1e-14 unless the triangle is a sliver), far below
/// any distance a picture could show (10 nm at 10 m).
pub const TIE: f64 = 1.0 / (1u64 << 30) as f64;

/// Rows no wider than this are tested sample by sample rather than cut by edges.
const NARROW: usize = 16;

/// What a tile draws: footprints that touch it, and samples already found.
pub struct Content<'a, I: Iterator<Item = &'a Footprint>> {
    pub footprints: I,
    pub specks: &'a [Speck],
}

/// Buffers of one tile, kept between tiles of a thread.
#[derive(Default)]
pub struct Tile<'a> {
    rect: Option<TileRect>,
    xs: Vec<f64>,
    ys: Vec<f64>,
    /// Nearest key so far; minus infinity while nothing is hit.
    best: Vec<f64>,
    /// What a key must exceed to matter: see [`gate_of`].
    gate: Vec<f64>,
    winner: Vec<u32>,
    alternate: Vec<u32>,
    /// Least key among equals; meaningful where there is an alternate.
    low: Vec<f64>,
    /// Samples where equals turned out not to be equal to the nearest.
    contested: Vec<u32>,
    /// Farthest first in key: rank by nearest point, and place in `footprints`.
    order: Vec<u64>,
    footprints: Vec<&'a Footprint>,
}

/// A key above this is at least equal to `key`; keys beyond the far plane never are.
#[inline(always)]
fn gate_of(key: f64, far_gate: f64) -> f64 {
    let gate = key - TIE * key.abs();
    if gate > far_gate { gate } else { far_gate }
}

impl<'a> Tile<'a> {
    pub fn draw<I>(&mut self, kernel: Kernel, lens: &Lens, rect: TileRect, content: Content<'a, I>) -> TileRuns
    where
        I: Iterator<Item = &'a Footprint>,
    {
        self.start(lens, rect);
        self.footprints.clear();
        self.footprints.extend(content.footprints);
        match kernel {
            #[cfg(target_arch = "x86_64")]
            // SAFETY: `Kernel::Avx2` is given only where the processor has it.
            Kernel::Avx2 => unsafe { self.draw_occluders_avx2(lens) },
            _ => self.draw_occluders::<Plain>(lens),
        }
        let (key_near, far_gate) = (lens.key_near, lens.key_far.next_down());
        for s in content.specks {
            if s.key > self.gate[s.at as usize] {
                self.take(key_near, far_gate, s.at as usize, s.id, s.key);
            }
        }
        self.settle(far_gate, key_near, content.specks);
        let mut runs = TileRuns::encode(&self.winner, &self.alternate);
        for i in 0..self.footprints.len() {
            if !self.footprints[i].occluder {
                self.draw_veil(lens, self.footprints[i], &mut runs.veils);
            }
        }
        runs.veils.sort_unstable_by_key(|v| (v.id, v.y, v.x));
        runs
    }

    fn start(&mut self, lens: &Lens, rect: TileRect) {
        let size = rect.width() * rect.height();
        self.rect = Some(rect);
        // Blocks of lanes may run over the end of a row, and of the tile.
        let padding = [f64::NAN; LANES];
        for (to, from) in [
            (&mut self.xs, &lens.xs[rect.x0 as usize..rect.x1 as usize]),
            (&mut self.ys, &lens.ys[rect.y0 as usize..rect.y1 as usize]),
        ] {
            to.clear();
            to.extend_from_slice(from);
            to.extend_from_slice(&padding);
        }
        // What is as far as the far plane is still in: the gate lets it pass.
        for (buffer, value) in [(&mut self.best, f64::NEG_INFINITY), (&mut self.gate, lens.key_far.next_down())] {
            buffer.clear();
            buffer.resize(size + LANES, value);
        }
        self.low.resize(size, 0.0);
        for buffer in [&mut self.winner, &mut self.alternate] {
            buffer.clear();
            buffer.resize(size, BACKGROUND);
        }
        self.contested.clear();
    }

    fn rect(&self) -> TileRect {
        self.rect.expect("started")
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn draw_occluders_avx2(&mut self, lens: &Lens) {
        self.draw_occluders::<super::lanes::Avx2>(lens);
    }

    #[inline(always)]
    fn draw_occluders<L: Lanes>(&mut self, lens: &Lens) {
        let rect = self.rect();
        let (width, height) = (rect.width(), rect.height());
        let (across, down) = ([self.xs[0], self.xs[width - 1]], [self.ys[height - 1], self.ys[0]]);
        self.order.clear();
        for (place, f) in (0u64..).zip(&self.footprints) {
            if f.occluder {
                // Nearest first; keys that agree as f32 in the order of triangles.
                self.order.push(rank(f.key_max_in(across, down)) << 32 | place);
            }
        }
        self.order.sort_unstable();
        let mut drawn_area = 0;
        for i in 0..self.order.len() {
            let f = self.footprints[self.order[i] as u32 as usize];
            if drawn_area >= width * height {
                // All that follows is farther still.
                let farthest = farthest::<L>(&self.gate[..width * height]);
                if nearest_of_rank(self.order[i] >> 32) <= farthest {
                    break;
                }
                drawn_area = 0;
            }
            drawn_area += self.draw_occluder::<L>(lens, rect, f);
        }
    }

    /// Returns the work done in samples, to decide when asking for the farthest
    /// key is worth it.
    #[inline(always)]
    fn draw_occluder<L: Lanes>(&mut self, lens: &Lens, rect: TileRect, f: &Footprint) -> usize {
        let width = rect.width();
        let first = (f.x0.max(rect.x0) - rect.x0) as usize;
        let end = (f.x1 + 1).min(rect.x1).saturating_sub(rect.x0) as usize;
        if first >= end {
            return 0;
        }
        let narrow = end - first <= NARROW;
        let mut work = 0;
        for y in f.y0.max(rect.y0)..(f.y1 + 1).min(rect.y1) {
            let row = (y - rect.y0) as usize;
            let at_y = self.ys[row];
            let key_row = f.key_row(at_y);
            let (mut from, mut to) = (first, end);
            if !narrow {
                let (a, b) = f.span(&self.xs[first..end], at_y, lens.per_step[0]);
                (from, to) = (first + a, first + b);
            }
            work += to - from;
            let mut x = from;
            while x < to {
                let at = row * width + x;
                let xs = L::load(&self.xs[x..]);
                let mut inside = if to - x >= LANES { 15 } else { (1 << (to - x)) - 1 };
                let key = L::splat(f.key[0]) * xs + L::splat(key_row);
                let key = key.max(L::splat(f.key_min)).min(L::splat(f.key_max));
                inside &= key.gt(L::load(&self.gate[at..]));
                if narrow && inside != 0 {
                    for k in 0..3 {
                        let [cx, cy, c] = f.edges[k];
                        let value = L::splat(cx) * xs + L::splat(at_y * cy + c);
                        inside &= value.ge(L::splat(f.threshold(k)));
                    }
                }
                if inside != 0 {
                    self.take_lanes::<L>(lens, at, inside, f.id, key);
                }
                x += LANES;
            }
        }
        work
    }

    /// Lanes of `inside`, whose keys passed the gate.
    #[inline(always)]
    fn take_lanes<L: Lanes>(&mut self, lens: &Lens, at: usize, inside: u32, id: u32, key: L) {
        let far_gate = lens.key_far.next_down();
        if inside == 15 {
            let gate = (key - L::splat(TIE) * key.abs()).max(L::splat(far_gate));
            let best = L::load(&self.best[at..]);
            if gate.ge(best) & L::splat(lens.key_near).ge(key) == 15 {
                key.store(&mut self.best[at..]);
                gate.store(&mut self.gate[at..]);
                self.winner[at..at + LANES].fill(id);
                self.alternate[at..at + LANES].fill(BACKGROUND);
                return;
            }
        }
        let mut keys = [0.0; LANES];
        key.store(&mut keys);
        let mut rest = inside;
        while rest != 0 {
            let i = rest.trailing_zeros() as usize;
            rest &= rest - 1;
            self.take(lens.key_near, far_gate, at + i, id, keys[i]);
        }
    }

    /// A sample whose key passed the gate.
    #[inline]
    fn take(&mut self, key_near: f64, far_gate: f64, at: usize, id: u32, key: f64) {
        if key > key_near {
            return;
        }
        let (best, gate) = (self.best[at], gate_of(key, far_gate));
        if best <= gate {
            (self.winner[at], self.alternate[at], self.best[at], self.gate[at]) = (id, BACKGROUND, key, gate);
            return;
        }
        let (winner, alternate) = (self.winner[at], self.alternate[at]);
        self.low[at] = key.min(if alternate == BACKGROUND { best } else { self.low[at] });
        self.alternate[at] = if alternate == BACKGROUND { winner.max(id) } else { ANY };
        self.winner[at] = winner.min(id);
        self.best[at] = best.max(key);
        self.gate[at] = gate_of(self.best[at], far_gate);
        // A chain: equal to one another link by link, but not to the nearest.
        if self.low[at] <= self.gate[at] {
            self.contested.push(at as u32);
        }
    }

    /// Finds anew who is equal to the nearest where a chain made it doubtful.
    fn settle(&mut self, far_gate: f64, key_near: f64, specks: &[Speck]) {
        let mut contested = std::mem::take(&mut self.contested);
        contested.sort_unstable();
        contested.dedup();
        let (rect, width) = (self.rect(), self.rect().width());
        for &at in &contested {
            let place = at as usize;
            let gate = gate_of(self.best[place], far_gate);
            let (row, column) = (place / width, place % width);
            let (x, y) = (rect.x0 + column as u32, rect.y0 + row as u32);
            let at_plane = [self.xs[column], self.ys[row]];
            let touches = |f: &&&Footprint| {
                f.occluder && (f.x0..=f.x1).contains(&x) && (f.y0..=f.y1).contains(&y) && f.inside(at_plane)
            };
            let of_footprints = self.footprints.iter().filter(touches);
            let keys = of_footprints.map(|f| (f.id, f.key_at(at_plane[0], f.key_row(at_plane[1]))));
            let of_specks = specks.iter().filter(|s| s.at == at).map(|s| (s.id, s.key));
            let (mut winner, mut alternate) = (BACKGROUND, BACKGROUND);
            for (id, _) in keys.chain(of_specks).filter(|(_, key)| *key > gate && *key <= key_near) {
                (winner, alternate) = match (winner, alternate) {
                    (BACKGROUND, _) => (id, BACKGROUND),
                    (w, BACKGROUND) => (w.min(id), w.max(id)),
                    (w, _) => (w.min(id), ANY),
                };
            }
            (self.winner[place], self.alternate[place]) = (winner, alternate);
        }
        self.contested = contested;
    }

    fn draw_veil(&self, lens: &Lens, f: &Footprint, veils: &mut Vec<Veil>) {
        let rect = self.rect();
        let first = (f.x0.max(rect.x0) - rect.x0) as usize;
        let end = (f.x1 + 1).min(rect.x1).saturating_sub(rect.x0) as usize;
        for y in f.y0.max(rect.y0)..(f.y1 + 1).min(rect.y1) {
            let row = (y - rect.y0) as usize;
            let (a, b) = f.span(&self.xs[first..end], self.ys[row], lens.per_step[0]);
            let key_row = f.key_row(self.ys[row]);
            let seen = |x: usize| {
                let (at, key) = (row * rect.width() + x, f.key_at(self.xs[x], key_row));
                let best = self.best[at];
                // Strictly in front: on a decal's own wall either may be what is seen.
                let in_front =
                    if self.winner[at] == BACKGROUND { key >= lens.key_far } else { key > best + TIE * best.abs() };
                in_front && key <= lens.key_near
            };
            let (mut x, end) = (first + a, first + b);
            while x < end {
                let len = (x..end).take_while(|x| seen(*x)).count();
                if len > 0 {
                    veils.push(Veil { x: rect.x0 + x as u32, y, len: len as u32, id: f.id });
                }
                x += len + 1;
            }
        }
    }
}

/// Orders keys as f32, the greatest first.
fn rank(key: f64) -> u64 {
    let bits = (key as f32).to_bits();
    // Ascending order of floats as whole numbers: flip negative ones.
    let ascending = if bits >> 31 == 1 { !bits } else { bits | 1 << 31 };
    u64::from(!ascending)
}

/// No key of this rank, or of a later one, is greater.
fn nearest_of_rank(rank: u64) -> f64 {
    let ascending = !(rank as u32);
    let bits = if ascending >> 31 == 1 { ascending & !(1 << 31) } else { !ascending };
    f64::from(f32::from_bits(bits).next_up())
}

#[inline(always)]
fn farthest<L: Lanes>(gate: &[f64]) -> f64 {
    let mut least = L::splat(f64::INFINITY);
    let blocks = gate.chunks_exact(LANES);
    let mut rest = f64::INFINITY;
    for g in blocks.remainder() {
        rest = rest.min(*g);
    }
    for block in blocks {
        least = least.min(L::load(block));
    }
    let mut lanes = [0.0; LANES];
    least.store(&mut lanes);
    lanes.into_iter().fold(rest, f64::min)
}
