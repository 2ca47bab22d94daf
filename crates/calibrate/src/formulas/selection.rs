//! Effects of threshold noise that is redrawn at every readout.
//!
//! * `z`: a standard normal draw. `sigma`: standard deviation of the noise, in thresholds.
//! * `x`: charge per readout in thresholds. `g = x / sigma`: charge per readout in units of `sigma`.
//! * `y`: distance of the charge below the threshold, in units of `sigma`.
//! * `phi` and `Phi`: density and distribution function of the standard normal distribution.
//!
//! A pixel fires at the first draw `z` for which `1 + sigma z` is below the charge. The draws at which it fires are
//! therefore not typical. The charge approaches the threshold in steps of `g`, and its phase is uniform. The mean of a
//! function `h` of the draw at a spike is
//! `E[h(z)] = 1/g * integral H(y) prod_(i>=1) Phi(y + i g) dy`, with `H(y) = E[h(z); z <= -y]`.
//!
//! * For `h = z`: the rate increases by `sigma^2 psi(g)`, with `psi(g) = integral phi(y) prod_(i>=1) Phi(y + i g) dy`.
//!   [`noise_rate_gain`] returns `psi(g)`.
//! * For `h = z^2`: one spike adds the variance `sigma^2 nu(g)` to the phase. [`firing_draw_variance`] returns
//!   `nu(g)`.
//!
//! The charge at which a pixel fires is `Y = -y` above the mean threshold, in units of `sigma`. Both ends of a span of
//! spike times contribute `2 (Var Y - Cov(Y, z)) / g^2` to the variance of the span, in readouts squared. Noise that is
//! constant between resets contributes 1/6, the rounding to whole readouts. [`redraw_end_variance`] returns the
//! difference.

use std::sync::OnceLock;

use spikelane::unstable::threads;

/// Number of grid points of each table. The points are uniform in `ln g`.
const GRID_POINTS: usize = 512;
/// Smallest `g` in the tables.
const MIN_INCREMENT: f64 = 1e-3;
/// Largest `g` in the tables.
const MAX_INCREMENT: f64 = 100.0;

static TABLES: OnceLock<[Vec<f64>; 3]> = OnceLock::new();

/// Computes the tables of this module unless they exist. Call this function before
/// parallel work that uses the tables. Otherwise all threads wait until one thread has computed them.
pub(crate) fn prepare_tables() {
    tables();
}

fn tables() -> &'static [Vec<f64>; 3] {
    if let Some(tables) = TABLES.get() {
        return tables;
    }
    // The tables are computed before the lock is taken. Parallel work inside the lock could wait for the same lock and
    // never end.
    let step = (MAX_INCREMENT / MIN_INCREMENT).ln() / (GRID_POINTS - 1) as f64;
    let each = threads::map(0..GRID_POINTS, |i| draw_moments(MIN_INCREMENT * (step * i as f64).exp()));
    TABLES.get_or_init(|| [0, 1, 2].map(|column| each.iter().map(|row| row[column]).collect()))
}

/// Returns `psi(g)`, the rate that threshold noise adds divided by the variance of the noise. `psi` is 0 for slow pixels
/// and 1 for fast pixels.
#[must_use]
pub fn noise_rate_gain(g: f64) -> f64 {
    lookup(&tables()[0], g)
}

/// Returns `nu(g)`, the variance of the draws at which a pixel fires divided by the variance of all draws.
#[must_use]
pub fn firing_draw_variance(g: f64) -> f64 {
    lookup(&tables()[1], g)
}

/// Returns the variance that redrawn noise adds to both ends of a span of spike times, in readouts squared. It is 0 for
/// noise that is constant between resets.
#[must_use]
pub(crate) fn redraw_end_variance(g: f64) -> f64 {
    lookup(&tables()[2], g)
}

fn lookup(table: &[f64], g: f64) -> f64 {
    if g.is_nan() || g <= 0.0 {
        return 0.0;
    }
    let step = (MAX_INCREMENT / MIN_INCREMENT).ln() / (GRID_POINTS - 1) as f64;
    let at = ((g / MIN_INCREMENT).ln() / step).clamp(0.0, (GRID_POINTS - 1) as f64);
    let i = (at as usize).min(GRID_POINTS - 2);
    table[i] + (at - i as f64) * (table[i + 1] - table[i])
}

