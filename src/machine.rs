//! The machine under the measurement: what it is, where a trial is pinned,
//! and whether it was quiet. Everything here is Linux first; elsewhere the
//! answers are "unknown" and pinning does nothing.

pub mod fitness;

use crate::error::{Error, Result};
use crate::record::Environment;
use std::hint::black_box;
use std::time::Instant;

/// The widest instruction set of the culling kernels on this machine.
pub fn isa() -> &'static str {
    #[cfg(target_arch = "x86_64")]
    {
        if std::arch::is_x86_feature_detected!("avx512f") {
            return "avx512";
        }
        if std::arch::is_x86_feature_detected!("avx2") {
            return "avx2";
        }
    }
    "scalar"
}

/// Numbers of the cores this process may use, ascending: a container or
/// `taskset` may leave it any of the machine's. Asked once: pinning narrows what the
/// system answers later, and a trial would name another class of machine than its study.
pub fn cores() -> &'static [u32] {
    static CORES: std::sync::OnceLock<Vec<u32>> = std::sync::OnceLock::new();
    CORES.get_or_init(|| {
        // A quota may allow fewer at a time than there are to choose from.
        let count = std::thread::available_parallelism().map_or(1, |n| n.get());
        let mut cores = affinity();
        if cores.len() < count {
            cores = (0..count as u32).collect();
        }
        cores.split_off(cores.len() - count)
    })
}

pub fn core_count() -> u32 {
    cores().len() as u32
}

#[cfg(target_os = "linux")]
fn affinity() -> Vec<u32> {
    // SAFETY: cpu_set_t is plain bits and valid when zeroed; sched_getaffinity fills
    // as many bytes as it is given; CPU_ISSET checks its index against the set's size.
    unsafe {
        let mut set: libc::cpu_set_t = std::mem::zeroed();
        if libc::sched_getaffinity(0, size_of::<libc::cpu_set_t>(), &mut set) != 0 {
            return Vec::new();
        }
        (0..libc::CPU_SETSIZE as usize).filter(|c| libc::CPU_ISSET(*c, &set)).map(|c| c as u32).collect()
    }
}

#[cfg(not(target_os = "linux"))]
fn affinity() -> Vec<u32> {
    Vec::new()
}

/// `release`, `dist`, `debug`: as this binary was built.
pub fn build_profile() -> &'static str {
    env!("CULLMARK_PROFILE")
}

/// The core of the measuring lane: the last one, since interrupts and daemons
/// favour the first. `None` on a machine with one core.
pub fn measuring_core() -> Option<u32> {
    match cores() {
        [.., _, last] => Some(*last),
        _ => None,
    }
}

/// What is stored with every trial.
pub fn environment(pinned_core: Option<u32>) -> Environment {
    let read = |path: &str| std::fs::read_to_string(path).unwrap_or_default();
    let field = |text: &str, key: &str| {
        let line = text.lines().find(|l| l.starts_with(key))?;
        line.split_once(':').map(|(_, v)| v.trim().to_string())
    };
    let unknown = || "unknown".to_string();
    let cpuinfo = read("/proc/cpuinfo");
    let cpu = field(&cpuinfo, "model name").unwrap_or_else(unknown);
    let family = field(&cpuinfo, "cpu family").unwrap_or_default();
    let model = field(&cpuinfo, "model\t").unwrap_or_default();
    let memory_kib: u64 =
        field(&read("/proc/meminfo"), "MemTotal").and_then(|v| v.split_whitespace().next()?.parse().ok()).unwrap_or(0);
    let os = read("/etc/os-release")
        .lines()
        .find_map(|l| l.strip_prefix("PRETTY_NAME=").map(|v| v.trim_matches('"').to_string()))
        .unwrap_or_else(|| std::env::consts::OS.to_string());
    let governor = read("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor").trim().to_string();
    let cores = core_count();
    let slug: String = cpu
        .to_lowercase()
        .chars()
        .map(|c| if c.is_ascii_alphanumeric() { c } else { '-' })
        .collect::<String>()
        .split('-')
        .filter(|s| !s.is_empty())
        .collect::<Vec<_>>()
        .join("-");
    Environment {
        machine_class: format!("{slug}-f{family}m{model}-{cores}c-{}", isa()),
        cpu,
        cores,
        memory_mib: memory_kib / 1024,
        kernel: read("/proc/sys/kernel/osrelease").trim().to_string(),
        os,
        compiler: env!("CULLMARK_RUSTC").to_string(),
        cullmark: env!("CARGO_PKG_VERSION").to_string(),
        commit: env!("CULLMARK_COMMIT").to_string(),
        build_profile: build_profile().to_string(),
        isa: isa().to_string(),
        governor: if governor.is_empty() { unknown() } else { governor },
        pinned_core,
    }
}

