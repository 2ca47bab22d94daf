//! The rate from the first to the last spike of a window.

use std::ops::Range;

use crate::error::Result;
use crate::reconstruct::{check_readout, for_each_spike};
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
    let mut pixels = of_window(packed, from..to);
    pixels.truncate(packed.geometry().pixels());
    let by_count = |spikes: u32| f64::from(spikes) / (to - from) as f64;
    Ok(pixels.iter().map(|p| p.rate().unwrap_or_else(|| by_count(p.spikes)) as f32).collect())
}

/// What is kept of a pixel's spikes, in readouts of the window.
#[derive(Clone, Copy, Default)]
struct Spikes {
    spikes: u32,
    first: u32,
    last: u32,
}

impl Spikes {
    fn rate(&self) -> Option<f64> {
        span_rate(self.spikes, self.first, self.last)
    }
}

/// The spikes of all pixels, and of the bits that fill the last byte.
fn of_window(packed: Packed, window: Range<usize>) -> Vec<Spikes> {
    let mut pixels = vec![Spikes::default(); packed.geometry().frame_bytes() * 8];
    for (at, readout) in (0..).zip(window) {
        for_each_spike(packed.frame(readout), |p| {
            let pixel = &mut pixels[p];
            if pixel.spikes == 0 {
                pixel.first = at;
            }
            pixel.last = at;
            pixel.spikes += 1;
        });
    }
    pixels
}
