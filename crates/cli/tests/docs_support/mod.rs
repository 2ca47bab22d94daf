//! Reads the pages of the documentation.
#![allow(dead_code, reason = "each test file uses a part of it")]

pub(crate) mod check;
pub(crate) mod run;

use std::fs;
use std::path::{Path, PathBuf};

pub(crate) struct Page {
    /// Path from the repository root, with `/` between folders.
    pub name: String,
    pub text: String,
}

/// A fenced block: the words after the opening fence, the text, and the line number of the opening fence.
#[derive(Clone, Debug)]
pub(crate) struct Block {
    pub fence_words: Vec<String>,
    pub text: String,
    pub line: usize,
}

pub(crate) fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

pub(crate) fn page(name: &str) -> Page {
    let path = root().join(name);
    let text = fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    Page { name: name.to_owned(), text }
}

/// Returns README, the changelog and every page below `docs`, sorted by name.
pub(crate) fn pages() -> Vec<Page> {
    let mut names: Vec<String> = files("docs").into_iter().filter(|name| name.ends_with(".md")).collect();
    names.extend(["README.md", "CHANGELOG.md"].map(str::to_owned));
    names.sort();
    names.iter().map(|name| page(name)).collect()
}

/// Returns [`pages`] without the changelog, and the pages of single packages.
pub(crate) fn current_pages() -> Vec<Page> {
    let mut all = pages();
    all.retain(|page| page.name != "CHANGELOG.md");
    let crates = fs::read_dir(root().join("crates")).unwrap();
    let folders = crates.map(|entry| format!("crates/{}", entry.unwrap().file_name().to_string_lossy()));
    let folders = folders.chain(["src", "bindings/c"].map(str::to_owned));
    all.extend(folders.map(|folder| page(&format!("{folder}/README.md"))));
    all.extend(["CONTRIBUTING.md", "SECURITY.md", "SHORTCOMINGS.md"].map(page));
    all
}

/// Returns all files below a folder of the repository, as paths relative to the repository root.
pub(crate) fn files(folder: &str) -> Vec<String> {
    let mut names = Vec::new();
    let Ok(entries) = fs::read_dir(root().join(folder)) else { return names };
    for entry in entries {
        let path = entry.unwrap().path();
        let name = format!("{folder}/{}", path.file_name().unwrap().to_string_lossy());
        if path.is_dir() {
            names.extend(files(&name));
        } else {
            names.push(name);
        }
    }
    names
}

impl Page {
    pub(crate) fn blocks(&self) -> Vec<Block> {
        let mut blocks: Vec<Block> = Vec::new();
        let mut open = false;
        for (i, line) in self.text.lines().enumerate() {
            match line.strip_prefix("```") {
                Some(_) if open => open = false,
                Some(words) => {
                    let words =
                        words.split([' ', ',']).filter(|w| !w.is_empty()).map(str::to_owned).collect();
                    blocks.push(Block { fence_words: words, text: String::new(), line: i + 1 });
                    open = true;
                }
                None if open => {
                    let block = blocks.last_mut().unwrap();
                    block.text += line;
                    block.text.push('\n');
                }
                None => {}
            }
        }
        assert!(!open, "{}: a block without an end", self.name);
        blocks
    }

    /// Returns the text of the page without its fenced blocks.
    pub(crate) fn prose(&self) -> String {
        let mut open = false;
        let mut text = String::new();
        for line in self.text.lines() {
            if line.starts_with("```") {
                open = !open;
            } else if !open {
                text += line;
                text.push('\n');
            }
        }
        text
    }

    /// Returns the texts between backticks outside of blocks.
    pub(crate) fn code_spans(&self) -> Vec<String> {
        self.prose().split('`').skip(1).step_by(2).map(|span| span.replace('\n', " ")).collect()
    }

    pub(crate) fn title(&self) -> &str {
        self.text.lines().find_map(|line| line.strip_prefix("# ")).unwrap_or(&self.name)
    }

    pub(crate) fn count_words(&self) -> usize {
        self.text.split_whitespace().count()
    }

    /// Returns the folder of the page below `docs`. This folder is the kind of the page.
    pub(crate) fn kind(&self) -> Option<&str> {
        self.name.strip_prefix("docs/")?.split_once('/').map(|(kind, _)| kind)
    }
}

impl Block {
    pub(crate) fn language(&self) -> &str {
        self.fence_words.first().map_or("", String::as_str)
    }

    pub(crate) fn has_word(&self, word: &str) -> bool {
        self.fence_words.iter().any(|w| w == word)
    }

    /// Returns the requirements of the block. A requirement is a program, `python:MODULE`, or `./FILE`.
    pub(crate) fn requirements(&self) -> &[String] {
        match self.fence_words.iter().position(|w| w == "needs") {
            Some(at) => &self.fence_words[at + 1..],
            None => &[],
        }
    }

    /// Whether the block contains shell commands.
    pub(crate) fn is_command_block(&self) -> bool {
        self.language() == "sh"
    }
}

/// Returns three texts of a page: before the first marker, between the markers, and after the second marker.
pub(crate) fn split_at_markers<'a>(page: &'a Page, begin: &str, end: &str) -> [&'a str; 3] {
    let (head, rest) = page.text.split_once(begin).unwrap_or_else(|| panic!("{}: no {begin}", page.name));
    let (generated, tail) = rest.split_once(end).unwrap_or_else(|| panic!("{}: no {end}", page.name));
    [head, generated, tail]
}

/// Replaces the text between the markers of a page with `text`.
pub(crate) fn write_between_markers(name: &str, begin: &str, end: &str, text: &str) {
    let page = page(name);
    let [head, _, tail] = split_at_markers(&page, begin, end);
    fs::write(root().join(name), format!("{head}{begin}{text}{end}{tail}")).unwrap();
}

/// Whether the target `name` of a link exists in the repository.
pub(crate) fn exists_in_repository(name: &str) -> bool {
    Path::new(&root()).join(name).exists()
}
