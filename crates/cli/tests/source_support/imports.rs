//! Finds import circles: groups of files of a package in which every file imports from every other one, directly or
//! through others.

use std::collections::{BTreeMap, BTreeSet};

use super::{Package, SourceFile, indentation, without_visibility};

/// Path of a module. The first part is the file of the root of its crate.
type ModulePath = Vec<String>;

/// A name that a `use` declaration brings into a module.
struct Import {
    /// Full path as written, for example `crate`, `light`, `Frame`.
    path: Vec<String>,
    /// Name in the importing module; `*` if all names are imported.
    name: String,
    is_public: bool,
}

struct Module<'a> {
    file: &'a SourceFile,
    imports: Vec<Import>,
    /// Code without comments, tests and `use` declarations.
    code: String,
}

#[derive(Default)]
struct Crate<'a> {
    modules: BTreeMap<ModulePath, Module<'a>>,
    /// Modules whose files are outside the package.
    outside: BTreeSet<ModulePath>,
}

/// Returns the import circles of a package. Each circle is the sorted list of its files.
pub(crate) fn import_circles(package: &Package) -> Vec<Vec<String>> {
    let is_root = |file: &&SourceFile| matches!(file.name.rsplit('/').next(), Some("lib.rs" | "main.rs"));
    let mut circles = BTreeSet::new();
    for root in package.files.iter().filter(is_root) {
        circles.extend(strongly_connected(&Crate::read(package, root).imports_of_files()));
    }
    circles.into_iter().collect()
}

impl<'a> Crate<'a> {
    fn read(package: &'a Package, root: &'a SourceFile) -> Self {
        let mut read = Self::default();
        add_module(&mut read, package, root, vec![root.name.clone()], &folder_of(&root.name));
        read
    }

    /// Returns the files from which each file imports.
    ///
    /// An import of a re-exported name leads to the file that declares the name. A re-export itself is an import only if
    /// its file also uses the name. The `mod.rs` or `lib.rs` of an enclosing folder is part of every file in the folder, so
    /// imports from it do not count.
    fn imports_of_files(&self) -> BTreeMap<String, BTreeSet<String>> {
        let mut edges: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
        for (path, module) in &self.modules {
            let imports = module.imports.iter().filter(|i| !i.is_public || has_word(&module.code, &i.name));
            let written = inline_paths(&module.code);
            let paths = imports.map(|i| i.path.clone()).chain(written);
            let files = paths.filter_map(|p| self.resolve(path, &p, 0)).map(|p| &self.modules[&p].file.name);
            let is_other =
                |name: &&String| **name != module.file.name && !is_enclosing(name, &module.file.name);
            let files = files.filter(is_other).cloned();
            edges.entry(module.file.name.clone()).or_default().extend(files);
        }
        edges
    }

    /// Returns the module that declares the item `path`, which is written in the module `from`. Returns `None` for paths
    /// into other crates.
    fn resolve(&self, from: &ModulePath, path: &[String], depth: usize) -> Option<ModulePath> {
        /// Re-exports of re-exports are resolved up to this depth.
        const MAX_DEPTH: usize = 8;
        let (first, mut rest) = path.split_first()?;
        let mut at = match first.as_str() {
            "crate" => from[..1].to_vec(),
            "self" => from.clone(),
            "super" => from[..from.len().max(2) - 1].to_vec(),
            _ => {
                rest = path;
                from.clone()
            }
        };
        let is_relative = rest.len() == path.len();
        let start = at.clone();
        while let Some((next, tail)) = rest.split_first() {
            if next == "super" {
                at.pop();
            } else {
                at.push(next.clone());
                if self.outside.contains(&at) {
                    return None;
                }
                if !self.modules.contains_key(&at) {
                    at.pop();
                    break;
                }
            }
            rest = tail;
        }
        if is_relative && at == start {
            return None;
        }
        let Some(item) = rest.first().filter(|_| depth < MAX_DEPTH) else { return Some(at) };
        let module = &self.modules[&at];
        if declares(&module.code, item) {
            return Some(at);
        }
        let named = module.imports.iter().find(|i| &i.name == item);
        if let Some(import) = named {
            return self.resolve(&at, &import.path, depth + 1);
        }
        let mut globs = module.imports.iter().filter(|i| i.name == "*");
        let found = globs.find_map(|glob| {
            let mut path = glob.path.clone();
            path.push(item.clone());
            self.resolve(&at, &path, depth + 1).filter(|p| declares(&self.modules[p].code, item))
        });
        Some(found.unwrap_or(at))
    }
}

