//! What became of detail and of noise in a picture, beside a reference of the same scene.
//!
//! A mean square error alone prefers a blur where noise is strong. So detail and noise are told apart: the part of a picture that a mean over
//! 3x3 pixels leaves is detail as far as it follows the reference's, and noise as far as it does not.

use std::ops::Range;

use crate::error::{Error, Kind, Result};
use crate::reconstruct::{psnr, span};
use crate::spikes::{Geometry, Packed};

/// Deviations by which a pixel has to stand out of its neighbours.
const OUTLYING: f64 = 6.0;

/// A scene as it is, or as long and independent observations have it.
#[derive(Clone, Debug)]
pub struct Reference {
    /// The scene twice, each with noise of its own; the same where there is no noise.
    pub observed: [Vec<f32>; 2],
    /// Pixels that count, if not all do.
    pub counted: Option<Vec<bool>>,
    /// Whether what stands out of its neighbours in the reference is a part of the scene. Recordings have pixels that do in every
    /// picture of theirs.
    pub is_scene: bool,
}

/// What is said of a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Detail {
    /// Peak signal-to-noise ratio in decibels after the line of least squares from picture to reference, infinite for equal ones. The peak is what one
    /// pixel in a thousand of the reference exceeds.
    pub aligned_psnr_db: f64,
    /// Share of the reference's detail that is there: 1 is sharp, 0 flat; above 1 it is exaggerated.
    pub slope: f64,
    /// Standard deviation of what follows no detail of the reference, as a share of the reference's mean.
    pub noise: f64,
    /// Pixels that stand out of the median of their neighbours by six deviations of what pixels of this picture do, and not in the
    /// scene.
    pub outliers: usize,
}

impl Reference {
    /// Readouts that there have to be before and behind a picture's own.
    pub const LEAST: usize = 20;

    /// A scene that stands still, as the span rates of the readouts before `own`, those of a picture, and behind them have it.
    ///
    /// # Errors
    /// [`Kind::Usage`] when there are fewer than 20 readouts on either side.
    pub fn of_others(packed: Packed, own: Range<usize>) -> Result<Self> {
        let all = packed.readouts();
        if own.start < Self::LEAST || own.end + Self::LEAST > all {
            return Err(Error::new(Kind::Usage, "a still scene beside a picture of it")
                .found(format_args!("{all} readouts, {own:?} of them in the picture"))
                .expected(format_args!("{} and more before and behind", Self::LEAST))
                .remedy("give a smaller --window, or --at nearer to the middle"));
        }
        let of = |part: Range<usize>| span(packed.part(part.clone()), part.len() / 2, part.len());
        Ok(Self { observed: [of(0..own.start)?, of(own.end..all)?], counted: None, is_scene: false })
    }
}

impl Detail {
    /// The mean of several, term by term, outliers rounded; none of none.
    #[must_use]
    pub fn average(all: &[Self]) -> Option<Self> {
        let mean = |f: fn(&Self) -> f64| all.iter().map(f).sum::<f64>() / all.len() as f64;
        (!all.is_empty()).then(|| Self {
            aligned_psnr_db: mean(|d| d.aligned_psnr_db),
            slope: mean(|d| d.slope),
            noise: mean(|d| d.noise),
            outliers: mean(|d| d.outliers as f64).round() as usize,
        })
    }
}

