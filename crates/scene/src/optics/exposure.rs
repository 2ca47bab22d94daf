//! The exposure of the camera: the luminance that is white, as a function of time.
//!
//! The camera meters the scene and changes its iris with a lag, as auto-iris lenses do. White is high enough for the
//! bright parts of the image, unless these parts are so small that the rest would be black.

use spikelane::error::{Result, error};

/// How the luminance of white follows the scene.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub enum Exposure {
    /// White follows the scene with a lag of a third of a second.
    #[default]
    Automatic,
    /// White stays at the luminance that the camera meters at the start of the drive.
    Locked,
    /// White stays at this luminance in cd/m2.
    Fixed(f32),
}

/// Time constant with which the logarithm of white follows the scene, in seconds.
const LAG_S: f64 = 0.3;
/// Longest time between two metered instants, in seconds. It is a sixth of the lag.
pub(crate) const METER_INTERVAL_S: f64 = 0.05;
/// Fraction of the pixels that may exceed white.
const HIGHLIGHT_SHARE: f32 = 0.02;
/// White is lowered until the mean light, clipped at white, is this fraction of white. Otherwise a small bright area,
/// such as the exit of a tunnel, would make the rest of the image black.
const MIN_MEAN_LIGHT: f32 = 0.06;
/// Lower limit of white in cd/m2, far below the darkest scene.
const MIN_WHITE_CD_M2: f32 = 1e-3;

impl Exposure {
    pub(crate) fn check(self) -> Result<()> {
        match self {
            Self::Fixed(white) if !(white.is_finite() && white > 0.0) => {
                Err(error!(Usage, "luminance of white"; found "{white} cd/m2"; expected "a positive number"))
            }
            _ => Ok(()),
        }
    }
}

/// The logarithm of white at evenly spaced instants.
#[derive(Debug)]
pub(crate) struct ExposureCurve {
    interval_s: f64,
    log_white: Vec<f64>,
}

impl ExposureCurve {
    /// Returns the curve that follows the logarithms of metered white, which are `interval_s` apart, with a lag.
    pub(crate) fn from_metered(log_metered: &[f64], interval_s: f64) -> Self {
        Self { interval_s, log_white: follow_with_lag(log_metered, interval_s) }
    }

    /// Returns white at time `t`, which is clamped to the curve.
    pub(crate) fn at(&self, t: f64) -> f32 {
        let last = self.log_white.len() - 1;
        let x = (t / self.interval_s).clamp(0.0, last as f64);
        let k = (x as usize).min(last.saturating_sub(1));
        let next = self.log_white[(k + 1).min(last)];
        libm::exp(self.log_white[k] + (next - self.log_white[k]) * (x - k as f64)) as f32
    }
}

/// Returns the logarithm of white at evenly spaced instants, from the metered logarithms at the same instants.
///
/// It is the first-order lag w' = (m - w) / [`LAG_S`], where m is the metered value. m is constant between two instants
/// and equals its value at the later instant. White starts at the first metered value.
fn follow_with_lag(metered: &[f64], interval_s: f64) -> Vec<f64> {
    let keep = libm::exp(-interval_s / LAG_S);
    let mut white = metered[0];
    let follow = |&target: &f64| {
        white = target + (white - target) * keep;
        white
    };
    metered.iter().map(follow).collect()
}

/// Returns the white for an image.
pub(crate) fn white_of(light: &mut [f32]) -> f32 {
    light.sort_unstable_by(f32::total_cmp);
    let index = ((1.0 - HIGHLIGHT_SHARE) * light.len() as f32) as usize;
    let highlight = light[index.min(light.len() - 1)].max(MIN_WHITE_CD_M2);
    let mean = |white: f32| light.iter().map(|l| (l / white).min(1.0)).sum::<f32>() / light.len() as f32;
    if mean(highlight) >= MIN_MEAN_LIGHT {
        return highlight;
    }
    // The mean decreases with white, so a bisection of the logarithm finds white.
    let (mut low, mut high) = (MIN_WHITE_CD_M2, highlight);
    for _ in 0..24 {
        let middle = (low * high).sqrt();
        if mean(middle) >= MIN_MEAN_LIGHT { low = middle } else { high = middle }
    }
    low
}

