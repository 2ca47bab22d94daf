//! Levels of light that are not what was stated.
//!
//! A camera's response bends smoothly: dead time and a response that is not linear in proportion to the light, what leaks or is
//! added against it. So a level that lies off every smooth curve through the others is its lamp's. Mean rates are known far
//! better than a lamp, by all pixels together.

use nalgebra::{DMatrix, DVector};

use super::fault::{Fault, FaultKind};
use crate::LightLevel;
use crate::diagnose::protocol::recorded_set::LAMP;
use crate::diagnose::statistics::quantiles::Spread;

/// Deviations from every curve, and share of its light, from which on a level is off; of the darkest and the brightest the second ones:
/// a bend shows there most, and is known least from the others.
const OFF: [f64; 2] = [6.0, 4.5];
const LEAST: [f64; 2] = [0.005, 0.012];

/// Mean square of the others about their curve, in lamps' deviations, up to which that is a curve of theirs.
const SMOOTH: f64 = 6.0;

/// Scatter about any curve, in lamps' deviations, that is no chance with two degrees of freedom and more, and the most that is a lamp's: beyond,
/// the response is no smooth curve.
const SCATTER: [f64; 2] = [2.6, 15.0];

/// Fewest lit levels of which one can be said to be off, and of which all can be said to scatter.
const FEWEST: [usize; 2] = [4, 3];

/// The same scatter with the one degree of freedom that three levels leave, and by how much it then may be too small: in a quarter of
/// all cases one deviation shows less than a third of what it is drawn from.
const BY_ONE: [f64; 2] = [3.3, 2.0];

/// Rate above which a level tells nothing.
const SATURATED: f64 = 0.985;

/// What the levels say: the one that is off with its relative deviation, or how far all of them scatter, in lamps' deviations.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Said {
    Nothing,
    Off(usize, f64),
    Scatter(f64),
}

/// The level that is off, and the deviation of lamps that the levels show. `beside` is what a further scene says of its bright light.
pub(super) fn odd(
    levels: &[(usize, LightLevel)],
    beside: Option<[f64; 2]>,
) -> (Vec<(usize, Fault)>, Option<Fault>, f64) {
    let usual = |l: &LightLevel| Spread::of(&l.rate).trimmed;
    let dark = levels.iter().find(|(_, l)| l.light == 0.0).map_or(0.0, |(_, l)| usual(l));
    let lit: Vec<&(usize, LightLevel)> =
        levels.iter().filter(|(_, l)| l.light > 0.0 && l.median_rate() <= SATURATED).collect();
    let mut points: Vec<[f64; 2]> = lit.iter().map(|(_, l)| [l.light, (usual(l) - dark) / l.light]).collect();
    let own = points.len();
    points.extend(beside.map(|[light, rate]| [light, (rate - dark) / light]));
    match said(&points, own) {
        Said::Nothing => (Vec::new(), None, LAMP),
        Said::Off(i, by) => {
            let (k, level) = lit[i];
            let words = format!(
                "the light of this recording deviates by {:+.1} %: {} stated, {:.5} estimated in proportion to the other levels. No smooth response of a camera changes a single level in this way. Check the lamp.",
                100.0 * by,
                level.light,
                level.light * (1.0 + by)
            );
            (vec![(*k, Fault::of(&level.name, FaultKind::LightMismatch, words))], None, LAMP)
        }
        Said::Scatter(times) => {
            let words = format!(
                "the lit levels deviate by {:.1} % from any smooth response, but the assumed uncertainty of the lamps is {:.1} %. The larger value is used, so weaker nonlinearities of the response are not detectable.",
                100.0 * times * LAMP,
                100.0 * LAMP
            );
            (Vec::new(), Some(Fault::of_set(FaultKind::LightScatter, words)), times * LAMP)
        }
    }
}

/// Smooth responses over the light, relative: none but a scale, one that grows with it, one that falls.
fn curves(points: usize) -> Vec<fn(f64) -> Vec<f64>> {
    let mut all: Vec<fn(f64) -> Vec<f64>> = vec![|_| vec![1.0], |x| vec![1.0, x], |x| vec![1.0, 1.0 / x]];
    if points >= 6 {
        all.push(|x| vec![1.0, x, 1.0 / x]);
    }
    all
}

/// `points` are light and response over it; the first `own` may be off.
fn said(points: &[[f64; 2]], own: usize) -> Said {
    let scale = Spread::of(&points.iter().map(|p| p[1]).collect::<Vec<_>>()).median();
    let points: Vec<[f64; 2]> = points.iter().map(|p| [p[0], (p[1] / scale - 1.0) / LAMP]).collect();
    if own < FEWEST[1] || !(scale.is_finite() && scale > 0.0) {
        return Said::Nothing;
    }
    let all: Vec<usize> = (0..points.len()).collect();
    let whole = curves(points.len()).into_iter().filter_map(|c| Curve::of(&points, &all, c));
    let scatter = whole.map(|c| c.mean_square.sqrt()).fold(f64::INFINITY, f64::min);
    let few = points.len() < FEWEST[0];
    if scatter < if few { BY_ONE[0] } else { SCATTER[0] } {
        return Said::Nothing;
    }
    if own < FEWEST[0] {
        let more = if few { BY_ONE[1] } else { 1.0 };
        return if scatter < SCATTER[1] { Said::Scatter(more * scatter) } else { Said::Nothing };
    }
    let order = |i: usize| (0..own).filter(|j| points[*j][0] < points[i][0]).count();
    let candidates = (0..own).filter_map(|i| {
        let (times, by) = off(&points, i)?;
        let end = usize::from(order(i) == 0 || order(i) + 1 == own);
        // Pixels that saturate are short of spikes in the brightest light alone.
        let may_saturate = order(i) + 1 == own && own == points.len() && by < 0.0;
        (times > OFF[end] && by.abs() > LEAST[end] && !may_saturate).then_some((i, times, by))
    });
    match candidates.max_by(|a, b| a.1.total_cmp(&b.1)) {
        Some((i, _, by)) => Said::Off(i, by),
        None if scatter < SCATTER[1] => Said::Scatter(scatter),
        None => Said::Nothing,
    }
}

