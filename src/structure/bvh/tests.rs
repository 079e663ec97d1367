//! Kernels against their twins, bins against the exact sweep, the linear build against
//! plain recursion.

use super::bins::{self, BINS_MAX, Bins, Domain, Split, stride};
use super::grow::Grow;
use super::kernel::Kernel;
use super::record::{self, Record};
use super::sweep::Sweep;
use super::tree::Slim;
use super::{Bvh, lay, linear, sah_cost, sides, tree};
use crate::hierarchy::LANES;
use crate::math::{Aabb, Box32, DVec3, Vec3};
use crate::scene::Scene;
use crate::structure::Structure;
use crate::structure::builder::morton::Lattice;
use crate::structure::builder::{self, collapse};

/// Seeded numbers from -1 to 1.
fn random(seed: u64) -> impl FnMut() -> f64 {
    use rand_chacha::rand_core::{RngCore, SeedableRng};
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    move || (rng.next_u64() >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

fn scene_of(positions: Vec<DVec3>) -> Scene {
    let n = positions.len() as u32 / 3;
    let mut scene = Scene {
        positions,
        triangles: (0..n).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect(),
        source_triangle_id: (0..n).collect(),
        object_id: vec![0; n as usize],
        material_id: (0..n).map(|t| t % 3).collect(),
        two_sided: vec![false; n as usize],
        occluder: vec![true; n as usize],
        ..Scene::default()
    };
    scene.anchor();
    scene
}

fn soup(seed: u64, count: usize, edge_m: f64, offset: DVec3) -> Scene {
    let mut unit = random(seed);
    let mut vector = move || DVec3::new(unit(), unit(), unit());
    let triangle = |_| {
        let centre = offset + vector() * 10.0;
        [vector(), vector(), vector()].map(|v| centre + v * edge_m)
    };
    scene_of((0..count).flat_map(triangle).collect())
}

/// Ordinary and degenerate scenes.
fn scenes() -> Vec<Scene> {
    let point = |x: f64, y: f64, z: f64| [DVec3::new(x, y, z); 3];
    vec![
        soup(1, 700, 0.3, DVec3::ZERO),
        soup(2, 97, 8.0, DVec3::ZERO),
        soup(3, 300, 1.0, DVec3::new(1e7, -3e7, 1e9)),
        soup(4, 200, 1e-30, DVec3::ZERO),
        scene_of((0..130).flat_map(|_| point(1.0, -2.0, 3.0)).collect()),
        scene_of((0..130).flat_map(|i| point(f64::from(i), 0.0, -0.0)).collect()),
        scene_of(
            (0..130).flat_map(|i| point(libm::exp2(-f64::from(i)), libm::exp2(f64::from(i) - 40.0), 1.0)).collect(),
        ),
        scene_of((0..130).flat_map(|i| point(f64::from(i % 2) * 3e38, f64::from(i % 3) * -3e38, 0.0)).collect()),
        scene_of((0..9).flat_map(|i| point(0.0, f64::from(i) * 5e-324, f64::from(i) * 1e-40)).collect()),
        scene_of(point(0.5, 0.5, 0.5).to_vec()),
    ]
}

fn records(scene: &Scene) -> Vec<Record> {
    let mut out = vec![Record::EMPTY; scene.len()];
    record::make(scene, 0, &mut out);
    out
}

fn bits(r: &[Record]) -> Vec<[u32; 8]> {
    r.iter().map(|r| r.0.map(f32::to_bits)).collect()
}

fn used(b: &Bins, bins: usize) -> (Vec<[u32; 8]>, Vec<u32>) {
    let boxes: Vec<Record> = b.spans[..3 * stride(bins)].iter().map(|s| s.bare()).collect();
    (bits(&boxes), b.counts[..3 * stride(bins)].to_vec())
}

#[test]
fn records_are_the_boxes_of_the_triangles_from_every_kernel() {
    for scene in scenes() {
        let twin = records(&scene);
        for (t, r) in twin.iter().enumerate() {
            assert_eq!((r.bounds(), r.triangle()), (scene.triangle_box(t as u32), t as u32));
        }
        for kernel in Kernel::all() {
            for first in [0, scene.len() / 2] {
                let mut out = vec![Record::EMPTY; scene.len() - first];
                kernel.records(&scene, first as u32, &mut out);
                assert_eq!(bits(&out), bits(&twin[first..]), "{kernel:?}");
            }
        }
    }
}

#[test]
fn kernels_give_the_bits_of_their_twins() {
    let mut tried = 0;
    let endless = {
        let mut all = records(&soup(5, 60, 1.0, DVec3::ZERO));
        // Boxes without end: centroids that are infinite or not a number.
        all[7].0[1] = f32::INFINITY;
        all[9].0[4] = f32::INFINITY;
        (all[11].0[2], all[11].0[6]) = (f32::INFINITY, f32::INFINITY);
        all
    };
    let inputs: Vec<Vec<Record>> = scenes().iter().map(records).chain([endless, Vec::new()]).collect();
    for input in &inputs {
        let (_, lo, hi) = bins::extent(input);
        for (bins, tight) in [2, 5, 8, 16, 17, BINS_MAX].into_iter().flat_map(|b| [(b, true), (b, false)]) {
            let loose = |x: [f32; 3], y: [f32; 3]| [x[0] - 1.0, x[1] * 0.5 + y[1] * 0.5, x[2]];
            let domain = if tight { Domain::over(lo, hi, bins) } else { Domain::over(loose(lo, hi), hi, bins) };
            let mut twin = Bins::ZERO;
            bins::fill(input, &domain, bins, &mut twin);
            let best = twin.best(bins);
            let below = [Domain::over(lo, hi, bins), domain];
            for kernel in Kernel::all() {
                let (mut own, mut spare) = (Bins::ZERO, [Bins::ZERO; 2]);
                assert_eq!(
                    format!("{:?}", kernel.extent(input)),
                    format!("{:?}", bins::extent(input)),
                    "{kernel:?}: signs of zeros, too"
                );
                kernel.fill(input, &domain, bins, &mut own, &mut spare[0]);
                assert_eq!(used(&own, bins), used(&twin, bins), "{kernel:?}, {bins} bins");
                assert_eq!(kernel.best(&own, bins), best, "{kernel:?}, {bins} bins");
                if let Some(split) = best {
                    let sides = sides::sides(&twin, &split, bins);
                    assert_eq!(bits(&kernel.sides(&twin, &split, bins)), bits(&sides), "{kernel:?}, {bins} bins");
                    assert_eq!(split.left as usize, bins::count_left(input, &domain, &split));
                    for bins_below in [bins, 7] {
                        let of = |k: Kernel| k.below(&twin, &domain, bins, &split, &sides, bins_below);
                        let (own, twin) = (of(kernel), of(Kernel::Scalar));
                        assert_eq!(format!("{own:?}"), format!("{twin:?}"), "{kernel:?}, {bins} bins");
                    }
                }
                for split in best.into_iter().chain([0, 1, 2].map(|axis| Split { axis, plane: 1, left: 0, cost: 0.0 }))
                {
                    let left = bins::count_left(input, &domain, &split);
                    let deal = |kernel: Kernel| {
                        let mut out = vec![Record::EMPTY; input.len()];
                        let mut pair = [Bins::ZERO; 2];
                        let (a, b) = out.split_at_mut(left);
                        let sets = &mut [Bins::ZERO; 2];
                        kernel.deal(input, [a, b], &domain, &split, &below, bins, pair.each_mut(), sets);
                        (bits(&out), used(&pair[0], bins), used(&pair[1], bins))
                    };
                    let dealt = deal(kernel);
                    assert!(dealt == deal(Kernel::Scalar), "{kernel:?}, {bins} bins, {split:?}");
                    let mut out = vec![Record::EMPTY; input.len()];
                    let (a, b) = out.split_at_mut(left);
                    kernel.part(input, [a, b], &domain, &split);
                    assert!(bits(&out) == dealt.0, "{kernel:?}: stable, as with bins");
                    tried += 1;
                }
            }
        }
    }
    assert!(tried > 300, "{tried}");
}

#[test]
#[should_panic(expected = "as large as counted")]
fn a_side_that_is_too_small_is_a_panic() {
    let input = records(&soup(6, 40, 1.0, DVec3::ZERO));
    let (_, lo, hi) = bins::extent(&input);
    let mut out = vec![Record::EMPTY; input.len()];
    let (a, b) = out.split_at_mut(1);
    Kernel::fastest().part(&input, [a, b], &Domain::over(lo, hi, 8), &Split { axis: 0, plane: 4, left: 1, cost: 0.0 });
}

fn grow(kernel: Kernel, leaf_size: usize, by_cost: bool, sweep: usize) -> Grow {
    Grow { leaf_size, bins: 16, median: false, by_cost, sweep, kernel }
}

fn arena(scene: &Scene, kernel: Kernel) -> super::pages::Arena {
    record::records(scene, kernel)
}

#[test]
fn every_kernel_builds_the_same_tree() {
    for scene in scenes() {
        for (leaf_size, by_cost, sweep) in [(1, false, 0), (4, false, 8), (64, true, 8), (20, true, 0)] {
            let build = |kernel| grow(kernel, leaf_size, by_cost, sweep).run(arena(&scene, kernel));
            for kernel in Kernel::all() {
                assert!(build(kernel) == build(Kernel::Scalar), "{kernel:?}");
            }
        }
    }
}

/// The surface-area cost of a tree.
fn cost(nodes: &[Slim]) -> f64 {
    let area = |s: &Slim| {
        let e = (s.bounds.hi - s.bounds.lo).as_dvec3();
        e.x * e.y + e.y * e.z + e.z * e.x
    };
    nodes.iter().map(|s| area(s) * f64::from(if s.is_leaf() { s.count } else { 1 })).sum::<f64>() / area(&nodes[0])
}

#[test]
fn bins_cost_within_a_twentieth_of_the_exact_sweep() {
    for seed in 10..16 {
        let scene = soup(seed, 1500, 0.1 + 0.3 * (seed - 10) as f64, DVec3::ZERO);
        for (leaf_size, by_cost) in [(4, false), (16, false), (64, true)] {
            let kernel = Kernel::fastest();
            let [binned, mixed, swept] = [0, 8, usize::MAX]
                .map(|sweep| cost(&grow(kernel, leaf_size, by_cost, sweep).run(arena(&scene, kernel)).0));
            println!(
                "leaf {leaf_size}, by cost {by_cost}: bins {binned:.2}, with small sweeps {mixed:.2}, sweeps {swept:.2}"
            );
            assert!(binned <= 1.05 * swept && mixed <= 1.05 * swept, "{binned} {mixed} {swept}");
            assert!(swept <= 1.05 * binned, "the sweep itself is no worse: {binned} {swept}");
        }
    }
}

#[test]
fn the_sweep_finds_the_least_of_all_planes() {
    for scene in scenes().into_iter().filter(|s| s.len() < 150) {
        let input = records(&scene);
        let mut least = f32::INFINITY;
        for axis in 0..3 {
            let mut order: Vec<&Record> = input.iter().collect();
            order.sort_by(|a, b| a.centre2(axis).total_cmp(&b.centre2(axis)));
            for left in 1..order.len() {
                let area = |part: &[&Record]| part.iter().fold(Record::EMPTY, |s, r| s.union(**r)).half_area();
                let (a, b) = order.split_at(left);
                least = least.min(area(a) * left as f32 + area(b) * b.len() as f32);
            }
        }
        let mut out = vec![Record::EMPTY; input.len()];
        let best = Sweep::default().cut(&input, &mut out);
        assert_eq!(best.map_or(f32::INFINITY, |c| c.cost), least);
        if let Some(cut) = best {
            assert!(out.is_sorted_by_key(|r| r.centre2(cut.axis)));
            for (side, part) in [&out[..cut.left], &out[cut.left..]].into_iter().enumerate() {
                let naive = part.iter().fold(Record::EMPTY, |s, r| s.union(*r));
                assert_eq!(naive.bounds(), cut.bounds[side].bounds());
            }
        }
    }
}

#[test]
fn every_kernel_sweeps_alike() {
    let mut cut = [0; 2];
    let mut endless = records(&soup(7, 40, 1.0, DVec3::ZERO));
    for (i, r) in endless.iter_mut().enumerate() {
        r.0[[1, 4, 6][i % 3]] = if i % 5 < 2 { f32::INFINITY } else { r.0[4] };
    }
    let few = |all: &[Record]| all[..all.len().min(130)].to_vec();
    for input in scenes().iter().map(|s| few(&records(s))).chain([endless, records(&soup(8, 130, 20.0, DVec3::ZERO))]) {
        for (n, first) in (1..=17).flat_map(|n| (0..input.len().saturating_sub(n)).step_by(7).map(move |f| (n, f))) {
            let part = &input[first..first + n];
            let of = |kernel: Kernel| {
                let mut out = vec![Record::EMPTY; n];
                let best = kernel.cut(part, &mut out, &mut Sweep::default());
                // Signs of zeros, too; and what is not a number is like itself.
                (best.map(|c| (c.axis, c.left, c.cost.to_bits(), bits(&c.bounds))), bits(&out))
            };
            let twin = of(Kernel::Scalar);
            cut[usize::from(twin.0.is_some())] += 1;
            for kernel in Kernel::all() {
                assert_eq!(of(kernel), twin, "{kernel:?}, {n} records from {first}");
            }
        }
    }
    assert!(cut[0] > 20 && cut[1] > 1000, "{cut:?}");
}

/// Lauterbach's recursion on whole codes: the ranges of the leaves.
fn plain(codes: &[u64], first: usize, leaf_size: usize, out: &mut Vec<(u32, u32)>) {
    if codes.len() <= leaf_size {
        return out.push((first as u32, codes.len() as u32));
    }
    let differ = codes[0] ^ codes[codes.len() - 1];
    let left = match differ {
        0 => codes.len() / 2,
        d => codes.iter().filter(|c| *c >> d.ilog2() & 1 == 0).count(),
    };
    plain(&codes[..left], first, leaf_size, out);
    plain(&codes[left..], first + left, leaf_size, out);
}

#[test]
fn the_linear_build_is_the_plain_recursion_on_whole_codes() {
    let mut crowded = soup(20, 900, 1e-4, DVec3::ZERO);
    // Two far corners leave all others to the lower half of the codes.
    let far = |x: f64| [DVec3::splat(x), DVec3::splat(x + 1.0), DVec3::new(x, x, x + 1.0)];
    let mut positions = crowded.positions.clone();
    positions.extend([far(-1e5), far(1e5)].iter().flatten());
    crowded = scene_of(positions);
    for scene in scenes().into_iter().chain([crowded, soup(21, 9000, 0.1, DVec3::splat(1e6))]) {
        let lattice = Lattice::new(&scene.bounds(), 21);
        let code = |t: u32| {
            let [a, b, c] = scene.corners(t);
            lattice.code((a + b + c) / 3.0)
        };
        let mut order: Vec<(u64, u32)> = (0..scene.len() as u32).map(|t| (code(t), t)).collect();
        order.sort_unstable();
        let codes: Vec<u64> = order.iter().map(|o| o.0).collect();
        for leaf_size in [1, 7, 64] {
            let mut expected = Vec::new();
            plain(&codes, 0, leaf_size, &mut expected);
            let (slim, sealed) = linear::build(&scene, &records(&scene), leaf_size);
            let leaf = |n: &builder::Node| n.is_leaf().then_some((n.first, n.end - n.first));
            let mut leaves: Vec<(u32, u32)> = tree::nodes(&slim).iter().filter_map(leaf).collect();
            leaves.sort_unstable();
            assert_eq!(leaves, expected);
            for (first, count) in leaves {
                let range = first as usize..(first + count) as usize;
                let mut triangles: Vec<u32> = order[range.clone()].iter().map(|o| o.1).collect();
                triangles.sort_unstable_by_key(|t| (scene.material_id[*t as usize], *t));
                assert!(sealed[range].iter().map(|key| *key as u32).eq(triangles));
            }
        }
    }
}

#[test]
fn the_layout_is_that_of_collapse_and_flatten() {
    let scene = soup(22, 3000, 0.5, DVec3::ZERO);
    for scene in scenes().iter().chain([&scene]) {
        for (leaf_size, by_cost) in [(1, false), (9, false), (64, true)] {
            let kernel = Kernel::fastest();
            let (tree, sealed) = grow(kernel, leaf_size, by_cost, 8).run(arena(scene, kernel));
            let entries: Vec<u32> = sealed.iter().map(|key| *key as u32).collect();
            let binary = tree::nodes(&tree);
            for (width, nodes) in [(2, binary.clone()), (LANES, collapse::collapse(&binary))] {
                let h = lay::lay(scene, &tree, &sealed, width, leaf_size as u32);
                let twin = builder::flatten(scene, &nodes, entries.clone(), None);
                assert!(h.entries == twin.entries);
                assert!(h.bounds == twin.bounds && h.links == twin.links && h.parent == twin.parent);
                assert!(h.root_blocks == twin.root_blocks && h.material_run == twin.material_run);
                assert_eq!(h.stats, builder::stats(&binary, leaf_size as u64));
            }
        }
    }
}

#[test]
fn the_cost_of_a_tree_of_two_leaves_is_counted_by_hand() {
    let at = |x: f64| [DVec3::new(x, 0.0, 0.0), DVec3::new(x + 1.0, 1.0, 0.0), DVec3::new(x, 0.0, 1.0)];
    let scene = scene_of([at(0.0), at(0.0), at(3.0)].concat());
    let bvh = Bvh { leaf_size: 2, wide: false, ..Bvh::default() };
    // The root 4 x 1 x 1 has half a surface of 9; its leaves are unit cubes, of 3.
    let expected = 1.0 + 3.0 / 9.0 * 2.0 + 3.0 / 9.0;
    assert!((sah_cost(&bvh.build(&scene).unwrap()) - expected).abs() < 1e-6);
    assert_eq!(sah_cost(&bvh.build(&scene_of(Vec::new())).unwrap()), 0.0);
}

#[test]
fn the_middle_of_a_box_is_one_difference_and_its_union_one_maximum() {
    let b = Box32 { lo: Vec3::new(-1.0, 0.0, 2.0), hi: Vec3::new(0.0, 5.0, 3.0) };
    let r = Record::new(b, 7, 9);
    assert_eq!([0, 1, 2].map(|axis| r.centre2(axis)), [-1.0, 5.0, 5.0]);
    assert_eq!((r.bounds(), r.triangle(), r.key()), (b, 7, 9 << 32 | 7));
    let o = Box32 { lo: Vec3::new(-3.0, 1.0, 2.5), hi: Vec3::new(-2.0, 2.0, 9.0) };
    assert_eq!(r.union(Record::new(o, 1, 1)).bounds(), b.union(o));
    assert_eq!(Record::EMPTY.union(r).bounds(), b);
    assert!(Aabb::EMPTY.is_empty() && Record::EMPTY.bounds().is_empty());
}
