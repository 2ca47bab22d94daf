//! The house: a room imports only from rooms below it, and unsafe lives in few of them.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

#[path = "architecture/api.rs"]
mod api;
#[path = "architecture/graph.rs"]
mod graph;

use api::Api;
use graph::Graph;

/// Rooms from the ground up; rooms on one line do not see each other.
const HOUSE: &[&[&str]] = &[
    &["error", "setters"],
    &["units", "interpolation", "inputs", "threads"],
    &["draws", "spikes", "pixel", "npy"],
    &["sensor"],
    &["effects"],
    &["plan", "presets"],
    &["kernels", "storage", "scene"],
    &["formats", "light"],
    &["simulate"],
    &["measure", "reconstruct", "live"],
    &["report"],
    &["calibrate"],
    &["diagnose", "compare"],
    &["dataset"],
    &["cli"],
];

/// Files that may hold unsafe code, by their beginning.
const UNSAFE: &[&str] = &[
    "kernels/bits/avx2.rs",
    "kernels/bits/avx512.rs",
    "kernels/bits/counting.rs",
    "kernels/entry.rs",
    "kernels/isa/avx2.rs",
    "kernels/isa/avx512.rs",
    "kernels/isa/avx512_counts.rs",
    "kernels/isa/proven.rs",
    "kernels/isa/sse41.rs",
    "storage/",
];

/// The most files of a room, its face included.
const MOST_FILES: usize = 15;

/// Rooms that are larger, with the reason.
const LARGE: &[(&str, &str)] = &[("effects", "one file for each effect")];

/// Rooms whose files may use each other in a circle, with the reason.
const CIRCLES: &[(&str, &str)] = &[("plan", "a plan is made by its parts, each of which writes into it")];

fn floor(room: &str) -> Option<usize> {
    HOUSE.iter().position(|line| line.contains(&room))
}

fn sources() -> BTreeMap<PathBuf, String> {
    fn walk(folder: &Path, into: &mut BTreeMap<PathBuf, String>) {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                walk(&path, into);
            } else if path.extension().is_some_and(|e| e == "rs") {
                into.insert(path.clone(), fs::read_to_string(&path).unwrap());
            }
        }
    }
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut all = BTreeMap::new();
    walk(&root, &mut all);
    all.into_iter().map(|(path, text)| (path.strip_prefix(&root).unwrap().to_path_buf(), text)).collect()
}

/// The room a source file belongs to; none for `lib.rs` and `main.rs`.
fn room_of(path: &Path) -> Option<String> {
    let first = path.components().next()?.as_os_str().to_str()?;
    let room = first.trim_end_matches(".rs");
    (!matches!(room, "lib" | "main")).then(|| room.to_owned())
}

/// The rooms that a text names as `crate::room`, outside comments.
fn imports(text: &str) -> Vec<String> {
    let code = text.lines().filter(|line| !line.trim_start().starts_with("//"));
    let mut rooms = Vec::new();
    for line in code {
        for (at, _) in line.match_indices("crate::") {
            let rest = &line[at + "crate::".len()..];
            let names: Vec<&str> = match rest.strip_prefix('{') {
                Some(group) => group.split([',', '}']).map(str::trim).collect(),
                None => vec![rest],
            };
            for name in names {
                let end = name.find(|c: char| !(c.is_alphanumeric() || c == '_')).unwrap_or(name.len());
                rooms.push(name[..end].to_owned());
            }
        }
    }
    rooms.retain(|r| floor(r).is_some());
    rooms
}

fn upward(room: &str, text: &str) -> Vec<String> {
    let own = floor(room).unwrap_or_else(|| panic!("room {room} has no floor"));
    let wrong = |other: &String| other != room && floor(other).is_some_and(|f| f >= own);
    imports(text).into_iter().filter(wrong).collect()
}

#[test]
fn no_arrow_between_rooms_runs_upward() {
    for (path, text) in sources() {
        let Some(room) = room_of(&path) else { continue };
        let wrong = upward(&room, &text);
        assert!(wrong.is_empty(), "{} imports from {wrong:?}, which is not below {room}", path.display());
    }
}

#[test]
fn a_made_up_arrow_upward_is_seen() {
    assert_eq!(upward("plan", "use crate::kernels::Backend;"), ["kernels"]);
    assert_eq!(upward("plan", "use crate::presets;"), ["presets"]);
    assert_eq!(upward("light", "use crate::{error::Result, simulate::run};"), ["simulate"]);
    assert!(upward("plan", "use crate::draws::hash; // crate::draws").is_empty());
}

