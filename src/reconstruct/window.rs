//! Texture from playback: spikes counted in a window.

use crate::error::Result;
use crate::kernels::Tally;
use crate::reconstruct::check_readout;
use crate::spikes::Packed;

/// Spikes per readout within `half_window` readouts on either side of `centre`, row-major.
///
/// At the borders of the stream the window is cut and the count is divided by what is left of it.
///
/// # Examples
/// ```
/// use spikelane::{Geometry, Packed, reconstruct};
/// // One pixel of eight that fires at every second readout.
/// let bytes = [1, 0, 1, 0, 1, 0, 1];
/// let rates = reconstruct::tfp(Packed::new(Geometry::new(8, 1)?, &bytes)?, 3, 3)?;
/// assert!((rates[0] - 4.0 / 7.0).abs() < 1e-6 && rates[1] == 0.0);
/// # Ok::<(), spikelane::Error>(())
/// ```
///
/// # Errors
/// [`crate::Kind::Usage`] when `centre` lies beyond the stream.
pub fn tfp(packed: Packed, centre: usize, half_window: usize) -> Result<Vec<f32>> {
    let mut sequence = TfpSequence::new(packed, half_window);
    sequence.move_to(centre)?;
    Ok(sequence.image())
}

/// The window of [`tfp`] as it slides along a stream: a step costs the frames that
/// enter and those that leave, or the whole window where that is less.
#[derive(Clone, Debug)]
pub struct TfpSequence<'a> {
    packed: Packed<'a>,
    half: usize,
    /// Readouts that are counted, half open.
    window: std::ops::Range<usize>,
    counts: Vec<u32>,
}

impl<'a> TfpSequence<'a> {
    /// A window that stands nowhere yet.
    #[must_use]
    pub fn new(packed: Packed<'a>, half_window: usize) -> Self {
        Self {
            packed,
            half: half_window,
            window: 0..0,
            // A last byte may hold bits beyond the last pixel, which must be zero but are not trusted.
            counts: vec![0; packed.geometry().frame_bytes() * 8],
        }
    }

    /// Centres the window on a readout, from wherever it is.
    ///
    /// # Errors
    /// [`crate::Kind::Usage`] when `centre` lies beyond the stream.
    pub fn move_to(&mut self, centre: usize) -> Result<()> {
        check_readout(self.packed, centre)?;
        let from = centre.saturating_sub(self.half);
        let to = centre.saturating_add(self.half).saturating_add(1).min(self.packed.readouts());
        let old = self.window.clone();
        let moved = old.start.abs_diff(from) + old.end.abs_diff(to);
        if moved >= to - from || to <= old.start || old.end <= from {
            self.counts.fill(0);
            self.add(from..to);
        } else {
            self.subtract(old.start..from);
            self.subtract(to..old.end);
            self.add(from..old.start);
            self.add(old.end..to);
        }
        self.window = from..to;
        Ok(())
    }

    /// Spikes per readout of every pixel in the window; zeros before the first [`Self::move_to`].
    #[must_use]
    pub fn image(&self) -> Vec<f32> {
        let readouts = self.window.len().max(1) as f32;
        self.counts[..self.packed.geometry().pixels()].iter().map(|&n| n as f32 / readouts).collect()
    }

    fn add(&mut self, readouts: std::ops::Range<usize>) {
        self.tally(readouts).add(&mut self.counts);
    }

    fn subtract(&mut self, readouts: std::ops::Range<usize>) {
        self.tally(readouts).subtract(&mut self.counts);
    }

    /// The frames of some readouts, none where the range runs backwards.
    fn tally(&self, readouts: std::ops::Range<usize>) -> Tally<'a> {
        let part = self.packed.part(readouts.start..readouts.end.max(readouts.start));
        Tally::new(part.bytes(), self.packed.geometry().frame_bytes())
    }
}
