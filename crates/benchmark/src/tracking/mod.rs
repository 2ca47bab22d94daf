//! Metrics of multi-object tracking: HOTA (Luiten et al., IJCV 2021).
//!
//! [`count_matches`] counts the matches of a sequence, and [`TrackingCounts::combine`] joins sequences. The values equal
//! those of TrackEval for boxes of one class.

mod assignment;

use std::collections::{BTreeMap, BTreeSet};

use crate::{BoundingBox, MetricError, Result};
use assignment::assign;

/// Number of thresholds of the intersection over union: 0.05 to 0.95 in steps of 0.05.
pub const THRESHOLDS: usize = 19;

/// A box with the number of its track.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrackedBox {
    /// Number of the track. All boxes of an object have the same number.
    pub track: u64,
    /// The box.
    pub bounds: BoundingBox,
}

/// The boxes of one moment.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TrackingFrame {
    /// The true boxes.
    pub truth: Vec<TrackedBox>,
    /// The boxes of the method.
    pub output: Vec<TrackedBox>,
}

/// The counts of matches for each threshold, from which the scores follow.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TrackingCounts {
    correct: [f64; THRESHOLDS],
    missed: [f64; THRESHOLDS],
    wrong: [f64; THRESHOLDS],
    /// Sum of the intersections over unions of the matches.
    overlap: [f64; THRESHOLDS],
    /// Sum of the association scores of the matches.
    association: [f64; THRESHOLDS],
}

/// The scores of tracks, 0 to 1. Each field is the mean over the thresholds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrackingScores {
    /// Higher order tracking accuracy. The metric is `hota`.
    pub hota: f64,
    /// Detection accuracy. The metric is `det_a`.
    pub det_a: f64,
    /// Association accuracy. The metric is `ass_a`.
    pub ass_a: f64,
    /// Localization accuracy. The metric is `loc_a`.
    pub loc_a: f64,
}

/// Counts the matches between the tracks of a method and the true tracks of one sequence.
///
/// 1. In each frame, the similarity of two boxes is their intersection over union `s`. A pair of tracks collects
///    `s / (sum of s of the true box + sum of s of the method's box - s)` over the frames. This sum `m`, divided by the
///    sum of the lengths of both tracks minus `m`, is the alignment of the pair.
/// 2. In each frame, an optimal assignment maximizes the sum of the alignments times `s`.
/// 3. An assigned pair is a match at the threshold `a` if `s >= a`.
/// 4. The association score of a match of two tracks is `k / (n + n' - k)`. `k` is the number of matches of the two
///    tracks, and `n` and `n'` are their lengths.
///
/// # Examples
/// ```
/// use spikelane_benchmark::BoundingBox;
/// use spikelane_benchmark::tracking::{TrackedBox, TrackingFrame, count_matches};
/// let bounds = BoundingBox { x: 0.0, y: 0.0, width: 10.0, height: 10.0 };
/// let truth = vec![TrackedBox { track: 1, bounds }];
/// let frames = [
///     TrackingFrame { truth: truth.clone(), output: vec![TrackedBox { track: 8, bounds }] },
///     TrackingFrame { truth, output: Vec::new() },
/// ];
/// // The method finds one of two boxes.
/// let scores = count_matches(&frames)?.scores();
/// assert_eq!((scores.det_a, scores.ass_a, scores.loc_a), (0.5, 0.5, 1.0));
/// # Ok::<(), spikelane_benchmark::MetricError>(())
/// ```
///
/// # Errors
/// [`MetricError`] if a box is not finite, if a side is negative, or if a track has two boxes in one frame. The index in
/// the error is the index of the frame.
pub fn count_matches(frames: &[TrackingFrame]) -> Result<TrackingCounts> {
    for (index, frame) in frames.iter().enumerate() {
        check(frame, index)?;
    }
    let truth = Tracks::new(frames.iter().map(|frame| &frame.truth));
    let output = Tracks::new(frames.iter().map(|frame| &frame.output));
    let similarities: Vec<Vec<Vec<f64>>> = frames.iter().map(similarities).collect();
    let columns = output.lengths.len();
    let mut potential = vec![0.0; truth.lengths.len() * columns];
    for (t, similarity) in similarities.iter().enumerate() {
        let column_sums: Vec<f64> =
            (0..output.frames[t].len()).map(|j| similarity.iter().map(|row| row[j]).sum()).collect();
        for (row, i) in similarity.iter().zip(&truth.frames[t]) {
            let row_sum: f64 = row.iter().sum();
            for ((s, column_sum), j) in row.iter().zip(&column_sums).zip(&output.frames[t]) {
                let union = column_sum + row_sum - s;
                if union > f64::EPSILON {
                    potential[i * columns + j] += s / union;
                }
            }
        }
    }
    let alignment = |i: usize, j: usize| {
        let shared = potential[i * columns + j];
        shared / (truth.lengths[i] + output.lengths[j] - shared)
    };
    let mut counts = TrackingCounts::default();
    let mut pairs = vec![BTreeMap::<(usize, usize), f64>::new(); THRESHOLDS];
    for (t, similarity) in similarities.iter().enumerate() {
        let (rows, cols) = (&truth.frames[t], &output.frames[t]);
        let scores = similarity
            .iter()
            .zip(rows)
            .map(|(row, i)| row.iter().zip(cols).map(|(s, j)| alignment(*i, *j) * s).collect());
        let assigned = assign(&scores.collect::<Vec<Vec<f64>>>());
        for a in 0..THRESHOLDS {
            let limit = threshold(a) - f64::EPSILON;
            let mut matched = 0.0;
            for (i, j) in assigned.iter().filter(|(i, j)| similarity[*i][*j] >= limit) {
                matched += 1.0;
                counts.overlap[a] += similarity[*i][*j];
                *pairs[a].entry((rows[*i], cols[*j])).or_default() += 1.0;
            }
            counts.correct[a] += matched;
            counts.missed[a] += rows.len() as f64 - matched;
            counts.wrong[a] += cols.len() as f64 - matched;
        }
    }
    for (sum, pairs) in counts.association.iter_mut().zip(&pairs) {
        for ((i, j), matches) in pairs {
            *sum += matches * (matches / (truth.lengths[*i] + output.lengths[*j] - matches));
        }
    }
    Ok(counts)
}

