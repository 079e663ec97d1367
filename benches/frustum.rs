//! The frustum test over boxes in list form:
//! `cargo bench --no-default-features --bench frustum [-- kernels | arithmetics | NAME...]`.
//!
//! `kernels`: those of `f32_relative` against the memory they have to read. The floor
//! reads the same 24 bytes a box with the widest loads this processor has and
//! does nothing but OR them together. `arithmetics`: the whole test in all six, or in those
//! that are named, against `f32_relative`. All take turns, so that a disturbance meets
//! all of them; medians of many turns are compared, spread is the middle half.

use cullmark::culling::frustum::{Kernels, kernels};
use cullmark::culling::frustum_planes::FramePlanes;
use cullmark::culling::{Tally, Test, make_tests_in};
use cullmark::hierarchy::{BoundsBlock, Hierarchy, LANES, LinkBlock};
use cullmark::math::{Arithmetic, Box32, Camera, DVec3, Pose, Vec3, View};
use cullmark::registry::Spec;
use rand_chacha::rand_core::{RngCore, SeedableRng};
use std::hint::black_box;
use std::time::Instant;

fn main() {
    let wanted: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with('-')).collect();
    let asked = |name: &str| wanted.is_empty() || wanted.iter().any(|w| w == name);
    if asked("kernels") {
        println!("{:>8} {:>8} {:>10} {:>10} {:>8} {:>7}", "boxes", "kernel", "ns a box", "GB/s", "of floor", "kept");
        let mut met = true;
        for (count, turns) in [(2_000, 4001), (64_000, 401), (1_000_000, 101)] {
            met &= compare(count, turns);
        }
        println!("1 M boxes within 1.3x of the floor: {}", if met { "yes" } else { "NO" });
    }
    let chosen: Vec<Arithmetic> =
        Arithmetic::ALL.into_iter().filter(|a| asked("arithmetics") || asked(a.name())).collect();
    if !chosen.is_empty() {
        for (count, turns) in [(2_000, 401), (64_000, 41), (1_000_000, 11)] {
            arithmetics(&chosen, count, turns);
        }
    }
}

/// Prints the table of the test in `chosen` arithmetics, with ratios turn by turn to the default.
fn arithmetics(chosen: &[Arithmetic], count: usize, turns: usize) {
    let bounds = random_boxes(count);
    let links = vec![LinkBlock { live: 0xff, ..LinkBlock::EMPTY }; bounds.len()];
    let h = Hierarchy { root_blocks: links.len() as u32, bounds, links, ..Default::default() };
    let mut names = vec![Arithmetic::default()];
    names.extend(chosen.iter().filter(|a| **a != Arithmetic::default()));
    let view = view();
    let mut tests: Vec<Box<dyn Test>> = names
        .iter()
        .map(|a| {
            let (mut tests, _) = make_tests_in(&[Spec::new("frustum")], *a).expect("the test exists");
            tests[0].prepare(&Default::default(), &h);
            tests.remove(0)
        })
        .collect();
    let mut outside = vec![0u8; h.links.len()];
    let mut tallies = vec![Tally::default(); tests.len()];
    let mut times = vec![Vec::with_capacity(turns); tests.len()];
    let rounds = (64_000 / count).max(1);
    for _ in 0..turns {
        for (i, test) in tests.iter_mut().enumerate() {
            // Planes are made anew, as in every frame.
            times[i].push(timed(rounds, || {
                outside.fill(0);
                tallies[i] = Tally::default();
                test.begin(&view, &h);
                test.judge_flat(black_box(&h), &mut outside, &mut tallies[i]);
            }));
        }
    }
    let boxes = (rounds * count) as f64;
    println!(
        "{:>8} {:>13} {:>9} {:>17} {:>20} {:>8} {:>9}",
        "boxes", "arithmetic", "ns a box", "middle half", "of f32_relative", "kept", "fallbacks"
    );
    for (i, test) in tests.iter_mut().enumerate() {
        outside.fill(0);
        test.judge_flat(&h, &mut outside, &mut Tally::default());
        let kept: u32 = outside.iter().map(|o| o.count_zeros()).sum();
        let [low, middle, high] = quartiles(times[i].iter().map(|t| t / boxes).collect());
        let [least, ratio, most] = quartiles(times[i].iter().zip(&times[0]).map(|(t, base)| t / base).collect());
        let t = tallies[i];
        println!(
            "{count:>8} {:>13} {middle:>9.3} {:>17} {:>20} {kept:>8} {:>9}",
            names[i].name(),
            format!("[{low:.3}-{high:.3}]"),
            format!("{ratio:.2} [{least:.2}-{most:.2}]"),
            format!("{}, {}", t.fallbacks_f64, t.fallbacks_exact),
        );
    }
}

fn view() -> View {
    let pose = Pose { eye: DVec3::new(0.3, -0.2, 0.1), forward: DVec3::new(0.8, 0.5, 0.1), up: DVec3::Z };
    View::new(&Camera::default(), &pose)
}

