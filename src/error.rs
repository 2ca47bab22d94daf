//! The one error of the crate's public doors.
//!
//! Every error says which thing was wrong, what was found there, what was
//! expected, and what to do. The kind decides the exit code of the program.

mod nearest;

use std::borrow::Cow;
use std::fmt;
use std::io::ErrorKind;

/// What sort of mistake it is; see `docs/reference/errors.md` for the exit codes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Kind {
    /// An argument or a combination of arguments makes no sense.
    Usage,
    /// A preset, camera or sidecar describes something impossible.
    Config,
    /// The bytes of an input are not what they claim to be.
    Input,
    /// The operating system refused to read or write.
    Io,
    /// The disk cannot hold the result, or a limit on the size of files forbids it.
    Space,
    /// The output exists and nobody allowed overwriting it.
    Exists,
    /// A program that is needed is missing or failed.
    Tool,
    /// Bits do not match their digest.
    Corrupt,
    /// Another process is at this work.
    Busy,
    /// There is no memory for a size that an input requires.
    Memory,
    /// Asked to stop in the middle of work that is to be queued again.
    Requeue,
    /// The user asked to stop.
    Interrupted,
}

impl Kind {
    /// The name in the program's JSON.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Usage => "usage",
            Self::Config => "config",
            Self::Input => "input",
            Self::Io => "io",
            Self::Space => "space",
            Self::Exists => "exists",
            Self::Tool => "tool",
            Self::Corrupt => "corrupt",
            Self::Busy => "busy",
            Self::Memory => "memory",
            Self::Requeue => "requeue",
            Self::Interrupted => "interrupted",
        }
    }

    /// The exit code of the program for this kind of error.
    #[must_use]
    pub const fn exit_code(self) -> u8 {
        match self {
            Self::Usage => 2,
            Self::Config => 3,
            Self::Input => 4,
            Self::Io => 5,
            Self::Space => 6,
            Self::Exists => 7,
            Self::Tool => 8,
            Self::Corrupt => 9,
            Self::Busy => 10,
            Self::Memory => 11,
            // EX_TEMPFAIL of sysexits.h: the same command, given again, goes on.
            Self::Requeue => 75,
            Self::Interrupted => 130,
        }
    }
}

/// An error: `subject: found ..., expected ...; remedy`.
#[derive(Debug)]
pub struct Error {
    kind: Kind,
    subject: String,
    found: String,
    expected: String,
    remedy: String,
    source: Option<std::io::Error>,
}

/// A result with this crate's [`Error`].
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// What an [`Error`] says, piece by piece; a piece that it does not say is empty.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Parts<'a> {
    /// The sort of mistake.
    pub kind: Kind,
    /// The thing the error is about: a file, a key, an argument.
    pub subject: &'a str,
    /// What was found there.
    pub found: &'a str,
    /// What was expected instead.
    pub expected: &'a str,
    /// What to do about it.
    pub remedy: &'a str,
}

impl Error {
    /// An error of `kind` about `subject` (a file, a key, an argument).
    #[must_use]
    pub fn new(kind: Kind, subject: impl fmt::Display) -> Self {
        Self {
            kind,
            subject: subject.to_string(),
            found: String::new(),
            expected: String::new(),
            remedy: String::new(),
            source: None,
        }
    }

    /// The operating system's refusal of something about `subject`.
    ///
    /// An error of this crate that went through a reader comes out as it was.
    #[must_use]
    pub fn io(subject: impl fmt::Display, source: std::io::Error) -> Self {
        let source = match source.downcast::<Self>() {
            Ok(error) => return error,
            Err(source) => source,
        };
        let kind = match source.kind() {
            ErrorKind::StorageFull | ErrorKind::QuotaExceeded | ErrorKind::FileTooLarge => Kind::Space,
            ErrorKind::AlreadyExists => Kind::Exists,
            ErrorKind::OutOfMemory => Kind::Memory,
            _ => Kind::Io,
        };
        let mut error = Self::new(kind, subject).found(&source);
        error = match source.kind() {
            ErrorKind::FileTooLarge => error
                .expected("a file within the size limit of this process and of the file system")
                .remedy("raise the limit (ulimit -f), or choose another file system"),
            ErrorKind::StorageFull | ErrorKind::QuotaExceeded => {
                error.remedy("free some space, or choose another disk")
            }
            ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem => {
                error.remedy("give this user access to it, or choose another place")
            }
            _ => error,
        };
        error.source = Some(source);
        error
    }

    /// What was found.
    #[must_use]
    pub fn found(mut self, found: impl fmt::Display) -> Self {
        self.found = found.to_string();
        self
    }

