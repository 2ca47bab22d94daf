//! `A..B` and `x,y,w,h`.

use std::ops::Range;
use std::str::FromStr;

use spikelane::{Error, Kind};
use spikelane_io::formats::Crop;

/// Readouts `A..B`, `A..` or `..B`; B is not in it.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Readouts {
    first: usize,
    end: Option<usize>,
}

impl Readouts {
    pub(crate) fn of(self, readouts: usize) -> Range<usize> {
        self.first..self.end.unwrap_or(readouts)
    }
}

impl FromStr for Readouts {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let bad = || {
            Error::new(Kind::Usage, "readouts")
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
pub(crate) struct Rectangle(pub Crop);

impl FromStr for Rectangle {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let numbers: Result<Vec<usize>, _> = text.split(',').map(|s| s.trim().parse()).collect();
        match numbers.as_deref() {
            Ok(&[x, y, width, height]) => Ok(Self(Crop { x, y, width, height })),
            _ => Err(Error::new(Kind::Usage, "crop")
                .found(format_args!("`{text}`"))
                .expected("x,y,width,height in pixels, such as 100,50,64,64")),
        }
    }
}
