//! Runs the blocks of a page, one after the other, in a folder of their own.

use std::path::Path;
use std::process::Command;

use tempfile::TempDir;

use super::{Block, Page, check};

/// Runs what can run, looks at the rest, and says what was left out and why. `prepare` puts into the folder what a reader of
/// the page has.
///
/// Panics with the block and its output where one fails.
pub(crate) fn page(page: &Page, variables: &[(&str, &str)], prepare: fn(&str, &Path)) {
    let place = TempDir::new().unwrap();
    prepare(&page.name, place.path());
    let bin = TempDir::new().unwrap();
    std::os::unix::fs::symlink(env!("CARGO_BIN_EXE_spikelane"), bin.path().join("spikelane")).unwrap();
    let run = Runner { page, place: place.path(), bin: bin.path(), variables };
    for block in page.blocks() {
        match block.language() {
            "sh" => run.commands(&block),
            "python" => run.python(&block),
            "toml" => drop(toml_of(page, &block)),
            _ => {}
        }
    }
}

/// A block of TOML has to be TOML.
fn toml_of(page: &Page, block: &Block) -> toml::Table {
    block.text.parse().unwrap_or_else(|e| panic!("{}:{}: {e}", page.name, block.line))
}

struct Runner<'a> {
    page: &'a Page,
    place: &'a Path,
    bin: &'a Path,
    variables: &'a [(&'a str, &'a str)],
}

impl Runner<'_> {
    fn commands(&self, block: &Block) {
        let wrong = check::wrong(&block.text);
        assert!(wrong.is_empty(), "{}:{}: {wrong:#?}", self.page.name, block.line);
        if block.is("study") {
            self.skip(block, "a study, which takes long");
        } else if block.is("build") {
            self.first_run(block);
        } else if let Some(missing) = block.needs().iter().find(|what| !self.here(what)) {
            self.skip(block, &format!("it needs {missing}, which is not here"));
        } else {
            let mut shell = Command::new("bash");
            shell.args(["-euo", "pipefail", "-c", &block.text]);
            self.run(block, shell);
        }
    }

    /// What compiles or installs is not done inside of a test; `cargo run` is the program that is there.
    fn first_run(&self, block: &Block) {
        for line in block.text.lines().filter(|line| line.starts_with("cargo run --release")) {
            let rest = line.split('#').next().unwrap().trim_start_matches("cargo run --release").trim();
            let mut shell = Command::new("bash");
            shell.args(["-euo", "pipefail", "-c", &format!("spikelane {}", rest.trim_start_matches("--"))]);
            self.run(block, shell);
        }
        self.skip(block, "the rest of it builds or installs");
    }

    fn python(&self, block: &Block) {
        if !self.here("python:numpy") {
            return self.skip(block, "it needs numpy, which is not here");
        }
        if let Some(missing) = block.needs().iter().find(|what| !self.here(what)) {
            return self.skip(block, &format!("it needs {missing}, which is not here"));
        }
        let mut python = Command::new("python3");
        python.args(["-c", &block.text]);
        self.run(block, python);
    }

    fn here(&self, what: &str) -> bool {
        match (what.strip_prefix("python:"), what.strip_prefix("./")) {
            (Some(module), _) => {
                let said = Command::new("python3").args(["-c", &format!("import {module}")]).output();
                said.is_ok_and(|out| out.status.success())
            }
            (_, Some(file)) => self.place.join(file).exists(),
            // The client without a controller is no cluster.
            _ if what == "sbatch" => Command::new("sinfo").output().is_ok_and(|out| out.status.success()),
            _ => check::found(what),
        }
    }

    fn run(&self, block: &Block, mut command: Command) {
        let path = std::env::var("PATH").unwrap_or_default();
        command.env("PATH", format!("{}:{path}", self.bin.display()));
        command.current_dir(self.place).envs(self.variables.iter().copied()).env_remove("SPIKELANE_BACKEND");
        let out = command.output().unwrap_or_else(|e| panic!("{:?}: {e}", command.get_program()));
        assert!(
            out.status.success(),
            "{}:{}: {}\n{}\n{}{}",
            self.page.name,
            block.line,
            out.status,
            block.text,
            String::from_utf8_lossy(&out.stdout),
            String::from_utf8_lossy(&out.stderr)
        );
    }

    fn skip(&self, block: &Block, why: &str) {
        let first = block.text.lines().next().unwrap_or("");
        println!("skipped: {}:{}: {why}: {first}", self.page.name, block.line);
    }
}
