//! The bytes of a glTF: GLB chunks, files beside it, base64 data URIs.

use crate::error::{Error, Result};
use crate::scene::load::read_beside;
use base64::Engine;
use gltf::buffer::Source;
use std::borrow::Cow;
use std::path::{Path, PathBuf};

/// JSON and binary chunk of a GLB; a text file is all JSON.
pub fn split(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>)> {
    if !bytes.starts_with(b"glTF") {
        return Ok((bytes, None));
    }
    let cut = |what: &str, want: usize, have: usize| {
        Error::new(format!("{what} should have {want} bytes, but {have} are there"))
            .help("the file was probably cut short: copy or export it again")
    };
    let word = |at: usize| bytes.get(at..at + 4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as usize);
    let (Some(version), Some(length)) = (word(4), word(8)) else {
        return Err(cut("the GLB header", 12, bytes.len()));
    };
    if version != 2 {
        return Err(Error::new(format!("GLB version {version} is not supported")).help("export it as glTF 2.0"));
    }
    if length > bytes.len() {
        return Err(cut("the GLB", length, bytes.len()));
    }
    let mut chunks = [None, None];
    let mut at = 12;
    while at < length {
        let (Some(size), Some(kind)) = (word(at), bytes.get(at + 4..at + 8)) else {
            return Err(cut("a chunk header", 8, bytes.len() - at));
        };
        at += 8;
        let Some(chunk) = bytes.get(at..at.saturating_add(size)) else {
            return Err(cut("a chunk", size, bytes.len() - at));
        };
        // Unknown chunks belong to extensions and are passed over.
        match kind {
            b"JSON" if chunks[0].is_none() => chunks[0] = Some(chunk),
            b"BIN\0" if chunks[1].is_none() => chunks[1] = Some(chunk),
            _ => {}
        }
        at += size;
    }
    match chunks {
        [Some(json), bin] => Ok((json, bin)),
        [None, _] => Err(Error::new("the GLB has no JSON chunk").help("export it again")),
    }
}

/// The bytes of every buffer, at least as long as declared.
pub fn load<'a>(document: &gltf::Document, path: &Path, blob: Option<&'a [u8]>) -> Result<Vec<Cow<'a, [u8]>>> {
    document
        .buffers()
        .map(|buffer| {
            let (n, declared) = (buffer.index(), buffer.length());
            let (what, bytes) = match buffer.source() {
                Source::Bin => match blob {
                    Some(blob) => ("the binary chunk".to_string(), Cow::Borrowed(blob)),
                    None => {
                        return Err(Error::new(format!("buffer {n} should be in the file, which has no binary chunk"))
                            .help("the file was probably cut short, or is a .glb renamed .gltf"));
                    }
                },
                Source::Uri(uri) if uri.starts_with("data:") => {
                    ("its data URI".to_string(), Cow::Owned(data_uri(uri, n)?))
                }
                Source::Uri(uri) => {
                    let file = beside(path, uri, n)?;
                    let bytes = read_beside(&file).map_err(|e| {
                        Error::new(format!("buffer {n} is in {}, which cannot be read: {e}", file.display()))
                            .help("keep a .gltf together with its .bin files, or pack them into one .glb")
                    })?;
                    (file.display().to_string(), Cow::Owned(bytes))
                }
            };
            if bytes.len() < declared {
                let have = bytes.len();
                return Err(Error::new(format!("buffer {n} should have {declared} bytes, but {what} has {have}"))
                    .help("a file was probably cut short: copy or export it again"));
            }
            Ok(bytes)
        })
        .collect()
}

/// Files outside the glTF that its content depends on; none if it cannot be parsed
/// (reading will say why).
pub fn external_files(path: &Path, bytes: &[u8]) -> Vec<PathBuf> {
    let Ok((json, _)) = split(bytes) else { return Vec::new() };
    let root: serde_json::Value = serde_json::from_slice(json).unwrap_or_default();
    let buffers = root["buffers"].as_array().cloned().unwrap_or_default();
    let uris = buffers.iter().filter_map(|b| b["uri"].as_str()).filter(|u| !u.starts_with("data:"));
    uris.filter_map(|u| beside(path, u, 0).ok()).collect()
}

fn beside(path: &Path, uri: &str, n: usize) -> Result<PathBuf> {
    if uri.contains("://") {
        return Err(Error::new(format!("buffer {n} is at {uri}, and cullmark fetches nothing"))
            .help("download it and store it beside the file"));
    }
    Ok(path.parent().unwrap_or(Path::new("")).join(percent_decoded(uri)))
}

/// `%20` and its like; what is not valid stays as it is written.
fn percent_decoded(uri: &str) -> String {
    let mut out = Vec::with_capacity(uri.len());
    let mut rest = uri.as_bytes();
    while let Some((first, tail)) = rest.split_first() {
        let hex = tail.get(..2).and_then(|h| std::str::from_utf8(h).ok());
        match (first, hex.and_then(|h| u8::from_str_radix(h, 16).ok())) {
            (b'%', Some(byte)) => {
                out.push(byte);
                rest = &tail[2..];
            }
            _ => {
                out.push(*first);
                rest = tail;
            }
        }
    }
    String::from_utf8(out).unwrap_or_else(|_| uri.to_string())
}

fn data_uri(uri: &str, n: usize) -> Result<Vec<u8>> {
    let Some((_, base64)) = uri.split_once(";base64,") else {
        return Err(Error::new(format!("buffer {n} has a data URI that is not base64")).help("export it as .glb"));
    };
    base64::engine::general_purpose::STANDARD
        .decode(base64.trim())
        .map_err(|e| Error::new(format!("buffer {n} has a damaged data URI: {e}")).help("export it again"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_with_escapes_are_decoded_and_strays_left_alone() {
        assert_eq!(percent_decoded("my%20scene%2ebin"), "my scene.bin");
        assert_eq!(percent_decoded("100%"), "100%");
        assert_eq!(percent_decoded("a%zz%e4"), "a%zz%e4", "not UTF-8: taken as written");
    }
}
