//! NumPy arrays (`.npy`): `(T, H, W)`, or `(H, W)` for one frame, of any type of numbers.
//!
//! `u8`, `u16`, `bool` and floats have a full scale of their own; other integers need one that is stated.
//!
//! Read frame by frame, so memory does not grow with the length. Both byte orders are
//! read. Bytes after the array are left alone, as NumPy leaves them.

use std::io::{BufReader, ErrorKind, Read};
use std::path::Path;

use spikelane::error::{Error, Kind, Result};
use spikelane::light::{Curve, Frame, OwnedSamples, Rate, Source, Transfer};
use spikelane::sensor::FrontEnd;
use spikelane::spikes::Geometry;
use spikelane::unstable::inputs::{self, InputFile, MAX_PICTURE_BYTES};
use spikelane::unstable::light::stored_size;
use spikelane::unstable::npy::Header;

use crate::light::fit::Fit;

pub use spikelane::unstable::npy::{Element, MAGIC};

/// Floats above this many full scales are codes rather than light.
const CODES: f32 = 32.0;

/// An array as frames at the camera's size.
pub struct Array {
    reader: Reader<Box<dyn Read + Send>>,
    curve: Curve,
    front_end: FrontEnd,
    fit: Fit,
    camera: Geometry,
    /// The stored number that is full scale, when it was stated.
    scale: Option<f64>,
}

impl Array {
    /// Opens a file and checks that it is long enough.
    ///
    /// # Errors
    /// As [`Array::from_reader`]; [`Kind::Input`] too when the file ends before its array does.
    pub fn open(path: &Path, camera: Geometry, fit: Fit, transfer: Option<Transfer>) -> Result<Self> {
        let name = path.display().to_string();
        let file = InputFile::open(path)?;
        let len = file.len();
        let input = Box::new(BufReader::new(file.into_reader()));
        let array = Self::from_reader(input, &name, camera, fit, transfer)?;
        let wanted = array.reader.total_bytes();
        if len < wanted {
            return Err(Error::new(Kind::Input, name)
                .found(format_args!("{len} bytes"))
                .expected(format_args!("{wanted} as the header says"))
                .remedy("the file was cut short; save it again"));
        }
        Ok(array)
    }

    /// Reads a stream; `name` stands for it in errors. Integers are linear unless `transfer` says otherwise.
    ///
    /// # Errors
    /// As [`Reader::new`]; [`Kind::Usage`] for a transfer function with floats, which are always
    /// linear; [`Kind::Input`] when [`Fit::Crop`] finds the frames too small. Whether full scale has to be stated is
    /// found out by [`Array::with_scale`] and when frames are read.
    pub fn from_reader(
        reader: Box<dyn Read + Send>,
        name: &str,
        camera: Geometry,
        fit: Fit,
        transfer: Option<Transfer>,
    ) -> Result<Self> {
        let reader = Reader::new(reader, name)?;
        let transfer = transfer.unwrap_or(Transfer::Linear);
        if reader.element().is_float() && transfer != Transfer::Linear {
            return Err(Error::new(Kind::Usage, name)
                .found(format_args!("transfer function {transfer} for an {} array", reader.element()))
                .expected("linear, as floats always are")
                .remedy("leave the transfer function out"));
        }
        fit.check(reader.geometry(), camera).map_err(|e| e.within(name))?;
        let front_end = FrontEnd { transfer: Some(transfer), ..FrontEnd::default() };
        Ok(Self { reader, curve: Curve::new(transfer), front_end, fit, camera, scale: None })
    }

    /// Takes integers as the codes of a camera's front end, unless `declared` says another transfer function; floats
    /// stay light.
    #[must_use]
    pub fn with_front_end(mut self, front_end: &FrontEnd, declared: Option<Transfer>) -> Self {
        if !self.reader.element().is_float() {
            let transfer = declared.or(front_end.transfer).unwrap_or(Transfer::Linear);
            self.curve = Curve::new(transfer);
            self.front_end = FrontEnd { transfer: Some(transfer), ..*front_end };
        }
        self
    }