/// Compares `picture` with `reference`, whose unit may be another.
///
/// With `h` what a mean over 3x3 pixels leaves of a picture `p` and of the two observations `a` and `b` of the scene, and the line `p ~ g (a + b) / 2 + c` of
/// least squares through their means over 5x5 pixels, the slope is `<h(p), h(a) + h(b)> / (2 g <h(a), h(b)>)`: noise of the observations is in no product, so
/// it makes the slope no smaller. The noise is that of `h(p) / g - slope (h(a) + h(b)) / 2`, times `sqrt(9 / 8)` for the
/// ninth of a pixel's own variance that its mean takes away, less what the observations add.
///
/// # Errors
/// [`Kind::Usage`] when sizes differ or a side is below 8 pixels; [`Kind::Input`] when picture or reference are flat, or too few pixels count.
pub fn detail(picture: &[f32], reference: &Reference, geometry: Geometry) -> Result<Detail> {
    check(picture, reference, geometry)?;
    let [a, b] = &reference.observed;
    let mean: Vec<f32> = a.iter().zip(b).map(|(a, b)| 0.5 * (a + b)).collect();
    let inside = inside(geometry, reference.counted.as_deref());
    let pick = |values: &[f64]| -> Vec<f64> { inside.iter().map(|p| values[*p]).collect() };
    let smooth = |values: &[f32]| pick(&box_mean(values, geometry, 2));
    let fine = |values: &[f32]| -> Vec<f64> {
        let means = box_mean(values, geometry, 1);
        inside.iter().map(|p| f64::from(values[*p]) - means[*p]).collect()
    };
    let gain = Line::of(&smooth(&mean), &smooth(picture)).slope;
    let (p, a, b) = (fine(picture), fine(a), fine(b));
    let both: Vec<f64> = a.iter().zip(&b).map(|(a, b)| 0.5 * (a + b)).collect();
    let power = product(&a, &b);
    let slope = product(&p, &both) / (gain * power);
    if !(slope.is_finite() && power > 0.0) {
        return Err(Error::new(Kind::Input, "detail of a picture")
            .found("a picture or a reference without detail that agrees")
            .expected("a scene that is not flat"));
    }
    // The mean of two observations has a quarter of the noise by which they differ.
    let own = a.iter().zip(&b).map(|(a, b)| (0.5 * (a - b)).powi(2)).sum::<f64>();
    let left = p.iter().zip(&both).map(|(p, r)| (p / gain - slope * r).powi(2)).sum::<f64>();
    let variance = (left - slope * slope * own).max(0.0) / p.len() as f64;
    let level = inside.iter().map(|p| f64::from(mean[*p])).sum::<f64>() / inside.len() as f64;
    Ok(Detail {
        aligned_psnr_db: aligned_psnr(&chosen(picture, &inside), &chosen(&mean, &inside))?,
        slope,
        noise: (9.0 / 8.0 * variance).sqrt() / level,
        outliers: outliers(picture, reference.is_scene.then_some(&mean), geometry, &inside),
    })
}

/// PSNR after the line of least squares from picture to truth; the peak is what one pixel in 1,000 of the truth exceeds.
///
/// # Errors
/// As [`psnr`]; a truth that is dark has no peak.
pub fn aligned_psnr(picture: &[f32], truth: &[f32]) -> Result<f64> {
    let wide = |v: &[f32]| -> Vec<f64> { v.iter().map(|x| f64::from(*x)).collect() };
    let line = Line::of(&wide(picture), &wide(truth));
    let fitted: Vec<f32> = picture.iter().map(|x| line.at(f64::from(*x)) as f32).collect();
    psnr(&fitted, truth, f64::from(peak(truth)))
}

/// What one pixel in 1,000 exceeds.
fn peak(truth: &[f32]) -> f32 {
    let mut sorted = truth.to_vec();
    sorted.sort_by(f32::total_cmp);
    sorted.len().checked_sub(1 + sorted.len() / 1000).map_or(0.0, |at| sorted[at])
}

