//! The error type of the public interface.
//!
//! Every error contains its subject, what was found, what was expected, and a remedy. The kind of an error determines the
//! exit code of the program.

pub(crate) mod nearest;
pub(crate) mod quoting;
mod setting;

use std::borrow::Cow;
use std::{fmt, io};

use crate::variants::variant_names;

pub use quoting::excerpt;
pub use setting::{Setting, render_settings};

/// Largest number of characters of [`ErrorParts::expected`] and [`ErrorParts::remedy`].
const MAX_LISTED_CHARS: usize = 1000;

/// The kind of an error. `docs/reference/errors.md` lists the exit code of each kind.
///
/// # Examples
/// ```
/// use spikelane::{ErrorKind, Geometry};
/// let kind = Geometry::new(0, 250).unwrap_err().kind();
/// assert_eq!((kind, kind.name(), kind.exit_code()), (ErrorKind::Usage, "usage", 2));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum ErrorKind {
    /// An argument or a combination of arguments is invalid.
    Usage,
    /// A preset, camera or sidecar describes something impossible.
    Config,
    /// The bytes of an input do not have the declared format.
    Input,
    /// The operating system cannot read or write.
    Io,
    /// The output does not fit on the disk or exceeds the limit on file sizes.
    Space,
    /// The output exists and overwriting is not allowed.
    Exists,
    /// A required program is missing or failed.
    Tool,
    /// Bits do not match the stored digest of these bits.
    Corrupt,
    /// Another process already does the work that this process was started for.
    Busy,
    /// The system cannot allocate an amount of memory that an input requires.
    Memory,
    /// A request to stop arrived during work that should be queued again.
    Requeue,
    /// The user requested a stop.
    Interrupted,
}

variant_names!(ErrorKind {
    Usage = "usage", Config = "config", Input = "input", Io = "io", Space = "space", Exists = "exists",
    Tool = "tool", Corrupt = "corrupt", Busy = "busy", Memory = "memory", Requeue = "requeue",
    Interrupted = "interrupted",
});

impl ErrorKind {
    /// Returns the exit code of the program for this kind of error.
    ///
    /// # Examples
    /// ```
    /// // 75 is `EX_TEMPFAIL` of `sysexits.h`: a queue should run the work again.
    /// assert_eq!(spikelane::ErrorKind::Requeue.exit_code(), 75);
    /// ```
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
            // This code is EX_TEMPFAIL of sysexits.h. Running the same command again resumes the work.
            Self::Requeue => 75,
            Self::Interrupted => 130,
        }
    }
}

/// An error: `subject: found ..., expected ...; remedy`.
///
/// # Examples
/// ```
/// use spikelane::{Error, ErrorKind};
/// let error = Error::new(ErrorKind::Input, "light.npy")
///     .found("2 axes")
///     .expected("3 axes: frames, height and width")
///     .remedy("add an axis with `a[None]`");
/// assert_eq!(
///     error.to_string(),
///     "light.npy: found 2 axes, expected 3 axes: frames, height and width; add an axis with `a[None]`",
/// );
/// assert_eq!((error.kind(), &*error.subject()), (ErrorKind::Input, "light.npy"));
/// ```
#[derive(Debug)]
pub struct Error {
    kind: ErrorKind,
    subject: String,
    found: String,
    expected: String,
    remedy: String,
    source: Option<std::io::Error>,
}

/// Returns an [`Error`] of a kind about a subject: `error!(Config, "{key}"; found "{value}"; expected "0 to 1")`.
///
/// The subject and each part (`found`, `expected`, `remedy`) is a format string with its arguments.
#[doc(hidden)]
#[macro_export]
macro_rules! __error {
    ($kind:ident, $($subject:expr),+ $(; $part:ident $($text:expr),+)*) => {
        $crate::Error::new($crate::ErrorKind::$kind, format_args!($($subject),+))$(.$part(format_args!($($text),+)))*
    };
}

/// Returns from a function with the error that [`error!`](__error) creates from the same arguments.
#[doc(hidden)]
#[macro_export]
macro_rules! __bail {
    ($($error:tt)+) => {
        return Err($crate::error::error!($($error)+))
    };
}

#[doc(hidden)]
pub use crate::{__bail as bail, __error as error};

