//! Tests the pages of the documentation: links must be valid, pages must follow the rules of their kind, and the index must
//! be current.

mod docs_support;

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

use docs_support::{
    Page, check, current_pages, exists_in_repository, files, page, pages, root, split_at_markers,
    write_between_markers,
};

const INDEX: &str = "docs/README.md";
const BEGIN: &str = "<!-- generated: begin -->\n";
const END: &str = "<!-- generated: end -->\n";

const PAGE_KINDS: &[(&str, &str)] = &[
    ("guides", "How do I do it?"),
    ("reference", "What exactly does it read, write and print?"),
    ("why", "Why can it be trusted?"),
];

/// Maximum number of words in a guide, including commands.
const MAX_GUIDE_WORDS: usize = 900;

/// Phrases that describe history. Guides and reference pages must not contain them.
const HISTORY_WORDS: &[&str] = &[
    "no longer",
    "is not kept",
    "are not kept",
    " used to ",
    "which was here before",
    "earlier version",
    "commit ",
    "previously",
];

/// Returns the targets of the links and images on a page.
fn links(text: &str) -> Vec<&str> {
    text.match_indices("](").filter_map(|(at, _)| text[at + 2..].split_once(')').map(|(to, _)| to)).collect()
}

/// Returns the anchors of the headings on a page. GitHub and most viewers generate the same anchors.
fn anchors(page: &Page) -> Vec<String> {
    let headings = page.text.lines().filter(|line| line.starts_with('#'));
    let slug = |line: &str| {
        let anchor_char = |c: char| match c {
            ' ' => Some('-'),
            c if c.is_alphanumeric() || c == '-' || c == '_' => Some(c),
            _ => None,
        };
        line.trim_start_matches('#').trim().to_lowercase().chars().filter_map(anchor_char).collect()
    };
    headings.map(slug).collect()
}

/// Converts the target `to` of a link on the page `from` to a path relative to the repository root.
fn resolve(from: &str, to: &str) -> String {
    let mut parts: Vec<&str> = from.split('/').collect();
    parts.pop();
    for part in to.split('/') {
        match part {
            "." | "" => {}
            ".." => drop(parts.pop()),
            other => parts.push(other),
        }
    }
    parts.join("/")
}

fn broken_links(page: &Page, all: &BTreeMap<String, Vec<String>>) -> Vec<String> {
    let text = page.prose();
    let mut wrong = Vec::new();
    for to in links(&text).into_iter().filter(|to| !to.contains("://")) {
        let (file, anchor) = to.split_once('#').unwrap_or((to, ""));
        let name = if file.is_empty() { page.name.clone() } else { resolve(&page.name, file) };
        let heading =
            anchor.is_empty() || all.get(&name).is_none_or(|anchors| anchors.iter().any(|a| a == anchor));
        if !(file.is_empty() || exists_in_repository(&name)) || !heading {
            wrong.push(format!("{}: {to}", page.name));
        }
    }
    wrong
}

