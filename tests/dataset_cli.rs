//! The commands `dataset` and `scene`, by their arguments.

use clap::Parser;

#[path = "../src/cli/dataset.rs"]
mod dataset;
#[path = "../src/cli/scene.rs"]
mod scene;

#[derive(Parser)]
enum Cli {
    Dataset(Box<dataset::Args>),
    Scene(scene::Args),
}

fn run(args: &[&str]) -> spikelane::Result<()> {
    match Cli::try_parse_from([&["spikelane"], args].concat()).unwrap() {
        Cli::Dataset(args) => dataset::run(&args),
        Cli::Scene(args) => scene::run(&args),
    }
}

/// Arguments of one's own, to make a larger dataset: `SPIKELANE_ARGS="dataset -o out" cargo test --test dataset_cli -- --ignored`.
#[test]
#[ignore = "makes what SPIKELANE_ARGS asks for"]
fn arguments_from_the_environment() {
    let args = std::env::var("SPIKELANE_ARGS").unwrap();
    run(&args.split_whitespace().collect::<Vec<_>>()).unwrap();
}

#[test]
fn a_scene_becomes_pictures_of_light_and_labels() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("preview");
    run(&["scene", "-o", out.to_str().unwrap(), "--width", "64", "--height", "40", "--frames", "2"]).unwrap();
    for kind in ["light", "depth", "flow", "semantic", "instance"] {
        let picture = image::open(out.join(format!("0001.{kind}.png"))).unwrap();
        assert_eq!((picture.width(), picture.height()), (64, 40), "{kind}");
    }
    assert!(out.join("0001.boxes.json").is_file());
}

#[test]
fn a_dry_run_writes_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("set");
    run(&["dataset", "-o", out.to_str().unwrap(), "--dry-run"]).unwrap();
    assert!(!out.exists());
}
