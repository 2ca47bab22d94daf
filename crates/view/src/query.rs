//! The parameters of a request.

use std::ops::Range;
use std::str::FromStr;

use spikelane::error::{Result, bail, error};
use spikelane::spikes::{Crop, Geometry};

/// The parameters after `?`, such as `at=12&method=tfp`. Values are numbers and short words, so no value is escaped.
pub(crate) struct Query<'a>(pub(crate) &'a str);

/// A stream: index of a path, and for paths with several streams the index of the item.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct StreamKey {
    pub(crate) source: usize,
    pub(crate) item: Option<usize>,
    /// Whether the clean stream of a sequence is read.
    pub(crate) is_clean: bool,
}

impl FromStr for StreamKey {
    type Err = ();

    /// Parses `0`, `0.3` or `0.3.clean`.
    fn from_str(text: &str) -> std::result::Result<Self, ()> {
        let mut parts = text.split('.');
        let source = parts.next().and_then(|p| p.parse().ok()).ok_or(())?;
        let item = parts.next().map(|p| p.parse().map_err(|_| ())).transpose()?;
        let is_clean = match parts.next() {
            None => false,
            Some("clean") => true,
            Some(_) => return Err(()),
        };
        if parts.next().is_some() { Err(()) } else { Ok(Self { source, item, is_clean }) }
    }
}

impl<'a> Query<'a> {
    /// Returns the text of a parameter.
    pub(crate) fn text(&self, name: &str) -> Option<&'a str> {
        self.0
            .split('&')
            .filter_map(|pair| pair.split_once('='))
            .find(|(key, _)| *key == name)
            .map(|(_, v)| v)
    }

    /// Returns the value of a parameter.
    ///
    /// # Errors
    /// [`ErrorKind::Usage`](spikelane::ErrorKind::Usage) if the parameter is missing or invalid.
    pub(crate) fn get<T: FromStr>(&self, name: &str) -> Result<T> {
        let text = self.text(name);
        text.and_then(|t| t.parse().ok()).ok_or_else(|| {
            error!(Usage, "parameter {name}";
                found "{}", text.map_or("nothing".to_owned(), |t| format!("{t:?}")); expected "a valid value")
        })
    }

    /// Returns the stream of parameter `s`.
    pub(crate) fn stream(&self) -> Result<StreamKey> {
        self.get("s")
    }

    /// Returns the rectangle of the parameters `x`, `y`, `w` and `h`, which must be inside `geometry`.
    pub(crate) fn crop(&self, geometry: Geometry) -> Result<Crop> {
        let crop =
            Crop { row: self.get("y")?, col: self.get("x")?, width: self.get("w")?, height: self.get("h")? };
        crop.geometry(geometry).map(|_| crop)
    }

    /// Returns the range of the parameters `from` and `to`, which must be inside `0..readouts` and not empty.
    pub(crate) fn readouts(&self, readouts: usize) -> Result<Range<usize>> {
        let range: Range<usize> = self.get("from")?..self.get("to")?;
        if range.is_empty() || range.end > readouts {
            bail!(Usage, "readouts"; found "{}..{}", range.start, range.end;
                expected "a range within 0..{readouts}");
        }
        Ok(range)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stream_keys_are_numbers_and_the_word_clean() {
        let key = |source, item, is_clean| Ok(StreamKey { source, item, is_clean });
        assert_eq!("1".parse(), key(1, None, false));
        assert_eq!("0.12".parse(), key(0, Some(12), false));
        assert_eq!("0.12.clean".parse(), key(0, Some(12), true));
        for wrong in ["", ".", "-1", "0.", "0.x", "0.1.dirty", "0.1.clean.2", "../etc", "0/1"] {
            assert_eq!(wrong.parse::<StreamKey>(), Err(()), "{wrong}");
        }
    }
}
