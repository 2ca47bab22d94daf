//! Names and paths that come from a file.

use std::fmt;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::error::{Error, ErrorKind, Result, error, excerpt};

/// Length in bytes of the longest name that all common file systems accept.
const MAX_NAME_BYTES: usize = 255;

/// Ending of the hidden name of a file or folder that is incomplete. Only entries with this ending are removed without a
/// request to replace them, so the ending contains the name of the program.
pub const PARTIAL_ENDING: &str = ".spikelane.partial";

/// Names that Windows opens as devices, even if an extension follows.
const DEVICES: [&str; 6] = ["CON", "PRN", "AUX", "NUL", "CONIN$", "CONOUT$"];

/// A file or folder name that comes from an untrusted file, for example `scene-0000`. `..`, `a/b` and `C:` are rejected.
///
/// The rules for names are equal on all operating systems, so every system can read a data set from another system.
#[derive(Clone, Debug, Deserialize, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize)]
#[serde(try_from = "String", into = "String")]
pub struct PlainName(String);

/// A path inside a folder: [`PlainName`]s separated by `/`, for example `train/spike/scene-0000.dat`.
///
/// An inner path is built from checked texts and from constants of the program, never from an unchecked text.
#[derive(Clone, Debug, Deserialize, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize)]
#[serde(try_from = "String", into = "String")]
pub struct InnerPath(String);

/// The purpose for which a path inside a folder is used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// Reading. A link may point to another position inside the folder.
    Read,
    /// Reading. A link may point to any position, because the user allowed it.
    ReadThroughLinks,
    /// Writing or deleting. No part of the path may be a link.
    Write,
}

impl Access {
    /// Returns the access mode for reading. If `follow_links` is true, a link may leave the folder.
    pub const fn for_reading(follow_links: bool) -> Self {
        if follow_links { Self::ReadThroughLinks } else { Self::Read }
    }
}

impl PlainName {
    /// Accepts `text` as a name. `subject` names the file and the key that contain `text`.
    ///
    /// # Errors
    /// Returns an error of `kind` with the reason why `text` is not a plain name.
    pub fn parse(kind: ErrorKind, subject: impl fmt::Display, text: &str) -> Result<Self> {
        match name_fault(text) {
            None => Ok(Self(text.to_owned())),
            Some(fault) => Err(Error::new(kind, subject)
                .found(format_args!("a name that {fault}: {text:?}"))
                .expected("the name of a file or folder, without a path")),
        }
    }

    /// Returns the decimal digits of `number`, padded with zeros to `width` digits.
    pub fn from_number(from_number: u64, width: usize) -> Self {
        Self(format!("{from_number:0width$}"))
    }

    /// Returns this name followed by `ending`, such as `.dat`.
    pub fn with_ending(&self, ending: &'static str) -> Self {
        Self(format!("{}{ending}", self.0))
    }

    /// Returns the hidden name that a file or folder has while the file or folder is incomplete.
    pub fn partial_name(&self) -> Self {
        Self(format!(".{}{PARTIAL_ENDING}", self.0))
    }

    /// Returns the name as text.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl InnerPath {
    /// Accepts `text` as a path inside a folder. `subject` names the file and the key that contain `text`.
    ///
    /// # Errors
    /// Returns an error of `kind` with the reason why `text` is not a path inside a folder.
    pub fn parse(kind: ErrorKind, subject: impl fmt::Display, text: &str) -> Result<Self> {
        match text.split('/').find_map(name_fault) {
            None => Ok(Self(text.to_owned())),
            Some(fault) => Err(Error::new(kind, subject)
                .found(format_args!("a path, part of which {fault}: {text:?}"))
                .expected("a relative path inside the folder, such as train/scene.dat")),
        }
    }

    /// Returns the path of `inner` inside the folder at this path.
    pub fn join(&self, inner: impl Into<Self>) -> Self {
        Self(format!("{}/{}", self.0, inner.into().0))
    }

    /// Returns the path as text with `/` as separator.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }

    /// Returns the path in `folder`. Every link along the path is checked first.
    ///
    /// `folder` itself may be a link, because the user named this folder. Parts of the path need not exist.
    ///
    /// # Errors
    /// Returns [`ErrorKind::Input`] if a link leaves the folder, or if `access` is [`Access::Write`] and any part is a link.
    pub fn resolve_in(&self, folder: &Path, access: Access) -> Result<PathBuf> {
        let (mut path, last) = self.checked_parent(folder, access)?;
        path.push(last);
        check_link(folder, &path, access)?;
        Ok(path)
    }

