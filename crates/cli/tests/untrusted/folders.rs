//! Tests untrusted datasets: paths that point outside the dataset, files that are not regular, and inconsistent numbers.
#![cfg(unix)]

use std::fs;
use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::{Command, Stdio};

use serde_json::{Value, json};
use spikelane_io::storage::Digest;

const SCENES: &str =
    "--scene-preset tiny --sequences 1 --images-per-scene 3 --label-every 0 --width 32 --height 24";

/// Runs the program. Returns its exit code and its output.
fn run(folder: &Path, line: &str) -> (i32, String) {
    let ran = Command::new(env!("CARGO_BIN_EXE_spikelane"))
        .args(line.split_whitespace())
        .current_dir(folder)
        .stdin(Stdio::null())
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&ran.stdout).into_owned() + &String::from_utf8_lossy(&ran.stderr);
    (ran.status.code().unwrap_or(-1), text)
}

fn run_ok(folder: &Path, line: &str) {
    let (code, text) = run(folder, line);
    assert_eq!(code, 0, "{line}: {text}");
}

#[test]
fn a_file_outside_that_a_record_lists_is_not_packed() {
    let dir = tempfile::tempdir().unwrap();
    let top = dir.path();
    let secret = top.join("secretkey");
    fs::write(&secret, "PRIVATE KEY").unwrap();
    run_ok(top, &format!("dataset plan {SCENES} --sequences-per-shard 1 -o p"));
    run_ok(top, "dataset run p --shards 0");
    edit(&top.join("p/plan.json"), |plan| plan["pack_shards"] = true.into());
    let shard = top.join("p/shards/000000");
    let folder = shard.join("sequences/scene-0000");
    edit(&folder.join("record.json"), |record| {
        let file = json!({"path": secret, "bytes": 11, "digest": Digest::hash_bytes(b"PRIVATE KEY")});
        record["files"].as_array_mut().unwrap().push(file);
    });
    let manifest = fs::read_to_string(shard.join("manifest.jsonl")).unwrap();
    let mut line: Value = serde_json::from_str(manifest.lines().nth(1).unwrap()).unwrap();
    line["digest"] = Digest::hash_bytes(&fs::read(folder.join("record.json")).unwrap()).into();
    fs::remove_file(shard.join("manifest.jsonl")).unwrap();
    fs::write(shard.join("journal.jsonl"), format!("{line}\n")).unwrap();
    let (code, text) = run(top, "dataset run p --shards 0 --verify");
    assert!(code == 0 && text.contains("1 generated, 0 kept"), "{code}: {text}");
    let tar = fs::read(top.join("p/shards/000000.tar")).unwrap();
    assert!(!tar.windows(11).any(|part| part == b"PRIVATE KEY"));
}

#[test]
fn verify_reads_no_file_that_is_not_beside_the_sidecar() {
    let dir = tempfile::tempdir().unwrap();
    let top = dir.path();
    run_ok(top, "simulate --builtin-light chart --width 32 --height 24 --readouts 20 --images-every 10 -o c");
    fs::write(top.join("secret.txt"), "secret").unwrap();
    let digest = Digest::hash_bytes(b"secret");
    fs::create_dir(top.join("in")).unwrap();
    let absolute = top.join("secret.txt").display().to_string();
    let place = |pointer: &str, name: &str| {
        fs::copy(top.join("c.json"), top.join("in/c.json")).unwrap();
        fs::copy(top.join("c.dat"), top.join("in/c.dat")).unwrap();
        edit(&top.join("in/c.json"), |sidecar| *sidecar.pointer_mut(pointer).unwrap() = name.into());
        run(top, "verify in/c.json")
    };
    for pointer in ["/file", "/images/folder", "/images/files/0/file"] {
        for name in ["../secret.txt", absolute.as_str(), "..", ""] {
            let (code, text) = place(pointer, name);
            assert!(code == 3 && !text.contains(&digest), "{pointer} = {name}: {code}: {text}");
        }
    }
    fs::remove_file(top.join("in/c.dat")).unwrap();
    symlink("../c.dat", top.join("in/c.dat")).unwrap();
    fs::copy(top.join("c.json"), top.join("in/c.json")).unwrap();
    edit(&top.join("in/c.json"), |sidecar| drop(sidecar.as_object_mut().unwrap().remove("images")));
    assert_eq!(run(top, "verify in/c.json").0, 4, "the link leaves the folder");
    run_ok(top, "verify in/c.json --follow-links");
    run_ok(top, "verify c.json");
    symlink("in", top.join("named")).unwrap();
    fs::remove_file(top.join("in/c.dat")).unwrap();
    fs::copy(top.join("c.dat"), top.join("in/c.dat")).unwrap();
    run_ok(top, "verify named/c.json");
}

