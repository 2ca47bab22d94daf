//! Parameters of a given camera that the data contradict.

use crate::search::effect_search::{Evidence, SearchResult};
use crate::search::state::TestedFit;
use crate::thresholds::{CALIBRATION_INFORMATION, MAX_AMBIGUOUS_DISTANCE, MIN_MISMATCH_GAIN};
use nalgebra::{DMatrix, DVector};

/// A parameter that the data contradict.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Contradicted {
    pub number: usize,
    /// Position of the fitted parameter, and its standard deviation. Parameters that the data do not contradict are
    /// held at their given values.
    pub position: f64,
    pub deviation: f64,
    /// Indices of the parameters that explain the data equally well in the place of this one.
    pub tied: Vec<usize>,
    /// Decrease of the squared distance when this parameter becomes free. The parameters before it are free
    /// already.
    pub gain: f64,
    /// Change of all parameters when this parameter becomes free.
    pub change: DVector<f64>,
    /// Whether the held-out set confirms the mismatch.
    pub is_borne_out: bool,
}

/// The contradicted parameters. `distance` is the squared distance between the given and the fitted parameters.
pub(crate) struct Contradictions {
    pub numbers: Vec<Contradicted>,
    pub distance: f64,
}

/// Returns the smallest set of base parameters that must differ from the `given` positions.
///
/// A parameter is not necessarily wrong if its fitted value deviates by several standard deviations. For example,
/// the spreads of gain and of threshold can replace each other. If one of them is wrong, a fit moves both. The cost
/// of a fit does not depend on the base parameters, so the cost cannot decide which one is wrong.
///
/// `missed` is the root mean square error of each parameter in fits of clean sensors. `off` is the deviation of the
/// data from the fit. If no value exceeds its limit, the last step that a linear fit of `off` requests is added to
/// the fitted parameters. The cost cannot decide whether this step is right.
pub(crate) fn contradicted(
    found: &SearchResult,
    missed: &[f64],
    off: &DVector<f64>,
    given: &[f64],
) -> Contradictions {
    let n = given.len();
    let TestedFit { fit, own, off: held_out_off, left, .. } = &found.last;
    let last = own.metric.bounded(off, &fit.bounds());
    let fitted = |j: usize| fit.u[j] + if *left { 0.0 } else { last[j] };
    let fitted: Vec<f64> = (0..n).map(fitted).collect();
    let linear: DMatrix<f64> = own.metric.covariance().view((0, 0), (n, n)).into_owned();
    let told = |j: usize| own.deviations[j].max(missed[j]) / linear[(j, j)].sqrt();
    let covariance = DMatrix::from_fn(n, n, |i, j| linear[(i, j)] * told(i) * told(j));
    // The prior comes from the calibration, so it is no evidence about the calibration.
    let leaning = DMatrix::identity(n, n) * CALIBRATION_INFORMATION;
    let none = Contradictions { numbers: Vec::new(), distance: 0.0 };
    let Some(precision) = covariance.try_inverse().map(|p| p - leaning) else { return none };
    let mut numbers = fewest(&precision, &fitted, given);
    // Positions of the parameters that fit the held-out set best.
    let held_out = own.metric.fit(held_out_off);
    let held_out = DVector::from_fn(n, |j, _| fit.u[j] + held_out[j]);
    let misfit = own.metric.square(held_out_off);
    let distance_of = |numbers: &DVector<f64>| {
        let off = numbers - &held_out;
        misfit + off.dot(&(&precision * &off))
    };
    let off = DVector::from_fn(n, |j, _| given[j] - fitted[j]);
    let free: Vec<usize> = numbers.iter().map(|c| c.number).collect();
    let with = numbers_at(&precision, &off, &fitted, given, &free);
    for c in &mut numbers {
        let others: Vec<usize> = free.iter().copied().filter(|j| *j != c.number).collect();
        let without = numbers_at(&precision, &off, &fitted, given, &others);
        let evidence = Evidence {
            before: distance_of(&without),
            after: distance_of(&with),
            whole: 0.0,
            others: fit.effects.len() + others.len(),
        };
        c.is_borne_out = evidence.beyond() > 0.0;
        c.change = &with - without;
    }
    Contradictions { numbers, distance: off.dot(&(&precision * &off)) }
}

/// Returns the positions of all parameters. The `free` parameters fit best while the others are at their given
/// positions.
fn numbers_at(
    precision: &DMatrix<f64>,
    off: &DVector<f64>,
    fitted: &[f64],
    given: &[f64],
    free: &[usize],
) -> DVector<f64> {
    let mut numbers = DVector::from_column_slice(given);
    if let Some(held) = Held::of(precision, off, free) {
        free.iter().zip(held.positions.iter()).for_each(|(j, x)| numbers[*j] = fitted[*j] + x);
    }
    numbers
}

