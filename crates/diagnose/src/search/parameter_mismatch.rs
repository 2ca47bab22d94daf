//! Parameters of a given camera that the data contradict.

use crate::search::effect_search::{Evidence, SearchResult};
use crate::search::state::TestedFit;
use crate::thresholds::{CALIBRATION_INFORMATION, MAX_AMBIGUOUS_DISTANCE, MIN_MISMATCH_GAIN};
use nalgebra::{DMatrix, DVector};

/// A parameter that the data contradict.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Contradicted {
    pub number: usize,
    /// Fitted position if all parameters that the data do not contradict have their given values, and its standard
    /// deviation.
    pub position: f64,
    pub deviation: f64,
    /// Parameters that explain the data equally well in its place.
    pub tied: Vec<usize>,
    /// Fall of the squared distance if this parameter is free beside those before it.
    pub gain: f64,
    /// Change of all parameters if this one is free instead of given.
    pub change: DVector<f64>,
    /// Whether the held-out set confirms it.
    pub is_borne_out: bool,
}

/// The contradicted parameters, and the squared distance between the given and the fitted parameters.
pub(crate) struct Contradictions {
    pub numbers: Vec<Contradicted>,
    pub distance: f64,
}

/// Returns the smallest set of base parameters that must differ from the `given` positions.
///
/// A parameter that deviates by several standard deviations need not be wrong: the spreads of gain and of threshold can
/// replace each other, and if one is wrong a fit moves both. The cost of a fit does not depend on the base parameters,
/// so it cannot decide.
///
/// `missed` is the root mean square error of the fit of clean sensors for each parameter. `off` is the part of the data
/// that the fit does not explain. If nothing exceeds a limit, the last step that `off` requests is taken here, because
/// the cost cannot decide whether to take it.
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
    // The prior of the calibration is no evidence about the calibration.
    let leaning = DMatrix::identity(n, n) * CALIBRATION_INFORMATION;
    let none = Contradictions { numbers: Vec::new(), distance: 0.0 };
    let Some(precision) = covariance.try_inverse().map(|p| p - leaning) else { return none };
    let mut numbers = fewest(&precision, &fitted, given);
    // The parameters that the held-out set requests.
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

/// Returns all parameters. The `free` ones have the best fit beside the others at their given positions.
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

/// Frees one parameter after the other: each time the one that reduces the squared distance most.
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

/// A fit of some free parameters. The others are held at the distance `off` from their fitted positions.
struct Held {
    /// Displacements of the free parameters from their fitted positions, and their standard deviations.
    positions: DVector<f64>,
    deviations: Vec<f64>,
    /// Remaining squared distance.
    distance: f64,
}

impl Held {
    /// Returns `None` if the data do not determine the free parameters.
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

    /// Two numbers of which mostly the sum is told, to a hundredth, and a third one by itself.
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
        // Truth: the first is 1 and all others are as given; the fit has some of it in the second.
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
        // Three deviations of the sum.
        assert_eq!(fewest(&precision(), &[0.02, 0.01, 0.03], &[0.0, 0.0, 0.0]), []);
    }
}
