//! Light levels that contradict their stated uncertainty.
//!
//! The response of a camera is a smooth function of the light. Dead time and nonlinearity change the response in
//! proportion to the light. Leaks and offsets change it in inverse proportion to the light. If one level deviates
//! from every smooth response through the other levels, the cause is therefore its lamp. The error of the mean rate
//! of all pixels is much smaller than the error of any lamp.
//!
//! No recording is excluded because of its level. Its lamp receives a larger uncertainty instead, which covers the
//! deviation.

use crate::faults::fault::{Fault, FaultKind};
use crate::statistics::order::Spread;
use crate::thresholds::{
    MAX_LAMP_SCATTER, MAX_LEVEL_PULL, MIN_LEVEL_DEVIATIONS, MIN_LIT_LEVELS, MIN_RESPONSE_UNCERTAINTY,
    REPORTED_LAMP_UNCERTAINTY, REPORTED_SCATTER_Z, WIDENED_SCATTER_Z,
};
use nalgebra::{DMatrix, DVector};
use spikelane_calibrate::LightLevel;
use spikelane_calibrate::unstable::{SATURATION_RATE, chi_square_over_freedom};

/// The response of a camera at one light level.
#[derive(Clone, Copy, Debug)]
pub(super) struct Point {
    /// Index of the recording, or `None` for a level that is not reported, such as the squares of a checkerboard.
    pub recording: Option<usize>,
    pub light: f64,
    /// Rate minus the rate in the dark, divided by the light.
    pub response: f64,
    /// Relative standard deviation of the light.
    pub uncertainty: f64,
}

/// Result of the comparison of all levels with smooth responses.
#[derive(Debug, Default)]
pub(super) struct LampCheck {
    /// Recordings whose light deviates from the stated light, each with its relative deviation.
    pub off: Vec<(usize, f64)>,
    /// Factor for the uncertainties of the other lamps, at least 1.
    pub factor: f64,
    /// Relative scatter of the levels about a smooth response. `None` if it is too small for a report.
    pub scatter: Option<f64>,
}

/// Returns the points of the lit uniform levels below saturation. `uncertainty` returns the relative uncertainty of
/// the light of a recording.
pub(super) fn points(levels: &[(usize, LightLevel)], uncertainty: impl Fn(usize) -> f64) -> Vec<Point> {
    let dark = dark_rate(levels);
    let lit = levels.iter().filter(|(_, l)| l.light > 0.0 && l.median_rate() <= SATURATION_RATE);
    lit.map(|(k, l)| Point {
        recording: Some(*k),
        light: l.light,
        response: (usual(l) - dark) / l.light,
        uncertainty: uncertainty(*k),
    })
    .collect()
}

pub(super) fn dark_rate(levels: &[(usize, LightLevel)]) -> f64 {
    levels.iter().find(|(_, l)| l.light == 0.0).map_or(0.0, |(_, l)| usual(l))
}

fn usual(level: &LightLevel) -> f64 {
    Spread::of(&level.rate).trimmed
}

impl LampCheck {
    /// Returns the faults of the lamps. `name` returns the file name of a recording.
    pub(super) fn faults(&self, points: &[Point], name: impl Fn(usize) -> String) -> Vec<Fault> {
        let stated = |k: usize| points.iter().find(|p| p.recording == Some(k));
        let off = self.off.iter().filter_map(|(k, by)| {
            let point = stated(*k)?;
            let words = format!(
                "the light of this recording deviates by {:+.1} %: {} stated, {:.5} estimated in proportion to the other levels. This is more than {MAX_LEVEL_PULL} times the uncertainty of the light ({} %), and no smooth response of a camera changes a single level in this way. Check the lamp. The diagnosis uses the noise of this recording, but not its level.",
                100.0 * by,
                point.light,
                point.light * (1.0 + by),
                100.0 * point.uncertainty,
            );
            Some(Fault::of_lamp(&name(*k), words))
        });
        let mut faults: Vec<Fault> = off.collect();
        let of = |p: &Point| p.uncertainty;
        let stated = points.iter().map(of).fold(0.0, f64::max);
        if let Some(scatter) = self.scatter {
            faults.push(Fault::of_set(
                FaultKind::LightScatter,
                format!(
                    "the lit levels deviate by {:.1} % from any smooth response, and the uncertainty of the light is {} %. The diagnosis uses {:.1} % instead, so weaker nonlinearities of the response are not detectable.",
                    100.0 * scatter,
                    100.0 * stated,
                    100.0 * stated * self.factor
                ),
            ));
        }
        faults
    }

