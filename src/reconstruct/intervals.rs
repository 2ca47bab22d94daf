//! Texture from intervals: how long a pixel takes from one spike to the next.

use crate::error::{Error, Kind, Result};
use crate::reconstruct::check_readout;
use crate::spikes::{Packed, firing_pixels};

/// One over the interval around readout `at`, row-major, in spikes per readout.
///
/// The interval runs from the last spike at or before `at` to the first one after
/// it, each within `search` readouts. Where either is missing the interval counts as
/// `2 * search` (SpikeCV's habit: 40 for its 20), so such a pixel is dark but not black.
/// Near the ends of a stream spikes are missing that the pixel's light does not account for: see [`tfi_at`].
///
/// # Errors
/// [`Kind::Usage`] when `at` lies beyond the stream or `search` is zero.
pub fn tfi(packed: Packed, at: usize, search: usize) -> Result<Vec<f32>> {
    Ok(tfi_at(packed, at, search)?.rates)
}

/// A TFI picture, and how much of it the ends of the stream leave open.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Tfi {
    /// The picture, as [`tfi`] gives it.
    pub rates: Vec<f32>,
    /// Pixels whose interval is not closed because the stream ends within the search.
    pub open_pixels: usize,
    /// Sum over the open pixels of the square of the highest rate that each may have.
    open: f64,
    /// Sum over the closed pixels of the variance that rounding to whole readouts gives a rate.
    rounding: f64,
}

impl Tfi {
    /// Whether the picture is one of the scene.
    ///
    /// An interval `n` is known to `1 / sqrt(6)` readouts, the rate to `n^-2 / sqrt(6)`. A pixel left open after `s`
    /// silent readouts has any rate up to `1 / s`. The picture counts as long as the squares of all the latter are at most a
    /// quarter of those of the former: a mean square error is then wrong by a quarter at most, PSNR of rates by 1 dB.
    #[must_use]
    pub fn is_measurable(&self) -> bool {
        self.open <= 0.25 * self.rounding
    }
}

/// [`tfi`] with what the ends of the stream do to it.
///
/// # Errors
/// As [`tfi`].
pub fn tfi_at(packed: Packed, at: usize, search: usize) -> Result<Tfi> {
    check_readout(packed, at)?;
    if search == 0 {
        return Err(Error::new(Kind::Usage, "readouts to search for spikes").found(0).expected("at least 1"));
    }
    let missing = 1.0 / (2.0 * search as f32);
    let last = packed.readouts() - 1;
    // The silent readouts that an end of the stream leaves; `None` where all were there to be searched.
    let cut = [(at < search).then_some(at + 1), (last - at < search).then_some(last - at + 1)];
    let mut tfi = Tfi {
        rates: Vec::with_capacity(packed.geometry().pixels()),
        open_pixels: 0,
        open: 0.0,
        rounding: 0.0,
    };
    for sides in sides(packed, at, search) {
        let found = interval(sides);
        tfi.rates.push(found.map_or(missing, |n| 1.0 / n as f32));
        if let Some(n) = found {
            tfi.rounding += f64::from(n).powi(-4) / 6.0;
        } else if let [Some(before), Some(after)] = [0, 1].map(|i| sides[i].map(|n| n as usize).or(cut[i])) {
            tfi.open_pixels += 1;
            tfi.open += ((before + after) as f64).powi(-2);
        }
    }
    Ok(tfi)
}

/// Length in readouts of the interval around readout `at`, row-major; 0 where the
/// stream does not hold both of its spikes.
///
/// # Errors
/// [`Kind::Usage`] when `at` lies beyond the stream.
pub fn isi_map(packed: Packed, at: usize) -> Result<Vec<u32>> {
    check_readout(packed, at)?;
    let sides = sides(packed, at, packed.readouts());
    Ok(sides.map(|both| interval(both).unwrap_or(0)).collect())
}

/// Readouts from the last spike at or before `at`, and to the first after it, of every pixel; `None` where
/// there is none within `search`.
fn sides(packed: Packed, at: usize, search: usize) -> impl Iterator<Item = [Option<u32>; 2]> {
    let last = packed.readouts() - 1;
    let first = at.saturating_sub(search);
    let before = distances(packed, (first..=at).rev(), 0);
    let after = distances(packed, at + 1..=at.saturating_add(search).min(last), 1);
    before.into_iter().zip(after).take(packed.geometry().pixels()).map(|(b, a)| [b, a])
}

/// The interval, when both of its spikes are there.
fn interval([before, after]: [Option<u32>; 2]) -> Option<u32> {
    Some(before? + after?)
}

/// How many readouts of the row it takes to meet each pixel's first spike, the first
/// readout counting as `start`. Stops when every pixel has fired.
fn distances(packed: Packed, readouts: impl Iterator<Item = usize>, start: u32) -> Vec<Option<u32>> {
    let bytes = packed.geometry().frame_bytes();
    let mut found = vec![None; bytes * 8];
    let mut waiting = vec![0xff_u8; bytes];
    if !packed.geometry().pixels().is_multiple_of(8) {
        // Padding never fires, and would keep the search going.
        waiting[bytes - 1] = (1 << (packed.geometry().pixels() % 8)) - 1;
    }
    let mut left = packed.geometry().pixels();
    let mut fresh = vec![0_u8; bytes];
    for (distance, readout) in (start..).zip(readouts) {
        for ((new, wait), &spikes) in fresh.iter_mut().zip(&mut waiting).zip(packed.frame(readout)) {
            *new = spikes & *wait;
            *wait &= !spikes;
        }
        for p in firing_pixels(&fresh) {
            found[p] = Some(distance);
            left -= 1;
        }
        if left == 0 {
            break;
        }
    }
    found
}