/// A result whose error type is this crate's [`Error`].
///
/// # Examples
/// ```
/// /// Returns the number of bytes of one second of the camera.
/// fn bytes_per_second(width: u32, height: u32, readout_hz: f64) -> spikelane::Result<f64> {
///     let sensor = spikelane::Sensor::new(width, height, readout_hz)?;
///     Ok(sensor.geometry.frame_bytes() as f64 * sensor.readout_hz)
/// }
/// assert_eq!(bytes_per_second(400, 250, 20_000.0)?, 250e6);
/// # Ok::<(), spikelane::Error>(())
/// ```
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// The parts of the message of an [`Error`]. A part that was not set is empty.
///
/// # Examples
/// ```
/// let error = spikelane::Geometry::new(0, 250).unwrap_err();
/// let parts = error.parts();
/// assert_eq!((&*parts.subject, &*parts.found), ("sensor size", "0x250"));
/// assert_eq!(parts.remedy, "set `width` and `height` in pixels");
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct ErrorParts<'a> {
    /// The kind of error.
    pub kind: ErrorKind,
    /// The subject of the error: a file, a key or an argument.
    pub subject: Cow<'a, str>,
    /// What was found.
    pub found: Cow<'a, str>,
    /// What was expected instead.
    pub expected: Cow<'a, str>,
    /// The action that solves the problem.
    pub remedy: Cow<'a, str>,
}

impl Error {
    /// Returns an error of `kind` about `subject` (a file, a key or an argument).
    ///
    /// # Examples
    /// ```
    /// use spikelane::{Error, ErrorKind};
    /// let error = Error::new(ErrorKind::Config, "camera.toml");
    /// assert_eq!(error.to_string(), "camera.toml");
    /// ```
    #[must_use]
    pub fn new(kind: ErrorKind, subject: impl fmt::Display) -> Self {
        Self {
            kind,
            subject: subject.to_string(),
            found: String::new(),
            expected: String::new(),
            remedy: String::new(),
            source: None,
        }
    }

    /// Returns an error about `subject`, caused by a failed call to the operating system.
    ///
    /// If `source` wraps an [`Error`] of this crate, the wrapped error is returned unchanged. Implementations of
    /// [`std::io::Read`] in this crate wrap their errors in this way.
    ///
    /// # Examples
    /// ```
    /// use spikelane::{Error, ErrorKind};
    /// let full = std::io::Error::from(std::io::ErrorKind::StorageFull);
    /// let error = Error::io("out.dat", full);
    /// assert_eq!(error.kind(), ErrorKind::Space);
    /// assert_eq!(error.io_error().map(std::io::Error::kind), Some(std::io::ErrorKind::StorageFull));
    /// ```
    #[must_use]
    pub fn io(subject: impl fmt::Display, source: std::io::Error) -> Self {
        let source = match source.downcast::<Self>() {
            Ok(error) => return error,
            Err(source) => source,
        };
        let kind = match source.kind() {
            io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded | io::ErrorKind::FileTooLarge => {
                ErrorKind::Space
            }
            io::ErrorKind::AlreadyExists => ErrorKind::Exists,
            io::ErrorKind::OutOfMemory => ErrorKind::Memory,
            _ => ErrorKind::Io,
        };
        let mut error = Self::new(kind, subject).found(&source);
        error = match source.kind() {
            io::ErrorKind::NotFound => error
                .found("no such file or folder")
                .expected("an existing file or folder")
                .remedy("check the path"),
            io::ErrorKind::FileTooLarge => error
                .expected("a file within the size limit of this process and of the file system")
                .remedy("raise the limit (ulimit -f), or choose another file system"),
            io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => {
                error.remedy("free some space, or choose another disk")
            }
            io::ErrorKind::PermissionDenied | io::ErrorKind::ReadOnlyFilesystem => {
                error.remedy("allow this user to access the file or folder, or choose another location")
            }
            _ => error,
        };
        error.source = Some(source);
        error
    }

    /// Sets the description of what was found. [`excerpt`] shortens the description, because it can quote a file.
    #[must_use]
    pub fn found(mut self, found: impl fmt::Display) -> Self {
        self.found = excerpt(&found.to_string()).into_owned();
        self
    }