    /// Returns the uncertainty that the diagnosis uses for the light of recording `k`. `stated` is the stated
    /// uncertainty.
    pub(super) fn uncertainty(&self, k: usize, stated: f64) -> f64 {
        if self.off.iter().any(|(off, _)| *off == k) {
            return stated.max(REPORTED_LAMP_UNCERTAINTY);
        }
        stated * self.factor
    }
}

/// Basis functions of smooth responses. Their argument is the light, and the responses are relative to their
/// median.
fn curves(points: usize) -> Vec<fn(f64) -> Vec<f64>> {
    let mut all: Vec<fn(f64) -> Vec<f64>> = vec![|_| vec![1.0], |x| vec![1.0, x], |x| vec![1.0, 1.0 / x]];
    if points >= 6 {
        all.push(|x| vec![1.0, x, 1.0 / x]);
    }
    all
}

/// Compares all levels with smooth responses. First removes single levels that deviate, then tests the scatter of
/// the others.
pub(super) fn check(points: &[Point]) -> LampCheck {
    let scale = Spread::of(&points.iter().map(|p| p.response).collect::<Vec<_>>()).median();
    let mut left: Vec<Point> = points.to_vec();
    left.iter_mut().for_each(|p| p.response = p.response / scale - 1.0);
    let mut found = LampCheck { factor: 1.0, ..LampCheck::default() };
    let own = |points: &[Point]| points.iter().filter(|p| p.recording.is_some()).count();
    if own(&left) < MIN_LIT_LEVELS[1] || !(scale.is_finite() && scale > 0.0) {
        return found;
    }
    // Most lamps must remain, because each lamp is compared with the others.
    while own(&left) >= MIN_LIT_LEVELS[0] && 3 * found.off.len() < points.len() && !is_smooth(&left) {
        let Some((i, by)) = most_deviating(&left) else { break };
        found.off.extend(left[i].recording.map(|k| (k, by)));
        left.remove(i);
    }
    let Some((freedom, mean_square)) = scatter(&left) else { return found };
    let relative = mean_square.sqrt() * left.iter().map(|p| p.uncertainty).sum::<f64>() / left.len() as f64;
    if relative > MAX_LAMP_SCATTER {
        return found;
    }
    let square = mean_square * freedom as f64;
    if square > limit(freedom, WIDENED_SCATTER_Z) {
        // The largest uncertainty factor at which a scatter this small or smaller has a probability of 5 %.
        found.factor = (square / lower_twentieth(freedom)).sqrt().max(1.0);
    }
    found.scatter = (square > limit(freedom, REPORTED_SCATTER_Z)).then_some(relative);
    found
}

/// Returns the degrees of freedom and the mean squared deviation of the best-fitting curve.
fn scatter(points: &[Point]) -> Option<(usize, f64)> {
    let all: Vec<usize> = (0..points.len()).collect();
    let fitted = curves(points.len()).into_iter().filter_map(|c| Curve::of(points, &all, c));
    fitted.map(|c| (c.freedom, c.mean_square)).min_by(|a, b| a.1.total_cmp(&b.1))
}

fn is_smooth(points: &[Point]) -> bool {
    scatter(points).is_none_or(|(freedom, mean_square)| {
        mean_square * freedom as f64 <= limit(freedom, REPORTED_SCATTER_Z)
    })
}

/// Returns the index and the relative deviation of the level that deviates most from every smooth response through
/// the other levels.
fn most_deviating(points: &[Point]) -> Option<(usize, f64)> {
    let brightest = (0..points.len()).max_by(|a, b| points[*a].light.total_cmp(&points[*b].light));
    let candidates = (0..points.len()).filter(|i| points[*i].recording.is_some()).filter_map(|i| {
        let (excess, by) = deviation(points, i)?;
        // Saturated pixels lack spikes. In the brightest level, a negative deviation may therefore come from
        // saturation instead of the lamp.
        let may_saturate = brightest == Some(i) && by < 0.0;
        let darker = points.iter().filter(|p| p.light < points[i].light).count();
        let is_end = darker == 0 || darker + 1 == points.len();
        (excess > 0.0 && by.abs() > MIN_LEVEL_DEVIATIONS[usize::from(is_end)] && !may_saturate)
            .then_some((i, excess, by))
    });
    candidates.max_by(|a, b| a.1.total_cmp(&b.1)).map(|(i, _, by)| (i, by))
}

