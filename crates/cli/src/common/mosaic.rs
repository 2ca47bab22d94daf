//! Flags that describe the color filters of a camera.

use std::fmt::Display;
use std::path::Path;

use spikelane::sensor::Mosaic;
use spikelane::{Error, ErrorKind, Result};

use super::stream::sidecar_beside;

/// The value of `--mosaic` for a camera without color filters.
const NO_MOSAIC: &str = "none";

/// Parses the value of `--mosaic`. The value `none` is `None`.
pub(crate) fn parse(text: &str) -> Result<Option<Mosaic>> {
    if text == NO_MOSAIC {
        return Ok(None);
    }
    let wrong = |e: Error| {
        Error::new(ErrorKind::Usage, "--mosaic")
            .found(e)
            .expected("a pattern such as RGGB or quad-RGGB, or none")
    };
    text.parse().map(Some).map_err(wrong)
}

/// Returns the note about a stream with undeclared color filters. `patterns` are the two possible Bayer patterns.
pub(crate) fn detection_note(stream: impl Display, patterns: &[Mosaic; 2], effect: &str) -> String {
    let [first, second] = patterns;
    format!(
        "note: {stream}: rows and columns alternate as in a color camera with the pattern {first} or {second}; {effect}; to name the pattern, set --mosaic"
    )
}

/// The color filters of the camera that recorded a stream.
#[derive(clap::Args, Clone, Debug)]
pub(crate) struct StreamMosaicArgs {
    /// Set the color filters of the camera, such as RGGB, or none [default: from the sidecar]
    ///
    /// The letters are the filters of the first rows and columns, row by row. quad-RGGB has blocks of 2x2 pixels, and
    /// RGBG/GWGW has one part per row.
    #[arg(hide_short_help = true, long, value_name = "PATTERN", help_heading = "Stream")]
    pub mosaic: Option<String>,
}

impl StreamMosaicArgs {
    /// Returns the mosaic of the stream at `path`: from the flag, else from the sidecar.
    pub(crate) fn of_stream(&self, path: &Path) -> Result<Option<Mosaic>> {
        match &self.mosaic {
            Some(text) => parse(text),
            None => sidecar_beside(path)?.and_then(|(_, s)| s.mosaic).map(|facts| facts.mosaic()).transpose(),
        }
    }
}
