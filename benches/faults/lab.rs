//! Where the study lives: a folder with a measuring lane of its own, on it a small disk
//! that can be filled, and the undisturbed run that tells what the answers must be.

use super::Plan;
use std::fs::{self, File};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

pub const STUDY: &str = "faults";
const DISK_MIB: u64 = 256;
const STRUCTURES_A_ROUND: u64 = 3;
const CULLING: [&str; 4] = ["none", "frustum", "back_face", "frustum+back_face"];

pub struct Lab {
    folder: Option<tempfile::TempDir>,
    path: PathBuf,
    pub can_be_full: bool,
}

impl Lab {
    pub fn new(plan: &Plan) -> Lab {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().to_path_buf();
        for name in ["disk", "calm"] {
            fs::create_dir(path.join(name)).expect("a folder");
        }
        // A copy: somebody may build while we work.
        fs::copy(env!("CARGO_BIN_EXE_cullmark"), path.join("cullmark")).expect("the program");
        let can_be_full = plan.full > 0 && small_disk(&path.join("disk"));
        fs::write(path.join("calm/m.toml"), manifest(plan)).expect("a manifest");
        Lab { folder: Some(folder), path, can_be_full }
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    pub fn database(&self) -> PathBuf {
        self.path.join("disk/x.db")
    }

    /// In the environment of every process of ours, and of no other.
    pub fn lane(&self) -> PathBuf {
        self.path.join("lane")
    }

    pub fn command(&self) -> Command {
        let mut command = Command::new(self.path.join("cullmark"));
        command.current_dir(&self.path).env("CULLMARK_LANE", self.lane());
        command
    }

    pub fn manifest(&self, plan: &Plan) -> String {
        manifest(plan)
    }

    /// The same study by `cullmark run` in a database of its own, which is returned.
    pub fn undisturbed(&self) -> PathBuf {
        let mut command = self.command();
        command.current_dir(self.path.join("calm")).args(["run", "m.toml", "--db", "x.db", "--no-report", "--json"]);
        let out = command.output().expect("the program starts");
        assert!(out.status.success(), "the undisturbed run: {}", String::from_utf8_lossy(&out.stderr));
        self.path.join("calm/x.db")
    }

    /// Leaves no free byte on the disk for so long; `meanwhile` runs in between.
    pub fn fill(&self, time: Duration, meanwhile: impl FnOnce()) {
        let path = self.path.join("disk/filler");
        let mut file = File::create(&path).expect("the disk had room");
        let top_up = |file: &mut File| {
            for bytes in [1 << 20, 4096, 1] {
                let block = vec![0u8; bytes];
                while file.write_all(&block).is_ok() {}
            }
        };
        top_up(&mut file);
        let end = Instant::now() + time;
        let stop = std::sync::atomic::AtomicBool::new(false);
        std::thread::scope(|scope| {
            let filler = scope.spawn(|| {
                // Others delete and shrink: what they give back is taken at once.
                while Instant::now() < end || !stop.load(std::sync::atomic::Ordering::Relaxed) {
                    top_up(&mut file);
                    std::thread::sleep(Duration::from_millis(5));
                }
            });
            meanwhile();
            stop.store(true, std::sync::atomic::Ordering::Relaxed);
            filler.join().expect("the filler");
        });
        fs::remove_file(&path).expect("the filler is there");
    }

    /// Files that a killed child was writing.
    pub fn partial_files(&self) -> usize {
        let list = |sub: &str| fs::read_dir(self.path.join("disk/cache").join(sub)).into_iter().flatten().flatten();
        let names = ["truth", "scenes", "paths"].into_iter().flat_map(list).map(|e| e.file_name());
        names.filter(|n| [".partial", ".tmp"].iter().any(|end| n.to_string_lossy().ends_with(end))).count()
    }

    /// Keeps the folder: a copy, since the small disk goes with this process.
    pub fn keep(&self) -> String {
        let kept = std::env::temp_dir().join(format!("cullmark-faults-{}", std::process::id()));
        let _ = fs::remove_file(self.path.join("cullmark"));
        let copied = Command::new("cp").arg("-r").arg(&self.path).arg(&kept).status();
        copied.map_or_else(|e| e.to_string(), |_| kept.display().to_string())
    }
}

impl Drop for Lab {
    fn drop(&mut self) {
        if self.can_be_full {
            let disk = std::ffi::CString::new(self.path.join("disk").as_os_str().as_encoded_bytes()).expect("a path");
            // SAFETY: a path that ends in 0; we mounted it, in a view of mounts of our own.
            unsafe { libc::umount2(disk.as_ptr(), libc::MNT_DETACH) };
        }
        drop(self.folder.take());
    }
}

/// Mounts a tmpfs that only this thread and what it starts can see: it goes with them.
fn small_disk(at: &Path) -> bool {
    // SAFETY: no memory is shared with the new view of mounts; failing changes nothing.
    if unsafe { libc::unshare(libc::CLONE_NEWNS) } != 0 {
        return false;
    }
    let quiet = |args: &[&std::ffi::OsStr]| Command::new("mount").args(args).output().is_ok_and(|o| o.status.success());
    let words = |text: &'static str| text.split(' ').map(std::ffi::OsStr::new).collect::<Vec<_>>();
    let size = format!("size={DISK_MIB}m");
    let mut tmpfs = words("-t tmpfs -o");
    tmpfs.extend([size.as_ref(), "tmpfs".as_ref(), at.as_os_str()]);
    quiet(&words("--make-rprivate /")) && quiet(&tmpfs)
}

/// Small enough that a trial takes tens of milliseconds, most of them to start its process.
fn manifest(plan: &Plan) -> String {
    let structures = plan.runs.div_ceil(CULLING.len() as u64);
    let structure = |i: u64| match (i % STRUCTURES_A_ROUND, i / STRUCTURES_A_ROUND) {
        (0, n) => format!("\"list:leaf_size={}\"", 8 + n),
        (1, n) => format!("\"octree:depth={},leaf_limit={}\"", 2 + n % 3, n / 3),
        (_, n) => format!("\"bsp:min_leaf={}\"", 100 + 7 * n),
    };
    let list: Vec<String> = (0..structures).map(structure).collect();
    format!(
        "[study]\nname = \"{STUDY}\"\ntitle = \"Faults\"\n[measure]\nrepeats = {}\npasses = 1\ntimeout_s = 120\n\
         [accuracy]\nframes = 1\nwidth_px = 32\nheight_px = 18\n[[scene]]\nname = \"town\"\n\
         generate = \"arena:map=nucleus\"\n[[path]]\nname = \"walk\"\ngenerate = \"walk:frames=60,seed=7\"\n\
         [matrix]\nstructure = [{}]\nculling = [{}]\n",
        plan.repeats,
        list.join(", "),
        CULLING.map(|c| format!("\"{c}\"")).join(", "),
    )
}

/// Cells of the manifest: `runs` rounded up to whole structures.
pub fn cells(plan: &Plan) -> u64 {
    plan.runs.div_ceil(CULLING.len() as u64) * CULLING.len() as u64
}