/// Compares level `i` with smooth responses through the other levels. Returns `None` if no curve fits the other
/// levels.
///
/// The first value is the excess of the deviation over [`MAX_LEVEL_PULL`], in standard deviations, for the curve
/// with the smallest excess. The second value is the relative deviation from the simplest curve.
fn deviation(points: &[Point], i: usize) -> Option<(f64, f64)> {
    let others: Vec<usize> = (0..points.len()).filter(|j| *j != i).collect();
    let of = |c| {
        let curve = Curve::of(points, &others, c)
            .filter(|c| c.mean_square * c.freedom as f64 <= limit(c.freedom, REPORTED_SCATTER_Z))?;
        let (expected, variance) = curve.at(points[i].light);
        let off = points[i].response - expected;
        // The other lamps may deviate as well, so the curve has an error. Two standard deviations of the curve are
        // therefore subtracted.
        let own = points[i].uncertainty.hypot(MIN_RESPONSE_UNCERTAINTY);
        Some(((off.abs() - 2.0 * variance.sqrt()) / own - MAX_LEVEL_PULL, off))
    };
    let found: Vec<(f64, f64)> = curves(others.len()).into_iter().filter_map(of).collect();
    let least = found.iter().map(|f| f.0).fold(f64::INFINITY, f64::min);
    found.first().map(|f| (least, f.1))
}

/// Returns the value of chi-square at the normal quantile `z`.
fn limit(freedom: usize, z: f64) -> f64 {
    freedom as f64 * chi_square_over_freedom(freedom as f64, z)
}

/// Returns the 5 % quantile of chi-square with `freedom` degrees of freedom.
fn lower_twentieth(freedom: usize) -> f64 {
    match freedom {
        // The approximation in `limit` is inaccurate for few degrees of freedom. For one, this is the squared
        // normal quantile at the probability 0.525. For two, chi-square follows an exponential distribution.
        1 => 0.003_93,
        2 => 0.102_6,
        _ => limit(freedom, -WIDENED_SCATTER_Z),
    }
}

/// A smooth response that is fitted to some of the levels. Each level is weighted by its uncertainty.
struct Curve {
    basis: fn(f64) -> Vec<f64>,
    values: DVector<f64>,
    covariance: DMatrix<f64>,
    freedom: usize,
    /// Sum of the squared weighted deviations, divided by the degrees of freedom.
    mean_square: f64,
}

impl Curve {
    /// Fits a curve to the points with the indices `used`. Returns `None` if no degree of freedom remains.
    fn of(points: &[Point], used: &[usize], basis: fn(f64) -> Vec<f64>) -> Option<Self> {
        let n = basis(1.0).len();
        if used.len() <= n {
            return None;
        }
        let weight = |i: usize| points[used[i]].uncertainty.hypot(MIN_RESPONSE_UNCERTAINTY).recip();
        let rows: Vec<Vec<f64>> = used.iter().map(|i| basis(points[*i].light)).collect();
        let a = DMatrix::from_fn(used.len(), n, |i, j| weight(i) * rows[i][j]);
        let y = DVector::from_fn(used.len(), |i, _| weight(i) * points[used[i]].response);
        let covariance = (a.transpose() * &a).try_inverse()?;
        let values = &covariance * a.transpose() * &y;
        let freedom = used.len() - n;
        let mean_square = (y - a * &values).norm_squared() / freedom as f64;
        Some(Self { basis, values, covariance, freedom, mean_square })
    }