/// Restricts the calling thread, and threads it starts later, to `cores`.
#[cfg(target_os = "linux")]
pub fn pin_to(cores: &[u32]) -> Result<()> {
    // SAFETY: cpu_set_t is plain bits and valid when zeroed; CPU_SET checks its
    // index against the set's size; sched_setaffinity only reads the set.
    let ok = unsafe {
        let mut set: libc::cpu_set_t = std::mem::zeroed();
        for core in cores {
            libc::CPU_SET(*core as usize, &mut set);
        }
        libc::sched_setaffinity(0, size_of::<libc::cpu_set_t>(), &set) == 0
    };
    if ok {
        return Ok(());
    }
    Err(Error::new(format!("cannot pin to cores {cores:?}: {}", std::io::Error::last_os_error()))
        .help("choose a core that this process may use (see `taskset -p`), or leave pinning off"))
}

#[cfg(not(target_os = "linux"))]
pub fn pin_to(_cores: &[u32]) -> Result<()> {
    Ok(())
}

/// Every core but the measuring one: where judges and builds may run.
pub fn auxiliary_cores(measuring: Option<u32>) -> Vec<u32> {
    cores().iter().copied().filter(|c| Some(*c) != measuring).collect()
}

/// Caps the address space of this process; an allocation beyond it aborts.
#[cfg(unix)]
pub fn limit_memory(mib: u64) -> Result<()> {
    let bytes = mib.saturating_mul(1 << 20);
    let limit = libc::rlimit { rlim_cur: bytes, rlim_max: bytes };
    // SAFETY: setrlimit reads one rlimit, alive for the call.
    if unsafe { libc::setrlimit(libc::RLIMIT_AS, &limit) } == 0 {
        return Ok(());
    }
    Err(Error::new(format!("cannot limit memory to {mib} MiB: {}", std::io::Error::last_os_error())))
}

#[cfg(not(unix))]
pub fn limit_memory(_mib: u64) -> Result<()> {
    Ok(())
}

/// Peak resident set of this process. Not `getrusage`: its maximum survives
/// exec and would show the parent's.
pub fn peak_rss_bytes() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"));
    line.and_then(|v| v.split_whitespace().next()?.parse::<u64>().ok()).unwrap_or(0) * 1024
}

/// Returns to the system what large answers and submissions left behind in the heap: glibc
/// keeps it otherwise, an arena a thread.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
pub fn give_back_memory() {
    // SAFETY: malloc_trim takes a number, locks what it touches and frees nothing that is in use.
    unsafe { libc::malloc_trim(0) };
}

#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
pub fn give_back_memory() {}

/// How often the scheduler took this thread off its core against its will.
#[cfg(target_os = "linux")]
pub fn involuntary_switches() -> u64 {
    // SAFETY: rusage is plain integers, valid when zeroed; getrusage fills it.
    unsafe {
        let mut usage: libc::rusage = std::mem::zeroed();
        libc::getrusage(libc::RUSAGE_THREAD, &mut usage);
        usage.ru_nivcsw as u64
    }
}

#[cfg(not(target_os = "linux"))]
pub fn involuntary_switches() -> u64 {
    0
}

/// Times a fixed kernel (dependent multiplications and reads over 512 KiB, near
/// 0.3 ms): the median of five. Short, since every trial pays for it twice. A machine that is shared, throttled or
/// interrupted shows in it before it shows in a result.
pub fn sentinel_ns() -> f64 {
    let table: Vec<u64> = (0..65_536u64).map(|i| i.wrapping_mul(0x9E37_79B9_7F4A_7C15)).collect();
    let runs: Vec<f64> = (0..5u64)
        .map(|run| {
            let start = Instant::now();
            let mut x = run | 1;
            for _ in 0..60_000 {
                x = x.wrapping_mul(0xD129_0D3B_5B92_3C45) ^ table[(x >> 48) as usize];
            }
            black_box(x);
            start.elapsed().as_nanos() as f64
        })
        .collect();
    crate::stats::median(&runs)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_environment_names_the_machine() {
        let e = environment(None);
        assert!(e.cores >= 1 && !e.machine_class.is_empty());
        assert!(e.compiler.contains("rustc"), "{}", e.compiler);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_pinned_thread_runs_on_its_core_and_an_absent_core_is_refused() {
        std::thread::spawn(|| {
            pin_to(&[0]).unwrap();
            // SAFETY: no arguments, no effects.
            assert_eq!(unsafe { libc::sched_getcpu() }, 0);
            assert!(pin_to(&[900]).unwrap_err().help.is_some());
        })
        .join()
        .unwrap();
    }

    #[test]
    fn the_sentinel_takes_time() {
        assert!(sentinel_ns() > 1000.0);
        assert!(peak_rss_bytes() > 0);
    }
}
