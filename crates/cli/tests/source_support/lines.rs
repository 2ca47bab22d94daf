//! Counts the lines of packages by kind.

use std::fmt::Write as _;

use super::{Package, SourceFile, packages};
use crate::source_support::imports::import_circles;

/// Numbers of lines of each kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct LineCounts {
    /// Lines with code outside the other kinds.
    pub code: usize,
    /// Lines of documentation comments.
    pub documentation: usize,
    /// Lines of other comments.
    pub comments: usize,
    /// Lines of `use` declarations.
    pub imports: usize,
    /// Lines of inline modules of tests.
    pub tests: usize,
    pub blank: usize,
}

impl LineCounts {
    pub(crate) fn of_file(file: &SourceFile) -> Self {
        let mut counts = Self::default();
        let (tests, uses) = (file.test_blocks(), file.use_blocks());
        for (i, line) in file.lines.iter().enumerate().map(|(i, line)| (i, line.trim_start())) {
            let kind = if tests.iter().any(|t| t.contains(&i)) {
                &mut counts.tests
            } else if uses.iter().any(|u| u.contains(&i)) {
                &mut counts.imports
            } else if line.is_empty() {
                &mut counts.blank
            } else if line.starts_with("//!") || line.starts_with("///") && !line.starts_with("////") {
                &mut counts.documentation
            } else if line.starts_with("//") {
                &mut counts.comments
            } else {
                &mut counts.code
            };
            *kind += 1;
        }
        counts
    }

    fn add(&mut self, other: Self) {
        self.code += other.code;
        self.documentation += other.documentation;
        self.comments += other.comments;
        self.imports += other.imports;
        self.tests += other.tests;
        self.blank += other.blank;
    }
}

/// Returns a Markdown table of the packages: lines of each kind, files, median length of a file, and sizes of the import
/// circles.
pub(crate) fn table() -> String {
    let mut text = "| sources | code | documentation | comments | imports | inline tests | blank | files | median lines | import circles |\n|---|--:|--:|--:|--:|--:|--:|--:|--:|---|\n".to_owned();
    let mut sum = LineCounts::default();
    let mut all_lengths = Vec::new();
    let mut circles = 0;
    for package in packages() {
        let counts = package_counts(&package);
        sum.add(counts);
        let lengths: Vec<usize> = package.files.iter().map(|file| file.lines.len()).collect();
        let sizes: Vec<String> = import_circles(&package).iter().map(|c| c.len().to_string()).collect();
        circles += sizes.len();
        row(&mut text, &package.folder, counts, &lengths, &sizes.join(", "));
        all_lengths.extend(lengths);
    }
    row(&mut text, "all", sum, &all_lengths, &format!("{circles} circles"));
    text
}

fn package_counts(package: &Package) -> LineCounts {
    let mut sum = LineCounts::default();
    package.files.iter().for_each(|file| sum.add(LineCounts::of_file(file)));
    sum
}

fn row(text: &mut String, name: &str, counts: LineCounts, lengths: &[usize], circles: &str) {
    let LineCounts { code, documentation, comments, imports, tests, blank } = counts;
    let mut sorted = lengths.to_vec();
    sorted.sort_unstable();
    let (files, median) = (sorted.len(), sorted.get(sorted.len() / 2).copied().unwrap_or(0));
    writeln!(
        text,
        "| `{name}` | {code} | {documentation} | {comments} | {imports} | {tests} | {blank} | {files} | {median} | {circles} |"
    )
    .unwrap();
}