    /// Returns the path in `folder` of a file or link to remove.
    ///
    /// If the last part is a link, the caller removes the link and not its target.
    ///
    /// # Errors
    /// Returns [`ErrorKind::Input`] if a part of the path before the last one is a link.
    pub fn resolve_for_removal(&self, folder: &Path) -> Result<PathBuf> {
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

/// Accepts a path that is a constant of the program.
impl From<&'static str> for InnerPath {
    fn from(path: &'static str) -> Self {
        debug_assert!(path.split('/').find_map(name_fault).is_none(), "{path}");
        Self(path.to_owned())
    }
}

impl TryFrom<String> for PlainName {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        match name_fault(&text) {
            None => Ok(Self(text)),
            Some(fault) => Err(format!("a name that {fault}: {:?}", excerpt(&text))),
        }
    }
}

impl TryFrom<String> for InnerPath {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        match text.split('/').find_map(name_fault) {
            None => Ok(Self(text)),
            Some(fault) => Err(format!("a path, part of which {fault}: {:?}", excerpt(&text))),
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

/// Checks that `path`, which is inside `folder`, is not a link that `access` forbids.
///
/// # Errors
/// Returns [`ErrorKind::Input`] if `access` forbids the link.
pub fn check_link(folder: &Path, path: &Path, access: Access) -> Result<()> {
    let is_link = std::fs::symlink_metadata(path).is_ok_and(|metadata| metadata.is_symlink());
    if is_link && !is_link_allowed(folder, path, access) { Err(link_error(path, access)) } else { Ok(()) }
}

fn is_link_allowed(folder: &Path, link: &Path, access: Access) -> bool {
    match access {
        Access::Write => false,
        Access::ReadThroughLinks => true,
        Access::Read => match (or_current_dir(folder).canonicalize(), link.canonicalize()) {
            (Ok(folder), Ok(target)) => target.starts_with(folder),
            // A broken link exposes no data, and the later attempt to open the link reports the error.
            _ => true,
        },
    }
}

/// Returns `folder`, or `.` if `folder` is the empty path. Both mean the current directory.
fn or_current_dir(folder: &Path) -> &Path {
    if folder.as_os_str().is_empty() { Path::new(".") } else { folder }
}

fn link_error(link: &Path, access: Access) -> Error {
    let error = error!(Input, "{}", link.display());
    match access {
        Access::Write => error
            .found("a symbolic link")
            .expected("a plain file or folder; links are never followed when files are written or deleted")
            .remedy("remove the link, or specify the target folder of the link"),
        _ => error
            .found("a symbolic link that points outside the folder")
            .expected("a file inside the folder")
            .remedy(
                "copy the file into the folder; if you trust the folder, allow links that leave the folder",
            ),
    }
}

/// Returns the reason why `name` is not a plain name, in a form that completes the sentence "the name ...".
fn name_fault(name: &str) -> Option<&'static str> {
    let stem = name.split('.').next().unwrap_or_default().trim_end();
    if name.is_empty() {
        Some("is empty")
    } else if name == "." || name == ".." {
        Some("is the folder itself or its parent")
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
                PlainName::parse(ErrorKind::Config, "id", wrong).unwrap_err().kind(),
                ErrorKind::Config,
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
            assert_eq!(PlainName::parse(ErrorKind::Input, "id", right).unwrap().as_str(), right);
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
                InnerPath::parse(ErrorKind::Input, "path", wrong).unwrap_err().kind(),
                ErrorKind::Input,
                "{wrong:?}"
            );
        }
        let path = InnerPath::parse(ErrorKind::Input, "path", "train/spike/a.dat").unwrap();
        let joined = path.resolve_in(Path::new("set"), Access::Write).unwrap();
        assert_eq!(joined, Path::new("set").join("train").join("spike").join("a.dat"));
    }

    #[test]
    fn a_name_in_json_is_checked_when_it_is_read() {
        let name = |text: &str| serde_json::from_str::<PlainName>(text);
        assert_eq!(name("\"scene-0000\"").unwrap().as_str(), "scene-0000");
        let error = name("\"../x\"").unwrap_err().to_string();
        assert!(error.contains("a name that contains a path separator: \"../x\""), "{error}");
        assert!(serde_json::from_str::<InnerPath>("\"images/000000.png\"").is_ok());
        assert!(serde_json::from_str::<InnerPath>("\"/etc/passwd\"").is_err());
        let long = name(&format!("\"{}\"", "x".repeat(1 << 20))).unwrap_err().to_string();
        assert!(long.len() < 300, "{} bytes", long.len());
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
        let below = |text: &str, access| {
            InnerPath::parse(ErrorKind::Input, "p", text).unwrap().resolve_in(&folder, access)
        };
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
        let named = InnerPath::parse(ErrorKind::Input, "p", "real/a")
            .unwrap()
            .resolve_in(&top.path().join("named"), Access::Write);
        assert!(named.is_ok(), "the folder that the user names may be a link");
    }
}
