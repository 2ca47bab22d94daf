//! Options for opening a stream. The reader determines missing options from the file and the files beside it.

use std::io::{Seek as _, SeekFrom};
use std::path::{Path, PathBuf};

use crate::ARCHIVE_MAGIC;
use crate::formats::layouts::{self, ArchiveHint, ArrayContent, ArrayHeader, ReadoutAxis};
use crate::formats::origin::{GeometryOrigin, MissingFrames};
use crate::formats::reader::StreamReader;
use crate::formats::sidecar::SidecarFacts;
use crate::formats::source::{ByteSource, FrameOffsets};
use crate::formats::{Codec, Layout, dataset_config, foreign_format, layout_guesses, sidecar, size};
use spikelane::error::{Error, Result, Setting, bail, error};
use spikelane::spikes::Geometry;
use spikelane::unstable::inputs::InputFile;
use spikelane::unstable::{Count, npy};

/// Options for opening a stream. The reader determines options that are `None` from the file and the files beside it.
///
/// # Examples
/// ```
/// use spikelane::Geometry;
/// use spikelane_io::formats::{GeometryOrigin, Layout, OpenOptions};
/// let geometry = Some(Geometry::new(8, 1)?);
/// let options = OpenOptions::default().with_layout(Some(Layout::DatMsb)).with_geometry(geometry);
/// let reader = options.from_bytes("mine", vec![0b1000_0000])?;
/// // The most significant bit is pixel 0.
/// assert!(reader.read(0..1)?.get(0, 0, 0));
/// assert_eq!(*reader.origin(), GeometryOrigin::Caller);
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct OpenOptions {
    /// Layout of the file.
    pub layout: Option<Layout>,
    /// Width and height.
    pub geometry: Option<Geometry>,
    /// Name of the array in an `.npz`.
    pub key: Option<String>,
    /// How missing frames are handled.
    pub missing_frames: MissingFrames,
}

spikelane::unstable::with_methods!(OpenOptions {
    with_layout: layout: Option<Layout>,
    with_geometry: geometry: Option<Geometry>,
    with_key: key: Option<String>,
    with_missing_frames: missing_frames: MissingFrames,
});

impl StreamReader {
    /// Opens a file with `layout` and `geometry`; see [`OpenOptions::open`].
    ///
    /// # Errors
    /// As [`OpenOptions::open`].
    pub fn open(path: &Path, layout: Option<Layout>, geometry: Option<Geometry>) -> Result<Self> {
        OpenOptions { layout, geometry, ..OpenOptions::default() }.open(path)
    }

    /// Opens a stream in memory. Error messages refer to the stream as `name`.
    ///
    /// # Examples
    /// ```
    /// use spikelane::Geometry;
    /// use spikelane_io::formats::{Layout, StreamReader};
    /// let reader = StreamReader::from_bytes("mine", vec![0; 6], Some(Layout::Dat), Some(Geometry::new(8, 2)?))?;
    /// assert_eq!(reader.readouts(), 3);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// As [`OpenOptions::from_bytes`].
    pub fn from_bytes(
        name: &str,
        bytes: Vec<u8>,
        layout: Option<Layout>,
        geometry: Option<Geometry>,
    ) -> Result<Self> {
        OpenOptions { layout, geometry, ..OpenOptions::default() }.from_bytes(name, bytes)
    }
}

