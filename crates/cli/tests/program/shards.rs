//! Tests datasets in shards. The bytes must not depend on the division into shards, and errors must be reported.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::program_support::{TestFolder, exists, y4m};

const SCENES: &str =
    "--scene-preset tiny --sequences 5 --images-per-scene 3 --label-every 2 --width 32 --height 24";

/// Returns the files below several folders. The keys are the paths relative to these folders.
fn sequences(roots: &[std::path::PathBuf]) -> BTreeMap<String, Vec<u8>> {
    fn walk(root: &Path, folder: &Path, into: &mut BTreeMap<String, Vec<u8>>) {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                walk(root, &path, into);
            } else {
                let name = path.strip_prefix(root).unwrap().to_string_lossy().into_owned();
                into.insert(name, fs::read(path).unwrap());
            }
        }
    }
    let mut all = BTreeMap::new();
    roots.iter().for_each(|root| walk(root, root, &mut all));
    all
}

fn digest(stdout: &str) -> String {
    stdout.lines().find_map(|l| l.strip_prefix("digest ")).unwrap_or_else(|| panic!("{stdout}")).to_owned()
}

/// Writes `n` clips of two frames each. The light of the clips differs.
fn clips(place: &TestFolder, n: u8) {
    fs::create_dir_all(place.path("clips")).unwrap();
    for i in 0..n {
        place.write(&format!("clips/{i:03}.y4m"), y4m(32, 24, &[20 * i + 30, 90]));
    }
}

const CLIPS: &str = "--from clips --width 32 --height 24 --readouts-per-frame 4";

#[test]
fn a_dataset_is_the_same_however_it_is_cut() {
    let place = TestFolder::new();
    let full_digest = digest(&place.run_ok(&format!("dataset {SCENES} -o whole --threads 1")).stdout);
    let expected = sequences(&[place.path("whole/sequences")]);
    for (per_shard, shards) in [(1u32, "4,2-3,0-1"), (2, "all"), (7, "0")] {
        let out = format!("cut{per_shard}");
        place.run_ok(&format!("dataset plan {SCENES} -o {out} --sequences-per-shard {per_shard}"));
        place.run_ok(&format!("dataset run {out} --shards {shards}"));
        assert_eq!(digest(&place.run_ok(&format!("dataset merge {out}")).stdout), full_digest, "{per_shard}");
        let roots: Vec<_> = (0..5u32.div_ceil(per_shard))
            .map(|k| place.path(&format!("{out}/shards/{k:06}/sequences")))
            .collect();
        assert!(sequences(&roots) == expected, "{per_shard} a shard");
        for split in ["train", "test"] {
            let names = |set: &str| {
                let mut all = sequences(&[place.path(&format!("{set}/{split}"))]);
                // The file contains the paths of images. The part of the path that names the shard is removed before comparing.
                let coco = String::from_utf8(all["coco.json"].clone()).unwrap();
                let parts = coco.split("shards/").enumerate();
                let joined: String = parts.map(|(i, part)| &part[if i > 0 { 7 } else { 0 }..]).collect();
                all.insert("coco.json".into(), joined.into());
                all
            };
            assert!(names(&out) == names("whole"), "{split}, {per_shard} a shard");
        }
    }
    for kind in ["boxes", "depth", "flow"] {
        let folder = |set: &str| sequences(&[place.path(&format!("{set}/spikecv/{kind}/train"))]);
        assert!(!folder("whole").is_empty() && folder("cut2") == folder("whole"), "{kind}");
    }
    assert!(place.run_ok("evaluate cut2 --window 1").stdout.contains("5 sequences"));
}

