//! Texture from intervals (TFI): the duration between successive spikes of a pixel.

use crate::error::{Error, ErrorKind, Result};
use crate::reconstruct::check_readout;
use crate::spikes::{SpikeFramesRef, firing_pixels};

/// Returns the reciprocal of the interval that contains readout `at`, row-major, in spikes per readout.
///
/// The interval starts at the last spike at or before `at` and ends at the first spike after `at`. Both spikes must be
/// within `search` readouts of `at`. If a spike is missing, the interval is set to `2 * search`, so the pixel is dark but
/// not black. (SpikeCV uses the interval 40 with a search of 20.)
///
/// Near the ends of a stream, a spike can be missing although the pixel is bright. [`tfi_with_open_pixels`] counts
/// these pixels.
///
/// # Examples
/// ```
/// use spikelane::{Geometry, SpikeFramesRef, reconstruct};
/// // One pixel of eight fires at the readouts 0, 4 and 8.
/// let bytes = [1, 0, 0, 0, 1, 0, 0, 0, 1];
/// let stream = SpikeFramesRef::new(Geometry::new(8, 1)?, &bytes)?;
/// // Readout 5 is in an interval of 4 readouts. A pixel without spikes has an interval of twice the search.
/// assert_eq!(reconstruct::tfi(stream, 5, 20)?[..2], [1.0 / 4.0, 1.0 / 40.0]);
/// assert_eq!(reconstruct::tfi(stream, 9, 20).unwrap_err().kind(), spikelane::ErrorKind::Usage);
/// # Ok::<(), spikelane::Error>(())
/// ```
///
/// # Errors
/// Returns [`ErrorKind::Usage`] if `at` is not a readout of the stream or if `search` is zero.
pub fn tfi(packed: SpikeFramesRef, at: usize, search: usize) -> Result<Vec<f32>> {
    Ok(tfi_with_open_pixels(packed, at, search)?.rates)
}

/// A TFI image, and the number of pixels whose interval is incomplete because the stream ends.
///
/// # Examples
/// ```
/// use spikelane::{Geometry, SpikeFramesRef, reconstruct};
/// // The other seven pixels have no spikes: their intervals start before the stream or end after it.
/// let bytes = [1, 0, 1, 0, 1];
/// let stream = SpikeFramesRef::new(Geometry::new(8, 1)?, &bytes)?;
/// let image = reconstruct::tfi_with_open_pixels(stream, 2, 20)?;
/// assert_eq!((image.rates[0], image.open_pixels), (0.5, 7));
/// assert!(!image.is_measurable());
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Tfi {
    /// The image of [`tfi`].
    pub rates: Vec<f32>,
    /// Number of open pixels. The interval of an open pixel is incomplete because the stream ends within the search
    /// range.
    pub open_pixels: usize,
    /// Sum of the squared highest possible rates of the open pixels.
    open_error: f64,
    /// Sum of the variances of the rates of all pixels with a complete interval. The variance of a rate is due to the
    /// rounding of spikes to readouts.
    rounding_error: f64,
}

impl Tfi {
    /// Returns whether the number of open pixels is small enough to compare the image with the scene.
    ///
    /// Rounding gives an interval of `n` readouts a standard error of `1 / sqrt(6)` readouts. The standard error of the
    /// rate `1 / n` is then `n^-2 / sqrt(6)`. An open pixel with `s` silent readouts can have any rate up to `1 / s`.
    /// Let `O` be the sum of `1 / s^2` over the open pixels, and `R` the sum of `n^-4 / 6` over the complete intervals.
    /// The image is measurable if `O <= R / 4`. The relative error of the mean square error is then at most a quarter,
    /// and the error of the PSNR of rates is at most 1 dB.
    #[must_use]
    pub fn is_measurable(&self) -> bool {
        self.open_error <= 0.25 * self.rounding_error
    }
}