/// Returns whether `name` is the `mod.rs` or `lib.rs` of a folder that contains `file`.
fn is_enclosing(name: &str, file: &str) -> bool {
    let folder = name.strip_suffix("mod.rs").or_else(|| name.strip_suffix("lib.rs"));
    folder.is_some_and(|folder| file.starts_with(folder))
}

/// Adds the module of `file` and the modules that it declares. The files of child modules are in `folder`.
fn add_module<'a>(
    read: &mut Crate<'a>,
    package: &'a Package,
    file: &'a SourceFile,
    path: ModulePath,
    folder: &str,
) {
    let (tests, uses) = (file.test_blocks(), file.use_blocks());
    let is_code = |i: &usize| !tests.iter().chain(&uses).any(|block| block.contains(i));
    let mut code = String::new();
    let mut inline = InlineModules::new(path);
    let mut imports: BTreeMap<ModulePath, Vec<Import>> = BTreeMap::new();
    for (i, line) in file.lines.iter().enumerate() {
        if is_code(&i) {
            let line = without_comment(line);
            inline.enter_or_leave(line);
            if let Some(child) = declared_module(line) {
                let below = format!("{folder}{}", inline.folder());
                let child_path = inline.path().into_iter().chain([child.to_owned()]).collect();
                let attributes = file.lines[..i].iter().rev().map(|line| line.trim());
                let mut attributes = attributes.take_while(|line| line.starts_with("#["));
                let stated =
                    attributes.find_map(|line| line.strip_prefix("#[path = \"")?.strip_suffix("\"]"));
                let (names, child_folder) = match stated {
                    Some(stated) => {
                        let name = normalized(&format!("{}{stated}", folder_of(&file.name)));
                        (vec![name.clone()], folder_of(&name))
                    }
                    None => {
                        let name = format!("{below}{child}");
                        (vec![format!("{name}.rs"), format!("{name}/mod.rs")], format!("{name}/"))
                    }
                };
                if let Some(child_file) = package.files.iter().find(|f| names.contains(&f.name)) {
                    add_module(read, package, child_file, child_path, &child_folder);
                } else {
                    read.outside.insert(child_path);
                }
            }
            code += line;
            code.push('\n');
        } else if let Some(block) = uses.iter().find(|block| block.start == i) {
            let parsed = parse_use(&file.lines[block.clone()].concat());
            imports.entry(inline.path()).or_default().extend(parsed);
        }
        imports.entry(inline.path()).or_default();
    }
    for (at, imports) in imports {
        // The code of an inline module is part of the code of its file.
        let code = if at == inline.root { code.clone() } else { String::new() };
        read.modules.insert(at, Module { file, imports, code });
    }
}

/// Returns the folder of a file, with a slash at its end.
fn folder_of(name: &str) -> String {
    name.rsplit_once('/').map_or(String::new(), |(folder, _)| format!("{folder}/"))
}

/// Removes `folder/..` from a path.
fn normalized(path: &str) -> String {
    let mut parts: Vec<&str> = Vec::new();
    for part in path.split('/') {
        if part == ".." && parts.last().is_some_and(|last| *last != "..") {
            parts.pop();
        } else {
            parts.push(part);
        }
    }
    parts.join("/")
}

/// The inline modules that contain a line, such as `mod name { mod child; }`.
struct InlineModules {
    /// Path of the file.
    root: ModulePath,
    /// Name and indentation of each open module.
    open: Vec<(String, usize)>,
}

impl InlineModules {
    fn new(root: ModulePath) -> Self {
        Self { root, open: Vec::new() }
    }

    fn enter_or_leave(&mut self, line: &str) {
        let name =
            without_visibility(line.trim()).strip_prefix("mod ").and_then(|rest| rest.strip_suffix(" {"));
        if let Some(name) = name {
            self.open.push((name.to_owned(), indentation(line)));
        } else if line.trim() == "}" && self.open.last().is_some_and(|(_, open)| *open == indentation(line)) {
            self.open.pop();
        }
    }

    fn path(&self) -> ModulePath {
        self.root.iter().chain(self.open.iter().map(|(name, _)| name)).cloned().collect()
    }

    /// Folder of the files of child modules, below the folder of the file.
    fn folder(&self) -> String {
        self.open.iter().map(|(name, _)| format!("{name}/")).collect()
    }
}

/// Returns the name in a declaration such as `pub mod name;`.
fn declared_module(line: &str) -> Option<&str> {
    without_visibility(line.trim()).strip_prefix("mod ")?.strip_suffix(';')
}