#[test]
fn a_pack_holds_every_sequence_in_webdatasets_naming_with_a_fixed_digest() {
    let place = TestFolder::new();
    let full_digest = digest(&place.run_ok(&format!("dataset {SCENES} -o whole")).stdout);
    for (out, threads) in [("a", 1), ("b", 2)] {
        place.run_ok(&format!("dataset plan {SCENES} -o {out} --sequences-per-shard 2 --pack"));
        place.run_ok(&format!("dataset run {out} --shards all --threads {threads}"));
        assert_eq!(digest(&place.run_ok(&format!("dataset merge {out}")).stdout), full_digest);
        assert!(!exists(&place.path(&format!("{out}/shards/000000/sequences"))));
    }
    let expected = sequences(&[place.path("whole/sequences")]);
    let mut packed_files = BTreeMap::new();
    let mut names = Vec::new();
    for k in 0..3 {
        let name = format!("shards/{k:06}.tar");
        let bytes = place.read(&format!("a/{name}"));
        assert!(bytes == place.read(&format!("b/{name}")), "{name}");
        let mut tar = tar::Archive::new(&bytes[..]);
        for member in tar.entries().unwrap() {
            let mut member = member.unwrap();
            assert_eq!(member.header().mtime().unwrap(), 0);
            let name = member.path().unwrap().to_string_lossy().into_owned();
            let mut bytes = Vec::new();
            std::io::Read::read_to_end(&mut member, &mut bytes).unwrap();
            names.push(name.clone());
            packed_files.insert(name, bytes);
        }
    }
    assert!(names.is_sorted(), "{names:?}");
    // Every sequence has the same members.
    let members = ["clean.dat", "files.tar", "gt.png", "json", "png", "spk.dat", "split.txt"];
    let expected_names: Vec<String> =
        (0..5).flat_map(|k| members.map(|member| format!("scene-000{k}.{member}"))).collect();
    assert_eq!(names, expected_names);
    for (file, name) in [
        ("stream.dat", "spk.dat"),
        ("stream.clean.dat", "clean.dat"),
        ("reference.png", "png"),
        ("gt.png", "gt.png"),
    ] {
        let (expected, packed) =
            (&expected[&format!("scene-0003/{file}")], &packed_files[&format!("scene-0003.{name}")]);
        assert!(expected == packed, "{file}");
    }
    // The inner tar contains all other files under their paths.
    let mut others = expected.clone();
    let in_members = ["stream.dat", "stream.clean.dat", "reference.png", "gt.png"];
    others.retain(|path, _| {
        path.starts_with("scene-0003/") && !in_members.iter().any(|f| path.ends_with(&format!("/{f}")))
    });
    let mut inner = tar::Archive::new(&packed_files["scene-0003.files.tar"][..]);
    for member in inner.entries().unwrap() {
        let mut member = member.unwrap();
        let path = format!("scene-0003/{}", member.path().unwrap().display());
        let mut bytes = Vec::new();
        std::io::Read::read_to_end(&mut member, &mut bytes).unwrap();
        assert!(others.remove(&path) == Some(bytes), "{path}");
    }
    assert!(others.is_empty(), "{:?}", others.keys());
}

/// Returns the type of each key of a JSON object.
fn json_types(bytes: &[u8]) -> Vec<(String, &'static str)> {
    let value: serde_json::Map<String, serde_json::Value> = serde_json::from_slice(bytes).unwrap();
    let kind = |value: &serde_json::Value| match value {
        serde_json::Value::String(_) => "text",
        serde_json::Value::Number(n) if n.is_f64() => "float",
        serde_json::Value::Number(n) if n.is_i64() => "integer of 63 bits",
        _ => "other",
    };
    value.iter().map(|(key, value)| (key.clone(), kind(value))).collect()
}

#[test]
fn the_description_in_a_pack_has_one_type_for_each_key_in_scenes_and_inputs() {
    let place = TestFolder::new();
    clips(&place, 3);
    place.write("clips/long.y4m", y4m(48, 30, &[1, 2, 3, 4, 5]));
    let mut types = Vec::new();
    for (out, flags) in [("a", SCENES.to_owned()), ("b", format!("{CLIPS} --images-every 2"))] {
        place.run_ok(&format!("dataset plan {flags} -o {out} --sequences-per-shard 9 --pack"));
        place.run_ok(&format!("dataset run {out} --shards all"));
        let bytes = place.read(&format!("{out}/shards/000000.tar"));
        for member in tar::Archive::new(&bytes[..]).entries().unwrap() {
            let mut member = member.unwrap();
            if member
                .path()
                .unwrap()
                .to_string_lossy()
                .split_once('.')
                .is_some_and(|(_, rest)| rest == "json")
            {
                let mut text = Vec::new();
                std::io::Read::read_to_end(&mut member, &mut text).unwrap();
                types.push(json_types(&text));
            }
        }
    }
    assert_eq!(types.len(), 9);
    assert!(types.iter().all(|own| *own == types[0]), "{types:?}");
    assert!(types[0].iter().all(|(_, kind)| *kind != "other"), "{:?}", types[0]);
    let page =
        std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/reference/shards.md"))
            .unwrap();
    for (key, kind) in &types[0] {
        let kind = kind.split(' ').next().unwrap();
        assert!(page.contains(&format!("| `{key}` | {kind} |")), "{key} {kind}");
    }
}

