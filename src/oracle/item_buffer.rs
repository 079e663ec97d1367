//! The item buffer: which triangle every sample of the image sees, in f64.
//!
//! A tiled scan-line rasteriser. Triangles are set up once, binned to tiles and
//! drawn nearest first within a tile, so that a full tile ends the work as soon
//! as everything left lies behind it. Inside a row only the depth is compared.
//!
//! - Back faces of single-sided triangles and what is certainly outside the view
//!   volume are not drawn ([`super::sets`] decides, exactly).
//! - Surfaces that agree in depth within [`TIE`] are a tie: the smaller triangle
//!   index wins, the other is kept beside it, and neither can be proved lost while
//!   the other is submitted.
//! - Triangles that hide nothing (`occluder == false`) come in a second pass: a
//!   sample sees each of them that no hiding triangle covers.
//!
//! Class: sample-exact. Every id in it has a ray that hits the triangle first.
//! Nothing depends on the number of threads.

use super::footprint::{Footprint, Lens};
use super::image::{ANY, BACKGROUND, Grid, TileRect, TileRuns, Veil};
use super::sets::Standing;
use crate::math::{DVec3, View};
use crate::scene::Scene;
use rayon::prelude::*;

/// Depth keys closer than this share of each other are equal: far above the
/// rounding of the key (about 1e-14 unless the triangle is a sliver), far below
/// any distance a picture could show (10 nm at 10 m).
pub const TIE: f64 = 1.0 / (1u64 << 30) as f64;

/// Draws `scene` from `view`; the tiles in the order of [`Grid::tile`].
pub fn draw(scene: &Scene, view: &View, standings: &[Standing], grid: Grid) -> Vec<TileRuns> {
    let lens = Lens::new(view, grid);
    let footprints = set_up(scene, view, standings, &lens);
    let bins = Bins::new(&footprints, grid);
    (0..grid.tile_count())
        .into_par_iter()
        .map_init(Tile::default, |tile, index| tile.draw(&lens, grid.tile(index), &footprints, bins.of(index)))
        .collect()
}

fn set_up(scene: &Scene, view: &View, standings: &[Standing], lens: &Lens) -> Vec<Footprint> {
    const CHUNK: usize = 8192;
    let camera: Vec<DVec3> = scene.positions.par_iter().with_min_len(CHUNK).map(|p| view.to_camera(*p)).collect();
    let parts: Vec<Vec<Footprint>> = standings
        .par_chunks(CHUNK)
        .enumerate()
        .map(|(chunk, standings)| {
            let drawn = standings.iter().enumerate().filter(|(_, s)| s.drawable());
            let t = drawn.map(|(i, _)| chunk * CHUNK + i);
            t.filter_map(|t| {
                let corners = scene.triangles[t].map(|v| camera[v as usize]);
                Footprint::new(lens, t as u32 + 1, scene.occluder[t], corners)
            })
            .collect()
        })
        .collect();
    parts.concat()
}

/// Indices of footprints by tile, ascending within a tile.
struct Bins {
    first: Vec<u32>,
    items: Vec<u32>,
}

impl Bins {
    fn new(footprints: &[Footprint], grid: Grid) -> Bins {
        let side = grid.tile_side();
        let across = grid.tiles_across();
        let mut first = vec![0u32; grid.tile_count() as usize + 1];
        let tiles = |f: &Footprint| {
            let (i0, i1) = (f.x0 / side, f.x1 / side);
            (f.y0 / side..=f.y1 / side).flat_map(move |j| (i0..=i1).map(move |i| (j * across + i) as usize))
        };
        for f in footprints {
            tiles(f).for_each(|t| first[t + 1] += 1);
        }
        for t in 1..first.len() {
            first[t] += first[t - 1];
        }
        let mut items = vec![0; *first.last().expect("one more than tiles") as usize];
        let mut next = first.clone();
        for (index, f) in footprints.iter().enumerate() {
            tiles(f).for_each(|t| {
                items[next[t] as usize] = index as u32;
                next[t] += 1;
            });
        }
        Bins { first, items }
    }

    fn of(&self, tile: u32) -> &[u32] {
        &self.items[self.first[tile as usize] as usize..self.first[tile as usize + 1] as usize]
    }
}

/// Buffers of one tile, kept between tiles of a thread.
#[derive(Default)]
struct Tile {
    /// Nearest key so far.
    best: Vec<f64>,
    /// What a key must exceed to matter: `best` less the tie.
    gate: Vec<f64>,
    winner: Vec<u32>,
    alternate: Vec<u32>,
    order: Vec<(f64, u32)>,
}

