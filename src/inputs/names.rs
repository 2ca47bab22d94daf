//! Names and paths that were read from a file.

use std::fmt;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::error::{Error, Kind, Result};

/// The longest name that all file systems in use accept, in bytes.
const MAX_NAME_BYTES: usize = 255;

/// Names that Windows opens as devices, whatever the ending behind them.
const DEVICES: [&str; 6] = ["CON", "PRN", "AUX", "NUL", "CONIN$", "CONOUT$"];

/// One name of a file or folder that a file from elsewhere may choose: `scene-0000`, never `..`, `a/b` or `C:`.
///
/// The same names are valid on every system, so that a data set made on one can be read on another.
#[derive(Clone, Debug, Deserialize, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize)]
#[serde(try_from = "String", into = "String")]
pub struct PlainName(String);

/// A path below a folder, of [`PlainName`]s with `/` between them: `train/spike/scene-0000.dat`.
///
/// It is made of texts that were checked and of words of the program itself, never of an unchecked text.
#[derive(Clone, Debug, Deserialize, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize)]
#[serde(try_from = "String", into = "String")]
pub struct InnerPath(String);

/// What a path below a folder is used for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// Reading. A link may lead to another place below the folder.
    Read,
    /// Reading. A link may lead anywhere, since the user allowed it.
    ReadThroughLinks,
    /// Writing or deleting. No part of the path may be a link.
    Write,
}

impl Access {
    /// Reading, with or without links that leave the folder.
    pub const fn reading(follow_links: bool) -> Self {
        if follow_links { Self::ReadThroughLinks } else { Self::Read }
    }
}

impl PlainName {
    /// Accepts `text` as a name; `subject` is the file and key that it was read from.
    ///
    /// # Errors
    /// An error of `kind` that states why `text` is not a plain name.
    pub fn parse(kind: Kind, subject: impl fmt::Display, text: &str) -> Result<Self> {
        match fault(text) {
            None => Ok(Self(text.to_owned())),
            Some(fault) => Err(Error::new(kind, subject)
                .found(format_args!("{}, which {fault}", shown(text)))
                .expected("one plain name of a file or folder")),
        }
    }

    /// Returns the digits of `number`, with zeros before them up to `width` digits.
    pub fn number(number: u64, width: usize) -> Self {
        Self(format!("{number:0width$}"))
    }

    /// Returns the name with an ending of the program's own, such as `.dat`.
    pub fn with(&self, ending: &'static str) -> Self {
        Self(format!("{}{ending}", self.0))
    }

    /// Returns the hidden name of the same file or folder in the making.
    pub fn partial(&self) -> Self {
        Self(format!(".{}.partial", self.0))
    }

    /// Returns the name as text.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl InnerPath {
    /// Accepts `text` as a path below a folder; `subject` is the file and key that it was read from.
    ///
    /// # Errors
    /// An error of `kind` that states why `text` is not such a path.
    pub fn parse(kind: Kind, subject: impl fmt::Display, text: &str) -> Result<Self> {
        match text.split('/').find_map(fault) {
            None => Ok(Self(text.to_owned())),
            Some(fault) => Err(Error::new(kind, subject)
                .found(format_args!("{}, part of which {fault}", shown(text)))
                .expected("a path of plain names below the folder, such as train/scene.dat")),
        }
    }

    /// Returns the path of `inner` in the folder that this path names.
    pub fn join(&self, inner: impl Into<Self>) -> Self {
        Self(format!("{}/{}", self.0, inner.into().0))
    }

    /// Returns the path as text, with `/` between its names.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }

    /// Returns the path in `folder`, after a look at each link on the way.
    ///
    /// `folder` itself may be a link: the user named it. Parts that do not exist yet are no error.
    ///
    /// # Errors
    /// [`Kind::Input`] when a link leaves the folder, or when `access` is [`Access::Write`] and any part is a link.
    pub fn below(&self, folder: &Path, access: Access) -> Result<PathBuf> {
        let (mut path, last) = self.checked_parent(folder, access)?;
        path.push(last);
        check_link(folder, &path, access)?;
        Ok(path)
    }

    /// Returns the path in `folder` of something to remove, which may be a link itself: the link is removed.
    ///
    /// # Errors
    /// [`Kind::Input`] when a part above the last one is a link.
    pub fn removable_below(&self, folder: &Path) -> Result<PathBuf> {
        let (mut path, last) = self.checked_parent(folder, Access::Write)?;
        path.push(last);
        Ok(path)
    }

