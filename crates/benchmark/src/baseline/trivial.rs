//! Baselines that ignore the spikes.

use crate::detection::Detection;
use crate::tracking::TrackedBox;
use crate::{MetricError, Result};

/// Returns a flow of zero for every pixel: nothing moves.
#[must_use]
pub fn zero_flow(pixels: usize) -> Vec<[f32; 2]> {
    vec![[0.0; 2]; pixels]
}

/// Returns the mean of the true depths of several maps, in meters.
///
/// Depths that are infinite, not a number or not positive are not counted, as in
/// [`depth_scores`](crate::depth::depth_scores). Use the maps of the training split: a baseline must not see the depths
/// with which its output is compared.
///
/// # Examples
/// ```
/// use spikelane_benchmark::baseline::{constant_depth, mean_depth};
/// // The last pixel of the first map shows the sky.
/// let mean = mean_depth([&[10.0, f32::INFINITY][..], &[40.0, 40.0]])?;
/// assert_eq!(constant_depth(mean, 2), [30.0, 30.0]);
/// # Ok::<(), spikelane_benchmark::MetricError>(())
/// ```
///
/// # Errors
/// [`MetricError::Reference`] if no pixel has a true depth.
pub fn mean_depth<'a>(references_m: impl IntoIterator<Item = &'a [f32]>) -> Result<f32> {
    let (mut sum, mut pixels) = (0.0, 0_usize);
    for depth in references_m.into_iter().flatten().filter(|d| d.is_finite() && **d > 0.0) {
        sum += f64::from(*depth);
        pixels += 1;
    }
    if pixels == 0 {
        return Err(MetricError::reference("true depths", "no valid pixel", "at least one valid pixel"));
    }
    Ok((sum / pixels as f64) as f32)
}

/// Returns the same depth in meters for every pixel.
#[must_use]
pub fn constant_depth(depth_m: f32, pixels: usize) -> Vec<f32> {
    vec![depth_m; pixels]
}

/// Returns the detections of an image without objects.
#[must_use]
pub const fn no_detections() -> Vec<Detection> {
    Vec::new()
}

/// Returns the tracked boxes of an image without objects.
#[must_use]
pub const fn no_tracks() -> Vec<TrackedBox> {
    Vec::new()
}