/// Prints one table; true unless the best kernel misses the target at a million.
fn compare(count: usize, turns: usize) -> bool {
    let bounds = random_boxes(count);
    let live = vec![0xffu8; bounds.len()];
    let planes = FramePlanes::new(&view(), DVec3::ZERO);
    let kernels = kernels();
    let mut outside = vec![0u8; bounds.len()];
    let mut times = vec![Vec::with_capacity(turns); kernels.len() + 1];
    // Small sets are judged several times a turn, or the clock would be measured.
    let rounds = (64_000 / count).max(1);
    for _ in 0..turns {
        times[0].push(timed(rounds, || {
            black_box(floor(black_box(&bounds)));
        }));
        for (i, kernel) in kernels.iter().enumerate() {
            times[i + 1].push(timed(rounds, || {
                outside.fill(0);
                black_box((kernel.flat)(&planes, black_box(&bounds), &live, &mut outside));
            }));
        }
    }
    let medians: Vec<f64> = times.into_iter().map(median).map(|ns| ns / (rounds * count) as f64).collect();
    let kept = |k: &Kernels| {
        outside.fill(0);
        (k.flat)(&planes, &bounds, &live, &mut outside);
        outside.iter().map(|o| o.count_zeros()).sum::<u32>()
    };
    let mut kept: Vec<u32> = kernels.iter().map(kept).collect();
    assert!(kept.windows(2).all(|w| w[0] == w[1]), "all kernels keep the same boxes");
    kept.insert(0, 0);
    let names = std::iter::once("floor").chain(kernels.iter().map(|k| k.name));
    for ((name, ns), kept) in names.zip(&medians).zip(kept) {
        println!("{count:>8} {name:>8} {ns:>10.3} {:>10.1} {:>8.2} {kept:>7}", 24.0 / ns, ns / medians[0]);
    }
    count < 1_000_000 || medians[1] <= 1.3 * medians[0]
}

/// Boxes of 0.1 to 2 m in a cube of 200 m around the eye.
fn random_boxes(count: usize) -> Vec<BoundsBlock> {
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
    let mut unit = move || (rng.next_u32() >> 8) as f32 / (1 << 24) as f32;
    let mut vector = move |lo: f32, hi: f32| Vec3::new(unit(), unit(), unit()) * (hi - lo) + lo;
    let mut blocks = vec![BoundsBlock::EMPTY; count / LANES];
    for block in &mut blocks {
        for lane in 0..LANES {
            let (centre, half) = (vector(-100.0, 100.0), vector(0.05, 1.0));
            block.set(lane, Box32 { lo: centre - half, hi: centre + half });
        }
    }
    blocks
}

fn timed(rounds: usize, mut work: impl FnMut()) -> f64 {
    let start = Instant::now();
    (0..rounds).for_each(|_| work());
    start.elapsed().as_nanos() as f64
}

fn median(values: Vec<f64>) -> f64 {
    quartiles(values)[1]
}

fn quartiles(mut values: Vec<f64>) -> [f64; 3] {
    values.sort_by(f64::total_cmp);
    [1, 2, 3].map(|q| values[(values.len() - 1) * q / 4])
}

#[cfg(target_arch = "x86_64")]
fn floor(bounds: &[BoundsBlock]) -> u64 {
    use std::arch::x86_64::*;

    #[target_feature(enable = "avx512f")]
    fn or_512(bounds: &[BoundsBlock]) -> u64 {
        let mut sums = [_mm512_setzero_si512(); 6];
        for pair in bounds.chunks_exact(2) {
            for (i, sum) in sums.iter_mut().enumerate() {
                // SAFETY: two blocks are 384 contiguous bytes, 64-byte aligned.
                let x = unsafe { _mm512_load_si512(pair.as_ptr().cast::<__m512i>().add(i)) };
                *sum = _mm512_or_si512(*sum, x);
            }
        }
        let all = sums.into_iter().fold(_mm512_setzero_si512(), |a, b| _mm512_or_si512(a, b));
        _mm512_reduce_or_epi64(all) as u64
    }

    #[target_feature(enable = "avx2")]
    fn or_256(bounds: &[BoundsBlock]) -> u64 {
        let mut sums = [_mm256_setzero_si256(); 6];
        for block in bounds {
            for (i, sum) in sums.iter_mut().enumerate() {
                // SAFETY: a block is 192 bytes, 64-byte aligned.
                let x = unsafe { _mm256_load_si256(std::ptr::from_ref(block).cast::<__m256i>().add(i)) };
                *sum = _mm256_or_si256(*sum, x);
            }
        }
        let all = sums.into_iter().fold(_mm256_setzero_si256(), |a, b| _mm256_or_si256(a, b));
        (_mm256_extract_epi64::<0>(all) | _mm256_extract_epi64::<3>(all)) as u64
    }

    if is_x86_feature_detected!("avx512f") {
        // SAFETY: the processor has the feature.
        unsafe { or_512(bounds) }
    } else if is_x86_feature_detected!("avx2") {
        // SAFETY: the processor has the feature.
        unsafe { or_256(bounds) }
    } else {
        or_scalar(bounds)
    }
}

#[cfg(not(target_arch = "x86_64"))]
fn floor(bounds: &[BoundsBlock]) -> u64 {
    or_scalar(bounds)
}

fn or_scalar(bounds: &[BoundsBlock]) -> u64 {
    let rows = bounds.iter().flat_map(|b| b.lo.iter().chain(&b.hi)).flatten();
    u64::from(rows.fold(0, |a, x| a | x.to_bits()))
}
