//! Runs every command block in README and `docs`. Each page runs in its own empty folder.

#![cfg(unix)]

mod docs_support;

use std::path::Path;
use std::process::Command;

use docs_support::{check, current_pages, page, pages, root, run};
use spikelane_calibrate::RecordingSet;

/// Defines one test per page. Variables replace values in the blocks of a page to shorten the run.
macro_rules! runs {
    ($($test:ident: $page:literal $(, $name:ident = $value:literal)*;)*) => {
        $(
            #[test]
            fn $test() {
                run::run_page(&page($page), &[$((stringify!($name), $value)),*], prepare);
            }
        )*
        const TESTED: &[&str] = &[$($page),*];
    };
}

runs! {
    readme: "README.md";
    guide_benchmark: "docs/guides/benchmark.md";
    guide_check: "docs/guides/check.md";
    guide_color: "docs/guides/color.md";
    guide_clusters: "docs/guides/clusters.md", SEQUENCES = "3", IMAGES = "3", PER_SHARD = "1";
    guide_embedding: "docs/guides/embedding.md";
    guide_first_video: "docs/guides/first-video.md";
    guide_own_camera: "docs/guides/own-camera.md", SIDE = "24", READOUTS = "800", MAX_READOUTS = "200";
    guide_own_data_set: "docs/guides/own-data-set.md", FRAMES = "2", SEQUENCES = "2", IMAGES = "4";
    guide_view: "docs/guides/view.md", READOUTS = "600";
    reference_datasets: "docs/reference/datasets.md", SEQUENCES = "2", IMAGES = "3";
    reference_features: "docs/reference/features.md";
    reference_formats: "docs/reference/formats.md";
    reference_live: "docs/reference/live.md";
    reference_measure: "docs/reference/measure.md", READOUTS = "500";
    reference_recordings: "docs/reference/recordings.md";
    reference_shards: "docs/reference/shards.md";
    why_benchmark: "docs/why/benchmark.md";
    why_calibration: "docs/why/calibration.md";
    why_calibration_labs: "docs/why/calibration-labs.md";
    why_clusters: "docs/why/clusters.md";
    why_diagnosis: "docs/why/diagnosis.md";
    why_fuzzing: "docs/why/fuzzing.md";
    why_measure_coverage: "docs/why/measure-coverage.md";
    why_networks: "docs/why/networks.md";
    why_performance: "docs/why/performance.md";
    why_presets: "docs/why/presets.md";
    why_reconstruction: "docs/why/reconstruction.md";
    why_scenes: "docs/why/scenes.md";
}

/// Pages whose blocks other tests run.
const TESTED_ELSEWHERE: &[(&str, &str)] = &[
    ("docs/guides/python.md", "bindings/python/tests/test_guide.py"),
    ("docs/guides/training.md", "bindings/python/tests/test_guide.py"),
];

/// Creates the files that readers of the page have.
fn prepare(name: &str, place: &Path) {
    if name == "README.md" && check::is_installed("ffmpeg") {
        let clip = ["-f", "lavfi", "-i", "testsrc2=size=400x250:rate=25:duration=0.2", "video.mp4"];
        let status =
            Command::new("ffmpeg").args(["-loglevel", "error"]).args(clip).current_dir(place).status();
        assert!(status.unwrap().success());
    }
    if name == "docs/guides/benchmark.md" {
        let page = page(name);
        let suite = page.blocks().into_iter().find(|block| block.language() == "toml").unwrap();
        std::fs::write(place.join("tiny.toml"), suite.text).unwrap();
        std::fs::copy(root().join("docs/examples/method.py"), place.join("method.py")).unwrap();
    }
}

#[test]
fn every_page_with_blocks_has_a_test() {
    for page in pages() {
        let runs = page.blocks().iter().any(|b| matches!(b.language(), "sh" | "python" | "toml"));
        let here = TESTED.contains(&page.name.as_str());
        let there = TESTED_ELSEWHERE.iter().find(|(name, _)| *name == page.name);
        if let Some((name, test)) = there {
            let text = std::fs::read_to_string(root().join(test)).unwrap();
            assert!(text.contains(name.rsplit('/').next().unwrap()), "{test} does not run {name}");
        }
        assert!(!runs || here || there.is_some(), "{}: add it to tests/docs_blocks.rs", page.name);
    }
}

#[test]
fn every_rust_block_is_a_doctest() {
    let library = std::fs::read_to_string(root().join("tests/outside_effect/src/lib.rs")).unwrap();
    for page in current_pages().iter().filter(|p| p.blocks().iter().any(|b| b.language() == "rust")) {
        assert!(
            library.contains(&format!("\"../../../{}\"", page.name)),
            "{}: include it in tests/outside_effect/src/lib.rs",
            page.name
        );
    }
}

#[test]
fn indented_commands_are_blocks_instead() {
    let command = |line: &&str| {
        let first = line.split_whitespace().next().unwrap_or("");
        line.starts_with("    ") && ["spikelane", "cargo", "pip", "python", "python3"].contains(&first)
    };
    for page in pages() {
        let prose = page.prose();
        let commands: Vec<_> = prose.lines().filter(command).collect();
        assert!(commands.is_empty(), "{}: {commands:?}", page.name);
    }
}

#[test]
fn commands_within_sentences_exist() {
    for page in pages().iter().filter(|p| p.name != "CHANGELOG.md") {
        let prose = page.prose();
        let spans = prose.split('`').skip(1).step_by(2);
        let command = |s: &&str| s.starts_with("cargo ") || s.starts_with("spikelane ") && !s.contains(" = ");
        for span in spans.filter(command) {
            let wrong = check::command_errors(&span.replace('\n', " "));
            assert!(wrong.is_empty(), "{}: {wrong:?}", page.name);
        }
    }
}

#[test]
fn wrong_commands_are_detected() {
    for good in [
        "spikelane simulate a.png -o b --clean | head",
        "cargo test --test diagnose_study",
        "cargo run --release -p spikelane-studies --bin study-labs -- --labs 3 # three",
        "play() {\n    spikelane verify \"$@\"\n}\nplay a.json",
        "READOUTS=5 spikelane preset show physical > mine.toml",
    ] {
        assert_eq!(check::command_errors(good), Vec::<String>::new());
    }
    for bad in [
        "spikelane simulate a.png -o b --cleaner",
        "spikelane simulat a.png",
        "cargo test --test no_such_file",
        "cargo run --release -p spikelane-studies --bin study-labs -- --laps 3",
        "cargo run --example no-such-study",
        "fuzz/none.sh",
    ] {
        assert_eq!(check::command_errors(bad).len(), 1, "{bad}");
    }
}

#[test]
fn the_recording_set_of_the_reference_is_one() {
    let page = page("docs/reference/recordings.md");
    let blocks: Vec<_> = page.blocks().into_iter().filter(|b| b.language() == "toml").collect();
    assert!(!blocks.is_empty());
    for block in blocks {
        RecordingSet::parse(&block.text, root())
            .unwrap_or_else(|e| panic!("{}:{}: {e}", page.name, block.line));
    }
}
