//! Rates from the span between the first and the last spike in a window.

use crate::error::Result;
use crate::kernels::{SpikeTimes, Tally};
use crate::reconstruct::check_readout;
use crate::spikes::{SpikeFramesRef, span_rate};

/// Returns the rate of every pixel in spikes per readout. The rate is computed from the first and the last spike in a
/// window with [`span_rate`].
///
/// The window contains `half_window` readouts before `center` and `half_window` readouts after `center`. It is shortened
/// at the ends of the stream. The result is row-major with values from 0 to 1.
///
/// The span starts and ends with spikes. For steady light, the only error is therefore the rounding of both spikes to
/// readouts. For a rate `f` and `n` intervals, the error of the rate is about `f^2 / (sqrt(6) n)`. The error is smaller
/// if `n / f` is close to an integer. In a window of `W` readouts, the error of counting spikes
/// ([`crate::reconstruct::tfp()`]) is `1 / (sqrt(6) W)`, which is about `1 / f` times as large.
///
/// A pixel with fewer than two spikes in the window has no span. Its rate is the number of spikes divided by the length
/// `W` of the window, which is 0 or `1 / W`. The true rate differs from this value by at most `1 / W`.
///
/// A false spike near an end of the window changes the span. The error is largest in dark pixels: two false spikes in
/// successive readouts of a silent pixel give the rate 1.
///
/// # Examples
/// ```
/// use spikelane::{Geometry, SpikeFramesRef, reconstruct};
/// // One pixel of eight fires at the readouts 1, 4 and 7.
/// let bytes = [0, 1, 0, 0, 1, 0, 0, 1, 0, 0];
/// let stream = SpikeFramesRef::new(Geometry::new(8, 1)?, &bytes)?;
/// let rates = reconstruct::span_rates(stream, 5, 5)?;
/// // Two intervals in six readouts. Counting gives 3 spikes in 10 readouts.
/// assert_eq!(rates[..2], [2.0 / 6.0, 0.0]);
/// assert_eq!(reconstruct::tfp(stream, 5, 5)?[0], 0.3);
/// # Ok::<(), spikelane::Error>(())
/// ```
///
/// # Errors
/// Returns [`ErrorKind::Usage`](crate::ErrorKind::Usage) if `center` is not a readout of the stream.
pub fn span_rates(packed: SpikeFramesRef, center: usize, half_window: usize) -> Result<Vec<f32>> {
    check_readout(packed, center)?;
    let from = center.saturating_sub(half_window);
    let to = center.saturating_add(half_window).saturating_add(1).min(packed.readouts());
    let pixels = Tally::new(packed.slice(from..to).as_bytes(), packed.geometry().frame_bytes()).spike_times();
    let by_count = |spikes: u32| f64::from(spikes) / (to - from) as f64;
    let rate =
        |t: &SpikeTimes| span_rate(t.spikes, t.first, t.last).unwrap_or_else(|| by_count(t.spikes)) as f32;
    // The last byte may contain padding bits after the last pixel, so the result is cut to the number of pixels.
    Ok(pixels[..packed.geometry().pixels()].iter().map(rate).collect())
}
