//! Creates small valid folders of each kind, and lists the commands that read them.

use std::fs::{self, File};
use std::path::Path;
use std::process::Command;

use serde_json::{Value, json};
use spikelane::{Geometry, presets};
use spikelane_io::simulate;

/// A kind of folder.
pub(super) struct FolderKind {
    pub(super) folder: &'static str,
    /// Commands that run in the folder, in this order.
    pub(super) commands: &'static [&'static str],
    /// Whether the commands accept `--follow-links`.
    pub(super) follows_links: bool,
}

const SCENES: &str =
    "--scene-preset tiny --sequences 2 --images-per-scene 3 --label-every 2 --width 32 --height 24";

pub(super) const KINDS: &[FolderKind] = &[
    FolderKind {
        folder: "set",
        commands: &[
            "dataset stats . --report page.html",
            "dataset --scene-preset tiny --sequences 2 --images-per-scene 3 --label-every 2 --width 32 --height 24 --resume -o .",
        ],
        follows_links: true,
    },
    FolderKind {
        folder: "set",
        commands: &["evaluate . --json", "verify sequences/scene-0000/stream.json"],
        follows_links: true,
    },
    FolderKind {
        folder: "plan",
        commands: &["dataset status .", "dataset run . --shards all", "dataset merge . --no-verify"],
        follows_links: true,
    },
    FolderKind { folder: "merged", commands: &["dataset status .", "dataset merge ."], follows_links: true },
    FolderKind {
        folder: "half",
        commands: &["dataset status .", "dataset run . --shards 0 --verify", "dataset merge ."],
        follows_links: true,
    },
    FolderKind {
        folder: "packed",
        commands: &["dataset run . --shards all --verify", "dataset merge ."],
        follows_links: true,
    },
    FolderKind {
        folder: "packed",
        commands: &[
            "dataset stats . --report page.html",
            "evaluate . --json --method tfp",
            "dataset stats shards/000001",
            "dataset stats shards/000000.tar",
        ],
        follows_links: true,
    },
    FolderKind {
        folder: "packing",
        commands: &["dataset run . --shards 0", "dataset merge ."],
        follows_links: true,
    },
    FolderKind {
        folder: "inputs",
        commands: &["dataset status .", "dataset run . --shards all --retry-failed", "dataset merge ."],
        follows_links: true,
    },
    FolderKind {
        folder: "text",
        commands: &[
            "dataset --config dataset.toml -o out --dry-run",
            "dataset plan --config dataset.toml --sequences-per-shard 1 -o out",
        ],
        follows_links: true,
    },
    FolderKind { folder: "stream", commands: &["verify c.json", "verify c.dat"], follows_links: true },
    FolderKind { folder: "stream", commands: &["inspect c.dat", "evaluate c.dat"], follows_links: false },
    FolderKind {
        folder: "camera",
        commands: &[
            "preset show camera.toml",
            "simulate --builtin-light chart --camera camera.toml --readouts 5 -o out",
        ],
        follows_links: false,
    },
];

fn spikelane(folder: &Path, line: &str) {
    let ran =
        Command::new(super::program().0).args(line.split_whitespace()).current_dir(folder).output().unwrap();
    assert!(ran.status.success(), "{line}: {}", String::from_utf8_lossy(&ran.stderr));
}

/// Creates a folder of each kind in `base`.
pub(super) fn make(base: &Path) {
    fs::create_dir_all(base.join("clips")).unwrap();
    for (name, level) in [("a.y4m", 40), ("b.y4m", 200)] {
        let mut bytes = b"YUV4MPEG2 W32 H24 F100:1 Cmono\n".to_vec();
        for frame in 0..3 {
            bytes.extend_from_slice(b"FRAME\n");
            bytes.extend(std::iter::repeat_n(level + frame, 32 * 24));
        }
        fs::write(base.join("clips").join(name), bytes).unwrap();
    }
    let go = |line: &str| spikelane(base, line);
    go(&format!("dataset {SCENES} -o set"));
    go(&format!("dataset plan {SCENES} --sequences-per-shard 1 -o plan"));
    go("dataset run plan --shards 0");
    copy(&base.join("plan"), &base.join("merged"));
    go("dataset run merged --shards 1");
    go("dataset merge merged");
    go(&format!("dataset plan {SCENES} --sequences-per-shard 2 -o half"));
    go("dataset run half --shards 0");
    halve(&base.join("half/shards/000000"));
    go(&format!("dataset plan {SCENES} --sequences-per-shard 1 --pack -o packed"));
    go(&format!("dataset plan {SCENES} --sequences-per-shard 2 -o packing"));
    go("dataset run packing --shards 0");
    halve(&base.join("packing/shards/000000"));
    edit(&base.join("packing/plan.json"), |plan| plan["pack_shards"] = json!(true));
    go("dataset run packed --shards all");
    go(
        "dataset plan --from clips --width 32 --height 24 --readouts-per-frame 3 --sequences-per-shard 1 -o inputs",
    );
    fs::create_dir(base.join("stream")).unwrap();
    go("simulate --builtin-light chart --width 32 --height 24 --readouts 20 --images-every 5 -o stream/c");
    let mut camera = presets::builtin("physical").unwrap();
    camera.sensor.geometry = Geometry::new(32, 24).unwrap();
    camera.maps.gain = Some((0..32 * 24).map(|i| 1.0 + f64::from(i % 7) * 1e-3).collect());
    simulate::save_camera(&camera, &base.join("camera"), false).unwrap();
    copy(&base.join("camera"), &base.join("text"));
    let text = format!(
        "format_version = 1\ncamera = [\"camera.toml\"]\n[inputs]\nfolder = {:?}\nreadouts_per_frame = 3\n[splits]\ntest = 0.5\n",
        base.join("clips")
    );
    fs::write(base.join("text/dataset.toml"), text).unwrap();
}

/// Changes a finished shard of two sequences to the state of a shard that was stopped after the first sequence.
fn halve(shard: &Path) {
    let manifest = fs::read_to_string(shard.join("manifest.jsonl")).unwrap();
    let first = manifest.lines().nth(1).unwrap();
    fs::write(shard.join("journal.jsonl"), format!("{first}\n")).unwrap();
    fs::remove_file(shard.join("manifest.jsonl")).unwrap();
    fs::remove_dir_all(shard.join("sequences/scene-0001")).unwrap();
}

pub(super) fn edit(path: &Path, change: impl FnOnce(&mut Value)) {
    let mut value: Value = serde_json::from_slice(&fs::read(path).unwrap()).unwrap();
    change(&mut value);
    fs::write(path, value.to_string()).unwrap();
}

/// Copies a folder. The modification times of the files are copied too, because journals contain them.
pub(super) fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let path = entry.unwrap().path();
        let target = to.join(path.file_name().unwrap());
        if path.is_dir() {
            copy(&path, &target);
        } else {
            fs::copy(&path, &target).unwrap();
            let time = fs::metadata(&path).unwrap().modified().unwrap();
            File::options().write(true).open(&target).unwrap().set_modified(time).unwrap();
        }
    }
}
