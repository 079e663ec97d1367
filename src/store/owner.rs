//! Who holds a lease: boot, process namespace, process and its start time, so
//! that a restarted program can tell at once that the former holder is dead
//! instead of waiting for the lease to run out.

/// This process, as a lease names it.
pub fn this() -> &'static str {
    static THIS: std::sync::OnceLock<String> = std::sync::OnceLock::new();
    THIS.get_or_init(|| {
        format!("{}:{}:{}", machine(), std::process::id(), start_ticks(std::process::id()).unwrap_or(0))
    })
}

/// True only if the holder surely no longer runs: it was on this machine and
/// boot, in our process namespace, and its process is gone or is another one.
pub fn is_dead(owner: &str) -> bool {
    let mut parts = owner.rsplitn(3, ':');
    let (Some(start), Some(pid), Some(place)) = (parts.next(), parts.next(), parts.next()) else {
        return false;
    };
    let (Ok(start), Ok(pid)) = (start.parse::<u64>(), pid.parse::<u32>()) else { return false };
    // Without /proc nothing is known of anybody: the lease has to run out.
    if place != machine() || start_ticks(std::process::id()).is_none() {
        return false;
    }
    start_ticks(pid) != Some(start)
}

fn machine() -> String {
    let read = |path: &str| std::fs::read_to_string(path).map(|s| s.trim().to_string()).unwrap_or_default();
    let namespace = std::fs::read_link("/proc/self/ns/pid").map(|p| p.display().to_string()).unwrap_or_default();
    format!("{}/{}/{namespace}", read("/proc/sys/kernel/hostname"), read("/proc/sys/kernel/random/boot_id"))
}

/// Start of a process in clock ticks since boot (field 22 of /proc/PID/stat); none for a zombie.
fn start_ticks(pid: u32) -> Option<u64> {
    let stat = std::fs::read_to_string(format!("/proc/{pid}/stat")).ok()?;
    // The name in parentheses may hold anything, also parentheses and spaces.
    let mut fields = stat.rsplit_once(')')?.1.split_whitespace();
    let state = fields.next()?;
    if matches!(state, "Z" | "X") {
        return None;
    }
    fields.nth(18)?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[cfg(target_os = "linux")]
    fn the_living_keep_their_leases_and_the_dead_do_not() {
        assert!(!is_dead(this()));
        let mut child = std::process::Command::new("sleep").arg("60").spawn().unwrap();
        let start = start_ticks(child.id()).unwrap();
        let owner = format!("{}:{}:{start}", machine(), child.id());
        assert!(!is_dead(&owner));
        assert!(is_dead(&format!("{}:{}:{}", machine(), child.id(), start + 1)), "the id was given to another process");
        child.kill().unwrap();
        child.wait().unwrap();
        assert!(is_dead(&owner));
        assert!(!is_dead("elsewhere:1:1"), "another machine may well be alive");
        assert!(!is_dead("nonsense"));
    }
}
