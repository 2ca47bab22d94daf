//! Opening a stream in any layout.

use std::ops::{Deref, Range};
use std::path::Path;

use crate::error::{Error, Kind, Result};
use crate::formats::sidecar::Facts;
use crate::formats::{Codec, Layout, npy, npz, rows1024, sidecar, size};
use crate::spikes::{Geometry, Packed};
use crate::storage::Map;

/// How far [`Frames`] reads before it gives memory back.
const RELEASE: usize = 16 << 20;

/// A stream, opened: any frame, in any order, from any thread.
#[derive(Debug)]
pub struct Reader {
    source: Source,
    name: String,
    layout: Layout,
    codec: Codec,
    /// Bytes before the first whole frame, and of them those that are no header.
    start: usize,
    leading: usize,
    trailing: usize,
    readouts: usize,
}

#[derive(Debug)]
enum Source {
    Map(Map),
    Memory(Vec<u8>),
}

impl Deref for Source {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        match self {
            Self::Map(map) => map,
            Self::Memory(bytes) => bytes,
        }
    }
}

impl Reader {
    /// Opens a file. What is not given comes from the sidecar `STEM.json` beside it (for
    /// `STEM.clean.dat` also `STEM.json`), from the header of a `.npy` or `.npz`, or from
    /// the camera a layout belongs to; a headerless file of known geometry is taken for `dat`.
    ///
    /// # Errors
    /// [`Kind::Input`] when the file is empty, truncated or of another geometry,
    /// [`Kind::Usage`] when nothing tells the geometry, [`Kind::Config`] when the sidecar
    /// is needed and broken, [`Kind::Io`] when the file cannot be read.
    pub fn open(path: &Path, layout: Option<Layout>, geometry: Option<Geometry>) -> Result<Self> {
        let map = Map::open(path)?;
        let known = layout.is_some() && (geometry.is_some() || layout_tells_geometry(layout));
        let facts = if known { Facts::default() } else { sidecar::beside(path)? };
        Self::build(Source::Map(map), path.display().to_string(), layout, geometry, &facts)
    }

    /// Takes a stream that is already in memory; `name` stands for it in errors.
    ///
    /// # Errors
    /// As [`open`](Self::open), without a sidecar.
    pub fn from_bytes(
        name: &str,
        bytes: Vec<u8>,
        layout: Option<Layout>,
        geometry: Option<Geometry>,
    ) -> Result<Self> {
        let source = Source::Memory(bytes);
        Self::build(source, name.into(), layout, geometry, &Facts::default())
    }

    fn build(
        source: Source,
        name: String,
        layout: Option<Layout>,
        geometry: Option<Geometry>,
        facts: &Facts,
    ) -> Result<Self> {
        let wanted = layout.or(facts.layout);
        let known = geometry.or(facts.geometry);
        let is_npy = |l| matches!(l, Layout::NpyBits | Layout::NpyBytes);
        // Only without a named layout may the first bytes speak: a headerless
        // stream can begin with any bytes.
        let reader = if wanted.is_none_or(is_npy) && source.starts_with(npz::MAGIC) {
            Self::from_archive(&source, name, known)
        } else if wanted.map_or(source.starts_with(npy::MAGIC), is_npy) {
            Self::from_npy(source, name, wanted, known)
        } else {
            Self::from_raw(source, name, wanted.unwrap_or_default(), known)
        }?;
        let same = Some(reader.geometry()) == facts.geometry && wanted == facts.layout;
        match facts.readouts {
            Some(expected) if same && expected != reader.readouts as u64 => {
                Err(Error::new(Kind::Input, reader.name)
                    .found(format_args!("{} readouts", reader.readouts))
                    .expected(format_args!("{expected}, as its sidecar says"))
                    .remedy("the file was cut short or belongs to another sidecar"))
            }
            _ => Ok(reader),
        }
    }

    fn from_raw(source: Source, name: String, layout: Layout, geometry: Option<Geometry>) -> Result<Self> {
        let Some(geometry) = geometry.or(layout.fixed_geometry()) else {
            return Err(size::unknown(&name, source.len()));
        };
        let codec = Codec::new(layout, geometry).map_err(|e| e.within(&name))?;
        let (start, readouts) = if layout == Layout::Rows1024 {
            let start =
                rows1024::synchronise(&source).ok_or_else(|| no_frame(&name, &codec, source.len()))?;
            (start, (source.len() - start) / codec.frame_bytes())
        } else {
            (0, size::readouts(&name, &codec, source.len())?)
        };
        Ok(Self {
            leading: start,
            trailing: source.len() - start - readouts * codec.frame_bytes(),
            source,
            name,
            layout,
            codec,
            start,
            readouts,
        })
    }

