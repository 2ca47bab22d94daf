//! Interprets the flag `-o`. The flag determines the stream layout and the common part of the file names of a
//! simulation.

use std::path::{Path, PathBuf};

use spikelane::{Error, ErrorKind, Result};
use spikelane_io::formats::Layout;

/// Extensions of formats that a user may expect but this program does not write.
const FOREIGN_EXTENSIONS: [&str; 12] =
    ["npz", "h5", "hdf5", "mp4", "mkv", "avi", "mov", "raw", "aedat4", "png", "json", "zip"];

/// The common beginning of all file names of a simulation, and the layout of its streams.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct OutputStem {
    pub path: PathBuf,
    pub layout: Layout,
}

impl OutputStem {
    /// Interprets `output`, the value of the flag `-o`. For example, `run` is a stem, and `run.dat` and `run.npy` are
    /// names of a stream. `d/` is a folder, and the stem in this folder is `name`.
    ///
    /// # Errors
    /// [`ErrorKind::Usage`] if the extension contradicts the layout `to`, or if the program cannot write files with
    /// this extension.
    pub(crate) fn new(output: &Path, to: Option<Layout>, name: &str) -> Result<Self> {
        if is_folder(output) {
            return Ok(Self { path: output.join(name), layout: to.unwrap_or_default() });
        }
        let ending = output.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
        let Some(meant) =
            [Layout::Dat, Layout::NpyBytes].into_iter().find(|l| l.default_extension() == ending)
        else {
            if FOREIGN_EXTENSIONS.contains(&&*ending) {
                return Err(cannot_write(output, &ending));
            }
            return Ok(Self { path: output.to_owned(), layout: to.unwrap_or_default() });
        };
        match to {
            Some(to) if to.default_extension() != ending => {
                Err(Error::new(ErrorKind::Usage, output.display())
                    .found(format_args!("the extension .{ending} and --to {to}"))
                    .expected(format_args!(
                        "the extension .{} for this layout, or a name without an extension",
                        to.default_extension()
                    )))
            }
            _ => Ok(Self { path: output.with_extension(""), layout: to.unwrap_or(meant) }),
        }
    }

    /// Returns the path with `ending` appended (see [`append_ending`]).
    pub(crate) fn with_ending(&self, ending: &str) -> PathBuf {
        append_ending(&self.path, ending)
    }
}

/// Returns `stem` with `ending` appended. Any existing extension remains, because a stem can contain dots.
pub(crate) fn append_ending(stem: &Path, ending: &str) -> PathBuf {
    let mut full_path = stem.as_os_str().to_os_string();
    full_path.push(ending);
    PathBuf::from(full_path)
}

fn is_folder(output: &Path) -> bool {
    let slash = output.as_os_str().to_string_lossy().ends_with(std::path::is_separator);
    slash || output.file_name().is_none()
}

fn cannot_write(output: &Path, ending: &str) -> Error {
    Error::new(ErrorKind::Usage, output.display())
        .found(format_args!("the extension .{ending}, which no writable stream format has"))
        .expected("a name without an extension such as out/run, a folder such as out/, or a name that ends in .dat or .npy")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stem(output: &str, to: Option<Layout>) -> Result<(String, Layout)> {
        OutputStem::new(Path::new(output), to, "clip").map(|s| (s.path.display().to_string(), s.layout))
    }

    #[test]
    fn a_stem_a_file_and_a_folder_are_told_apart() {
        let parsed = |output, to| stem(output, to).unwrap();
        assert_eq!(parsed("out/run", None), ("out/run".into(), Layout::Dat));
        assert_eq!(parsed("run.v2", None), ("run.v2".into(), Layout::Dat));
        assert_eq!(parsed("run.dat", None), ("run".into(), Layout::Dat));
        assert_eq!(parsed("run.dat", Some(Layout::DatTop)), ("run".into(), Layout::DatTop));
        assert_eq!(parsed("run.npy", None), ("run".into(), Layout::NpyBytes));
        assert_eq!(parsed("run.npy", Some(Layout::NpyBits)), ("run".into(), Layout::NpyBits));
        assert_eq!(parsed("d/", None), ("d/clip".into(), Layout::Dat));
        assert_eq!(parsed(".", None), ("./clip".into(), Layout::Dat));
    }

    #[test]
    fn a_misleading_extension_is_refused() {
        for (output, to) in [
            ("run.npz", None),
            ("run.h5", None),
            ("run.npy", Some(Layout::Dat)),
            ("run.dat", Some(Layout::NpyBits)),
        ] {
            assert_eq!(stem(output, to).unwrap_err().kind(), ErrorKind::Usage, "{output}");
        }
    }
}