/// The picture under a Gaussian of `sigma` pixels, its borders continued: what a comparison should never take for an improvement.
#[must_use]
pub fn blurred(picture: &[f32], geometry: Geometry, sigma: f64) -> Vec<f32> {
    let reach = (3.0 * sigma).ceil() as usize;
    let weights: Vec<f64> =
        (0..=2 * reach).map(|k| libm::exp(-((k as f64 - reach as f64) / sigma).powi(2) / 2.0)).collect();
    let sum: f64 = weights.iter().sum();
    let [width, height] = [geometry.width(), geometry.height()];
    // The pixel `k` further along a line of `size` pixels, which is `place` of it, `step` apart.
    let along = |values: &[f32], p: usize, place: usize, size: usize, step: usize| {
        let near = |k: usize| (place + k).saturating_sub(reach).min(size - 1);
        let line = p - place * step;
        let taken = weights.iter().enumerate().map(|(k, w)| w * f64::from(values[line + near(k) * step]));
        (taken.sum::<f64>() / sum) as f32
    };
    let all = 0..geometry.pixels();
    let rows: Vec<f32> = all.clone().map(|p| along(picture, p, p % width, width, 1)).collect();
    all.map(|p| along(&rows, p, p / width, height, width)).collect()
}

/// A line of least squares.
struct Line {
    slope: f64,
    from: [f64; 2],
}

