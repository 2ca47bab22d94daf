//! The frames of an array of NumPy, one after the other, as they are stored.

use std::io::{ErrorKind, Read};

use spikelane::error::{Error, Kind, Result};
use spikelane::light::OwnedSamples;
use spikelane::spikes::Geometry;
use spikelane::unstable::inputs::{self, MAX_PICTURE_BYTES};
use spikelane::unstable::light::stored_size;
use spikelane::unstable::npy::{Element, Header};

/// Frames of an array at their own size, as they are stored.
pub struct Reader<R: Read> {
    pub(super) name: String,
    pub(super) reader: R,
    pub(super) geometry: Geometry,
    pub(super) frames: u64,
    pub(super) next: u64,
    pub(super) element: Element,
    pub(super) big_endian: bool,
    pub(super) header_bytes: u64,
}

impl<R: Read> Reader<R> {
    /// Reads the header. `name` stands for the stream in errors.
    ///
    /// # Errors
    /// [`Kind::Input`] when the header is damaged, or the array's type, shape or order is not one that is
    /// read here; [`Kind::Io`] when reading fails.
    pub fn new(mut reader: R, name: &str) -> Result<Self> {
        let header = Header::read(name, &mut reader)?;
        if header.fortran && header.shape.len() > 1 {
            return Err(Error::new(Kind::Input, name)
                .found("column-major (Fortran) order")
                .expected("C order")
                .remedy("save np.ascontiguousarray(a)"));
        }
        let (frames, geometry) = shape(&header.shape, name)?;
        let element = header.element;
        if (geometry.pixels() * element.bytes()) as u64 > MAX_PICTURE_BYTES {
            return Err(Error::new(Kind::Input, name)
                .found(format_args!("frames of {geometry}, {element}"))
                .expected(format_args!("frames of at most {MAX_PICTURE_BYTES} bytes")));
        }
        Ok(Self {
            name: name.to_owned(),
            reader,
            geometry,
            frames,
            next: 0,
            element,
            big_endian: header.big_endian,
            header_bytes: header.start as u64,
        })
    }

    /// Width and height of the array's frames.
    #[must_use]
    pub const fn geometry(&self) -> Geometry {
        self.geometry
    }

    /// Number of frames that the header declares.
    #[must_use]
    pub const fn frames(&self) -> u64 {
        self.frames
    }

    /// Type of the elements.
    #[must_use]
    pub const fn element(&self) -> Element {
        self.element
    }

    /// Whether elements of more than a byte are stored with the highest byte first.
    #[must_use]
    pub const fn big_endian(&self) -> bool {
        self.big_endian
    }

    /// Bytes of header and frames together.
    #[must_use]
    pub const fn total_bytes(&self) -> u64 {
        let frame = self.geometry.pixels() as u64 * self.element.bytes() as u64;
        self.header_bytes.saturating_add(self.frames.saturating_mul(frame))
    }

    /// The elements of the next frame, or `None` after the last one.
    ///
    /// # Errors
    /// [`Kind::Input`] when the data end early, [`Kind::Io`] when reading fails.
    pub fn next_samples(&mut self) -> Result<Option<OwnedSamples>> {
        if self.next == self.frames {
            return Ok(None);
        }
        let wanted = self.geometry.pixels() * self.element.bytes();
        // `take` grows the buffer with what comes, so a false header cannot ask for memory.
        let mut bytes = Vec::new();
        self.reader.by_ref().take(wanted as u64).read_to_end(&mut bytes).map_err(|e| match e.kind() {
            // What a compressed archive says of its own bytes.
            ErrorKind::InvalidData => damaged(&self.name, e),
            _ => Error::io(&self.name, e),
        })?;
        if bytes.len() < wanted {
            return Err(cut_short(&self.name, self.next, self.frames));
        }
        self.next += 1;
        self.decode(bytes).map(Some)
    }

    fn decode(&self, bytes: Vec<u8>) -> Result<OwnedSamples> {
        Ok(match self.element {
            Element::U8 => OwnedSamples::U8(bytes),
            Element::U16 => {
                let order = if self.big_endian { u16::from_be_bytes } else { u16::from_le_bytes };
                OwnedSamples::U16(bytes.as_chunks().0.iter().map(|b| order(*b)).collect())
            }
            Element::Bool => OwnedSamples::U8(bytes.iter().map(|b| if *b == 0 { 0 } else { 255 }).collect()),
            Element::F32 => {
                let order = if self.big_endian { f32::from_be_bytes } else { f32::from_le_bytes };
                OwnedSamples::F32(bytes.as_chunks().0.iter().map(|b| order(*b)).collect())
            }
            other => {
                let mut values = inputs::buffer(&self.name, self.geometry.pixels())?;
                other.for_each(self.big_endian, &bytes, |v| values.push(v as f32));
                OwnedSamples::F32(values)
            }
        })
    }
}

fn cut_short(name: &str, frame: u64, frames: u64) -> Error {
    Error::new(Kind::Input, name)
        .found(format_args!("the end within frame {frame}"))
        .expected(format_args!("{frames} frames, as the header says"))
        .remedy("the file was cut short; save it again")
}

fn damaged(name: &str, found: impl std::fmt::Display) -> Error {
    Error::new(Kind::Input, name)
        .found(found)
        .expected("a NumPy array file")
        .remedy("save it again with np.save")
}

fn shape(shape: &[u64], name: &str) -> Result<(u64, Geometry)> {
    let (frames, rows, cols) = match *shape {
        [rows, cols] => (1, rows, cols),
        // A channel of length 1 is no axis.
        [frames, 1, rows, cols] | [frames, rows, cols, 1] | [frames, rows, cols] => (frames, rows, cols),
        _ => {
            return Err(Error::new(Kind::Input, name)
                .found(format_args!("shape {shape:?}"))
                .expected("(frames, height, width) or (height, width)")
                .remedy("reshape or average colour channels before saving"));
        }
    };
    if frames == 0 {
        return Err(Error::new(Kind::Input, name)
            .found(format_args!("shape {shape:?}"))
            .expected("at least one frame"));
    }
    Ok((frames, stored_size(cols, rows, name)?))
}
