//! Scores for the detail and the noise of an image, relative to a reference of the scene.
//!
//! If the noise is strong, a blurred image has a smaller mean square error than a sharp image. These scores therefore
//! separate detail from noise. They analyze the high-pass image: the image minus its mean over 3x3 pixels. The detail
//! is the part of the high-pass image that is proportional to the high-pass image of the reference. The noise is the
//! remaining part.

use std::ops::Range;

use crate::count::Count;
use crate::error::{Result, Setting, bail};
use crate::reconstruct::{psnr, span_rates};
use crate::spikes::{Geometry, SpikeFramesRef};

/// A pixel is an outlier if it exceeds the median of its neighbors by more than this number of standard deviations.
const OUTLIER_DEVIATIONS: f64 = 6.0;

/// The reference for an image: the exact scene, or two independent observations of the scene.
///
/// # Examples
/// ```
/// use spikelane::Geometry;
/// use spikelane::light::{Chart, Rate};
/// use spikelane::reconstruct::{DetailReference, score_detail};
/// let geometry = Geometry::new(64, 48)?;
/// let scene = Chart::new(geometry, Rate::new(1000, 1)?, None)?.frame_at(0.0).to_f32();
/// // Compare only the upper half.
/// let mask = (0..geometry.pixels()).map(|p| p < geometry.pixels() / 2).collect();
/// let observations = [scene.clone(), scene.clone()];
/// let reference = DetailReference { observations, mask: Some(mask), is_scene: true };
/// let mut picture = scene;
/// picture[geometry.pixels() - 1] = 1e6;
/// assert!((score_detail(&picture, &reference, geometry)?.slope - 1.0).abs() < 1e-6);
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct DetailReference {
    /// Two observations of the scene with independent noise. If there is no noise, both observations are equal.
    pub observations: [Vec<f32>; 2],
    /// Mask of the pixels to compare, or `None` to compare all pixels.
    pub mask: Option<Vec<bool>>,
    /// Whether outliers of the reference are part of the scene.
    ///
    /// Set this field to `false` for recordings. Some pixels of a camera are outliers in every image, including the
    /// reference, and these outliers are not part of the scene.
    pub is_scene: bool,
}

/// The scores of an image.
///
/// # Examples
/// ```
/// use spikelane::Geometry;
/// use spikelane::light::{Chart, Rate};
/// use spikelane::reconstruct::{DetailReference, gaussian_blur, score_detail};
/// let geometry = Geometry::new(64, 48)?;
/// let scene = Chart::new(geometry, Rate::new(1000, 1)?, None)?.frame_at(0.0).to_f32();
/// let reference = DetailReference { observations: [scene.clone(), scene.clone()], mask: None, is_scene: true };
/// let [sharp, blurred] = [scene.clone(), gaussian_blur(&scene, geometry, 1.0)]
///     .map(|picture| score_detail(&picture, &reference, geometry));
/// assert!(blurred?.slope < 0.7 * sharp?.slope);
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DetailScores {
    /// Peak signal-to-noise ratio in decibels after a linear least-squares fit of the image to the reference. It is
    /// infinite for equal images.
    ///
    /// The peak is the value that one pixel in 1,000 of the reference exceeds.
    pub aligned_psnr_db: f64,
    /// Share of the reference's detail that the image contains. 1 means sharp, 0 means flat, and above 1 means
    /// exaggerated detail.
    pub slope: f64,
    /// Standard deviation of the noise, relative to the mean of the reference. The noise is the part of the image's
    /// detail that is not proportional to the detail of the reference.
    pub noise: f64,
    /// Number of pixels that are outliers in this image but not in the scene.
    ///
    /// An outlier exceeds the median of its neighbors by more than six standard deviations. The standard deviation is
    /// computed from the differences between all pixels of this image and the medians of their neighbors.
    pub outliers: usize,
}

impl DetailReference {
    /// Number of readouts that are required before the first readout of the image, and also after its last readout.
    pub const MIN_SIDE_READOUTS: usize = 20;

