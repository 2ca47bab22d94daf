//! Images of a stream.

use std::str::FromStr;

use spikelane::error::Result;
use spikelane::reconstruct::{span_rates, tfi, tfp};
use spikelane::spikes::SpikeFramesRef;
use spikelane::unstable::inputs;
use spikelane::unstable::spikes::unpack_frame;
use spikelane_io::formats::StreamReader;

/// Largest window in readouts.
pub(crate) const MAX_WINDOW_READOUTS: usize = 4096;

/// How an image is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Method {
    /// Spikes in the window divided by its readouts.
    Tfp,
    /// 1 divided by the interval around the readout.
    Tfi,
    /// Intervals in the window divided by the readouts from its first to its last spike.
    Span,
    /// The bits of one readout.
    Bits,
}

impl FromStr for Method {
    type Err = ();

    fn from_str(text: &str) -> std::result::Result<Self, ()> {
        Ok(match text {
            "tfp" => Self::Tfp,
            "tfi" => Self::Tfi,
            "span" => Self::Span,
            "bits" => Self::Bits,
            _ => return Err(()),
        })
    }
}

impl Method {
    /// Returns the number of readouts that are needed before and after the readout of the image.
    ///
    /// A TFI image searches `window` readouts on both sides. The other methods use a centered window.
    pub(crate) fn half_window(self, window: usize) -> usize {
        let window = window.clamp(1, MAX_WINDOW_READOUTS);
        match self {
            Self::Tfp | Self::Span => window / 2,
            Self::Tfi => window,
            Self::Bits => 0,
        }
    }

    /// Returns the image at readout `at` in spikes per readout, one value per pixel, top row first.
    pub(crate) fn image(self, reader: &StreamReader, at: usize, window: usize) -> Result<Vec<f32>> {
        if self == Self::Tfi {
            return Ok(reader.tfi(at, self.half_window(window))?.rates);
        }
        let (frames, center) = reader.read_around(at, self.half_window(window))?;
        self.image_of_frames(frames.view(), center, window)
    }

    /// Returns the image of readout `center` of `frames`.
    pub(crate) fn image_of_frames(
        self,
        frames: SpikeFramesRef<'_>,
        center: usize,
        window: usize,
    ) -> Result<Vec<f32>> {
        let half = self.half_window(window);
        match self {
            Self::Tfp => tfp(frames, center, half),
            Self::Span => span_rates(frames, center, half),
            Self::Tfi => tfi(frames, center, half),
            Self::Bits => {
                let mut bits = inputs::zeroed_vec("bits of a readout", frames.geometry().pixels())?;
                unpack_frame(frames.frame(center).as_bytes(), &mut bits);
                Ok(bits.into_iter().map(f32::from).collect())
            }
        }
    }
}