#[test]
fn only_the_module_threads_names_rayon() {
    // Elsewhere it would run in the global pool, whose threads a forked child lacks.
    for (path, text) in sources() {
        let code = text.lines().filter(|line| !line.trim_start().starts_with("//"));
        let names = code.filter(|line| line.contains("rayon")).count();
        assert!(names == 0 || path.starts_with("threads"), "{} names rayon", path.display());
    }
}

#[test]
fn no_files_use_each_other_in_a_circle() {
    let excused = |file: &PathBuf| CIRCLES.iter().any(|(room, _)| file.starts_with(room));
    let circles = Graph::new(&sources()).circles();
    let wrong: Vec<_> = circles.iter().filter(|circle| !circle.iter().all(excused)).collect();
    assert!(wrong.is_empty(), "these use each other: {wrong:#?}");
}

#[test]
fn a_made_up_circle_is_seen_through_a_face() {
    let source = |path: &str, text: &str| (PathBuf::from(path), text.to_owned());
    let open = [
        source("lib.rs", "pub mod a;\npub mod b;"),
        source("a/mod.rs", "mod inner;\npub use inner::Thing;"),
        source("a/inner.rs", "pub struct Thing; // crate::b::f"),
        source("b.rs", "use crate::a::{self, Thing as T};\npub fn f(_: T) -> a::Thing { a::Thing }"),
    ];
    let mut sources = BTreeMap::from(open);
    assert!(Graph::new(&sources).circles().is_empty());
    let inner = sources.get_mut(Path::new("a/inner.rs")).unwrap();
    inner.push_str("\nfn g() { crate::b::f(Thing) }");
    assert_eq!(Graph::new(&sources).circles(), [["a/inner.rs", "b.rs"].map(PathBuf::from)]);
}

/// The page that lists the public face.
const FACE: &str = "docs/reference/api.txt";

/// The most things that the face may have; methods, fields and impls are counted beside it.
const MOST_ITEMS: usize = 250;

fn face() -> (Api, String) {
    let sources = sources();
    let api = Api::of(&Graph::new(&sources), &sources);
    let mut text = format!(
        "# What a crate that depends on spikelane can name, all features on, `internals` off.\n\
         # Written by `cargo test --test architecture -- --ignored` from the sources.\n\
         # {} modules, types, traits, functions and constants; beside them {} methods, {} public fields, {} impls.\n\
         # {} structs with public fields and enums may grow (`#[non_exhaustive]`); those marked `closed` may not.\n\n",
        api.items.len(),
        api.methods,
        api.fields,
        api.impls,
        api.growing,
    );
    for item in &api.items {
        let closed = api.closed.iter().any(|path| item.ends_with(&format!(" {path}")));
        text += &format!("{item}{}\n", if closed { "  closed" } else { "" });
    }
    (api, text)
}

#[test]
fn the_public_face_is_the_listed_one_and_short() {
    let (api, text) = face();
    assert!(api.items.len() < MOST_ITEMS, "{} public things", api.items.len());
    let listed = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(FACE)).unwrap();
    assert!(listed == text, "{FACE} is another; run: cargo test --test architecture -- --ignored");
}

#[test]
#[ignore = "writes the page"]
fn write_the_list_of_the_public_face() {
    fs::write(Path::new(env!("CARGO_MANIFEST_DIR")).join(FACE), face().1).unwrap();
}

#[test]
fn the_face_is_followed_through_re_exports_and_leaves_out_what_is_internal() {
    let source = |path: &str, text: &str| (PathBuf::from(path), text.to_owned());
    let sources = BTreeMap::from([
        source("lib.rs", "pub mod a;\n#[cfg(feature = \"internals\")]\npub mod b;\nmod c;\npub use c::f;"),
        source(
            "a/mod.rs",
            "mod inner;\npub use inner::Thing;\n#[cfg(feature = \"internals\")]\npub use inner::Own;",
        ),
        source("a/inner.rs", "pub struct Thing {\n    pub x: u8,\n}\npub struct Own;"),
        source("b.rs", "pub fn hidden() {}"),
        source("c.rs", "pub const fn f() {}\npub fn unseen() {}"),
    ]);
    let api = Api::of(&Graph::new(&sources), &sources);
    assert_eq!(api.items, ["mod    spikelane::a", "struct spikelane::a::Thing", "fn     spikelane::f"]);
    assert_eq!((api.fields, api.closed), (1, vec!["spikelane::a::Thing".to_owned()]));
}

