//! The item buffer: which triangle every sample of the image sees, in f64.
//!
//! A tiled scan-line rasteriser. Triangles are set up once ([`super::set_up`]),
//! binned to tiles and drawn nearest first within a tile ([`super::tile`]), so
//! that a full tile ends the work as soon as everything left lies behind it.
//!
//! - Back faces of single-sided triangles and what is certainly outside the view
//!   volume are not drawn ([`super::sets`] decides, exactly).
//! - Surfaces that agree in depth within [`TIE`] are a tie: the smaller triangle
//!   index wins, the other is kept beside it, and neither can be proved lost while
//!   the other is submitted.
//! - Triangles that hide nothing (`occluder == false`) come in a second pass: a
//!   sample sees each of them that no hiding triangle covers.
//!
//! Class: sample-exact but for the rounding of f64: along an edge, or where a surface
//! is seen within some 1e-8 rad of edge-on, a sample may go to the neighbour.
//! Nothing depends on the number of threads, or on the instruction set.

pub use super::tile::TIE;

use super::footprint::{Footprint, Lens};
use super::image::{Grid, TileRuns};
use super::lanes::Kernel;
use super::set_up::{Part, SetUp, Speck};
use super::sets::Standing;
use super::tile::{Content, Tile};
use crate::math::View;
use crate::scene::Scene;
use rayon::prelude::*;

/// Triangles set up by one task: a place within a part takes so many bits.
const CHUNK_BITS: u32 = 13;

/// Draws `scene` from `view`; the tiles in the order of [`Grid::tile`].
pub fn draw(scene: &Scene, view: &View, standings: &[Standing], grid: Grid) -> Vec<TileRuns> {
    draw_on(Kernel::best(), scene, view, standings, grid)
}

fn draw_on(kernel: Kernel, scene: &Scene, view: &View, standings: &[Standing], grid: Grid) -> Vec<TileRuns> {
    let lens = Lens::new(view, grid);
    let set_up = SetUp { scene, view, standings, lens: &lens };
    let chunk = 1 << CHUNK_BITS;
    let parts: Vec<Part> = (0..scene.len().div_ceil(chunk))
        .into_par_iter()
        .map(|i| set_up.chunk(kernel, i * chunk..((i + 1) * chunk).min(scene.len())))
        .collect();
    let (bins, specks) = rayon::join(|| Bins::new(&parts, grid), || SpeckBins::new(&parts, grid));
    (0..grid.tile_count())
        .into_par_iter()
        .map_init(Tile::default, |tile, index| {
            let footprints = bins.of(index).iter().map(|place| footprint(&parts, *place));
            let content = Content { footprints, specks: specks.of(index) };
            tile.draw(kernel, &lens, grid.tile(index), content)
        })
        .collect()
}

#[inline]
fn footprint(parts: &[Part], place: u32) -> &Footprint {
    &parts[(place >> CHUNK_BITS) as usize].footprints[(place & ((1 << CHUNK_BITS) - 1)) as usize]
}

/// Footprints by tile, as places in the parts, ascending within a tile.
struct Bins {
    first: Vec<u32>,
    items: Vec<u32>,
}

impl Bins {
    fn new(parts: &[Part], grid: Grid) -> Bins {
        let side = grid.tile_side();
        let across = grid.tiles_across();
        let mut first = vec![0u32; grid.tile_count() as usize + 1];
        let tiles = |f: &Footprint| {
            let (i0, i1) = (f.x0 / side, f.x1 / side);
            (f.y0 / side..=f.y1 / side).flat_map(move |j| (i0..=i1).map(move |i| (j * across + i) as usize))
        };
        for f in parts.iter().flat_map(|p| &p.footprints) {
            tiles(f).for_each(|t| first[t + 1] += 1);
        }
        accumulate(&mut first);
        let mut items = vec![0; *first.last().expect("one more than tiles") as usize];
        let mut next = first.clone();
        for (part, p) in (0u32..).zip(parts) {
            for (place, f) in (part << CHUNK_BITS..).zip(&p.footprints) {
                tiles(f).for_each(|t| {
                    items[next[t] as usize] = place;
                    next[t] += 1;
                });
            }
        }
        Bins { first, items }
    }

