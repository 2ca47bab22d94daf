//! Checks that a headerless file contains whole frames, and lists other frame sizes that match the file length.

use crate::formats::{Codec, Layout};
use spikelane::error::{Error, Result, Setting, error};
use spikelane::spikes::Geometry;
use spikelane::unstable::Count;

/// Frame sizes and layouts of known cameras and data sets.
pub(super) const KNOWN_SIZES: [(u32, u32, Layout); 5] = [
    (400, 250, Layout::Dat),
    (400, 250, Layout::Rows416),
    (1000, 1000, Layout::Dat),
    (1000, 1000, Layout::Rows1024),
    (250, 250, Layout::Dat),
];

/// Returns the number of whole frames in `data` bytes of a headerless file.
///
/// A recording may end inside a frame. However, the file length may be a whole number of frames of a known camera, or
/// of the layout and geometry `declared` in the sidecar. In that case, the geometry of `codec` is probably wrong, and
/// the function returns an error.
pub(super) fn whole_readouts(
    name: &str,
    codec: &Codec,
    data: usize,
    declared: Option<(Layout, Geometry)>,
) -> Result<usize> {
    let frame = codec.frame_bytes();
    let complete_frames = data / frame;
    if complete_frames > 0 && data.is_multiple_of(frame) {
        return Ok(complete_frames);
    }
    let declared = declared.and_then(|(layout, g)| Codec::new(layout, g).ok());
    let other = declared.filter(|t| t != codec).is_some_and(|t| data.is_multiple_of(t.frame_bytes()));
    let sure = declared == Some(*codec);
    if complete_frames == 0 || other || !sure && !hints(data, Some(*codec)).is_empty() {
        return Err(size_mismatch_error(name, codec, data));
    }
    Ok(complete_frames)
}

/// Returns the error for a file whose length is not a whole number of frames.
pub(super) fn size_mismatch_error(name: &str, codec: &Codec, data: usize) -> Error {
    let frame = codec.frame_bytes();
    let error = error!(Input, "{name}");
    let error = if data == 0 {
        error.found("an empty file, 0 bytes")
    } else {
        error.found(format_args!(
            "{} ({} and {})",
            Count(data, "byte"),
            Count(data / frame, "whole frame"),
            Count(data % frame, "byte"),
        ))
    };
    error
        .expected(format_args!(
            "a multiple of {}, one frame of {} in layout {}",
            Count(frame, "byte"),
            codec.geometry(),
            codec.layout()
        ))
        .remedy(remedy(data, Some(*codec)))
}

/// Returns the error for a file whose frame size cannot be determined.
pub(super) fn unknown_size_error(name: &str, data: usize) -> Error {
    error!(Usage, "{name}";
        found "{}, and neither a sidecar nor a config.yaml with width and height", Count(data, "byte");
        expected "width and height of the camera"; remedy "{}", remedy(data, None))
}

fn remedy(data: usize, tried: Option<Codec>) -> String {
    let (settings, hints) = (stream_settings(), hints(data, tried));
    if hints.is_empty() {
        return format!("check {settings}, and whether the file is truncated");
    }
    format!("set {settings} to the values of the file: {}", hints.join("; "))
}

/// Returns the settings that describe a stream without a header.
pub(super) fn stream_settings() -> String {
    format!("{}, {} and {}", Setting("width"), Setting("height"), Setting("layout"))
}

fn hints(data: usize, tried: Option<Codec>) -> Vec<String> {
    let fits = |&(w, h, layout): &(u32, u32, Layout)| {
        let codec = Codec::new(layout, Geometry::new(w, h).ok()?).ok()?;
        let frame = codec.frame_bytes();
        let fits = data > 0 && data.is_multiple_of(frame) && Some(codec) != tried;
        fits.then(|| format!("{frame} bytes per frame match {w}x{h} in layout {layout}"))
    };
    KNOWN_SIZES.iter().filter_map(fits).collect()
}
