//! A stroll through the band of a [`Space`]: goals far from what was seen, A*
//! between them, short cuts and rounded corners, then even steps.

use super::space::{BAND, COVERED, Space};
use crate::error::{Error, Result};
use crate::math::DVec3;
use crate::scene::generate::random::Random;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// `frames` eye positions, at most `speed` apart; every step lies in free cells.
pub fn stroll(space: &Space, frames: usize, speed: f64, rng: &mut Random) -> Result<Vec<DVec3>> {
    let band: Vec<usize> = (0..space.state.len()).filter(|c| space.state[*c] & BAND != 0).collect();
    // Those at the right height are where goals may be.
    let least = band.iter().map(|c| space.off[*c]).min().unwrap_or(0);
    let level: Vec<usize> = band.iter().copied().filter(|c| space.off[*c] == least).collect();
    // The rim of a map is seldom the place that it was made for.
    let inner = |c: &usize| {
        let at = space.coordinates(*c);
        (0..2).all(|i| at[i] * 13 > space.dims[i] && at[i] * 13 < space.dims[i] * 12)
    };
    let mut goals: Vec<usize> = level.iter().copied().filter(inner).collect();
    if goals.len() * 4 < level.len() {
        goals = level;
    }
    let mut at = *rng.pick(&goals);
    let mut way = vec![space.centre(at)];
    let mut length = 0.0;
    let mut search = Search::new(space);
    let mut idle = 0;
    while length < speed * frames as f64 {
        let goal = choose_goal(space, &goals, &way, at, rng);
        let Some(cells) = search.path(at, goal) else { break };
        let points: Vec<DVec3> = shorten(space, cells.iter().map(|c| space.centre(*c)).collect());
        length += points.windows(2).map(|p| p[0].distance(p[1])).sum::<f64>();
        idle = if points.len() < 2 { idle + 1 } else { 0 };
        way.extend(points.into_iter().skip(1));
        at = goal;
        if idle > 50 {
            return Err(Error::new("the free space is too small to walk in")
                .help("use a smaller clearance_m or eye_height_m, or check the scene's `scale` and `up`"));
        }
    }
    Ok(pace(space, &round_corners(space, &way), frames, speed))
}

/// Of a few candidates, every other one indoors, the one farthest from the way so
/// far, less a part of its distance from here.
fn choose_goal(space: &Space, goals: &[usize], way: &[DVec3], at: usize, rng: &mut Random) -> usize {
    let here = space.centre(at);
    let indoors = rng.chance(0.5);
    let mut best = (f64::NEG_INFINITY, at);
    let (mut asked, mut tries) = (0, 0);
    while asked < 24 && tries < 400 {
        tries += 1;
        let c = *rng.pick(goals);
        if (space.state[c] & COVERED != 0) != indoors && tries < 300 {
            continue;
        }
        asked += 1;
        let p = space.centre(c);
        let unseen = way.iter().map(|w| w.distance_squared(p)).fold(f64::INFINITY, f64::min).sqrt();
        let score = unseen - 0.3 * p.distance(here);
        if score > best.0 && c != at {
            best = (score, c);
        }
    }
    best.1
}

struct Search<'a> {
    space: &'a Space,
    /// Cost so far and the cell before, valid where `stamp` is this search's.
    cost: Vec<u32>,
    before: Vec<u32>,
    stamp: Vec<u16>,
    now: u16,
}

impl<'a> Search<'a> {
    fn new(space: &'a Space) -> Search<'a> {
        let n = space.state.len();
        Search { space, cost: vec![0; n], before: vec![0; n], stamp: vec![0; n], now: 0 }
    }

    /// Cells from `start` to `goal` by A*: steps cost 10, more off the eye height and beside obstacles.
    fn path(&mut self, start: usize, goal: usize) -> Option<Vec<usize>> {
        if self.now == u16::MAX {
            self.stamp.fill(0);
            self.now = 0;
        }
        self.now += 1;
        let space = self.space;
        let target = space.coordinates(goal);
        // Steps go along axes, so the taxi distance never overestimates.
        let estimate = |c: usize| {
            let at = space.coordinates(c);
            (0..3).map(|i| at[i].abs_diff(target[i])).sum::<usize>() as u32 * 10
        };
        let mut open = BinaryHeap::new();
        self.cost[start] = 0;
        self.stamp[start] = self.now;
        open.push(Reverse((estimate(start), 0u32, start)));
        while let Some(Reverse((_, cost, at))) = open.pop() {
            if at == goal {
                let mut cells = vec![goal];
                while *cells.last()? != start {
                    cells.push(self.before[*cells.last()?] as usize);
                }
                cells.reverse();
                return Some(cells);
            }
            if cost > self.cost[at] {
                continue;
            }
            for next in space.neighbours(at) {
                if space.state[next] & BAND == 0 {
                    continue;
                }
                let edge = space.neighbours(next).filter(|n| space.state[*n] & BAND == 0).count() as u32;
                let cost = cost + 10 + 6 * u32::from(space.off[next]) + 2 * edge;
                if self.stamp[next] != self.now || cost < self.cost[next] {
                    self.stamp[next] = self.now;
                    self.cost[next] = cost;
                    self.before[next] = at as u32;
                    open.push(Reverse((cost + estimate(next), cost, next)));
                }
            }
        }
        None
    }
}

/// Pulls the string: goes straight to the farthest point that free band cells allow.
fn shorten(space: &Space, points: Vec<DVec3>) -> Vec<DVec3> {
    const REACH: usize = 64;
    let mut out = vec![points[0]];
    let mut i = 0;
    while i + 1 < points.len() {
        let mut next = i + 1;
        for j in (i + 2..(i + REACH).min(points.len())).rev() {
            if space.clear(points[i], points[j], BAND) {
                next = j;
                break;
            }
        }
        out.push(points[next]);
        i = next;
    }
    out
}

/// Cuts corners (Chaikin 1974) where the cut is free, three times over.
fn round_corners(space: &Space, way: &[DVec3]) -> Vec<DVec3> {
    let mut way = way.to_vec();
    for cut in [1.6, 0.6, 0.25] {
        let mut out = vec![way[0]];
        for w in way.windows(3) {
            let (a, b) = ((w[0] - w[1]), (w[2] - w[1]));
            let take = |d: DVec3| w[1] + d * (cut * space.cell.max(0.3) / d.length().max(1e-12)).min(0.3);
            let (p, q) = (take(a), take(b));
            if space.clear(p, q, 0) { out.extend([p, q]) } else { out.push(w[1]) }
        }
        out.extend(way.last());
        way = out;
    }
    way
}

/// Even steps along the way; where a chord would leave free cells, the corner itself is a step.
fn pace(space: &Space, way: &[DVec3], frames: usize, speed: f64) -> Vec<DVec3> {
    let mut out = vec![way[0]];
    let (mut leg, mut along) = (0, 0.0);
    while out.len() < frames {
        let here = out[out.len() - 1];
        let (mut l, mut a) = (leg, along + speed);
        while l + 1 < way.len() && a > way[l].distance(way[l + 1]) {
            a -= way[l].distance(way[l + 1]);
            l += 1;
        }
        if l + 1 >= way.len() {
            // The way is long enough for all frames unless it could not go on.
            out.push(here);
            continue;
        }
        let step = way[l] + (way[l + 1] - way[l]) * (a / way[l].distance(way[l + 1]).max(1e-12));
        if l == leg || space.clear(here, step, 0) {
            (leg, along) = (l, a);
            out.push(step);
        } else {
            (leg, along) = (leg + 1, 0.0);
            out.push(way[leg]);
        }
    }
    out
}
