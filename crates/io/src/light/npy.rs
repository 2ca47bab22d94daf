//! NumPy arrays (`.npy`) of numbers with shape `(T, H, W)` or, in color, `(T, H, W, 3)`, or `(H, W)` for one frame.
//!
//! Full scale is the array value that represents light 1.0. It has a default value for `u8`, `u16`, `bool` and
//! floats. For other integer types, the caller must give a value.
//!
//! Arrays in both byte orders are read frame by frame, so memory use does not depend on the number of frames. Bytes
//! after the array are ignored, as in NumPy.

use std::io::{self, BufReader, Read};
use std::path::Path;

use spikelane::error::{Error, ErrorKind, Result, Setting};
use spikelane::light::{Frame, OwnedSamples, Rate, Source, ToneCurve, Transfer};
use spikelane::sensor::{FrontEnd, FullScale};
use spikelane::spikes::Geometry;
use spikelane::unstable::Count;
use spikelane::unstable::inputs::{self, InputFile, MAX_PICTURE_BYTES};
use spikelane::unstable::light::declared_geometry;
use spikelane::unstable::npy::{Header, shape_text};

use crate::light::full_scale::{check_float_light, check_full_scale};
use crate::light::images::encoding::{CodeScan, Encoding};
use crate::light::resize_mode::ResizeMode;

pub use spikelane::unstable::npy::{Element, MAGIC};

/// An array as a source of frames at the camera's size.
pub struct ArraySource {
    reader: ArrayReader<Box<dyn Read + Send>>,
    curve: ToneCurve,
    front_end: FrontEnd,
    resize_mode: ResizeMode,
    camera: Geometry,
    /// Whether the frames of a color array keep their colors.
    keeps_color: bool,
    /// The array value of full scale, if the caller gave one.
    scale: Option<f64>,
    /// The 16-bit codes of the first, middle and last frame, if the array is in a file.
    codes: CodeScan,
}

impl ArraySource {
    /// Opens a file and checks its length.
    ///
    /// # Errors
    /// Errors of [`ArraySource::from_reader`]. Also [`ErrorKind::Input`] if the file ends before the end of the array.
    pub fn open(
        path: &Path,
        camera: Geometry,
        resize_mode: ResizeMode,
        transfer: Option<Transfer>,
    ) -> Result<Self> {
        let name = path.display().to_string();
        let file = InputFile::open(path)?;
        let len = file.len();
        let input = Box::new(BufReader::new(InputFile::open(path)?.into_reader()));
        let mut array = Self::from_reader(input, &name, camera, resize_mode, transfer)?;
        let wanted = array.reader.total_bytes();
        if len < wanted {
            return Err(Error::new(ErrorKind::Input, name)
                .found(Count(len, "byte"))
                .expected(format_args!("{}, as stated in the header", Count(wanted, "byte")))
                .remedy("the file is truncated; save the array again"));
        }
        array.codes = array.reader.scan_codes(&file)?;
        Ok(array)
    }

    /// Reads an array from a stream. Error messages refer to the stream as `name`. If `transfer` is `None`, integers
    /// are linear.
    ///
    /// An element type without a default full scale is not an error of this function. [`ArraySource::with_scale`] and
    /// the reading of frames report the missing full scale.
    ///
    /// # Errors
    /// * Errors of [`ArrayReader::new`].
    /// * [`ErrorKind::Usage`] if a nonlinear transfer function is given for floats, which are always linear.
    /// * [`ErrorKind::Input`] if the mode is [`ResizeMode::Crop`] and the frames are smaller than the camera.
    pub fn from_reader(
        reader: Box<dyn Read + Send>,
        name: &str,
        camera: Geometry,
        resize_mode: ResizeMode,
        transfer: Option<Transfer>,
    ) -> Result<Self> {
        let reader = ArrayReader::new(reader, name)?;
        let transfer = transfer.unwrap_or(Transfer::Linear);
        if reader.element().is_float() && transfer != Transfer::Linear {
            return Err(Error::new(ErrorKind::Usage, name)
                .found(format_args!("transfer function {transfer} for an {} array", reader.element()))
                .expected("linear, because floats are always linear")
                .remedy(format_args!("omit {}", Setting("transfer"))));
        }
        resize_mode.check(reader.geometry(), camera).map_err(|e| e.with_context(name))?;
        let front_end = FrontEnd { transfer: Some(transfer), ..FrontEnd::default() };
        Ok(Self {
            reader,
            curve: ToneCurve::new(transfer),
            front_end,
            resize_mode,
            camera,
            keeps_color: false,
            scale: None,
            codes: CodeScan::default(),
        })
    }

