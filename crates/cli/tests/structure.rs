//! Tests the structure of the sources: the files of a package import from each other without circles.

mod source_support;

use std::collections::BTreeSet;

use source_support::imports::import_circles;
use source_support::lines::{LineCounts, table};
use source_support::{Package, SourceFile, packages};

#[test]
fn the_files_of_a_package_do_not_import_in_circles() {
    for package in packages() {
        let circles = import_circles(&package);
        assert!(circles.is_empty(), "files of {} import from each other: {circles:#?}", package.folder);
    }
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
fn a_circle_through_a_stated_path_is_found_and_a_file_of_another_package_is_no_circle() {
    let files = [
        ("one/main.rs", "#[path = \"../two/a.rs\"]\nmod a;\n#[path = \"../../x.rs\"]\nmod x;\nmod b;\n"),
        ("one/b.rs", "use super::a::Area;\npub use super::x::Unit;\npub struct Length(Area);\n"),
        ("two/a.rs", "use super::b::Length;\nuse super::x::Unit;\npub struct Area(Length, Unit);\n"),
    ];
    let files = files.map(|(name, text)| SourceFile::new(name, text));
    let package = Package { folder: "src".to_owned(), files: files.into() };
    assert_eq!(import_circles(&package), [["one/b.rs", "two/a.rs"]]);
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

/// Returns the packages below `root` with their features.
fn selected_features(root: &[&str]) -> BTreeSet<String> {
    let output = std::process::Command::new(env!("CARGO"))
        .args(["tree", "--offline", "--edges", "normal,build", "--format", "{p} {f}", "--prefix", "none"])
        .args(root)
        .current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).unwrap();
    text.lines().map(|line| line.trim_end_matches(" (*)").to_owned()).collect()
}

/// Other features would compile all libraries again in `cargo install --path crates/cli` after `cargo run --release`.
#[test]
fn the_program_selects_the_features_of_the_workspace() {
    let workspace = selected_features(&[]);
    let program = selected_features(&["--package", "spikelane-cli"]);
    let only_program: Vec<_> = program.difference(&workspace).collect();
    assert!(only_program.is_empty() && program.len() > 100, "{only_program:#?}");
}
