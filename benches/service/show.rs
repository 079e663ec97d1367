//! A figure a line, beside its target and what its peers take.

use cullmark::stats::{median, quantile};
use std::io::Write;
use std::time::{Duration, Instant};

pub fn ms(time: Duration) -> f64 {
    time.as_secs_f64() * 1e3
}

pub fn heading() {
    println!(
        "{:<50} {:>6} {:>9} {:>9} {:>9} {:>20} {:<4} | {:<12} | peers",
        "", "n", "median", "p95", "p99", "least .. most", "unit", "target"
    );
}

/// Many values of one thing.
pub fn many(what: &str, values: &[f64], unit: &str, target: &str, peers: &str) {
    let q = |q| short(quantile(values, q));
    let ends = format!("{} .. {}", q(0.0), q(1.0));
    println!(
        "{what:<50} {:>6} {:>9} {:>9} {:>9} {ends:>20} {unit:<4} | {target:<12} | {peers}",
        values.len(),
        short(median(values)),
        q(0.95),
        q(0.99)
    );
}

/// A single value.
pub fn one(what: &str, value: f64, unit: &str, target: &str, peers: &str) {
    println!(
        "{what:<50} {:>6} {:>9} {:>9} {:>9} {:>20} {unit:<4} | {target:<12} | {peers}",
        1,
        short(value),
        "",
        "",
        ""
    );
}

pub fn note(text: &str) {
    println!("  {text}");
}

fn short(x: f64) -> String {
    match x.abs() {
        a if a >= 1000.0 => format!("{x:.0}"),
        a if a >= 10.0 => format!("{x:.1}"),
        a if a >= 1.0 => format!("{x:.2}"),
        _ => format!("{x:.3}"),
    }
}

/// What reaching the disk costs here and now: the floor of every durable commit.
pub fn fsync() {
    let mut file = tempfile::tempfile().expect("a temporary file");
    let times: Vec<f64> = (0..100)
        .map(|_| {
            let start = Instant::now();
            file.write_all(&[7; 4096]).and_then(|()| file.sync_data()).expect("a disk");
            ms(start.elapsed())
        })
        .collect();
    heading();
    many("4 KiB written and synchronised (floor)", &times, "ms", "", "");
}
