//! The public face, read from the sources: what a crate that depends on this one can name.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use crate::graph::{Graph, is_internal};

const KINDS: &[&str] = &["struct", "enum", "union", "trait", "fn", "const", "static", "type", "mod"];

/// The face and what was counted beside it.
#[derive(Debug, Default)]
pub(crate) struct Api {
    /// `kind path`, in order; every thing once, by its shortest path.
    pub items: Vec<String>,
    /// Methods and associated functions of public types.
    pub methods: usize,
    /// Public fields.
    pub fields: usize,
    /// `impl` blocks of public types, traits' included, derived ones not.
    pub impls: usize,
    /// Public structs with public fields, and public enums, that may grow without breaking anybody.
    pub growing: usize,
    /// Those that may not.
    pub closed: Vec<String>,
}

/// Where a name leads: the file's module and the kind and name of the thing.
type Thing = (Vec<String>, &'static str, String);

impl Api {
    /// Walks from the crate's root through everything public.
    pub(crate) fn of(graph: &Graph, sources: &BTreeMap<PathBuf, String>) -> Self {
        let mut found: BTreeMap<Thing, String> = BTreeMap::new();
        walk(graph, sources, &[], "spikelane", &mut found, &mut BTreeSet::new());
        let mut api = Self::default();
        for ((_, kind, _), path) in &found {
            api.items.push(format!("{kind:<6} {path}"));
        }
        api.items.sort_by(|a, b| a[7..].cmp(&b[7..]));
        for ((module, kind, name), path) in &found {
            let text = &sources[graph.file(module)];
            match *kind {
                "struct" => api.count_struct(text, name, path),
                "enum" => api.note(text, &format!("pub enum {name}"), path),
                _ => {}
            }
        }
        let names: BTreeSet<&str> =
            found.keys().filter(|t| t.1 != "mod" && t.1 != "fn").map(|t| t.2.as_str()).collect();
        for (path, text) in sources {
            if public_room(graph, &found, path) {
                api.count_impls(text, &names);
            }
        }
        api.closed.sort();
        api
    }

    fn count_struct(&mut self, text: &str, name: &str, path: &str) {
        let Some(body) = body(text, &format!("pub struct {name}")) else {
            return;
        };
        let fields = body.lines().filter(|l| l.starts_with("    pub ") && l.contains(':')).count();
        self.fields += fields;
        if fields > 0 {
            self.note(text, &format!("pub struct {name}"), path);
        }
    }

    fn note(&mut self, text: &str, start: &str, path: &str) {
        let Some(at) = position(text, start) else {
            return;
        };
        let before = text[..at].lines().rev().take_while(|l| l.starts_with("#[") || l.starts_with("///"));
        if before.into_iter().any(|l| l.contains("non_exhaustive")) {
            self.growing += 1;
        } else {
            self.closed.push(path.to_owned());
        }
    }

    fn count_impls(&mut self, text: &str, names: &BTreeSet<&str>) {
        let mut inside = false;
        for line in text.lines().take_while(|l| !l.starts_with("#[cfg(test)]")) {
            if line.starts_with("impl") {
                let target = line.split(" for ").last().unwrap_or(line);
                let own =
                    target.split(|c: char| !(c.is_alphanumeric() || c == '_')).find(|w| names.contains(w));
                inside = own.is_some() && !line.contains(" for ");
                self.impls += usize::from(own.is_some());
            } else if line.starts_with('}') {
                inside = false;
            } else if inside
                && line.starts_with("    pub ")
                && line.contains("fn ")
                && !line.starts_with("    pub(")
            {
                self.methods += 1;
            }
        }
    }
}

/// Whether a file belongs to a room of which anything is public.
fn public_room(graph: &Graph, found: &BTreeMap<Thing, String>, path: &PathBuf) -> bool {
    found.keys().any(|(module, _, _)| {
        let file = graph.file(module);
        file == path || file.components().next() == path.components().next()
    })
}

fn walk(
    graph: &Graph,
    sources: &BTreeMap<PathBuf, String>,
    module: &[String],
    shown: &str,
    found: &mut BTreeMap<Thing, String>,
    seen: &mut BTreeSet<(Vec<String>, String)>,
) {
    if !seen.insert((module.to_vec(), shown.to_owned())) {
        return;
    }
    for (kind, name) in defined(&sources[graph.file(module)]) {
        if kind == "mod" {
            let inner: Vec<String> = module.iter().cloned().chain([name.clone()]).collect();
            keep(found, (inner.clone(), "mod", name.clone()), format!("{shown}::{name}"));
            walk(graph, sources, &inner, &format!("{shown}::{name}"), found, seen);
        } else {
            keep(found, (module.to_vec(), kind, name.clone()), format!("{shown}::{name}"));
        }
    }
    for (path, name) in graph.handed_on(module) {
        let Some((other, rest)) = graph.leads_to(module, &path) else {
            continue;
        };
        let path = format!("{shown}::{name}");
        match rest.first() {
            None => {
                keep(found, (other.clone(), "mod", name), path.clone());
                walk(graph, sources, &other, &path, found, seen);
            }
            Some(last) => {
                for (kind, own) in
                    defined(&sources[graph.file(&other)]).into_iter().filter(|(_, own)| own == last)
                {
                    keep(found, (other.clone(), kind, own), path.clone());
                }
            }
        }
    }
}

fn keep(found: &mut BTreeMap<Thing, String>, thing: Thing, path: String) {
    let known = found.entry(thing).or_insert_with(|| path.clone());
    if (path.matches("::").count(), &path) < (known.matches("::").count(), known) {
        *known = path;
    }
}

/// What a file defines in public, at its top, without what is hidden.
fn defined(text: &str) -> Vec<(&'static str, String)> {
    let lines: Vec<&str> = text.lines().collect();
    let mut all = Vec::new();
    for (i, line) in lines.iter().enumerate() {
        let Some(rest) = line.strip_prefix("pub ") else {
            continue;
        };
        let words: Vec<&str> = rest.split(|c: char| !(c.is_alphanumeric() || c == '_')).collect();
        let Some(at) = words.iter().position(|w| KINDS.contains(w)) else {
            continue;
        };
        // `const fn` is a function.
        let at = if words[at] == "const" && words.get(at + 1) == Some(&"fn") { at + 1 } else { at };
        let attributes = lines[..i].iter().rev().take_while(|l| l.starts_with("#[") || l.starts_with("///"));
        if attributes.into_iter().any(|l| l.contains("doc(hidden)") || is_internal(l)) {
            continue;
        }
        let kind = KINDS.iter().find(|k| **k == words[at]).copied().unwrap_or("mod");
        all.push((kind, words.get(at + 1).copied().unwrap_or_default().to_owned()));
    }
    all
}

fn position(text: &str, start: &str) -> Option<usize> {
    let ends = |at: &usize| text[at + start.len()..].starts_with([' ', '<', '(', ';', '{']);
    text.match_indices(start).map(|(at, _)| at).find(ends)
}

fn body<'a>(text: &'a str, start: &str) -> Option<&'a str> {
    let at = position(text, start)?;
    let end = text[at..].find("\n}").map_or(text.len(), |n| at + n);
    Some(&text[at..end])
}