    /// States the stored number that is full scale; without one it is 255, 65535, true or 1.0.
    ///
    /// # Errors
    /// [`Kind::Usage`] for a number that is not positive; [`Kind::Input`] for none where the type has no full scale of its own.
    pub fn with_scale(mut self, scale: Option<f64>) -> Result<Self> {
        if let Some(scale) = scale.filter(|s| !(s.is_finite() && *s > 0.0)) {
            return Err(Error::new(Kind::Usage, "--scale")
                .found(scale)
                .expected("the number of full scale, above 0"));
        }
        self.scale = scale;
        self.check_scale()?;
        Ok(self)
    }

    fn check_scale(&self) -> Result<()> {
        let element = self.reader.element();
        let own = element.is_float() || matches!(element, Element::Bool | Element::U8 | Element::U16);
        if own || self.scale.is_some() {
            return Ok(());
        }
        Err(Error::new(Kind::Input, &self.reader.name)
            .found(format_args!("elements of type {element}, which have no full scale of their own"))
            .expected("the number that is full scale")
            .remedy("give --scale, such as --scale 255 for codes of 8 bits"))
    }

    /// Numbers as shares of full scale.
    fn scaled(&self, samples: OwnedSamples, frame: u64) -> Result<OwnedSamples> {
        let Some(scale) = self.scale else {
            if let OwnedSamples::F32(values) = &samples {
                let most = values.iter().copied().fold(0.0, f32::max);
                if most > CODES && most.is_finite() {
                    return Err(Error::new(Kind::Input, &self.reader.name)
                        .found(format_args!("the value {most} in frame {frame}"))
                        .expected("light with full scale at 1.0")
                        .remedy(
                            "give --scale 255 if 255 is full scale, or --scale 1 if light is that bright",
                        ));
                }
            }
            return Ok(samples);
        };
        let values: Vec<f64> = match samples {
            OwnedSamples::U8(v) if self.reader.element() == Element::Bool => {
                v.into_iter().map(|x| f64::from(x) / 255.0).collect()
            }
            OwnedSamples::U8(v) => v.into_iter().map(f64::from).collect(),
            OwnedSamples::U16(v) => v.into_iter().map(f64::from).collect(),
            OwnedSamples::F32(v) => v.into_iter().map(f64::from).collect(),
        };
        let light = |x: f64| match self.curve.transfer() {
            Transfer::Linear => x,
            // A code below 0 or not finite stays what it is, and is refused as light.
            curve if x >= 0.0 => curve.light(x),
            _ => x,
        };
        Ok(OwnedSamples::F32(values.into_iter().map(|x| light(x / scale) as f32).collect()))
    }

    fn linear(&self, samples: OwnedSamples) -> OwnedSamples {
        if self.curve.transfer() == Transfer::Linear {
            return samples;
        }
        match samples {
            OwnedSamples::U8(v) => {
                let table = self.curve.table8();
                OwnedSamples::U16(v.iter().map(|&c| table[usize::from(c)]).collect())
            }
            OwnedSamples::U16(v) => {
                let table = self.curve.table16();
                OwnedSamples::F32(v.iter().map(|&c| table[usize::from(c)]).collect())
            }
            floats @ OwnedSamples::F32(_) => floats,
        }
    }
}

impl Source for Array {
    fn geometry(&self) -> Geometry {
        self.camera
    }

    fn frames(&self) -> Option<u64> {
        Some(self.reader.frames())
    }

    fn next_frame(&mut self, into: &mut Frame) -> Result<bool> {
        let index = self.reader.next;
        let Some(samples) = self.reader.next_samples()? else {
            return Ok(false);
        };
        self.check_scale()?;
        let scaled = self.scaled(samples, index)?;
        let light = if self.scale.is_some() { scaled } else { self.linear(scaled) };
        let frame = Frame::new(self.reader.geometry(), light)
            .map_err(|e| e.within(format_args!("{}: frame {index}", self.reader.name)))?;
        *into = self.fit.apply(frame, self.camera)?;
        Ok(true)
    }

    fn rate(&self) -> Option<Rate> {
        None
    }

    fn front_end(&self) -> FrontEnd {
        self.front_end
    }

    fn describe(&self) -> String {
        let r = &self.reader;
        let scale = self.scale.map_or(String::new(), |s| format!(", full scale at {s}"));
        format!("{}: {} frames of {}, {}{scale}", r.name, r.frames, r.geometry, r.element)
    }

    fn stored(&self) -> Option<Geometry> {
        Some(self.reader.geometry())
    }
}

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
