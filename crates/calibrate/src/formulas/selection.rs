//! What threshold noise that is redrawn at every readout does to a pixel.
//!
//! A pixel fires at the first draw `z` with `1 + sigma z` below its charge, so
//! the draws at which it fires are not typical ones. With `g = x / sigma` the
//! increment in units of the noise, and the charge approaching the threshold
//! through positions `y, y + g, ...` (uniform phase), the draw at a spike has
//! `E[h(z)] = 1/g * integral H(y) prod_(i>=1) Phi(y + i g) dy`, `H(y) = E[h(z); z <= -y]`.
//! From `h = z`, the rate gains `sigma^2 psi(g)`, with
//! `psi(g) = integral phi(y) prod_(i>=1) Phi(y + i g) dy`, and from `h = z^2` the
//! variance that one spike adds to the phase is `sigma^2 nu(g)`.

use std::sync::OnceLock;

use spikelane::unstable::threads;

/// Grid of the tables: `ln g` from `ln 1e-3` to `ln 100`.
const POINTS: usize = 512;
const LOWEST: f64 = 1e-3;
const HIGHEST: f64 = 100.0;

static TABLES: OnceLock<(Vec<f64>, Vec<f64>)> = OnceLock::new();

/// Makes the tables of [`psi`] and [`nu`], if they are not made yet. Parallel work that uses them calls it first, so that its
/// threads do not wait for one.
pub(crate) fn prepare() {
    tables();
}

fn tables() -> &'static (Vec<f64>, Vec<f64>) {
    if let Some(tables) = TABLES.get() {
        return tables;
    }
    // Outside the lock: parallel work that waited for the lock would wait for itself.
    let step = (HIGHEST / LOWEST).ln() / (POINTS - 1) as f64;
    let each = threads::map(0..POINTS, |i| integrals(LOWEST * (step * i as f64).exp()));
    TABLES.get_or_init(|| each.into_iter().unzip())
}

/// The rate that threshold noise adds, over its variance: 0 for slow pixels, 1 for fast ones.
#[must_use]
pub fn psi(g: f64) -> f64 {
    lookup(&tables().0, g)
}

/// Variance of the draws at which a pixel fires, over that of all draws.
#[must_use]
pub fn nu(g: f64) -> f64 {
    lookup(&tables().1, g)
}

fn lookup(table: &[f64], g: f64) -> f64 {
    if g.is_nan() || g <= 0.0 {
        return 0.0;
    }
    let step = (HIGHEST / LOWEST).ln() / (POINTS - 1) as f64;
    let at = ((g / LOWEST).ln() / step).clamp(0.0, (POINTS - 1) as f64);
    let i = (at as usize).min(POINTS - 2);
    table[i] + (at - i as f64) * (table[i + 1] - table[i])
}

fn density(y: f64) -> f64 {
    (-0.5 * y * y).exp() / (2.0 * std::f64::consts::PI).sqrt()
}

fn cumulative(y: f64) -> f64 {
    0.5 * libm::erfc(-y / std::f64::consts::SQRT_2)
}

/// `psi` and `nu` by the midpoint rule, which converges faster than any power for such integrands.
fn integrals(g: f64) -> (f64, f64) {
    // A charge may already lie a whole increment above the threshold.
    let (low, high) = (-8.0 - g, 8.0);
    let cells = ((high - low) / 0.02).ceil();
    let h = (high - low) / cells;
    let (mut first, mut second) = (0.0, 0.0);
    for i in 0..cells as i32 {
        let y = low + h * (f64::from(i) + 0.5);
        let waited = survived(y, g);
        if waited == 0.0 {
            continue;
        }
        first += density(y) * waited * h;
        second += (cumulative(-y) + y * density(y)) * waited * h;
    }
    let mean = -first / g;
    (first, (second / g - mean * mean).max(0.0))
}

/// Probability that no earlier readout of the approach fired: the product over `y + i g`, `i >= 1`.
fn survived(y: f64, g: f64) -> f64 {
    let mut log = 0.0;
    let mut at = y + g;
    while at < 8.0 {
        log += cumulative(at).max(1e-300).ln();
        if log < -40.0 {
            return 0.0;
        }
        at += g;
    }
    log.exp()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn psi_has_the_values_of_direct_simulation() {
        // Simulated rates of single pixels, good to about 0.01.
        for (g, expected) in [
            (0.1, 0.170),
            (0.2, 0.282),
            (0.4, 0.448),
            (0.8, 0.656),
            (1.2, 0.788),
            (2.0, 0.917),
            (20.0, 0.995),
        ] {
            assert!((psi(g) - expected).abs() < 0.012, "psi({g}) = {}", psi(g));
        }
    }

    #[test]
    fn a_fast_pixel_fires_at_typical_draws() {
        assert!((nu(100.0) - 1.0).abs() < 0.01 && nu(0.1) < nu(1.0), "{} {} {}", nu(0.1), nu(1.0), nu(100.0));
    }
}
