//! The rate from the first to the last spike of a window.

use crate::error::Result;
use crate::kernels::{Tally, Times};
use crate::reconstruct::check_readout;
use crate::spikes::{Packed, span_rate};

/// Spikes per readout from the times of the first and the last spike within `half_window` readouts on
/// either side of `centre`, row-major: [`span_rate`].
///
/// Both ends of the span are spikes, so of a steady pixel only their rounding to whole readouts is left:
/// some `f^2 / (sqrt(6) n)` of a rate `f` over `n` intervals (less where `n / f` is nearly whole), where counting ([`crate::reconstruct::tfp`])
/// is off by `1 / (sqrt(6) W)` in a window of `W` readouts, about `1 / f` times as much.
///
/// A pixel with one spike or none in the window has no span and gets the count over the window's length, 1/W or
/// 0: its rate lies within 1/W of that. At the borders of the stream the window is cut. Values are in 0 to 1.
///
/// A false spike near an end of the window moves an end of the span, most in dark pixels: two false spikes in
/// successive readouts of a silent pixel read as rate 1.
///
/// # Errors
/// [`crate::Kind::Usage`] when `centre` lies beyond the stream.
pub fn span(packed: Packed, centre: usize, half_window: usize) -> Result<Vec<f32>> {
    check_readout(packed, centre)?;
    let from = centre.saturating_sub(half_window);
    let to = centre.saturating_add(half_window).saturating_add(1).min(packed.readouts());
    let pixels = Tally::new(packed.part(from..to).bytes(), packed.geometry().frame_bytes()).times();
    let by_count = |spikes: u32| f64::from(spikes) / (to - from) as f64;
    let rate = |t: &Times| span_rate(t.spikes, t.first, t.last).unwrap_or_else(|| by_count(t.spikes)) as f32;
    // A last byte may hold bits beyond the last pixel.
    Ok(pixels[..packed.geometry().pixels()].iter().map(rate).collect())
}
