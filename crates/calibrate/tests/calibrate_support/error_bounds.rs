//! Computes the smallest errors that are possible with the counts of a laboratory and the stated uncertainty of its lamps.
//!
//! The errors are Cramer-Rao bounds for normal estimates:
//!
//! * Scale of the light: `u / sqrt(n)`, for `n` correct lamps with the relative uncertainty `u`.
//! * Mean over `N` pixels: `sd / sqrt(N)`. Spread of `N` pixels: `sd / sqrt(2 N)`. The variance `sd^2` includes the
//!   variance of each pixel's error.
//! * Noise: relative error `1 / sqrt(2 M)`, for `M` spikes. Each spike is one sample of the variance.
//!
//! No estimate reaches the bound of the noise, because spike times are rounded to readouts. The rounding is as large as
//! the noise of a dark interval, and a hundred times the noise of a bright interval. In addition, phases are correlated.

use super::lab::{Laboratory, Shot};

/// Relative uncertainty of a lamp that `calibrate` assumes.
const LAMP_UNCERTAINTY: f64 = 0.01;

/// A recording with a higher rate, in spikes per readout, is not used.
const SATURATION_RATE: f64 = 0.985;

/// A lamp with a larger relative deviation is deliberately wrong.
const MAX_LAMP_DEVIATION: f64 = 0.035;

/// Brightest light at which intervals are measured.
const MAX_INTERVAL_LIGHT: f64 = 0.12;

/// Returns the smallest absolute errors in the order of [`super::assessment::QUANTITIES`], without the levels.
pub(crate) fn best_errors(lab: &Laboratory) -> [f64; 6] {
    let n = &lab.noise;
    let pixels = lab.defect_free_pixels().count() as f64;
    let [scale, shift] = best_alignment_errors(lab);
    let [var_a, var_d] = best_pixel_variances(lab);
    let sd_a = (n.gain_sd.powi(2) + n.threshold_sd.powi(2)).sqrt();
    let sd_d = n.dark_sd.hypot(n.dark * n.threshold_sd);
    let mean = |sd: f64, pixel_variance: f64| ((sd * sd + pixel_variance) / pixels).sqrt();
    let spread = |sd: f64, pixel_variance: f64| (sd * sd + pixel_variance) / (sd * (2.0 * pixels).sqrt());
    let [threshold, electrons] = best_noise_errors(lab);
    [
        mean(sd_a, var_a).hypot(scale),
        spread(sd_a, var_a).hypot(sd_a * scale),
        mean(sd_d, var_d).hypot(shift),
        spread(sd_d, var_d).hypot(sd_a * shift),
        threshold,
        electrons,
    ]
}

/// Returns the smallest relative error of a level. It is the error of the common scale of all levels. No recording
/// determines this scale.
pub(crate) fn best_level_error(lab: &Laboratory) -> f64 {
    best_alignment_errors(lab)[0]
}

fn usable_shots(lab: &Laboratory) -> impl Iterator<Item = &Shot> {
    lab.shots.iter().filter(|s| s.light + lab.noise.dark < SATURATION_RATE)
}

/// Returns the relative error of the scale and the error of the shift that all levels share.
fn best_alignment_errors(lab: &Laboratory) -> [f64; 2] {
    let right =
        usable_shots(lab).filter(|s| s.light > 0.0 && (s.light / s.stated - 1.0).abs() < MAX_LAMP_DEVIATION);
    let (mut ss, mut s, mut one) = (0.0, 0.0, 0.0);
    for shot in right {
        let w = (LAMP_UNCERTAINTY * shot.stated).powi(-2);
        ss += w * shot.stated * shot.stated;
        s += w * shot.stated;
        one += w;
    }
    if lab.shots[0].stated == 0.0 {
        return [1.0 / ss.sqrt(), 0.0];
    }
    let det = ss * one - s * s;
    [(one / det).sqrt(), (ss / det).sqrt()]
}

/// Returns the variances of the gain and of the dark rate of an average pixel, if the light is known.
fn best_pixel_variances(lab: &Laboratory) -> [f64; 2] {
    let n = &lab.noise;
    let (mut aa, mut ad, mut dd) = (0.0, 0.0, 0.0);
    for shot in usable_shots(lab) {
        let x = shot.light + n.dark;
        let spikes = x * f64::from(shot.readouts);
        let phase = n.sigma_t * n.sigma_t + shot.light / x / n.photons;
        // The variance of a rate is the phase noise of the spikes, plus the rounding of the first and last spike.
        let w = 1.0 / (x * x * phase / spikes + x.powi(4) / (6.0 * spikes * spikes));
        aa += w * shot.light * shot.light;
        ad += w * shot.light;
        dd += w;
    }
    let det = aa * dd - ad * ad;
    [dd / det, aa / det]
}

/// Returns the smallest errors of the threshold noise and of the electrons.
fn best_noise_errors(lab: &Laboratory) -> [f64; 2] {
    let n = &lab.noise;
    let pixels = lab.defect_free_pixels().count() as f64;
    let square = n.sigma_t * n.sigma_t;
    let (mut dark, mut lit) = (0.0, 0.0);
    for shot in usable_shots(lab).filter(|s| s.light < MAX_INTERVAL_LIGHT) {
        let x = shot.light + n.dark;
        let spikes = pixels * x * f64::from(shot.readouts);
        if shot.light == 0.0 {
            dark += spikes;
        } else {
            lit += spikes / (2.0 * (square + 1.0 / n.photons).powi(2));
        }
    }
    [n.sigma_t / (2.0 * dark).sqrt(), n.photons.powi(2) * (1.0 / lit + 2.0 * square * square / dark).sqrt()]
}
