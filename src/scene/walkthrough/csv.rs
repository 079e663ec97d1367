//! Path files: `frame,px,py,pz,fx,fy,fz,ux,uy,uz`, one pose a line, in the units
//! and axes of the scene's file. Columns are found by name, in any order.

use crate::error::{Error, Result, did_you_mean};
use crate::math::{DVec3, Pose};
use std::fmt::Write;
use std::path::Path;

pub const COLUMNS: [&str; 10] = ["frame", "px", "py", "pz", "fx", "fy", "fz", "ux", "uy", "uz"];

/// Directions this close to unit length are made unit; others are mistakes.
pub const UNIT_TOLERANCE: f64 = 1e-3;

/// Sine of the smallest angle allowed between forward and up: below it, the roll
/// of the camera would be decided by rounding.
const MIN_SINE: f64 = 1e-6;

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame {
    pub number: u64,
    pub pose: Pose,
}

/// Reads and checks a path file.
///
/// # Errors
/// With line and column: a missing or unknown column, a wrong number of fields,
/// what is not a finite number, directions that are not unit or parallel, frame
/// numbers that do not ascend, no frame at all.
pub fn read(path: &Path) -> Result<Vec<Frame>> {
    let bytes = read_bytes(path)?;
    parse(&String::from_utf8_lossy(&bytes)).map_err(|e| e.in_file(path))
}

pub(super) fn read_bytes(path: &Path) -> Result<Vec<u8>> {
    if path.is_dir() {
        return Err(Error::new("is a folder, but a path is a CSV file").in_file(path));
    }
    std::fs::read(path).map_err(|e| {
        Error::io(path, "cannot read the camera path", &e)
            .help("check that it exists; in a manifest it is relative to the manifest")
    })
}

/// [`read`] of a text.
///
/// # Errors
/// Those of [`read`].
pub fn parse(text: &str) -> Result<Vec<Frame>> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let mut lines = (1u32..).zip(text.lines()).filter(|(_, l)| !l.trim().is_empty());
    let help = || format!("the first line names the columns: {}", COLUMNS.join(","));
    let Some((line, header)) = lines.next() else {
        return Err(Error::new("the camera path is empty").help(help()));
    };
    let order = columns(header).map_err(|e| e.at(line, None).help(help()))?;
    let mut frames: Vec<Frame> = Vec::new();
    for (line, row) in lines {
        let fields: Vec<&str> = row.split(',').map(str::trim).collect();
        if fields.len() != COLUMNS.len() {
            return Err(Error::new(format!("{} fields, but the header names {}", fields.len(), COLUMNS.len()))
                .at(line, None)
                .help("the file may be cut short, or use a decimal comma"));
        }
        let field = |column: usize| {
            let text = fields[order[column]];
            // In characters from 1, as editors count.
            let start = text.as_ptr() as usize - row.as_ptr() as usize;
            (text, Some(row[..start].chars().count() as u32 + 1))
        };
        frames.push(frame(&field, line, frames.last())?);
    }
    if frames.is_empty() {
        return Err(Error::new("the camera path has a header but no frames")
            .at(line, None)
            .help("a walkthrough needs at least one frame"));
    }
    Ok(frames)
}

/// Position in the file of each of [`COLUMNS`].
fn columns(header: &str) -> Result<[usize; 10]> {
    let names: Vec<&str> = header.split(',').map(str::trim).collect();
    for (i, name) in names.iter().enumerate() {
        if !COLUMNS.contains(name) {
            let near = did_you_mean(name, COLUMNS).map_or(String::new(), |n| format!(" (did you mean `{n}`?)"));
            return Err(Error::new(format!("unknown column `{name}`{near}")));
        }
        if names[..i].contains(name) {
            return Err(Error::new(format!("column `{name}` is there twice")));
        }
    }
    let mut order = [0; 10];
    for (at, name) in order.iter_mut().zip(COLUMNS) {
        *at = names.iter().position(|n| *n == name).ok_or_else(|| Error::new(format!("column `{name}` is missing")))?;
    }
    Ok(order)
}

fn frame<'a>(field: &impl Fn(usize) -> (&'a str, Option<u32>), line: u32, before: Option<&Frame>) -> Result<Frame> {
    let wrong = |column: usize, message: String| Error::new(message).at(line, field(column).1).key(COLUMNS[column]);
    let text = field(0).0;
    let number = text
        .parse::<u64>()
        .map_err(|_| wrong(0, format!("`{text}` is not a frame number")).help("frames are whole numbers from 0"))?;
    if let Some(before) = before
        && number <= before.number
    {
        return Err(
            wrong(0, format!("frame {number} comes after frame {}", before.number)).help("frame numbers must ascend")
        );
    }
    let mut vectors = [DVec3::ZERO; 3];
    for column in 1..COLUMNS.len() {
        let text = field(column).0;
        let value = text.parse::<f64>().map_err(|_| wrong(column, format!("`{text}` is not a number")))?;
        if !value.is_finite() {
            return Err(wrong(column, format!("is {text}, but must be finite")));
        }
        vectors[(column - 1) / 3][(column - 1) % 3] = value;
    }
    let [eye, forward, up] = vectors;
    let unit = |v: DVec3, column: usize, name: &str| {
        let length = v.length();
        if (length - 1.0).abs() > UNIT_TOLERANCE {
            let message = format!("{name} has length {length}, but must be a unit vector");
            return Err(wrong(column, message).help("divide the direction by its length"));
        }
        // What is unit to the last bits stays as it is, so that files survive reading and writing.
        Ok(if (length - 1.0).abs() <= 4.0 * f64::EPSILON { v } else { v / length })
    };
    let (forward, up) = (unit(forward, 4, "forward")?, unit(up, 7, "up")?);
    if forward.cross(up).length() < MIN_SINE {
        return Err(
            wrong(7, "up is parallel to forward".to_string()).help("up must point to the upper edge of the image")
        );
    }
    Ok(Frame { number, pose: Pose { eye, forward, up } })
}