    /// Converts integers with the camera's front end. The transfer function `declared` overrides the transfer function
    /// of the front end. Floats remain linear light.
    #[must_use]
    pub fn with_front_end(mut self, front_end: &FrontEnd, declared: Option<Transfer>) -> Self {
        if !self.reader.element().is_float() {
            let transfer = declared.or(front_end.transfer).unwrap_or(Transfer::Linear);
            self.curve = ToneCurve::new(transfer);
            self.front_end = FrontEnd { transfer: Some(transfer), ..*front_end };
        }
        self
    }

    /// Sets whether the frames of a color array keep their colors ([`Frame::rgb`]).
    #[must_use]
    pub(in crate::light) fn with_color(mut self, keeps_color: bool) -> Self {
        self.keeps_color = keeps_color;
        self
    }

    /// Sets the array value of full scale. If `scale` is `None`, full scale is 255 for `u8`, 65535 for `u16`, true for
    /// `bool` and 1.0 for floats.
    ///
    /// # Errors
    /// * [`ErrorKind::Usage`] if `scale` is not finite and positive.
    /// * [`ErrorKind::Input`] if `scale` is `None` and the element type has no default.
    pub fn with_scale(mut self, scale: Option<f64>) -> Result<Self> {
        self.scale = scale.map(check_full_scale).transpose()?;
        self.check_scale()?;
        Ok(self)
    }

    fn check_scale(&self) -> Result<()> {
        let element = self.reader.element();
        let is_supported =
            element.is_float() || matches!(element, Element::Bool | Element::U8 | Element::U16);
        if is_supported || self.scale.is_some() {
            return Ok(());
        }
        Err(Error::new(ErrorKind::Input, &self.reader.name)
            .found(format_args!("elements of type {element}, which have no default full scale"))
            .expected("the value of full scale")
            .remedy(format_args!("set {}, for example to 255 for 8-bit codes", Setting("full_scale"))))
    }

