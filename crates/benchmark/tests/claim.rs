//! Compares a generated suite and the scores of two baselines with a recorded claim, to the last digit.
//!
//! Every instruction set of x86-64 and aarch64 gives the recorded numbers.
//! To write the claim again after a change of the scenes, run
//! `cargo test -p spikelane-benchmark --test claim -- --ignored`.

use std::path::PathBuf;
use std::time::Duration;

use serde_json::{Value, json};
use spikelane_benchmark::generated::{GenerateOptions, GeneratedSuite, generate};
use spikelane_benchmark::run::{self, Method, RunOptions, SandboxOptions};
use spikelane_benchmark::score;
use spikelane_benchmark::suite::Suite;
use spikelane_scene::SCENE_VERSION;

const SUITE: &str = r#"
format_version = 1
name = "claim"
version = "0.1.0"
description = "Small images for tests"
scene_version = SCENES
release = "0.1.0"
task = "reconstruction"
metrics = [
    "psnr/1", "ssim/1", "psnr_as_spike_zoo/1", "ssim_as_spike_zoo/1", "psnr_as_spikecv/1", "ssim_as_spikecv/1",
    "detail_slope/1", "high_pass_noise/1", "noise_chen/1", "noise_liu/1",
]
dataset.scenes = { images_per_scene = 21, label_every = 0, samples = 4, vehicles = 1 }
dataset.images = { every = 10, format = "f32" }
[dataset.camera]
preset = "physical"
sensor = { width = 64, height = 40, thresholds_at_full_scale = 0.6 }
[[splits]]
name = "test"
seed = 11
sequences = 2
[[curves]]
name = "light"
quantity = "light"
values = [0.05, 1.0]
sequences = 1
"#;

fn recorded_path() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/golden/claim.json")
}

/// Returns the digest of the suite, and the scores and the digests of the outputs of each sequence.
fn computed_claim() -> Value {
    let suite = Suite::parse(&SUITE.replace("SCENES", &SCENE_VERSION.to_string())).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("data");
    let options = GenerateOptions { output: output.clone(), splits: Vec::new(), threads: 1, resume: false };
    let digest = generate(&suite, &options, &mut |_| Ok(())).unwrap().digest;
    let data = GeneratedSuite::open(&output).unwrap();
    let methods = ["span-blur", "tfi"].map(|baseline| {
        let options = RunOptions {
            output: folder.path().join(baseline),
            method: Method::Baseline(baseline.to_owned()),
            time_limit: Duration::from_secs(600),
            resume: false,
            sandbox: SandboxOptions::default(),
            adopts_orphans: false,
        };
        run::run(&data, &options, &mut || Ok(()), &mut |_| Ok(())).unwrap();
        let file = score::score(&data, &options.output, baseline, &|| Ok(())).unwrap();
        let sequences: Vec<Value> = file
            .sequences
            .iter()
            .map(|s| json!({"group": s.group, "id": s.id, "output": s.output_digest, "scores": s.scores}))
            .collect();
        json!({"baseline": baseline, "sequences": sequences, "summaries": file.summaries})
    });
    json!({"digest": digest, "scene_version": SCENE_VERSION, "methods": methods})
}

#[test]
fn the_claim_is_equal_on_every_machine() {
    let recorded: Value = serde_json::from_slice(&std::fs::read(recorded_path()).unwrap()).unwrap();
    let computed = computed_claim();
    assert_eq!(computed["digest"], recorded["digest"]);
    for (computed, recorded) in
        computed["methods"].as_array().unwrap().iter().zip(recorded["methods"].as_array().unwrap())
    {
        assert_eq!(computed, recorded);
    }
}

#[test]
#[ignore = "writes the recorded claim"]
fn write_the_claim() {
    let text = serde_json::to_string_pretty(&computed_claim()).unwrap();
    std::fs::write(recorded_path(), text + "\n").unwrap();
}
