//! Data sets from strangers: names that lead elsewhere, files that are none, and numbers that do not fit.
#![cfg(unix)]

use std::fs;
use std::path::Path;

use serde_json::Value;
use spikelane::{Error, Kind};
use spikelane_dataset::shards::{self, Merging, Plan, Running};
use spikelane_dataset::{self as dataset, DatasetOptions, Manifest};
use spikelane_io::storage::Digest;

use crate::make::{clip, drives, inputs, make, options};

fn edit(path: &Path, change: impl FnOnce(&mut Value)) {
    let mut value: Value = serde_json::from_slice(&fs::read(path).unwrap()).unwrap();
    change(&mut value);
    fs::write(path, value.to_string()).unwrap();
}

/// A plan of given inputs whose list has `id`, with the digest that belongs to it.
fn planned_with_id(options: &DatasetOptions, id: &str) {
    Plan::make(options, 1, false).unwrap();
    let list = options.output.join("inputs.jsonl");
    edit(&list, |line| line["id"] = id.into());
    let text = fs::read(&list).unwrap();
    edit(&options.output.join("plan.json"), |plan| {
        plan["pieces"][0]["bytes"] = text.len().into();
        plan["pieces"][0]["digest"] = Digest::of(&text).into();
    });
}

#[test]
fn an_id_of_a_plan_that_leads_outside_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let thesis = dir.path().join("home/alice/thesis.txt");
    fs::create_dir_all(thesis.parent().unwrap()).unwrap();
    fs::write(&thesis, "precious").unwrap();
    clip(&dir.path().join("clips/a"), 200);
    let home = dir.path().join("home/alice");
    for (number, id) in ["../../../../home/alice", "..", "a/b", home.to_str().unwrap()].iter().enumerate() {
        let options = options(&dir.path().join(format!("plan{number}")), inputs(&dir.path().join("clips")));
        planned_with_id(&options, id);
        let how = Running { threads: 1, verify: false, retry: false, lock: true };
        let plan = Plan::read(&options.output).unwrap();
        let error = shards::run(&plan, 0, &how, &mut |_| Ok(())).unwrap_err();
        assert_eq!(error.kind(), Kind::Corrupt, "{id}: {error}");
    }
    assert_eq!(fs::read(thesis).unwrap(), b"precious");
}

#[test]
fn an_id_split_or_shard_of_a_manifest_that_leads_outside_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("set");
    make(&options(&out, drives(1))).unwrap();
    let whole = fs::read_to_string(out.join("manifest.jsonl")).unwrap();
    for (key, value) in [("id", "../../home/bob"), ("split", ".."), ("shard", "../home"), ("shard", "")] {
        let mut entry: Value = serde_json::from_str(whole.lines().nth(1).unwrap()).unwrap();
        entry[key] = value.into();
        fs::write(out.join("manifest.jsonl"), format!("{whole}{entry}\n")).unwrap();
        let error = make(&options(&out, drives(1)).with_resume(true)).unwrap_err();
        assert_eq!(error.kind(), Kind::Config, "{key} = {value}: {error}");
    }
}

/// `value["options"]` panics if the value is neither an object nor null.
#[test]
fn a_manifest_whose_first_line_is_no_object_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    for head in ["0", "\"options\"", "[{}]", "true", "null"] {
        fs::write(dir.path().join("manifest.jsonl"), format!("{head}\n")).unwrap();
        let error = Manifest::read(dir.path()).unwrap_err();
        assert_eq!(error.kind(), Kind::Config, "{head}: {error}");
    }
}

/// A user's own names may be any: they become plain ones, each another.
#[test]
fn inputs_of_any_name_become_sequences_with_plain_names() {
    let dir = tempfile::tempdir().unwrap();
    let clips = dir.path().join("clips");
    let long = "x".repeat(200);
    let names =
        ["12:30", "a b", "a\u{1b}[2J", "con", "nul.d", "trailing.", "back\\slash", "\u{fc}ber", &long, "a-b"];
    names.iter().for_each(|name| clip(&clips.join(name), 200));
    let found = dataset::inputs(&clips, Path::new("nowhere")).unwrap();
    let ids: std::collections::BTreeSet<_> = found.iter().map(|input| input.id.as_str().to_owned()).collect();
    assert_eq!(ids.len(), names.len());
    assert!(ids.iter().all(|id| id.len() < 100 && id.chars().all(|c| c.is_ascii_alphanumeric() || c == '-')));
    let report = make(&options(&dir.path().join("set"), inputs(&clips))).unwrap();
    assert_eq!(report.made, names.len());
}

#[test]
fn a_request_to_stop_ends_merge_and_status_between_two_files() {
    let dir = tempfile::tempdir().unwrap();
    let options = options(dir.path(), drives(2));
    let (plan, _) = Plan::make(&options, 1, false).unwrap();
    let how = Running { threads: 1, verify: false, retry: false, lock: true };
    for shard in 0..2 {
        shards::run(&plan, shard, &how, &mut |_| Ok(())).unwrap();
    }
    let merging = Merging { quick: false, links: true, lock: true };
    let mut calls = 0;
    shards::merge(&plan, &merging, &mut |_, _| {
        calls += 1;
        Ok(())
    })
    .unwrap();
    // 24 readouts of two streams, 12 images and the labels of two of them, in each of two sequences.
    assert!(calls > 2 * 14, "{calls} calls");
    fs::remove_file(dir.path().join("manifest.jsonl")).unwrap();
    for end in [0, 1, 10, calls - 1] {
        let mut left = end;
        let error = shards::merge(&plan, &merging, &mut |_, _| {
            if left == 0 {
                return Err(Error::new(Kind::Interrupted, "stopped"));
            }
            left -= 1;
            Ok(())
        });
        assert_eq!(error.unwrap_err().kind(), Kind::Interrupted);
        assert!(!dir.path().join("manifest.jsonl").exists());
    }
    let error = shards::status(&plan, &mut |shard| match shard {
        0 => Ok(()),
        _ => Err(Error::new(Kind::Interrupted, "stopped")),
    });
    assert_eq!(error.unwrap_err().kind(), Kind::Interrupted);
}
