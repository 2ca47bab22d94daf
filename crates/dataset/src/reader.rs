//! Opens the sequences of a dataset. Sequences are in folders or in packed shards, and both are read in the same way.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use crate::fingerprint::exists;
use crate::labels::{LabeledFrame, read_labeled_frames};
use crate::manifest::{self, DatasetDigest, SequenceEntry};
use crate::pack_schema::{self, SampleDescription};
use crate::record;
use crate::shards::{ShardPlan, read_plan_entries, read_shard_entries};
use crate::tar_index::TarIndex;
use crate::{Manifest, SequenceRecord, SequenceStatus};
use spikelane::error::{Error, ErrorKind, Result};
use spikelane::unstable::inputs::{
    Access, InnerPath, InputFile, MAX_TEXT_BYTES, PlainName, not_found_as_none, utf8_bytes,
};
use spikelane_io::formats::{OpenOptions, StreamReader};
use spikelane_io::simulate::Sidecar;

/// Reads the sequences of a dataset, of a plan whose shards are finished, of one shard, or of one packed shard.
///
/// Packed sequences are read from the tar in place and not unpacked.
#[derive(Debug)]
pub struct DatasetReader {
    folder: PathBuf,
    access: Access,
    entries: Vec<SequenceEntry>,
    /// The tar that contains all sequences. `None` if the entries determine the places of the sequences.
    tar: Option<PathBuf>,
    /// The tar that was read last. Consecutive sequences are usually in the same tar.
    open_tar: Mutex<Option<(PathBuf, Arc<TarIndex>)>>,
}

impl DatasetReader {
    /// Opens the dataset at `path`. This is the folder of a dataset, a plan or a shard, or the tar of a shard.
    ///
    /// If `follow_links` is true, files may be links to files outside the folder.
    ///
    /// # Errors
    /// * [`ErrorKind::Io`] if there is no manifest.
    /// * [`ErrorKind::Config`] if the manifest is invalid.
    /// * [`ErrorKind::Input`] if shards of a plan are not finished.
    /// * [`ErrorKind::Input`] if the tar is not a packed shard.
    pub fn open(path: &Path, follow_links: bool) -> Result<Self> {
        let access = Access::for_reading(follow_links);
        let new =
            |entries, tar| Self { folder: path.to_owned(), access, entries, tar, open_tar: Mutex::new(None) };
        if path.is_file() {
            let tar = TarIndex::read(InputFile::open(path)?)?;
            return Ok(new(tar_entries(path, &tar)?, Some(path.to_owned())));
        }
        if let Some((entries, tar)) = read_shard_entries(path, access)? {
            return Ok(new(entries, tar));
        }
        let has_file = |name: &'static str| {
            InnerPath::from(name).resolve_in(path, access).and_then(|file| exists(&file))
        };
        if !has_file(manifest::FILE_NAME)? && has_file(ShardPlan::FILE_NAME)? {
            return Ok(new(read_plan_entries(&ShardPlan::open(path, access)?)?, None));
        }
        Ok(new(Manifest::read(path, access)?.entries, None))
    }

    /// Returns the entries of all sequences.
    #[must_use]
    pub fn entries(&self) -> &[SequenceEntry] {
        &self.entries
    }

    /// Returns the entries of the finished sequences.
    #[must_use]
    pub fn done_entries(&self) -> Vec<&SequenceEntry> {
        self.entries.iter().filter(|entry| entry.status == SequenceStatus::Done).collect()
    }

    /// Returns the digest of the dataset; see [`Manifest::dataset_digest`].
    #[must_use]
    pub fn dataset_digest(&self) -> String {
        let mut digest = DatasetDigest::default();
        self.entries.iter().for_each(|entry| digest.add(entry));
        digest.text()
    }

    /// Opens the sequence of `entry`, which must be finished.
    ///
    /// # Errors
    /// * [`ErrorKind::Input`] for a link that leaves the folder.
    /// * [`ErrorKind::Input`] if the tar is damaged or does not contain the sequence.
    pub fn sequence(&self, entry: &SequenceEntry) -> Result<SequenceFiles> {
        let tar = match (&self.tar, &entry.shard) {
            (Some(tar), _) => tar.clone(),
            (None, None) => return self.folder_of(entry),
            (None, Some(shard)) => {
                let tar = InnerPath::from("shards").join(shard.with_ending(".tar"));
                let tar = tar.resolve_in(&self.folder, self.access)?;
                // The shard is not packed, or a user has unpacked and removed the tar.
                if !tar.is_file() {
                    return self.folder_of(entry);
                }
                tar
            }
        };
        SequenceFiles::in_tar(&self.index(&tar)?, &tar, &entry.id)
    }

    fn folder_of(&self, entry: &SequenceEntry) -> Result<SequenceFiles> {
        let folder = entry.path().resolve_in(&self.folder, self.access)?;
        Ok(SequenceFiles::in_folder(folder, self.access))
    }

    fn index(&self, path: &Path) -> Result<Arc<TarIndex>> {
        let mut open_tar = self.open_tar.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((open, index)) = &*open_tar
            && open == path
        {
            return Ok(Arc::clone(index));
        }
        let index = Arc::new(TarIndex::read(InputFile::open(path)?)?);
        *open_tar = Some((path.to_owned(), Arc::clone(&index)));
        Ok(index)
    }
}

