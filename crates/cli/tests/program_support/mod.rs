//! Runs the program and reads its outputs.
#![allow(dead_code, reason = "each test file uses a part of it")]

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use serde_json::Value;
use tempfile::TempDir;

/// A folder in which the program runs.
pub(crate) struct TestFolder(TempDir);

impl TestFolder {
    pub(crate) fn new() -> Self {
        Self(TempDir::new().unwrap())
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub(crate) fn command(&self, line: &str) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_spikelane"));
        command.args(line.split_whitespace()).current_dir(self.0.path()).stdin(Stdio::null());
        command.env_remove("SPIKELANE_BACKEND");
        command
    }

    pub(crate) fn run(&self, line: &str) -> CommandResult {
        CommandResult::from_output(line, self.command(line).output().unwrap())
    }

    /// Runs a command that must succeed.
    pub(crate) fn run_ok(&self, line: &str) -> CommandResult {
        let ran = self.run(line);
        assert_eq!(ran.code, 0, "{line}: {}", ran.stderr);
        ran
    }

    /// Runs a command that must fail with `code`, print each of `words`, and leave the folder unchanged.
    pub(crate) fn run_refused(&self, line: &str, code: i32, words: &[&str]) {
        let before = self.file_names();
        let ran = self.run(line);
        assert_eq!(ran.code, code, "{line}: {}", ran.stderr);
        for word in words {
            assert!(ran.stderr.contains(word), "{line}: no '{word}' in: {}", ran.stderr);
        }
        assert_eq!(self.file_names(), before, "{line} left something behind");
    }

    /// Returns the names of the entries in the folder, including hidden entries.
    pub(crate) fn file_names(&self) -> Vec<String> {
        let entries = std::fs::read_dir(self.0.path()).unwrap();
        let mut names: Vec<_> =
            entries.map(|e| e.unwrap().file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }

    pub(crate) fn read(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.path(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
    }

    pub(crate) fn write(&self, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
        std::fs::write(self.path(name), bytes).unwrap();
        self.path(name)
    }

    pub(crate) fn json(&self, name: &str) -> Value {
        serde_json::from_slice(&self.read(name)).unwrap()
    }

    /// Writes a gray PNG with `level` in every pixel.
    pub(crate) fn picture(&self, name: &str, width: u32, height: u32, level: u8) -> PathBuf {
        let image = image::GrayImage::from_pixel(width, height, image::Luma([level]));
        let path = self.path(name);
        image.save(&path).unwrap();
        path
    }
}

pub(crate) struct CommandResult {
    pub code: i32,
    pub stdout: String,
    pub stderr: String,
}

impl CommandResult {
    pub(crate) fn from_output(line: &str, output: Output) -> Self {
        let text = |bytes| String::from_utf8(bytes).unwrap();
        let code = output.status.code().unwrap_or_else(|| panic!("{line}: ended by a signal"));
        let ran = Self { code, stdout: text(output.stdout), stderr: text(output.stderr) };
        assert!(!ran.stderr.contains("panicked"), "{line}: {}", ran.stderr);
        ran
    }

    /// Parses each line of standard output as one JSON value.
    pub(crate) fn events(&self) -> Vec<Value> {
        self.stdout.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
    }
}

/// Returns the bytes of a NumPy file of f32 with the shape (frames, height, width).
pub(crate) fn npy_f32(shape: [usize; 3], values: &[f32]) -> Vec<u8> {
    let [t, h, w] = shape;
    let mut text = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({t}, {h}, {w}), }}");
    text.push_str(&" ".repeat(128 - 11 - text.len()));
    text.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((text.len() as u16).to_le_bytes());
    bytes.extend(text.as_bytes());
    bytes.extend(values.iter().flat_map(|v| v.to_le_bytes()));
    bytes
}

/// Returns a mono y4m video in which every pixel of frame `i` is `levels[i]`.
pub(crate) fn y4m(width: usize, height: usize, levels: &[u8]) -> Vec<u8> {
    let mut bytes = format!("YUV4MPEG2 W{width} H{height} F25:1 Ip A1:1 Cmono\n").into_bytes();
    for &level in levels {
        bytes.extend(b"FRAME\n");
        bytes.extend(std::iter::repeat_n(level, width * height));
    }
    bytes
}

pub(crate) fn exists(path: &Path) -> bool {
    path.symlink_metadata().is_ok()
}