    /// Returns the reference of a static scene. One observation is the [`span_rates`] of all readouts before
    /// `used_readouts`, and the other observation is the [`span_rates`] of all readouts after. The image was computed
    /// from `used_readouts`.
    ///
    /// # Examples
    /// ```
    /// use spikelane::reconstruct::DetailReference;
    /// use spikelane::{Geometry, SpikeFrames};
    /// // One pixel of eight fires at every second readout.
    /// let spikes = SpikeFrames::new(Geometry::new(8, 1)?, [1, 0].repeat(50))?;
    /// let reference = DetailReference::from_surrounding(spikes.view(), 40..60)?;
    /// assert_eq!(reference.observations.map(|rates| rates[0]), [0.5, 0.5]);
    ///
    /// let error = DetailReference::from_surrounding(spikes.view(), 10..90).unwrap_err();
    /// assert_eq!(error.kind(), spikelane::ErrorKind::Usage);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns [`ErrorKind::Usage`](crate::ErrorKind::Usage) if there are fewer than 20 readouts before `used_readouts` or after
    /// `used_readouts`.
    pub fn from_surrounding(packed: SpikeFramesRef, used_readouts: Range<usize>) -> Result<Self> {
        let all = packed.readouts();
        if used_readouts.start < Self::MIN_SIDE_READOUTS || used_readouts.end + Self::MIN_SIDE_READOUTS > all
        {
            bail!(Usage, "readouts outside the window of the image";
                found "{}, of which readouts {} to {} are in the window", Count(all, "readout"),
                    used_readouts.start, used_readouts.end.saturating_sub(1);
                expected "at least {} before and after the window", Count(Self::MIN_SIDE_READOUTS, "readout");
                remedy "reduce {}, or move {} toward the middle", Setting("window"), Setting("at"));
        }
        let rates_of =
            |part: Range<usize>| span_rates(packed.slice(part.clone()), part.len() / 2, part.len());
        Ok(Self {
            observations: [rates_of(0..used_readouts.start)?, rates_of(used_readouts.end..all)?],
            mask: None,
            is_scene: false,
        })
    }
}