#[test]
fn a_plan_whose_numbers_are_not_those_of_its_options_is_refused_at_once() {
    let dir = tempfile::tempdir().unwrap();
    let top = dir.path();
    run_ok(top, &format!("dataset plan {SCENES} --sequences-per-shard 1 -o p"));
    let plan_text = fs::read(top.join("p/plan.json")).unwrap();
    for (sequences, per_shard) in [(5u64, 1u64), (1 << 50, 1), (u64::MAX, u64::MAX), (0, 1), (1, 0)] {
        fs::write(top.join("p/plan.json"), &plan_text).unwrap();
        edit(&top.join("p/plan.json"), |plan| {
            plan["sequences"] = sequences.into();
            plan["sequences_per_shard"] = per_shard.into();
            plan["shards"] = sequences.checked_div(per_shard).unwrap_or(0).into();
        });
        for command in ["run p --shards all", "run p --shards 0", "status p", "merge p"] {
            let (code, text) = run(top, &format!("dataset {command}"));
            assert_eq!(code, 3, "{sequences} / {per_shard}: {command}: {text}");
        }
    }
}

#[test]
fn sequences_and_readouts_beyond_what_memory_holds_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let place = |text: &str, line: &str| {
        fs::write(dir.path().join("d.toml"), format!("format_version = 1\n[scenes]\n{text}\n")).unwrap();
        run(dir.path(), line)
    };
    let (dry, plan) = (
        "dataset --config d.toml -o out --dry-run",
        "dataset plan --config d.toml --sequences-per-shard 1 -o out",
    );
    for text in ["sequences = 4294967296", "sequences = -1"] {
        assert_eq!(place(text, dry).0, 3, "{text}");
    }
    for text in [
        "sequences = 4294967295",
        "images_per_scene = 4294967295",
        "images_per_scene = 0",
        "readouts_per_image = 4294967295",
    ] {
        for line in [dry, plan] {
            let (code, message) = place(text, line);
            assert_eq!(code, 2, "{text}: {line}: {message}");
        }
    }
    assert!(!dir.path().join("out").exists());
}

/// The files are pipes and devices. Reading a pipe would block, and reading a device would never end.
#[test]
fn what_is_no_regular_file_is_refused_at_once_by_every_command() {
    let dir = tempfile::tempdir().unwrap();
    let top = dir.path();
    run_ok(top, &format!("dataset {SCENES} -o set"));
    run_ok(top, &format!("dataset plan {SCENES} --sequences-per-shard 1 -o plan"));
    fs::write(top.join("d.toml"), "format_version = 1\n").unwrap();
    for (file, lines) in [
        ("set/manifest.jsonl", &["dataset stats set", "evaluate set"][..]),
        ("set/sequences/scene-0000/record.json", &["dataset stats set"]),
        (
            "set/sequences/scene-0000/stream.json",
            &["dataset stats set", "verify set/sequences/scene-0000/stream.json"],
        ),
        ("plan/plan.json", &["dataset status plan", "dataset run plan --shards 0", "dataset merge plan"]),
        ("d.toml", &["dataset --config d.toml -o x --dry-run"]),
        ("list.txt", &["dataset --from-list list.txt -o x --dry-run"]),
    ] {
        let path = top.join(file);
        for device in [true, false] {
            let _ = fs::remove_file(&path);
            if device {
                symlink("/dev/zero", &path).unwrap();
            } else {
                use rustix::fs::{CWD, FileType, Mode, mknodat};
                mknodat(CWD, &path, FileType::Fifo, Mode::RUSR | Mode::WUSR, 0).unwrap();
            }
            for line in lines {
                let (code, text) = run(top, line);
                assert!([3, 4].contains(&code), "{file}: {line}: {code}: {text}");
            }
        }
    }
}

