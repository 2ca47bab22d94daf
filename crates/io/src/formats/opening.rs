//! What is known of a stream before it is opened, and how the rest is found out.

use std::io::{Seek as _, SeekFrom};
use std::path::{Path, PathBuf};

use crate::formats::layouts::{self, Array, Axes, Entry, Meaning};
use crate::formats::origin::{Lost, Origin};
use crate::formats::reader::Reader;
use crate::formats::sidecar::Facts;
use crate::formats::source::{Place, Source};
use crate::formats::{Codec, Layout, container, dataset_config, readings, sidecar, size};
use spikelane::error::{Error, Kind, Result};
use spikelane::spikes::Geometry;
use spikelane::unstable::npy;

/// How a stream is to be opened; what is `None` is found out.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Opening {
    /// Layout of the file.
    pub layout: Option<Layout>,
    /// Width and height.
    pub geometry: Option<Geometry>,
    /// Name of the array in an `.npz`.
    pub key: Option<String>,
    /// What stands for lost readouts.
    pub lost: Lost,
}

spikelane::unstable::with_methods!(Opening {
    with_layout: layout: Option<Layout>,
    with_geometry: geometry: Option<Geometry>,
    with_key: key: Option<String>,
    with_lost: lost: Lost,
});

impl Reader {
    /// Opens a file; see [`Opening::open`], of which this gives layout and geometry.
    ///
    /// # Errors
    /// As [`Opening::open`].
    pub fn open(path: &Path, layout: Option<Layout>, geometry: Option<Geometry>) -> Result<Self> {
        Opening { layout, geometry, ..Opening::default() }.open(path)
    }

    /// Takes a stream that is already in memory; `name` stands for it in errors.
    ///
    /// # Examples
    /// ```
    /// use spikelane::Geometry;
    /// use spikelane_io::formats::{Layout, Reader};
    /// let reader = Reader::from_bytes("mine", vec![0; 6], Some(Layout::Dat), Some(Geometry::new(8, 2)?))?;
    /// assert_eq!(reader.readouts(), 3);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// As [`Opening::from_bytes`].
    pub fn from_bytes(
        name: &str,
        bytes: Vec<u8>,
        layout: Option<Layout>,
        geometry: Option<Geometry>,
    ) -> Result<Self> {
        Opening { layout, geometry, ..Opening::default() }.from_bytes(name, bytes)
    }
}

impl Opening {
    /// Opens a file. What is not given comes from the sidecar `STEM.json` beside it (for
    /// `STEM.clean.dat` also `STEM.json`), from a `config.yaml` above it, from the header of a `.npy` or `.npz`, or
    /// from the camera a layout belongs to; a headerless file of known geometry is taken for `dat`.
    ///
    /// A recording that stops inside a readout is read up to there; [`Reader::warnings`] says so.
    ///
    /// # Errors
    /// [`Kind::Input`] when the file is empty, of another geometry, or no stream at all,
    /// [`Kind::Usage`] when nothing tells the geometry or the order of axes, [`Kind::Config`] when the sidecar
    /// is needed and broken, [`Kind::Io`] when the file cannot be read.
    pub fn open(&self, path: &Path) -> Result<Reader> {
        let source = Source::open(path)?;
        let head = source.head()?;
        let tells = |l: Layout| l.fixed_geometry().is_some() || l == Layout::NpyBytes;
        let known = self.layout.is_some() && (self.geometry.is_some() || self.layout.is_some_and(tells));
        // Named in full, a stream needs no sidecar; one that can be read is still a witness.
        let facts = if known { sidecar::beside(path).unwrap_or_default() } else { sidecar::beside(path)? };
        let named = self.geometry.is_some() || facts.geometry.is_some() || self.layout.is_some_and(tells);
        let above = if named || is_array(&head) {
            None
        } else if head.starts_with(layouts::ARCHIVE_MAGIC) {
            // An archive may do without.
            dataset_config::above(path).unwrap_or_default()
        } else {
            dataset_config::above(path)?
        };
        drop(head);
        Builder { opening: self, name: path.display().to_string(), facts, above }.build(source)
    }