impl TrackingCounts {
    /// Returns the counts of all sequences together.
    ///
    /// # Examples
    /// ```
    /// use spikelane_benchmark::BoundingBox;
    /// use spikelane_benchmark::tracking::{TrackedBox, TrackingCounts, TrackingFrame, count_matches};
    /// let bounds = BoundingBox { x: 0.0, y: 0.0, width: 10.0, height: 10.0 };
    /// let truth = vec![TrackedBox { track: 1, bounds }];
    /// let found = count_matches(&[TrackingFrame { truth: truth.clone(), output: truth.clone() }])?;
    /// let missed = count_matches(&[TrackingFrame { truth, output: Vec::new() }])?;
    /// assert_eq!(TrackingCounts::combine([&found, &missed]).scores().det_a, 0.5);
    /// # Ok::<(), spikelane_benchmark::MetricError>(())
    /// ```
    #[must_use]
    pub fn combine<'a>(sequences: impl IntoIterator<Item = &'a Self>) -> Self {
        let mut all = Self::default();
        for one in sequences {
            for a in 0..THRESHOLDS {
                all.correct[a] += one.correct[a];
                all.missed[a] += one.missed[a];
                all.wrong[a] += one.wrong[a];
                all.overlap[a] += one.overlap[a];
                all.association[a] += one.association[a];
            }
        }
        all
    }

    /// Returns the scores.
    ///
    /// For each threshold, let `t` be the number of matches, `m` the number of missed true boxes, and `f` the number of
    /// false boxes.
    ///
    /// * `DetA = t / (t + m + f)`
    /// * `AssA` is the mean association score of the matches.
    /// * `LocA` is the mean intersection over union of the matches.
    /// * `HOTA = sqrt(DetA AssA)`
    ///
    /// Without a match, `DetA`, `AssA` and `HOTA` are 0 and `LocA` is 1, as in TrackEval.
    ///
    /// # Examples
    /// ```
    /// use spikelane_benchmark::BoundingBox;
    /// use spikelane_benchmark::tracking::{TrackedBox, TrackingFrame, count_matches};
    /// let bounds = BoundingBox { x: 0.0, y: 0.0, width: 10.0, height: 10.0 };
    /// let frame = |track| TrackingFrame {
    ///     truth: vec![TrackedBox { track: 1, bounds }],
    ///     output: vec![TrackedBox { track, bounds }],
    /// };
    /// // The method changes the number of the track after half of the frames.
    /// let scores = count_matches(&[frame(5), frame(5), frame(6), frame(6)])?.scores();
    /// assert_eq!((scores.det_a, scores.ass_a), (1.0, 0.5));
    /// assert!((scores.hota - 0.5f64.sqrt()).abs() < 1e-12);
    /// # Ok::<(), spikelane_benchmark::MetricError>(())
    /// ```
    #[must_use]
    pub fn scores(&self) -> TrackingScores {
        let all = self.scores_by_threshold();
        let mean = |f: fn(&TrackingScores) -> f64| all.iter().map(f).sum::<f64>() / THRESHOLDS as f64;
        TrackingScores {
            hota: mean(|s| s.hota),
            det_a: mean(|s| s.det_a),
            ass_a: mean(|s| s.ass_a),
            loc_a: mean(|s| s.loc_a),
        }
    }

    /// Returns the scores at each threshold, 0.05 to 0.95.
    ///
    /// # Examples
    /// ```
    /// use spikelane_benchmark::BoundingBox;
    /// use spikelane_benchmark::tracking::{TrackedBox, TrackingFrame, count_matches};
    /// let bounds = BoundingBox { x: 0.0, y: 0.0, width: 10.0, height: 10.0 };
    /// let half = BoundingBox { width: 5.0, ..bounds };
    /// let boxes = |bounds| vec![TrackedBox { track: 1, bounds }];
    /// let counts = count_matches(&[TrackingFrame { truth: boxes(bounds), output: boxes(half) }])?;
    /// // The intersection over union is 0.5, which reaches the thresholds 0.05 to 0.50.
    /// let reached = counts.scores_by_threshold().iter().filter(|scores| scores.hota == 1.0).count();
    /// assert_eq!(reached, 10);
    /// # Ok::<(), spikelane_benchmark::MetricError>(())
    /// ```
    #[must_use]
    pub fn scores_by_threshold(&self) -> [TrackingScores; THRESHOLDS] {
        std::array::from_fn(|a| {
            let correct = self.correct[a];
            let det_a = correct / (correct + self.missed[a] + self.wrong[a]).max(1.0);
            let ass_a = self.association[a] / correct.max(1.0);
            let loc_a = if correct > 0.0 { self.overlap[a] / correct } else { 1.0 };
            TrackingScores { hota: (det_a * ass_a).sqrt(), det_a, ass_a, loc_a }
        })
    }
}

