//! The reference of a static scene. It is computed from the readouts outside the window of a picture.

use std::ops::Range;
use std::path::Path;

use crate::common::images::frames_around;
use spikelane::reconstruct::{DetailReference, tfp};
use spikelane::spikes::SpikeFramesRef;
use spikelane::{Error, ErrorKind, Result};
use spikelane_calibrate::compare::steady_pixels;
use spikelane_io::formats::StreamReader;

/// Largest number of readouts before and after the center that are used.
pub(super) const MAX_SIDE_READOUTS: usize = 4096;

/// Returns the error for a static scene from which no reference can be computed.
pub(super) fn no_detail_error(stream: &Path) -> Error {
    Error::new(ErrorKind::Input, stream.display())
        .found("windows that leave too few readouts, or a scene without detail")
        .expected("a scene with structure, and 20 readouts before and after each window")
        .remedy("reduce --window")
}

/// A stream of a static scene.
pub(crate) struct StaticScene {
    bytes: Vec<u8>,
    geometry: spikelane::Geometry,
    /// Whether nothing changes around each pixel.
    is_steady: Vec<bool>,
    /// Number of the first readout in `bytes`.
    first_readout: usize,
}

impl StaticScene {
    pub(crate) fn read(reader: &StreamReader, at: usize) -> Result<Self> {
        let geometry = reader.geometry();
        let (bytes, center) = frames_around(reader, at, MAX_SIDE_READOUTS)?;
        let packed = SpikeFramesRef::new(geometry, &bytes)?;
        let half = packed.readouts() / 2;
        let spikes = |window: Range<usize>| -> Result<Vec<f64>> {
            let (middle, reach) = (usize::midpoint(window.start, window.end - 1), (window.len() - 1) / 2);
            let readouts = (2 * reach + 1) as f64;
            Ok(tfp(packed, middle, reach)?.iter().map(|rate| f64::from(*rate) * readouts).collect())
        };
        if half == 0 {
            return Err(Error::new(ErrorKind::Usage, "--static-scene")
                .found("one readout")
                .expected("a window, and readouts outside the window"));
        }
        // Both halves have the same odd length.
        let length = half - (half + 1) % 2;
        let (early, late) = (spikes(0..length)?, spikes(half..half + length)?);
        let steady = steady_pixels(&early, &late, geometry.width());
        Ok(Self { bytes, geometry, is_steady: steady, first_readout: at - center })
    }

    /// Returns the share of steady pixels.
    pub(crate) fn steady_share(&self) -> f64 {
        self.is_steady.iter().filter(|s| **s).count() as f64 / self.is_steady.len() as f64
    }

    /// Returns a reference that is computed from the readouts before and after `used_readouts`, the readouts of a
    /// picture.
    pub(crate) fn reference(&self, used_readouts: Range<usize>) -> Result<DetailReference> {
        let packed = SpikeFramesRef::new(self.geometry, &self.bytes)?;
        let from = |at: usize| at.saturating_sub(self.first_readout).min(packed.readouts());
        let others =
            DetailReference::from_surrounding(packed, from(used_readouts.start)..from(used_readouts.end))?;
        Ok(DetailReference { mask: Some(self.is_steady.clone()), ..others })
    }
}
