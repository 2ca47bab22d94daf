//! The streams and data sets that the user named.

use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use serde_json::{Value, json};
use spikelane::error::{Error, ErrorKind, Result, bail, error};
use spikelane::sensor::Mosaic;
use spikelane::unstable::inputs::{InputFile, not_found_as_none};
use spikelane::unstable::npy;
use spikelane_calibrate::{ColorFilters, RecordingSet, Stimulus};
use spikelane_dataset::{Access, DatasetReader, InnerPath, SequenceEntry, SequenceFiles};
use spikelane_io::formats::{OpenOptions, StreamReader};
use spikelane_io::simulate::Sidecar;

use crate::live::LiveStream;
use crate::query::StreamKey;

/// Number of streams that stay open.
const MAX_OPEN_STREAMS: usize = 16;

/// Largest number of streams in a folder.
const MAX_FOLDER_STREAMS: usize = 1000;

/// Largest report page in bytes.
const MAX_REPORT_BYTES: u64 = 64 << 20;

/// Name of the recording set in a folder that `record` wrote.
const SET_FILE: &str = "recordings.toml";

/// Options for opening paths.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct SourceOptions {
    /// Layout and size of stream files.
    pub open: OpenOptions,
    /// Readouts per second of streams without a sidecar.
    pub readout_hz: Option<f64>,
}

spikelane::unstable::with_methods!(SourceOptions {
    with_open: open: OpenOptions,
    with_readout_hz: readout_hz: Option<f64>,
});

/// An open stream.
pub(crate) struct OpenStream {
    pub(crate) reader: StreamReader,
    pub(crate) readout_hz: Option<f64>,
    /// Color filters that the sidecar or the recording set states.
    pub(crate) mosaic: Option<Mosaic>,
    /// Problems of the file that affect the images.
    pub(crate) warnings: Vec<String>,
}

/// A path that the user named.
struct Source {
    /// File name without its folders.
    name: String,
    content: Content,
}

enum Content {
    Stream(Arc<OpenStream>),
    Dataset { reader: DatasetReader, sequences: Vec<SequenceEntry> },
    Recordings(RecordingSet),
    Folder { folder: PathBuf, streams: Vec<InnerPath>, report: Option<InnerPath> },
    Live(LiveStream),
}

/// The opened paths. Requests name a path by its index.
///
/// # Examples
/// ```
/// use spikelane_view::{SourceOptions, Sources};
/// let folder = tempfile::tempdir().map_err(|e| spikelane::Error::io("folder", e))?;
/// let path = folder.path().join("empty.npy");
/// let error = Sources::open(&[path.clone()], &SourceOptions::default()).unwrap_err();
/// assert_eq!(error.kind(), spikelane::ErrorKind::Io); // The file does not exist.
/// # Ok::<(), spikelane::Error>(())
/// ```
pub struct Sources {
    list: Vec<Source>,
    options: SourceOptions,
    open: Mutex<VecDeque<(StreamKey, Arc<OpenStream>)>>,
}

impl std::fmt::Debug for Sources {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_list().entries(self.list.iter().map(|s| &s.name)).finish()
    }
}

impl Sources {
    /// Opens streams, data sets, packed shards, recording sets, output folders and `shm:NAME` for live cameras.
    ///
    /// # Errors
    /// Errors of the readers. [`ErrorKind::Input`] if a folder contains nothing that the viewer displays.
    pub fn open(paths: &[PathBuf], options: &SourceOptions) -> Result<Self> {
        let list = paths.iter().map(|path| Source::open(path, options)).collect::<Result<_>>()?;
        Ok(Self { list, options: options.clone(), open: Mutex::default() })
    }

    /// Returns the warnings of the streams that are paths.
    #[must_use]
    pub fn warnings(&self) -> Vec<String> {
        let streams = self.list.iter().filter_map(|source| match &source.content {
            Content::Stream(stream) => Some((&source.name, stream)),
            _ => None,
        });
        streams.flat_map(|(name, s)| s.warnings.iter().map(move |w| format!("{name}: {w}"))).collect()
    }

    /// Returns the description of all paths for the page.
    pub(crate) fn to_json(&self) -> Value {
        let sources = self.list.iter().map(|source| {
            let (kind, items) = match &source.content {
                Content::Stream(_) => ("stream", Vec::new()),
                Content::Live(_) => ("live", Vec::new()),
                Content::Dataset { sequences, .. } => ("dataset", sequences.iter().map(sequence_json).collect()),
                Content::Recordings(set) => {
                    let item = |r: &spikelane_calibrate::Recording| json!({"name": r.file, "light": light_json(r.light)});
                    ("recordings", set.recordings.iter().map(item).collect())
                }
                Content::Folder { streams, .. } => {
                    ("folder", streams.iter().map(|path| json!({"name": path.as_str()})).collect())
                }
            };
            let has_report = matches!(&source.content, Content::Folder { report: Some(_), .. });
            json!({"name": source.name, "kind": kind, "items": items, "has_report": has_report})
        });
        json!({"sources": sources.collect::<Vec<_>>(), "version": env!("CARGO_PKG_VERSION")})
    }