#[test]
fn packed_and_unpacked_datasets_have_equal_statistics_and_scores() {
    let place = TestFolder::new();
    place.run_ok(&format!("dataset {SCENES} -o whole"));
    for (out, flag) in [("cut", ""), ("pack", "--pack")] {
        place.run_ok(&format!("dataset plan {SCENES} -o {out} --sequences-per-shard 2 {flag}"));
        place.run_refused(&format!("dataset stats {out}"), 4, &["3 of 3 shards missing", "0-2"]);
        place.run_ok(&format!("dataset run {out} --shards all"));
    }
    let stats = |set: &str| place.run_ok(&format!("dataset stats {set} --report {set}.html --force")).stdout;
    let scores = |set: &str| {
        let text = place.run_ok(&format!("evaluate {set} --method tfp --window 1")).stdout;
        text.split_once('\n').unwrap().1.to_owned()
    };
    let expected = (stats("whole"), scores("whole"));
    for set in ["cut", "pack"] {
        assert!((stats(set), scores(set)) == expected, "{set} before the merge");
        place.run_ok(&format!("dataset merge {set}"));
        assert!((stats(set), scores(set)) == expected, "{set}");
        assert_eq!(
            place.read(&format!("{set}.html")).len() as i64 - place.read("whole.html").len() as i64,
            set.len() as i64 * 4 - "whole".len() as i64 * 4,
            "only the name differs, in the title, the heading and twice in the command"
        );
    }
    let shard = |set: &str| (stats(set), scores(set));
    let expected = shard("cut/shards/000001");
    assert!(expected.0.starts_with("2 sequences, 6 readouts"), "{}", expected.0);
    for set in ["pack/shards/000001", "pack/shards/000001.tar"] {
        assert!(shard(set) == expected, "{set}");
    }
}

#[test]
fn a_tar_that_is_no_pack_or_is_damaged_is_refused_by_name() {
    let place = TestFolder::new();
    let small = SCENES.replace("--sequences 5", "--sequences 1");
    place.run_ok(&format!("dataset plan {small} -o set --sequences-per-shard 1 --pack"));
    place.run_ok("dataset run set --shards all");
    let bytes = place.read("set/shards/000000.tar");
    let members = |keep: &dyn Fn(&str) -> bool| {
        let mut out = tar::Builder::new(Vec::new());
        for member in tar::Archive::new(&bytes[..]).entries().unwrap() {
            let member = member.unwrap();
            if keep(&member.path().unwrap().to_string_lossy()) {
                out.append(&member.header().clone(), member).unwrap();
            }
        }
        out.into_inner().unwrap()
    };
    for (name, tar, words) in [
        ("cut", bytes[..bytes.len() / 2].to_vec(), "exceeds the file"),
        ("early", members(&|name| !name.ends_with(".files.tar")), "no scene-0000.files.tar"),
        ("other", members(&|name| name.ends_with(".png")), "a tar without descriptions of sequences"),
        ("stream", members(&|name| !name.ends_with(".spk.dat")), "scene-0000/stream.dat"),
    ] {
        place.write(&format!("{name}.tar"), tar);
        let ran = place.run(&format!("evaluate {name}.tar"));
        assert!(ran.code != 0 && ran.stderr.contains(words), "{name}: {} {}", ran.code, ran.stderr);
    }
}

