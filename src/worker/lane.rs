//! The measuring lane: one timed trial at a time on a machine, whatever the
//! process, the database or the user. An advisory lock on a file that all of
//! them find; the system frees it when its holder dies.

use crate::error::{Error, Result};
use std::fs::{File, OpenOptions, TryLockError};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Names another lock file, such as one on a file system that several containers share.
pub const VARIABLE: &str = "CULLMARK_LANE";

/// How often one who waits looks again: the lane idles so long when it changes hands.
const POLL: Duration = Duration::from_millis(2);

/// Shared by all of this machine's users of cullmark. Not in `$TMPDIR`, of which
/// each user or session may have one of its own.
pub fn default_path() -> PathBuf {
    if let Some(path) = std::env::var_os(VARIABLE).filter(|p| !p.is_empty()) {
        return PathBuf::from(path);
    }
    let shared = Path::new("/tmp");
    let folder = if cfg!(unix) && shared.is_dir() { shared.to_path_buf() } else { std::env::temp_dir() };
    folder.join("cullmark.lane")
}

/// The lane, held until dropped.
#[derive(Debug)]
pub struct Held(#[allow(dead_code)] File);

#[derive(Debug)]
pub struct Lane {
    path: PathBuf,
    /// Held by whoever is next: without it, the one who lets go would be the first to
    /// ask again, and another study would hardly get a turn.
    turnstile: PathBuf,
}

impl Lane {
    pub fn new(path: &Path) -> Lane {
        let mut turnstile = path.as_os_str().to_owned();
        turnstile.push(".next");
        Lane { path: path.to_path_buf(), turnstile: turnstile.into() }
    }

    /// The lane if nobody holds it.
    ///
    /// # Errors
    /// When the lock file can neither be opened nor made.
    pub fn try_hold(&self) -> Result<Option<Held>> {
        lock(&self.path)
    }

    /// Waits for the lane; `waiting` is called once if it is not free at once.
    /// Polls: a blocked lock could not be interrupted by Ctrl-C.
    ///
    /// # Errors
    /// As [`Lane::try_hold`].
    pub async fn hold(&self, waiting: impl Fn()) -> Result<Held> {
        let mut told = false;
        let mut next = None;
        loop {
            if next.is_none() {
                next = lock(&self.turnstile)?;
            }
            if next.is_some()
                && let Some(held) = lock(&self.path)?
            {
                return Ok(held);
            }
            if !told {
                waiting();
                told = true;
            }
            tokio::time::sleep(POLL).await;
        }
    }
}

fn lock(path: &Path) -> Result<Option<Held>> {
    let file = open(path)?;
    match file.try_lock() {
        // A cleaner of temporary files may have removed it, and another made a new one.
        Ok(()) if !is_at(&file, path) => Ok(None),
        Ok(()) => Ok(Some(Held(file))),
        Err(TryLockError::WouldBlock) => Ok(None),
        Err(TryLockError::Error(e)) => Err(broken(path, &e)),
    }
}

/// An existing file is opened for reading: another user's cannot be written, but can be locked.
fn open(path: &Path) -> Result<File> {
    if let Ok(file) = File::open(path) {
        return Ok(file);
    }
    match OpenOptions::new().write(true).create_new(true).open(path) {
        Ok(file) => {
            // Whatever the umask says, other users must be able to open it.
            #[cfg(unix)]
            {
                use std::os::unix::fs::PermissionsExt;
                let _ = file.set_permissions(std::fs::Permissions::from_mode(0o644));
            }
            Ok(file)
        }
        Err(e) if e.kind() == std::io::ErrorKind::AlreadyExists => File::open(path).map_err(|e| broken(path, &e)),
        Err(e) => Err(broken(path, &e)),
    }
}

#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let same = |a: &std::fs::Metadata, b: &std::fs::Metadata| (a.dev(), a.ino()) == (b.dev(), b.ino());
    matches!((file.metadata(), std::fs::metadata(path)), (Ok(a), Ok(b)) if same(&a, &b))
}

#[cfg(not(unix))]
fn is_at(_file: &File, _path: &Path) -> bool {
    true
}

fn broken(path: &Path, e: &std::io::Error) -> Error {
    Error::io(path, "the lock of the measuring lane cannot be used", e)
        .help(format!("make it readable (`chmod 644`) and its folder writable, or name another file in ${VARIABLE}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::{Arc, Mutex};

    #[test]
    fn only_one_holds_the_lane_and_letting_go_frees_it() {
        let dir = tempfile::tempdir().unwrap();
        let lane = Lane::new(&dir.path().join("x.lane"));
        let held = lane.try_hold().unwrap();
        assert!(held.is_some());
        assert!(lane.try_hold().unwrap().is_none());
        drop(held);
        assert!(lane.try_hold().unwrap().is_some());
        let e = Lane::new(&dir.path().join("absent/x.lane")).try_hold().unwrap_err();
        assert!(e.help.is_some() && e.file.is_some());
    }

    #[test]
    #[cfg(unix)]
    fn a_lock_file_that_was_removed_and_made_anew_still_lets_one_in() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("x.lane");
        let file = open(&path).unwrap();
        std::fs::remove_file(&path).unwrap();
        assert!(!is_at(&file, &path));
        let held = lock(&path).unwrap();
        assert!(held.is_some() && lock(&path).unwrap().is_none());
        assert!(!is_at(&file, &path), "the old one is another");
        let mode = std::os::unix::fs::PermissionsExt::mode(&std::fs::metadata(&path).unwrap().permissions());
        assert_eq!(mode & 0o444, 0o444, "other users can lock it too");
    }

    #[tokio::test(flavor = "multi_thread", worker_threads = 3)]
    async fn those_who_wait_get_their_turn() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("x.lane");
        let log = Arc::new(Mutex::new(Vec::new()));
        let tasks: Vec<_> = (0..2)
            .map(|who| {
                let (path, log) = (path.clone(), log.clone());
                tokio::spawn(async move {
                    let lane = Lane::new(&path);
                    for _ in 0..10 {
                        let held = lane.hold(|| ()).await.unwrap();
                        log.lock().unwrap().push(who);
                        tokio::time::sleep(Duration::from_millis(8)).await;
                        drop(held);
                    }
                })
            })
            .collect();
        for task in tasks {
            task.await.unwrap();
        }
        // While both ask (until one has had its ten), neither goes more than a few times in a row.
        let log = log.lock().unwrap();
        let end = (0..log.len()).find(|n| (0..2).any(|w| log[..*n].iter().filter(|x| **x == w).count() == 10)).unwrap();
        let changes = log[..end].windows(2).filter(|w| w[0] != w[1]).count();
        assert!(changes >= 6, "{log:?}");
    }
}