/// Frees one parameter after the other. Each time, it frees the parameter that reduces the squared distance most.
fn fewest(precision: &DMatrix<f64>, fitted: &[f64], given: &[f64]) -> Vec<Contradicted> {
    let off = DVector::from_fn(given.len(), |j, _| given[j] - fitted[j]);
    let mut free: Vec<usize> = Vec::new();
    let mut ties: Vec<(Vec<usize>, f64)> = Vec::new();
    let mut distance = off.dot(&(precision * &off));
    while free.len() < given.len() {
        let open = (0..given.len()).filter(|j| !free.contains(j));
        let with =
            |j: usize| Some((j, Held::of(precision, &off, &[free.as_slice(), &[j]].concat())?.distance));
        let mut tried: Vec<(usize, f64)> = open.filter_map(with).collect();
        tried.sort_by(|a, b| a.1.total_cmp(&b.1));
        let Some((number, least)) = tried.first().copied() else { break };
        if distance - least < MIN_MISMATCH_GAIN {
            break;
        }
        let tied = tried[1..].iter().filter(|t| t.1 < least + MAX_AMBIGUOUS_DISTANCE).map(|t| t.0).collect();
        ties.push((tied, distance - least));
        free.push(number);
        distance = least;
    }
    let Some(held) = Held::of(precision, &off, &free) else { return Vec::new() };
    let said = |(place, (tied, gain)): (usize, (Vec<usize>, f64))| Contradicted {
        number: free[place],
        position: fitted[free[place]] + held.positions[place],
        deviation: held.deviations[place],
        tied,
        gain,
        change: DVector::zeros(given.len()),
        is_borne_out: true,
    };
    ties.into_iter().enumerate().map(said).collect()
}

/// A fit of some free parameters. The others are held at their distance `off` from the fitted positions.
struct Held {
    /// Distances of the free parameters from their fitted positions, and their standard deviations.
    positions: DVector<f64>,
    deviations: Vec<f64>,
    /// Squared distance that remains after the fit.
    distance: f64,
}

impl Held {
    /// Fits the parameters with the indices `free`. Returns `None` if the data do not determine them.
    fn of(precision: &DMatrix<f64>, off: &DVector<f64>, free: &[usize]) -> Option<Self> {
        let inner = DMatrix::from_fn(free.len(), free.len(), |i, j| precision[(free[i], free[j])]);
        let mut place = off.clone();
        free.iter().for_each(|j| place[*j] = 0.0);
        let pull = precision * &place;
        let factor = inner.cholesky()?;
        let positions = factor.solve(&DVector::from_fn(free.len(), |i, _| -pull[free[i]]));
        free.iter().zip(positions.iter()).for_each(|(j, x)| place[*j] = *x);
        let deviations = factor.inverse().diagonal().iter().map(|v| v.sqrt()).collect();
        Some(Self { distance: place.dot(&(precision * &place)), positions, deviations })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Information about three parameters. The sum of the first two is determined to 0.01, and each of them alone
    /// to 0.1. The third parameter is independent.
    fn precision() -> DMatrix<f64> {
        let sum = DVector::from_vec(vec![1.0, 1.0, 0.0]);
        let mut precision = &sum * sum.transpose() * 1e4;
        precision[(0, 0)] += 100.0;
        precision[(1, 1)] += 100.0;
        precision[(2, 2)] = 2500.0;
        precision
    }

    #[test]
    fn of_two_numbers_that_stand_in_for_each_other_the_wrong_one_is_said() {
        // In truth, the first parameter is 1 and the others have their given values. The fit attributes a part of
        // the first to the second.
        let found = fewest(&precision(), &[0.95, 0.06, 0.01], &[0.0, 0.0, 0.0]);
        assert_eq!(found.len(), 1, "{found:?}");
        assert_eq!((found[0].number, found[0].tied.as_slice()), (0, [].as_slice()));
        let right = (found[0].position - 1.0).abs() < 2.0 * found[0].deviation;
        assert!(right && found[0].deviation < 0.01, "{found:?}");
    }

    #[test]
    fn numbers_that_only_their_sum_tells_are_tied() {
        let found = fewest(&precision(), &[0.06, 0.04, 0.0], &[0.0, 0.0, 0.0]);
        assert_eq!(found.len(), 1, "{found:?}");
        assert_eq!((found[0].number, found[0].tied.as_slice()), (0, [1].as_slice()));
    }

    #[test]
    fn two_wrong_numbers_are_both_said_and_noise_is_not() {
        let found = fewest(&precision(), &[0.5, 0.0, 0.3], &[0.0, 0.0, 0.0]);
        let mut numbers: Vec<usize> = found.iter().map(|c| c.number).collect();
        numbers.sort_unstable();
        assert_eq!(numbers, [0, 2]);
        // The sum deviates by three standard deviations.
        assert_eq!(fewest(&precision(), &[0.02, 0.01, 0.03], &[0.0, 0.0, 0.0]), []);
    }
}