    /// Sets the description of what was expected. [`excerpt`] shortens a text of more than 1000 characters, because a part of
    /// it can come from a file. Shorter texts remain, because they can list the accepted values.
    #[must_use]
    pub fn expected(mut self, expected: impl fmt::Display) -> Self {
        self.expected = shortened(expected);
        self
    }

    /// Sets the action that solves the problem. The length is limited as in [`Error::expected`].
    #[must_use]
    pub fn remedy(mut self, remedy: impl fmt::Display) -> Self {
        self.remedy = shortened(remedy);
        self
    }

    /// Returns an error about `what` unless `is_enabled` is true.
    ///
    /// `is_enabled` states whether this build includes `feature`, the feature that `what` requires.
    #[cfg(feature = "presets")]
    pub fn require_feature(what: impl fmt::Display, feature: &str, is_enabled: bool) -> Result<()> {
        if is_enabled {
            return Ok(());
        }
        Err(Self::new(ErrorKind::Usage, what)
            .found(format_args!("a build without the feature '{feature}'"))
            .expected("a build with this feature")
            .remedy(format_args!("enable the Cargo feature '{feature}', or the default features")))
    }

    /// Sets the remedy to the element of `names` that is most similar to `word`. If no element is similar enough, the
    /// remedy is unchanged.
    ///
    /// # Examples
    /// ```
    /// use spikelane::{Error, ErrorKind};
    /// let error = Error::new(ErrorKind::Usage, "color").found("gren").with_suggestion("gren", ["red", "green"]);
    /// assert_eq!(error.to_string(), "color: found gren; did you mean green?");
    /// ```
    #[must_use]
    pub fn with_suggestion<'a>(self, word: &str, names: impl IntoIterator<Item = &'a str>) -> Self {
        match nearest::nearest(word, names) {
            Some(name) => self.remedy(format_args!("did you mean {name}?")),
            None => self,
        }
    }

    /// Returns this error with `outer` and a colon before the subject: `outer: subject`.
    ///
    /// # Examples
    /// ```
    /// let read = |name: &str| spikelane::Geometry::new(0, 250).map_err(|e| e.with_context(name));
    /// assert_eq!(read("camera.toml").unwrap_err().subject(), "camera.toml: sensor size");
    /// ```
    #[must_use]
    pub fn with_context(mut self, outer: impl fmt::Display) -> Self {
        self.subject = format!("{outer}: {}", self.subject);
        self
    }

    /// Changes the kind `Usage` to `Config`. Call this method if the wrong value is in a file and not on the command
    /// line.
    #[cfg(feature = "presets")]
    pub const fn usage_as_config(mut self) -> Self {
        if matches!(self.kind, ErrorKind::Usage) {
            self.kind = ErrorKind::Config;
        }
        self
    }

    /// Returns the kind of error.
    ///
    /// # Examples
    /// ```
    /// use spikelane::{ErrorKind, Sensor};
    /// let error = Sensor::new(400, 250, -1.0).unwrap_err();
    /// assert_eq!(error.kind(), ErrorKind::Config);
    /// ```
    #[must_use]
    pub const fn kind(&self) -> ErrorKind {
        self.kind
    }

    /// Returns the subject of the error.
    ///
    /// # Examples
    /// ```
    /// let error = spikelane::Sensor::new(400, 250, -1.0).unwrap_err();
    /// assert_eq!(error.subject(), "readout rate (Hz)");
    /// ```
    #[must_use]
    pub fn subject(&self) -> Cow<'_, str> {
        render_settings(&self.subject, &setting::quoted)
    }

    /// Returns all parts of the message, with each [`Setting`] in backticks.
    ///
    /// # Examples
    /// ```
    /// let error = spikelane::Sensor::new(400, 250, -1.0).unwrap_err();
    /// assert_eq!((&*error.parts().found, &*error.parts().expected), ("-1", "a positive number"));
    /// ```
    #[must_use]
    pub fn parts(&self) -> ErrorParts<'_> {
        self.render_parts(&setting::quoted)
    }

    /// Returns all parts of the message, with the key of each [`Setting`] spelled by `spell`.
    ///
    /// # Examples
    /// ```
    /// let error = spikelane::Geometry::new(0, 250).unwrap_err();
    /// let parts = error.render_parts(&|key| format!("{key}="));
    /// assert_eq!(parts.remedy, "set width= and height= in pixels");
    /// ```
    #[must_use]
    pub fn render_parts(&self, spell: &dyn Fn(&str) -> String) -> ErrorParts<'_> {
        let render = |part| render_settings(part, spell);
        ErrorParts {
            kind: self.kind,
            subject: render(&self.subject),
            found: render(&self.found),
            expected: render(&self.expected),
            remedy: render(&self.remedy),
        }
    }

    /// Returns the error of the operating system that caused this error, or `None`.
    ///
    /// # Examples
    /// ```
    /// use spikelane::{Error, ErrorKind};
    /// let missing = std::fs::File::open("no/such/file").map_err(|e| Error::io("no/such/file", e)).unwrap_err();
    /// assert_eq!(missing.io_error().map(|e| e.kind()), Some(std::io::ErrorKind::NotFound));
    /// assert!(Error::new(ErrorKind::Usage, "width").io_error().is_none());
    /// ```
    #[must_use]
    pub fn io_error(&self) -> Option<&std::io::Error> {
        self.source.as_ref()
    }
}