    fn of(&self, tile: u32) -> &[u32] {
        &self.items[self.first[tile as usize] as usize..self.first[tile as usize + 1] as usize]
    }
}

/// Specks by tile.
struct SpeckBins {
    first: Vec<u32>,
    items: Vec<Speck>,
}

impl SpeckBins {
    fn new(parts: &[Part], grid: Grid) -> SpeckBins {
        let mut first = vec![0u32; grid.tile_count() as usize + 1];
        for s in parts.iter().flat_map(|p| &p.specks) {
            first[s.tile as usize + 1] += 1;
        }
        accumulate(&mut first);
        let nothing = Speck { key: 0.0, id: 0, tile: 0, at: 0 };
        let mut items = vec![nothing; *first.last().expect("one more than tiles") as usize];
        let mut next = first.clone();
        for s in parts.iter().flat_map(|p| &p.specks) {
            let next = &mut next[s.tile as usize];
            items[*next as usize] = *s;
            *next += 1;
        }
        SpeckBins { first, items }
    }

    fn of(&self, tile: u32) -> &[Speck] {
        &self.items[self.first[tile as usize] as usize..self.first[tile as usize + 1] as usize]
    }
}

fn accumulate(counts: &mut [u32]) {
    for i in 1..counts.len() {
        counts[i] += counts[i - 1];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{Camera, DVec3, Pose, Projection};
    use crate::oracle::image::{ANY, BACKGROUND, Veil};
    use crate::oracle::sets::standings;
    use proptest::prelude::*;

    /// The twin: every sample asks every triangle, and the definition is read off.
    fn sample_by_sample(scene: &Scene, view: &View, standings: &[Standing], grid: Grid) -> Vec<TileRuns> {
        let lens = Lens::new(view, grid);
        let new = |t: u32| {
            let corners = scene.corners(t).map(|p| view.to_camera(p));
            Footprint::new(&lens, t + 1, scene.occluder[t as usize], corners)
        };
        let drawn = (0..scene.len() as u32).filter(|t| standings[*t as usize].drawable());
        let footprints: Vec<Footprint> = drawn.filter_map(new).collect();
        let tile = |index: u32| {
            let rect = grid.tile(index);
            let (mut winners, mut alternates, mut seen) = (Vec::new(), Vec::new(), Vec::new());
            for (y, x) in (rect.y0..rect.y1).flat_map(|y| (rect.x0..rect.x1).map(move |x| (y, x))) {
                let at = [lens.xs[x as usize], lens.ys[y as usize]];
                let inside = |f: &&Footprint| (f.x0..=f.x1).contains(&x) && (f.y0..=f.y1).contains(&y) && f.inside(at);
                let hits: Vec<(&Footprint, f64)> = footprints
                    .iter()
                    .filter(inside)
                    .map(|f| (f, f.key_at(at[0], f.key_row(at[1]))))
                    .filter(|(_, key)| *key >= lens.key_far && *key <= lens.key_near)
                    .collect();
                let hiding = hits.iter().filter(|(f, _)| f.occluder);
                let nearest = hiding.clone().map(|(_, key)| *key).fold(f64::NEG_INFINITY, f64::max);
                let equal: Vec<u32> =
                    hiding.filter(|(_, key)| *key > nearest - TIE * nearest.abs()).map(|(f, _)| f.id).collect();
                winners.push(equal.first().copied().unwrap_or(BACKGROUND));
                alternates.push(match equal[..] {
                    [] | [_] => BACKGROUND,
                    [_, other] => other,
                    _ => ANY,
                });
                let in_front = |key: f64| nearest == f64::NEG_INFINITY || key > nearest + TIE * nearest.abs();
                seen.extend(hits.iter().filter(|(f, key)| !f.occluder && in_front(*key)).map(|(f, _)| (f.id, y, x)));
            }
            seen.sort_unstable();
            let mut runs = TileRuns::encode(&winners, &alternates);
            for (id, y, x) in seen {
                match runs.veils.last_mut() {
                    Some(v) if v.id == id && v.y == y && v.x + v.len == x => v.len += 1,
                    _ => runs.veils.push(Veil { x, y, len: 1, id }),
                }
            }
            runs
        };
        (0..grid.tile_count()).map(tile).collect()
    }

    fn scene_of(corners: impl Iterator<Item = ([DVec3; 3], bool, bool)>) -> Scene {
        let mut scene = Scene::default();
        for (corners, two_sided, occluder) in corners {
            let v = scene.positions.len() as u32;
            scene.positions.extend(corners);
            scene.triangles.push([v, v + 1, v + 2]);
            scene.two_sided.push(two_sided);
            scene.occluder.push(occluder);
        }
        scene
    }

    fn views() -> [View; 3] {
        let pose = Pose { eye: DVec3::ZERO, forward: DVec3::X, up: DVec3::Z };
        let ortho = Projection::Orthographic { height_m: 6.0 };
        [
            Camera { near_m: 1.0, ..Camera::default() },
            Camera { near_m: 0.5, far_m: Some(5.0), ..Camera::default() },
            Camera { projection: ortho, near_m: 1.0, ..Camera::default() },
        ]
        .map(|camera| View::new(&camera, &pose))
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn tiles_agree_with_every_sample_asking_every_triangle(
            coordinates in proptest::collection::vec(-6i32..7, 9 * 40),
            size in prop_oneof![Just(0.05), Just(0.25), Just(1.0)],
            samples in 1u32..4,
        ) {
            // Whole coordinates: coplanar and repeated triangles, slivers, and corners behind the eye.
            let corner = |c: &[i32], k: usize, middle: DVec3| {
                middle + DVec3::new(f64::from(c[k]), f64::from(c[k + 1]), f64::from(c[k + 2])) * size
            };
            let scene = scene_of(coordinates.chunks(9).enumerate().map(|(i, c)| {
                let middle = DVec3::new(4.0, f64::from(c[0]) * 0.4, f64::from(c[1]) * 0.3);
                ([0, 3, 6].map(|k| corner(c, k, middle)), i % 4 != 0, i % 6 != 5)
            }));
            for view in views() {
                let grid = Grid { width_px: 70, height_px: 40, samples };
                let (standings, _) = standings(&scene, &view);
                let twin = sample_by_sample(&scene, &view, &standings, grid);
                for kernel in [Kernel::Plain, Kernel::best()] {
                    prop_assert_eq!(&draw_on(kernel, &scene, &view, &standings, grid), &twin);
                }
            }
        }
    }

    #[test]
    fn a_chain_of_near_ties_counts_only_those_equal_to_the_nearest() {
        // Each wall lies 0.7 of a tie behind the one before: neighbours are equal,
        // the first and the third are not. Drawn in every order of ids.
        let wall = |depth: f64| {
            let p = |y: f64, z: f64| DVec3::new(depth, y * 50.0, z * 50.0);
            [p(-1.0, -1.0), p(1.0, -1.0), p(0.0, 1.0)]
        };
        let depths = [0.0, 0.7, 1.4, 2.1].map(|n| 4.0 * (1.0 + n * TIE));
        for order in [[0, 1, 2, 3], [3, 2, 1, 0], [2, 0, 3, 1], [1, 3, 0, 2], [3, 0, 2, 1]] {
            let scene = scene_of(order.into_iter().map(|k: usize| (wall(depths[k]), true, true)));
            for view in views() {
                let grid = Grid { width_px: 20, height_px: 9, samples: 1 };
                let (standings, _) = standings(&scene, &view);
                let twin = sample_by_sample(&scene, &view, &standings, grid);
                for kernel in [Kernel::Plain, Kernel::best()] {
                    assert_eq!(draw_on(kernel, &scene, &view, &standings, grid), twin);
                }
                let id = |k: usize| order.iter().position(|o| *o == k).expect("listed") as u32 + 1;
                twin[0].for_each(grid.tile(0), |run| {
                    let (a, b) = (id(0).min(id(1)), id(0).max(id(1)));
                    assert!(run.winner == BACKGROUND || (run.winner, run.alternate) == (a, b), "{run:?}");
                });
            }
        }
    }
}