    fn from_npy(
        source: Source,
        name: String,
        layout: Option<Layout>,
        geometry: Option<Geometry>,
    ) -> Result<Self> {
        let array = npy::parse(&name, &source)?;
        let (layout, geometry) = npy_meaning(&name, &array, layout, geometry)?;
        let codec = Codec::new(layout, geometry)?;
        let data = source.len() - array.start;
        // More than there are bytes saturates into a mismatch.
        let claims = array.data_bytes().unwrap_or(u64::MAX);
        if claims == 0 || claims != data as u64 {
            return Err(Error::new(Kind::Input, name)
                .found(format_args!("{data} bytes behind the header"))
                .expected(format_args!("{claims}, at least one frame, for its shape {:?}", array.shape))
                .remedy("the file was cut short or is still being written"));
        }
        Ok(Self {
            readouts: data / codec.frame_bytes(),
            source,
            name,
            layout,
            codec,
            start: array.start,
            leading: 0,
            trailing: 0,
        })
    }

    fn from_archive(bytes: &[u8], name: String, geometry: Option<Geometry>) -> Result<Self> {
        let archive = npz::read(&name, bytes)?;
        if let Some(wanted) = geometry.filter(|&g| g != archive.geometry) {
            return Err(other_geometry(&name, archive.geometry, wanted));
        }
        // In memory it is what `dat-top` is in a file.
        let codec = Codec::new(Layout::DatTop, archive.geometry)?;
        Ok(Self {
            readouts: archive.packed.len() / codec.frame_bytes(),
            source: Source::Memory(archive.packed),
            name,
            layout: Layout::NpyBytes,
            codec,
            start: 0,
            leading: 0,
            trailing: 0,
        })
    }

    /// The number of whole frames, at least one.
    #[must_use]
    pub const fn readouts(&self) -> usize {
        self.readouts
    }

    /// Width and height.
    #[must_use]
    pub const fn geometry(&self) -> Geometry {
        self.codec.geometry()
    }

    /// The layout; an `.npz` archive holds an array of `npy-bytes`.
    #[must_use]
    pub const fn layout(&self) -> Layout {
        self.layout
    }

    /// The path or name it was opened by.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Bytes of partial frames left out before the first and behind the last whole
    /// frame; other than zero only in `rows1024`, whose recordings start anywhere.
    #[must_use]
    pub const fn dropped_bytes(&self) -> (usize, usize) {
        (self.leading, self.trailing)
    }

    /// Reads the packed frame of readout `i` into `packed`.
    ///
    /// # Errors
    /// As [`read_frames`](Self::read_frames).
    pub fn read_frame(&self, i: usize, packed: &mut [u8]) -> Result<()> {
        if packed.len() != self.geometry().frame_bytes() {
            return Err(Error::new(Kind::Usage, "frame buffer")
                .found(format_args!("{} bytes", packed.len()))
                .expected(format_args!("{}", self.geometry().frame_bytes())));
        }
        self.read_frames(i, packed)
    }

    /// Reads as many packed frames as `packed` holds, from readout `first` on.
    ///
    /// # Errors
    /// [`Kind::Usage`] when they are not all in the stream, or `packed` holds no whole
    /// number of frames; [`Kind::Input`] as [`Codec::decode`].
    pub fn read_frames(&self, first: usize, packed: &mut [u8]) -> Result<()> {
        let size = self.geometry().frame_bytes();
        let end = first.saturating_add(packed.len() / size);
        let file = self.file_range(first..end)?;
        self.codec
            .decode(&self.source[file], packed)
            .map_err(|e| e.within(format_args!("{} from readout {first} on", self.name)))
    }

