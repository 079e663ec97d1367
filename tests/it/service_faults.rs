//! The service under faults, in short: the long study is `cargo bench --bench faults`.

#[path = "../../benches/faults/mod.rs"]
mod study;

use std::time::Duration;

#[test]
#[cfg(target_os = "linux")]
fn kills_a_full_disk_and_a_locked_database_lose_nothing() {
    let plan = study::Plan {
        kills: 6,
        runs: 24,
        repeats: 1,
        full: 1,
        locks: 1,
        long_locks: 0,
        stops: 0,
        // Debug builds, beside other tests.
        healthy_within: Duration::from_secs(20),
        orphans_within: Duration::from_secs(10),
        ..study::Plan::long()
    };
    let report = study::run(&plan);
    println!("{}\n{}", plan.words(), report.text);
    assert!(report.violations.is_empty(), "{:#?}\n{}", report.violations, report.text);
}