    fn source(&self, index: usize) -> Result<&Source> {
        self.list.get(index).ok_or_else(|| not_listed(format_args!("path {index}"), self.list.len()))
    }

    /// Returns the live stream of path `index`. `None` if the path is not a live stream.
    pub(crate) fn live(&self, index: usize) -> Result<Option<&LiveStream>> {
        Ok(match &self.source(index)?.content {
            Content::Live(live) => Some(live),
            _ => None,
        })
    }

    /// Returns the stream of `key`. Recently used streams stay open.
    pub(crate) fn stream(&self, key: StreamKey) -> Result<Arc<OpenStream>> {
        if let (Content::Stream(stream), None, false) =
            (&self.source(key.source)?.content, key.item, key.is_clean)
        {
            return Ok(Arc::clone(stream));
        }
        let mut open = self.open.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(at) = open.iter().position(|(k, _)| *k == key)
            && let Some(found) = open.remove(at)
        {
            let stream = Arc::clone(&found.1);
            open.push_back(found);
            return Ok(stream);
        }
        let stream = Arc::new(self.open_item(key)?);
        if open.len() >= MAX_OPEN_STREAMS {
            open.pop_front();
        }
        open.push_back((key, Arc::clone(&stream)));
        Ok(stream)
    }

    fn open_item(&self, key: StreamKey) -> Result<OpenStream> {
        let (source, index) = (self.source(key.source)?, key.item.unwrap_or(usize::MAX));
        let missing = |count| not_listed(format_args!("item {index} of {}", source.name), count);
        match &source.content {
            Content::Dataset { .. } => {
                let files = self.sequence(key)?;
                let name = if key.is_clean { "stream.clean.dat" } else { "stream.dat" };
                let reader = files.stream(name, &OpenOptions::default())?;
                let sidecar = files.sidecar()?;
                Ok(OpenStream::new(reader, sidecar.readout_hz).with_mosaic(color_filters(&sidecar)))
            }
            Content::Recordings(set) if !key.is_clean => {
                let recording = set.recordings.get(index).ok_or_else(|| missing(set.recordings.len()))?;
                let mosaic = match set.color_filters() {
                    Ok(ColorFilters::Mosaic(mosaic)) => Some(mosaic),
                    _ => None,
                };
                Ok(OpenStream::new(set.reader(recording)?, Some(set.readout_hz)).with_mosaic(mosaic))
            }
            Content::Folder { folder, streams, .. } if !key.is_clean => {
                let inner = streams.get(index).ok_or_else(|| missing(streams.len()))?;
                OpenStream::open(&inner.resolve_in(folder, Access::for_reading(false))?, &self.options)
            }
            _ => Err(missing(0)),
        }
    }

    /// Returns the files of a sequence of a data set.
    pub(crate) fn sequence(&self, key: StreamKey) -> Result<SequenceFiles> {
        let source = self.source(key.source)?;
        let (Content::Dataset { reader, sequences }, Some(item)) = (&source.content, key.item) else {
            return Err(not_listed("a sequence", 0));
        };
        let entry = sequences
            .get(item)
            .ok_or_else(|| not_listed(format_args!("sequence {item}"), sequences.len()))?;
        reader.sequence(entry)
    }

    /// Returns the report page of an output folder.
    pub(crate) fn report(&self, index: usize) -> Result<Vec<u8>> {
        match &self.source(index)?.content {
            Content::Folder { folder, report: Some(report), .. } => {
                InputFile::open(&report.resolve_in(folder, Access::for_reading(false))?)?
                    .read_all("a report", MAX_REPORT_BYTES)
            }
            _ => Err(not_listed("a report", 0)),
        }
    }

    /// Returns the number of readouts of the only path.
    ///
    /// # Errors
    /// [`ErrorKind::Usage`] if there are several paths, or if the path is not a stream file.
    pub fn only_readouts(&self) -> Result<usize> {
        Ok(self.only_stream()?.1.reader.readouts())
    }

    /// Returns the only stream, for an export.
    pub(crate) fn only_stream(&self) -> Result<(&str, Arc<OpenStream>)> {
        match self.list.as_slice() {
            [Source { name, content: Content::Stream(stream) }] => Ok((name, Arc::clone(stream))),
            _ => Err(error!(Usage, "export";
                found "{} paths, or a path that is not a stream file", self.list.len();
                expected "one stream file")),
        }
    }
}

fn not_listed(what: impl std::fmt::Display, count: usize) -> Error {
    error!(Usage, "{what}"; expected "one of {count} listed entries")
}

fn sequence_json(entry: &SequenceEntry) -> Value {
    json!({
        "name": entry.id.as_str(), "split": entry.split, "readouts": entry.readouts, "bytes": entry.bytes,
        "input": entry.input,
    })
}