/// Compares the image `picture` with `reference`. The units of both may differ.
///
/// Let `p` be the image, and `a` and `b` the two observations. Let `h(x)` be `x` minus the mean of `x` over 3x3 pixels.
/// The gain `g` is the slope of the least-squares line `p ~ g (a + b) / 2 + c` through the means over 5x5 pixels.
///
/// * The slope is `<h(p), h(a) + h(b)> / (2 g <h(a), h(b)>)`. The two factors of each product have independent noise,
///   so the noise of the observations does not reduce the slope.
/// * The noise is the standard deviation of `h(p) / g - slope (h(a) + h(b)) / 2` without the contribution of the
///   observations. In `h`, the subtraction of the mean removes a ninth of the variance of independent noise, and the
///   factor `sqrt(9 / 8)` restores it.
///
/// # Examples
/// ```
/// use spikelane::Geometry;
/// use spikelane::light::{Chart, Rate};
/// use spikelane::reconstruct::{DetailReference, score_detail};
/// let geometry = Geometry::new(64, 48)?;
/// let scene = Chart::new(geometry, Rate::new(1000, 1)?, None)?.frame_at(0.0).to_f32();
/// let reference = DetailReference { observations: [scene.clone(), scene.clone()], mask: None, is_scene: true };
/// // Another unit and another offset do not change the scores.
/// let picture: Vec<f32> = scene.iter().map(|light| 3.0 * light + 1.0).collect();
/// let scores = score_detail(&picture, &reference, geometry)?;
/// assert!((scores.slope - 1.0).abs() < 1e-4 && scores.noise < 1e-3);
/// # Ok::<(), spikelane::Error>(())
/// ```
///
/// # Errors
/// Returns [`ErrorKind::Usage`](crate::ErrorKind::Usage) if the sizes differ or if a side is shorter than 8 pixels. Returns [`ErrorKind::Input`](crate::ErrorKind::Input)
/// if the image or the reference is flat, or if fewer than 32 pixels are compared.
pub fn score_detail(
    picture: &[f32],
    reference: &DetailReference,
    geometry: Geometry,
) -> Result<DetailScores> {
    check(picture, reference, geometry)?;
    let [a, b] = &reference.observations;
    let mean: Vec<f32> = a.iter().zip(b).map(|(a, b)| 0.5 * (a + b)).collect();
    let inside = interior_pixels(geometry, reference.mask.as_deref());
    let pick = |values: &[f64]| -> Vec<f64> { inside.iter().map(|p| values[*p]).collect() };
    let smooth = |values: &[f32]| pick(&box_mean(values, geometry, 2));
    let fine = |values: &[f32]| -> Vec<f64> {
        let means = box_mean(values, geometry, 1);
        inside.iter().map(|p| f64::from(values[*p]) - means[*p]).collect()
    };
    let gain = LineFit::fit(&smooth(&mean), &smooth(picture)).slope;
    let (p, a, b) = (fine(picture), fine(a), fine(b));
    let both: Vec<f64> = a.iter().zip(&b).map(|(a, b)| 0.5 * (a + b)).collect();
    let power = product(&a, &b);
    let slope = product(&p, &both) / (gain * power);
    if !(slope.is_finite() && power > 0.0) {
        bail!(Input, "detail of an image"; found "an image or a reference without matching detail";
            expected "a scene with visible structure");
    }
    // The noise variance of the mean of two observations is a quarter of the variance of their difference: var((a - b) /
    // 2).
    let noise_sum = a.iter().zip(&b).map(|(a, b)| (0.5 * (a - b)).powi(2)).sum::<f64>();
    let left = p.iter().zip(&both).map(|(p, r)| (p / gain - slope * r).powi(2)).sum::<f64>();
    let variance = (left - slope * slope * noise_sum).max(0.0) / p.len() as f64;
    let level = inside.iter().map(|p| f64::from(mean[*p])).sum::<f64>() / inside.len() as f64;
    Ok(DetailScores {
        aligned_psnr_db: aligned_psnr(&select_pixels(picture, &inside), &select_pixels(&mean, &inside))?,
        slope,
        noise: (9.0 / 8.0 * variance).sqrt() / level,
        outliers: outliers(picture, reference.is_scene.then_some(&mean), geometry, &inside),
    })
}

/// Returns the PSNR in decibels after a linear least-squares fit of the image to the truth.
///
/// The peak is the value that one pixel in 1,000 of the truth exceeds.
///
/// # Examples
/// ```
/// use spikelane::reconstruct::{aligned_psnr, psnr};
/// let truth = [0.0, 0.25, 0.5, 1.0];
/// let picture = truth.map(|light| 0.5 * light + 0.125);
/// // The image differs from the truth only in scale and offset.
/// assert!(aligned_psnr(&picture, &truth)? > 100.0);
/// assert!(psnr(&picture, &truth, 1.0)? < 15.0);
/// # Ok::<(), spikelane::Error>(())
/// ```
///
/// # Errors
/// Returns the errors of [`psnr`]. Also returns an error if the truth is dark, because its peak is then 0.
pub fn aligned_psnr(picture: &[f32], truth: &[f32]) -> Result<f64> {
    let wide = |v: &[f32]| -> Vec<f64> { v.iter().map(|x| f64::from(*x)).collect() };
    let line = LineFit::fit(&wide(picture), &wide(truth));
    let fitted: Vec<f32> = picture.iter().map(|x| line.at(f64::from(*x)) as f32).collect();
    psnr(&fitted, truth, f64::from(peak(truth)))
}

/// Returns the value that one pixel in 1,000 of `truth` exceeds.
fn peak(truth: &[f32]) -> f32 {
    let mut sorted = truth.to_vec();
    sorted.sort_by(f32::total_cmp);
    sorted.len().checked_sub(1 + sorted.len() / 1000).map_or(0.0, |at| sorted[at])
}