    /// Returns the value of the curve at `light` and the variance of this value.
    fn at(&self, light: f64) -> (f64, f64) {
        let row = DVector::from_vec((self.basis)(light));
        (row.dot(&self.values), row.dot(&(&self.covariance * &row)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use spikelane::unstable::draws::pattern_rng::PatternRng;
    use spikelane::unstable::draws::{RandomStream, Seeds};

    const LIGHTS: [f64; 5] = [0.03, 0.1, 0.3, 0.6, 0.9];

    fn set(lights: &[f64], uncertainty: f64, deviation: impl Fn(usize, f64) -> f64) -> Vec<Point> {
        let point = |(i, x): (usize, &f64)| Point {
            recording: Some(i),
            light: *x,
            response: 0.98 * (1.0 + deviation(i, *x)),
            uncertainty,
        };
        lights.iter().enumerate().map(point).collect()
    }

    /// All lamps deviate by about 0.1 %, and one lamp additionally deviates by 3 %.
    #[test]
    fn any_level_off_by_many_uncertainties_is_found() {
        let lamps = [4e-4, -1.1e-3, 9e-4, -3e-4, 1.2e-3];
        for off in 0..LIGHTS.len() {
            for by in [0.03, -0.03] {
                let found = check(&set(&LIGHTS, 1e-3, |i, _| lamps[i] + if i == off { by } else { 0.0 }));
                // The negative deviation of the brightest level may come from saturated pixels, so it is not
                // reported.
                if off == 4 && by < 0.0 {
                    assert!(found.off.is_empty(), "{found:?}");
                    continue;
                }
                let [(k, found)] = found.off[..] else { panic!("{off} by {by}: {found:?}") };
                assert!(k == off && (found - by).abs() < 0.006, "{off} by {by}: {k} by {found}");
            }
        }
    }

    #[test]
    fn smooth_responses_are_not_attributed_to_lamps() {
        let lamps = [4e-4, -1.1e-3, 9e-4, -3e-4, 1.2e-3];
        let bends: [&dyn Fn(f64) -> f64; 6] =
            [&|_| 0.0, &|x| -0.05 * x, &|x| 0.02 * x, &|x| -6e-4 / x, &|x| -0.03 * x - 2e-4 / x, &|x| {
                0.02 * x + 3e-4 / x
            }];
        for (number, bend) in bends.iter().enumerate() {
            let found = check(&set(&LIGHTS, 1e-3, |i, x| lamps[i] + bend(x)));
            assert!(found.off.is_empty(), "{number}: {found:?}");
        }
    }

    /// Ten lamps have deviations that agree with their stated uncertainty. Each lamp is reported with a probability
    /// below 5e-4, so at most 10 reports are expected in 2,000 sets. The limit of 20 is three standard deviations
    /// higher.
    #[test]
    fn lamps_within_their_uncertainty_are_hardly_ever_reported() {
        let seeds = Seeds { camera: 8, shot: 0, sequence: 0 };
        let mut normal = PatternRng::new(seeds, RandomStream::from_name("lamps")).normals();
        let lights = [0.01, 0.03, 0.1, 0.2, 0.3, 0.45, 0.55, 0.7, 0.8, 0.9];
        let (mut off, mut scattered, mut widened) = (0, 0, 0);
        for _ in 0..2000 {
            let lamps: Vec<f64> = (0..10).map(|_| 0.01 * normal.next().unwrap()).collect();
            let found = check(&set(&lights, 0.01, |i, _| lamps[i]));
            off += found.off.len();
            scattered += usize::from(found.scatter.is_some());
            widened += usize::from(found.factor > 1.0);
        }
        assert!(off <= 20 && scattered <= 10 && widened <= 150, "{off} {scattered} {widened}");
    }

    /// The stated uncertainty is a fifth of the true one. In nearly all sets, the widened uncertainty covers the
    /// true deviations.
    #[test]
    fn uncertainties_that_are_stated_too_small_are_widened() {
        let seeds = Seeds { camera: 9, shot: 0, sequence: 0 };
        let mut normal = PatternRng::new(seeds, RandomStream::from_name("lamps")).normals();
        let lights = [0.03, 0.1, 0.3, 0.49, 0.6, 0.66, 0.74, 0.9];
        let (mut largest, mut covered) = (Vec::new(), 0);
        for _ in 0..500 {
            let lamps: Vec<f64> = (0..8).map(|_| 0.01 * normal.next().unwrap()).collect();
            let points = set(&lights, 0.002, |i, _| lamps[i]);
            let found = check(&points);
            let used = |i: usize| found.uncertainty(i, 0.002);
            let pull = (0..8).map(|i| (lamps[i] / used(i)).abs()).fold(0.0, f64::max);
            covered += usize::from(pull < 3.5);
            largest.push(pull);
        }
        largest.sort_by(f64::total_cmp);
        assert!(covered >= 475, "{covered} of 500, 95th percentile of the largest pull {}", largest[475]);
    }

    #[test]
    fn three_levels_scatter_and_do_not_bend() {
        let of = |added: [f64; 3]| check(&set(&[0.1, 0.3, 0.7], 1e-3, |i, _| added[i]));
        let scattered = of([6e-3, -9e-3, 4e-3]);
        assert!(scattered.scatter.is_some() && scattered.factor > 4.0, "{scattered:?}");
        for bend in [[0.0; 3], [-2e-3, -6e-3, -14e-3], [-6e-3, -2e-3, -0.9e-3]] {
            assert!(of(bend).scatter.is_none(), "{bend:?}");
        }
    }
}