#[test]
fn a_shard_that_is_there_is_kept_and_what_was_damaged_is_made_again() {
    let place = TestFolder::new();
    place.run_ok(&format!("dataset plan {SCENES} -o set --sequences-per-shard 5"));
    assert!(place.run_ok("dataset run set --shards 0").stdout.contains("5 generated, 0 kept"));
    assert!(place.run_ok("dataset run set --shards 0").stdout.contains("0 generated, 5 kept"));
    let before = sequences(&[place.path("set/shards/000000/sequences")]);
    // The test truncates one file, removes a second file, and changes a third file but not its size and time.
    let at = |file: &str| place.path(&format!("set/shards/000000/sequences/{file}"));
    fs::write(at("scene-0000/gt.png"), "cut").unwrap();
    fs::remove_file(at("scene-0002/stream.dat")).unwrap();
    assert!(place.run("dataset merge set --no-verify").stderr.contains("--shards to 0"));
    assert!(place.run_ok("dataset run set --shards 0").stdout.contains("2 generated, 3 kept"));
    assert!(sequences(&[place.path("set/shards/000000/sequences")]) == before);
    let time = fs::metadata(at("scene-0004/stream.dat")).unwrap().modified().unwrap();
    let mut bytes = fs::read(at("scene-0004/stream.dat")).unwrap();
    bytes[0] ^= 1;
    fs::write(at("scene-0004/stream.dat"), bytes).unwrap();
    fs::File::options().write(true).open(at("scene-0004/stream.dat")).unwrap().set_modified(time).unwrap();
    assert!(place.run_ok("dataset run set --shards 0").stdout.contains("0 generated, 5 kept"));
    let ran = place.run("dataset merge set");
    assert!(ran.code == 9 && ran.stderr.contains("set --shards to 0 and enable --verify"), "{}", ran.stderr);
    assert!(place.run_ok("dataset run set --shards 0 --verify").stdout.contains("1 generated, 4 kept"));
    assert!(sequences(&[place.path("set/shards/000000/sequences")]) == before);
    place.run_ok("dataset merge set");
}

#[test]
fn what_a_killed_run_left_is_removed() {
    let place = TestFolder::new();
    place.run_ok(&format!("dataset plan {SCENES} -o set --sequences-per-shard 3 --pack"));
    for hidden in ["shards/000000/sequences/.scene-0000.spikelane.partial", "shards/000000"] {
        fs::create_dir_all(place.path(&format!("set/{hidden}"))).unwrap();
    }
    for file in [
        "shards/000000/sequences/.scene-0000.spikelane.partial/stream.dat",
        "shards/000000/.journal.jsonl.77-0.spikelane.partial",
        "shards/.000000.tar.77-3.spikelane.partial",
        "shards/.000001.tar.78-3.spikelane.partial",
    ] {
        place.write(&format!("set/{file}"), "half");
    }
    // The journal ends with an incomplete line.
    place.write("set/shards/000000/journal.jsonl", "{\"id\": \"scene-0000\"");
    place.run_ok("dataset run set --shards 0");
    let mut left: Vec<_> = fs::read_dir(place.path("set/shards/000000"))
        .unwrap()
        .map(|e| e.unwrap().file_name().into_string().unwrap())
        .collect();
    left.sort();
    assert_eq!(left, ["lock", "manifest.jsonl"]);
    assert!(!exists(&place.path("set/shards/.000000.tar.77-3.spikelane.partial")));
    assert!(
        exists(&place.path("set/shards/.000001.tar.78-3.spikelane.partial")),
        "another shard's is not ours"
    );
}

#[test]
fn inputs_are_frozen_and_one_that_changed_or_is_poisoned_is_set_aside() {
    let place = TestFolder::new();
    clips(&place, 7);
    place.write("clips/bad.y4m", "YUV4MPEG2 W48");
    place.run_ok(&format!("dataset plan {CLIPS} -o set --sequences-per-shard 3"));
    // Adding a file to the folder does not change the division into shards.
    place.write("clips/000a.y4m", y4m(32, 24, &[1, 2]));
    let again = place.run_ok(&format!("dataset plan {CLIPS} -o set --sequences-per-shard 3"));
    assert!(
        again.stdout.contains("8 sequences in 3 shards") && again.stdout.contains("was not changed"),
        "{}",
        again.stdout
    );
    place.write("clips/004.y4m", y4m(32, 24, &[1, 2, 3]));
    let ran = place.run_ok("dataset run set --shards all --json");
    let events: Vec<_> = ran.events().into_iter().filter(|e| e["event"] == "shard").collect();
    let aside = |k: usize| events[k]["failures"].as_array().unwrap().clone();
    assert_eq!([aside(0).len(), aside(1).len(), aside(2).len()], [0, 1, 1]);
    assert_eq!(aside(1)[0]["input"], "004.y4m");
    assert!(aside(1)[0]["reason"].as_str().unwrap().contains("as in the plan"), "{:?}", aside(1));
    assert_eq!(aside(2)[0]["input"], "bad.y4m");
    let merged = place.run("dataset merge set");
    assert_eq!(merged.code, 4, "{}", merged.stderr);
    assert!(merged.stdout.contains("6 sequences, 2 failed"), "{}", merged.stdout);
    // For the remaining inputs, 'dataset' computes the same digest.
    for name in ["004", "bad", "000a"] {
        fs::remove_file(place.path(&format!("clips/{name}.y4m"))).unwrap();
    }
    let unsharded = place.run_ok(&format!("dataset {CLIPS} -o plain"));
    assert_eq!(digest(&unsharded.stdout), digest(&merged.stdout));
}