/// Returns the image blurred with a Gaussian of `sigma` pixels. Outside the image, the border values are repeated.
///
/// A blurred image is a baseline: no score should prefer it to the original.
///
/// # Examples
/// ```
/// use spikelane::{Geometry, reconstruct::gaussian_blur};
/// let geometry = Geometry::new(15, 15)?;
/// let mut dot = vec![0.0; geometry.pixels()];
/// dot[7 * 15 + 7] = 1.0;
/// let blurred = gaussian_blur(&dot, geometry, 2.0);
/// // The total light is unchanged. The peak of a Gaussian is 1 / (2 pi sigma^2).
/// assert!((blurred.iter().sum::<f32>() - 1.0).abs() < 1e-3);
/// assert!((blurred[7 * 15 + 7] - 0.0398).abs() < 1e-3);
/// # Ok::<(), spikelane::Error>(())
/// ```
#[must_use]
pub fn gaussian_blur(picture: &[f32], geometry: Geometry, sigma: f64) -> Vec<f32> {
    let reach = (3.0 * sigma).ceil() as usize;
    let weights: Vec<f64> =
        (0..=2 * reach).map(|k| libm::exp(-((k as f64 - reach as f64) / sigma).powi(2) / 2.0)).collect();
    let sum: f64 = weights.iter().sum();
    let [width, height] = [geometry.width(), geometry.height()];
    // Returns the weighted sum at pixel `p`. The pixel has index `place` on a line of `size` pixels that are `step`
    // elements apart.
    let along = |values: &[f32], p: usize, place: usize, size: usize, step: usize| {
        let near = |k: usize| (place + k).saturating_sub(reach).min(size - 1);
        let line = p - place * step;
        let terms = weights.iter().enumerate().map(|(k, w)| w * f64::from(values[line + near(k) * step]));
        (terms.sum::<f64>() / sum) as f32
    };
    let all = 0..geometry.pixels();
    let rows: Vec<f32> = all.clone().map(|p| along(picture, p, p % width, width, 1)).collect();
    all.map(|p| along(&rows, p, p / width, height, width)).collect()
}

/// A least-squares line.
struct LineFit {
    slope: f64,
    from: [f64; 2],
}

impl LineFit {
    fn fit(x: &[f64], y: &[f64]) -> Self {
        let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
        let from = [mean(x), mean(y)];
        let (mut square, mut cross) = (0.0, 0.0);
        for (x, y) in x.iter().zip(y) {
            square += (x - from[0]).powi(2);
            cross += (x - from[0]) * (y - from[1]);
        }
        Self { slope: if square > 0.0 { cross / square } else { 0.0 }, from }
    }

    fn at(&self, x: f64) -> f64 {
        self.from[1] + self.slope * (x - self.from[0])
    }
}

fn check(picture: &[f32], reference: &DetailReference, geometry: Geometry) -> Result<()> {
    let sizes = [picture.len(), reference.observations[0].len(), reference.observations[1].len()];
    let counted = reference.mask.as_ref().is_none_or(|c| c.len() == geometry.pixels());
    if sizes != [geometry.pixels(); 3] || !counted || geometry.width() < 8 || geometry.height() < 8 {
        bail!(Usage, "image and reference"; found "{} values for {geometry} pixels", sizes.map(|n| n.to_string()).join(", ");
            expected "the same size, at least 8x8 pixels");
    }
    if interior_pixels(geometry, reference.mask.as_deref()).len() < 32 {
        bail!(Input, "image and reference"; found "fewer than 32 static pixels";
            expected "a scene with static parts");
    }
    Ok(())
}

/// Returns the pixels of the mask `counted` that are at least two pixels from the border of the image.
fn interior_pixels(geometry: Geometry, counted: Option<&[bool]>) -> Vec<usize> {
    let [width, height] = [geometry.width(), geometry.height()];
    let all = (2..height - 2).flat_map(|y| (2..width - 2).map(move |x| y * width + x));
    all.filter(|p| counted.is_none_or(|c| c[*p])).collect()
}

fn select_pixels(values: &[f32], pixels: &[usize]) -> Vec<f32> {
    pixels.iter().map(|p| values[*p]).collect()
}

