//! Runs the blocks of a page in order in a new folder.

use std::path::Path;
use std::process::Command;

use tempfile::TempDir;

use super::{Block, Page, check};

/// Runs the blocks of a page. Blocks that cannot run on this machine are only checked. Prints which blocks are skipped and
/// why.
///
/// `prepare` creates the files that readers of the page have.
///
/// # Panics
/// If a block fails. The message contains the block and its output.
pub(crate) fn run_page(page: &Page, variables: &[(&str, &str)], prepare: fn(&str, &Path)) {
    let place = TempDir::new().unwrap();
    prepare(&page.name, place.path());
    let bin = TempDir::new().unwrap();
    std::os::unix::fs::symlink(env!("CARGO_BIN_EXE_spikelane"), bin.path().join("spikelane")).unwrap();
    let run = Runner { page, place: place.path(), bin: bin.path(), variables };
    for block in page.blocks() {
        match block.language() {
            "sh" => run.run_commands(&block),
            "python" => run.run_python(&block),
            "toml" => drop(parse_toml(page, &block)),
            _ => {}
        }
    }
}

/// Parses a TOML block.
fn parse_toml(page: &Page, block: &Block) -> toml::Table {
    block.text.parse().unwrap_or_else(|e| panic!("{}:{}: {e}", page.name, block.line))
}

struct Runner<'a> {
    page: &'a Page,
    place: &'a Path,
    bin: &'a Path,
    variables: &'a [(&'a str, &'a str)],
}

impl Runner<'_> {
    fn run_commands(&self, block: &Block) {
        let wrong = check::command_errors(&block.text);
        assert!(wrong.is_empty(), "{}:{}: {wrong:#?}", self.page.name, block.line);
        if block.has_word("study") {
            self.skip(block, "a study, which takes long");
        } else if block.has_word("build") {
            self.first_run(block);
        } else if let Some(missing) = block.requirements().iter().find(|what| !self.is_available(what)) {
            self.skip(block, &format!("it needs {missing}, which is not here"));
        } else {
            let mut shell = Command::new("bash");
            shell.args(["-euo", "pipefail", "-c", &block.text]);
            self.run(block, shell);
        }
    }

    /// Runs the `cargo run` lines of a block with the program that is already built. The other lines build or
    /// install, and are skipped.
    fn first_run(&self, block: &Block) {
        for line in block.text.lines().filter(|line| line.starts_with("cargo run --release")) {
            let rest = line.split('#').next().unwrap().trim_start_matches("cargo run --release").trim();
            let mut shell = Command::new("bash");
            shell.args(["-euo", "pipefail", "-c", &format!("spikelane {}", rest.trim_start_matches("--"))]);
            self.run(block, shell);
        }
        self.skip(block, "the rest of it builds or installs");
    }

    fn run_python(&self, block: &Block) {
        if !self.is_available("python:numpy") {
            return self.skip(block, "it needs numpy, which is not here");
        }
        if let Some(missing) = block.requirements().iter().find(|what| !self.is_available(what)) {
            return self.skip(block, &format!("it needs {missing}, which is not here"));
        }
        let mut python = Command::new("python3");
        python.args(["-c", &block.text]);
        self.run(block, python);
    }

    fn is_available(&self, what: &str) -> bool {
        match (what.strip_prefix("python:"), what.strip_prefix("./")) {
            (Some(module), _) => {
                let output = Command::new("python3").args(["-c", &format!("import {module}")]).output();
                output.is_ok_and(|out| out.status.success())
            }
            (_, Some(file)) => self.place.join(file).exists(),
            // The Slurm client can be installed without a controller, so `sinfo` must succeed too.
            _ if what == "sbatch" => Command::new("sinfo").output().is_ok_and(|out| out.status.success()),
            _ => check::is_installed(what),
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
