//! The names of outputs, and claims of outputs.

use std::path::{Path, PathBuf};

use serde_json::Value;
use spikelane::{Error, ErrorKind, Result};
use spikelane_io::formats::Layout;
use spikelane_io::storage::{self, FileGroup, OutputSet};

use super::console::flag;
use super::progress::stop_flag;

/// Claims files (see [`OutputSet::claim`]). Also installs the signal handlers, because an interrupted command must remove
/// its locks.
pub(crate) fn claim_files<P: AsRef<Path>>(
    files: impl IntoIterator<Item = P>,
    force: bool,
) -> Result<OutputSet> {
    stop_flag()?;
    OutputSet::claim(files, force)
}

/// Claims a folder (see [`OutputSet::claim_folder`]). Installs the signal handlers as [`claim_files`] does.
pub(crate) fn claim_folder(folder: &Path) -> Result<OutputSet> {
    stop_flag()?;
    OutputSet::claim_folder(folder)
}

/// The HTML report of a command and the JSON file beside it. Both are claimed while this value lives.
pub(crate) struct ReportFiles {
    page: PathBuf,
    json: PathBuf,
    force: bool,
    _claim: OutputSet,
}

impl ReportFiles {
    /// Claims the files of the report `page`, if the user requested one.
    ///
    /// # Errors
    /// [`ErrorKind::Usage`] if the page has the extension of the JSON file, and the errors of [`OutputSet::claim`].
    pub(crate) fn claim(page: Option<&Path>, force: bool) -> Result<Option<Self>> {
        let Some(page) = page else { return Ok(None) };
        if page.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("json")) {
            return Err(Error::new(ErrorKind::Usage, flag("report"))
                .found("a name with the ending of the JSON file beside the page")
                .expected("the name of an HTML file, such as report.html"));
        }
        let json = page.with_extension("json");
        let claim = claim_files([page, &json], force)?;
        Ok(Some(Self { page: page.to_owned(), json, force, _claim: claim }))
    }

    /// Writes both files, or none of them.
    pub(crate) fn write(&self, html: &str, json: &Value) -> Result<()> {
        let mut group = FileGroup::new(self.force);
        group.write(&self.page, html.as_bytes())?;
        group.write(&self.json, format!("{json:#}\n").as_bytes())?;
        group.commit()
    }
}

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

/// Replaces the text between two marker lines of a page.
///
/// # Errors
/// [`ErrorKind::Input`] if the page lacks a marker line.
pub(crate) fn replace_between_markers(path: &Path, (begin, end): (&str, &str), text: &str) -> Result<()> {
    let old = std::fs::read_to_string(path).map_err(|e| Error::io(path.display(), e))?;
    let parts = old.split_once(begin).and_then(|(before, rest)| Some((before, rest.split_once(end)?.1)));
    let Some((before, after)) = parts else {
        return Err(Error::new(ErrorKind::Input, path.display())
            .found("no marker lines")
            .expected(format_args!("the lines {} and {}", begin.trim_end(), end.trim_end())));
    };
    storage::write_small(path, format!("{before}{begin}{text}{end}{after}").as_bytes(), true)
}

/// The file names that begin with one stem.
pub(crate) struct OutputNames {
    pub stream: PathBuf,
    pub clean_stream: PathBuf,
    pub sidecar: PathBuf,
    pub picture: PathBuf,
    pub camera: PathBuf,
    pub images: PathBuf,
}

impl OutputNames {
    pub(crate) fn new(stem: &OutputStem) -> Self {
        let name = |ending: &str| stem.with_ending(ending);
        let data = stem.layout.default_extension();
        Self {
            stream: name(&format!(".{data}")),
            clean_stream: name(&format!(".clean.{data}")),
            sidecar: name(".json"),
            picture: name(".png"),
            camera: name(".camera"),
            images: name(".images"),
        }
    }

    /// Returns the files of a simulation. `clean` is whether they include the clean stream.
    pub(crate) fn files(&self, clean: bool) -> Vec<&Path> {
        let all =
            [(&self.stream, true), (&self.clean_stream, clean), (&self.sidecar, true), (&self.picture, true)];
        all.into_iter().filter(|(_, wanted)| *wanted).map(|(path, _)| path.as_path()).collect()
    }

    /// Claims the files of a simulation. Returns an error if the folder of reference images exists and `force` is false.
    pub(crate) fn claim(&self, clean: bool, images: bool, force: bool) -> Result<OutputSet> {
        if images && !force && self.images.symlink_metadata().is_ok() {
            return Err(Error::new(ErrorKind::Exists, self.images.display())
                .found("a folder of that name")
                .expected("a path that does not exist")
                .remedy("choose another output, or pass --force to replace the folder"));
        }
        claim_files(self.files(clean), force)
    }
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
