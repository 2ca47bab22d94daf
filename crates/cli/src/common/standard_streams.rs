//! The rule for the path `-`: standard input or standard output where a stream makes sense, otherwise an error.

use std::io::{ErrorKind, Read as _, Write as _};
use std::path::{Path, PathBuf};

use clap::builder::{PathBufValueParser, TypedValueParser as _};
use clap::{Arg, Command};
use spikelane::unstable::Count;
use spikelane::{Error, Result};
use spikelane_io::Stdin;

use super::progress::stop_flag;

/// The path that means standard input or standard output.
const DASH: &str = "-";

/// Arguments for which `-` is standard input or standard output, as command and argument. All other paths refuse `-`.
const STREAM_ARGUMENTS: [(&str, &str); 8] = [
    ("simulate", "input"),
    ("live", "input"),
    ("inspect", "file"),
    ("measure", "file"),
    ("convert", "input"),
    ("convert", "output"),
    ("reconstruct", "file"),
    ("reconstruct", "output"),
];

/// Largest stream in bytes that is read from standard input. The stream is kept in memory, because its layout can be
/// determined only from all of its bytes.
const MAX_STDIN_BYTES: usize = 4 << 30;

/// Returns whether `path` means standard input or standard output.
pub(crate) fn is_dash(path: &Path) -> bool {
    path.as_os_str() == DASH
}

/// Makes all path arguments of `command` and its subcommands refuse `-`, except [`STREAM_ARGUMENTS`].
pub(crate) fn refuse_dash(command: Command) -> Command {
    let name = command.get_name().to_owned();
    let is_path =
        |arg: &Arg| arg.get_value_parser().type_id() == clap::builder::ValueParser::path_buf().type_id();
    let refused = move |arg: Arg| {
        let is_stream = STREAM_ARGUMENTS.contains(&(&*name, arg.get_id().as_str()));
        if is_path(&arg) && !is_stream {
            arg.value_parser(PathBufValueParser::new().try_map(check))
        } else {
            arg
        }
    };
    command.mut_args(refused).mut_subcommands(refuse_dash)
}

fn check(path: PathBuf) -> std::result::Result<PathBuf, &'static str> {
    if !is_dash(&path) {
        return Ok(path);
    }
    Err(
        "expected a path; for a file of this name, type ./-; only convert, reconstruct, inspect and measure use standard input and output for streams, and live writes to a pipe",
    )
}

/// Reads a stream from standard input.
pub(crate) fn read_stdin() -> Result<Vec<u8>> {
    const SUBJECT: &str = "standard input";
    let io = |e| Error::io(SUBJECT, e);
    let mut stdin = Stdin::new(stop_flag()?).map_err(io)?;
    let (mut bytes, mut chunk) = (Vec::new(), vec![0; 1 << 20]);
    loop {
        let count = match stdin.read(&mut chunk) {
            Ok(0) => return Ok(bytes),
            Ok(count) => count,
            Err(e) if e.kind() == ErrorKind::Interrupted => continue,
            Err(e) => return Err(io(e)),
        };
        if bytes.len() + count > MAX_STDIN_BYTES {
            return Err(Error::new(spikelane::ErrorKind::Input, SUBJECT)
                .found(format_args!("more than {MAX_STDIN_BYTES} bytes"))
                .expected("a stream that fits in memory")
                .remedy("write the stream to a file, and read the file"));
        }
        bytes.try_reserve(count).map_err(|_| {
            Error::new(spikelane::ErrorKind::Memory, SUBJECT)
                .found(format_args!("not enough memory for {}", Count(bytes.len() + count, "byte")))
                .expected("a stream that fits in memory")
                .remedy("write the stream to a file, and read the file")
        })?;
        bytes.extend_from_slice(&chunk[..count]);
    }
}

/// Standard output for the bytes of a stream. If the reader closes the pipe, the remaining bytes are discarded.
#[derive(Default)]
pub(crate) struct StreamOutput {
    /// Whether the reader closed the pipe.
    pub is_closed: bool,
}

impl StreamOutput {
    pub(crate) fn write(&mut self, bytes: &[u8]) -> Result<()> {
        let mut stdout = std::io::stdout().lock();
        match stdout.write_all(bytes).and_then(|()| stdout.flush()) {
            Err(e) if e.kind() == ErrorKind::BrokenPipe => self.is_closed = true,
            Err(e) => return Err(Error::io("standard output", e)),
            Ok(()) => {}
        }
        Ok(())
    }
}

/// Returns an error if standard output would receive both a stream and JSON lines.
pub(crate) fn refuse_json(json: bool) -> Result<()> {
    if !json {
        return Ok(());
    }
    Err(Error::new(spikelane::ErrorKind::Usage, "--json")
        .found("an output to standard output")
        .expected("one of both on standard output")
        .remedy("omit --json, or write to a file"))
}
