//! Means over sequences, bootstrap intervals and paired differences.
//!
//! The samples of a sequence resemble each other, so the sequence is the unit of the bootstrap. The intervals depend only
//! on the scores and the seed.

use rand_pcg::Pcg64Mcg;
use rand_pcg::rand_core::{Rng, SeedableRng};

use crate::{MetricError, Result};

/// Quantiles of the 95 % interval.
const QUANTILES: [f64; 2] = [0.025, 0.975];

/// The options of a bootstrap.
///
/// # Examples
/// ```
/// use spikelane_benchmark::aggregate::Bootstrap;
/// let options = Bootstrap { seed: 7, ..Bootstrap::default() };
/// assert_eq!(options.resamples, 2000);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bootstrap {
    /// Seed of the random numbers.
    pub seed: u64,
    /// Number of resamples, at least 40. The default is 2000, so 50 resamples are outside each end of the interval.
    pub resamples: usize,
}

impl Default for Bootstrap {
    fn default() -> Self {
        Self { seed: 0, resamples: 2000 }
    }
}

/// An interval with the probability 95 %.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// Quantile 2.5 %.
    pub low: f64,
    /// Quantile 97.5 %.
    pub high: f64,
}

/// A value with its 95 % interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ValueWithInterval {
    /// The value.
    pub value: f64,
    /// The interval, or `None` if there are fewer than two sequences.
    pub interval: Option<Interval>,
}

/// The means of the scores of a method.
#[derive(Clone, Debug, PartialEq)]
pub struct Summary {
    /// Mean over all samples. Long sequences have a large weight.
    pub pooled: ValueWithInterval,
    /// Mean of the means of the sequences. All sequences have equal weights.
    pub sequence_mean: ValueWithInterval,
    /// The mean of each sequence.
    pub means: Vec<f64>,
    /// Number of all samples.
    pub samples: usize,
}

/// Returns the means of scores and their bootstrap intervals.
///
/// `sequences` contains the scores of the samples of each sequence.
///
/// # Examples
/// ```
/// use spikelane_benchmark::aggregate::{Bootstrap, summarize};
/// let summary = summarize(&[vec![1.0, 1.0, 1.0], vec![3.0]], Bootstrap::default())?;
/// assert_eq!((summary.pooled.value, summary.sequence_mean.value), (1.5, 2.0));
/// // A resample can contain only one of the sequences.
/// let interval = summary.sequence_mean.interval.unwrap();
/// assert_eq!((interval.low, interval.high), (1.0, 3.0));
/// # Ok::<(), spikelane_benchmark::MetricError>(())
/// ```
///
/// # Errors
/// [`MetricError::Reference`] if `sequences` is empty, if a sequence has no score, if a score is not finite, or if there
/// are fewer than 40 resamples.
pub fn summarize<S: AsRef<[f64]>>(sequences: &[S], options: Bootstrap) -> Result<Summary> {
    let sums = sequence_sums(sequences)?;
    let pooled = |chosen: &[usize]| {
        let (sum, count) = chosen.iter().fold((0.0, 0.0), |(s, n), i| (s + sums[*i].0, n + sums[*i].1));
        sum / count
    };
    let means: Vec<f64> = sums.iter().map(|(sum, count)| sum / count).collect();
    let sequence_mean =
        |chosen: &[usize]| chosen.iter().map(|i| means[*i]).sum::<f64>() / chosen.len() as f64;
    Ok(Summary {
        pooled: bootstrap(sums.len(), options, pooled)?,
        sequence_mean: bootstrap(sums.len(), options, sequence_mean)?,
        samples: sequences.iter().map(|s| s.as_ref().len()).sum(),
        means,
    })
}

/// Returns the means of the differences `a - b` of two methods, and their bootstrap intervals.
///
/// The scores of both methods belong to the same samples in the same order. The difference of each sample is computed
/// first, so the difficulty of a sequence does not widen the interval. If the interval excludes 0, the methods differ
/// beyond the choice of sequences.
///
/// # Examples
/// ```
/// use spikelane_benchmark::aggregate::{Bootstrap, summarize_differences};
/// let a = [vec![31.0, 32.0], vec![22.0], vec![41.5]];
/// let b = [vec![30.0, 31.0], vec![21.5], vec![40.0]];
/// let interval = summarize_differences(&a, &b, Bootstrap::default())?.sequence_mean.interval.unwrap();
/// // The scores differ by 20 dB between sequences, but the first method is better in each sequence.
/// assert!(interval.low >= 0.5 && interval.high <= 1.5);
/// # Ok::<(), spikelane_benchmark::MetricError>(())
/// ```
///
/// # Errors
/// The errors of [`summarize`], and [`MetricError::Reference`] if the numbers of sequences or samples differ.
pub fn summarize_differences<S: AsRef<[f64]>>(a: &[S], b: &[S], options: Bootstrap) -> Result<Summary> {
    let lengths = |all: &[S]| -> Vec<usize> { all.iter().map(|s| s.as_ref().len()).collect() };
    if lengths(a) != lengths(b) {
        return Err(MetricError::reference(
            "scores of two methods",
            "different sequences or samples",
            "the same samples in the same order",
        ));
    }
    sequence_sums(a)?;
    sequence_sums(b)?;
    let difference = |(a, b): (&S, &S)| a.as_ref().iter().zip(b.as_ref()).map(|(a, b)| a - b).collect();
    let differences: Vec<Vec<f64>> = a.iter().zip(b).map(difference).collect();
    summarize(&differences, options)
}