#[test]
fn a_list_names_inputs_and_one_that_is_not_there_is_named() {
    let place = TestFolder::new();
    clips(&place, 3);
    place.write("clips/list.txt", "002.y4m\n\n000.y4m\n002.y4m\n");
    let from = CLIPS.replace("--from clips", "--from-list clips/list.txt");
    place.run_ok(&format!("dataset plan {from} -o set --sequences-per-shard 1"));
    place.run_ok("dataset run set --shards all");
    let listed = digest(&place.run_ok("dataset merge set").stdout);
    fs::remove_file(place.path("clips/001.y4m")).unwrap();
    assert_eq!(digest(&place.run_ok(&format!("dataset {CLIPS} -o plain")).stdout), listed);
    place.write("clips/list.txt", "002.y4m\nnowhere.y4m\n");
    place.run_refused(
        &format!("dataset plan {from} -o other --sequences-per-shard 1"),
        5,
        &["line 2", "nowhere.y4m"],
    );
}

#[test]
fn a_plan_whose_inputs_lie_outside_of_its_folder_is_run_with_a_line_that_names_their_folder() {
    let place = TestFolder::new();
    clips(&place, 1);
    fs::create_dir_all(place.path("set/clips")).unwrap();
    place.write("set/clips/000.y4m", y4m(32, 24, &[30, 90]));
    place.write("clips/list.txt", "000.y4m\n");
    for (from, line) in [
        ("--from set/clips -o set", None),
        ("--from clips -o other", Some("clips, as stated in the plan\n")),
        (
            "--from-list clips/list.txt -o listed",
            Some("clips and from the paths of a list, as stated in the plan\n"),
        ),
    ] {
        let output = from.rsplit(' ').next().unwrap();
        place.run_ok(&format!(
            "dataset plan {from} --width 32 --height 24 --readouts-per-frame 4 --sequences-per-shard 1"
        ));
        for command in [format!("run {output} --shards all"), format!("merge {output}")] {
            let ran = place.run_ok(&format!("dataset {command}"));
            let is_reported = ran.stderr.contains("inputs are read from ");
            assert_eq!(is_reported, line.is_some(), "{command}: {}", ran.stderr);
            assert!(line.is_none_or(|line| ran.stderr.contains(line)), "{command}: {}", ran.stderr);
        }
    }
}

#[test]
fn a_plan_is_never_changed_and_only_its_own_version_runs_it() {
    let place = TestFolder::new();
    place.run_ok(&format!("dataset plan {SCENES} -o set --sequences-per-shard 2"));
    let before = place.read("set/plan.json");
    for other in
        ["--sequences-per-shard 3", "--sequences-per-shard 2 --seed 9", "--sequences-per-shard 2 --pack"]
    {
        place.run_refused(&format!("dataset plan {SCENES} -o set {other}"), 7, &["another plan"]);
    }
    assert_eq!(place.read("set/plan.json"), before);
    for shard in ["3", "x", "2-1", ""] {
        place.run_refused(&format!("dataset run set --shards={shard}"), 2, &["0 to 2"]);
    }
    place.run_refused("dataset run nowhere --shards 0", 5, &["plan.json", "plan the dataset first"]);
    place.run_refused("dataset merge set", 4, &["run the shards 0-2"]);
    let text = String::from_utf8(before).unwrap();
    let version = env!("CARGO_PKG_VERSION");
    place.write(
        "set/plan.json",
        text.replacen(&format!("\"program_version\": \"{version}\""), "\"program_version\": \"0.0.9\"", 1),
    );
    place.run_refused("dataset run set --shards 0", 3, &["0.0.9", version]);
    place.write(
        "set/plan.json",
        text.replacen("\"format_version\": 1", "\"format_version\": 2, \"new\": 1", 1),
    );
    place.run_refused("dataset run set --shards 0", 3, &["version 2"]);
}