impl Line {
    fn of(x: &[f64], y: &[f64]) -> Self {
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

fn check(picture: &[f32], reference: &Reference, geometry: Geometry) -> Result<()> {
    let sizes = [picture.len(), reference.observed[0].len(), reference.observed[1].len()];
    let counted = reference.counted.as_ref().is_none_or(|c| c.len() == geometry.pixels());
    if sizes != [geometry.pixels(); 3] || !counted || geometry.width() < 8 || geometry.height() < 8 {
        return Err(Error::new(Kind::Usage, "picture and reference")
            .found(format_args!("{sizes:?} values for {geometry} pixels"))
            .expected("one size, 8x8 pixels and more"));
    }
    if inside(geometry, reference.counted.as_deref()).len() < 32 {
        return Err(Error::new(Kind::Input, "picture and reference")
            .found("fewer than 32 pixels in which nothing moves")
            .expected("a scene that stands still in parts"));
    }
    Ok(())
}

/// Pixels that count and are two from the border and more.
fn inside(geometry: Geometry, counted: Option<&[bool]>) -> Vec<usize> {
    let [width, height] = [geometry.width(), geometry.height()];
    let all = (2..height - 2).flat_map(|y| (2..width - 2).map(move |x| y * width + x));
    all.filter(|p| counted.is_none_or(|c| c[*p])).collect()
}

fn chosen(values: &[f32], pixels: &[usize]) -> Vec<f32> {
    pixels.iter().map(|p| values[*p]).collect()
}

/// The mean over the pixels up to `radius` to each side; zero at the border, where it is not asked for.
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
    let out = |values: &[f32], p: usize| f64::from(values[p]) - neighbours(values, geometry.width(), p);
    let mut sizes: Vec<f64> = inside.iter().map(|p| out(picture, *p).abs()).collect();
    let middle = sizes.len() / 2;
    // Of a normal variable the median absolute value is 0.6745 deviations.
    let deviation = *sizes.select_nth_unstable_by(middle, f64::total_cmp).1 / 0.6745;
    let stands = |p: usize| out(picture, p) > OUTLYING * deviation;
    let scene = scene.map(|s| (s, level(s)));
    let bright = level(picture);
    let of_scene =
        |p: usize| scene.is_some_and(|(s, level)| out(s, p) * bright > 0.5 * OUTLYING * deviation * level);
    inside.iter().filter(|p| stands(**p) && !of_scene(**p)).count()
}

fn level(values: &[f32]) -> f64 {
    values.iter().map(|v| f64::from(*v)).sum::<f64>() / values.len() as f64
}

/// The median of a pixel's eight neighbours.
fn neighbours(values: &[f32], width: usize, p: usize) -> f64 {
    let around =
        [p - width - 1, p - width, p - width + 1, p - 1, p + 1, p + width - 1, p + width, p + width + 1];
    let mut found = around.map(|q| values[q]);
    found.sort_by(f32::total_cmp);
    f64::midpoint(f64::from(found[3]), f64::from(found[4]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draws::pattern::Pattern;
    use crate::draws::{Seeds, Stream};

    const SIDE: usize = 96;

    /// Texture of several sizes, and normal noise of its own for each `seed`.
    fn scene() -> Vec<f32> {
        let wave = |p: usize, k: f64| ((p % SIDE) as f64 * k).sin() * ((p / SIDE) as f64 * k * 0.7).cos();
        (0..SIDE * SIDE).map(|p| (1.0 + 0.3 * wave(p, 0.11) + 0.1 * wave(p, 1.3)) as f32).collect()
    }

    fn noise(seed: u64, sigma: f64) -> Vec<f32> {
        let pattern = Pattern::new(Seeds { camera: seed, ..Seeds::default() }, Stream::named("detail"));
        pattern.normals().take(SIDE * SIDE).map(|x| (sigma * x) as f32).collect()
    }

    fn sum(a: &[f32], b: &[f32]) -> Vec<f32> {
        a.iter().zip(b).map(|(a, b)| a + b).collect()
    }

    fn geometry() -> Geometry {
        Geometry::new(SIDE as u32, SIDE as u32).unwrap()
    }

    fn of(picture: &[f32], observed: [Vec<f32>; 2]) -> Detail {
        detail(picture, &Reference { observed, counted: None, is_scene: true }, geometry()).unwrap()
    }

    /// 8,464 normal values: a deviation is good to 0.8 %, a slope to 0.05 / sqrt(8,464) / 0.04 = 1.4 %.
    #[test]
    fn slope_and_noise_of_a_noisy_sharp_picture_are_one_and_its_noise() {
        let (truth, grain) = (scene(), noise(1, 0.05));
        let found = of(&sum(&truth, &grain), [truth.clone(), truth.clone()]);
        assert!((found.slope - 1.0).abs() < 0.05 && (found.noise - 0.05).abs() < 0.002, "{found:?}");
    }

    /// The noise of the observations is as large as that of the picture.
    #[test]
    fn noise_of_the_reference_changes_neither() {
        let truth = scene();
        let [picture, a, b] = [1, 2, 3].map(|seed| sum(&truth, &noise(seed, 0.05)));
        let found = of(&picture, [a, b]);
        assert!((found.slope - 1.0).abs() < 0.1 && (found.noise - 0.05).abs() < 0.005, "{found:?}");
    }

    #[test]
    fn a_blur_has_less_noise_and_less_detail() {
        let (truth, grain) = (scene(), noise(1, 0.05));
        let sharp = sum(&truth, &grain);
        let soft = blurred(&sharp, geometry(), 1.0);
        let [sharp, soft] = [sharp, soft].map(|p| of(&p, [truth.clone(), truth.clone()]));
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
        let [one, other] = [picture, scaled].map(|p| of(&p, [truth.clone(), truth.clone()]));
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
        assert_eq!(of(&picture, [truth.clone(), truth.clone()]).outliers, 7);
        let reference = Reference { observed: [truth.clone(), truth], counted: None, is_scene: false };
        assert_eq!(detail(&picture, &reference, geometry()).unwrap().outliers, 8);
    }

    #[test]
    fn flat_pictures_and_other_sizes_are_refused() {
        let reference = Reference { observed: [scene(), scene()], counted: None, is_scene: true };
        let flat = vec![1.0; SIDE * SIDE];
        assert_eq!(detail(&flat, &reference, geometry()).unwrap_err().kind(), Kind::Input);
        assert_eq!(detail(&flat[1..], &reference, geometry()).unwrap_err().kind(), Kind::Usage);
        let none = Reference { counted: Some(vec![false; SIDE * SIDE]), ..reference };
        assert_eq!(detail(&scene(), &none, geometry()).unwrap_err().kind(), Kind::Input);
    }

    #[test]
    fn a_blur_keeps_what_is_flat_and_sums_to_one() {
        let flat = blurred(&vec![0.5; SIDE * SIDE], geometry(), 1.0);
        assert!(flat.iter().all(|x| (x - 0.5).abs() < 1e-6));
    }
}