fn light_json(light: Stimulus) -> Value {
    light.level().map_or_else(|| json!("scene"), |level| json!(level))
}

/// Returns the color filters that a sidecar states. Invalid filters do not prevent a view of the stream.
fn color_filters(sidecar: &Sidecar) -> Option<Mosaic> {
    sidecar.mosaic.as_ref()?.mosaic().ok()
}

impl OpenStream {
    pub(crate) fn new(reader: StreamReader, readout_hz: Option<f64>) -> Self {
        let warnings = reader.warnings().to_vec();
        let readout_hz = readout_hz.filter(|hz| hz.is_finite() && *hz > 0.0);
        Self { reader, readout_hz, mosaic: None, warnings }
    }

    pub(crate) fn with_mosaic(self, mosaic: Option<Mosaic>) -> Self {
        Self { mosaic, ..self }
    }

    /// Opens a file. The warnings include a layout that does not look like a picture.
    fn open(path: &Path, options: &SourceOptions) -> Result<Self> {
        let reader = options.open.open(path)?;
        let sidecar = Sidecar::read_beside(path).ok().flatten().map(|(_, sidecar)| sidecar);
        let guess = reader.layout_guesses()?.warning();
        let readout_hz = options.readout_hz.or(sidecar.as_ref().and_then(|s| s.readout_hz));
        let mosaic = sidecar.as_ref().and_then(color_filters);
        let mut stream = Self::new(reader, readout_hz).with_mosaic(mosaic);
        stream.warnings.extend(guess);
        Ok(stream)
    }
}

impl Source {
    fn open(path: &Path, options: &SourceOptions) -> Result<Self> {
        let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
        if let Some(ring) = path.to_str().and_then(|p| p.strip_prefix("shm:")) {
            let ring =
                if ring.contains('/') { PathBuf::from(ring) } else { Path::new("/dev/shm").join(ring) };
            return Ok(Self { name, content: Content::Live(LiveStream::open(&ring)?) });
        }
        let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase());
        let content = match ending.as_deref() {
            _ if path.is_dir() => open_folder(path)?,
            Some("tar") => open_dataset(path)?,
            Some("toml") => Content::Recordings(RecordingSet::open(path)?),
            _ => Content::Stream(Arc::new(OpenStream::open(path, options)?)),
        };
        Ok(Self { name, content })
    }
}

fn open_dataset(path: &Path) -> Result<Content> {
    let reader = DatasetReader::open(path, false)?;
    let sequences: Vec<_> = reader.done_entries().into_iter().cloned().collect();
    if sequences.is_empty() {
        bail!(Input, "{}", path.display(); found "a data set without finished sequences";
            expected "at least one finished sequence"; remedy "generate the data set");
    }
    Ok(Content::Dataset { reader, sequences })
}

/// Returns whether a file is an array of floats or of fewer than three axes, such as the maps of `calibrate`.
fn is_map(path: &Path) -> bool {
    let header = InputFile::open(path).and_then(|file| npy::Header::read("array", &mut file.reader()));
    header.is_ok_and(|header| header.element.is_float() || header.shape.len() < 3)
}

/// Opens a data set, the folder of a recording set, or an output folder.
fn open_folder(folder: &Path) -> Result<Content> {
    if let Some(dataset) = not_found_as_none(open_dataset(folder))? {
        return Ok(dataset);
    }
    if folder.join(SET_FILE).is_file() {
        return Ok(Content::Recordings(RecordingSet::open(&folder.join(SET_FILE))?));
    }
    let (mut streams, mut reports) = (Vec::new(), Vec::new());
    for entry in std::fs::read_dir(folder).map_err(|e| Error::io(folder.display(), e))? {
        let entry = entry.map_err(|e| Error::io(folder.display(), e))?;
        let is_file = entry.file_type().is_ok_and(|t| t.is_file());
        let name = entry.file_name().to_string_lossy().into_owned();
        let Ok(inner) = InnerPath::parse(ErrorKind::Input, folder.display(), &name) else { continue };
        match name.rsplit_once('.').map(|(_, ending)| ending) {
            Some("npy") if is_file && is_map(&entry.path()) => {}
            Some("dat" | "npy" | "npz") if is_file => streams.push(inner),
            Some("html") if is_file => reports.push(inner),
            _ => {}
        }
    }
    streams.sort_by(|a, b| a.as_str().cmp(b.as_str()));
    streams.truncate(MAX_FOLDER_STREAMS);
    reports.sort_by(|a, b| a.as_str().cmp(b.as_str()));
    if streams.is_empty() && reports.is_empty() {
        bail!(Input, "{}", folder.display(); found "a folder without streams or a report page";
            expected "a data set, a recording set, or a folder with .dat, .npy, .npz or .html files");
    }
    Ok(Content::Folder { folder: folder.to_owned(), streams, report: reports.into_iter().next() })
}
