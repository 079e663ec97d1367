//! Is this machine fit to measure? What is known to disturb timings, checked one by one:
//! frequency governor, turbo, other load, time stolen by a hypervisor, free cores, how
//! much a fixed piece of work varies, and room for the results.

use super::{auxiliary_cores, cores};
use crate::stats;
use std::path::Path;
use std::time::{Duration, Instant};

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    Good,
    Warn,
    Bad,
    Unknown,
}

impl Verdict {
    pub fn word(self) -> &'static str {
        match self {
            Verdict::Good => "good",
            Verdict::Warn => "warn",
            Verdict::Bad => "bad",
            Verdict::Unknown => "unknown",
        }
    }
}

#[derive(Debug, Clone)]
pub struct Check {
    pub name: &'static str,
    pub verdict: Verdict,
    pub value: String,
    /// What to do; empty where all is well.
    pub advice: String,
}

/// The kernel's counters are watched so long.
const WATCH: Duration = Duration::from_millis(400);
/// Pieces of the noise probe.
const PIECES: usize = 200;

/// Nothing is bad. What cannot be known is no reason against measuring.
pub fn fit(checks: &[Check]) -> bool {
    checks.iter().all(|c| c.verdict != Verdict::Bad)
}

/// All checks; takes about half a second. `folder` is where results go, `lane` the core
/// that trials are pinned to, `noise` the sentinel of earlier trials over its usual time.
/// `quiet` says that nobody measures meanwhile: the probe computes on the measuring core.
pub fn checks(folder: &Path, lane: Option<u32>, noise: Option<f64>, quiet: bool) -> Vec<Check> {
    let before = Ticks::read();
    std::thread::sleep(WATCH);
    let after = Ticks::read();
    let mut out = vec![lanes(lane), governor(lane), turbo(), steal(before.as_ref(), after.as_ref()), load()];
    out.push(if quiet { probe(lane) } else { unknown("noise", "a trial is being measured: ask again later") });
    out.push(earlier(noise));
    out.push(memory());
    out.push(disk(folder));
    out
}

fn check(name: &'static str, verdict: Verdict, value: impl Into<String>, advice: impl Into<String>) -> Check {
    let advice = if verdict == Verdict::Good { String::new() } else { advice.into() };
    Check { name, verdict, value: value.into(), advice }
}

fn unknown(name: &'static str, why: &str) -> Check {
    check(name, Verdict::Unknown, "unknown", why)
}

fn read(path: &str) -> Option<String> {
    std::fs::read_to_string(path).ok().map(|s| s.trim().to_string())
}

fn lanes(lane: Option<u32>) -> Check {
    match lane {
        None => check(
            "cores",
            Verdict::Warn,
            "1",
            "trials and judgements take turns on the only core: times are sound, but a study takes longer",
        ),
        Some(core) => {
            let beside = auxiliary_cores(lane).len();
            let value = format!("{}; core {core} measures, {beside} beside it judge", cores().len());
            check("cores", Verdict::Good, value, "")
        }
    }
}

fn governor(lane: Option<u32>) -> Check {
    let path = format!("/sys/devices/system/cpu/cpu{}/cpufreq/scaling_governor", lane.unwrap_or(0));
    match read(&path) {
        None => unknown("governor", "the system does not tell it; in a virtual machine the host decides"),
        Some(g) if g == "performance" => check("governor", Verdict::Good, g, ""),
        Some(g) => check(
            "governor",
            Verdict::Warn,
            g,
            "the clock follows the load: `cpupower frequency-set -g performance` fixes it",
        ),
    }
}

fn turbo() -> Check {
    let no_turbo = read("/sys/devices/system/cpu/intel_pstate/no_turbo").map(|s| s == "1");
    let boost = read("/sys/devices/system/cpu/cpufreq/boost").map(|s| s == "0");
    match no_turbo.or(boost) {
        None => unknown("turbo", "the system does not tell it; in a virtual machine the host decides"),
        Some(true) => check("turbo", Verdict::Good, "off", ""),
        Some(false) => check(
            "turbo",
            Verdict::Warn,
            "on",
            "the clock depends on heat and on other cores: turn it off for figures that are to be published",
        ),
    }
}

/// Ticks of all cores since boot: stolen, all.
struct Ticks(u64, u64);

impl Ticks {
    fn read() -> Option<Ticks> {
        let text = std::fs::read_to_string("/proc/stat").ok()?;
        let line = text.lines().find(|l| l.starts_with("cpu "))?;
        let n: Vec<u64> = line.split_whitespace().skip(1).filter_map(|w| w.parse().ok()).collect();
        // user nice system idle iowait irq softirq steal
        Some(Ticks(*n.get(7)?, n.iter().take(8).sum()))
    }
}

fn steal(before: Option<&Ticks>, after: Option<&Ticks>) -> Check {
    let (Some(a), Some(b)) = (before, after) else {
        return unknown("steal", "the system does not count it");
    };
    let all = b.1.saturating_sub(a.1).max(1) as f64;
    let share = b.0.saturating_sub(a.0) as f64 / all;
    let advice = "the hypervisor gives this machine's time to others: measure on a dedicated one, or repeat more often";
    let verdict = match share {
        s if s > 0.05 => Verdict::Bad,
        s if s > 0.005 => Verdict::Warn,
        _ => Verdict::Good,
    };
    check("steal", verdict, format!("{:.1} % of the time", share * 100.0), advice)
}

