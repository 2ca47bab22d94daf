//! The least errors that the counts of a laboratory and the stated uncertainty of its lamps allow.
//!
//! Cramer-Rao bounds where estimates are normal: of `n` lamps that are right the scale is known to `u / sqrt(n)`; of `N` pixels a mean to
//! `sd / sqrt(N)`, a spread to `sd / sqrt(2 N)`, with each pixel's own error added to the variance; of `M` spikes a noise whose variance each
//! shows once to `1 / sqrt(2 M)`. The last one is out of reach: a spike's time is rounded to a readout, which is as much as the
//! noise of a dark interval and a hundred times that of a bright one, and phases are drawn together.

use super::lab::{Lab, Shot};

/// What `calibrate` takes a lamp to be known to.
const UNCERTAINTY: f64 = 0.01;

/// A recording is used below this rate.
const SATURATED: f64 = 0.985;

/// A lamp that is off by more than this was not meant to be as stated.
const RIGHT: f64 = 0.035;

/// Intervals are looked at up to this light.
const DIM: f64 = 0.12;

/// Absolute errors, in the order of [`super::judge::QUANTITIES`] without the levels.
pub(crate) fn errors(lab: &Lab) -> [f64; 6] {
    let n = &lab.noise;
    let pixels = lab.usual().count() as f64;
    let [scale, shift] = lamps(lab);
    let [var_a, var_d] = pixel(lab);
    let sd_a = (n.gain_sd.powi(2) + n.threshold_sd.powi(2)).sqrt();
    let sd_d = n.dark_sd.hypot(n.dark * n.threshold_sd);
    let mean = |sd: f64, own: f64| ((sd * sd + own) / pixels).sqrt();
    let spread = |sd: f64, own: f64| (sd * sd + own) / (sd * (2.0 * pixels).sqrt());
    let [threshold, electrons] = noise(lab);
    [
        mean(sd_a, var_a).hypot(scale),
        spread(sd_a, var_a).hypot(sd_a * scale),
        mean(sd_d, var_d).hypot(shift),
        spread(sd_d, var_d).hypot(sd_a * shift),
        threshold,
        electrons,
    ]
}

/// Relative error of a level: that of the scale, which no recording tells.
pub(crate) fn level(lab: &Lab) -> f64 {
    lamps(lab)[0]
}

fn usable(lab: &Lab) -> impl Iterator<Item = &Shot> {
    lab.shots.iter().filter(|s| s.light + lab.noise.dark < SATURATED)
}

/// Errors of the scale and of the shift of all levels.
fn lamps(lab: &Lab) -> [f64; 2] {
    let right = usable(lab).filter(|s| s.light > 0.0 && (s.light / s.stated - 1.0).abs() < RIGHT);
    let (mut ss, mut s, mut one) = (0.0, 0.0, 0.0);
    for shot in right {
        let w = (UNCERTAINTY * shot.stated).powi(-2);
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

/// Variances of a mean pixel's gain and dark rate, with the light known.
fn pixel(lab: &Lab) -> [f64; 2] {
    let n = &lab.noise;
    let (mut aa, mut ad, mut dd) = (0.0, 0.0, 0.0);
    for shot in usable(lab) {
        let x = shot.light + n.dark;
        let spikes = x * f64::from(shot.readouts);
        let phase = n.sigma_t * n.sigma_t + shot.light / x / n.photons;
        // Noise of the spikes between, and two rounded ends.
        let w = 1.0 / (x * x * phase / spikes + x.powi(4) / (6.0 * spikes * spikes));
        aa += w * shot.light * shot.light;
        ad += w * shot.light;
        dd += w;
    }
    let det = aa * dd - ad * ad;
    [dd / det, aa / det]
}

/// Errors of the threshold noise and of the electrons.
fn noise(lab: &Lab) -> [f64; 2] {
    let n = &lab.noise;
    let pixels = lab.usual().count() as f64;
    let square = n.sigma_t * n.sigma_t;
    let (mut dark, mut lit) = (0.0, 0.0);
    for shot in usable(lab).filter(|s| s.light < DIM) {
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