impl OpenOptions {
    /// Opens a file.
    ///
    /// If layout or geometry is `None`, the following sources are used in this order:
    /// * the sidecar beside the file: `STEM.dat.json`, else `STEM.json` (also for `STEM.clean.dat`),
    /// * the header of a `.npy` or `.npz` file,
    /// * the geometry of the camera, if the layout belongs to one camera,
    /// * a `config.yaml` in the folder of the file or in one of its parent folders.
    ///
    /// A headerless file without a known layout is read as `dat`. If a recording ends inside a readout, the reader
    /// ignores the partial readout. [`StreamReader::warnings`] reports the bytes of the partial readout.
    ///
    /// # Errors
    /// * [`ErrorKind::Input`](spikelane::ErrorKind::Input) if the file is empty, is not a stream or does not match the requested geometry.
    /// * [`ErrorKind::Usage`](spikelane::ErrorKind::Usage) if the geometry or the order of axes cannot be determined.
    /// * [`ErrorKind::Config`](spikelane::ErrorKind::Config) if a required sidecar is invalid.
    /// * [`ErrorKind::Io`](spikelane::ErrorKind::Io) if the file cannot be read.
    pub fn open(&self, path: &Path) -> Result<StreamReader> {
        let source = ByteSource::open(path)?;
        let head = source.head()?;
        let tells = |l: Layout| l.fixed_geometry().is_some() || l == Layout::NpyBytes;
        let known = self.layout.is_some() && (self.geometry.is_some() || self.layout.is_some_and(tells));
        // If the caller gave layout and geometry, an unreadable sidecar is ignored. A readable sidecar is still
        // compared with the stream.
        let facts =
            if known { sidecar::read_beside(path).unwrap_or_default() } else { sidecar::read_beside(path)? };
        let is_described =
            self.geometry.is_some() || facts.geometry.is_some() || self.layout.is_some_and(tells);
        let above = if is_described || is_array(&head) {
            None
        } else if head.starts_with(ARCHIVE_MAGIC) {
            // The size of the arrays in an archive is known without a configuration, so an invalid configuration is
            // ignored.
            dataset_config::find_above(path).unwrap_or_default()
        } else {
            dataset_config::find_above(path)?
        };
        drop(head);
        ReaderBuilder { options: self, name: path.display().to_string(), facts, dataset_config: above }
            .build(source)
    }

    /// Opens a file that this process has just written with a known layout and geometry.
    ///
    /// A sidecar or configuration beside the file is ignored, because it may describe the previous file of this name.
    ///
    /// # Errors
    /// As [`open`](Self::open).
    pub fn open_written(&self, path: &Path) -> Result<StreamReader> {
        let (facts, above) = (SidecarFacts::default(), None);
        let source = ByteSource::open(path)?;
        ReaderBuilder { options: self, name: path.display().to_string(), facts, dataset_config: above }
            .build(source)
    }

    /// Opens a stream whose sidecar is not in a file beside it, such as a member of a tar.
    ///
    /// `sidecar` is the text of the sidecar, and errors refer to it as `sidecar_path`.
    ///
    /// # Errors
    /// As [`open`](Self::open).
    pub fn open_with_sidecar(
        &self,
        file: InputFile,
        sidecar: &[u8],
        sidecar_path: PathBuf,
    ) -> Result<StreamReader> {
        let facts = sidecar::parse(&sidecar_path.display().to_string(), sidecar, file.path())?;
        let facts = SidecarFacts { path: Some(sidecar_path), ..facts };
        let name = file.path().display().to_string();
        ReaderBuilder { options: self, name, facts, dataset_config: None }.build(ByteSource::from_file(file)?)
    }

    /// Opens a stream in memory. Error messages refer to the stream as `name`.
    ///
    /// # Errors
    /// As [`open`](Self::open), but without the errors of sidecars and `config.yaml`.
    pub fn from_bytes(&self, name: &str, bytes: Vec<u8>) -> Result<StreamReader> {
        let (facts, above) = (SidecarFacts::default(), None);
        ReaderBuilder { options: self, name: name.into(), facts, dataset_config: above }
            .build(ByteSource::Memory(bytes))
    }
}

struct ReaderBuilder<'a> {
    options: &'a OpenOptions,
    name: String,
    facts: SidecarFacts,
    /// The geometry in the `config.yaml` of a data set, and the path of that file. `None` if another source determines
    /// the geometry.
    dataset_config: Option<(Geometry, PathBuf)>,
}

