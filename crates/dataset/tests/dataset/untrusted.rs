//! Tests of untrusted datasets. The datasets contain names that refer to paths outside the folder, files of other
//! types, and numbers out of range.
#![cfg(unix)]

use std::fs;
use std::path::Path;

use serde_json::Value;
use spikelane::{Error, ErrorKind};
use spikelane_dataset::shards::{self, MergeOptions, ShardOptions, ShardPlan};
use spikelane_dataset::{self as dataset, Access, DatasetOptions, Manifest};
use spikelane_io::storage::Digest;

use crate::generate::{clip, generate_dataset, inputs, options, scene_content};

fn edit(path: &Path, change: impl FnOnce(&mut Value)) {
    let mut value: Value = serde_json::from_slice(&fs::read(path).unwrap()).unwrap();
    change(&mut value);
    fs::write(path, value.to_string()).unwrap();
}

/// Creates a plan of inputs and changes its list to contain `id`. The digest of the list matches the changed list.
fn planned_with_id(options: &DatasetOptions, id: &str) {
    ShardPlan::create(options, 1, false).unwrap();
    let list = options.output.join("inputs.jsonl");
    edit(&list, |line| line["id"] = id.into());
    let text = fs::read(&list).unwrap();
    edit(&options.output.join("plan.json"), |plan| {
        plan["list_slices"][0]["bytes"] = text.len().into();
        plan["list_slices"][0]["digest"] = Digest::hash_bytes(&text).into();
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
        let shard_options =
            ShardOptions { threads: 1, verify_digests: false, retry_failed: false, take_lock: true };
        let plan = ShardPlan::open(&options.output, Access::Read).unwrap();
        let error = shards::generate_shard(&plan, 0, &shard_options, &mut |_| Ok(())).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Corrupt, "{id}: {error}");
    }
    assert_eq!(fs::read(thesis).unwrap(), b"precious");
}

#[test]
fn an_id_split_or_shard_of_a_manifest_that_leads_outside_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("set");
    generate_dataset(&options(&out, scene_content(1))).unwrap();
    let manifest_text = fs::read_to_string(out.join("manifest.jsonl")).unwrap();
    for (key, value) in [("id", "../../home/bob"), ("split", ".."), ("shard", "../home"), ("shard", "")] {
        let mut entry: Value = serde_json::from_str(manifest_text.lines().nth(1).unwrap()).unwrap();
        entry[key] = value.into();
        fs::write(out.join("manifest.jsonl"), format!("{manifest_text}{entry}\n")).unwrap();
        let error = generate_dataset(&options(&out, scene_content(1)).with_resume(true)).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Config, "{key} = {value}: {error}");
    }
}

/// The expression `value["options"]` would panic if the value were neither an object nor null.
#[test]
fn a_manifest_whose_first_line_is_no_object_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    for head in ["0", "\"options\"", "[{}]", "true", "null"] {
        fs::write(dir.path().join("manifest.jsonl"), format!("{head}\n")).unwrap();
        let error = Manifest::read(dir.path(), Access::Read).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Config, "{head}: {error}");
    }
}

/// Inputs of users may have any names. Their sequences must have plain names that are all different.
#[test]
fn inputs_of_any_name_become_sequences_with_plain_names() {
    let dir = tempfile::tempdir().unwrap();
    let clips = dir.path().join("clips");
    let long = "x".repeat(200);
    let names =
        ["12:30", "a b", "a\u{1b}[2J", "con", "nul.d", "trailing.", "back\\slash", "\u{fc}ber", &long, "a-b"];
    names.iter().for_each(|name| clip(&clips.join(name), 200));
    let discovered = dataset::discover_inputs(&clips, Path::new("nowhere")).unwrap();
    let ids: std::collections::BTreeSet<_> =
        discovered.iter().map(|input| input.id.as_str().to_owned()).collect();
    assert_eq!(ids.len(), names.len());
    assert!(ids.iter().all(|id| id.len() < 100 && id.chars().all(|c| c.is_ascii_alphanumeric() || c == '-')));
    let report = generate_dataset(&options(&dir.path().join("set"), inputs(&clips))).unwrap();
    assert_eq!(report.generated, names.len());
}

#[test]
fn a_request_to_stop_ends_merge_and_status_between_two_files() {
    let dir = tempfile::tempdir().unwrap();
    let options = options(dir.path(), scene_content(2));
    let (plan, _) = ShardPlan::create(&options, 1, false).unwrap();
    let shard_options =
        ShardOptions { threads: 1, verify_digests: false, retry_failed: false, take_lock: true };
    for shard in 0..2 {
        shards::generate_shard(&plan, shard, &shard_options, &mut |_| Ok(())).unwrap();
    }
    let merging = MergeOptions { verify_digests: true, create_links: true, take_lock: true };
    let mut calls = 0;
    shards::merge(&plan, &merging, &mut |_, _| {
        calls += 1;
        Ok(())
    })
    .unwrap();
    // Each of the two sequences has two streams with 24 readouts, 12 images, and the labels of two images.
    assert!(calls > 2 * 14, "{calls} calls");
    fs::remove_file(dir.path().join("manifest.jsonl")).unwrap();
    for end in [0, 1, 10, calls - 1] {
        let mut left = end;
        let error = shards::merge(&plan, &merging, &mut |_, _| {
            if left == 0 {
                return Err(Error::new(ErrorKind::Interrupted, "stopped"));
            }
            left -= 1;
            Ok(())
        });
        assert_eq!(error.unwrap_err().kind(), ErrorKind::Interrupted);
        assert!(!dir.path().join("manifest.jsonl").exists());
    }
    let error = shards::plan_status(&plan, &mut |shard| match shard {
        0 => Ok(()),
        _ => Err(Error::new(ErrorKind::Interrupted, "stopped")),
    });
    assert_eq!(error.unwrap_err().kind(), ErrorKind::Interrupted);
}
