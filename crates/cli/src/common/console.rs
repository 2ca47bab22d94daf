//! Output of the program. Results are printed to standard output, and all other text to standard error.

use std::ffi::OsString;
use std::io::{ErrorKind, Write};
use std::path::Path;
use std::sync::Mutex;

use serde::Serialize;
use serde_json::{Value, json};
use spikelane::error::{printable, render_settings};
use spikelane::{Error, Result};
use spikelane_measure::report::RunRecord;

/// The standard output and standard error, and the output format that the user selected.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Console {
    json: bool,
    verbose: bool,
}

impl Console {
    pub(crate) const fn new(json: bool, verbose: bool) -> Self {
        Self { json, verbose }
    }

    pub(crate) const fn json(&self) -> bool {
        self.json
    }

    /// Prints one line of JSON if `--json` is set. Names of settings in the line are replaced by flags of the program.
    ///
    /// JSON text can contain the control characters 7f to 9f. Terminals interpret these characters, so they are
    /// escaped.
    pub(crate) fn print_event(&self, value: &Value) -> Result<()> {
        if !self.json {
            return Ok(());
        }
        let escaped = |c: char| match c {
            '\u{7f}'..='\u{9f}' => format!("\\u{:04x}", u32::from(c)),
            _ => c.to_string(),
        };
        let line: String = render_settings(&value.to_string(), &flag).chars().map(escaped).collect();
        write_stdout(format!("{line}\n").as_bytes())
    }

    /// Prints a result. With `--json` it prints the JSON line, otherwise the text with escaped control characters.
    pub(crate) fn print_result(&self, value: &Value, text: &str) -> Result<()> {
        if self.json {
            self.print_event(value)
        } else {
            write_stdout(printable(&render_settings(text, &flag)).as_bytes())
        }
    }

    /// Prints the bytes of a file as the result, in both output formats.
    pub(crate) fn print_bytes(&self, bytes: &[u8]) -> Result<()> {
        write_stdout(bytes)
    }

    /// Prints a message to standard error, with escaped control characters.
    pub(crate) fn print_message(&self, text: impl std::fmt::Display) {
        // If standard error is closed, there is nowhere to report it.
        let text = text.to_string();
        let _ = writeln!(std::io::stderr(), "{}", printable(&render_settings(&text, &flag)));
    }

    /// Prints a message to standard error if `--verbose` is set.
    pub(crate) fn print_detail(&self, text: impl std::fmt::Display) {
        if self.verbose {
            self.print_message(text);
        }
    }

    pub(crate) fn print_error(&self, error: &Error) {
        let message = error.render(&flag);
        self.print_message(format_args!("spikelane: {message}"));
        let kind = error.kind().name();
        let code = error.kind().exit_code();
        let event = json!({"event": "error", "kind": kind, "exit_code": code, "message": message});
        let _ = self.print_event(&event);
    }
}

/// Returns the JSON event `name` with the fields of `result`, which is a structure.
pub(crate) fn event(name: &str, result: &impl Serialize) -> Result<Value> {
    let fields = serde_json::to_value(result);
    let mut event = fields.map_err(|e| Error::new(spikelane::ErrorKind::Config, name).found(e))?;
    event["event"] = name.into();
    Ok(event)
}

/// Returns the flag of a setting that a message of a library names.
pub(crate) fn flag(key: &str) -> String {
    format!("--{}", key.replace('_', "-"))
}

/// Writes to standard output. A closed pipe is not an error, because `| head` closes its pipe early. The command then
/// continues without output.
fn write_stdout(bytes: &[u8]) -> Result<()> {
    let mut stdout = std::io::stdout().lock();
    match stdout.write_all(bytes).and_then(|()| stdout.flush()) {
        Err(e) if e.kind() != ErrorKind::BrokenPipe => Err(Error::io("standard output", e)),
        _ => Ok(()),
    }
}

/// The most recent command line of this process, and whether absolute paths are recorded.
static RECORDED_COMMAND: Mutex<(Vec<String>, bool)> = Mutex::new((Vec::new(), false));

/// Stores the command line for [`command_line`]. `absolute` is whether absolute paths are recorded.
pub(crate) fn remember_command(args: &[OsString], absolute: bool) {
    if let Ok(mut command) = RECORDED_COMMAND.lock() {
        *command = (args.iter().map(|a| a.to_string_lossy().into_owned()).collect(), absolute);
    }
}

/// Returns the command line for a sidecar or a report. Its paths are shortened as in [`recorded_path`].
pub(crate) fn command_line() -> Vec<String> {
    let (command, absolute) = RECORDED_COMMAND.lock().map(|command| command.clone()).unwrap_or_default();
    command.iter().map(|word| if absolute { word.clone() } else { strip_folders(word) }).collect()
}

/// Returns a path in the form in which files record it. Without `--record-paths` the folders of an absolute path are
/// removed, because they are private.
pub(crate) fn recorded_path(path: &Path) -> String {
    let absolute = RECORDED_COMMAND.lock().is_ok_and(|command| command.1);
    let text = path.display().to_string();
    if absolute { text } else { strip_folders(&text) }
}

/// Returns the origin of a report: the command line, the date and the digests of the input files.
pub(crate) fn run_record(files: impl IntoIterator<Item = impl AsRef<Path>>) -> RunRecord {
    let run = RunRecord::now(recorded_command());
    files.into_iter().fold(run, |run, file| {
        let file = file.as_ref();
        run.with_file(file, recorded_path(file))
    })
}

/// Returns the command line as text. The program is written as `spikelane`, without its folder.
pub(crate) fn recorded_command() -> String {
    let words = command_line().into_iter().skip(1);
    std::iter::once("spikelane".to_owned()).chain(words).collect::<Vec<_>>().join(" ")
}

/// Replaces an absolute path in `word` with its file name. `word` is a word of a command line.
///
/// The path can be the whole word, or the value in `--flag=PATH` or `-oPATH`.
fn strip_folders(word: &str) -> String {
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
        for (word, expected) in [
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
            assert_eq!(strip_folders(word), expected);
        }
    }
}