impl ReaderBuilder<'_> {
    fn build(self, source: ByteSource) -> Result<StreamReader> {
        let wanted = self.options.layout.or(self.facts.layout);
        let head = source.head()?;
        if let Some(format) = foreign_format::detect(&head)
            && (wanted.is_none() || format.overrides_layout())
        {
            return Err(format.to_error(&self.name));
        }
        let arrays = wanted.is_none_or(Layout::is_array);
        if let Some(key) = self.options.key.as_ref().filter(|_| !head.starts_with(ARCHIVE_MAGIC)) {
            bail!(Usage, "{}", self.name; found "the array name '{key}' for a file that is not an archive";
                expected "an .npz archive"; remedy "omit {}", Setting("key"));
        }
        let is_npz = head.starts_with(ARCHIVE_MAGIC);
        let (is_npy, begins_as_npy) = (is_array(&head), head.starts_with(npy::MAGIC));
        drop(head);
        let mut reader = if arrays && is_npz {
            self.open_archive(&source)
        } else if wanted.map_or(begins_as_npy, Layout::is_array) {
            self.open_array(source, wanted)
        } else if is_npy || is_npz && ends_as_archive(&source)? {
            let what = if is_npy { "a NumPy array, with a header" } else { "a zip archive, such as .npz" };
            Err(error!(Input, "{}", self.name; found "{what}";
                expected "a headerless file of layout {}", wanted.unwrap_or_default();
                remedy "omit {}", Setting("layout")))
        } else {
            self.open_headerless(source, wanted.unwrap_or_default())
        }?;
        self.check_sidecar(&mut reader, wanted)?;
        Ok(reader)
    }

    /// Compares the stream with its sidecar. A difference results in a warning or in an error.
    fn check_sidecar(&self, reader: &mut StreamReader, wanted: Option<Layout>) -> Result<()> {
        if let (Some(sidecar_geometry), Some(path)) = (self.facts.geometry, &self.facts.path)
            && sidecar_geometry != reader.geometry()
        {
            reader.warn(format!(
                "the stream is read as {}, but the sidecar {} states {sidecar_geometry}",
                reader.geometry(),
                path.display()
            ));
        }
        let same = Some(reader.geometry()) == self.facts.geometry && wanted == self.facts.layout;
        let Some(expected) = self.facts.readouts.filter(|_| same) else { return Ok(()) };
        let numbered = reader.numbered_readouts() as u64;
        if numbered > expected {
            bail!(Input, "{}", self.name; found "{}", Count(numbered, "readout");
                expected "{expected}, as stated in the sidecar";
                remedy "the stream file does not belong to the sidecar; check both files");
        }
        if numbered < expected {
            reader.warn(format!(
                "the stream has {}, but the sidecar states {expected}: the file is truncated",
                Count(numbered, "readout"),
            ));
        }
        Ok(())
    }

    /// Returns the geometry of a headerless file and the source of this geometry, or `None` if no source contains a
    /// geometry.
    fn known_geometry(&self, layout: Layout) -> Option<(Geometry, GeometryOrigin)> {
        let sidecar = self.facts.path.clone().unwrap_or_default();
        let caller_geometry = self.options.geometry.map(|g| (g, GeometryOrigin::Caller));
        let sidecar_geometry = self.facts.geometry.map(|g| (g, GeometryOrigin::Sidecar(sidecar)));
        let above = self.dataset_config.clone().map(|(g, path)| (g, GeometryOrigin::Dataset(path)));
        caller_geometry
            .or(sidecar_geometry)
            .or(layout.fixed_geometry().map(|g| (g, GeometryOrigin::Camera)))
            .or(above)
    }

    fn open_headerless(&self, source: ByteSource, layout: Layout) -> Result<StreamReader> {
        let Some((geometry, origin)) = self.known_geometry(layout) else {
            return Err(size::unknown_size_error(&self.name, source.len()));
        };
        let codec = Codec::new(layout, geometry).map_err(|e| e.with_context(&self.name))?;
        if layout == Layout::Rows1024 {
            return self.open_rows1024(source, codec, origin);
        }
        let sidecar_shape = self.facts.geometry.map(|g| (self.facts.layout.unwrap_or_default(), g));
        let readouts = size::whole_readouts(&self.name, &codec, source.len(), sidecar_shape)?;
        let trailing = source.len() - readouts * codec.frame_bytes();
        let mut reader = StreamReader::new(source, &self.name, layout, codec, readouts, origin);
        reader.set_partial_bytes(0, trailing);
        Ok(reader)
    }

    fn open_rows1024(
        &self,
        source: ByteSource,
        codec: Codec,
        origin: GeometryOrigin,
    ) -> Result<StreamReader> {
        let scan = layouts::find_rows1024(&source, source.len())?
            .ok_or_else(|| no_frame_error(&self.name, &codec, source.len()))?;
        let numbers: Vec<usize> =
            scan.frames.iter().enumerate().filter(|(_, f)| f.is_none()).map(|(i, _)| i).collect();
        let mut frames = scan.frames;
        let all = frames.len();
        if self.options.missing_frames == MissingFrames::Drop {
            frames.retain(Option::is_some);
        }
        let mut reader = StreamReader::new(source, &self.name, codec.layout(), codec, frames.len(), origin);
        reader.frame_offsets = if numbers.is_empty() {
            FrameOffsets::Contiguous(scan.leading)
        } else {
            FrameOffsets::Individual(frames)
        };
        reader.set_partial_bytes(scan.leading, scan.trailing);
        reader.set_missing_frames(numbers, all, self.options.missing_frames);
        Ok(reader)
    }

    fn open_array(&self, source: ByteSource, wanted: Option<Layout>) -> Result<StreamReader> {
        let array = layouts::parse(&self.name, &source.head()?)?;
        let known = self.options.geometry.or(self.facts.geometry);
        let origin = match (self.options.geometry, &self.facts.path) {
            (Some(_), _) => GeometryOrigin::Caller,
            (None, Some(path)) if self.facts.geometry.is_some() => GeometryOrigin::Sidecar(path.clone()),
            _ => GeometryOrigin::Header,
        };
        let data = source.len() - array.data_offset_bytes;
        let meaning = layouts::array_content(&self.name, &array, wanted, known)?;
        let ArrayContent::Frames(layout, geometry) = meaning else {
            return self.open_in_memory_array(&source, &array, meaning, origin);
        };
        let codec = Codec::new(layout, geometry)?;
        let claims = array.data_bytes().unwrap_or(u64::MAX);
        let readouts = (data as u64).min(claims) / codec.frame_bytes() as u64;
        if readouts == 0 || claims < data as u64 {
            bail!(Input, "{}", self.name; found "{} after the header", Count(data, "byte");
                expected "{}, at least one frame, for the shape {} in the header", Count(claims, "byte"), npy::shape_text(&array.shape);
                remedy "the file is truncated or still being written");
        }
        let trailing = data - readouts as usize * codec.frame_bytes();
        let mut reader = StreamReader::new(source, &self.name, layout, codec, readouts as usize, origin);
        reader.frame_offsets = FrameOffsets::Contiguous(array.data_offset_bytes);
        if layout == Layout::NpyBytes && wanted.is_none() {
            layout_guesses::refuse_packed(&reader)?;
        }
        reader.set_partial_bytes(0, trailing);
        if claims > data as u64 {
            reader.warn(format!(
                "the stream has {}, but the header states {}: the file is truncated",
                Count(readouts, "whole readout"),
                array.shape[0],
            ));
        }
        Ok(reader)
    }

    /// Opens an array whose pixels must be packed in memory.
    fn open_in_memory_array(
        &self,
        source: &ByteSource,
        array: &ArrayHeader,
        meaning: ArrayContent,
        origin: GeometryOrigin,
    ) -> Result<StreamReader> {
        let axes = if let ArrayContent::Pixels(axes) = meaning { axes } else { ReadoutAxis::First };
        if array.data_bytes().is_none_or(|n| n != (source.len() - array.data_offset_bytes) as u64) {
            bail!(Input, "{}", self.name;
                found "{} after the header", Count(source.len() - array.data_offset_bytes, "byte");
                expected "as many bytes as the shape {} of {} requires", npy::shape_text(&array.shape), array.element;
                remedy "the file is truncated or still being written");
        }
        let mut data = source.reader();
        let skipped = data.seek(SeekFrom::Start(array.data_offset_bytes as u64));
        skipped.map_err(|e| Error::io(&self.name, e))?;
        let packing = layouts::pack(&self.name, array, axes, &mut data)?;
        self.open_memory(packing, origin)
    }

    fn open_archive(&self, source: &ByteSource) -> Result<StreamReader> {
        let known = self.options.geometry.or(self.facts.geometry);
        let above = self.dataset_config.as_ref().map(|(g, _)| *g);
        let entry = |geometry| ArchiveHint {
            key: self.options.key.as_deref(),
            geometry,
            readouts_first: self.options.layout == Some(Layout::NpyBytes),
        };
        // The `config.yaml` may belong to other files. If its geometry does not match the array, the archive is read
        // without the `config.yaml`.
        let (read, origin) = match above.filter(|_| known.is_none()) {
            Some(g) => match layouts::read_archive(&self.name, source, entry(Some(g))) {
                Ok(read) => (Ok(read), self.known_geometry(Layout::Dat).map(|s| s.1)),
                Err(_) => (layouts::read_archive(&self.name, source, entry(None)), None),
            },
            None => {
                let origin = self.known_geometry(Layout::Dat).map(|s| s.1);
                (layouts::read_archive(&self.name, source, entry(known)), origin)
            }
        };
        let (packing, key) = read?;
        let mut reader = self.open_memory(packing, origin.unwrap_or(GeometryOrigin::Header))?;
        if self.options.key.is_none() && !["spk", "seq", "arr_0"].contains(&key.as_str()) {
            reader.warn(format!("the only array of the archive, '{key}', is read as the stream"));
        }
        Ok(reader)
    }

    fn open_memory(&self, packing: layouts::PackedStream, origin: GeometryOrigin) -> Result<StreamReader> {
        // The frames that were packed in memory have the encoding of `dat-top`.
        let codec = Codec::new(Layout::DatTop, packing.geometry)?;
        let readouts = packing.packed.len() / codec.frame_bytes();
        let source = ByteSource::Memory(packing.packed);
        Ok(StreamReader::new(source, &self.name, Layout::NpyBytes, codec, readouts, origin))
    }
}

fn is_array(head: &[u8]) -> bool {
    head.starts_with(npy::MAGIC)
        && head.get(6).is_some_and(|v| (1..=3).contains(v))
        && head.get(7) == Some(&0)
}

/// Returns whether the source ends with the end-of-directory record of a zip archive.
fn ends_as_archive(source: &ByteSource) -> Result<bool> {
    let tail = source.bytes(source.len().saturating_sub(22 + 0xffff)..source.len())?;
    Ok(tail.windows(4).any(|w| w == b"PK\x05\x06"))
}

fn no_frame_error(name: &str, codec: &Codec, bytes: usize) -> Error {
    if bytes < codec.frame_bytes() {
        return size::size_mismatch_error(name, codec, bytes);
    }
    error!(Input, "{name}";
        found "{} without a frame near the start whose first tag is (line 500, channel 0)", Count(bytes, "byte");
        expected "layout rows1024 of the 1000x1000 camera, with 128000 bytes per frame";
        remedy "check {}; frames of 125000 bytes have layout dat", Setting("layout"))
}
