//! The near-truth of a scene that stands still: what a stream says of it outside of a picture's own readouts.

use std::ops::Range;
use std::path::Path;

use crate::shared::picture::around;
use spikelane::reconstruct::{Reference, tfp};
use spikelane::spikes::Packed;
use spikelane::{Error, Kind, Result};
use spikelane_calibrate::compare::steady;
use spikelane_io::formats::Reader;

/// Readouts on either side that are looked at.
pub(super) const REACH: usize = 4096;

/// Of a still scene that gives nothing to compare with.
pub(super) fn without_detail(stream: &Path) -> Error {
    Error::new(Kind::Input, stream.display())
        .found("windows that leave too few readouts, or a scene without detail")
        .expected("a scene with structure, and 20 readouts before and behind each window")
        .remedy("give a smaller --window")
}

/// A stream whose scene stands still.
pub(crate) struct Still {
    bytes: Vec<u8>,
    geometry: spikelane::Geometry,
    /// Pixels around which nothing changes.
    steady: Vec<bool>,
    /// The first readout of `bytes`.
    first: usize,
}

impl Still {
    pub(crate) fn read(reader: &Reader, at: usize) -> Result<Self> {
        let geometry = reader.geometry();
        let (bytes, centre) = around(reader, at, REACH)?;
        let packed = Packed::new(geometry, &bytes)?;
        let half = packed.readouts() / 2;
        let spikes = |window: Range<usize>| -> Result<Vec<f64>> {
            let (middle, reach) = (usize::midpoint(window.start, window.end - 1), (window.len() - 1) / 2);
            let readouts = (2 * reach + 1) as f64;
            Ok(tfp(packed, middle, reach)?.iter().map(|rate| f64::from(*rate) * readouts).collect())
        };
        if half == 0 {
            return Err(Error::new(Kind::Usage, "--still")
                .found("one readout")
                .expected("a window and others"));
        }
        // Halves of one odd length.
        let length = half - (half + 1) % 2;
        let (early, late) = (spikes(0..length)?, spikes(half..half + length)?);
        let steady = steady(&early, &late, geometry.width());
        Ok(Self { bytes, geometry, steady, first: at - centre })
    }

    /// Share of the pixels around which nothing changes.
    pub(crate) fn share(&self) -> f64 {
        self.steady.iter().filter(|s| **s).count() as f64 / self.steady.len() as f64
    }

    /// The scene as the readouts before a picture's own and those behind them have it.
    pub(crate) fn reference(&self, own: Range<usize>) -> Result<Reference> {
        let packed = Packed::new(self.geometry, &self.bytes)?;
        let from = |at: usize| at.saturating_sub(self.first).min(packed.readouts());
        let others = Reference::of_others(packed, from(own.start)..from(own.end))?;
        Ok(Reference { counted: Some(self.steady.clone()), ..others })
    }
}
