//! Texture from playback (TFP): the number of spikes in a window.

use crate::error::Result;
use crate::kernels::Tally;
use crate::reconstruct::check_readout;
use crate::spikes::SpikeFramesRef;

/// Returns the rate of every pixel in spikes per readout, row-major.
///
/// The window contains `half_window` readouts before `center` and `half_window` readouts after `center`. At the ends of
/// the stream the window is shorter. The number of spikes is divided by the actual length of the window.
///
/// # Examples
/// ```
/// use spikelane::{Geometry, SpikeFramesRef, reconstruct};
/// // One pixel of eight that fires at every second readout.
/// let bytes = [1, 0, 1, 0, 1, 0, 1];
/// let rates = reconstruct::tfp(SpikeFramesRef::new(Geometry::new(8, 1)?, &bytes)?, 3, 3)?;
/// assert!((rates[0] - 4.0 / 7.0).abs() < 1e-6 && rates[1] == 0.0);
/// # Ok::<(), spikelane::Error>(())
/// ```
///
/// # Errors
/// Returns [`ErrorKind::Usage`](crate::ErrorKind::Usage) if `center` is not a readout of the stream.
pub fn tfp(packed: SpikeFramesRef, center: usize, half_window: usize) -> Result<Vec<f32>> {
    let mut sequence = TfpSequence::new(packed, half_window);
    sequence.move_to(center)?;
    Ok(sequence.image())
}

/// A window of [`tfp`] that moves along a stream.
///
/// [`Self::move_to`] counts only the spikes of the readouts that enter or leave the window. If the whole new window has
/// fewer readouts, [`Self::move_to`] counts the whole new window instead.
///
/// # Examples
/// ```
/// use spikelane::{Geometry, SpikeFramesRef, reconstruct};
/// // One pixel of eight fires at every second readout, then at every readout.
/// let bytes = [1, 0, 1, 0, 1, 0, 1, 1, 1, 1];
/// let stream = SpikeFramesRef::new(Geometry::new(8, 1)?, &bytes)?;
/// let mut window = reconstruct::TfpSequence::new(stream, 1);
/// let mut rates = Vec::new();
/// for center in [1, 7, 8] {
///     window.move_to(center)?;
///     rates.push(window.image()[0]);
/// }
/// assert_eq!(rates, [2.0 / 3.0, 1.0, 1.0]);
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct TfpSequence<'a> {
    packed: SpikeFramesRef<'a>,
    half: usize,
    /// Range of the counted readouts.
    window: std::ops::Range<usize>,
    counts: Vec<u32>,
}

impl<'a> TfpSequence<'a> {
    /// Returns an empty window. [`Self::move_to`] sets its position.
    ///
    /// # Examples
    /// ```
    /// use spikelane::reconstruct::{TfpSequence, tfp};
    /// use spikelane::{Geometry, SpikeFramesRef};
    /// let stream = SpikeFramesRef::new(Geometry::new(8, 1)?, &[3, 1, 0, 1, 3])?;
    /// let mut window = TfpSequence::new(stream, 1);
    /// assert_eq!(window.image(), [0.0; 8]);
    /// window.move_to(3)?;
    /// assert_eq!(window.image(), tfp(stream, 3, 1)?);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    #[must_use]
    pub fn new(packed: SpikeFramesRef<'a>, half_window: usize) -> Self {
        Self {
            packed,
            half: half_window,
            window: 0..0,
            // The last byte of a frame may contain padding bits, which should be zero. `counts` has entries for the
            // padding bits too.
            counts: vec![0; packed.geometry().frame_bytes() * 8],
        }
    }

    /// Moves the window to the center `center`.
    ///
    /// # Errors
    /// Returns [`ErrorKind::Usage`](crate::ErrorKind::Usage) if `center` is not a readout of the stream.
    pub fn move_to(&mut self, center: usize) -> Result<()> {
        check_readout(self.packed, center)?;
        let from = center.saturating_sub(self.half);
        let to = center.saturating_add(self.half).saturating_add(1).min(self.packed.readouts());
        let old = self.window.clone();
        let distance = old.start.abs_diff(from) + old.end.abs_diff(to);
        if distance >= to - from || to <= old.start || old.end <= from {
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

    /// Returns the spikes per readout of every pixel in the window. Returns zeros before the first [`Self::move_to`].
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

    /// Returns the tally of the range `readouts`. If the range is reversed, the tally is empty.
    fn tally(&self, readouts: std::ops::Range<usize>) -> Tally<'a> {
        let part = self.packed.slice(readouts.start..readouts.end.max(readouts.start));
        Tally::new(part.as_bytes(), self.packed.geometry().frame_bytes())
    }
}