/// Returns the mean of the square window around each pixel. The window extends `radius` pixels to each side. Pixels
/// whose window crosses the border have the value zero, and no caller uses them.
fn box_mean(values: &[f32], geometry: Geometry, radius: usize) -> Vec<f64> {
    let [width, height] = [geometry.width(), geometry.height()];
    let mut means = vec![0.0; values.len()];
    let count = ((2 * radius + 1) * (2 * radius + 1)) as f64;
    for y in radius..height - radius {
        for x in radius..width - radius {
            let rows = (y - radius..=y + radius)
                .flat_map(|y| &values[y * width + x - radius..=y * width + x + radius]);
            means[y * width + x] = rows.map(|v| f64::from(*v)).sum::<f64>() / count;
        }
    }
    means
}

fn product(x: &[f64], y: &[f64]) -> f64 {
    x.iter().zip(y).map(|(x, y)| x * y).sum()
}

fn outliers(picture: &[f32], scene: Option<&Vec<f32>>, geometry: Geometry, inside: &[usize]) -> usize {
    let out = |values: &[f32], p: usize| f64::from(values[p]) - neighbor_median(values, geometry.width(), p);
    let mut sizes: Vec<f64> = inside.iter().map(|p| out(picture, *p).abs()).collect();
    let middle = sizes.len() / 2;
    // The median absolute value of a centered normal variable is 0.6745 standard deviations.
    let deviation = *sizes.select_nth_unstable_by(middle, f64::total_cmp).1 / 0.6745;
    let stands = |p: usize| out(picture, p) > OUTLIER_DEVIATIONS * deviation;
    let scene = scene.map(|s| (s, mean_value(s)));
    let bright = mean_value(picture);
    let of_scene = |p: usize| {
        scene.is_some_and(|(s, level)| out(s, p) * bright > 0.5 * OUTLIER_DEVIATIONS * deviation * level)
    };
    inside.iter().filter(|p| stands(**p) && !of_scene(**p)).count()
}

fn mean_value(values: &[f32]) -> f64 {
    values.iter().map(|v| f64::from(*v)).sum::<f64>() / values.len() as f64
}

