//! Pages of the documentation: links lead somewhere, each kind keeps to its kind, the list of pages is current.

mod docs_support;

use std::collections::BTreeMap;
use std::fmt::Write as _;

use docs_support::{Page, between, exists, files, page, pages, put, root};

const INDEX: &str = "docs/README.md";
const BEGIN: &str = "<!-- generated: begin -->\n";
const END: &str = "<!-- generated: end -->\n";

const KINDS: &[(&str, &str)] = &[
    ("guides", "How do I do it?"),
    ("reference", "What exactly does it say, read and write?"),
    ("why", "Why can it be trusted?"),
];

/// The most words of a guide, its commands included.
const LONGEST_GUIDE: usize = 900;

/// Words by which guides and reference would tell of how things were.
const HISTORY: &[&str] = &[
    "no longer",
    "is not kept",
    "are not kept",
    " used to ",
    "which was here before",
    "earlier version",
    "commit ",
    "previously",
];

/// The targets of a page's links and pictures.
fn links(text: &str) -> Vec<&str> {
    text.match_indices("](").filter_map(|(at, _)| text[at + 2..].split_once(')').map(|(to, _)| to)).collect()
}

/// The anchors that a page's headings have on GitHub and in most viewers.
fn anchors(page: &Page) -> Vec<String> {
    let headings = page.text.lines().filter(|line| line.starts_with('#'));
    let slug = |line: &str| {
        let kept = |c: char| match c {
            ' ' => Some('-'),
            c if c.is_alphanumeric() || c == '-' || c == '_' => Some(c),
            _ => None,
        };
        line.trim_start_matches('#').trim().to_lowercase().chars().filter_map(kept).collect()
    };
    headings.map(slug).collect()
}

/// `to` as seen from the page `from`, named from the root.
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

fn broken(page: &Page, all: &BTreeMap<String, Vec<String>>) -> Vec<String> {
    let text = page.prose();
    let mut wrong = Vec::new();
    for to in links(&text).into_iter().filter(|to| !to.contains("://")) {
        let (file, anchor) = to.split_once('#').unwrap_or((to, ""));
        let name = if file.is_empty() { page.name.clone() } else { resolve(&page.name, file) };
        let heading =
            anchor.is_empty() || all.get(&name).is_none_or(|found| found.iter().any(|a| a == anchor));
        if !(file.is_empty() || exists(&name)) || !heading {
            wrong.push(format!("{}: {to}", page.name));
        }
    }
    wrong
}

#[test]
fn every_link_between_pages_leads_somewhere() {
    let pages = pages();
    let all = pages.iter().map(|page| (page.name.clone(), anchors(page))).collect();
    let wrong: Vec<_> = pages.iter().flat_map(|page| broken(page, &all)).collect();
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn a_wrong_link_and_a_wrong_heading_are_seen() {
    let text =
        "# Here\n[a](README.md) [b](nowhere.md) [c](#here) [d](#there) ![e](pictures/none.png)\n".to_owned();
    let page = Page { name: "docs/made-up.md".to_owned(), text };
    let all = BTreeMap::from([(page.name.clone(), anchors(&page))]);
    assert_eq!(broken(&page, &all).len(), 3);
}

/// Paths below `docs` that a text names.
fn named(text: &str) -> Vec<&str> {
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
    let own = ["crates/cli/tests/docs_links.rs"];
    let pages = pages().into_iter().map(|page| page.name);
    for name in folders.iter().flat_map(|folder| files(folder)).chain(pages) {
        if own.iter().any(|skip| name.starts_with(skip)) || name.contains("/.") {
            continue;
        }
        let Ok(text) = std::fs::read_to_string(root().join(&name)) else { continue };
        wrong.extend(named(&text).into_iter().filter(|p| !exists(p)).map(|p| format!("{name}: {p}")));
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn every_page_is_of_a_kind() {
    // For those who change the sources.
    let loose = [INDEX, "docs/structure.md"];
    for page in pages().iter().filter(|p| p.name.starts_with("docs/") && !loose.contains(&p.name.as_str())) {
        let kind = page.kind().unwrap_or("");
        assert!(KINDS.iter().any(|(name, _)| *name == kind), "{} is of no kind", page.name);
    }
}

#[test]
fn guides_are_short() {
    for page in pages().iter().filter(|p| p.kind() == Some("guides")) {
        let words = page.count_words();
        assert!(words <= LONGEST_GUIDE, "{} has {words} words", page.name);
    }
}

#[test]
fn guides_and_reference_tell_no_history() {
    let told = |page: &Page| {
        let text = page.prose().replace('\n', " ").to_lowercase();
        let dated = text.match_indices("20").any(|(at, _)| {
            let rest = text.as_bytes().get(at..at + 10).unwrap_or_default();
            rest.len() == 10 && rest[4] == b'-' && rest[7] == b'-' && rest[5].is_ascii_digit()
        });
        let words = HISTORY.iter().find(|word| text.contains(**word)).copied();
        words.map(str::to_owned).or_else(|| dated.then(|| "a date".to_owned()))
    };
    let wrong: Vec<String> = pages()
        .iter()
        .filter(|p| matches!(p.kind(), Some("guides" | "reference")))
        .filter_map(|p| told(p).map(|what| format!("{}: {what}", p.name)))
        .collect();
    assert!(wrong.is_empty(), "git and the changelog have the history: {wrong:#?}");
}

fn index() -> String {
    let pages = pages();
    let mut text = String::new();
    for (kind, question) in KINDS {
        writeln!(text, "\n## {}{}\n\n{question}\n", kind[..1].to_uppercase(), &kind[1..]).unwrap();
        text += "| page | words, about |\n|---|--:|\n";
        for page in pages.iter().filter(|p| p.kind() == Some(kind)) {
            let path = page.name.strip_prefix("docs/").unwrap();
            // To the nearest fifty, so that not every mended sentence asks for a new list.
            let words = (page.count_words() + 25) / 50 * 50;
            writeln!(text, "| [{}]({path}) | {words} |", page.title()).unwrap();
        }
    }
    text
}

#[test]
fn the_list_of_pages_is_current() {
    let page = page(INDEX);
    let [_, found, _] = between(&page, BEGIN, END);
    assert!(found == index(), "run: cargo test --test docs_links -- --ignored");
}

#[test]
#[ignore = "writes docs/README.md"]
fn write_the_list_of_pages() {
    put(INDEX, BEGIN, END, &index());
}