    /// The frames of `readouts`, one at a time, in constant memory.
    ///
    /// # Errors
    /// [`Kind::Usage`] when they are not all in the stream.
    pub fn frames(&self, readouts: Range<usize>) -> Result<Frames<'_>> {
        self.file_range(readouts.clone())?;
        Ok(Frames {
            reader: self,
            frame: vec![0; self.geometry().frame_bytes()],
            released: readouts.start,
            next: readouts.start,
            end: readouts.end,
        })
    }

    /// The packed frames themselves, without a copy, when the file has them as memory
    /// does (`dat-top` and archives of whole bytes, `npy-bits` of whole rows).
    #[must_use]
    pub fn packed(&self, readouts: Range<usize>) -> Option<Packed<'_>> {
        if !self.codec.is_identity() {
            return None;
        }
        let range = self.file_range(readouts).ok()?;
        Packed::new(self.geometry(), &self.source[range]).ok()
    }

    /// Lets go of the memory behind these readouts; reading them again is allowed.
    pub fn release(&self, readouts: Range<usize>) {
        if let (Source::Map(map), Ok(range)) = (&self.source, self.file_range(readouts)) {
            map.release(range);
        }
    }

    fn file_range(&self, readouts: Range<usize>) -> Result<Range<usize>> {
        if readouts.start > readouts.end || readouts.end > self.readouts {
            return Err(Error::new(Kind::Usage, &self.name)
                .found(format_args!("readouts {}..{}", readouts.start, readouts.end))
                .expected(format_args!("a range within 0..{}", self.readouts)));
        }
        let at = |readout| self.start + readout * self.codec.frame_bytes();
        Ok(at(readouts.start)..at(readouts.end))
    }
}

/// The frames of a range of readouts; see [`Reader::frames`].
#[derive(Debug)]
pub struct Frames<'a> {
    reader: &'a Reader,
    frame: Vec<u8>,
    released: usize,
    next: usize,
    end: usize,
}

impl Frames<'_> {
    /// The next packed frame, `None` behind the last.
    ///
    /// Not an [`Iterator`]: the frame lives until the next call, so none is allocated.
    pub fn next_frame(&mut self) -> Option<Result<&[u8]>> {
        if self.next >= self.end {
            return None;
        }
        let result = self.reader.read_frame(self.next, &mut self.frame);
        self.next += 1;
        let passed = (self.next - self.released) * self.reader.codec.frame_bytes();
        if passed >= RELEASE {
            self.reader.release(self.released..self.next);
            self.released = self.next;
        }
        Some(result.map(|()| self.frame.as_slice()))
    }
}

fn layout_tells_geometry(layout: Option<Layout>) -> bool {
    layout.is_some_and(|l| l.fixed_geometry().is_some() || l == Layout::NpyBytes)
}

/// What an array of bytes means: bits or bytes, and how wide.
fn npy_meaning(
    name: &str,
    array: &npy::Array,
    layout: Option<Layout>,
    geometry: Option<Geometry>,
) -> Result<(Layout, Geometry)> {
    let [_, height, last] = array.shape;
    let shape_is = |g: Geometry, last_of_g: usize| (g.height() as u64, last_of_g as u64) == (height, last);
    let layout = layout.unwrap_or_else(|| match geometry {
        // A row of bytes as long as the camera's row of bits can only be packed. One pixel a
        // row reads the same either way.
        Some(g) if !array.is_bool && g.width() > 1 && shape_is(g, g.width().div_ceil(8)) => Layout::NpyBits,
        _ => Layout::NpyBytes,
    });
    if layout == Layout::NpyBits && array.is_bool {
        return Err(Error::new(Kind::Input, name)
            .found("elements of type bool")
            .expected("u8 in layout npy-bits")
            .remedy("name the layout npy-bytes"));
    }
    let per_byte = if layout == Layout::NpyBits { 8 } else { 1 };
    let side = |n: u64| u32::try_from(n).unwrap_or(u32::MAX);
    let found = Geometry::new(side(last.saturating_mul(per_byte)), side(height)).map_err(|_| {
        Error::new(Kind::Input, name)
            .found(format_args!("shape {:?}", array.shape))
            .expected("frames of 1 to 2^28 pixels")
    });
    match geometry {
        Some(g) if shape_is(g, g.width().div_ceil(per_byte as usize)) => Ok((layout, g)),
        Some(g) => Err(other_geometry(name, found?, g)),
        None => Ok((layout, found?)),
    }
}

fn other_geometry(name: &str, found: Geometry, wanted: Geometry) -> Error {
    Error::new(Kind::Input, name)
        .found(format_args!("frames of {found}"))
        .expected(format_args!("{wanted}"))
        .remedy("leave width and height out, or correct them")
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
