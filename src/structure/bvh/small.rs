//! The build of small nodes: divided by the exact sweep down to the leaves, with
//! nothing of what bins need.

use super::grow::{GREEDY_LEVELS, Grow, halve, seal};
use super::record::{Record, Span};
use super::sweep::Sweep;
use super::tree::Slim;

/// Cost of a step of the walk against that of a triangle.
const COST_STEP: f32 = 1.0;
const COST_TRIANGLE: f32 = 1.0;

/// Whether dividing `n` triangles at `cost` costs less than they do undivided.
pub fn pays(bounds: &Span, n: usize, cost: f32) -> bool {
    let area = bounds.half_area();
    COST_STEP * area + COST_TRIANGLE * cost < COST_TRIANGLE * area * n as f32
}

/// Grows the node `slot` over `records[0]`; `records[1]` is room for as many. `bounds` may
/// be unknown.
pub fn grow(
    how: &Grow,
    records: [&mut [Record]; 2],
    sealed: &mut [u64],
    level: u8,
    bounds: Span,
    sweep: &mut Sweep,
    out: &mut Vec<Slim>,
    slot: usize,
) {
    let [mut here, mut there] = records;
    let n = here.len();
    if n == 1 || (n <= how.leaf_size && !how.by_cost) {
        out[slot] = seal(how.kernel, here, sealed, &bounds);
        return;
    }
    let mut bounds = if bounds.is_empty() { how.kernel.extent(here).0 } else { bounds };
    let mut cut = None;
    if level < GREEDY_LEVELS {
        cut = how.kernel.cut(here, there, sweep);
        if n <= how.leaf_size && !pays(&bounds, n, cut.map_or(f32::INFINITY, |c| c.cost)) {
            out[slot] = seal(how.kernel, here, sealed, &bounds);
            return;
        }
    }
    let (left, below) = match cut.filter(|c| c.cost > 0.0) {
        Some(cut) => {
            (here, there) = (there, here);
            (cut.left, cut.bounds)
        }
        // Without area every plane is as good.
        None => {
            let left;
            (left, bounds) = halve(how.kernel, here);
            (left, [Record::EMPTY; 2])
        }
    };
    let child = out.len();
    out[slot] = Slim { bounds: bounds.bounds(), child: child as u32, count: n as u32 };
    out.extend([Slim::UNBORN; 2]);
    let ((a, b), (c, d), (e, f)) = (here.split_at_mut(left), there.split_at_mut(left), sealed.split_at_mut(left));
    grow(how, [a, c], e, level + 1, below[0], sweep, out, child);
    grow(how, [b, d], f, level + 1, below[1], sweep, out, child + 1);
}
