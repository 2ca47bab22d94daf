//! Parsers of readout ranges `A..B` and crops `x,y,w,h`.

use std::ops::Range;
use std::str::FromStr;

use spikelane::{Error, ErrorKind};
use spikelane_io::formats::Crop;

/// A range of readouts: `A..B`, `A..` or `..B`. Readout B is not included.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct ReadoutRange {
    first: usize,
    end: Option<usize>,
}

impl ReadoutRange {
    pub(crate) fn resolve(self, readouts: usize) -> Range<usize> {
        self.first..self.end.unwrap_or(readouts)
    }
}

impl FromStr for ReadoutRange {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let bad = || {
            Error::new(ErrorKind::Usage, "readouts")
                .found(format_args!("`{text}`"))
                .expected("A..B, A.. or ..B with A less than B, such as 0..1000")
        };
        let (first, end) = text.split_once("..").ok_or_else(bad)?;
        let number = |s: &str| s.parse::<usize>().map_err(|_| bad());
        let first = if first.is_empty() { 0 } else { number(first)? };
        let end = if end.is_empty() { None } else { Some(number(end)?) };
        if end.is_some_and(|end| end <= first) {
            return Err(bad());
        }
        Ok(Self { first, end })
    }
}

/// A rectangle `x,y,width,height` in pixels.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CropArg(pub Crop);

impl FromStr for CropArg {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let numbers: Result<Vec<usize>, _> = text.split(',').map(|s| s.trim().parse()).collect();
        match numbers.as_deref() {
            Ok(&[col, row, width, height]) => Ok(Self(Crop { row, col, width, height })),
            _ => Err(Error::new(ErrorKind::Usage, "crop")
                .found(format_args!("`{text}`"))
                .expected("x,y,width,height in pixels, such as 100,50,64,64")),
        }
    }
}