#[cfg(test)]
mod tests {
    use super::{
        ExposureCurve, HIGHLIGHT_SHARE, LAG_S, METER_INTERVAL_S, MIN_MEAN_LIGHT, follow_with_lag, white_of,
    };

    fn mean_light(light: &[f32], white: f32) -> f32 {
        light.iter().map(|l| (l / white).min(1.0)).sum::<f32>() / light.len() as f32
    }

    #[test]
    fn a_fiftieth_of_an_even_image_exceeds_white() {
        let mut light: Vec<f32> = (0..1000).map(|i| i as f32).collect();
        let white = white_of(&mut light);
        let above = light.iter().filter(|&&l| l > white).count() as f32 / 1000.0;
        assert!((above - HIGHLIGHT_SHARE).abs() < 0.002, "{above}");
    }

    #[test]
    fn a_small_exit_of_a_tunnel_leaves_its_walls_visible() {
        for exit in [30, 50, 200] {
            let mut light: Vec<f32> = (0..1000).map(|i| if i < exit { 9000.0 } else { 40.0 }).collect();
            let white = white_of(&mut light);
            let mean = mean_light(&light, white);
            assert!(mean >= 0.99 * MIN_MEAN_LIGHT, "{exit}: mean {mean} at {white}");
            // A large exit is exposed well.
            assert_eq!(exit > 100, white >= 9000.0, "{exit}: white {white}");
        }
    }

    /// The exact response to a step at time 0 is a + (b - a) (1 - exp(-t / 0.3 s)) for the logarithms a and b. The step is
    /// metered up to one interval late, and is then treated as up to one interval earlier. Between two instants, the
    /// logarithm is interpolated linearly, which differs by less than an eighth of (interval / lag)^2 of the step.
    #[test]
    fn white_follows_a_step_of_the_light_with_the_stated_time_constant() {
        let (dark, bright) = (10f64, 3_000f64);
        let steps = 80;
        let first_bright = 20;
        let metered: Vec<f64> =
            (0..=steps).map(|k| if k < first_bright { dark.ln() } else { bright.ln() }).collect();
        let curve = ExposureCurve::from_metered(&metered, METER_INTERVAL_S);
        let chord = (METER_INTERVAL_S / LAG_S).powi(2) / 8.0;
        let share = |t: f64| (f64::from(curve.at(t)) / dark).ln() / (bright / dark).ln();
        let step_response = |t: f64| if t <= 0.0 { 0.0 } else { 1.0 - (-t / LAG_S).exp() };
        for i in 0..=800 {
            let t = 0.005 * f64::from(i);
            let after_step = t - f64::from(first_bright) * METER_INTERVAL_S;
            let earliest = step_response(after_step + METER_INTERVAL_S) + chord + 1e-6;
            let latest = step_response(after_step) - chord - 1e-6;
            assert!((latest..=earliest).contains(&share(t)), "{} at {after_step} s after the step", share(t));
        }
    }

    #[test]
    fn white_follows_down_as_fast_as_up() {
        let step = |from: f64, to: f64| {
            let metered: Vec<f64> = (0..40).map(|k| if k < 5 { from } else { to }).collect();
            follow_with_lag(&metered, METER_INTERVAL_S)
        };
        for (up, down) in step(0.0, 1.0).into_iter().zip(step(1.0, 0.0)) {
            assert!((up - (1.0 - down)).abs() < 1e-12, "{up} up, {down} down");
        }
    }

    #[test]
    fn a_dark_image_has_a_positive_white() {
        assert!(white_of(&mut [0.0; 100]) > 0.0);
    }
}
