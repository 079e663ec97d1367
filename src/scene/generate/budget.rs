//! Spends a triangle budget to the last triangle: props appear in order, then
//! grow in detail turn by turn, and pennants, one triangle each, take the rest.

use super::builder::{Builder, v3};
use super::props::Placed;
use crate::math::DVec3;
use std::collections::BTreeMap;

/// A level beyond which triangles would shrink below what snapping keeps apart.
const LEVEL_MAX: u32 = 48;
/// Left for the pennants, so that a few triangles lost in snapping do no harm.
const RESERVE: usize = 12;

/// Adds `props` to `b` until it has `target` triangles exactly. Pennants hang
/// between `line[0]` and `line[1]`.
///
/// # Panics
/// If `b` already has more than `target` triangles: generators check their parameters first.
pub(super) fn spend(mut b: Builder, props: &[Placed], target: usize, line: [DVec3; 2]) -> Builder {
    assert!(b.len() <= target, "{} triangles before any detail, {target} wanted", b.len());
    let mut left = (target - b.len()).saturating_sub(RESERVE);
    let mut costs = Costs::default();
    let mut levels: Vec<Option<u32>> = vec![None; props.len()];
    for turn in 0..=LEVEL_MAX {
        let mut any = false;
        for (p, level) in props.iter().zip(&mut levels) {
            let next = level.map_or(0, |l| l + 1);
            if next > turn {
                continue;
            }
            let now = level.map_or(0, |l| costs.of(p, l));
            let cost = costs.of(p, next).saturating_sub(now);
            if cost <= left {
                left -= cost;
                *level = Some(next);
                any = true;
            }
        }
        if !any && left < RESERVE {
            break;
        }
    }
    for (p, level) in props.iter().zip(&levels) {
        if let Some(level) = level {
            p.emit(&mut b, *level);
        }
    }
    let rest = target.saturating_sub(b.len());
    pennants(&mut b, line, rest);
    b
}

/// Triangles of a prop at a level. They hardly depend on the seed, so the first
/// of a kind and size stands for all; what little differs falls to the pennants.
#[derive(Default)]
struct Costs(BTreeMap<(u8, u64, u32), usize>);

impl Costs {
    fn of(&mut self, p: &Placed, level: u32) -> usize {
        *self.0.entry((p.prop as u8, p.size.to_bits(), level)).or_insert_with(|| {
            let mut scratch = Builder::new("");
            p.emit(&mut scratch, level);
            scratch.len()
        })
    }
}

/// A string of two-sided triangular flags.
fn pennants(b: &mut Builder, [from, to]: [DVec3; 2], count: usize) {
    b.object();
    let step = (to - from) / count.max(1) as f64;
    let drop = v3(0.0, 0.0, 0.9 * step.length().min(0.8));
    b.two_sided(|b| {
        for i in 0..count {
            b.paint(["red_pennant", "white_pennant", "blue_pennant"][i % 3]);
            let a = from + step * (i as f64 + 0.1);
            let c = from + step * (i as f64 + 0.9);
            b.tri(a, (a + c) * 0.5 - drop, c);
        }
    });
}