    /// Divides the samples by full scale.
    fn to_full_scale(&self, samples: OwnedSamples, frame: u64) -> Result<OwnedSamples> {
        let Some(scale) = self.scale else {
            if let OwnedSamples::F32(values) = &samples {
                check_float_light(values, &self.reader.name, format_args!(" in frame {frame}"))?;
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
            // A negative or non-finite code is not converted. `Frame::new` rejects the code later.
            curve if x >= 0.0 => curve.light(x),
            _ => x,
        };
        Ok(OwnedSamples::F32(values.into_iter().map(|x| light(x / scale) as f32).collect()))
    }

    /// Returns the frame with linear samples. The samples of a color array are red, green and blue of each pixel.
    fn frame(&self, samples: OwnedSamples) -> Result<Frame> {
        let geometry = self.reader.geometry();
        if self.reader.channels == 1 {
            return Frame::new(geometry, samples);
        }
        let rgb: Vec<f32> = match samples {
            OwnedSamples::U8(v) => v.into_iter().map(|x| f32::from(x) / 255.0).collect(),
            OwnedSamples::U16(v) => v.into_iter().map(|x| f32::from(x) / 65535.0).collect(),
            OwnedSamples::F32(v) => v,
        };
        let [red, green, blue] = self.front_end.luminance.map(|w| w as f32);
        let light = rgb.as_chunks::<3>().0.iter().map(|[r, g, b]| red * r + green * g + blue * b).collect();
        let frame = Frame::new(geometry, OwnedSamples::F32(light))?;
        if self.keeps_color { frame.with_rgb(rgb) } else { Ok(frame) }
    }

    fn linearize(&self, samples: OwnedSamples) -> OwnedSamples {
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

impl Source for ArraySource {
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
        let scaled = self.to_full_scale(samples, index)?;
        let light = if self.scale.is_some() { scaled } else { self.linearize(scaled) };
        let frame = self
            .frame(light)
            .map_err(|e| e.with_context(format_args!("{}: frame {index}", self.reader.name)))?;
        *into = self.resize_mode.apply(frame, self.camera)?;
        Ok(true)
    }

    fn rate(&self) -> Option<Rate> {
        None
    }

    fn front_end(&self) -> FrontEnd {
        self.front_end
    }

    fn full_scale(&self) -> FullScale {
        let largest = match self.reader.element() {
            Element::U8 => 255.0,
            Element::U16 => 65535.0,
            _ => 1.0,
        };
        self.front_end.full_scale.in_units_of(self.scale.unwrap_or(largest))
    }

    fn describe(&self) -> String {
        let r = &self.reader;
        let scale = self.scale.map_or(String::new(), |s| format!(", full scale at {s}"));
        let color = if r.channels == 3 { ", RGB" } else { "" };
        format!("{}: {} of {}, {}{color}{scale}", r.name, Count(r.frames, "frame"), r.geometry, r.element)
    }

    fn stored_geometry(&self) -> Option<Geometry> {
        Some(self.reader.geometry())
    }

    fn notes(&self) -> Vec<String> {
        if self.scale.is_some() || self.front_end.full_scale != FullScale::MAX_CODE {
            return Vec::new();
        }
        let note = self.codes.apply(&mut Encoding::default(), "of the first, middle and last frame");
        note.into_iter().map(|note| format!("{}: {note}", self.reader.name)).collect()
    }
}

/// Reads the frames of an array at their original size. The elements are not converted to light.
pub struct ArrayReader<R: Read> {
    pub(super) name: String,
    pub(super) reader: R,
    pub(super) geometry: Geometry,
    /// 1 for gray frames, and 3 for red, green and blue.
    pub(super) channels: usize,
    pub(super) frames: u64,
    pub(super) next: u64,
    pub(super) element: Element,
    pub(super) is_big_endian: bool,
    pub(super) header_bytes: u64,
}

impl<R: Read> ArrayReader<R> {
    /// Reads the header. Error messages refer to the stream as `name`.
    ///
    /// # Errors
    /// * [`ErrorKind::Input`] if the header is damaged, or if type, shape or order is not supported.
    /// * [`ErrorKind::Io`] if reading fails.
    pub fn new(mut reader: R, name: &str) -> Result<Self> {
        let header = Header::read(name, &mut reader)?;
        if header.is_fortran_order && header.shape.len() > 1 {
            return Err(Error::new(ErrorKind::Input, name)
                .found("column-major (Fortran) order")
                .expected("C order")
                .remedy("save np.ascontiguousarray(a)"));
        }
        let (frames, geometry, channels) = shape(&header.shape, name)?;
        let element = header.element;
        if (channels * geometry.pixels() * element.bytes()) as u64 > MAX_PICTURE_BYTES {
            return Err(Error::new(ErrorKind::Input, name)
                .found(format_args!("frames of {geometry}, {element}"))
                .expected(format_args!("frames of at most {MAX_PICTURE_BYTES} bytes")));
        }
        Ok(Self {
            name: name.to_owned(),
            reader,
            geometry,
            channels,
            frames,
            next: 0,
            element,
            is_big_endian: header.is_big_endian,
            header_bytes: header.data_offset as u64,
        })
    }

    /// Returns the width and height of the array's frames.
    #[must_use]
    pub const fn geometry(&self) -> Geometry {
        self.geometry
    }

    /// Returns the number of frames that the header declares.
    #[must_use]
    pub const fn frames(&self) -> u64 {
        self.frames
    }

    /// Returns the element type.
    #[must_use]
    pub const fn element(&self) -> Element {
        self.element
    }

    /// Returns whether multi-byte elements are stored in big-endian order.
    #[must_use]
    pub const fn is_big_endian(&self) -> bool {
        self.is_big_endian
    }

    /// Returns the number of values per pixel: 1 for gray frames, and 3 for red, green and blue.
    #[must_use]
    pub const fn channels(&self) -> usize {
        self.channels
    }

    const fn frame_bytes(&self) -> usize {
        self.channels * self.geometry.pixels() * self.element.bytes()
    }

    /// Returns the total number of bytes of the header and all frames.
    #[must_use]
    pub const fn total_bytes(&self) -> u64 {
        let frame = self.frame_bytes() as u64;
        self.header_bytes.saturating_add(self.frames.saturating_mul(frame))
    }

    /// Returns the 16-bit codes of the first, middle and last frame of the array in `file`.
    fn scan_codes(&self, file: &InputFile) -> Result<CodeScan> {
        let mut scan = CodeScan::default();
        if self.element != Element::U16 {
            return Ok(scan);
        }
        let mut frames = vec![0, self.frames / 2, self.frames - 1];
        frames.dedup();
        let len = self.frame_bytes();
        for frame in frames {
            let mut bytes = inputs::zeroed_vec(&self.name, len)?;
            file.read_at(self.header_bytes + frame * len as u64, &mut bytes)?;
            if let OwnedSamples::U16(codes) = self.decode(bytes)? {
                scan.add(codes.into_iter());
            }
        }
        Ok(scan)
    }

    /// Returns the elements of the next frame, or `None` after the last frame.
    ///
    /// # Errors
    /// * [`ErrorKind::Input`] if the stream ends before the end of the frame.
    /// * [`ErrorKind::Io`] if reading fails.
    pub fn next_samples(&mut self) -> Result<Option<OwnedSamples>> {
        if self.next == self.frames {
            return Ok(None);
        }
        let wanted = self.frame_bytes();
        // The buffer grows only as bytes are read, so a header with a wrong size cannot cause a large allocation.
        let mut bytes = Vec::new();
        self.reader.by_ref().take(wanted as u64).read_to_end(&mut bytes).map_err(|e| match e.kind() {
            // The reader of a compressed archive returns this error kind for damaged data.
            io::ErrorKind::InvalidData => damaged_error(&self.name, e),
            _ => Error::io(&self.name, e),
        })?;
        if bytes.len() < wanted {
            return Err(truncated_error(&self.name, self.next, self.frames));
        }
        self.next += 1;
        self.decode(bytes).map(Some)
    }

    fn decode(&self, bytes: Vec<u8>) -> Result<OwnedSamples> {
        Ok(match self.element {
            Element::U8 => OwnedSamples::U8(bytes),
            Element::U16 => {
                let order = if self.is_big_endian { u16::from_be_bytes } else { u16::from_le_bytes };
                OwnedSamples::U16(bytes.as_chunks().0.iter().map(|b| order(*b)).collect())
            }
            Element::Bool => OwnedSamples::U8(bytes.iter().map(|b| if *b == 0 { 0 } else { 255 }).collect()),
            Element::F32 => {
                let order = if self.is_big_endian { f32::from_be_bytes } else { f32::from_le_bytes };
                OwnedSamples::F32(bytes.as_chunks().0.iter().map(|b| order(*b)).collect())
            }
            other => {
                let mut values = inputs::reserved_vec(&self.name, self.channels * self.geometry.pixels())?;
                other.for_each(self.is_big_endian, &bytes, |v| values.push(v as f32));
                OwnedSamples::F32(values)
            }
        })
    }
}

fn truncated_error(name: &str, frame: u64, frames: u64) -> Error {
    Error::new(ErrorKind::Input, name)
        .found(format_args!("the end of the file in frame {frame}"))
        .expected(format_args!("{}, as stated in the header", Count(frames, "frame")))
        .remedy("the file is truncated; save the array again")
}

fn damaged_error(name: &str, found: impl std::fmt::Display) -> Error {
    Error::new(ErrorKind::Input, name)
        .found(found)
        .expected("a NumPy array file")
        .remedy("save the array again with np.save")
}

/// Returns the number of frames, the geometry, and the number of values per pixel.
fn shape(shape: &[u64], name: &str) -> Result<(u64, Geometry, usize)> {
    let (frames, rows, cols, channels) = match *shape {
        [rows, cols] => (1, rows, cols, 1),
        // An axis of length 1 is a channel axis and is removed.
        [frames, 1, rows, cols] | [frames, rows, cols, 1] | [frames, rows, cols] => (frames, rows, cols, 1),
        [frames, rows, cols, 3] => (frames, rows, cols, 3),
        _ => {
            return Err(Error::new(ErrorKind::Input, name)
                .found(format_args!("shape {}", shape_text(shape)))
                .expected("(frames, height, width), (frames, height, width, 3) or (height, width)")
                .remedy("reshape the array and save the result"));
        }
    };
    if frames == 0 {
        return Err(Error::new(ErrorKind::Input, name)
            .found(format_args!("shape {}", shape_text(shape)))
            .expected("at least one frame"));
    }
    Ok((frames, declared_geometry(cols, rows, name)?, channels))
}