#[test]
fn links_out_of_a_data_set_are_read_only_where_the_user_allows_it() {
    let dir = tempfile::tempdir().unwrap();
    let top = dir.path();
    run_ok(top, &format!("dataset {SCENES} -o set"));
    let (sequence, moved) = (top.join("set/sequences/scene-0000"), top.join("store"));
    fs::rename(&sequence, &moved).unwrap();
    symlink(&moved, &sequence).unwrap();
    let (code, text) = run(top, "dataset stats set");
    assert!(code == 4 && text.contains("link that points outside the folder"), "{text}");
    run_ok(top, "dataset stats set --follow-links");
    run_ok(top, "evaluate set --follow-links");
    // If a sequence is behind a link, it is neither generated again nor replaced without `--follow-links`.
    assert_eq!(run(top, &format!("dataset {SCENES} -o set --resume")).0, 4);
    run_ok(top, &format!("dataset {SCENES} -o set --resume --follow-links"));
    assert!(sequence.symlink_metadata().unwrap().is_symlink() && moved.join("stream.dat").is_file());
    // The folder on the command line may be a link.
    fs::remove_file(&sequence).unwrap();
    fs::rename(&moved, &sequence).unwrap();
    symlink("set", top.join("named")).unwrap();
    run_ok(top, "dataset stats named");
    run_ok(top, &format!("dataset {SCENES} -o named --resume"));
}

/// A folder of images of another person contains a link to a file of the user.
#[test]
fn a_folder_of_images_is_read_through_links_only_where_the_user_allows_it() {
    let dir = tempfile::tempdir().unwrap();
    let top = dir.path();
    fs::create_dir_all(top.join("in/clip")).unwrap();
    let frame =
        |name: &str, value: u8| fs::write(top.join(name), format!("P2 2 1 255 {value} {value}")).unwrap();
    for i in 0..3 {
        frame(&format!("in/clip/{i}.pgm"), i);
    }
    frame("secret.pgm", 200);
    fs::write(top.join("secret.txt"), "0\n0.001\n0.002\n").unwrap();
    let simulate = "simulate in/clip -o out --force --width 8 --height 8 --readouts 8";
    let dataset = "dataset --from in -o set --width 8 --height 8 --readouts-per-frame 4";
    let plan = "dataset plan --from in -o plan --sequences-per-shard 1 --width 8 --height 8";
    // A link inside the folder is allowed.
    symlink("2.pgm", top.join("in/clip/3.pgm")).unwrap();
    run_ok(top, simulate);
    for (link, target, lines) in [
        ("in/clip/4.pgm", "../../secret.pgm", &[simulate, dataset, plan][..]),
        ("in/clip/timestamps.txt", "../../secret.txt", &[simulate, dataset]),
        ("in/alone.npy", "../secret.pgm", &[dataset, plan]),
    ] {
        symlink(target, top.join(link)).unwrap();
        for line in lines {
            let (code, text) = run(top, line);
            assert!(
                code == 4 && text.contains("points outside the folder"),
                "{link}: {line}: {code}: {text}"
            );
        }
        if link == "in/clip/4.pgm" {
            run_ok(top, &format!("{simulate} --follow-links"));
            run_ok(top, &format!("{dataset} --follow-links"));
        }
        let _ = fs::remove_dir_all(top.join("set"));
        fs::remove_file(top.join(link)).unwrap();
    }
    // A file of times that is not required is not used, and a note reports it.
    symlink("../../secret.txt", top.join("in/clip/images.csv")).unwrap();
    let (code, text) = run(top, simulate);
    assert!(code == 0 && text.contains("images.csv is not used for the times"), "{code}: {text}");
}