    fn checked_parent(&self, folder: &Path, access: Access) -> Result<(PathBuf, &str)> {
        let (above, last) = self.0.rsplit_once('/').unwrap_or(("", &self.0));
        let mut path = folder.to_owned();
        for name in above.split('/').filter(|name| !name.is_empty()) {
            path.push(name);
            check_link(folder, &path, access)?;
        }
        Ok((path, last))
    }
}

impl From<PlainName> for InnerPath {
    fn from(name: PlainName) -> Self {
        Self(name.0)
    }
}

impl From<&PlainName> for InnerPath {
    fn from(name: &PlainName) -> Self {
        Self(name.0.clone())
    }
}

/// Paths that are words of the program itself.
impl From<&'static str> for InnerPath {
    fn from(path: &'static str) -> Self {
        debug_assert!(path.split('/').find_map(fault).is_none(), "{path}");
        Self(path.to_owned())
    }
}

impl TryFrom<String> for PlainName {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        match fault(&text) {
            None => Ok(Self(text)),
            Some(fault) => Err(format!("the name {}, which {fault},", shown(&text))),
        }
    }
}

impl TryFrom<String> for InnerPath {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        match text.split('/').find_map(fault) {
            None => Ok(Self(text)),
            Some(fault) => Err(format!("the path {}, part of which {fault},", shown(&text))),
        }
    }
}

impl From<PlainName> for String {
    fn from(name: PlainName) -> Self {
        name.0
    }
}

impl From<InnerPath> for String {
    fn from(path: InnerPath) -> Self {
        path.0
    }
}

impl fmt::Display for PlainName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl fmt::Display for InnerPath {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// Checks that `path`, which lies below `folder`, may be used although it may be a link.
///
/// # Errors
/// [`Kind::Input`] when it is a link that `access` does not allow.
pub fn check_link(folder: &Path, path: &Path, access: Access) -> Result<()> {
    let is_link = std::fs::symlink_metadata(path).is_ok_and(|found| found.is_symlink());
    if is_link && !allowed(folder, path, access) { Err(refused(path, access)) } else { Ok(()) }
}

fn allowed(folder: &Path, link: &Path, access: Access) -> bool {
    match access {
        Access::Write => false,
        Access::ReadThroughLinks => true,
        Access::Read => match (named(folder).canonicalize(), link.canonicalize()) {
            (Ok(folder), Ok(target)) => target.starts_with(folder),
            // A link that leads nowhere shows nothing; opening it reports that.
            _ => true,
        },
    }
}

/// The folder of the process has an empty path.
fn named(folder: &Path) -> &Path {
    if folder.as_os_str().is_empty() { Path::new(".") } else { folder }
}

fn refused(link: &Path, access: Access) -> Error {
    let error = Error::new(Kind::Input, link.display());
    match access {
        Access::Write => error
            .found("a symbolic link")
            .expected("a plain file or folder, since writing and deleting never follow links")
            .remedy("remove the link, or name the folder that it leads to"),
        _ => error
            .found("a symbolic link that leaves the folder")
            .expected("a file below the folder")
            .remedy("copy the file into the folder, or allow links that leave it if you trust the folder"),
    }
}

/// Returns `text` in quotes and without control characters, cut where it is long.
fn shown(text: &str) -> String {
    const MAX_CHARS: usize = 80;
    match text.char_indices().nth(MAX_CHARS) {
        None => format!("{text:?}"),
        Some((end, _)) => format!("{:?}... ({} bytes)", &text[..end], text.len()),
    }
}

/// Why `name` is not a plain name, as the end of a sentence.
fn fault(name: &str) -> Option<&'static str> {
    let stem = name.split('.').next().unwrap_or_default().trim_end();
    if name.is_empty() {
        Some("is empty")
    } else if name == "." || name == ".." {
        Some("names the folder itself or the one above")
    } else if name.len() > MAX_NAME_BYTES {
        Some("is longer than 255 bytes")
    } else if name.contains(['/', '\\']) {
        Some("contains a path separator")
    } else if name.contains(':') {
        Some("contains a colon, which Windows reads as a drive or a stream")
    } else if name.chars().any(char::is_control) {
        Some("contains a control character")
    } else if name.ends_with(['.', ' ']) {
        Some("ends with a dot or a space, which Windows removes")
    } else if is_device(stem) {
        Some("is a device on Windows")
    } else {
        None
    }
}

