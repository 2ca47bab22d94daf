//! Texture from intervals: how long a pixel takes from one spike to the next.

use crate::error::{Error, Kind, Result};
use crate::reconstruct::{check_readout, for_each_spike};
use crate::spikes::Packed;

/// One over the interval around readout `at`, row-major, in spikes per readout.
///
/// The interval runs from the last spike at or before `at` to the first one after
/// it, each within `search` readouts. Where either is missing the interval counts as
/// `2 * search` (SpikeCV's habit: 40 for its 20), so such a pixel is dark but not black.
///
/// # Errors
/// [`Kind::Usage`] when `at` lies beyond the stream or `search` is zero.
pub fn tfi(packed: Packed, at: usize, search: usize) -> Result<Vec<f32>> {
    check_readout(packed, at)?;
    if search == 0 {
        return Err(Error::new(Kind::Usage, "readouts to search for spikes").found(0).expected("at least 1"));
    }
    let missing = 1.0 / (2.0 * search as f32);
    let spans = spans(packed, at, search);
    Ok(spans.map(|length| length.map_or(missing, |n| 1.0 / n as f32)).collect())
}

/// Length in readouts of the interval around readout `at`, row-major; 0 where the
/// stream does not hold both of its spikes.
///
/// # Errors
/// [`Kind::Usage`] when `at` lies beyond the stream.
pub fn isi_map(packed: Packed, at: usize) -> Result<Vec<u32>> {
    check_readout(packed, at)?;
    let spans = spans(packed, at, packed.readouts());
    Ok(spans.map(|length| length.unwrap_or(0)).collect())
}

/// The interval around `at` of every pixel, when both spikes are within `search`.
fn spans(packed: Packed, at: usize, search: usize) -> impl Iterator<Item = Option<u32>> {
    let last = packed.readouts() - 1;
    let first = at.saturating_sub(search);
    let before = distances(packed, (first..=at).rev(), 0);
    let after = distances(packed, at + 1..=at.saturating_add(search).min(last), 1);
    let pixels = packed.geometry().pixels();
    before.into_iter().zip(after).take(pixels).map(|(b, a)| Some(b? + a?))
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
        for_each_spike(&fresh, |p| {
            found[p] = Some(distance);
            left -= 1;
        });
        if left == 0 {
            break;
        }
    }
    found
}