#[test]
fn files_of_a_dataset_contain_no_path_of_the_inputs() {
    let dir = tempfile::tempdir().unwrap();
    let top = dir.path();
    fs::create_dir_all(top.join("in")).unwrap();
    for i in 0..3 {
        fs::write(top.join(format!("in/{i}.pgm")), format!("P2 2 1 255 {i} {i}")).unwrap();
    }
    fs::write(top.join("in/notes.md"), "This file is ignored, and a note reports it.").unwrap();
    let line =
        format!("dataset --from {}/in -o set --width 8 --height 8 --readouts-per-frame 4", top.display());
    run_ok(top, &line);
    fn check(folder: &Path, text: &str) {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                check(&path, text);
            } else {
                let bytes = fs::read(&path).unwrap();
                assert!(!bytes.windows(text.len()).any(|part| part == text.as_bytes()), "{}", path.display());
            }
        }
    }
    check(&top.join("set"), top.to_str().unwrap());
    // The same inputs are found again, and other inputs in a folder of the same name are read again.
    let (code, text) = run(top, &format!("{line} --resume"));
    assert!(code == 0 && text.contains("0 generated"), "{code}: {text}");
    fs::create_dir_all(top.join("other/in")).unwrap();
    for i in 0..3 {
        fs::write(top.join(format!("other/in/{i}.pgm")), format!("P2 2 1 255 {0} {0}", i + 9)).unwrap();
    }
    let (code, text) = run(top, &format!("{} --resume", line.replace("/in ", "/other/in ")));
    assert!(code == 0 && text.contains("1 generated"), "{code}: {text}");
}

/// A digest in a file is quoted by an error, so it has a fixed length.
#[test]
fn a_long_digest_is_refused_with_a_short_message() {
    let dir = tempfile::tempdir().unwrap();
    let top = dir.path();
    run_ok(top, "simulate --builtin-light chart --width 32 --height 24 --readouts 20 --images-every 10 -o c");
    run_ok(top, &format!("dataset plan {SCENES} --sequences-per-shard 1 -o p"));
    run_ok(top, "dataset run p --shards all");
    run_ok(top, "dataset merge p");
    let long = format!("blake3:{}", "a".repeat(30_000));
    for (file, pointer, line) in [
        ("c.json", "/digest", "verify c.dat"),
        ("c.json", "/images/files/0/digest", "verify c.json"),
        ("p/shards/000000/sequences/scene-0000/record.json", "/files/0/digest", "dataset stats p"),
    ] {
        let text = fs::read(top.join(file)).unwrap();
        edit(&top.join(file), |value| *value.pointer_mut(pointer).unwrap() = long.as_str().into());
        let (code, message) = run(top, line);
        assert!([3, 9].contains(&code) && message.len() < 1000, "{file}: {code}: {} bytes", message.len());
        fs::write(top.join(file), text).unwrap();
    }
}

#[test]
fn nothing_is_written_or_removed_through_a_link() {
    let dir = tempfile::tempdir().unwrap();
    let top = dir.path();
    fs::create_dir_all(top.join("home/gt")).unwrap();
    for name in ["home/.draft.spikelane.partial", "home/gt/scene-0000.png"] {
        fs::write(top.join(name), "precious").unwrap();
    }
    for (link, target) in [("train", "../home"), ("test", "../home"), ("sequences", "../home")] {
        run_ok(top, &format!("dataset {SCENES} -o set"));
        let _ = fs::remove_dir_all(top.join("set").join(link));
        symlink(target, top.join("set").join(link)).unwrap();
        let (code, text) = run(top, &format!("dataset {SCENES} -o set --resume --follow-links"));
        assert_eq!(code, 4, "{link}: {text}");
        fs::remove_dir_all(top.join("set")).unwrap();
    }
    for name in ["home/.draft.spikelane.partial", "home/gt/scene-0000.png"] {
        assert_eq!(fs::read(top.join(name)).unwrap(), b"precious", "{name}");
    }
    assert_eq!(fs::read_dir(top.join("home")).unwrap().count(), 2);
}

fn edit(path: &Path, change: impl FnOnce(&mut Value)) {
    let mut value: Value = serde_json::from_slice(&fs::read(path).unwrap()).unwrap();
    change(&mut value);
    fs::write(path, value.to_string()).unwrap();
}
