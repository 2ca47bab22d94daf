//! Texture from intervals (TFI): the duration between successive spikes of a pixel.

use crate::error::{Result, bail};
use crate::kernels::{SearchOrder, first_spikes};
use crate::reconstruct::check_readout;
use crate::spikes::SpikeFramesRef;

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
/// Returns [`ErrorKind::Usage`](crate::ErrorKind::Usage) if `at` is not a readout of the stream or if `search` is zero.
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
    /// Number of pixels without a complete interval within the search.
    pub missing_pixels: usize,
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
        bail!(Usage, "readouts to search for spikes"; found "0"; expected "at least 1");
    }
    let last = packed.readouts() - 1;
    // For each direction: the number of silent readouts up to the end of the stream. It is `None` if the search ends
    // before the end of the stream.
    let cut = [(at < search).then_some(at + 1), (last - at < search).then_some(last - at + 1)];
    let mut tfi = Tfi {
        rates: Vec::with_capacity(packed.geometry().pixels()),
        missing_pixels: 0,
        open_pixels: 0,
        open_error: 0.0,
        rounding_error: 0.0,
    };
    // The rates of all intervals. The first entry is the rate of pixels without an interval.
    let lengths = search.min(at) + 1 + search.min(last - at);
    let missing = 1.0 / (2.0 * search as f32);
    let rates: Vec<f32> = std::iter::once(missing).chain((1..lengths).map(|n| 1.0 / n as f32)).collect();
    let rounding_errors: Vec<f64> =
        std::iter::once(0.0).chain((1..lengths).map(|n| (n as f64).powi(-4) / 6.0)).collect();
    for numbers in spike_numbers(packed, at, search) {
        let readouts = interval(numbers) as usize;
        tfi.rates.push(rates[readouts]);
        tfi.rounding_error += rounding_errors[readouts];
        tfi.missing_pixels += usize::from(readouts == 0);
        if readouts == 0
            && let [Some(before), Some(after)] = silent_readouts(numbers, cut)
        {
            tfi.open_pixels += 1;
            tfi.open_error += ((before + after) as f64).powi(-2);
        }
    }
    Ok(tfi)
}

/// Returns the number of readouts without a spike before and after the readout of a TFI image. The number is `None` in a
/// direction in which the search ends before a spike and before the end of the stream. `cut` contains the numbers for
/// pixels without spikes.
fn silent_readouts([before, after]: [u32; 2], cut: [Option<usize>; 2]) -> [Option<usize>; 2] {
    let found = |number: u32, silent: u32| (number != 0).then_some(silent as usize);
    [found(before, before.wrapping_sub(1)).or(cut[0]), found(after, after).or(cut[1])]
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
/// Returns [`ErrorKind::Usage`](crate::ErrorKind::Usage) if `at` is not a readout of the stream.
pub fn isi_map(packed: SpikeFramesRef, at: usize) -> Result<Vec<u32>> {
    check_readout(packed, at)?;
    Ok(spike_numbers(packed, at, packed.readouts()).map(interval).collect())
}

/// Returns two numbers of readouts for every pixel: from the last spike at or before `at` to `at`, including both
/// readouts, and from the readout after `at` to the first spike after `at`.
///
/// A number is 0 without a spike within `search` readouts of `at`.
fn spike_numbers(packed: SpikeFramesRef, at: usize, search: usize) -> impl Iterator<Item = [u32; 2]> {
    let end = at.saturating_add(search).saturating_add(1).min(packed.readouts());
    let geometry = packed.geometry();
    let numbers = |readouts: std::ops::Range<usize>, order| {
        let frames = packed.slice(readouts);
        first_spikes(frames.as_bytes(), geometry.frame_bytes(), geometry.pixels(), order)
    };
    let before = numbers(at.saturating_sub(search)..at + 1, SearchOrder::Backward);
    let after = numbers(at + 1..end, SearchOrder::Forward);
    before.into_iter().zip(after).map(|(before, after)| [before, after])
}

/// Returns the length of the interval between two spikes, or 0 if one of the spikes was not found.
fn interval([before, after]: [u32; 2]) -> u32 {
    if before == 0 || after == 0 { 0 } else { before - 1 + after }
}