/// By how many deviations at least, and by which share, a level lies off the curves through the others; nothing where these are on none.
fn off(points: &[[f64; 2]], i: usize) -> Option<(f64, f64)> {
    let others: Vec<usize> = (0..points.len()).filter(|j| *j != i).collect();
    let of = |c| {
        let curve = Curve::of(points, &others, c).filter(|c| c.mean_square < SMOOTH)?;
        let (expected, variance) = curve.at(points[i][0]);
        let off = points[i][1] - expected;
        Some((off.abs() / (1.0 + variance).sqrt(), off * LAMP))
    };
    let found: Vec<(f64, f64)> = curves(others.len()).into_iter().filter_map(of).collect();
    let least = found.iter().map(|f| f.0).fold(f64::INFINITY, f64::min);
    // The simplest curve tells the deviation best.
    found.first().map(|f| (least, f.1))
}

/// A curve through some of the points, in lamps' deviations.
struct Curve {
    basis: fn(f64) -> Vec<f64>,
    values: DVector<f64>,
    covariance: DMatrix<f64>,
    /// Of what is left, over its degrees of freedom.
    mean_square: f64,
}

impl Curve {
    /// `None` where no degree of freedom is left.
    fn of(points: &[[f64; 2]], used: &[usize], basis: fn(f64) -> Vec<f64>) -> Option<Self> {
        let n = basis(1.0).len();
        if used.len() <= n {
            return None;
        }
        let rows: Vec<Vec<f64>> = used.iter().map(|i| basis(points[*i][0])).collect();
        let a = DMatrix::from_fn(used.len(), n, |i, j| rows[i][j]);
        let y = DVector::from_fn(used.len(), |i, _| points[used[i]][1]);
        let covariance = (a.transpose() * &a).try_inverse()?;
        let values = &covariance * a.transpose() * &y;
        let mean_square = (y - a * &values).norm_squared() / (used.len() - n) as f64;
        Some(Self { basis, values, covariance, mean_square })
    }

    /// Value and variance at a light.
    fn at(&self, light: f64) -> (f64, f64) {
        let row = DVector::from_vec((self.basis)(light));
        (row.dot(&self.values), row.dot(&(&self.covariance * &row)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIGHTS: [f64; 5] = [0.03, 0.1, 0.3, 0.6, 0.9];

    /// Lamps of a thousandth, and what a response adds.
    fn points(added: impl Fn(f64) -> f64) -> Vec<[f64; 2]> {
        let lamps = [4e-4, -1.1e-3, 9e-4, -3e-4, 1.2e-3];
        LIGHTS.iter().zip(lamps).map(|(x, e)| [*x, 0.98 * (1.0 + e + added(*x))]).collect()
    }

    #[test]
    fn any_one_level_that_is_off_by_three_per_cent_is_found() {
        for (i, light) in LIGHTS.into_iter().enumerate() {
            for by in [0.03, -0.03] {
                let found = said(&points(|x| if x == light { by } else { 0.0 }), 5);
                // The brightest short of light may be pixels that saturate.
                if i == 4 && by < 0.0 {
                    assert!(!matches!(found, Said::Off(..)), "{found:?}");
                    continue;
                }
                let Said::Off(j, found) = found else { panic!("{light} by {by}: {found:?}") };
                assert!(i == j && (found - by).abs() < 0.006, "{light} by {by}: {j} by {found}");
            }
        }
    }

    #[test]
    fn responses_that_bend_are_no_lamp() {
        let bends: [&dyn Fn(f64) -> f64; 6] =
            [&|_| 0.0, &|x| -0.05 * x, &|x| 0.02 * x, &|x| -6e-4 / x, &|x| -0.03 * x - 2e-4 / x, &|x| {
                0.02 * x + 3e-4 / x
            }];
        for (i, bend) in bends.iter().enumerate() {
            let found = said(&points(bend), 5);
            assert!(!matches!(found, Said::Off(..)), "{i}: {found:?}");
        }
    }

    #[test]
    fn lamps_that_all_scatter_are_taken_as_they_are() {
        let lamps = [7e-3, -6e-3, 5e-3, -8e-3, 6e-3];
        let points: Vec<[f64; 2]> = LIGHTS.iter().zip(lamps).map(|(x, e)| [*x, 1.0 + e]).collect();
        let Said::Scatter(times) = said(&points, 5) else { panic!() };
        assert!((4.0..12.0).contains(&times), "{times}");
    }

    #[test]
    fn three_levels_tell_lamps_that_scatter_from_a_response_that_bends() {
        let of = |added: [f64; 3]| {
            let points: Vec<[f64; 2]> =
                [0.1, 0.3, 0.7].iter().zip(added).map(|(x, e)| [*x, 1.0 + e]).collect();
            said(&points, 3)
        };
        let Said::Scatter(times) = of([6e-3, -9e-3, 4e-3]) else { panic!() };
        assert!((8.0..40.0).contains(&times), "{times}");
        for bend in [[0.0; 3], [-2e-3, -6e-3, -14e-3], [-6e-3, -2e-3, -0.9e-3]] {
            assert_eq!(of(bend), Said::Nothing, "{bend:?}");
        }
    }
}