/// Returns the image of [`tfi`], and the number of open pixels.
///
/// # Examples
/// ```
/// use spikelane::{Camera, Seeds, Sensor, Simulator, reconstruct};
/// let mut simulator = Simulator::new(&Camera::ideal(Sensor::new(32, 24, 20_000.0)?), Seeds::default())?;
/// // A fifth of full scale, so 100 readouts contain complete intervals of all pixels.
/// let spikes = simulator.run(&[51u8; 32 * 24], 100)?;
/// let image = reconstruct::tfi_with_open_pixels(spikes.view(), 50, 20)?;
/// assert_eq!(image.open_pixels, 0);
/// assert!(image.is_measurable() && image.rates.iter().all(|rate| *rate == 0.2));
/// # Ok::<(), spikelane::Error>(())
/// ```
///
/// # Errors
/// Returns the errors of [`tfi`].
pub fn tfi_with_open_pixels(packed: SpikeFramesRef, at: usize, search: usize) -> Result<Tfi> {
    check_readout(packed, at)?;
    if search == 0 {
        return Err(Error::new(ErrorKind::Usage, "readouts to search for spikes")
            .found(0)
            .expected("at least 1"));
    }
    let missing = 1.0 / (2.0 * search as f32);
    let last = packed.readouts() - 1;
    // For each direction: the number of silent readouts up to the end of the stream. It is `None` if the search ends
    // before the end of the stream.
    let cut = [(at < search).then_some(at + 1), (last - at < search).then_some(last - at + 1)];
    let mut tfi = Tfi {
        rates: Vec::with_capacity(packed.geometry().pixels()),
        open_pixels: 0,
        open_error: 0.0,
        rounding_error: 0.0,
    };
    for sides in spike_distances(packed, at, search) {
        let readouts = interval(sides);
        tfi.rates.push(readouts.map_or(missing, |n| 1.0 / n as f32));
        if let Some(n) = readouts {
            tfi.rounding_error += f64::from(n).powi(-4) / 6.0;
        } else if let [Some(before), Some(after)] = [0, 1].map(|i| sides[i].map(|n| n as usize).or(cut[i])) {
            tfi.open_pixels += 1;
            tfi.open_error += ((before + after) as f64).powi(-2);
        }
    }
    Ok(tfi)
}

/// Returns the length in readouts of the interval that contains readout `at`, row-major.
///
/// The length is 0 if the first or the last spike of the interval is not in the stream.
///
/// # Examples
/// ```
/// use spikelane::{Geometry, SpikeFramesRef, reconstruct};
/// // Pixel 0 fires at the readouts 0 and 3, and pixel 1 fires once.
/// let bytes = [0b01, 0b10, 0b00, 0b01];
/// let stream = SpikeFramesRef::new(Geometry::new(8, 1)?, &bytes)?;
/// assert_eq!(reconstruct::isi_map(stream, 2)?[..3], [3, 0, 0]);
/// # Ok::<(), spikelane::Error>(())
/// ```
///
/// # Errors
/// Returns [`ErrorKind::Usage`] if `at` is not a readout of the stream.
pub fn isi_map(packed: SpikeFramesRef, at: usize) -> Result<Vec<u32>> {
    check_readout(packed, at)?;
    let sides = spike_distances(packed, at, packed.readouts());
    Ok(sides.map(|both| interval(both).unwrap_or(0)).collect())
}

/// Returns two distances in readouts for every pixel: from `at` back to the last spike at or before `at`, and from `at`
/// to the first spike after `at`.
///
/// A distance is `None` if there is no spike within `search` readouts.
fn spike_distances(
    packed: SpikeFramesRef,
    at: usize,
    search: usize,
) -> impl Iterator<Item = [Option<u32>; 2]> {
    let last = packed.readouts() - 1;
    let first = at.saturating_sub(search);
    let before = distances(packed, (first..=at).rev(), 0);
    let after = distances(packed, at + 1..=at.saturating_add(search).min(last), 1);
    before.into_iter().zip(after).take(packed.geometry().pixels()).map(|(b, a)| [b, a])
}

/// Returns the length of the interval between two spikes, or `None` if one of the spikes was not found.
fn interval([before, after]: [Option<u32>; 2]) -> Option<u32> {
    Some(before? + after?)
}

/// Returns, for every pixel, the distance in readouts to its first spike in the sequence `readouts`.
///
/// The first readout of the sequence has the distance `start`. The search ends when every pixel has fired.
fn distances(packed: SpikeFramesRef, readouts: impl Iterator<Item = usize>, start: u32) -> Vec<Option<u32>> {
    let bytes = packed.geometry().frame_bytes();
    let mut intervals = vec![None; bytes * 8];
    let mut pending = vec![0xff_u8; bytes];
    if !packed.geometry().pixels().is_multiple_of(8) {
        // Padding bits never fire. They are cleared in `pending`, because otherwise the search would wait for them
        // until the last readout.
        pending[bytes - 1] = (1 << (packed.geometry().pixels() % 8)) - 1;
    }
    let mut left = packed.geometry().pixels();
    let mut new_spikes = vec![0_u8; bytes];
    for (distance, readout) in (start..).zip(readouts) {
        for ((new, wait), &spikes) in
            new_spikes.iter_mut().zip(&mut pending).zip(packed.frame(readout).as_bytes())
        {
            *new = spikes & *wait;
            *wait &= !spikes;
        }
        for p in firing_pixels(&new_spikes) {
            intervals[p] = Some(distance);
            left -= 1;
        }
        if left == 0 {
            break;
        }
    }
    intervals
}
