//! Which files a manifest may name. One from a user's own disk may name any; one that
//! came over a network names uploads, or files below the folders that its server allows,
//! and nothing else: neither `..` nor an absolute path nor a link leads out.

use crate::error::{Error, ErrorKind, Result, did_you_mean};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

#[derive(Debug, Clone, Default)]
pub enum Reach {
    /// Files start from the folder of the text that names them.
    #[default]
    Anywhere,
    Within(Allowed),
}

/// Presets that every server offers, by the end of the path that names them.
const PRESETS: &[(&str, &str)] = &[
    ("presets/base.toml", include_str!("../../experiments/presets/base.toml")),
    ("presets/stress.toml", include_str!("../../experiments/presets/stress.toml")),
];

/// What a server offers.
#[derive(Debug, Clone, Default)]
pub struct Allowed {
    /// Canonical.
    pub folders: Vec<PathBuf>,
    /// By name and by id.
    pub uploads: BTreeMap<String, PathBuf>,
}

/// Before the name of an upload.
const UPLOAD: &str = "upload:";

impl Reach {
    /// The text of a preset that needs no file: a manifest of the repository that is sent to
    /// a server names it as it does at home.
    pub fn preset(&self, text: &str) -> Option<&'static str> {
        let known = |(name, _): &&(&str, &str)| text == *name || text.ends_with(&format!("/{name}"));
        PRESETS.iter().filter(|_| matches!(self, Reach::Within(_))).find(known).map(|(_, preset)| *preset)
    }

    /// What others may read of a file's place: a server tells its name alone.
    pub fn shown(&self, file: &Path) -> String {
        let name = file.file_name().filter(|_| matches!(self, Reach::Within(_)));
        name.map_or_else(|| file.display().to_string(), |n| n.to_string_lossy().into_owned())
    }

    /// The file that `text`, written in a file of `folder`, names.
    ///
    /// # Errors
    /// When it is out of reach. What is there and what is not looks the same then.
    pub fn resolve(&self, folder: &Path, text: &str) -> Result<PathBuf> {
        let upload = text.strip_prefix(UPLOAD);
        match (self, upload) {
            (Reach::Anywhere, None) => Ok(folder.join(expanded(text)?)),
            (Reach::Anywhere, Some(_)) => Err(Error::new("uploads are known to a server alone")
                .help("send the manifest to it (`cullmark submit --server URL`), or name a file")),
            (Reach::Within(allowed), Some(name)) => allowed.upload(name),
            (Reach::Within(allowed), None) => allowed.file(folder, text),
        }
    }
}

/// `$NAME/rest` with the variable's value. A server expands nothing: what is set there is
/// none of its users' business.
///
/// # Errors
/// When the variable is not set.
pub fn expanded(text: &str) -> Result<PathBuf> {
    let Some((name, rest)) = text.strip_prefix('$').and_then(|t| t.split_once('/')) else { return Ok(text.into()) };
    match std::env::var_os(name).filter(|v| !v.is_empty()) {
        Some(folder) => Ok(Path::new(&folder).join(rest)),
        None => Err(Error::new(format!("the variable {name} is not set"))
            .help(format!("set it to the folder that holds {rest}: export {name}=/some/folder"))),
    }
}

impl Allowed {
    fn upload(&self, name: &str) -> Result<PathBuf> {
        self.uploads.get(name).cloned().ok_or_else(|| {
            let help = match did_you_mean(name, self.uploads.keys().map(String::as_str)) {
                Some(near) => format!("did you mean `{UPLOAD}{near}`?"),
                None => "send the file first: POST /api/v1/uploads, or the page's Scenes".to_string(),
            };
            Error::new(format!("there is no upload `{name}`")).kind(ErrorKind::Missing).help(help)
        })
    }

    /// From the folder of the preset that names it, if it lies in one, or from an allowed one.
    /// The real place decides, whatever dots and links lead there.
    fn file(&self, folder: &Path, text: &str) -> Result<PathBuf> {
        let inside = |p: PathBuf| {
            let real = p.canonicalize().ok()?;
            self.folders.iter().any(|f| real.starts_with(f)).then_some(real)
        };
        let mut starts = std::iter::once(folder).chain(self.folders.iter().map(PathBuf::as_path));
        let found = starts.find_map(|start| inside(start.join(text)).filter(|_| !text.is_empty()));
        found.ok_or_else(|| {
            let help = if self.folders.is_empty() {
                "upload it and write file = \"upload:NAME\"; this server allows no folder (`serve --scenes DIR` does)"
            } else {
                "write a path below a folder that the server allows (`serve --scenes DIR`), or upload it"
            };
            Error::new(format!("`{text}` is no file that this server offers")).help(help)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn offered(dir: &Path) -> Reach {
        let folders = vec![dir.canonicalize().unwrap()];
        let uploads = BTreeMap::from([("hall.glb".to_string(), PathBuf::from("/u/1.glb"))]);
        Reach::Within(Allowed { folders, uploads })
    }

    #[test]
    fn only_what_is_offered_is_reached() {
        let outer = tempfile::tempdir().unwrap();
        let dir = outer.path().join("scenes");
        std::fs::create_dir_all(dir.join("sub")).unwrap();
        std::fs::write(outer.path().join("secret.obj"), "x").unwrap();
        std::fs::write(dir.join("sub/a.obj"), "x").unwrap();
        let reach = offered(&dir);
        let ask = |text: &str| reach.resolve(Path::new("/anywhere"), text);
        assert!(ask("sub/a.obj").unwrap().ends_with("scenes/sub/a.obj"));
        assert!(ask("./sub/a.obj").is_ok());
        assert_eq!(ask("upload:hall.glb").unwrap(), PathBuf::from("/u/1.glb"));
        for bad in ["../secret.obj", "sub/../../secret.obj", "/etc/passwd", "nowhere.obj", "", "upload:other.glb"] {
            assert!(ask(bad).is_err(), "{bad}");
        }
        assert!(ask("upload:hal.glb").unwrap_err().help.unwrap().contains("did you mean"));
        #[cfg(unix)]
        {
            std::os::unix::fs::symlink(outer.path().join("secret.obj"), dir.join("link.obj")).unwrap();
            std::os::unix::fs::symlink(outer.path(), dir.join("out")).unwrap();
            assert!(ask("link.obj").is_err(), "a link that leads out");
            assert!(ask("out/secret.obj").is_err());
        }
        assert!(Reach::Anywhere.resolve(Path::new("/x"), "../y.obj").is_ok());
        let e = Reach::Anywhere.resolve(Path::new("/x"), "$CULLMARK_NO_SUCH_VARIABLE/y.obj").unwrap_err();
        assert!(e.message.contains("CULLMARK_NO_SUCH_VARIABLE is not set"), "{e}");
        assert!(ask("$HOME/y.obj").is_err(), "a server expands nothing");
    }
}