#[test]
fn every_link_between_pages_leads_somewhere() {
    let pages = pages();
    let all = pages.iter().map(|page| (page.name.clone(), anchors(page))).collect();
    let wrong: Vec<_> = pages.iter().flat_map(|page| broken_links(page, &all)).collect();
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn a_wrong_link_and_a_wrong_heading_are_seen() {
    let text =
        "# Here\n[a](README.md) [b](nowhere.md) [c](#here) [d](#there) ![e](pictures/none.png)\n".to_owned();
    let page = Page { name: "docs/made-up.md".to_owned(), text };
    let all = BTreeMap::from([(page.name.clone(), anchors(&page))]);
    assert_eq!(broken_links(&page, &all).len(), 3);
}

/// Returns the paths below `docs` that occur in a text.
fn named_pages(text: &str) -> Vec<&str> {
    let part = |c: char| c.is_ascii_alphanumeric() || "/_-.".contains(c);
    let starts = text.match_indices("docs/").map(|(at, _)| &text[at..]);
    let paths =
        starts.map(|rest| rest[..rest.find(|c| !part(c)).unwrap_or(rest.len())].trim_end_matches('.'));
    paths.filter(|p| p.rsplit('/').next().is_some_and(|name| name.contains('.'))).collect()
}

#[test]
fn every_page_that_code_and_pages_name_is_there() {
    let folders = [
        "src",
        "crates",
        "tests",
        "benches",
        "studies/src",
        "bindings",
        "examples",
        "fuzz/fuzz_targets",
        ".ci",
    ];
    let mut wrong = Vec::new();
    let exempt = ["crates/cli/tests/docs_links.rs"];
    let pages = pages().into_iter().map(|page| page.name);
    for name in folders.iter().flat_map(|folder| files(folder)).chain(pages) {
        if exempt.iter().any(|skip| name.starts_with(skip)) || name.contains("/.") {
            continue;
        }
        let Ok(text) = std::fs::read_to_string(root().join(&name)) else { continue };
        wrong.extend(
            named_pages(&text)
                .into_iter()
                .filter(|p| !exists_in_repository(p))
                .map(|p| format!("{name}: {p}")),
        );
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// Folders with sources of the repository.
const SOURCE_FOLDERS: &[&str] =
    &["src", "crates", "tests", "benches", "studies", "bindings", "examples", "fuzz", "docs", ".ci"];

/// Beginnings of paths that commands and builds write, so that the repository does not contain them.
const OUTPUT_PATHS: &[&str] =
    &["comparison/", "diagnosis/", "images/", "labels/", "target/", "include/spikelane."];

/// Names with `::` that are not Rust names of this workspace.
const FOREIGN_NAMES: &[&str] = &["spikelane::static"];

/// Returns the paths in a code span. A path has an extension. It also has a folder, unless it is a Rust file.
///
/// Paths with a placeholder such as `NAME` are omitted.
fn paths(span: &str) -> Vec<&str> {
    let is_part = |c: char| c.is_ascii_alphanumeric() || "/_-.".contains(c);
    let is_placeholder = |part: &str| {
        let stem = part.split('.').next().unwrap_or(part);
        stem.len() > 1 && stem.chars().all(|c| c.is_ascii_uppercase()) && stem != "README"
    };
    let has_extension = |word: &str| {
        let name = word.rsplit('/').next().unwrap_or(word);
        let parts = name.rsplit_once('.');
        parts.is_some_and(|(stem, end)| !stem.is_empty() && end.starts_with(|c: char| c.is_ascii_lowercase()))
    };
    let words = span.split_whitespace().map(|word| word.trim_end_matches([',', ';', ':', '.']));
    words
        .filter(|word| word.chars().all(is_part) && has_extension(word))
        .filter(|word| word.ends_with(".rs") || word.contains('/') && !word.starts_with(['/', '.']))
        .filter(|word| !word.split('/').any(is_placeholder))
        .collect()
}

/// Returns the Rust paths in a code span, such as `Plan::new`, as their parts.
fn rust_paths(span: &str) -> Vec<Vec<&str>> {
    let words = span.split(|c: char| !(c.is_ascii_alphanumeric() || c == '_' || c == ':'));
    let words = words.filter(|word| word.contains("::") && !FOREIGN_NAMES.contains(word));
    words.map(|word| word.split("::").filter(|part| !part.is_empty()).collect()).collect()
}

/// Returns the names of all items, fields and variants that the sources declare, and the names of the crates.
fn declared_names() -> BTreeSet<String> {
    const KEYWORDS: &[&str] =
        &["fn", "struct", "enum", "trait", "const", "type", "mod", "static", "macro_rules!"];
    let mut found = BTreeSet::from(["std".to_owned(), "spikelane".to_owned()]);
    for name in SOURCE_FOLDERS.iter().flat_map(|folder| files(folder)).filter(|name| name.ends_with(".rs")) {
        found.extend(name.split('/').nth(1).map(|package| format!("spikelane_{package}")));
        let text = std::fs::read_to_string(root().join(&name)).unwrap();
        for line in text.lines().map(str::trim) {
            let words: Vec<&str> = line.split_whitespace().collect();
            let begin = |word: &str| {
                let end = word.find(|c: char| !(c.is_ascii_alphanumeric() || c == '_'));
                word[..end.unwrap_or(word.len())].to_owned()
            };
            let items = words.windows(2).filter(|pair| KEYWORDS.contains(&pair[0]));
            found.extend(items.map(|pair| begin(pair[1])));
            match words[..] {
                ["pub", field, ..] if field.ends_with(':') => drop(found.insert(begin(field))),
                [variant, ..] if variant.starts_with(|c: char| c.is_ascii_uppercase()) => {
                    found.insert(begin(variant));
                }
                _ => {}
            }
        }
    }
    found
}

/// Returns the paths, flags and Rust paths (such as `Plan::new`) in the code spans of `page` that do not exist. A Rust path
/// exists if the sources declare each of its parts.
fn unknown_names(page: &Page, sources: &[String], declared: &BTreeSet<String>) -> Vec<String> {
    let mut wrong = Vec::new();
    for span in page.code_spans() {
        let is_source = |path: &str| {
            exists_in_repository(path) || sources.iter().any(|name| name.ends_with(&format!("/{path}")))
        };
        let is_output = |path: &str| OUTPUT_PATHS.iter().any(|begin| path.starts_with(begin));
        let unknown = paths(&span).into_iter().filter(|path| !is_source(path) && !is_output(path));
        wrong.extend(unknown.map(str::to_owned));
        let flags = span.split_whitespace().filter(|word| word.starts_with("--") && word.len() > 2);
        let flags = flags.map(|word| {
            let end = word[2..].find(|c: char| !(c.is_ascii_alphanumeric() || c == '-'));
            end.map_or(word, |end| &word[..end + 2])
        });
        wrong.extend(flags.filter(|flag| !check::is_flag(flag)).map(str::to_owned));
        // Commands contain filters of tests, which another test checks.
        for parts in rust_paths(&span).into_iter().filter(|_| !span.contains("cargo test")) {
            if parts.iter().any(|part| !declared.contains(*part)) {
                wrong.push(parts.join("::"));
            }
        }
    }
    wrong.into_iter().map(|name| format!("{}: {name}", page.name)).collect()
}

#[test]
fn every_path_flag_and_name_on_a_page_exists() {
    let sources: Vec<String> = SOURCE_FOLDERS.iter().flat_map(|folder| files(folder)).collect();
    let declared = declared_names();
    let wrong: Vec<_> =
        current_pages().iter().flat_map(|page| unknown_names(page, &sources, &declared)).collect();
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn unknown_paths_flags_and_names_are_seen() {
    let good = "`src/lib.rs` `sources/NAME.rs` `docs_links.rs` `images/000022.png` `--camera mine.toml` `Plan::new`\n";
    let bad = "`src/none.rs` `none.rs` `picture/none.png` `--no-such-flag` `Plan::no_such_name`\n";
    let page = Page { name: "docs/made-up.md".to_owned(), text: [good, bad].concat() };
    let sources: Vec<String> = SOURCE_FOLDERS.iter().flat_map(|folder| files(folder)).collect();
    assert_eq!(unknown_names(&page, &sources, &declared_names()).len(), 5);
}

#[test]
fn every_page_is_of_a_kind() {
    // These pages belong to no kind.
    let loose = [INDEX, "docs/structure.md", "docs/glossary.md"];
    for page in pages().iter().filter(|p| p.name.starts_with("docs/") && !loose.contains(&p.name.as_str())) {
        let kind = page.kind().unwrap_or("");
        assert!(PAGE_KINDS.iter().any(|(name, _)| *name == kind), "{} is of no kind", page.name);
    }
}

#[test]
fn guides_are_short() {
    for page in pages().iter().filter(|p| p.kind() == Some("guides")) {
        let words = page.count_words();
        assert!(words <= MAX_GUIDE_WORDS, "{} has {words} words", page.name);
    }
}

#[test]
fn guides_and_reference_tell_no_history() {
    let is_dated = |page: &Page| {
        let text = page.prose().replace('\n', " ").to_lowercase();
        let dated = text.match_indices("20").any(|(at, _)| {
            let rest = text.as_bytes().get(at..at + 10).unwrap_or_default();
            rest.len() == 10 && rest[4] == b'-' && rest[7] == b'-' && rest[5].is_ascii_digit()
        });
        let words = HISTORY_WORDS.iter().find(|word| text.contains(**word)).copied();
        words.map(str::to_owned).or_else(|| dated.then(|| "a date".to_owned()))
    };
    let wrong: Vec<String> = pages()
        .iter()
        .filter(|p| matches!(p.kind(), Some("guides" | "reference")))
        .filter_map(|p| is_dated(p).map(|what| format!("{}: {what}", p.name)))
        .collect();
    assert!(wrong.is_empty(), "git and the changelog have the history: {wrong:#?}");
}

fn index() -> String {
    let pages = pages();
    let mut text = String::new();
    for (kind, question) in PAGE_KINDS {
        writeln!(text, "\n## {}{}\n\n{question}\n", kind[..1].to_uppercase(), &kind[1..]).unwrap();
        for page in pages.iter().filter(|p| p.kind() == Some(kind)) {
            let path = page.name.strip_prefix("docs/").unwrap();
            writeln!(text, "* [{}]({path})", page.title()).unwrap();
        }
    }
    text
}

#[test]
fn the_list_of_pages_is_current() {
    let page = page(INDEX);
    let [_, committed, _] = split_at_markers(&page, BEGIN, END);
    assert!(committed == index(), "run: cargo test --test docs_links -- --ignored");
}

#[test]
#[ignore = "writes docs/README.md"]
fn write_the_list_of_pages() {
    write_between_markers(INDEX, BEGIN, END, &index());
}
