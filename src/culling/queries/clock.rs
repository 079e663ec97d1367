//! The virtual machine on which frames with queries are timed: a CPU that culls and
//! submits, and a GPU that works off in order what it is given.
//!
//! No real clock takes part: times are sums of counted work and stated prices, the same
//! in every pass and on every machine. Draw calls and indices cost what the time model of
//! reports says. A call is the CPU's, indices are the GPU's; the GPU starts when it is
//! free and the work is there. An answer is ready the latency after the GPU has finished
//! the query. The frame takes as long as the later of the two; what is left of the
//! latency of its last queries passes between frames.

use crate::record::TimeModel;

/// A query on the CPU: a call that draws the boxes and as much again to begin and end the
/// query around it. Fitted to the one published row that waits for every query (Serpa
/// 2018-19, nested grid on Rungholt: 13.0 of 13.7 ms are not in calls or indices, with
/// 1197 calls), a query costs 10.9 us, the wait included; so the price leaves 10 us to wait.
pub const QUERY_CPU_NS: f64 = 860.0;

/// Indices of a box.
const BOX_INDICES: f64 = 36.0;

/// Taking a node from the queue, judging it and putting it back: some 20-100 ns on the
/// machines of docs/PERFORMANCE.md.
pub const NODE_NS: f64 = 50.0;

/// The software depth buffer at 960 x 540, one thread: an occluder triangle, a box. From
/// `cargo bench --bench queries`, within a factor of two on `rooms` and Sponza; triangles
/// cost more the larger they are and the fewer are drawn at once.
const SOFTWARE_OCCLUDER_NS: f64 = 25.0;
const SOFTWARE_BOX_NS: f64 = 400.0;

/// What work costs; nanoseconds a piece.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prices {
    pub index_ns: f64,
    pub draw_call_ns: f64,
    /// A query, and each of its boxes.
    pub query_cpu_ns: f64,
    pub query_gpu_ns: f64,
    pub box_cpu_ns: f64,
    pub box_gpu_ns: f64,
    /// A triangle that hides, beside drawing it.
    pub occluder_cpu_ns: f64,
}

impl Prices {
    /// The GPU answers.
    pub fn gpu(query_cpu_ns: f64) -> Prices {
        let TimeModel { index_ns, draw_call_ns, .. } = TimeModel::default();
        Prices {
            index_ns,
            draw_call_ns,
            query_cpu_ns,
            query_gpu_ns: query_cpu_ns * 0.5,
            box_cpu_ns: 0.0,
            box_gpu_ns: BOX_INDICES * index_ns,
            occluder_cpu_ns: 0.0,
        }
    }

    /// The CPU answers, and the GPU only draws.
    pub fn software() -> Prices {
        Prices {
            query_gpu_ns: 0.0,
            box_cpu_ns: SOFTWARE_BOX_NS,
            box_gpu_ns: 0.0,
            occluder_cpu_ns: SOFTWARE_OCCLUDER_NS,
            ..Prices::gpu(0.0)
        }
    }

    pub fn draw_ns(&self, entries: u64, calls: u64) -> f64 {
        3.0 * self.index_ns * entries as f64 + self.draw_call_ns * calls as f64
    }

    pub fn queries_ns(&self, queries: u64, boxes: u64, occluders: u64) -> f64 {
        let boxes_ns = (self.box_cpu_ns + self.box_gpu_ns) * boxes as f64;
        (self.query_cpu_ns + self.query_gpu_ns) * queries as f64 + boxes_ns + self.occluder_cpu_ns * occluders as f64
    }
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Times {
    pub virtual_ns: u64,
    /// Of them, the CPU waited for answers.
    pub stall_ns: u64,
}

#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Clock {
    cpu_ns: f64,
    /// When the GPU will have done all that it was given.
    gpu_ns: f64,
    stall_ns: f64,
}

impl Clock {
    pub fn work(&mut self, cpu_ns: f64) {
        self.cpu_ns += cpu_ns;
    }

    /// Gives work to the GPU; returns when that is done.
    pub fn submit(&mut self, gpu_ns: f64) -> f64 {
        self.gpu_ns = self.gpu_ns.max(self.cpu_ns) + gpu_ns;
        self.gpu_ns
    }

    pub fn now_ns(&self) -> f64 {
        self.cpu_ns
    }

    pub fn wait_until(&mut self, ns: f64) {
        let wait = (ns - self.cpu_ns).max(0.0);
        self.stall_ns += wait;
        self.cpu_ns += wait;
    }

    /// Draws `entries` triangles in `calls` calls.
    pub fn draw(&mut self, prices: &Prices, entries: u64, calls: u64) {
        self.work(prices.draw_call_ns * calls as f64);
        self.submit(3.0 * prices.index_ns * entries as f64);
    }

    pub fn times(&self) -> Times {
        Times { virtual_ns: self.cpu_ns.max(self.gpu_ns).round() as u64, stall_ns: self.stall_ns.round() as u64 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cpu_and_gpu_run_beside_each_other_and_waiting_is_a_stall() {
        let mut clock = Clock::default();
        clock.work(100.0);
        assert_eq!(clock.submit(1000.0), 1100.0, "starts when it is submitted");
        clock.work(200.0);
        assert_eq!(clock.submit(50.0), 1150.0, "waits for what came before");
        assert_eq!(clock.times(), Times { virtual_ns: 1150, stall_ns: 0 });
        clock.wait_until(250.0);
        assert_eq!((clock.now_ns(), clock.times().stall_ns), (300.0, 0), "over already");
        clock.wait_until(1200.0);
        assert_eq!(clock.times(), Times { virtual_ns: 1200, stall_ns: 900 });
        assert_eq!(clock.submit(10.0), 1210.0, "was idle");
    }
}
