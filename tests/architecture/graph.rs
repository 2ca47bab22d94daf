//! Which source file uses which: read from `use` lines and written-out paths, re-exports followed.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

type Name = Vec<String>;

/// A `use` of one thing: who else may use it, its path, and the name that it gets.
struct Use {
    public: bool,
    for_all: bool,
    path: Vec<String>,
    name: String,
}

/// The modules of a source folder.
pub(crate) struct Graph {
    files: BTreeMap<Name, PathBuf>,
    uses: BTreeMap<Name, Vec<Use>>,
    arrows: BTreeMap<Name, BTreeSet<Name>>,
}

impl Graph {
    /// Reads the sources, given by their paths below `src`.
    pub(crate) fn new(sources: &BTreeMap<PathBuf, String>) -> Self {
        let mut graph = Self { files: BTreeMap::new(), uses: BTreeMap::new(), arrows: BTreeMap::new() };
        let mut rest = BTreeMap::new();
        for (path, text) in sources.iter().filter(|(path, _)| path.as_path() != Path::new("main.rs")) {
            let name = module_of(path);
            let (uses, code) = taken_apart(&code_of(text));
            graph.files.insert(name.clone(), path.clone());
            graph.uses.insert(name.clone(), uses);
            rest.insert(name, code);
        }
        for (name, code) in &rest {
            let found = graph.used_by(name, code);
            graph.arrows.insert(name.clone(), found);
        }
        graph
    }

    /// The circles, each as its files in alphabetical order.
    pub(crate) fn circles(&self) -> Vec<Vec<PathBuf>> {
        let reach: BTreeMap<&Name, BTreeSet<&Name>> =
            self.arrows.keys().map(|m| (m, self.reached(m))).collect();
        let mut circles = BTreeSet::new();
        for (module, beyond) in reach.iter().filter(|(module, beyond)| beyond.contains(*module)) {
            let mutual = beyond.iter().filter(|other| reach[*other].contains(module));
            let circle: BTreeSet<&PathBuf> = mutual.map(|other| &self.files[*other]).collect();
            circles.insert(circle.into_iter().cloned().collect::<Vec<_>>());
        }
        circles.into_iter().collect()
    }

    /// The file of a module.
    pub(crate) fn file(&self, module: &[String]) -> &PathBuf {
        &self.files[module]
    }

    /// What a module hands on to everybody: path and name.
    pub(crate) fn handed_on(&self, module: &[String]) -> Vec<(Vec<String>, String)> {
        let all = self.uses[module].iter().filter(|u| u.for_all);
        all.map(|u| (u.path.clone(), u.name.clone())).collect()
    }

    /// The module that a path leads to and the names behind it, re-exports followed; `None` outside this crate.
    pub(crate) fn leads_to(&self, module: &[String], path: &[String]) -> Option<(Vec<String>, Vec<String>)> {
        self.followed(&module.to_vec(), path, 0)
    }

    fn reached<'a>(&'a self, from: &'a Name) -> BTreeSet<&'a Name> {
        let mut seen = BTreeSet::new();
        let mut open: Vec<&Name> = self.arrows[from].iter().collect();
        while let Some(module) = open.pop() {
            if seen.insert(module) {
                open.extend(&self.arrows[module]);
            }
        }
        seen
    }

    fn used_by(&self, module: &Name, code: &str) -> BTreeSet<Name> {
        // What a room's face hands on is no use of it.
        let is_face = self.files[module].file_name().is_some_and(|n| n == "mod.rs" || n == "lib.rs");
        let used = self.uses[module].iter().filter(|u| !(u.public && is_face)).map(|u| u.path.clone());
        let written = paths(code);
        let all = used.chain(written).filter_map(|path| self.resolved(module, &path));
        all.filter(|other| other != module && self.files.contains_key(other)).collect()
    }

    /// The module that a path leads to, seen from `module`; `None` outside this crate.
    fn resolved(&self, module: &Name, path: &[String]) -> Option<Name> {
        self.followed(module, path, 0).map(|(found, _)| found)
    }

    fn followed(&self, module: &Name, path: &[String], depth: usize) -> Option<(Name, Vec<String>)> {
        if depth > 8 {
            return None;
        }
        let (mut here, mut i) = (module.clone(), 0);
        match path[0].as_str() {
            "crate" => (here, i) = (Name::new(), 1),
            "self" => i = 1,
            "super" => {
                while path.get(i).is_some_and(|p| p == "super") {
                    here.pop();
                    i += 1;
                }
            }
            first if self.files.contains_key(&child(module, first)) => {}
            first => {
                let found = self.uses[module].iter().find(|u| u.name == first && u.path != path)?;
                let longer: Vec<String> = found.path.iter().chain(&path[1..]).cloned().collect();
                return self.followed(module, &longer, depth + 1);
            }
        }
        while let Some(name) = path.get(i) {
            if self.files.contains_key(&child(&here, name)) {
                here = child(&here, name);
                i += 1;
                continue;
            }
            let handed_on = self.uses.get(&here)?.iter().find(|u| u.name == *name);
            let longer = handed_on.map(|u| u.path.iter().chain(&path[i + 1..]).cloned().collect::<Vec<_>>());
            let beyond = longer.and_then(|p| self.followed(&here, &p, depth + 1));
            return Some(beyond.unwrap_or_else(|| (here, path[i..].to_vec())));
        }
        Some((here, Vec::new()))
    }
}

