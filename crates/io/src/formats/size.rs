//! Does a file hold whole frames, and if not, what could it be?

use crate::formats::{Codec, Layout};
use spikelane::error::{Error, Kind, Result};
use spikelane::spikes::Geometry;

/// Sizes of known cameras and data sets, for hints.
pub(super) const KNOWN: [(u32, u32, Layout); 5] = [
    (400, 250, Layout::Dat),
    (400, 250, Layout::Rows416),
    (1000, 1000, Layout::Dat),
    (1000, 1000, Layout::Rows1024),
    (250, 250, Layout::Dat),
];

/// The number of whole frames in `data` bytes of a file without header.
///
/// A recording may stop inside a frame. But where another reading holds whole frames, of a known camera or what the
/// sidecar told, the one that was wanted is the likelier mistake.
pub(super) fn readouts(
    name: &str,
    codec: &Codec,
    data: usize,
    told: Option<(Layout, Geometry)>,
) -> Result<usize> {
    let frame = codec.frame_bytes();
    let whole = data / frame;
    if whole > 0 && data.is_multiple_of(frame) {
        return Ok(whole);
    }
    let told = told.and_then(|(layout, g)| Codec::new(layout, g).ok());
    let other = told.filter(|t| t != codec).is_some_and(|t| data.is_multiple_of(t.frame_bytes()));
    let sure = told == Some(*codec);
    if whole == 0 || other || !sure && !hints(data, Some(*codec)).is_empty() {
        return Err(mismatch(name, codec, data));
    }
    Ok(whole)
}

/// The error for a file that holds no whole number of frames.
pub(super) fn mismatch(name: &str, codec: &Codec, data: usize) -> Error {
    let frame = codec.frame_bytes();
    let error = Error::new(Kind::Input, name);
    let error = if data == 0 {
        error.found("an empty file, 0 bytes")
    } else {
        error.found(format_args!("{data} bytes ({} whole frames and {} bytes)", data / frame, data % frame))
    };
    error
        .expected(format_args!(
            "a multiple of {frame} bytes, one frame of {} in layout {}",
            codec.geometry(),
            codec.layout()
        ))
        .remedy(remedy(data, Some(*codec)))
}

/// The error for a file of which nothing tells the size of a frame.
pub(super) fn unknown(name: &str, data: usize) -> Error {
    Error::new(Kind::Usage, name)
        .found(format_args!("{data} bytes, no sidecar and no config.yaml that give width and height"))
        .expected("width and height of the camera")
        .remedy(remedy(data, None))
}

fn remedy(data: usize, tried: Option<Codec>) -> String {
    let hints = hints(data, tried);
    if hints.is_empty() {
        return "check width, height and layout, or whether the file was cut short".into();
    }
    format!("give the width, height and layout it was written with: {}", hints.join("; "))
}

fn hints(data: usize, tried: Option<Codec>) -> Vec<String> {
    let fits = |&(w, h, layout): &(u32, u32, Layout)| {
        let codec = Codec::new(layout, Geometry::new(w, h).ok()?).ok()?;
        let frame = codec.frame_bytes();
        let fits = data > 0 && data.is_multiple_of(frame) && Some(codec) != tried;
        fits.then(|| format!("{frame} bytes a frame would be {w}x{h} in layout {layout}"))
    };
    KNOWN.iter().filter_map(fits).collect()
}
