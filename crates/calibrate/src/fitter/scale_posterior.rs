//! Posterior error of the line through the light levels. A lamp that agrees with the other lamps can still be wrong.
//! Another line can therefore be right.
//!
//! The prior of each lit lamp has three cases. With probability 0.9 the lamp is as accurate as stated. With probability
//! 0.09 it deviates by up to 12 %, and all deviations are equally likely. With probability 0.01 it is mislabeled, and its
//! deviation has a standard deviation of 30 %. For example, three lamps can form two pairs,
//! and the lamps of each pair can differ by 3 standard deviations. Either pair can then be right. The posterior of the
//! scale then has two peaks, and the error must cover both peaks.
//!
//! The posterior is summed on a grid of lines. The result is the posterior root mean square deviation from the chosen
//! line. If this deviation exceeds the error of the chosen line, it replaces the error.

/// A lit or dark level: its found light, its stated light, and the standard deviation of the stated light.
#[derive(Clone, Copy, Debug)]
pub(super) struct StatedLevel {
    pub(super) found_light: f64,
    pub(super) stated_light: f64,
    pub(super) sd: f64,
}

/// Relative uncertainty of a level that is off the line.
pub(super) const OUTLIER_UNCERTAINTY: f64 = 0.3;

/// Prior probability that a lamp is wrong.
const OUTLIER_PRIOR: f64 = 0.1;

/// Largest relative deviation of a wrong lamp. A recording set may contain deviations of up to 10 %. The other 2 % are
/// for the deviation of a lamp that is as accurate as stated.
const MAX_RELATIVE_DEVIATION: f64 = 0.12;

/// Prior probability that a wrong lamp is mislabeled. Its deviation is then normal with a standard deviation of 30 %.
const FAR_PRIOR: f64 = 0.1;

/// Step of the grid in standard errors of the line.
const GRID_STEP: f64 = 0.25;
/// Maximum number of grid steps to each side of the chosen line.
const MAX_GRID_STEPS: i32 = 400;

/// Returns the root mean square deviations of the posterior lines from `line`: the relative deviation of the scale, and
/// the deviation of the shift. `errors` are the errors of scale and shift if the chosen levels are right.
pub(super) fn scale_posterior(
    lit: &[StatedLevel],
    dark: Option<&StatedLevel>,
    line: (f64, f64),
    errors: [f64; 2],
) -> [f64; 2] {
    let scale_step = GRID_STEP * errors[0];
    let scales = half_width_steps(MAX_RELATIVE_DEVIATION, scale_step);
    let nearest = lit.iter().map(|l| l.stated_light).fold(f64::INFINITY, f64::min);
    let shift_step = GRID_STEP * errors[1];
    let shifts =
        if dark.is_some() { 0 } else { half_width_steps(MAX_RELATIVE_DEVIATION * nearest, shift_step) };
    // The errors of scale and shift are independent if the line is expressed about the weighted mean of the lit levels.
    let middle = lit.iter().map(|l| l.found_light / l.sd.powi(2)).sum::<f64>()
        / lit.iter().map(|l| l.sd.powi(-2)).sum::<f64>();
    let turn = dark.map_or(middle, |d| d.found_light);
    let (mut sums, mut top) = ([0.0; 3], f64::NEG_INFINITY);
    for i in -scales..=scales {
        for j in -shifts..=shifts {
            let by = f64::from(i) * scale_step;
            let scale = line.0 * (1.0 + by);
            let shift = line.1 - line.0 * by * turn + f64::from(j) * shift_step;
            let log = lit.iter().map(|l| log_density(l, scale, shift)).sum::<f64>();
            if log > top {
                sums = sums.map(|s| s * (top - log).exp());
                top = log;
            }
            let weight = (log - top).exp();
            sums[0] += weight;
            sums[1] += weight * by * by;
            sums[2] += weight * (shift - line.1).powi(2);
        }
    }
    [(sums[1] / sums[0]).sqrt(), if dark.is_some() { 0.0 } else { (sums[2] / sums[0]).sqrt() }]
}

fn half_width_steps(range: f64, step: f64) -> i32 {
    ((range / step).ceil() as i32).clamp(1, MAX_GRID_STEPS)
}

/// Returns the log density of a lamp's deviation from a line. The deviation is in units of the lamp's stated standard
/// deviation. The density is the mixture of the three cases.
fn log_density(l: &StatedLevel, scale: f64, shift: f64) -> f64 {
    let deviation = scale * l.found_light + shift - l.stated_light;
    let z = deviation / l.sd;
    let right = (-0.5 * z * z).exp() / (2.0 * std::f64::consts::PI).sqrt();
    let relative_sd = l.sd / l.stated_light;
    let relative = deviation / l.stated_light;
    let near = if relative.abs() <= MAX_RELATIVE_DEVIATION { 0.5 / MAX_RELATIVE_DEVIATION } else { 0.0 };
    // A mislabeled lamp can be outside the range, so a set with such a lamp still has a best line.
    let u = relative / OUTLIER_UNCERTAINTY;
    let far = (-0.5 * u * u).exp() / ((2.0 * std::f64::consts::PI).sqrt() * OUTLIER_UNCERTAINTY);
    let off = relative_sd * ((1.0 - FAR_PRIOR) * near + FAR_PRIOR * far);
    ((1.0 - OUTLIER_PRIOR) * right + OUTLIER_PRIOR * off).ln()
}
