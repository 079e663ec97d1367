//! Tests: every reader against thousands of damaged files. What one execution does
//! and the files to begin with are those of the endless version, `fuzz/run.sh`.

#[path = "../../fuzz/src/lib.rs"]
mod targets;

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

/// A seeded sequence of words: George Marsaglia's xorshift (2003).
struct Words(u64);

impl Words {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next() >> 11) as usize % n.max(1)
    }
}

fn files(folder: &str) -> Vec<Vec<u8>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/corpus").join(folder);
    let mut names: Vec<_> = std::fs::read_dir(&folder).unwrap().map(|f| f.unwrap().path()).collect();
    names.sort();
    names.iter().map(|name| std::fs::read(name).unwrap()).collect()
}

/// One to six edits: bits, bytes, cuts, copies, numbers that are limits of something.
fn mutate(seeds: &[Vec<u8>], words: &mut Words) -> Vec<u8> {
    const LIMITS: [&str; 12] =
        ["0", "-1", "4294967295", "4294967296", "18446744073709551615", "1e308", "nan", "inf", "1e9", "[]", "\"", "\0"];
    let mut data = seeds[words.below(seeds.len())].clone();
    for _ in 0..1 + words.below(6) {
        let (at, other) = (words.below(data.len()), words.below(data.len()));
        let (from, to) = (at.min(other), at.max(other).min(at.min(other) + 40));
        match words.below(8) {
            0 if !data.is_empty() => data[at] ^= 1 << words.below(8),
            1 if !data.is_empty() => data[at] = words.next() as u8,
            2 => drop(data.drain(from..to)),
            3 => {
                let copy = data[from..to].to_vec();
                data.splice(other..other, copy);
            }
            4 => data.truncate(at),
            5 => {
                let seed = &seeds[words.below(seeds.len())];
                let start = words.below(seed.len());
                let piece = &seed[start..(start + words.below(60)).min(seed.len())];
                data.splice(at..at, piece.iter().copied());
            }
            // Another number in the place of one: most such files are well formed, and wrong inside.
            _ => {
                let digits = |b: &u8| b.is_ascii_digit();
                if let Some(start) = data[at.min(data.len())..].iter().position(digits).map(|i| i + at) {
                    let end = start + data[start..].iter().take_while(|b| digits(b)).count();
                    data.splice(start..end, LIMITS[words.below(LIMITS.len())].bytes());
                }
            }
        }
    }
    data
}

/// Reads the seeds and `runs` mutations of them; a panic shows the bytes that caused it.
fn damaged(format: &str, runs: usize, read: fn(&[u8])) {
    let seeds = files(format);
    seeds.iter().for_each(|seed| read(seed));
    let mut words = Words(0x9E37_79B9_7F4A_7C15);
    for run in 0..runs {
        let data = mutate(&seeds, &mut words);
        if catch_unwind(AssertUnwindSafe(|| read(&data))).is_err() {
            panic!("run {run} of {format} panicked on {:?}", data.escape_ascii().to_string());
        }
    }
}

#[test]
fn damaged_meshes_are_read_or_refused_and_never_panic() {
    damaged("obj", 3000, targets::obj);
    damaged("glb", 3000, targets::glb);
}

#[test]
fn damaged_camera_paths_are_read_or_refused_and_never_panic() {
    damaged("csv", 6000, targets::csv);
}

#[test]
fn damaged_manifests_are_read_or_refused_and_never_panic() {
    damaged("toml", 3000, targets::toml);
}

#[test]
fn the_seeds_reach_what_they_are_for() {
    use cullmark::scene::{gltf, obj, walkthrough::csv};
    let read = files("obj").iter().filter(|b| obj::read(Path::new("a.obj"), b).is_ok()).count();
    assert!(read >= 2, "{read} OBJ seeds are read");
    let [beside, data_uri, packed, split] = &files("glb")[..] else { panic!("four glTF seeds") };
    assert!(gltf::read(Path::new("a.gltf"), beside).is_err());
    assert_eq!(gltf::read(Path::new("a.gltf"), data_uri).unwrap().len(), 1);
    assert_eq!(gltf::read(Path::new("a.glb"), packed).unwrap().len(), 11);
    let zero = split.iter().position(|b| *b == 0).unwrap();
    assert_eq!(&targets::packed(&split[..zero], &split[zero + 1..]), packed);
    let paths = files("csv").iter().filter(|b| csv::parse(&String::from_utf8_lossy(b)).is_ok()).count();
    assert_eq!(paths, 2);
    let ok = |text: &[u8]| {
        let text = String::from_utf8(text.to_vec()).unwrap();
        cullmark::manifest::Manifest::parse(text, Path::new("/nonexistent/a.toml"), &[])
    };
    let manifests = files("toml");
    assert!(manifests[..2].iter().all(|m| ok(m).map_err(|e| eprintln!("{e:?}")).is_ok()));
}

#[test]
fn a_scene_does_not_read_devices_that_it_names() {
    // `/dev/zero` would never end; this one would, and give a library without materials.
    let text = b"mtllib /dev/null\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    let scene = cullmark::scene::obj::read(Path::new("a.obj"), text).unwrap();
    assert!(scene.report.warnings.iter().any(|w| w.contains("not a regular file")), "{:?}", scene.report.warnings);
}

#[test]
fn a_gltf_may_not_ask_for_more_zeros_than_it_could_hold() {
    let with = |count: u32| {
        // Sparse: one value is given, all others are zero.
        let sparse =
            r#""sparse":{"count":1,"indices":{"bufferView":0,"componentType":5125},"values":{"bufferView":1}}"#;
        let accessor = |n: u32| format!(r#"{{"componentType":5126,"count":{n},"type":"VEC3",{sparse}}}"#);
        let mesh = |a: u32| format!(r#"{{"primitives":[{{"attributes":{{"POSITION":{a}}}}}]}}"#);
        let text = format!(
            r#"{{"asset":{{"version":"2.0"}},"scenes":[{{"nodes":[0,1]}}],"nodes":[{{"mesh":0}},{{"mesh":1}}],
            "buffers":[{{"byteLength":16,"uri":"data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAAAAAA=="}}],
            "bufferViews":[{{"buffer":0,"byteLength":4}},{{"buffer":0,"byteOffset":4,"byteLength":12}}],
            "meshes":[{},{}],"accessors":[{},{}]}}"#,
            mesh(0),
            mesh(1),
            accessor(count),
            accessor(600_000)
        );
        cullmark::scene::gltf::read(Path::new("a.gltf"), text.as_bytes())
    };
    assert!(with(300_000).is_ok_and(|scene| scene.len() == 300_000));
    // Neither is too many; both together are.
    let e = with(600_000).unwrap_err();
    assert!(e.message.contains("1200000 values without data"), "{e}");
}