#[test]
fn rooms_have_few_files() {
    let mut rooms: BTreeMap<PathBuf, usize> = BTreeMap::new();
    for (path, _) in sources() {
        *rooms.entry(path.parent().unwrap().to_path_buf()).or_default() += 1;
    }
    rooms.retain(|room, files| {
        *files > MOST_FILES && !LARGE.iter().any(|(large, _)| room == Path::new(large))
    });
    assert!(rooms.is_empty(), "more than {MOST_FILES} files: {rooms:?}");
}

#[test]
fn unsafe_code_stays_in_its_rooms() {
    for (path, text) in sources() {
        let allowed = UNSAFE.iter().any(|start| path.to_str().unwrap().starts_with(start));
        let code = text.lines().filter(|line| !line.trim_start().starts_with("//"));
        let found = code.filter(|line| line.contains("unsafe {") || line.contains("unsafe fn")).count();
        assert!(allowed || found == 0, "{} holds unsafe code", path.display());
    }
}

/// Rooms of the kernels from the ground up: what runs plans and what counts bits share instruction sets and nothing else.
const KERNELS: &[&[&str]] = &[&["isa"], &["bits", "body", "reference"], &["entry"]];

#[test]
fn what_runs_plans_and_what_counts_bits_are_apart() {
    let floor = |room: &str| KERNELS.iter().position(|line| line.contains(&room));
    for (path, text) in sources() {
        let Ok(inside) = path.strip_prefix("kernels") else { continue };
        let own = room_of(inside).unwrap();
        let Some(own_floor) = floor(&own) else { continue };
        let code: Vec<&str> = text.lines().filter(|line| !line.trim_start().starts_with("//")).collect();
        for room in KERNELS.iter().copied().flatten().filter(|room| **room != own) {
            let uses =
                [format!("kernels::{room}::"), format!("kernels::{room}:"), format!("kernels::{{{room}")];
            let found = code.iter().any(|line| uses.iter().any(|name| line.contains(name)));
            assert!(!found || floor(room) < Some(own_floor), "{} imports from {room}", path.display());
        }
    }
}

#[test]
fn rooms_of_kernels_and_plans_hold_fifteen_files_at_most() {
    let mut rooms: BTreeMap<PathBuf, usize> = BTreeMap::new();
    for path in sources().into_keys() {
        *rooms.entry(path.parent().unwrap().to_path_buf()).or_default() += 1;
    }
    for (room, files) in rooms {
        let counted = ["kernels", "plan", "pixel"].iter().any(|name| room.starts_with(name));
        assert!(!counted || files <= 15, "{} holds {files} files", room.display());
    }
}

#[test]
fn files_stay_short_enough_to_read() {
    for (path, text) in sources() {
        let lines = text.lines().count();
        assert!(lines <= 500, "{} has {lines} lines", path.display());
    }
}

#[test]
fn every_effect_has_a_file_of_its_name() {
    let files = sources();
    for effect in spikelane::effects::ALL {
        let path = PathBuf::from(format!("effects/{}.rs", effect.name));
        assert!(files.contains_key(&path), "{} is missing", path.display());
    }
}

#[test]
fn the_pages_for_newcomers_name_files_that_exist() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    for page in ["CONTRIBUTING.md", "docs/structure.md"] {
        let text = fs::read_to_string(root.join(page)).unwrap();
        let spans = text.split('`').skip(1).step_by(2);
        let roots = ["src/", "tests/", "docs/", "study/", "bindings/", ".ci/"];
        let named: Vec<&str> =
            spans.filter(|s| roots.iter().any(|r| s.starts_with(r)) && !s.contains("NAME")).collect();
        assert!(named.len() > 10, "{page} names {} files", named.len());
        let missing: Vec<_> = named.into_iter().filter(|s| !root.join(s).exists()).collect();
        assert!(missing.is_empty(), "{page} names what is not there: {missing:?}");
    }
}

#[test]
fn the_page_of_the_structure_shows_every_room_on_its_floor() {
    let page = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/structure.md")).unwrap();
    for (floor, rooms) in HOUSE.iter().enumerate() {
        let names: Vec<String> = rooms.iter().map(|room| format!("`{room}`")).collect();
        let row =
            page.lines().find(|line| line.starts_with(&format!("| {} |", floor + 1))).unwrap_or_default();
        let shown = row.split('|').nth(2).unwrap_or_default();
        assert!(
            names.iter().all(|name| shown.contains(name)),
            "floor {}: {names:?}, the page has {row}",
            floor + 1
        );
    }
}
