//! The measuring lane: one timed trial at a time on a machine, whatever the
//! process, the database or the user. An advisory lock on a file in the
//! machine's folder for temporary files; the system frees it when its holder dies.

use crate::error::{Error, Result};
use std::fs::{File, OpenOptions, TryLockError};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Shared by all of this machine's users of cullmark.
pub fn default_path() -> PathBuf {
    std::env::temp_dir().join("cullmark.lane")
}

/// The lane, held until dropped.
#[derive(Debug)]
pub struct Held(#[allow(dead_code)] File);

#[derive(Debug)]
pub struct Lane {
    path: PathBuf,
}

impl Lane {
    pub fn new(path: &Path) -> Lane {
        Lane { path: path.to_path_buf() }
    }

    /// The lane if nobody holds it.
    ///
    /// # Errors
    /// When the lock file can neither be opened nor made.
    pub fn try_hold(&self) -> Result<Option<Held>> {
        let file = self.open()?;
        match file.try_lock() {
            Ok(()) => Ok(Some(Held(file))),
            Err(TryLockError::WouldBlock) => Ok(None),
            Err(TryLockError::Error(e)) => Err(self.broken(&e)),
        }
    }

    /// Waits for the lane; `waiting` is called once if it is not free at once.
    /// Polls: a blocked lock could not be interrupted by Ctrl-C.
    ///
    /// # Errors
    /// As [`Lane::try_hold`].
    pub async fn hold(&self, waiting: impl Fn()) -> Result<Held> {
        let mut told = false;
        loop {
            if let Some(held) = self.try_hold()? {
                return Ok(held);
            }
            if !told {
                waiting();
                told = true;
            }
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
    }

    /// An existing file is opened for reading: another user's cannot be written, but can be locked.
    fn open(&self) -> Result<File> {
        if let Ok(file) = File::open(&self.path) {
            return Ok(file);
        }
        match OpenOptions::new().write(true).create_new(true).open(&self.path) {
            Ok(file) => Ok(file),
            Err(e) if e.kind() == std::io::ErrorKind::AlreadyExists => {
                File::open(&self.path).map_err(|e| self.broken(&e))
            }
            Err(e) => Err(self.broken(&e)),
        }
    }

    fn broken(&self, e: &std::io::Error) -> Error {
        Error::io(&self.path, "the lock of the measuring lane cannot be used", e)
            .help("make the folder for temporary files writable, or set TMPDIR to one that is")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
}
