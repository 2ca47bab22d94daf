//! What the program says, and where: results to standard output, the rest to standard error.

use std::ffi::OsString;
use std::io::{ErrorKind, Write};
use std::path::Path;
use std::sync::Mutex;

use serde_json::{Value, json};
use spikelane::error::printable;
use spikelane::{Error, Result};

/// The two channels.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Out {
    json: bool,
    verbose: bool,
}

impl Out {
    pub(crate) const fn new(json: bool, verbose: bool) -> Self {
        Self { json, verbose }
    }

    pub(crate) const fn json(&self) -> bool {
        self.json
    }

    /// One line of JSON, if asked for. JSON writes the controls from 7f to 9f as they are, which a terminal may act on, so they
    /// are escaped too.
    pub(crate) fn event(&self, value: &Value) -> Result<()> {
        if !self.json {
            return Ok(());
        }
        let escaped = |c: char| match c {
            '\u{7f}'..='\u{9f}' => format!("\\u{:04x}", u32::from(c)),
            _ => c.to_string(),
        };
        let line: String = value.to_string().chars().map(escaped).collect();
        write_out(format!("{line}\n").as_bytes())
    }

    /// A result: the JSON line if asked for, else text to standard output, with control characters escaped.
    pub(crate) fn result(&self, value: &Value, text: &str) -> Result<()> {
        if self.json { self.event(value) } else { write_out(printable(text).as_bytes()) }
    }

    /// A file's bytes as the result, whatever was asked for.
    pub(crate) fn bytes(&self, bytes: &[u8]) -> Result<()> {
        write_out(bytes)
    }

    /// Text for people, to standard error, with control characters escaped.
    pub(crate) fn say(&self, text: impl std::fmt::Display) {
        // Nobody is left to hear that standard error is closed.
        let _ = writeln!(std::io::stderr(), "{}", printable(&text.to_string()));
    }

    /// Text for people who asked for more (`-v`), to standard error.
    pub(crate) fn detail(&self, text: impl std::fmt::Display) {
        if self.verbose {
            self.say(text);
        }
    }

    pub(crate) fn error(&self, error: &Error) {
        self.say(format_args!("spikelane: {error}"));
        let kind = error.kind().name();
        let code = error.kind().exit_code();
        let event =
            json!({"event": "error", "kind": kind, "exit_code": code, "message": error.raw_message()});
        let _ = self.event(&event);
    }
}

/// A reader that has seen enough (`| head`) is no error: the work goes on without it.
fn write_out(bytes: &[u8]) -> Result<()> {
    let mut stdout = std::io::stdout().lock();
    match stdout.write_all(bytes).and_then(|()| stdout.flush()) {
        Err(e) if e.kind() != ErrorKind::BrokenPipe => Err(Error::io("standard output", e)),
        _ => Ok(()),
    }
}

/// A process is one command; a host that runs several keeps the last.
static COMMAND: Mutex<(Vec<String>, bool)> = Mutex::new((Vec::new(), false));

/// Keeps the command line for [`command_line`], and whether absolute paths are recorded.
pub(crate) fn remember_command(args: &[OsString], absolute: bool) {
    if let Ok(mut command) = COMMAND.lock() {
        *command = (args.iter().map(|a| a.to_string_lossy().into_owned()).collect(), absolute);
    }
}

/// The command line for a sidecar or a report, see [`recorded`].
pub(crate) fn command_line() -> Vec<String> {
    let (command, absolute) = COMMAND.lock().map(|command| command.clone()).unwrap_or_default();
    command.iter().map(|word| if absolute { word.clone() } else { without_folders(word) }).collect()
}

/// A path as files record it: an absolute one without its folders, which are nobody else's business, unless the user
/// wants them.
pub(crate) fn recorded(path: &Path) -> String {
    let absolute = COMMAND.lock().is_ok_and(|command| command.1);
    let text = path.display().to_string();
    if absolute { text } else { without_folders(&text) }
}

/// A word of a command line with the file name alone in the place of an absolute path: the word itself, the value of
/// `--flag=PATH`, or that of `-oPATH`.
fn without_folders(word: &str) -> String {
    let value = match word.split_once('=') {
        Some((flag, value)) if flag.starts_with("--") => value,
        _ if word.starts_with('-') && !word.starts_with("--") => word.get(2..).unwrap_or_default(),
        _ => word,
    };
    let path = Path::new(value);
    match path.file_name() {
        Some(name) if path.is_absolute() => {
            format!("{}{}", &word[..word.len() - value.len()], name.to_string_lossy())
        }
        _ => word.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(unix)]
    #[test]
    fn absolute_paths_lose_their_folders_and_everything_else_stays() {
        for (word, kept) in [
            ("/usr/bin/spikelane", "spikelane"),
            ("/home/alice/in/clip.mp4", "clip.mp4"),
            ("--output=/home/alice/out/run", "--output=run"),
            ("-o/home/alice/out/", "-oout"),
            ("in/clip.mp4", "in/clip.mp4"),
            ("../clip.mp4", "../clip.mp4"),
            ("--readouts", "--readouts"),
            ("--effect=prnu.sigma=0.1", "--effect=prnu.sigma=0.1"),
            ("100..500", "100..500"),
            ("-", "-"),
            ("/", "/"),
            ("-\u{e9}/a", "-\u{e9}/a"),
        ] {
            assert_eq!(without_folders(word), kept);
        }
    }
}