/// The text of a path file; reading it gives the same bits again.
pub fn format(frames: &[Frame]) -> String {
    let mut text = COLUMNS.join(",") + "\n";
    for f in frames {
        let _ = write!(text, "{}", f.number);
        for x in [f.pose.eye, f.pose.forward, f.pose.up].iter().flat_map(|v| v.to_array()) {
            let _ = write!(text, ",{x}");
        }
        text.push('\n');
    }
    text
}

/// # Errors
/// If the file cannot be written.
pub fn write(path: &Path, frames: &[Frame]) -> Result<()> {
    std::fs::write(path, format(frames)).map_err(|e| Error::io(path, "cannot write the camera path", &e))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const HEADER: &str = "frame,px,py,pz,fx,fy,fz,ux,uy,uz\n";

    fn error(rows: &str) -> String {
        parse(&format!("{HEADER}{rows}")).unwrap_err().in_file("p.csv").to_string()
    }

    #[test]
    fn every_mistake_names_line_and_column() {
        let cases = [
            ("0,1,2,x3,1,0,0,0,0,1", "p.csv:2:7: `pz`: `x3` is not a number"),
            ("0,1,2,3,1,0,0,0,0,1\n\n1,1,nan,3,1,0,0,0,0,1", "p.csv:4:5: `py`: is nan, but must be finite"),
            ("0,1,2,3,0,0,0,0,0,1", "p.csv:2:9: `fx`: forward has length 0"),
            ("0,1,2,3,1.1,0,0,0,0,1", "`fx`: forward has length 1.1"),
            ("0,1,2,3,1,0,0,0,0,2", "`ux`: up has length 2"),
            ("0,1,2,3,1,0,0,-1,0,0", "`ux`: up is parallel to forward"),
            ("0,1,2,3,1,0,0,0,0", "p.csv:2: 9 fields, but the header names 10"),
            ("1,1,2,3,1,0,0,0,0,1\n1,1,2,3,1,0,0,0,0,1", "p.csv:3:1: `frame`: frame 1 comes after frame 1"),
            ("-1,1,2,3,1,0,0,0,0,1", "`frame`: `-1` is not a frame number"),
            ("", "p.csv:1: the camera path has a header but no frames"),
        ];
        for (rows, want) in cases {
            assert!(error(rows).contains(want), "{rows}: {}", error(rows));
        }
        let headers = [
            ("", "the camera path is empty"),
            ("frame,px,py,pz,fx,fy,fz,ux,uy", "column `uz` is missing"),
            ("frame,px,py,pz,fx,fy,fz,ux,uy,uzz", "unknown column `uzz` (did you mean `uz`?)"),
            ("frame,px,py,pz,fx,fy,fz,ux,uy,uy", "column `uy` is there twice"),
            ("0,1,2,3,1,0,0,0,0,1", "unknown column `0`"),
        ];
        for (text, want) in headers {
            let e = parse(text).unwrap_err().to_string();
            assert!(e.contains(want) && e.contains("help: "), "{text}: {e}");
        }
    }

    #[test]
    fn nearly_unit_directions_are_made_unit_and_columns_may_move() {
        let text = "\u{feff}ux,uy,uz,frame,px,py,pz,fx,fy,fz\r\n0,0,0.9995,7,1,2,3,0.999100,0.029996,0.029982\r\n";
        let f = parse(text).unwrap()[0];
        assert_eq!((f.number, f.pose.eye, f.pose.up), (7, DVec3::new(1.0, 2.0, 3.0), DVec3::Z));
        assert!((f.pose.forward.length() - 1.0).abs() < 1e-15);
    }

    proptest! {
        #[test]
        fn what_is_written_reads_back_bit_by_bit(
            eyes in prop::collection::vec(prop::array::uniform3(-1e7..1e7f64), 1..20),
            turn in prop::array::uniform3(-1.0..1.0f64),
        ) {
            let forward = (DVec3::from(turn) + DVec3::X * 3.0).normalize();
            let up = forward.cross(DVec3::Y).normalize();
            let frames: Vec<Frame> = (0u64..).zip(&eyes)
                .map(|(n, e)| Frame { number: 3 * n, pose: Pose { eye: DVec3::from(*e), forward, up } })
                .collect();
            prop_assert_eq!(parse(&format(&frames)).unwrap(), frames);
        }

        #[test]
        fn mutated_paths_never_panic(edits in prop::collection::vec((0usize..200, any::<u8>()), 1..8)) {
            let mut text = format!("{HEADER}0,1,2,3,1,0,0,0,0,1\n1,1.5,2,3,1,0,0,0,0,1\n2,2,2,3,1,0,0,0,0,1\n").into_bytes();
            for (at, byte) in edits {
                let n = text.len();
                text[at % n] = byte;
            }
            let _ = parse(&String::from_utf8_lossy(&text));
        }
    }
}
