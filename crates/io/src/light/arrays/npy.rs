//! NumPy arrays (`.npy`): `(T, H, W)`, or `(H, W)` for one frame, of any type of numbers.
//!
//! `u8`, `u16`, `bool` and floats have a full scale of their own; other integers need one that is stated.
//!
//! Read frame by frame, so memory does not grow with the length. Both byte orders are
//! read. Bytes after the array are left alone, as NumPy leaves them.

use std::io::{BufReader, Read};
use std::path::Path;

use crate::light::fit::Fit;
use spikelane::error::{Error, Kind, Result};
use spikelane::light::Rate;
use spikelane::light::{Curve, Transfer};
use spikelane::light::{Frame, OwnedSamples, Source};
use spikelane::sensor::FrontEnd;
use spikelane::spikes::Geometry;
use spikelane::unstable::inputs::InputFile;

pub use super::npy_reader::Reader;
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
