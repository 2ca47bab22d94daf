//! Metrics of optical flow.
//!
//! The flow of a pixel is the displacement of the point that the pixel shows, in pixels to the right and downward. The
//! displacement depends on the interval between the two images. Therefore each field states its interval, and two fields
//! with different intervals are not compared.

use crate::{MetricError, Result};

/// Threshold of an outlier in pixels, by the rule of KITTI.
const OUTLIER_PIXELS: f64 = 3.0;

/// Threshold of an outlier relative to the length of the displacement, by the rule of KITTI.
const OUTLIER_SHARE: f64 = 0.05;

/// The displacement of every pixel over an interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlowField<'a> {
    /// Displacements to the right and downward in pixels, row by row.
    pub displacements: &'a [[f32; 2]],
    /// Interval between the two images in seconds.
    pub interval_seconds: f64,
}

/// The true flow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlowReference<'a> {
    /// The displacements.
    pub field: FlowField<'a>,
    /// Pixels with a known displacement, or `None` if all displacements are known.
    pub is_valid: Option<&'a [bool]>,
    /// Pixels whose point is hidden in the second image or outside it. `None` if no pixel is occluded.
    pub is_occluded: Option<&'a [bool]>,
}

/// The errors of a set of pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlowErrors {
    /// Mean endpoint error in pixels over the interval.
    pub epe_px: f64,
    /// Share of outliers in percent.
    pub outlier_percent: f64,
    /// Number of compared pixels.
    pub pixels: usize,
}

/// The scores of a flow field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlowScores {
    /// Errors of the visible pixels. The metrics are `flow_epe` and `flow_outliers`. `None` if no valid pixel is visible.
    pub visible: Option<FlowErrors>,
    /// Errors of the occluded pixels. The metrics are `flow_epe_occluded` and `flow_outliers_occluded`. `None` if no valid
    /// pixel is occluded.
    pub occluded: Option<FlowErrors>,
}

/// Compares a flow field with the true flow.
///
/// * The endpoint error of a pixel is `e = sqrt((u - u')^2 + (v - v')^2)` in pixels over the interval. `(u, v)` is the
///   output, and `(u', v')` is the true displacement.
/// * A pixel is an outlier if `e > 3` px and `e > 0.05 sqrt(u'^2 + v'^2)`. This is the rule of KITTI 2015.
/// * Occluded pixels have no match in the second image, so they are scored apart.
///
/// # Examples
/// ```
/// use spikelane_benchmark::flow::{FlowField, FlowReference, flow_scores};
/// let field = |displacements| FlowField { displacements, interval_seconds: 0.01 };
/// let truth = [[100.0, 0.0], [10.0, 0.0], [0.0, 0.0]];
/// let reference = FlowReference {
///     field: field(&truth),
///     is_valid: None,
///     is_occluded: Some(&[false, false, true]),
/// };
/// let scores = flow_scores(field(&[[104.0, 0.0], [10.0, 4.0], [0.0, 1.0]]), reference)?;
/// // The error of 4 px is above 3 px for both visible pixels, and above 5 % only for the second.
/// let visible = scores.visible.unwrap();
/// assert_eq!((visible.epe_px, visible.outlier_percent, visible.pixels), (4.0, 50.0, 2));
/// assert_eq!(scores.occluded.unwrap().epe_px, 1.0);
/// # Ok::<(), spikelane_benchmark::MetricError>(())
/// ```
///
/// # Errors
/// [`MetricError`] if the output has a wrong size or another interval, if a value of the output is not finite, if a valid
/// displacement is not finite, if a mask has a wrong size, or if no pixel is valid.
pub fn flow_scores(output: FlowField<'_>, reference: FlowReference<'_>) -> Result<FlowScores> {
    let truth = reference.field.displacements;
    check_reference(reference)?;
    if output.displacements.len() != truth.len() {
        return Err(MetricError::WrongSize { found: output.displacements.len(), expected: truth.len() });
    }
    if output.interval_seconds != reference.field.interval_seconds {
        return Err(MetricError::WrongInterval {
            found_seconds: output.interval_seconds,
            expected_seconds: reference.field.interval_seconds,
        });
    }
    if let Some(index) = output.displacements.iter().position(|d| !is_finite(d)) {
        return Err(MetricError::NonFinite { index });
    }
    let [mut visible, mut occluded] = [Sums::default(); 2];
    for (p, (output, truth)) in output.displacements.iter().zip(truth).enumerate() {
        if reference.is_valid.is_none_or(|mask| mask[p]) {
            let sums =
                if reference.is_occluded.is_some_and(|mask| mask[p]) { &mut occluded } else { &mut visible };
            sums.add(output, truth);
        }
    }
    Ok(FlowScores { visible: visible.errors(), occluded: occluded.errors() })
}

#[derive(Clone, Copy, Default)]
struct Sums {
    error: f64,
    outliers: usize,
    pixels: usize,
}

impl Sums {
    fn add(&mut self, output: &[f32; 2], truth: &[f32; 2]) {
        let [u, v] = [0, 1].map(|k| f64::from(output[k]) - f64::from(truth[k]));
        let error = (u * u + v * v).sqrt();
        let [a, b] = truth.map(f64::from);
        self.error += error;
        self.outliers +=
            usize::from(error > OUTLIER_PIXELS && error > OUTLIER_SHARE * (a * a + b * b).sqrt());
        self.pixels += 1;
    }

    fn errors(self) -> Option<FlowErrors> {
        let pixels = self.pixels as f64;
        (self.pixels > 0).then(|| FlowErrors {
            epe_px: self.error / pixels,
            outlier_percent: 100.0 * self.outliers as f64 / pixels,
            pixels: self.pixels,
        })
    }
}

fn is_finite(displacement: &[f32; 2]) -> bool {
    displacement.iter().all(|x| x.is_finite())
}

fn check_reference(reference: FlowReference<'_>) -> Result<()> {
    let FlowField { displacements, interval_seconds } = reference.field;
    if !(interval_seconds.is_finite() && interval_seconds > 0.0) {
        return Err(MetricError::reference(
            "interval of the true flow",
            interval_seconds,
            "a positive time in seconds",
        ));
    }
    for mask in [reference.is_valid, reference.is_occluded].into_iter().flatten() {
        if mask.len() != displacements.len() {
            let expected = format!("{} pixels", displacements.len());
            return Err(MetricError::reference("mask of the true flow", mask.len(), expected));
        }
    }
    let is_valid = |p: usize| reference.is_valid.is_none_or(|mask| mask[p]);
    let mut valid = displacements.iter().enumerate().filter(|(p, _)| is_valid(*p)).peekable();
    if valid.peek().is_none() {
        return Err(MetricError::reference("true flow", "no valid pixel", "at least one valid pixel"));
    }
    match valid.find(|(_, displacement)| !is_finite(displacement)) {
        Some((p, _)) => {
            let found = format!("a displacement that is not finite at pixel {p}");
            Err(MetricError::reference("true flow", found, "finite displacements at valid pixels"))
        }
        None => Ok(()),
    }
}
