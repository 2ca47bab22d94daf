//! Tests the structure of the sources: the files of a package import from each other without circles.

mod source_support;

use source_support::imports::import_circles;
use source_support::lines::{LineCounts, table};
use source_support::{Package, SourceFile, packages};

/// Import circles that exist. The list may only become shorter: change the sources, not the list.
const KNOWN_CIRCLES: &[(&str, &[&str])] = &[
    ("bindings/python/src", &["argument.rs", "arrays.rs", "camera.rs", "distribution.rs", "mosaic.rs"]),
    ("bindings/python/src", &["spike_frames.rs", "spikes.rs"]),
    ("crates/benchmark/src", &["score/boxes.rs", "score/dense.rs", "score/evaluation.rs"]),
    ("crates/benchmark/src", &["suite/curve.rs", "suite/file.rs", "suite/task.rs"]),
    ("crates/calibrate/src", &["fitter/alignment.rs", "fitter/scale_posterior.rs"]),
    ("crates/calibrate/src", &["fitter/noise.rs", "fitter/shape.rs", "fitter/state.rs"]),
    (
        "crates/calibrate/src",
        &[
            "recordings/check.rs",
            "recordings/color_filters.rs",
            "recordings/observations.rs",
            "recordings/recording_set.rs",
            "recordings/sources.rs",
            "result.rs",
            "snee.rs",
        ],
    ),
    ("crates/cli/src", &["benchmark/run.rs", "benchmark/score.rs"]),
    ("crates/cli/src", &["check/frames.rs", "check/peer.rs"]),
    ("crates/dataset/src", &["exporters/loader_links.rs", "exporters/ssl_csc.rs"]),
    ("crates/scene/src", &["optics/exposure.rs", "options.rs", "rendering/frame.rs", "world.rs"]),
    (
        "src",
        &[
            "effects/camera.rs",
            "kernels/batch.rs",
            "kernels/mod.rs",
            "kernels/modulation.rs",
            "light/frame.rs",
            "plan/mod.rs",
            "sensor/mosaic.rs",
        ],
    ),
    ("src", &["reconstruct/color/menon.rs", "reconstruct/color/planes.rs"]),
    ("studies/src", &["diagnose/jobs.rs", "diagnose/main.rs"]),
    (
        "studies/src",
        &["program/diagnose_job.rs", "program/factors.rs", "program/laboratory.rs", "program/main.rs"],
    ),
];

#[test]
fn files_of_a_package_do_not_import_in_new_circles() {
    for package in packages() {
        let known = |circle: &Vec<String>| {
            let is_known_file = |files: &&[&str]| circle.iter().all(|file| files.contains(&file.as_str()));
            known_circles(&package.folder).iter().any(is_known_file)
        };
        let new: Vec<_> = import_circles(&package).into_iter().filter(|circle| !known(circle)).collect();
        assert!(new.is_empty(), "files of {} import from each other: {new:#?}", package.folder);
    }
}

#[test]
fn every_known_circle_still_exists() {
    for package in packages() {
        let circles = import_circles(&package);
        for files in known_circles(&package.folder) {
            let exists = circles.iter().any(|circle| circle == files);
            assert!(exists, "the circle {files:?} of {} is smaller or gone: update the list", package.folder);
        }
    }
}

fn known_circles(folder: &str) -> Vec<&'static [&'static str]> {
    KNOWN_CIRCLES.iter().filter(|(of, _)| *of == folder).map(|(_, files)| *files).collect()
}

fn circles(files: &[(&str, &str)]) -> Vec<Vec<String>> {
    let files = files.iter().map(|(name, text)| SourceFile::new(name, text)).collect();
    import_circles(&Package { folder: "src".to_owned(), files })
}

#[test]
fn a_circle_through_a_re_export_and_a_path_in_code_is_found() {
    let files = [
        ("lib.rs", "mod a;\nmod b;\nmod c;\npub use b::Length;\n"),
        ("a.rs", "use crate::Length;\npub struct Area(Length);\n"),
        ("b.rs", "use std::{fmt, ops::Add};\npub struct Length(crate::c::Unit);\n"),
        ("c.rs", "use super::{\n    a::{self, Area},\n    b,\n};\npub struct Unit;\n"),
    ];
    assert_eq!(circles(&files), [["a.rs", "b.rs", "c.rs"]]);
}

#[test]
fn a_circle_below_an_inline_module_is_found() {
    let files = [
        ("lib.rs", "mod a {\n    pub mod b;\n    mod c;\n}\npub use a::b::Length;\n"),
        ("a/b.rs", "use crate::a::c::Unit;\npub struct Length(Unit);\n"),
        ("a/c.rs", "use crate::Length;\npub struct Unit;\n"),
    ];
    assert_eq!(circles(&files), [["a/b.rs", "a/c.rs"]]);
}

#[test]
fn imports_of_tests_and_of_the_enclosing_folder_are_no_circle() {
    let files = [
        ("lib.rs", "pub mod a;\nuse a::Area;\npub struct Length;\npub fn f(_: Area) {}\n"),
        ("a/mod.rs", "mod b;\npub use b::Area;\npub struct Side;\n"),
        ("a/b.rs", "use super::Side;\nuse crate::Length;\npub struct Area(Side, Length);\n"),
        ("c.rs", "#[cfg(test)]\nmod tests {\n    use crate::a::Area;\n}\n"),
    ];
    assert!(circles(&files).is_empty());
}

#[test]
fn each_line_has_one_kind() {
    let text = "//! Page.\n\nuse std::{\n    fmt,\n};\n\n/// Item.\n// Reason.\nfn f() {}\n\n#[cfg(test)]\nmod tests {\n    use super::f;\n\n}\n";
    let expected = LineCounts { code: 1, documentation: 2, comments: 1, imports: 3, tests: 5, blank: 3 };
    assert_eq!(LineCounts::of_file(&SourceFile::new("a.rs", text)), expected);
}

#[test]
#[ignore = "prints a table"]
fn print_line_counts() {
    println!("{}", table());
}