/// Starts a run and waits until its journal exists. The caller stops the run.
fn spawn(place: &TestFolder, line: &str) -> std::process::Child {
    let mut command: Command = place.command(line);
    let child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let begun = Instant::now();
    while !exists(&place.path("set/shards/000000/journal.jsonl")) {
        assert!(begun.elapsed() < Duration::from_secs(60), "{line} does not begin");
        std::thread::sleep(Duration::from_millis(5));
    }
    child
}

#[test]
#[cfg(unix)]
fn two_workers_on_one_shard_and_a_request_to_end_have_codes_of_their_own() {
    let place = TestFolder::new();
    let long = SCENES.replace("--images-per-scene 3", "--images-per-scene 4000 --readouts-per-image 5");
    place.run_ok(&format!("dataset plan {long} -o set --sequences-per-shard 5"));
    let mut child = spawn(&place, "dataset run set --shards 0");
    let second = place.run("dataset run set --shards 0");
    assert_eq!(second.code, 10, "{}", second.stderr);
    assert!(second.stderr.contains(&format!("process {}", child.id())), "{}", second.stderr);
    let events = place.run_ok("dataset status set --json").events();
    assert_eq!(
        (&events[0]["running_shards"][0]["shard"], &events[0]["missing_shards"]),
        (&0.into(), &0.into())
    );
    let kill = Command::new("kill").args(["-TERM", &child.id().to_string()]).status().unwrap();
    assert!(kill.success());
    assert_eq!(child.wait().unwrap().code(), Some(75));
    let events = place.run_ok("dataset status set --json").events();
    assert_eq!((&events[0]["shard_array"], &events[0]["done_shards"]), (&"0".into(), &0.into()));
    let hidden = fs::read_dir(place.path("set/shards/000000/sequences")).unwrap();
    assert_eq!(hidden.count(), 0, "something half-written is left");
}

#[test]
fn a_dataset_is_a_text_that_makes_it_again() {
    let place = TestFolder::new();
    let flags = format!("{SCENES} --lighting dusk --effect prnu.sigma=0.031 --seed 18446744073709551615");
    let text = place.run_ok(&format!("dataset {flags} -o a --print-config")).stdout;
    assert!(!exists(&place.path("a")));
    place.write("dataset.toml", &text);
    assert_eq!(place.run_ok("dataset --config dataset.toml -o b --print-config").stdout, text);
    let by_flags = digest(&place.run_ok(&format!("dataset {flags} -o a")).stdout);
    assert_eq!(digest(&place.run_ok("dataset --config dataset.toml -o b").stdout), by_flags);
    place.run_refused(
        "dataset --config dataset.toml -o c --images-per-scene 3",
        2,
        &["--config", "--images-per-scene"],
    );
    place.write("wrong.toml", text.replace("label_every", "labels_every"));
    place.run_refused("dataset --config wrong.toml -o c", 3, &["labels_every", "did you mean label_every"]);
    place.write("wrong.toml", text.replace("format_version = 1", "format_version = 7"));
    place.run_refused("dataset --config wrong.toml -o c", 3, &["version 7"]);
}

/// While one process plans, other processes exit with code 10. After the plan exists, they exit with code 7.
#[test]
fn of_many_processes_that_plan_at_once_one_makes_a_whole_plan() {
    let place = TestFolder::new();
    let children: Vec<_> = (1..=6_u64)
        .map(|per_shard| {
            let line = format!("dataset plan {SCENES} -o set --sequences-per-shard {per_shard}");
            let mut command = place.command(&line);
            (per_shard, command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap())
        })
        .collect();
    let mut folders = Vec::new();
    for (per_shard, child) in children {
        let out = child.wait_with_output().unwrap();
        match out.status.code() {
            Some(0) => folders.push(per_shard),
            Some(7 | 10) => {}
            code => panic!("{code:?}: {}", String::from_utf8_lossy(&out.stderr)),
        }
    }
    let plan: serde_json::Value = serde_json::from_slice(&place.read("set/plan.json")).unwrap();
    assert_eq!(folders, [plan["sequences_per_shard"].as_u64().unwrap()]);
    assert!(!place.path("set/.folder.lock").exists());
}