    /// Opens a file that was just written, of a layout and a geometry that are known: what lies beside it may be of what it replaced.
    ///
    /// # Errors
    /// As [`open`](Self::open).
    pub fn open_written(&self, path: &Path) -> Result<Reader> {
        let (facts, above) = (Facts::default(), None);
        let source = Source::open(path)?;
        Builder { opening: self, name: path.display().to_string(), facts, above }.build(source)
    }

    /// Takes a stream that is already in memory; `name` stands for it in errors.
    ///
    /// # Errors
    /// As [`open`](Self::open), without sidecar and `config.yaml`.
    pub fn from_bytes(&self, name: &str, bytes: Vec<u8>) -> Result<Reader> {
        let (facts, above) = (Facts::default(), None);
        Builder { opening: self, name: name.into(), facts, above }.build(Source::Memory(bytes))
    }
}

struct Builder<'a> {
    opening: &'a Opening,
    name: String,
    facts: Facts,
    /// What a data set's configuration says, where nothing nearer does.
    above: Option<(Geometry, PathBuf)>,
}

impl Builder<'_> {
    fn build(self, source: Source) -> Result<Reader> {
        let wanted = self.opening.layout.or(self.facts.layout);
        let head = source.head()?;
        if let Some(found) = container::of(&head)
            && (wanted.is_none() || found.outweighs_a_name())
        {
            return Err(found.refusal(&self.name));
        }
        let arrays = wanted.is_none_or(Layout::is_array);
        if let Some(key) = self.opening.key.as_ref().filter(|_| !head.starts_with(layouts::ARCHIVE_MAGIC)) {
            return Err(Error::new(Kind::Usage, &self.name)
                .found(format_args!("the name of an array, '{key}', for what is no archive"))
                .expected("an .npz")
                .remedy("leave the name (--key) out"));
        }
        let is_npz = head.starts_with(layouts::ARCHIVE_MAGIC);
        let (is_npy, begins_as_npy) = (is_array(&head), head.starts_with(npy::MAGIC));
        drop(head);
        let mut reader = if arrays && is_npz {
            self.archive(&source)
        } else if wanted.map_or(begins_as_npy, Layout::is_array) {
            self.array(source, wanted)
        } else if is_npy || is_npz && ends_as_archive(&source)? {
            let what = if is_npy { "a NumPy array, with a header" } else { "a zip archive, such as .npz" };
            Err(Error::new(Kind::Input, &self.name)
                .found(what)
                .expected(format_args!("a headerless file of layout {}", wanted.unwrap_or_default()))
                .remedy("leave the layout out"))
        } else {
            self.headerless(source, wanted.unwrap_or_default())
        }?;
        self.compare(&mut reader, wanted)?;
        Ok(reader)
    }

    /// Compares with the sidecar.
    fn compare(&self, reader: &mut Reader, wanted: Option<Layout>) -> Result<()> {
        if let (Some(told), Some(path)) = (self.facts.geometry, &self.facts.path)
            && told != reader.geometry()
        {
            reader.warn(format!(
                "read as {}, but its sidecar {} says {told}",
                reader.geometry(),
                path.display()
            ));
        }
        let same = Some(reader.geometry()) == self.facts.geometry && wanted == self.facts.layout;
        let Some(expected) = self.facts.readouts.filter(|_| same) else { return Ok(()) };
        let found = reader.numbered() as u64;
        if found > expected {
            return Err(Error::new(Kind::Input, &self.name)
                .found(format_args!("{found} readouts"))
                .expected(format_args!("{expected}, as its sidecar says"))
                .remedy("the file belongs to another sidecar"));
        }
        if found < expected {
            reader
                .warn(format!("{found} readouts where its sidecar says {expected}: the file was cut short"));
        }
        Ok(())
    }

    /// The size that is known for a headerless file, and from where.
    fn size(&self, layout: Layout) -> Option<(Geometry, Origin)> {
        let sidecar = self.facts.path.clone().unwrap_or_default();
        let given = self.opening.geometry.map(|g| (g, Origin::Given));
        let told = self.facts.geometry.map(|g| (g, Origin::Sidecar(sidecar)));
        let above = self.above.clone().map(|(g, path)| (g, Origin::DataSet(path)));
        given.or(told).or(layout.fixed_geometry().map(|g| (g, Origin::Camera))).or(above)
    }

    fn headerless(&self, source: Source, layout: Layout) -> Result<Reader> {
        let Some((geometry, origin)) = self.size(layout) else {
            return Err(size::unknown(&self.name, source.len()));
        };
        let codec = Codec::new(layout, geometry).map_err(|e| e.within(&self.name))?;
        if layout == Layout::Rows1024 {
            return self.rows1024(source, codec, origin);
        }
        let told = self.facts.geometry.map(|g| (self.facts.layout.unwrap_or_default(), g));
        let readouts = size::readouts(&self.name, &codec, source.len(), told)?;
        let trailing = source.len() - readouts * codec.frame_bytes();
        let mut reader = Reader::new(source, &self.name, layout, codec, readouts, origin);
        reader.cut(0, trailing);
        Ok(reader)
    }

    fn rows1024(&self, source: Source, codec: Codec, origin: Origin) -> Result<Reader> {
        let found = layouts::find_rows1024(&source, source.len())?
            .ok_or_else(|| no_frame(&self.name, &codec, source.len()))?;
        let numbers: Vec<usize> =
            found.frames.iter().enumerate().filter(|(_, f)| f.is_none()).map(|(i, _)| i).collect();
        let mut frames = found.frames;
        let all = frames.len();
        if self.opening.lost == Lost::Drop {
            frames.retain(Option::is_some);
        }
        let mut reader = Reader::new(source, &self.name, codec.layout(), codec, frames.len(), origin);
        reader.place = if numbers.is_empty() { Place::Even(found.leading) } else { Place::Each(frames) };
        reader.cut(found.leading, found.trailing);
        reader.lose(numbers, all, self.opening.lost);
        Ok(reader)
    }

    fn array(&self, source: Source, wanted: Option<Layout>) -> Result<Reader> {
        let array = layouts::parse(&self.name, &source.head()?)?;
        let known = self.opening.geometry.or(self.facts.geometry);
        let origin = match (self.opening.geometry, &self.facts.path) {
            (Some(_), _) => Origin::Given,
            (None, Some(path)) if self.facts.geometry.is_some() => Origin::Sidecar(path.clone()),
            _ => Origin::Header,
        };
        let data = source.len() - array.start;
        let meaning = layouts::array_meaning(&self.name, &array, wanted, known)?;
        let Meaning::Frames(layout, geometry) = meaning else {
            return self.packed(&source, &array, meaning, origin);
        };
        let codec = Codec::new(layout, geometry)?;
        let claims = array.data_bytes().unwrap_or(u64::MAX);
        let readouts = (data as u64).min(claims) / codec.frame_bytes() as u64;
        if readouts == 0 || claims < data as u64 {
            return Err(Error::new(Kind::Input, &self.name)
                .found(format_args!("{data} bytes behind the header"))
                .expected(format_args!("{claims}, at least one frame, for its shape {:?}", array.shape))
                .remedy("the file was cut short or is still being written"));
        }
        let trailing = data - readouts as usize * codec.frame_bytes();
        let mut reader = Reader::new(source, &self.name, layout, codec, readouts as usize, origin);
        reader.place = Place::Even(array.start);
        if layout == Layout::NpyBytes && wanted.is_none() {
            readings::refuse_packed(&reader)?;
        }
        reader.cut(0, trailing);
        if claims > data as u64 {
            reader.warn(format!(
                "{readouts} whole readouts where its header says {}: the file was cut short",
                array.shape[0]
            ));
        }
        Ok(reader)
    }

    /// An array that has to be held in memory.
    fn packed(&self, source: &Source, array: &Array, meaning: Meaning, origin: Origin) -> Result<Reader> {
        let axes = if let Meaning::Packed(axes) = meaning { axes } else { Axes::First };
        if array.data_bytes().is_none_or(|n| n != (source.len() - array.start) as u64) {
            return Err(Error::new(Kind::Input, &self.name)
                .found(format_args!("{} bytes behind the header", source.len() - array.start))
                .expected(format_args!("those of its shape {:?} of {}", array.shape, array.element))
                .remedy("the file was cut short or is still being written"));
        }
        let mut data = source.reader();
        let skipped = data.seek(SeekFrom::Start(array.start as u64));
        skipped.map_err(|e| Error::io(&self.name, e))?;
        let packing = layouts::pack(&self.name, array, axes, &mut data)?;
        self.memory(packing, origin)
    }

    fn archive(&self, source: &Source) -> Result<Reader> {
        let known = self.opening.geometry.or(self.facts.geometry);
        let above = self.above.as_ref().map(|(g, _)| *g);
        let entry = |geometry| Entry {
            key: self.opening.key.as_deref(),
            geometry,
            readouts_first: self.opening.layout == Some(Layout::NpyBytes),
        };
        // A configuration above is about the data set's own files, so it may fit or not.
        let (read, origin) = match above.filter(|_| known.is_none()) {
            Some(g) => match layouts::read_archive(&self.name, source, entry(Some(g))) {
                Ok(read) => (Ok(read), self.size(Layout::Dat).map(|s| s.1)),
                Err(_) => (layouts::read_archive(&self.name, source, entry(None)), None),
            },
            None => {
                let origin = self.size(Layout::Dat).map(|s| s.1);
                (layouts::read_archive(&self.name, source, entry(known)), origin)
            }
        };
        let (packing, key) = read?;
        let mut reader = self.memory(packing, origin.unwrap_or(Origin::Header))?;
        if self.opening.key.is_none() && !["spk", "seq", "arr_0"].contains(&key.as_str()) {
            reader.warn(format!("array '{key}', the only one, was taken for the stream"));
        }
        Ok(reader)
    }

    fn memory(&self, packing: layouts::Packing, origin: Origin) -> Result<Reader> {
        // In memory it is what `dat-top` is in a file.
        let codec = Codec::new(Layout::DatTop, packing.geometry)?;
        let readouts = packing.packed.len() / codec.frame_bytes();
        let source = Source::Memory(packing.packed);
        Ok(Reader::new(source, &self.name, Layout::NpyBytes, codec, readouts, origin))
    }
}

fn is_array(head: &[u8]) -> bool {
    head.starts_with(npy::MAGIC)
        && head.get(6).is_some_and(|v| (1..=3).contains(v))
        && head.get(7) == Some(&0)
}

/// Whether it ends as archives do.
fn ends_as_archive(source: &Source) -> Result<bool> {
    let tail = source.bytes(source.len().saturating_sub(22 + 0xffff)..source.len())?;
    Ok(tail.windows(4).any(|w| w == b"PK\x05\x06"))
}

fn no_frame(name: &str, codec: &Codec, bytes: usize) -> Error {
    if bytes < codec.frame_bytes() {
        return size::mismatch(name, codec, bytes);
    }
    Error::new(Kind::Input, name)
        .found(format_args!(
            "{bytes} bytes without a frame near the start whose first tag is (line 500, channel 0)"
        ))
        .expected("layout rows1024 of the 1000x1000 camera, 128000 bytes a frame")
        .remedy("check the layout; plain frames of 125000 bytes are layout dat")
}
