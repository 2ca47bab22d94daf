//! Reads the Rust sources of the workspace: kinds of lines, and imports between files.
//!
//! The sources are formatted by rustfmt, so a block ends with a brace at the indentation of its first line.

pub(crate) mod imports;
pub(crate) mod lines;

use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// A package: its folder of sources and the files in it.
pub(crate) struct Package {
    /// Path of the folder of sources from the repository root, for example `crates/io/src`.
    pub folder: String,
    pub files: Vec<SourceFile>,
}

pub(crate) struct SourceFile {
    /// Path below the folder of sources, with `/` between folders.
    pub name: String,
    pub lines: Vec<String>,
}

/// Returns the packages of the workspace, sorted by folder.
pub(crate) fn packages() -> Vec<Package> {
    let root = root();
    let crates = fs::read_dir(root.join("crates")).unwrap();
    let crates = crates.map(|entry| format!("crates/{}/src", entry.unwrap().file_name().to_string_lossy()));
    let others = ["src", "bindings/c/src", "bindings/python/src", "studies/src"].map(str::to_owned);
    let mut folders: Vec<String> = crates.chain(others).collect();
    folders.sort();
    folders
        .into_iter()
        .map(|folder| Package { files: source_files(&root.join(&folder), ""), folder })
        .collect()
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn source_files(folder: &Path, below: &str) -> Vec<SourceFile> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = format!("{below}{}", path.file_name().unwrap().to_string_lossy());
        if path.is_dir() {
            files.extend(source_files(&path, &format!("{name}/")));
        } else if name.ends_with(".rs") {
            files.push(SourceFile::new(&name, &fs::read_to_string(&path).unwrap()));
        }
    }
    files.sort_by(|a, b| a.name.cmp(&b.name));
    files
}

impl SourceFile {
    pub(crate) fn new(name: &str, text: &str) -> Self {
        Self { name: name.to_owned(), lines: text.lines().map(str::to_owned).collect() }
    }

    /// Returns the line ranges of the inline modules of tests, including the attribute.
    pub(crate) fn test_blocks(&self) -> Vec<Range<usize>> {
        let mut blocks = Vec::new();
        let mut from = 0;
        while let Some(at) =
            self.lines[from..].iter().position(|l| l.trim() == "#[cfg(test)]").map(|i| from + i)
        {
            let indent = indentation(&self.lines[at]);
            let is_end = |l: &String| indentation(l) == indent && l.trim_start().starts_with(['}', ')']);
            // The block of a module or function opens on a line after the attributes.
            let opens = (at + 1..self.lines.len()).find(|i| !self.lines[*i].trim_start().starts_with("#["));
            let end = match opens {
                Some(i) if self.lines[i].ends_with('{') => {
                    self.lines[i..].iter().position(is_end).map_or(self.lines.len(), |n| i + n + 1)
                }
                Some(i) => i + 1,
                None => self.lines.len(),
            };
            blocks.push(at..end);
            from = end;
        }
        blocks
    }

    /// Returns the line ranges of the `use` declarations outside the blocks of tests.
    pub(crate) fn use_blocks(&self) -> Vec<Range<usize>> {
        let tests = self.test_blocks();
        let mut blocks = Vec::new();
        let mut from = 0;
        while from < self.lines.len() {
            let mut next = from + 1;
            if let Some(test) = tests.iter().find(|t| t.contains(&from)) {
                next = test.end;
            } else if is_use(&self.lines[from]) {
                let end = self.lines[from..].iter().position(|l| l.trim_end().ends_with(';'));
                next = end.map_or(self.lines.len(), |n| from + n + 1);
                blocks.push(from..next);
            }
            from = next;
        }
        blocks
    }
}

pub(crate) fn indentation(line: &str) -> usize {
    line.len() - line.trim_start().len()
}

fn is_use(line: &str) -> bool {
    without_visibility(line.trim_start()).starts_with("use ")
}

/// Removes `pub`, `pub(crate)` and so on from the beginning of an item.
pub(crate) fn without_visibility(item: &str) -> &str {
    let Some(rest) = item.strip_prefix("pub") else { return item };
    let rest = match rest.strip_prefix('(') {
        Some(inner) => inner.split_once(')').map_or(rest, |(_, rest)| rest),
        None => rest,
    };
    rest.strip_prefix(' ').unwrap_or(item)
}