fn without_comment(line: &str) -> &str {
    if line.trim_start().starts_with("//") { "" } else { line }
}

/// Returns the imports of one `use` declaration.
fn parse_use(declaration: &str) -> Vec<Import> {
    let item = declaration.trim_start();
    let bare = without_visibility(item);
    let tree: String = bare
        .trim_start_matches("use ")
        .trim_end_matches(';')
        .split_whitespace()
        .collect::<Vec<_>>()
        .join(" ");
    let mut imports = Vec::new();
    expand(&tree, &[], bare.len() < item.len(), &mut imports);
    imports
}

/// Adds the imports of a tree such as `a::{b, c::{self, D as E}}`.
fn expand(tree: &str, prefix: &[String], is_public: bool, imports: &mut Vec<Import>) {
    let tree = tree.trim();
    let (head, group) = match tree.split_once('{') {
        Some((head, group)) => (head, group.rsplit_once('}').map(|(group, _)| group)),
        None => (tree, None),
    };
    let (head, alias) = head.split_once(" as ").map_or((head, None), |(head, alias)| (head, Some(alias)));
    let mut path = prefix.to_vec();
    path.extend(head.split("::").map(str::trim).filter(|part| !part.is_empty()).map(str::to_owned));
    if let Some(group) = group {
        split_at_commas(group).iter().for_each(|branch| expand(branch, &path, is_public, imports));
        return;
    }
    if path.len() > 1 && path.last().is_some_and(|last| last == "self") {
        path.pop();
    }
    let Some(last) = path.last().cloned() else { return };
    if last == "*" {
        path.pop();
    }
    imports.push(Import { path, name: alias.map_or(last, str::to_owned), is_public });
}

/// Splits the branches of a group at the commas outside of inner groups.
fn split_at_commas(group: &str) -> Vec<&str> {
    let mut branches = Vec::new();
    let (mut depth, mut start) = (0, 0);
    for (i, c) in group.char_indices() {
        match c {
            '{' => depth += 1,
            '}' => depth -= 1,
            ',' if depth == 0 => {
                branches.push(&group[start..i]);
                start = i + 1;
            }
            _ => {}
        }
    }
    branches.push(&group[start..]);
    branches.retain(|branch| !branch.trim().is_empty());
    branches
}

/// Returns the paths in code that begin with `crate` or `super`.
fn inline_paths(code: &str) -> Vec<Vec<String>> {
    let words = code.split(|c: char| !(c.is_alphanumeric() || c == '_' || c == ':' || c == '$'));
    let paths = words.filter(|word| word.starts_with("crate::") || word.starts_with("super::"));
    paths.map(|path| path.split("::").filter(|part| !part.is_empty()).map(str::to_owned).collect()).collect()
}

/// Returns whether a module declares an item of this name.
fn declares(code: &str, name: &str) -> bool {
    const KEYWORDS: &[&str] =
        &["fn", "struct", "enum", "trait", "const", "static", "type", "union", "mod", "macro_rules!"];
    let is_end = |rest: &str| !rest.starts_with(|c: char| c.is_alphanumeric() || c == '_');
    KEYWORDS.iter().any(|keyword| {
        let item = format!("{keyword} {name}");
        code.match_indices(&item).any(|(at, _)| is_end(&code[at + item.len()..]))
    })
}

fn has_word(code: &str, word: &str) -> bool {
    code.split(|c: char| !(c.is_alphanumeric() || c == '_')).any(|w| w == word)
}

/// Returns the strongly connected groups of at least two nodes, each sorted.
fn strongly_connected(edges: &BTreeMap<String, BTreeSet<String>>) -> BTreeSet<Vec<String>> {
    let reach: BTreeMap<&String, BTreeSet<&String>> =
        edges.keys().map(|node| (node, reachable(edges, node))).collect();
    let circle = |node: &String| {
        reach[node]
            .iter()
            .filter(|other| reach[**other].contains(node))
            .map(|other| (*other).clone())
            .collect()
    };
    edges.keys().map(circle).filter(|circle: &Vec<String>| circle.len() > 1).collect()
}

/// Returns the nodes that can be reached from a node in one step or more.
fn reachable<'a>(edges: &'a BTreeMap<String, BTreeSet<String>>, from: &String) -> BTreeSet<&'a String> {
    let mut found = BTreeSet::new();
    let mut next: Vec<&String> = edges[from].iter().collect();
    while let Some(node) = next.pop() {
        if found.insert(node) {
            next.extend(edges.get(node).into_iter().flatten());
        }
    }
    found
}