fn load() -> Check {
    let Some(text) = read("/proc/loadavg") else { return unknown("load", "the system does not count it") };
    let one: f64 = text.split_whitespace().next().and_then(|w| w.parse().ok()).unwrap_or(0.0);
    let free = cores().len() as f64 - one;
    let verdict = match free {
        f if f < 0.0 => Verdict::Bad,
        f if f < 1.0 => Verdict::Warn,
        _ => Verdict::Good,
    };
    let value = format!("{one:.2} over the last minute, {} cores", cores().len());
    check("load", verdict, value, "other programs run: end them, or wait until at least one core is free")
}

/// The same piece of work over and over: what varies is the machine.
fn probe(lane: Option<u32>) -> Check {
    // On a thread of its own: pinning would outlast the probe.
    let work = move || {
        if let Some(core) = lane {
            let _ = super::pin_to(&[core]);
        }
        let piece = || {
            let start = Instant::now();
            let mut x = 0x9E37_79B9_7F4A_7C15u64;
            for _ in 0..100_000 {
                x ^= x << 13;
                x ^= x >> 7;
                x ^= x << 17;
            }
            std::hint::black_box(x);
            start.elapsed().as_secs_f64()
        };
        (0..PIECES).map(|_| piece()).collect::<Vec<f64>>()
    };
    let Ok(times) = std::thread::spawn(work).join() else { return unknown("noise", "the probe failed") };
    let (median, worst) = (stats::median(&times), stats::quantile(&times, 0.95));
    let spread = worst / median - 1.0;
    let verdict = match spread {
        s if s > 0.3 => Verdict::Bad,
        s if s > 0.05 => Verdict::Warn,
        _ => Verdict::Good,
    };
    let value = format!("95th percentile of a fixed piece of work {:.1} % above its median", spread * 100.0);
    check(
        "noise",
        verdict,
        value,
        "something disturbs the measuring core now; trials that it hits are marked and repeated",
    )
}

fn earlier(noise: Option<f64>) -> Check {
    match noise {
        None => unknown("earlier trials", "none are stored yet on this class of machine"),
        Some(n) => {
            let verdict = match n {
                n if n > 0.3 => Verdict::Bad,
                n if n > 0.1 => Verdict::Warn,
                _ => Verdict::Good,
            };
            let value = format!("{:.0} % of the last trials were disturbed", n * 100.0);
            check(
                "earlier trials",
                verdict,
                value,
                "the machine is busy at times: repeat more often, or measure at night",
            )
        }
    }
}

fn memory() -> Check {
    let text = std::fs::read_to_string("/proc/meminfo").unwrap_or_default();
    let kib =
        text.lines().find_map(|l| l.strip_prefix("MemAvailable:")?.split_whitespace().next()?.parse::<f64>().ok());
    match kib {
        None => unknown("memory", "the system does not tell it"),
        Some(kib) => {
            let gib = kib / f64::from(1 << 20);
            let verdict = match gib {
                g if g < 0.5 => Verdict::Bad,
                g if g < 2.0 => Verdict::Warn,
                _ => Verdict::Good,
            };
            check("memory", verdict, format!("{gib:.1} GiB available"), "large scenes and their ground truth need more")
        }
    }
}

fn disk(folder: &Path) -> Check {
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    match free_bytes(folder) {
        None => unknown("disk", "the system does not tell it"),
        Some(bytes) => {
            let gib = bytes as f64 / f64::from(1 << 30);
            let verdict = match gib {
                g if g < 0.2 => Verdict::Bad,
                g if g < 2.0 => Verdict::Warn,
                _ => Verdict::Good,
            };
            check(
                "disk",
                verdict,
                format!("{gib:.1} GiB free where results go"),
                "free some space; `cullmark compact` shrinks the database",
            )
        }
    }
}

#[cfg(unix)]
fn free_bytes(folder: &Path) -> Option<u64> {
    use std::os::unix::ffi::OsStrExt;
    let path = std::ffi::CString::new(folder.as_os_str().as_bytes()).ok()?;
    // SAFETY: statvfs is plain bits and valid when zeroed; the path ends in a zero byte
    // and both outlive the call, which only writes the struct.
    unsafe {
        let mut stat: libc::statvfs = std::mem::zeroed();
        (libc::statvfs(path.as_ptr(), &mut stat) == 0).then(|| stat.f_bavail as u64 * stat.f_frsize as u64)
    }
}

#[cfg(not(unix))]
fn free_bytes(_folder: &Path) -> Option<u64> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_check_says_something_and_advises_where_it_is_not_good() {
        let all = checks(Path::new("."), None, Some(0.5), true);
        assert_eq!(all.len(), 9);
        for c in &all {
            assert!(!c.value.is_empty(), "{c:?}");
            assert_eq!(c.advice.is_empty(), c.verdict == Verdict::Good, "{c:?}");
        }
        assert_eq!(all.iter().find(|c| c.name == "earlier trials").unwrap().verdict, Verdict::Bad);
        assert!(!fit(&all));
    }
}
