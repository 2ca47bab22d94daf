//! The pages of the documentation, and what stands in them.
#![allow(dead_code, reason = "each test file uses a part of it")]

pub(crate) mod check;
pub(crate) mod run;

use std::fs;
use std::path::{Path, PathBuf};

pub(crate) struct Page {
    /// From the root of the repository, with `/` between folders.
    pub name: String,
    pub text: String,
}

/// A fenced block: the words behind its fence, what it holds, and the line on which it begins.
#[derive(Clone, Debug)]
pub(crate) struct Block {
    pub words: Vec<String>,
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

/// The README, the changelog and every page below `docs`, in the order of their names.
pub(crate) fn pages() -> Vec<Page> {
    let mut names: Vec<String> = files("docs").into_iter().filter(|name| name.ends_with(".md")).collect();
    names.extend(["README.md", "CHANGELOG.md"].map(str::to_owned));
    names.sort();
    names.iter().map(|name| page(name)).collect()
}

/// All files below a folder of the repository, named from its root.
pub(crate) fn files(folder: &str) -> Vec<String> {
    let mut found = Vec::new();
    let Ok(entries) = fs::read_dir(root().join(folder)) else { return found };
    for entry in entries {
        let path = entry.unwrap().path();
        let name = format!("{folder}/{}", path.file_name().unwrap().to_string_lossy());
        if path.is_dir() {
            found.extend(files(&name));
        } else {
            found.push(name);
        }
    }
    found
}

impl Page {
    pub(crate) fn blocks(&self) -> Vec<Block> {
        let mut found: Vec<Block> = Vec::new();
        let mut open = false;
        for (i, line) in self.text.lines().enumerate() {
            match line.strip_prefix("```") {
                Some(_) if open => open = false,
                Some(words) => {
                    let words =
                        words.split([' ', ',']).filter(|w| !w.is_empty()).map(str::to_owned).collect();
                    found.push(Block { words, text: String::new(), line: i + 1 });
                    open = true;
                }
                None if open => {
                    let block = found.last_mut().unwrap();
                    block.text += line;
                    block.text.push('\n');
                }
                None => {}
            }
        }
        assert!(!open, "{}: a block without an end", self.name);
        found
    }

    /// The page without its blocks.
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

    pub(crate) fn title(&self) -> &str {
        self.text.lines().find_map(|line| line.strip_prefix("# ")).unwrap_or(&self.name)
    }

    pub(crate) fn count_words(&self) -> usize {
        self.text.split_whitespace().count()
    }

    /// The folder below `docs` that says of what kind the page is.
    pub(crate) fn kind(&self) -> Option<&str> {
        self.name.strip_prefix("docs/")?.split_once('/').map(|(kind, _)| kind)
    }
}

impl Block {
    pub(crate) fn language(&self) -> &str {
        self.words.first().map_or("", String::as_str)
    }

    pub(crate) fn is(&self, word: &str) -> bool {
        self.words.iter().any(|w| w == word)
    }

    /// What has to be there before the block can run: programs, `python:MODULE`, or `./FILE`.
    pub(crate) fn needs(&self) -> &[String] {
        match self.words.iter().position(|w| w == "needs") {
            Some(at) => &self.words[at + 1..],
            None => &[],
        }
    }

    /// Whether it is a command block.
    pub(crate) fn commands(&self) -> bool {
        self.language() == "sh"
    }
}

/// The text of `docs/README.md` between its marks, and the page around it.
pub(crate) fn between<'a>(page: &'a Page, begin: &str, end: &str) -> [&'a str; 3] {
    let (head, rest) = page.text.split_once(begin).unwrap_or_else(|| panic!("{}: no {begin}", page.name));
    let (found, tail) = rest.split_once(end).unwrap_or_else(|| panic!("{}: no {end}", page.name));
    [head, found, tail]
}

/// Writes `text` between the marks of a page.
pub(crate) fn put(name: &str, begin: &str, end: &str, text: &str) {
    let page = page(name);
    let [head, _, tail] = between(&page, begin, end);
    fs::write(root().join(name), format!("{head}{begin}{text}{end}{tail}")).unwrap();
}

/// Whether a link's target is in the repository.
pub(crate) fn exists(name: &str) -> bool {
    Path::new(&root()).join(name).exists()
}
