//! Queries answered by the software depth buffer, at once or as late as a GPU would.
//!
//! All that is drawn hides what comes later, but triangles that are seen through and,
//! where `occluder_px` says so, ranges of small ones: what is not drawn into the buffer
//! hides nothing, so leaving occluders out never loses anything.

use super::clock::Clock;
use super::*;
use crate::math::DVec3;
use crate::raster::{DepthBuffer, Occluders};
use std::collections::VecDeque;

pub struct Software {
    buffer: DepthBuffer,
    occluders: Occluders,
    occluder_px: f64,
    /// Area of all triangles at lower positions, if anybody asks.
    area_before_m2: Vec<f64>,
    /// Pixels that a square metre covers at a metre from the eye, or at any distance.
    px_per_m2: f64,
    perspective: bool,
    latency_ns: Option<f64>,
    prices: Prices,
    clock: Clock,
    /// Entries that a later call will draw.
    unsubmitted: u64,
    /// Pixels, and when they are known; oldest first.
    answers: VecDeque<(u32, f64)>,
    /// Number of the oldest of them.
    oldest: u64,
}

impl Software {
    /// Without a latency the CPU answers itself, and never waits.
    pub fn new(settings: Settings, prices: Prices, latency_ns: Option<f64>, occluder_px: f64) -> Software {
        Software {
            buffer: DepthBuffer::new(settings),
            occluders: Occluders::default(),
            occluder_px,
            area_before_m2: Vec::new(),
            px_per_m2: 0.0,
            perspective: true,
            latency_ns,
            prices,
            clock: Clock::default(),
            unsubmitted: 0,
            answers: VecDeque::new(),
            oldest: 0,
        }
    }

    /// Whether triangles of this range are large enough to be worth drawing.
    fn hides(&self, first: u32, end: u32, distance_m: f32) -> bool {
        if self.occluder_px == 0.0 || first == end {
            return first != end;
        }
        let area_m2 = self.area_before_m2[end as usize] - self.area_before_m2[first as usize];
        let distance_m = if self.perspective { f64::from(distance_m) } else { 1.0 };
        // A triangle that faces any way shows half of its area on average.
        let mean_px = 0.5 * area_m2 / f64::from(end - first) * self.px_per_m2;
        mean_px >= self.occluder_px * distance_m * distance_m
    }
}

/// Half of the length of the cross product.
fn area_m2([a, b, c]: [DVec3; 3]) -> f64 {
    0.5 * (b - a).cross(c - a).length()
}

impl Backend for Software {
    fn prepare(&mut self, scene: &Scene, hierarchy: &Hierarchy) -> usize {
        let count = hierarchy.entries.len() as u32;
        self.occluders = occluders_of(scene, hierarchy);
        self.area_before_m2.clear();
        if self.occluder_px > 0.0 {
            let sum = |sum: &mut f64, position| {
                *sum += area_m2(hierarchy.piece(scene, position));
                Some(*sum)
            };
            self.area_before_m2 = std::iter::once(0.0).chain((0..count).scan(0.0, sum)).collect();
        }
        self.reset();
        self.occluders.bytes() + self.buffer.bytes() + size_of_val(&self.area_before_m2[..])
    }

    fn begin(&mut self, view: &View, hierarchy: &Hierarchy) {
        self.buffer.begin(view, hierarchy.origin);
        let Settings { width_px, height_px, .. } = self.buffer.settings();
        let pixels = f64::from(width_px) * f64::from(height_px);
        self.px_per_m2 = pixels / (4.0 * view.half_width * view.half_height);
        self.perspective = view.is_perspective();
        (self.clock, self.unsubmitted) = (Clock::default(), 0);
        self.answers.iter_mut().for_each(|a| a.1 = 0.0);
    }

    fn draw(&mut self, first: u32, end: u32, calls: u32, distance_m: f32) -> u32 {
        self.unsubmitted += u64::from(end - first);
        if calls > 0 {
            self.clock.draw(&self.prices, std::mem::take(&mut self.unsubmitted), u64::from(calls));
        }
        if !self.hides(first, end, distance_m) {
            return 0;
        }
        let drawn = self.buffer.draw(&self.occluders, first, end);
        self.clock.work(self.prices.occluder_cpu_ns * f64::from(drawn));
        drawn
    }

    fn issue(&mut self, boxes: &[Box32], count: bool) -> Ticket {
        let pixels = match count {
            true => boxes.iter().fold(0, |sum: u32, b| sum.saturating_add(self.buffer.pixels(b))),
            false => u32::from(boxes.iter().any(|b| self.buffer.shows(b))),
        };
        let of_boxes = boxes.len() as f64;
        self.clock.work(self.prices.query_cpu_ns + self.prices.box_cpu_ns * of_boxes);
        let ready_ns = match self.latency_ns {
            None => 0.0,
            Some(latency_ns) => {
                latency_ns + self.clock.submit(self.prices.query_gpu_ns + self.prices.box_gpu_ns * of_boxes)
            }
        };
        self.answers.push_back((pixels, ready_ns));
        Ticket(self.oldest + self.answers.len() as u64 - 1)
    }

    fn is_ready(&self, ticket: Ticket) -> bool {
        self.answers[(ticket.0 - self.oldest) as usize].1 <= self.clock.now_ns()
    }

    fn take(&mut self, ticket: Ticket) -> u32 {
        assert_eq!(ticket.0, self.oldest, "answers are taken in the order of issue");
        let (pixels, ready_ns) = self.answers.pop_front().expect("a ticket is taken once");
        self.oldest += 1;
        self.clock.wait_until(ready_ns);
        pixels
    }

    fn work(&mut self, nodes: u64) {
        self.clock.work(clock::NODE_NS * nodes as f64);
    }

    fn times(&self) -> Times {
        self.clock.times()
    }

    fn prices(&self) -> Prices {
        self.prices
    }

    fn reset(&mut self) {
        self.answers.clear();
        self.oldest = 0;
    }

    fn buffer(&mut self) -> Option<&mut DepthBuffer> {
        Some(&mut self.buffer)
    }
}
