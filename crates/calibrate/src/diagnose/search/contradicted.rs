//! Which numbers of a given camera the data contradict.

use nalgebra::{DMatrix, DVector};

use super::search::Found;
use crate::diagnose::null::known::CALIBRATED;

/// By how much the squared distance of the camera's numbers from the fitted ones falls with a number set free for that one to be
/// contradicted: three and a half deviations of it.
const CONTRADICTED: f64 = 12.0;

/// Difference of squared distances within which two numbers explain it as well.
const ALIKE: f64 = 4.0;

/// A number that is contradicted.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::diagnose) struct Contradicted {
    pub number: usize,
    /// Where it lies with all the others as given but for those that are contradicted as well, and how well it is told then.
    pub position: f64,
    pub deviation: f64,
    /// Numbers that would do as well in its place.
    pub tied: Vec<usize>,
}

/// The fewest numbers of the base model that must leave those `given`, as positions.
///
/// Not every number that lies some of its deviations off: the spreads of gain and of threshold stand in for each other, and with
/// one wrong a fit moves both. The cost of a fit is no measure, since it is free along the base model's numbers.
///
/// `missed` is what fits of clean sensors miss them by. Where nothing is left, `off` is what the fit does not explain of the data: the last step that it asks for is taken here, as no
/// cost tells whether it is worth it.
pub(in crate::diagnose) fn contradicted(
    found: &Found,
    missed: &[f64],
    off: &DVector<f64>,
    given: &[f64],
) -> Vec<Contradicted> {
    let n = given.len();
    let last = found.own.metric.bounded(off, &found.fit.bounds());
    let fitted = |j: usize| found.fit.u[j] + if found.left { 0.0 } else { last[j] };
    let fitted: Vec<f64> = (0..n).map(fitted).collect();
    let linear: DMatrix<f64> = found.own.metric.covariance().view((0, 0), (n, n)).into_owned();
    let told = |j: usize| found.own.deviations[j].max(missed[j]) / linear[(j, j)].sqrt();
    let covariance = DMatrix::from_fn(n, n, |i, j| linear[(i, j)] * told(i) * told(j));
    // That they were calibrated is no evidence against the calibration.
    let leaning = DMatrix::identity(n, n) * CALIBRATED;
    let Some(precision) = covariance.try_inverse().map(|p| p - leaning) else { return Vec::new() };
    fewest(&precision, &fitted, given)
}

/// One number after the other, each time the one that brings the rest closest.
fn fewest(precision: &DMatrix<f64>, fitted: &[f64], given: &[f64]) -> Vec<Contradicted> {
    let off = DVector::from_fn(given.len(), |j, _| given[j] - fitted[j]);
    let mut free: Vec<usize> = Vec::new();
    let mut ties: Vec<Vec<usize>> = Vec::new();
    let mut distance = off.dot(&(precision * &off));
    while free.len() < given.len() {
        let open = (0..given.len()).filter(|j| !free.contains(j));
        let with =
            |j: usize| Some((j, Held::of(precision, &off, &[free.as_slice(), &[j]].concat())?.distance));
        let mut tried: Vec<(usize, f64)> = open.filter_map(with).collect();
        tried.sort_by(|a, b| a.1.total_cmp(&b.1));
        let Some((number, least)) = tried.first().copied() else { break };
        if distance - least < CONTRADICTED {
            break;
        }
        ties.push(tried[1..].iter().filter(|t| t.1 < least + ALIKE).map(|t| t.0).collect());
        free.push(number);
        distance = least;
    }
    let Some(held) = Held::of(precision, &off, &free) else { return Vec::new() };
    let said = |(place, tied): (usize, Vec<usize>)| Contradicted {
        number: free[place],
        position: fitted[free[place]] + held.positions[place],
        deviation: held.deviations[place],
        tied,
    };
    ties.into_iter().enumerate().map(said).collect()
}

/// Some numbers free, the others held `off` from where they were fitted.
struct Held {
    /// Where the free ones go, from where they were fitted, and how well they are told.
    positions: DVector<f64>,
    deviations: Vec<f64>,
    /// Squared distance that is left.
    distance: f64,
}

impl Held {
    /// `None` where the data do not tell the free numbers.
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
