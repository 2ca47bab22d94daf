//! Synthetic streams, and reference statistics that visit each pixel and readout.
#![allow(dead_code, reason = "each test file uses a part")]

pub(crate) mod intervals;

use rand_pcg::Pcg64Mcg;
use rand_pcg::rand_core::{Rng, SeedableRng};
use spikelane::spikes::{Geometry, SpikeFramesRef, set_bit};
use spikelane_measure::{Accumulator, MeasureOptions, NO_SPIKE, NeighborPair, Statistics};

/// A stream of spikes as booleans, indexed by `[readout][pixel]`.
pub(crate) struct Stream {
    pub geometry: Geometry,
    pub frames: Vec<Vec<bool>>,
}

pub(crate) fn uniform(random: &mut Pcg64Mcg) -> f64 {
    (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
}

impl Stream {
    pub(crate) fn from_frames(width: u32, height: u32, frames: Vec<Vec<bool>>) -> Self {
        let geometry = Geometry::new(width, height).unwrap();
        Self { geometry, frames }
    }

    /// Returns a stream of independent bits. The rate of pixel `p` is `rates[p]`.
    pub(crate) fn bernoulli(width: u32, height: u32, readouts: usize, rates: &[f64], seed: u64) -> Self {
        let mut random = Pcg64Mcg::seed_from_u64(seed);
        let mut frame = || rates.iter().map(|r| uniform(&mut random) < *r).collect();
        let frames = (0..readouts).map(|_| frame()).collect();
        Self::from_frames(width, height, frames)
    }

    /// Returns a stream of exact integrators. The charge of a pixel is an integer in units of `2^-40` times the
    /// threshold.
    pub(crate) fn integrators(width: u32, height: u32, readouts: usize, rates: &[f64], seed: u64) -> Self {
        let one = 1_u64 << 40;
        let mut random = Pcg64Mcg::seed_from_u64(seed);
        let mut charge: Vec<u64> = rates.iter().map(|_| random.next_u64() % one).collect();
        let mut step = |p: usize| {
            charge[p] += (rates[p] * one as f64) as u64;
            let fires = charge[p] >= one;
            charge[p] -= u64::from(fires) * one;
            fires
        };
        let frames = (0..readouts).map(|_| (0..rates.len()).map(&mut step).collect()).collect();
        Self::from_frames(width, height, frames)
    }

    pub(crate) fn packed(&self) -> Vec<u8> {
        let bytes = self.geometry.frame_bytes();
        let mut packed = vec![0; bytes * self.frames.len()];
        for (frame, out) in self.frames.iter().zip(packed.chunks_mut(bytes)) {
            (0..frame.len()).filter(|p| frame[*p]).for_each(|p| set_bit(out, p));
        }
        packed
    }

    /// Measures the stream in batches of the sizes `batches`, then measures all remaining readouts in one batch.
    pub(crate) fn measure(&self, options: &MeasureOptions, batches: &[usize]) -> Statistics {
        let packed = self.packed();
        let mut accumulator = Accumulator::new(self.geometry, options).unwrap();
        let mut rest = packed.as_slice();
        let mut sizes = batches.iter().copied().chain(std::iter::repeat(usize::MAX));
        while !rest.is_empty() {
            let n = sizes.next().unwrap().min(rest.len() / self.geometry.frame_bytes());
            let (batch, more) = rest.split_at(n * self.geometry.frame_bytes());
            accumulator.push(SpikeFramesRef::new(self.geometry, batch).unwrap()).unwrap();
            rest = more;
        }
        accumulator.finish()
    }

    pub(crate) fn pixels(&self) -> usize {
        self.geometry.pixels()
    }

    /// Returns the spike times of a pixel.
    pub(crate) fn times(&self, p: usize) -> Vec<u32> {
        (0..self.frames.len()).filter(|t| self.frames[*t][p]).map(|t| t as u32).collect()
    }

    fn fires(&self, t: usize, p: usize) -> bool {
        self.frames.get(t).is_some_and(|frame| frame[p])
    }

    /// Counts the coincidences of pixel `p` for `pair` with a loop over the readouts.
    pub(crate) fn coincidences(&self, p: usize, pair: NeighborPair) -> u32 {
        let (width, col) = (self.geometry.width(), p % self.geometry.width());
        let other = match pair {
            NeighborPair::Right | NeighborPair::RightAfter | NeighborPair::RightBefore => {
                (col + 1 < width).then_some(p + 1)
            }
            _ => (p + width < self.pixels()).then_some(p + width),
        };
        let Some(q) = other else { return 0 };
        let both = |t: usize| match pair {
            NeighborPair::Right | NeighborPair::Lower => self.fires(t, p) && self.fires(t, q),
            NeighborPair::RightAfter | NeighborPair::LowerAfter => self.fires(t, p) && self.fires(t + 1, q),
            NeighborPair::RightBefore | NeighborPair::LowerBefore => self.fires(t, q) && self.fires(t + 1, p),
            _ => panic!("{pair:?} has no loop"),
        };
        (0..self.frames.len()).filter(|t| both(*t)).count() as u32
    }

    /// Compares the per-pixel counts with the results of a loop over pixels and readouts.
    pub(crate) fn check_counts(&self, statistics: &Statistics) {
        let counts = statistics.counts.as_ref().unwrap();
        for p in 0..self.pixels() {
            let times = self.times(p);
            assert_eq!(counts.count[p] as usize, times.len(), "count of pixel {p}");
            assert_eq!(counts.first_spike[p], *times.first().unwrap_or(&NO_SPIKE), "first of {p}");
            assert_eq!(counts.last_spike[p], *times.last().unwrap_or(&NO_SPIKE), "last of {p}");
            for pair in NeighborPair::ALL {
                let coincidences = counts.coincidence(pair)[p];
                assert_eq!(coincidences, self.coincidences(p, pair), "{pair:?} of {p}");
            }
        }
    }

    /// Compares the statistics of whole readouts with the results of plain loops.
    pub(crate) fn check_frames(&self, statistics: &Statistics) {
        let frames = statistics.frames.as_ref().unwrap();
        let totals: Vec<u32> = self.frames.iter().map(|f| f.iter().filter(|b| **b).count() as u32).collect();
        assert_eq!(frames.totals, totals);
        let differing = |w: &[Vec<bool>]| w[0].iter().zip(&w[1]).filter(|(a, b)| a != b).count() as u32;
        let distances: Vec<u32> = self.frames.windows(2).map(differing).collect();
        assert_eq!(frames.distances, distances);
        let nearest = distances.iter().enumerate().min_by_key(|(_, d)| **d);
        assert_eq!(
            frames.min_distance().map(|e| (e.readout as usize, e.value)),
            nearest.map(|(t, d)| (t + 1, *d))
        );
        let farthest = distances.iter().enumerate().rev().max_by_key(|(_, d)| **d);
        assert_eq!(
            frames.max_distance().map(|e| (e.readout as usize, e.value)),
            farthest.map(|(t, d)| (t + 1, *d))
        );
        self.check_halves(frames);
    }

    fn check_halves(&self, frames: &spikelane_measure::FrameStatistics) {
        if self.frames.len() < 2 {
            return;
        }
        let (w, h) = (self.geometry.width(), self.geometry.height());
        let sum = |t: usize, rows: std::ops::Range<usize>, cols: std::ops::Range<usize>| -> f64 {
            let in_row = |r: usize| cols.clone().filter(|c| self.frames[t][r * w + c]).count();
            rows.map(in_row).sum::<usize>() as f64
        };
        let halves = |n: usize| (0..n / 2, n - n / 2..n);
        let series = |rows: std::ops::Range<usize>, cols: std::ops::Range<usize>| -> Vec<f64> {
            (0..self.frames.len()).map(|t| sum(t, rows.clone(), cols.clone())).collect()
        };
        let (left, right) = halves(w);
        let (top, bottom) = halves(h);
        let row = |r: usize, q: usize| {
            covariance(&series(r..r + 1, left.clone()), &series(q..q + 1, right.clone()))
        };
        let column = |c: usize, d: usize| {
            covariance(&series(top.clone(), c..c + 1), &series(bottom.clone(), d..d + 1))
        };
        check_excess(&frames.row_covariances(), frames.row_covariance().value, h, row);
        check_excess(&frames.column_covariances(), frames.column_covariance().value, w, column);
    }
}

/// Checks the mean covariance within lines minus the mean covariance between lines, with a loop over all pairs of lines.
fn check_excess(lines: &[f64], excess: f64, n: usize, cov: impl Fn(usize, usize) -> f64) {
    let (mut within, mut between) = (0.0, 0.0);
    for i in 0..n {
        assert!((lines[i] - cov(i, i)).abs() < 1e-9);
        within += cov(i, i) / n as f64;
        for j in (0..n).filter(|j| *j != i) {
            between += cov(i, j) / (n * (n - 1)) as f64;
        }
    }
    assert!((excess - (within - between)).abs() < 1e-9, "{excess} {within} {between}");
}

pub(crate) fn mean(x: &[f64]) -> f64 {
    x.iter().sum::<f64>() / x.len() as f64
}

/// Returns the unbiased covariance of `a` and `b`.
pub(crate) fn covariance(a: &[f64], b: &[f64]) -> f64 {
    let (ma, mb) = (mean(a), mean(b));
    let sum: f64 = a.iter().zip(b).map(|(x, y)| (x - ma) * (y - mb)).sum();
    sum / (a.len() as f64 - 1.0)
}