/// Returns the median of a pixel's eight neighbors.
fn neighbor_median(values: &[f32], width: usize, p: usize) -> f64 {
    let around =
        [p - width - 1, p - width, p - width + 1, p - 1, p + 1, p + width - 1, p + width, p + width + 1];
    let mut sorted = around.map(|q| values[q]);
    sorted.sort_by(f32::total_cmp);
    f64::midpoint(f64::from(sorted[3]), f64::from(sorted[4]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ErrorKind;
    use crate::draws::pattern_rng::PatternRng;
    use crate::draws::{RandomStream, Seeds};

    const SIDE: usize = 96;

    /// Returns a scene with textures of several sizes.
    fn scene() -> Vec<f32> {
        let wave = |p: usize, k: f64| ((p % SIDE) as f64 * k).sin() * ((p / SIDE) as f64 * k * 0.7).cos();
        (0..SIDE * SIDE).map(|p| (1.0 + 0.3 * wave(p, 0.11) + 0.1 * wave(p, 1.3)) as f32).collect()
    }

    fn noise(seed: u64, sigma: f64) -> Vec<f32> {
        let pattern =
            PatternRng::new(Seeds { camera: seed, ..Seeds::default() }, RandomStream::from_name("detail"));
        pattern.normals().take(SIDE * SIDE).map(|x| (sigma * x) as f32).collect()
    }

    fn sum(a: &[f32], b: &[f32]) -> Vec<f32> {
        a.iter().zip(b).map(|(a, b)| a + b).collect()
    }

    fn geometry() -> Geometry {
        Geometry::new(SIDE as u32, SIDE as u32).unwrap()
    }

    fn score_with(picture: &[f32], observed: [Vec<f32>; 2]) -> DetailScores {
        score_detail(
            picture,
            &DetailReference { observations: observed, mask: None, is_scene: true },
            geometry(),
        )
        .unwrap()
    }

    /// With 8,464 independent normal values, the standard error of a standard deviation is about 0.8 %, and the
    /// standard error of the slope is about 1 %.
    #[test]
    fn slope_and_noise_of_a_noisy_sharp_picture_are_one_and_its_noise() {
        let (truth, grain) = (scene(), noise(1, 0.05));
        let detail = score_with(&sum(&truth, &grain), [truth.clone(), truth.clone()]);
        assert!((detail.slope - 1.0).abs() < 0.05 && (detail.noise - 0.05).abs() < 0.002, "{detail:?}");
    }

    /// The noise of the observations is as large as the noise of the image.
    #[test]
    fn noise_of_the_reference_changes_neither() {
        let truth = scene();
        let [picture, a, b] = [1, 2, 3].map(|seed| sum(&truth, &noise(seed, 0.05)));
        let detail = score_with(&picture, [a, b]);
        assert!((detail.slope - 1.0).abs() < 0.1 && (detail.noise - 0.05).abs() < 0.005, "{detail:?}");
    }

    #[test]
    fn a_blur_has_less_noise_and_less_detail() {
        let (truth, grain) = (scene(), noise(1, 0.05));
        let sharp = sum(&truth, &grain);
        let soft = gaussian_blur(&sharp, geometry(), 1.0);
        let [sharp, soft] = [sharp, soft].map(|p| score_with(&p, [truth.clone(), truth.clone()]));
        assert!(
            soft.noise < 0.5 * sharp.noise && soft.slope < 0.6 && sharp.slope > 0.95,
            "{sharp:?} {soft:?}"
        );
    }

    #[test]
    fn a_picture_in_another_unit_is_the_same_picture() {
        let (truth, grain) = (scene(), noise(1, 0.05));
        let picture = sum(&truth, &grain);
        let scaled: Vec<f32> = picture.iter().map(|x| 0.25 * x + 3.0).collect();
        let [one, other] = [picture, scaled].map(|p| score_with(&p, [truth.clone(), truth.clone()]));
        let near = |a: f64, b: f64| (a / b - 1.0).abs() < 1e-3;
        assert!(near(one.slope, other.slope) && near(one.noise, other.noise), "{one:?} {other:?}");
        assert!(near(one.aligned_psnr_db, other.aligned_psnr_db), "{one:?} {other:?}");
    }

    #[test]
    fn pixels_that_stand_out_are_counted_unless_the_scene_has_them() {
        let (mut truth, grain) = (scene(), noise(1, 0.02));
        truth[40 * SIDE + 40] += 2.0;
        let mut picture = sum(&truth, &grain);
        for k in 0..7 {
            picture[(10 + 9 * k) * SIDE + 20] += 1.0;
        }
        assert_eq!(score_with(&picture, [truth.clone(), truth.clone()]).outliers, 7);
        let reference = DetailReference { observations: [truth.clone(), truth], mask: None, is_scene: false };
        assert_eq!(score_detail(&picture, &reference, geometry()).unwrap().outliers, 8);
    }

    #[test]
    fn flat_pictures_and_other_sizes_are_refused() {
        let reference = DetailReference { observations: [scene(), scene()], mask: None, is_scene: true };
        let flat = vec![1.0; SIDE * SIDE];
        assert_eq!(score_detail(&flat, &reference, geometry()).unwrap_err().kind(), ErrorKind::Input);
        assert_eq!(score_detail(&flat[1..], &reference, geometry()).unwrap_err().kind(), ErrorKind::Usage);
        let none = DetailReference { mask: Some(vec![false; SIDE * SIDE]), ..reference };
        assert_eq!(score_detail(&scene(), &none, geometry()).unwrap_err().kind(), ErrorKind::Input);
    }

    #[test]
    fn a_blur_keeps_what_is_flat_and_sums_to_one() {
        let flat = gaussian_blur(&vec![0.5; SIDE * SIDE], geometry(), 1.0);
        assert!(flat.iter().all(|x| (x - 0.5).abs() < 1e-6));
    }
}
