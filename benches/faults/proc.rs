//! Processes as /proc shows them. Only those that we started, and theirs, are ever touched:
//! a number alone is not enough, the start time goes with it.

use std::fs;

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Id {
    pub pid: i32,
    start: u64,
}

#[derive(Debug, Clone, Copy)]
pub struct Seen {
    pub id: Id,
    pub parent: i32,
    /// It has ended, and nobody has asked how.
    pub zombie: bool,
}

fn look(pid: i32) -> Option<Seen> {
    let stat = fs::read_to_string(format!("/proc/{pid}/stat")).ok()?;
    // The name in parentheses may hold anything.
    let fields: Vec<&str> = stat.rsplit_once(')')?.1.split_whitespace().collect();
    let id = Id { pid, start: fields.get(19)?.parse().ok()? };
    Some(Seen { id, parent: fields.get(1)?.parse().ok()?, zombie: matches!(*fields.first()?, "Z" | "X") })
}

pub fn all() -> Vec<Seen> {
    let numbers = fs::read_dir("/proc").expect("/proc").flatten();
    numbers.filter_map(|e| look(e.file_name().to_str()?.parse().ok()?)).collect()
}

pub fn children(parent: u32) -> Vec<Seen> {
    all().into_iter().filter(|p| p.parent == parent as i32).collect()
}

/// Still there, and not only waiting to be asked how it ended.
pub fn runs(id: Id) -> bool {
    look(id.pid).is_some_and(|p| p.id == id && !p.zombie)
}

/// What it was started as: the verb of our program.
pub fn verb(pid: i32) -> String {
    let line = fs::read(format!("/proc/{pid}/cmdline")).unwrap_or_default();
    let word = line.split(|b| *b == 0).nth(1).unwrap_or_default();
    String::from_utf8_lossy(word).into_owned()
}

/// Processes in whose environment `tag` stands.
pub fn tagged(tag: &str) -> Vec<i32> {
    let has = |p: &Seen| {
        let environment = fs::read(format!("/proc/{}/environ", p.id.pid)).unwrap_or_default();
        environment.split(|b| *b == 0).any(|v| v == tag.as_bytes())
    };
    all().into_iter().filter(has).map(|p| p.id.pid).collect()
}

pub fn signal(id: Id, signal: i32) {
    if look(id.pid).is_some_and(|p| p.id == id) {
        // SAFETY: kill takes two integers; the process is ours and still the same one.
        unsafe { libc::kill(id.pid, signal) };
    }
}

pub fn id_of(pid: u32) -> Option<Id> {
    look(pid as i32).map(|p| p.id)
}

/// Takes note of the ends of orphans that became ours.
pub fn reap(pid: i32) {
    // SAFETY: waitpid writes nothing where it is given no place; the process is our ended child.
    unsafe { libc::waitpid(pid, std::ptr::null_mut(), libc::WNOHANG) };
}