/// Returns the threshold with index `a`, with the rounding of `numpy.arange(0.05, 0.99, 0.05)`.
fn threshold(a: usize) -> f64 {
    0.05 + a as f64 * 0.05
}

/// Tracks with indices in place of their numbers.
struct Tracks {
    /// Number of boxes of each track.
    lengths: Vec<f64>,
    /// Index of the track of each box, for each frame.
    frames: Vec<Vec<usize>>,
}

impl Tracks {
    fn new<'a>(frames: impl Iterator<Item = &'a Vec<TrackedBox>> + Clone) -> Self {
        let numbers: BTreeSet<u64> = frames.clone().flatten().map(|b| b.track).collect();
        let indices: BTreeMap<u64, usize> = numbers.into_iter().zip(0..).collect();
        let frames: Vec<Vec<usize>> =
            frames.map(|boxes| boxes.iter().map(|b| indices[&b.track]).collect()).collect();
        let mut lengths = vec![0.0; indices.len()];
        for i in frames.iter().flatten() {
            lengths[*i] += 1.0;
        }
        Self { lengths, frames }
    }
}

/// Returns the intersection over union of each true box (row) and each box of the method (column).
fn similarities(frame: &TrackingFrame) -> Vec<Vec<f64>> {
    let row = |truth: &TrackedBox| {
        frame.output.iter().map(|output| truth.bounds.intersection_over_union(output.bounds)).collect()
    };
    frame.truth.iter().map(row).collect()
}

fn check(frame: &TrackingFrame, index: usize) -> Result<()> {
    let is_valid = |b: &TrackedBox| b.bounds.is_finite() && b.bounds.has_valid_sides();
    let has_repetition = |boxes: &[TrackedBox]| {
        let mut tracks = BTreeSet::new();
        boxes.iter().any(|b| !tracks.insert(b.track))
    };
    if !frame.truth.iter().all(is_valid) || has_repetition(&frame.truth) {
        let found = format!("an invalid box or a repeated track in frame {index}");
        return Err(MetricError::reference(
            "true tracks",
            found,
            "finite boxes, one for each track and frame",
        ));
    }
    if frame.output.iter().any(|b| !b.bounds.is_finite()) {
        return Err(MetricError::NonFinite { index });
    }
    if !frame.output.iter().all(is_valid) {
        return Err(MetricError::OutOfRange { index, requirement: "sides of at least 0" });
    }
    if has_repetition(&frame.output) {
        return Err(MetricError::OutOfRange { index, requirement: "one box for each track and frame" });
    }
    Ok(())
}