fn is_device(stem: &str) -> bool {
    let numbered = |prefix: &str| {
        let mut rest = stem.get(prefix.len()..).unwrap_or_default().chars();
        stem.get(..prefix.len()).is_some_and(|s| s.eq_ignore_ascii_case(prefix))
            && matches!(rest.next(), Some('0'..='9' | '\u{b9}' | '\u{b2}' | '\u{b3}'))
            && rest.next().is_none()
    };
    DEVICES.iter().any(|device| stem.eq_ignore_ascii_case(device)) || numbered("COM") || numbered("LPT")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_could_lead_elsewhere_are_refused() {
        let long = "x".repeat(256);
        for wrong in [
            "",
            ".",
            "..",
            "/",
            "/etc",
            "a/b",
            "a\\b",
            "C:",
            "C:a",
            "a:b",
            "a\0b",
            "a\nb",
            "a\u{1b}[2J",
            "a.",
            "a ",
            "con",
            "NUL.txt",
            "com1",
            "LPT9.dat",
            "COM\u{b2}",
            "aux .x",
            &long,
        ] {
            assert_eq!(
                PlainName::parse(Kind::Config, "id", wrong).unwrap_err().kind(),
                Kind::Config,
                "{wrong:?}"
            );
        }
        for right in [
            "scene-0000",
            ".hidden",
            "a b",
            "\u{fc}ber.dat",
            "<img>",
            "console",
            "com",
            "com10",
            "..a",
            "a..b",
        ] {
            assert_eq!(PlainName::parse(Kind::Input, "id", right).unwrap().as_str(), right);
        }
    }

    #[test]
    fn inner_paths_stay_below_their_folder() {
        for wrong in [
            "",
            "/a",
            "a/",
            "a//b",
            "../a",
            "a/../b",
            "a/..",
            "./a",
            "a/./b",
            "a\\..\\b",
            "//host/share",
            "a/nul",
        ] {
            assert_eq!(
                InnerPath::parse(Kind::Input, "path", wrong).unwrap_err().kind(),
                Kind::Input,
                "{wrong:?}"
            );
        }
        let path = InnerPath::parse(Kind::Input, "path", "train/spike/a.dat").unwrap();
        let joined = path.below(Path::new("set"), Access::Write).unwrap();
        assert_eq!(joined, Path::new("set").join("train").join("spike").join("a.dat"));
    }

    #[test]
    fn a_name_in_json_is_checked_when_it_is_read() {
        let name = |text: &str| serde_json::from_str::<PlainName>(text);
        assert_eq!(name("\"scene-0000\"").unwrap().as_str(), "scene-0000");
        let error = name("\"../x\"").unwrap_err().to_string();
        assert!(error.contains("\"../x\", which contains a path separator"), "{error}");
        assert!(serde_json::from_str::<InnerPath>("\"images/000000.png\"").is_ok());
        assert!(serde_json::from_str::<InnerPath>("\"/etc/passwd\"").is_err());
        let long = name(&format!("\"{}\"", "x".repeat(1 << 20))).unwrap_err().to_string();
        assert!(long.len() < 200, "{} bytes", long.len());
    }

    #[cfg(unix)]
    #[test]
    fn links_are_followed_only_as_far_as_allowed() {
        use std::os::unix::fs::symlink;
        let top = tempfile::tempdir().unwrap();
        let folder = top.path().join("set");
        std::fs::create_dir_all(folder.join("real")).unwrap();
        std::fs::create_dir(top.path().join("out")).unwrap();
        symlink("../out", folder.join("away")).unwrap();
        symlink("real", folder.join("near")).unwrap();
        symlink(&folder, top.path().join("named")).unwrap();
        let below =
            |text: &str, access| InnerPath::parse(Kind::Input, "p", text).unwrap().below(&folder, access);
        for (text, read, through, write) in [
            ("real/a", true, true, true),
            ("near/a", true, true, false),
            ("away/a", false, true, false),
            ("away", false, true, false),
        ] {
            assert_eq!(below(text, Access::Read).is_ok(), read, "{text}");
            assert_eq!(below(text, Access::ReadThroughLinks).is_ok(), through, "{text}");
            assert_eq!(below(text, Access::Write).is_ok(), write, "{text}");
        }
        let named = InnerPath::parse(Kind::Input, "p", "real/a")
            .unwrap()
            .below(&top.path().join("named"), Access::Write);
        assert!(named.is_ok(), "the folder that the user names may be a link");
    }
}
