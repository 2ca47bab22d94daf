//! How far the line of the levels may be from the one that was chosen, since a lamp that is off may hide among those that agree.
//!
//! Each lit lamp is as good as stated, or, one in ten, off by anything up to twelve per cent. Of three lamps two that lie 3 deviations apart
//! may both be right, and so may another two: the posterior of the scale then has two summits, and the error has to hold both. It is
//! summed on a grid of lines, and its root mean square about the chosen line is the error where it is the wider one.

/// A lit level, or the dark: its value as the recordings have it, as it was stated, and the standard deviation of what was stated.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stated {
    pub(super) found: f64,
    pub(super) light: f64,
    pub(super) sd: f64,
}

/// Prior share of lamps that are off.
const OFF: f64 = 0.1;

/// Furthest that a lamp is off, relative: the tenth that a set may have, and the deviation of a lamp as stated.
const FURTHEST: f64 = 0.12;

/// Steps of the grid in the error of the line, and steps at most.
const FINE: f64 = 0.25;
const STEPS: i32 = 400;

/// Root mean square deviation of the scale, relative, and of the shift about `line`, whose errors are `errors` if all is as chosen.
pub(super) fn doubt(lit: &[Stated], dark: Option<&Stated>, line: (f64, f64), errors: [f64; 2]) -> [f64; 2] {
    let scale_step = FINE * errors[0];
    let scales = half_width(FURTHEST, scale_step);
    let nearest = lit.iter().map(|l| l.light).fold(f64::INFINITY, f64::min);
    let shift_step = FINE * errors[1];
    let shifts = if dark.is_some() { 0 } else { half_width(FURTHEST * nearest, shift_step) };
    // The middle of the lit levels, about which scale and shift do not depend on each other.
    let middle = lit.iter().map(|l| l.found / l.sd.powi(2)).sum::<f64>()
        / lit.iter().map(|l| l.sd.powi(-2)).sum::<f64>();
    let turn = dark.map_or(middle, |d| d.found);
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

fn half_width(range: f64, step: f64) -> i32 {
    ((range / step).ceil() as i32).clamp(1, STEPS)
}

/// Of a lamp's deviation from a line, in its stated deviations: normal, or even over what a lamp can be off.
fn log_density(l: &Stated, scale: f64, shift: f64) -> f64 {
    let deviation = scale * l.found + shift - l.light;
    let z = deviation / l.sd;
    let right = (-0.5 * z * z).exp() / (2.0 * std::f64::consts::PI).sqrt();
    let within = deviation.abs() <= FURTHEST * l.light;
    // Beyond that range little is left, but not nothing: a set that has such a lamp still has a best line.
    let off = l.sd / (2.0 * FURTHEST * l.light) * if within { 1.0 } else { 1e-6 };
    ((1.0 - OFF) * right + OFF * off).ln()
}
