//! A copy of the whole database while others write it: one consistent moment.

use super::Store;
use crate::error::{Error, Result};
use std::path::Path;

impl Store {
    /// Copies everything into the new file `out`, which must not exist.
    ///
    /// # Errors
    /// When `out` exists or cannot be written, or the database fails.
    pub async fn backup(&self, out: &Path) -> Result<u64> {
        let exists = || {
            Error::new("there is such a file already: a backup never replaces one")
                .in_file(out)
                .help("name another file, or remove this one first")
        };
        if out.exists() {
            return Err(exists());
        }
        // Written beside and renamed: a backup that was interrupted does not look like one.
        let mut part = out.as_os_str().to_owned();
        part.push(".part");
        let part = Path::new(&part);
        let _ = std::fs::remove_file(part);
        let text = part.to_str().ok_or_else(|| Error::new("the name is not UTF-8").in_file(out))?;
        // A reading connection: VACUUM INTO takes a snapshot and blocks no writer.
        let done = sqlx::query("VACUUM INTO $1").bind(text).execute(&self.readers).await;
        if let Err(e) = done {
            let _ = std::fs::remove_file(part);
            return Err(self.explain("the backup", &e));
        }
        let io = |e: std::io::Error| Error::io(out, "the backup cannot be written", &e).help("choose another folder");
        std::fs::File::open(part).and_then(|f| f.sync_all()).map_err(io)?;
        if out.exists() {
            return Err(exists());
        }
        std::fs::rename(part, out).map_err(io)?;
        Ok(std::fs::metadata(out).map_err(io)?.len())
    }
}