fn normal_pdf(y: f64) -> f64 {
    (-0.5 * y * y).exp() / (2.0 * std::f64::consts::PI).sqrt()
}

fn normal_cdf(y: f64) -> f64 {
    0.5 * libm::erfc(-y / std::f64::consts::SQRT_2)
}

/// Largest width of a cell of the integrals.
const MAX_CELL: f64 = 0.02;

/// Returns `psi(g)`, `nu(g)` and the end variance, computed by the midpoint rule. For these smooth integrands the error
/// decreases faster than any power of the step.
///
/// The probability that no draw of an earlier readout fired is `S(y) = prod_(i>=1) Phi(y + i g)`. It satisfies
/// `S(y) = Phi(y + g) S(y + g)`. A whole number of cells covers `g`, so one product per cell gives `S`, from the highest
/// cell down.
fn draw_moments(g: f64) -> [f64; 3] {
    // The charge can be a whole increment above the threshold, so the range is extended by `g`.
    let (low, high) = (-8.0 - g, 8.0);
    let per_increment = (g / MAX_CELL).ceil() as usize;
    let h = g / per_increment as f64;
    let cells = ((high - low) / h).ceil() as usize;
    let (mut first, mut second) = (0.0, 0.0);
    let (mut charge, mut charge_square, mut product) = (0.0, 0.0, 0.0);
    // `S(y - g)` of each cell, from the highest `y` down. Above the range, no draw prevents a spike.
    let mut survival_below: Vec<f64> = Vec::with_capacity(cells);
    for i in 0..cells {
        let y = high - h * (i as f64 + 0.5);
        let survival = i.checked_sub(per_increment).map_or(1.0, |above| survival_below[above]);
        let (density, above) = (normal_pdf(y), normal_cdf(-y));
        survival_below.push((1.0 - above) * survival);
        if survival == 0.0 {
            break;
        }
        first += density * survival * h;
        second += (above + y * density) * survival * h;
        charge -= y * above * survival * h;
        charge_square += y * y * above * survival * h;
        product += y * density * survival * h;
    }
    let [mean, charge] = [-first / g, charge / g];
    let end = 2.0 * (charge_square / g - charge * charge - product / g + charge * mean) / (g * g);
    [first, (second / g - mean * mean).max(0.0), (end - 1.0 / 6.0).max(0.0)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn psi_has_the_values_of_direct_simulation() {
        // The expected values are simulated rates of single pixels. They are accurate to about 0.01.
        for (g, expected) in [
            (0.1, 0.170),
            (0.2, 0.282),
            (0.4, 0.448),
            (0.8, 0.656),
            (1.2, 0.788),
            (2.0, 0.917),
            (20.0, 0.995),
        ] {
            assert!((noise_rate_gain(g) - expected).abs() < 0.012, "psi({g}) = {}", noise_rate_gain(g));
        }
    }

    /// The grid of phases in `phase.rs` gives 1.9393 readouts squared for the variance of one interval of a dark pixel
    /// with the published noise. It shares no integral with this module. An error of 0.1 % is detected.
    #[test]
    fn end_variance_and_growth_sum_to_the_variance_of_an_interval() {
        let g = 0.004_68 * 1.0924 / 0.006_36;
        let one = firing_draw_variance(g) / (g * g) + 1.0 / 6.0 + redraw_end_variance(g);
        assert!((one / 1.9393 - 1.0).abs() < 1e-3, "{one}");
        assert!(redraw_end_variance(100.0) < 1e-4, "{}", redraw_end_variance(100.0));
    }

    #[test]
    fn a_fast_pixel_fires_at_typical_draws() {
        assert!(
            (firing_draw_variance(100.0) - 1.0).abs() < 0.01
                && firing_draw_variance(0.1) < firing_draw_variance(1.0),
            "{} {} {}",
            firing_draw_variance(0.1),
            firing_draw_variance(1.0),
            firing_draw_variance(100.0)
        );
    }
}
