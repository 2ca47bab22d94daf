//! The committed header and the list of symbols must match the sources.
//!
//! `WRITE=1 cargo test -p spikelane-c --test header` regenerates both.

use std::path::PathBuf;

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

fn generated() -> String {
    let config = cbindgen::Config::from_file(root().join("cbindgen.toml")).unwrap();
    let builder = cbindgen::Builder::new().with_config(config);
    let builder = builder.with_src(root().join("src/lib.rs"));
    let mut bytes = Vec::new();
    builder.generate().unwrap().write(&mut bytes);
    String::from_utf8(bytes).unwrap()
}

/// Returns the sorted names of the functions of a header.
fn functions(header: &str) -> Vec<&str> {
    let mut names: Vec<&str> = header
        .lines()
        .filter(|line| !line.starts_with([' ', '/', '*', '#', '}']) && line.contains('('))
        .filter_map(|line| line.split('(').next()?.rsplit([' ', '*']).next())
        .filter(|name| name.starts_with("spl_"))
        .collect();
    names.sort_unstable();
    names
}

fn compare(path: &str, actual: &str) {
    let path = root().join(path);
    if std::env::var_os("WRITE").is_some() {
        std::fs::write(&path, actual).unwrap();
    }
    let committed = std::fs::read_to_string(&path).unwrap();
    assert!(
        committed == actual,
        "{} is not what the sources say; WRITE=1 cargo test -p spikelane-c --test header writes it anew",
        path.display()
    );
}

#[test]
fn committed_header_equals_cbindgen_output() {
    compare("include/spikelane.h", &generated());
}

#[test]
fn the_committed_symbols_are_the_functions_of_the_header() {
    let header = generated();
    let names = functions(&header);
    assert!(names.len() > 30, "{names:?}");
    compare("symbols.txt", &format!("{}\n", names.join("\n")));
}

#[test]
fn the_name_of_the_library_has_the_version_of_the_abi() {
    let script = std::fs::read_to_string(root().join("build.rs")).unwrap();
    let header = generated();
    let version = header.lines().find_map(|line| line.strip_prefix("#define SPL_ABI_VERSION ")).unwrap();
    assert!(script.contains(&format!("let abi = {version};")), "build.rs has another than {version}");
}