/// Returns a statistic of sequences with its 95 % bootstrap interval.
///
/// `statistic` computes the value from the indices of the chosen sequences, in which an index can repeat. Use this
/// function for statistics that are not means of samples, such as the average precision of a data set.
///
/// Each resample draws as many sequences as there are, with replacement. The interval consists of the quantiles 2.5 % and
/// 97.5 % of the statistic over the resamples (Efron and Tibshirani 1993, percentile interval), interpolated linearly
/// between sorted values. For few sequences, the true coverage is below 95 %.
///
/// # Examples
/// ```
/// use spikelane_benchmark::aggregate::{Bootstrap, bootstrap};
/// let maxima = [3.0, 5.0, 4.0];
/// let largest = |chosen: &[usize]| chosen.iter().map(|i| maxima[*i]).fold(f64::MIN, f64::max);
/// let result = bootstrap(3, Bootstrap::default(), largest)?;
/// assert_eq!((result.value, result.interval.unwrap().high), (5.0, 5.0));
/// # Ok::<(), spikelane_benchmark::MetricError>(())
/// ```
///
/// # Errors
/// [`MetricError::Reference`] if `sequences` is 0, if there are fewer than 40 resamples, or if a value of the
/// statistic is not finite.
pub fn bootstrap(
    sequences: usize,
    options: Bootstrap,
    statistic: impl Fn(&[usize]) -> f64,
) -> Result<ValueWithInterval> {
    let min_resamples = (1.0 / QUANTILES[0]).round() as usize;
    if options.resamples < min_resamples {
        let expected = format!("at least {min_resamples}");
        return Err(MetricError::reference("number of bootstrap resamples", options.resamples, expected));
    }
    let finite = |value: f64| {
        let error = || MetricError::reference("statistic of sequences", value, "a finite value");
        value.is_finite().then_some(value).ok_or_else(error)
    };
    if sequences == 0 {
        return Err(MetricError::reference("scores", "no sequence", "at least one sequence"));
    }
    let mut chosen: Vec<usize> = (0..sequences).collect();
    let value = finite(statistic(&chosen))?;
    if sequences == 1 {
        return Ok(ValueWithInterval { value, interval: None });
    }
    let mut random = Pcg64Mcg::seed_from_u64(options.seed);
    let mut values = Vec::with_capacity(options.resamples);
    for _ in 0..options.resamples {
        for index in &mut chosen {
            // Multiply-shift draws an index. Its bias of at most sequences/2^64 is negligible.
            *index = ((u128::from(random.next_u64()) * sequences as u128) >> 64) as usize;
        }
        values.push(finite(statistic(&chosen))?);
    }
    values.sort_by(f64::total_cmp);
    let [low, high] = QUANTILES.map(|share| {
        let position = share * (values.len() - 1) as f64;
        let below = position as usize;
        let above = (below + 1).min(values.len() - 1);
        values[below] + (position - below as f64) * (values[above] - values[below])
    });
    Ok(ValueWithInterval { value, interval: Some(Interval { low, high }) })
}

/// Returns the sum and the number of the scores of each sequence.
fn sequence_sums<S: AsRef<[f64]>>(sequences: &[S]) -> Result<Vec<(f64, f64)>> {
    let sums = sequences.iter().enumerate().map(|(index, scores)| {
        let scores = scores.as_ref();
        if scores.is_empty() {
            let found = format!("no score in sequence {index}");
            return Err(MetricError::reference("scores", found, "at least one score for each sequence"));
        }
        if let Some(k) = scores.iter().position(|x| !x.is_finite()) {
            let found = format!("{} at index {k} of sequence {index}", scores[k]);
            return Err(MetricError::reference("scores", found, "finite scores"));
        }
        Ok((scores.iter().sum(), scores.len() as f64))
    });
    sums.collect()
}
