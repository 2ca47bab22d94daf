//! Names and paths that were read from a file.

use std::fmt;
use std::path::{Path, PathBuf};

use crate::error::{Error, Kind, Result};

/// The longest name that all file systems in use accept, in bytes.
const MAX_NAME_BYTES: usize = 255;

/// Names that Windows opens as devices, whatever the ending behind them.
const DEVICES: [&str; 6] = ["CON", "PRN", "AUX", "NUL", "CONIN$", "CONOUT$"];

/// One name of a file or folder that a file from elsewhere may choose: `scene-0000`, never `..`, `a/b` or `C:`.
///
/// The same names are valid on every system, so that a data set made on one can be read on another.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(crate) struct PlainName(String);

/// A path below a folder, of [`PlainName`]s with `/` between them: `train/spike/scene-0000.dat`.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(crate) struct InnerPath(String);

/// What a path below a folder is used for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Access {
    /// Reading. A link may lead to another place below the folder.
    Read,
    /// Reading. A link may lead anywhere, since the user allowed it.
    ReadThroughLinks,
    /// Writing or deleting. No part of the path may be a link.
    Write,
}

impl PlainName {
    /// Accepts `text` as a name; `subject` is the file and key that it was read from.
    ///
    /// # Errors
    /// An error of `kind` that states why `text` is not a plain name.
    pub(crate) fn parse(kind: Kind, subject: impl fmt::Display, text: &str) -> Result<Self> {
        match fault(text) {
            None => Ok(Self(text.to_owned())),
            Some(fault) => Err(Error::new(kind, subject)
                .found(format_args!("{text:?}, which {fault}"))
                .expected("one plain name of a file or folder")),
        }
    }

    pub(crate) fn as_str(&self) -> &str {
        &self.0
    }
}

impl InnerPath {
    /// Accepts `text` as a path below a folder; `subject` is the file and key that it was read from.
    ///
    /// # Errors
    /// An error of `kind` that states why `text` is not such a path.
    pub(crate) fn parse(kind: Kind, subject: impl fmt::Display, text: &str) -> Result<Self> {
        match text.split('/').find_map(fault) {
            None => Ok(Self(text.to_owned())),
            Some(fault) => Err(Error::new(kind, subject)
                .found(format_args!("{text:?}, part of which {fault}"))
                .expected("a path of plain names below the folder, such as train/scene.dat")),
        }
    }

    pub(crate) fn as_str(&self) -> &str {
        &self.0
    }

    /// Returns the path in `folder`, after a look at each link on the way.
    ///
    /// `folder` itself may be a link: the user named it. Parts that do not exist yet are no error.
    ///
    /// # Errors
    /// [`Kind::Input`] when a link leaves the folder, or when `access` is [`Access::Write`] and any part is a link.
    pub(crate) fn below(&self, folder: &Path, access: Access) -> Result<PathBuf> {
        let mut path = folder.to_owned();
        for name in self.0.split('/') {
            path.push(name);
            let is_link = std::fs::symlink_metadata(&path).is_ok_and(|found| found.is_symlink());
            if is_link && !allowed(folder, &path, access) {
                return Err(refused(&path, access));
            }
        }
        Ok(path)
    }
}

impl From<PlainName> for InnerPath {
    fn from(name: PlainName) -> Self {
        Self(name.0)
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

fn allowed(folder: &Path, link: &Path, access: Access) -> bool {
    match access {
        Access::Write => false,
        Access::ReadThroughLinks => true,
        Access::Read => match (folder.canonicalize(), link.canonicalize()) {
            (Ok(folder), Ok(target)) => target.starts_with(folder),
            // A link that leads nowhere shows nothing; opening it reports that.
            _ => true,
        },
    }
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
            .remedy("allow links (--follow-links) if you trust this folder"),
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
