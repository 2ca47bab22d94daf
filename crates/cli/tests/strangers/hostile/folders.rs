//! Small valid folders of each kind, and the commands that read them.

use std::fs::{self, File};
use std::path::Path;
use std::process::Command;

use serde_json::{Value, json};
use spikelane::{Geometry, presets};
use spikelane_io::simulate;

/// A kind of folder.
pub(super) struct Kind {
    pub(super) folder: &'static str,
    /// Run in the folder, one after another.
    pub(super) commands: &'static [&'static str],
    /// Whether the commands have `--follow-links`.
    pub(super) follows: bool,
}

const SCENES: &str = "--kind tiny --sequences 2 --images 3 --label-every 2 --width 32 --height 24";

pub(super) const KINDS: &[Kind] = &[
    Kind {
        folder: "set",
        commands: &[
            "dataset stats . --report page.html",
            "dataset --kind tiny --sequences 2 --images 3 --label-every 2 --width 32 --height 24 --resume -o .",
        ],
        follows: true,
    },
    Kind {
        folder: "set",
        commands: &["evaluate . --json", "verify sequences/scene-0000/stream.json"],
        follows: true,
    },
    Kind {
        folder: "plan",
        commands: &["dataset status .", "dataset run . --shard all", "dataset merge . --quick"],
        follows: true,
    },
    Kind { folder: "merged", commands: &["dataset status .", "dataset merge ."], follows: true },
    Kind {
        folder: "half",
        commands: &["dataset status .", "dataset run . --shard 0 --verify", "dataset merge ."],
        follows: true,
    },
    Kind {
        folder: "packed",
        commands: &["dataset run . --shard all --verify", "dataset merge ."],
        follows: true,
    },
    Kind { folder: "packing", commands: &["dataset run . --shard 0", "dataset merge ."], follows: true },
    Kind {
        folder: "inputs",
        commands: &["dataset status .", "dataset run . --shard all --retry", "dataset merge ."],
        follows: true,
    },
    Kind {
        folder: "text",
        commands: &[
            "dataset --config dataset.toml -o out --dry-run",
            "dataset plan --config dataset.toml --per-shard 1 -o out",
        ],
        follows: true,
    },
    Kind { folder: "stream", commands: &["verify c.json", "verify c.dat"], follows: true },
    Kind { folder: "stream", commands: &["inspect c.dat", "evaluate c.dat"], follows: false },
    Kind {
        folder: "camera",
        commands: &[
            "preset show camera.toml",
            "simulate --source chart --camera camera.toml --readouts 5 -o out",
        ],
        follows: false,
    },
];

fn spikelane(folder: &Path, line: &str) {
    let ran =
        Command::new(super::program().0).args(line.split_whitespace()).current_dir(folder).output().unwrap();
    assert!(ran.status.success(), "{line}: {}", String::from_utf8_lossy(&ran.stderr));
}

/// Makes a folder of each kind in `base`.
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
    go(&format!("dataset plan {SCENES} --per-shard 1 -o plan"));
    go("dataset run plan --shard 0");
    copy(&base.join("plan"), &base.join("merged"));
    go("dataset run merged --shard 1");
    go("dataset merge merged");
    go(&format!("dataset plan {SCENES} --per-shard 2 -o half"));
    go("dataset run half --shard 0");
    halve(&base.join("half/shards/000000"));
    go(&format!("dataset plan {SCENES} --per-shard 1 --pack -o packed"));
    go(&format!("dataset plan {SCENES} --per-shard 2 -o packing"));
    go("dataset run packing --shard 0");
    halve(&base.join("packing/shards/000000"));
    edit(&base.join("packing/plan.json"), |plan| plan["pack"] = json!(true));
    go("dataset run packed --shard all");
    go("dataset plan --from clips --width 32 --height 24 --readouts-per-frame 3 --per-shard 1 -o inputs");
    fs::create_dir(base.join("stream")).unwrap();
    go("simulate --source chart --width 32 --height 24 --readouts 20 --images-every 5 -o stream/c");
    let mut camera = presets::builtin("physical").unwrap();
    camera.sensor.geometry = Geometry::new(32, 24).unwrap();
    camera.maps.gain = Some((0..32 * 24).map(|i| 1.0 + f64::from(i % 7) * 1e-3).collect());
    simulate::save_camera(&camera, &base.join("camera"), false).unwrap();
    copy(&base.join("camera"), &base.join("text"));
    let text = format!(
        "dataset = 1\ncamera = [\"camera.toml\"]\n[inputs]\nfolder = {:?}\nreadouts_per_frame = 3\n[splits]\ntest = 0.5\n",
        base.join("clips")
    );
    fs::write(base.join("text/dataset.toml"), text).unwrap();
}

/// Makes of a finished shard of two sequences one that was ended after the first.
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

/// Copies a folder with the times of its files, which journals list.
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