    /// What was expected instead.
    #[must_use]
    pub fn expected(mut self, expected: impl fmt::Display) -> Self {
        self.expected = expected.to_string();
        self
    }

    /// What the user can do about it.
    #[must_use]
    pub fn remedy(mut self, remedy: impl fmt::Display) -> Self {
        self.remedy = remedy.to_string();
        self
    }

    /// Refuses `what` where this build lacks the feature that it needs; `here` is whether it has it.
    #[cfg(feature = "presets")]
    pub fn require(what: impl fmt::Display, feature: &str, here: bool) -> Result<()> {
        if here {
            return Ok(());
        }
        Err(Self::new(Kind::Usage, what)
            .found(format_args!("a build without the feature '{feature}'"))
            .expected("a build with it")
            .remedy(format_args!("build with '--features {feature}', or with the default features")))
    }

    /// Asks whether the nearest of `names` was meant, where one is near enough to `word`.
    #[must_use]
    pub fn or_nearest<'a>(self, word: &str, names: impl IntoIterator<Item = &'a str>) -> Self {
        match nearest::nearest(word, names) {
            Some(name) => self.remedy(format_args!("did you mean {name}?")),
            None => self,
        }
    }

    /// The same error about something inside `outer`, as `outer: subject`.
    #[must_use]
    pub fn within(mut self, outer: impl fmt::Display) -> Self {
        self.subject = format!("{outer}: {}", self.subject);
        self
    }

    /// The same error where a file, and not the command line, has the wrong value.
    #[cfg(feature = "presets")]
    pub const fn usage_as_config(mut self) -> Self {
        if matches!(self.kind, Kind::Usage) {
            self.kind = Kind::Config;
        }
        self
    }

    /// The sort of mistake.
    #[must_use]
    pub const fn kind(&self) -> Kind {
        self.kind
    }

    /// The thing the error is about.
    #[must_use]
    pub fn subject(&self) -> &str {
        &self.subject
    }

    /// Everything that it says.
    #[must_use]
    pub fn parts(&self) -> Parts<'_> {
        let Self { kind, subject, found, expected, remedy, .. } = self;
        Parts { kind: *kind, subject, found, expected, remedy }
    }

    /// The operating system's refusal behind it, if there is one.
    #[must_use]
    pub fn io_error(&self) -> Option<&std::io::Error> {
        self.source.as_ref()
    }
}

impl Error {
    /// The message, with all characters as they are in names and files.
    pub fn raw_message(&self) -> String {
        let mut message = self.subject.clone();
        let subject = message.len();
        for (between, label, text) in
            [(", ", "found ", &self.found), (", ", "expected ", &self.expected), ("; ", "", &self.remedy)]
        {
            if !text.is_empty() {
                message += if message.len() == subject { ": " } else { between };
                message += label;
                message += text;
            }
        }
        message
    }
}

/// The message on one channel to a person. Control characters, which a name or a file may hold, are escaped; see `printable`.
impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&printable(&self.raw_message()))
    }
}

/// `text` as a terminal may show it: control characters but line feeds and tabs, and characters that change the direction of
/// text or are invisible separators of lines, are escaped as `\u{1b}`.
pub fn printable(text: &str) -> Cow<'_, str> {
    let is_unsafe = |c: char| {
        (c.is_control() && c != '\n' && c != '\t')
            || matches!(c, '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
    };
    if !text.contains(is_unsafe) {
        return Cow::Borrowed(text);
    }
    let escaped = |c: char| if is_unsafe(c) { c.escape_unicode().to_string() } else { c.to_string() };
    Cow::Owned(text.chars().map(escaped).collect())
}

impl std::error::Error for Error {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        self.source.as_ref().map(|e| e as _)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_escapes_control_and_direction_characters() {
        let error = Error::new(Kind::Input, "a\u{1b}[2J\u{9b}b").found("\u{202e}txt\r\u{7}");
        assert_eq!(error.to_string(), r"a\u{1b}[2J\u{9b}b: found \u{202e}txt\u{d}\u{7}");
        assert_eq!(error.subject(), "a\u{1b}[2J\u{9b}b");
    }

    #[test]
    fn other_characters_are_printed_as_they_are() {
        let text = "größe 光\n\ttab 🎥";
        assert_eq!(printable(text), text);
    }

    #[cfg(feature = "presets")]
    #[test]
    fn what_needs_a_missing_feature_names_it() {
        assert!(Error::require("EXR pictures", "exr", true).is_ok());
        let error = Error::require("EXR pictures", "exr", false).unwrap_err();
        assert_eq!(error.kind(), Kind::Usage);
        let said = error.to_string();
        assert!(said.starts_with("EXR pictures") && said.contains("'--features exr'"), "{said}");
    }
}