impl Error {
    /// Returns the message with the key of each [`Setting`] spelled by `spell`.
    ///
    /// Characters of names and files are not escaped; see [`printable`].
    ///
    /// # Examples
    /// ```
    /// let error = spikelane::Geometry::new(0, 250).unwrap_err();
    /// let message = error.render(&|key| format!("--{key}"));
    /// assert!(message.ends_with("set --width and --height in pixels"));
    /// ```
    #[must_use]
    pub fn render(&self, spell: &dyn Fn(&str) -> String) -> String {
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
        render_settings(&message, spell).into_owned()
    }
}

/// Writes the message with control characters escaped by [`printable`], because names and files may contain control
/// characters.
impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&printable(&self.render(&setting::quoted)))
    }
}

/// Returns `text`, shortened by [`excerpt`] if it has more than [`MAX_LISTED_CHARS`] characters.
fn shortened(text: impl fmt::Display) -> String {
    let text = text.to_string();
    if text.chars().nth(MAX_LISTED_CHARS).is_some() { excerpt(&text).into_owned() } else { text }
}

/// Returns `text` in a form that is safe to print on a terminal.
///
/// Control characters other than line feeds and tabs are escaped in the form `\u{1b}`. Characters that change the
/// direction of text and invisible line separators are escaped too.
///
/// # Examples
/// ```
/// use spikelane::error::printable;
/// assert_eq!(printable("größe\t光"), "größe\t光");
/// // A file name must not send commands to the terminal.
/// assert_eq!(printable("a\u{1b}[2J.dat"), r"a\u{1b}[2J.dat");
/// ```
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
        let error = Error::new(ErrorKind::Input, "a\u{1b}[2J\u{9b}b").found("\u{202e}txt\r\u{7}");
        assert_eq!(error.to_string(), r"a\u{1b}[2J\u{9b}b: found \u{202e}txt\u{d}\u{7}");
        assert_eq!(error.subject(), "a\u{1b}[2J\u{9b}b");
    }

    #[test]
    fn other_characters_are_printed_as_they_are() {
        let text = "größe 光\n\ttab 🎥";
        assert_eq!(printable(text), text);
    }

    #[test]
    fn a_message_quotes_a_part_of_a_long_text() {
        for text in ["a", "\u{1f3a5}"] {
            let error =
                Error::new(ErrorKind::Input, "a.txt").found(format_args!("`{}`", text.repeat(1 << 20)));
            assert_eq!(
                error.parts().found,
                format!("`{}... ({} characters)", text.repeat(199), (1 << 20) + 2)
            );
            let error = Error::new(ErrorKind::Corrupt, "a.txt").expected(text.repeat(1001));
            assert_eq!(error.parts().expected, format!("{}... (1001 characters)", text.repeat(200)));
        }
    }

    #[cfg(feature = "presets")]
    #[test]
    fn a_missing_feature_is_named() {
        assert!(Error::require_feature("EXR pictures", "exr", true).is_ok());
        let error = Error::require_feature("EXR pictures", "exr", false).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Usage);
        let message = error.to_string();
        assert!(message.starts_with("EXR pictures") && message.contains("Cargo feature 'exr'"), "{message}");
    }
}
