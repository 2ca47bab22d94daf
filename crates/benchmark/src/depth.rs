//! Metrics of depth.

use crate::error::check_output;
use crate::{MetricError, Result};

/// Factor of the accuracy scores.
const DELTA_FACTOR: f64 = 1.25;

/// The scores of a depth map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DepthScores {
    /// Mean of the absolute errors divided by the true depths. The metric is `depth_abs_rel`.
    pub abs_rel: f64,
    /// Root mean square of the differences of the natural logarithms. The metric is `depth_rmse_log`.
    pub rmse_log: f64,
    /// Shares of the pixels within the factors 1.25, 1.25^2 and 1.25^3, 0 to 1. The metrics are `depth_delta_1` to
    /// `depth_delta_3`.
    pub delta: [f64; 3],
    /// Number of compared pixels.
    pub pixels: usize,
}

/// Compares a depth map with the true depths, which are distances in meters.
///
/// A pixel is compared if its true depth is finite and positive, so the sky is not compared. Let `d` be the output and `g`
/// the true depth of a compared pixel.
///
/// * `abs_rel` is the mean of `|d - g| / g`.
/// * `rmse_log` is the square root of the mean of `(ln d - ln g)^2`.
/// * `delta[k - 1]` is the share of the pixels with `max(d / g, g / d) < 1.25^k`.
///
/// The output is not scaled to the true depths. Write any finite value at pixels without a true depth.
///
/// # Examples
/// ```
/// use spikelane_benchmark::depth::depth_scores;
/// // The last pixel shows the sky.
/// let scores = depth_scores(&[11.0, 30.0, 1e6], &[10.0, 20.0, f32::INFINITY])?;
/// assert!((scores.abs_rel - 0.3).abs() < 1e-12);
/// // The factors are 1.1 and 1.5.
/// assert_eq!((scores.delta, scores.pixels), ([0.5, 1.0, 1.0], 2));
/// # Ok::<(), spikelane_benchmark::MetricError>(())
/// ```
///
/// # Errors
/// [`MetricError`] if the output has a wrong size, is not finite at some pixel, or is not positive at a compared pixel, or
/// if no pixel has a true depth.
pub fn depth_scores(output_m: &[f32], reference_m: &[f32]) -> Result<DepthScores> {
    check_output(output_m, reference_m.len())?;
    let (mut relative, mut squares, mut within, mut pixels) = (0.0, 0.0, [0_usize; 3], 0_usize);
    let limits = [DELTA_FACTOR, DELTA_FACTOR.powi(2), DELTA_FACTOR.powi(3)];
    for (index, (output, truth)) in output_m.iter().zip(reference_m).enumerate() {
        if !(truth.is_finite() && *truth > 0.0) {
            continue;
        }
        if *output <= 0.0 {
            return Err(MetricError::OutOfRange { index, requirement: "positive depths" });
        }
        let (d, g) = (f64::from(*output), f64::from(*truth));
        relative += (d - g).abs() / g;
        let difference = libm::log(d) - libm::log(g);
        squares += difference * difference;
        for (count, limit) in within.iter_mut().zip(limits) {
            *count += usize::from((d / g).max(g / d) < limit);
        }
        pixels += 1;
    }
    if pixels == 0 {
        return Err(MetricError::reference("true depth", "no positive depth", "at least one positive depth"));
    }
    let n = pixels as f64;
    Ok(DepthScores {
        abs_rel: relative / n,
        rmse_log: (squares / n).sqrt(),
        delta: within.map(|count| count as f64 / n),
        pixels,
    })
}