fn child(module: &Name, name: &str) -> Name {
    module.iter().cloned().chain([name.to_owned()]).collect()
}

fn module_of(path: &Path) -> Name {
    let mut name: Name =
        path.with_extension("").components().map(|c| c.as_os_str().to_string_lossy().into_owned()).collect();
    name.pop_if(|last| last == "mod" || last == "lib");
    name
}

/// The text without comments, without its tests, and without the rooms that visibilities name.
fn code_of(text: &str) -> String {
    let tests = text.find("#[cfg(test)]\nmod tests {").unwrap_or(text.len());
    let lines = text[..tests].lines().map(|line| line.split("//").next().unwrap_or_default());
    let mut code = lines.collect::<Vec<_>>().join("\n");
    while let Some(at) = code.find("pub(in ") {
        let end = at + code[at..].find(')').map_or(code.len() - at, |n| n + 1);
        code.replace_range(at..end, "pub");
    }
    code
}

/// Whether an attribute keeps what follows for this crate's own benches and tests.
pub(crate) fn is_internal(attribute: &str) -> bool {
    attribute.contains("feature = \"internals\"") && !attribute.contains("not(feature = \"internals\")")
}

/// How a `use` may begin.
const STARTS: &[&str] = &["use ", "pub use ", "pub(super) use ", "pub(crate) use "];

/// The `use` statements of a text, and the text without them.
fn taken_apart(code: &str) -> (Vec<Use>, String) {
    let (mut uses, mut rest) = (Vec::new(), String::new());
    let mut open: Option<(&str, String)> = None;
    let mut inside = false;
    for line in code.lines() {
        let trimmed = line.trim();
        if trimmed.starts_with("#[") {
            inside |= is_internal(trimmed);
        }
        let begun =
            STARTS.iter().find_map(|start| trimmed.strip_prefix(start).map(|tree| (*start, tree.to_owned())));
        match (&mut open, begun) {
            (Some((_, tree)), _) => tree.push_str(trimmed),
            (None, Some(found)) => open = Some(found),
            (None, None) => {
                rest.push_str(line);
                rest.push('\n');
            }
        }
        if open.as_ref().is_some_and(|(_, tree)| tree.ends_with(';')) {
            let (start, tree) = open.take().unwrap_or_default();
            let (public, for_all) = (start != "use ", start == "pub use " && !inside);
            spread(&[], tree.trim_end_matches(';'), &mut |path, name| {
                uses.push(Use { public, for_all, path, name })
            });
        }
        inside &= trimmed.starts_with("#[") || open.is_some();
    }
    (uses, rest)
}

/// Calls `each` for every path of a `use` tree.
fn spread(before: &[String], tree: &str, each: &mut impl FnMut(Vec<String>, String)) {
    let names = |text: &str| -> Vec<String> {
        text.split("::").map(str::trim).filter(|s| !s.is_empty()).map(str::to_owned).collect()
    };
    let Some(open) = tree.find('{') else {
        let (path, alias) = tree.split_once(" as ").unwrap_or((tree, ""));
        let mut path: Vec<String> = before.iter().cloned().chain(names(path)).collect();
        if path.len() > 1 {
            path.pop_if(|last| last == "self");
        }
        let name =
            if alias.is_empty() { path.last().cloned().unwrap_or_default() } else { alias.trim().to_owned() };
        return each(path, name);
    };
    let before: Vec<String> = before.iter().cloned().chain(names(&tree[..open])).collect();
    let inside = &tree[open + 1..tree.rfind('}').unwrap_or(tree.len())];
    let (mut depth, mut start) = (0, 0);
    for (at, c) in inside.char_indices().chain([(inside.len(), ',')]) {
        match c {
            '{' => depth += 1,
            '}' => depth -= 1,
            ',' if depth == 0 => {
                if !inside[start..at].trim().is_empty() {
                    spread(&before, inside[start..at].trim(), each);
                }
                start = at + 1;
            }
            _ => {}
        }
    }
}

/// The paths of two names and more in a text.
fn paths(code: &str) -> Vec<Vec<String>> {
    let word = |c: char| c.is_alphanumeric() || c == '_' || c == ':';
    let runs = code.split(|c: char| !word(c)).filter(|run| run.contains("::"));
    let split = runs.map(|run| run.split("::").map(str::to_owned).collect::<Vec<_>>());
    split.filter(|path| path.iter().all(|name| !name.is_empty() && !name.contains(':'))).collect()
}