impl Tile {
    fn draw(&mut self, lens: &Lens, rect: TileRect, footprints: &[Footprint], bin: &[u32]) -> TileRuns {
        let size = rect.width() * rect.height();
        // What is as far as the far plane is still in: the gate lets it pass.
        for (buffer, value) in [(&mut self.best, lens.key_far), (&mut self.gate, lens.key_far.next_down())] {
            buffer.clear();
            buffer.resize(size, value);
        }
        for buffer in [&mut self.winner, &mut self.alternate] {
            buffer.clear();
            buffer.resize(size, BACKGROUND);
        }
        let xs = &lens.xs[rect.x0 as usize..rect.x1 as usize];
        let ys = &lens.ys[rect.y0 as usize..rect.y1 as usize];
        let (across, down) = ([xs[0], xs[xs.len() - 1]], [ys[ys.len() - 1], ys[0]]);
        self.order.clear();
        self.order.extend(bin.iter().map(|i| (footprints[*i as usize].key_max_in(across, down), *i)));
        // Nearest first; equal keys by triangle, so that the order is total.
        self.order.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));

        let order = std::mem::take(&mut self.order);
        let mut drawn_area = 0;
        for (key_max, index) in &order {
            let f = &footprints[*index as usize];
            if !f.occluder {
                continue;
            }
            if drawn_area >= size {
                // All that follows is farther still.
                let farthest = self.gate.iter().fold(f64::INFINITY, |m, g| if *g < m { *g } else { m });
                if *key_max <= farthest {
                    break;
                }
                drawn_area = 0;
            }
            drawn_area += self.draw_occluder(lens, rect, xs, ys, f);
        }
        let mut runs = TileRuns::encode(&self.winner, &self.alternate);
        for (_, index) in order.iter().filter(|(_, i)| !footprints[*i as usize].occluder) {
            self.draw_veil(lens, rect, xs, ys, &footprints[*index as usize], &mut runs.veils);
        }
        runs.veils.sort_unstable_by_key(|v| (v.id, v.y, v.x));
        self.order = order;
        runs
    }

    /// Returns the work done in samples, to decide when asking for the farthest
    /// key is worth it.
    fn draw_occluder(&mut self, lens: &Lens, rect: TileRect, xs: &[f64], ys: &[f64], f: &Footprint) -> usize {
        let mut work = 0;
        for_rows(lens, rect, xs, ys, f, |row, x0, x1, key_row| {
            work += x1 - x0;
            let at = row * xs.len();
            // Most samples of most rows lie behind what is drawn: find the others
            // eight at a time without a branch.
            const LANES: usize = 8;
            for start in (x0..x1).step_by(LANES) {
                let end = (start + LANES).min(x1);
                let mut passes = 0u32;
                for (i, (x, gate)) in xs[start..end].iter().zip(&self.gate[at + start..at + end]).enumerate() {
                    passes |= u32::from(key_at(f, *x, key_row) > *gate) << i;
                }
                while passes != 0 {
                    let x = start + passes.trailing_zeros() as usize;
                    passes &= passes - 1;
                    self.take(lens, at + x, f.id, key_at(f, xs[x], key_row));
                }
            }
        });
        work
    }

    /// A sample whose key passed the gate.
    #[inline]
    fn take(&mut self, lens: &Lens, at: usize, id: u32, key: f64) {
        if key > lens.key_near {
            return;
        }
        let best = self.best[at];
        if self.winner[at] == BACKGROUND || key > best + TIE * best.abs() {
            (self.winner[at], self.alternate[at], self.best[at]) = (id, BACKGROUND, key);
        } else {
            let (winner, alternate) = (self.winner[at], self.alternate[at]);
            self.alternate[at] = if alternate == BACKGROUND { winner.max(id) } else { ANY };
            self.winner[at] = winner.min(id);
            self.best[at] = best.max(key);
        }
        self.gate[at] = self.best[at] - TIE * self.best[at].abs();
    }

    fn draw_veil(&self, lens: &Lens, rect: TileRect, xs: &[f64], ys: &[f64], f: &Footprint, veils: &mut Vec<Veil>) {
        for_rows(lens, rect, xs, ys, f, |row, x0, x1, key_row| {
            let seen = |x: usize| {
                let (at, key) = (row * xs.len() + x, key_at(f, xs[x], key_row));
                let best = self.best[at];
                // Strictly in front: on a decal's own wall either may be what is seen.
                let in_front = self.winner[at] == BACKGROUND && key >= best || key > best + TIE * best.abs();
                in_front && key <= lens.key_near
            };
            let mut x = x0;
            while x < x1 {
                let len = (x..x1).take_while(|x| seen(*x)).count();
                if len > 0 {
                    veils.push(Veil { x: rect.x0 + x as u32, y: rect.y0 + row as u32, len: len as u32, id: f.id });
                }
                x += len + 1;
            }
        });
    }
}

/// Visits the rows of `f` in the tile: row and columns within the tile, half-open,
/// and the part of the key that does not depend on x.
#[inline]
fn for_rows(
    lens: &Lens,
    rect: TileRect,
    xs: &[f64],
    ys: &[f64],
    f: &Footprint,
    mut visit: impl FnMut(usize, usize, usize, f64),
) {
    let first = (f.x0.max(rect.x0) - rect.x0) as usize;
    let end = (f.x1 + 1).min(rect.x1).saturating_sub(rect.x0) as usize;
    for y in f.y0.max(rect.y0)..(f.y1 + 1).min(rect.y1) {
        let row = (y - rect.y0) as usize;
        let (a, b) = f.span(&xs[first..end], ys[row], lens.step_x());
        if a < b {
            visit(row, first + a, first + b, f.key[1] * ys[row] + f.key[2]);
        }
    }
}

/// The key at a sample, held within the triangle's own range.
#[inline(always)]
fn key_at(f: &Footprint, x: f64, row: f64) -> f64 {
    let key = f.key[0] * x + row;
    // Not `clamp`: these compile to one instruction each.
    let key = if key < f.key_min { f.key_min } else { key };
    if key > f.key_max { f.key_max } else { key }
}