/// Returns the entries of the sequences of a packed shard, read from their descriptions.
fn tar_entries(path: &Path, tar: &TarIndex) -> Result<Vec<SequenceEntry>> {
    let mut entries = Vec::new();
    for name in tar.names() {
        // A name with a second dot is another member of the sequence, such as `scene-0000.files.tar`.
        let Some((_, pack_schema::DESCRIPTION)) = name.split_once('.') else { continue };
        let place = path.join(name);
        let file = tar.open(name, place.clone())?;
        let text = file.read_all("a description", pack_schema::MAX_DESCRIPTION_BYTES)?;
        let description: SampleDescription = serde_json::from_slice(&utf8_bytes(&text)).map_err(|e| {
            Error::new(ErrorKind::Corrupt, place.display())
                .found(e)
                .expected("a description written by this version")
                .remedy("use the version of spikelane that packed the shard, or generate the shard again")
        })?;
        entries.push(description.entry(place.display())?);
    }
    if entries.is_empty() {
        return Err(Error::new(ErrorKind::Input, path.display())
            .found("a tar without descriptions of sequences")
            .expected("a packed shard"));
    }
    Ok(entries)
}

/// The files of one sequence, in a folder or in a packed shard.
#[derive(Debug)]
pub struct SequenceFiles {
    place: Place,
}

#[derive(Debug)]
enum Place {
    Folder { folder: PathBuf, access: Access },
    Tar { shard: Arc<TarIndex>, id: PlainName, inner: TarIndex, path: PathBuf },
}

impl SequenceFiles {
    /// Returns the files in the folder of a sequence.
    pub(super) const fn in_folder(folder: PathBuf, access: Access) -> Self {
        Self { place: Place::Folder { folder, access } }
    }

    fn in_tar(shard: &Arc<TarIndex>, tar: &Path, id: &PlainName) -> Result<Self> {
        let path = tar.join(id.as_str());
        let name = pack_schema::member_name(id, pack_schema::INNER_TAR);
        let inner =
            not_found_as_none(shard.open(name.as_str(), tar.join(name.as_str())))?.ok_or_else(|| {
                Error::new(ErrorKind::Input, tar.display())
                    .found(format_args!("no {name}"))
                    .expected("a shard that this version packed and that contains the sequence")
                    .remedy("generate the shard again")
            })?;
        let place =
            Place::Tar { shard: Arc::clone(shard), id: id.clone(), inner: TarIndex::read(inner)?, path };
        Ok(Self { place })
    }

    /// Opens the file `path` of the sequence, such as `labels/000012.depth.npy`.
    ///
    /// # Errors
    /// * [`ErrorKind::Io`] if the file does not exist.
    /// * [`ErrorKind::Input`] for a link that leaves the folder.
    pub fn open(&self, path: &InnerPath) -> Result<InputFile> {
        match &self.place {
            Place::Folder { folder, access } => InputFile::open(&path.resolve_in(folder, *access)?),
            Place::Tar { shard, id, inner, path: place } => {
                let shown = place.join(path.as_str());
                match pack_schema::file_member(path) {
                    Some(ending) => shard.open(pack_schema::member_name(id, ending).as_str(), shown),
                    None => inner.open(path.as_str(), shown),
                }
            }
        }
    }

    /// Reads the record. The files are not verified.
    ///
    /// # Errors
    /// As [`open`](Self::open), and [`ErrorKind::Config`] if the record is invalid.
    pub fn record(&self) -> Result<SequenceRecord> {
        let file = self.open(&record::FILE_NAME.into())?;
        SequenceRecord::parse(file.path(), &file.read_all("a record", record::MAX_RECORD_BYTES)?)
    }

    /// Reads the common sidecar of both streams.
    ///
    /// # Errors
    /// As [`open`](Self::open), and [`ErrorKind::Config`] if the sidecar is invalid.
    pub fn sidecar(&self) -> Result<Sidecar> {
        let file = self.sidecar_file()?;
        Sidecar::parse(file.path(), &file.read_all("a sidecar", MAX_TEXT_BYTES)?)
    }

    /// Opens the noisy stream `stream.dat` or the clean stream `stream.clean.dat`.
    ///
    /// # Errors
    /// As [`open`](Self::open) and [`OpenOptions::open_with_sidecar`].
    pub fn stream(&self, file: &'static str, options: &OpenOptions) -> Result<StreamReader> {
        let sidecar = self.sidecar_file()?;
        let text = sidecar.read_all("a sidecar", MAX_TEXT_BYTES)?;
        options.open_with_sidecar(self.open(&file.into())?, &text, sidecar.path().to_owned())
    }

    fn sidecar_file(&self) -> Result<InputFile> {
        self.open(&"stream.json".into())
    }

    /// Reads the labeled readouts. If the sequence has no labels, the result is empty.
    pub(super) fn labeled_frames(&self) -> Result<Vec<LabeledFrame>> {
        let file = not_found_as_none(self.open(&"labels/labels.json".into()))?;
        file.map_or(Ok(Vec::new()), |file| read_labeled_frames(&file))
    }
}
