//! The private folder of a method. It contains a copy of one stream, and receives one output.
//!
//! | path | content |
//! |---|---|
//! | `input/stream.dat`, `input/stream.json` | the stream, and its size, layout and rate |
//! | `work/RANDOM/output.npy` | the output |
//! | `work/RANDOM` | folder for temporary files of a process |
//!
//! The names are equal for all sequences, because a name such as `light-0.1` states what a suite tests. A method can change
//! `work`, so the names of its folders are random: a process of an earlier sequence cannot prepare a link with such a name.

use std::fs::OpenOptions;
use std::io::Read as _;
use std::path::{Path, PathBuf};

use serde_json::json;
use spikelane::error::{Error, ErrorKind, Result};
use spikelane::unstable::Count;
use spikelane_io::storage::{OutputSet, open_no_follow};

use super::command_template::SequenceJob;
use crate::generated::GeneratedSequence;
use crate::suite::Task;

const STREAM_FILE: &str = "stream.dat";
const SIDECAR_FILE: &str = "stream.json";

/// The private folder of a method. It is removed when this value is dropped.
pub(super) struct Workspace {
    root: PathBuf,
    claim: Option<OutputSet>,
}

impl Workspace {
    /// Creates the folder in the folder of the system for temporary files.
    pub(super) fn create() -> Result<Self> {
        let parent = std::env::temp_dir();
        let parent = parent.canonicalize().map_err(|e| Error::io(parent.display(), e))?;
        let root = parent.join(format!(".spikelane-{}.{}.partial", random_name()?, std::process::id()));
        create_private(&root)?;
        let mut workspace = Self { root, claim: None };
        workspace.claim = Some(OutputSet::claim_folder(&workspace.root)?);
        create_private(&workspace.input())?;
        create_private(&workspace.work())?;
        Ok(workspace)
    }

    /// Returns the folder that a method can read.
    pub(super) fn root(&self) -> &Path {
        &self.root
    }

    fn input(&self) -> PathBuf {
        self.root.join("input")
    }

    /// Returns the folder that a method can change.
    pub(super) fn work(&self) -> PathBuf {
        self.root.join("work")
    }

    /// Creates an empty folder for temporary files of a process.
    pub(super) fn create_temporary(&self) -> Result<PathBuf> {
        let folder = self.work().join(random_name()?);
        create_private(&folder)?;
        Ok(folder)
    }

    /// Copies a stream and its description, and creates an empty folder for the output.
    ///
    /// The stream is not a hard link, because a method that changes the link would change the suite.
    pub(super) fn prepare<'a>(
        &self,
        stream: &Path,
        sequence: &'a GeneratedSequence,
        task: Task,
    ) -> Result<SequenceJob<'a>> {
        let job = SequenceJob {
            sequence,
            stream: self.input().join(STREAM_FILE),
            output: self.create_temporary()?.join(format!("output{}", task.output_extension())),
        };
        remove(&job.stream);
        std::fs::copy(stream, &job.stream).map_err(|e| Error::io(job.stream.display(), e))?;
        let sidecar = json!({
            "file": STREAM_FILE, "layout": "dat", "width": sequence.width, "height": sequence.height,
            "readouts": sequence.readouts, "readout_hz": sequence.readout_hz, "mosaic": sequence.mosaic,
        });
        let path = self.input().join(SIDECAR_FILE);
        remove(&path);
        std::fs::write(&path, sidecar.to_string()).map_err(|e| Error::io(path.display(), e))?;
        Ok(job)
    }

    /// Returns the bytes of the output, or the fault in one line. Returns `None` if there is no output.
    ///
    /// The process of a server is still running, so the output is opened once and a link is not followed.
    pub(super) fn read_output(
        job: &SequenceJob<'_>,
        max_bytes: u64,
    ) -> std::result::Result<Option<Vec<u8>>, String> {
        let fault = |found: &str, expected: &str| {
            Err(format!("output of the method: found {found}, expected {expected}"))
        };
        let file = match open_no_follow(OpenOptions::new().read(true), &job.output) {
            Ok(file) => file,
            Err(e) if e.io_error().is_some_and(|e| e.kind() == std::io::ErrorKind::NotFound) => {
                return Ok(None);
            }
            Err(e) => match e.io_error() {
                Some(e) => return fault(&e.to_string(), "a file that can be read"),
                None => return fault("a link, folder, pipe or device", "a regular file"),
            },
        };
        let mut bytes = Vec::new();
        match file.take(max_bytes + 1).read_to_end(&mut bytes) {
            Err(e) => fault(&e.to_string(), "a file that can be read"),
            Ok(_) if bytes.len() as u64 > max_bytes => {
                fault(&format!("more than {}", Count(max_bytes, "byte")), "at most this number")
            }
            Ok(_) => Ok(Some(bytes)),
        }
    }

    /// Removes the folder of an output.
    pub(super) fn remove_output(&self, job: &SequenceJob<'_>) {
        job.output.parent().into_iter().for_each(remove);
    }

    /// Removes all files that a method wrote.
    pub(super) fn empty_work(&self) {
        for entry in std::fs::read_dir(self.work()).into_iter().flatten().flatten() {
            remove(&entry.path());
        }
    }
}

impl Drop for Workspace {
    fn drop(&mut self) {
        // Some systems cannot remove a locked file.
        self.claim = None;
        remove(&self.root);
    }
}

/// Removes a file or a folder. A link is removed, and its target remains. What a method protected against removal remains.
fn remove(path: &Path) {
    let is_folder = path.symlink_metadata().is_ok_and(|metadata| metadata.is_dir());
    let _ = if is_folder { std::fs::remove_dir_all(path) } else { std::fs::remove_file(path) };
}

/// Creates a folder that only this user can read.
fn create_private(path: &Path) -> Result<()> {
    let mut builder = std::fs::DirBuilder::new();
    #[cfg(unix)]
    std::os::unix::fs::DirBuilderExt::mode(&mut builder, 0o700);
    builder.create(path).map_err(|e| Error::io(path.display(), e))
}

fn random_name() -> Result<String> {
    let mut bytes = [0; 8];
    getrandom::fill(&mut bytes)
        .map_err(|e| Error::new(ErrorKind::Io, "random numbers of the system").found(e))?;
    Ok(format!("{:016x}", u64::from_le_bytes(bytes)))
}
