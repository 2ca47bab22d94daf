//! Pixels whose rate switches between levels while the rates of their neighbors do not, as with random telegraph noise.

use std::ops::Range;

use spikelane::error::Result;
use spikelane::unstable::inputs::check_memory;
use spikelane::unstable::threads;
use spikelane_io::formats::StreamReader;
use spikelane_measure::median;

use crate::encoding::spike_counts;

/// Number of blocks of readouts. A pixel must stay on a level for about a block to be found.
const BLOCKS: usize = 32;

/// Smallest mean number of spikes per block. With fewer spikes, the distribution of the variance has long tails.
const MIN_BLOCK_SPIKES: f64 = 4.0;

/// Largest accepted probability that at least one intact pixel of a stream is reported.
const MAX_FALSE_PROBABILITY: f64 = 0.01;

/// Largest variance of the spikes in a block of a pixel that fires at regular intervals. The number of spikes then
/// takes two successive values.
const ROUNDING_VARIANCE: f64 = 0.25;

/// Largest ratio of variance and mean of the spikes of static neighbors. Independent readouts have the ratio 1, and its
/// estimate from 32 blocks of 24 neighbors has a standard deviation of 0.07.
const MAX_NEIGHBOR_FANO: f64 = 1.5;

/// Distance from the limit in standard deviations at which a neighbor counts as changed too.
const NEIGHBOR_SIGMAS: f64 = 3.0;

/// Correlation with a neighbor above which both pixels follow the same light. For independent pixels, the standard
/// deviation of the correlation is `1 / sqrt(BLOCKS)`, so this is 3.4 standard deviations.
const MAX_NEIGHBOR_CORRELATION: f64 = 0.6;

/// Returns the pixels that blink, in ascending order. `progress` receives the number of readouts read.
///
/// The stream is divided into [`BLOCKS`] blocks. Let `n_b` be the spikes of a pixel in block `b`, `n` their mean, and
/// `m_b` the median of `n_b / n` over the 5x5 box around the pixel without the pixel. A line is fitted to `n_b` over `m_b`.
/// Its residuals contain neither flicker, drift nor motion of large objects, which the neighbors share. The line has an
/// offset, because the light does not change the dark rate of a hot pixel. `V` is the variance of the residuals.
///
/// An intact pixel has the variance that its neighbors predict: `n` times the median of `V / n` over the box, because
/// the number of spikes of a renewal process has a variance proportional to its mean. The prediction is at least
/// [`ROUNDING_VARIANCE`]. A pixel blinks if `V` exceeds the prediction times [`variance_limit`], and
/// * no pixel in the box exceeds the limit of [`NEIGHBOR_SIGMAS`], because motion changes several pixels;
/// * the median of `V / n` is at most [`MAX_NEIGHBOR_FANO`], because motion changes the light of the whole box;
/// * no adjacent pixel has the same changes, as at the corner of a light that flickers.
///
/// # Errors
/// Errors of the reader, and [`spikelane::ErrorKind::Memory`] if the counts of all blocks do not fit.
pub(crate) fn blinking_pixels(reader: &StreamReader, progress: &mut dyn FnMut(usize)) -> Result<Vec<usize>> {
    let length = reader.readouts() / BLOCKS;
    if length == 0 {
        return Ok(Vec::new());
    }
    let pixels = reader.geometry().pixels();
    check_memory("spikes of blocks of readouts", pixels * BLOCKS * size_of::<u32>())?;
    let mut blocks = Vec::new();
    for b in 0..BLOCKS {
        blocks.push(spike_counts(reader, b * length..(b + 1) * length)?);
        progress((b + 1) * length);
    }
    Ok(BlockCounts::new(blocks, reader.geometry().width(), pixels).blinking())
}

struct BlockCounts {
    /// Spikes of every pixel, for each block.
    blocks: Vec<Vec<u32>>,
    /// Mean spikes per block of every pixel.
    means: Vec<f64>,
    width: usize,
}

impl BlockCounts {
    fn new(blocks: Vec<Vec<u32>>, width: usize, pixels: usize) -> Self {
        let mean = |p: usize| blocks.iter().map(|b| f64::from(b[p])).sum::<f64>() / blocks.len() as f64;
        let means = (0..pixels).map(mean).collect();
        Self { blocks, means, width }
    }

    fn blinking(&self) -> Vec<usize> {
        let pixels = self.means.len();
        let rows: Vec<Range<usize>> =
            (0..pixels).step_by(self.width).map(|start| start..start + self.width).collect();
        let variances: Vec<f64> = threads::map(&rows, |row| {
            threads::check_stop();
            row.clone().map(|p| self.variance(p)).collect::<Vec<_>>()
        })
        .concat();
        // Chernoff's bound: the probability of more than `z` standard deviations is below `exp(-z^2 / 2) / 2`.
        let sigmas = (-2.0 * (2.0 * MAX_FALSE_PROBABILITY / pixels as f64).ln()).sqrt();
        let exceeds = |p: usize, sigmas: f64| self.exceeds(&variances, p, sigmas);
        let is_alone = |p: &usize| {
            let reference = self.reference(*p);
            !self.neighbors(*p, 2).any(|q| exceeds(q, NEIGHBOR_SIGMAS))
                && !self.neighbors(*p, 1).any(|q| self.has_same_changes(*p, q, &reference))
        };
        (0..pixels).filter(|p| exceeds(*p, sigmas)).filter(is_alone).collect()
    }

    /// Returns the pixels in the square box around `p` without `p`. The box extends `radius` pixels to each side.
    fn neighbors(&self, p: usize, radius: usize) -> impl Iterator<Item = usize> + use<> {
        let (width, height) = (self.width, self.means.len() / self.width);
        let (row, col) = (p / width, p % width);
        let cols = col.saturating_sub(radius)..(col + radius + 1).min(width);
        let rows = row.saturating_sub(radius)..(row + radius + 1).min(height);
        rows.flat_map(move |r| cols.clone().map(move |c| r * width + c)).filter(move |q| *q != p)
    }

    /// Returns the median change of the neighbors of `p` in each block, relative to their means.
    fn reference(&self, p: usize) -> Vec<f64> {
        let neighbors: Vec<usize> = self.neighbors(p, 2).filter(|q| self.means[*q] > 0.0).collect();
        let mut changes = Vec::with_capacity(neighbors.len());
        let of_block = |block: &Vec<u32>| {
            changes.clear();
            changes.extend(neighbors.iter().map(|q| f64::from(block[*q]) / self.means[*q]));
            median(&mut changes)
        };
        self.blocks.iter().map(of_block).collect()
    }

    /// Returns the residuals of the line that is fitted to the spikes of `p` over `reference`.
    fn residuals(&self, p: usize, reference: &[f64]) -> Vec<f64> {
        let mean = reference.iter().sum::<f64>() / reference.len() as f64;
        let pairs = || {
            self.blocks
                .iter()
                .zip(reference)
                .map(|(block, m)| (m - mean, f64::from(block[p]) - self.means[p]))
        };
        let (products, squares) = pairs().fold((0.0, 0.0), |(xy, xx), (x, y)| (xy + x * y, xx + x * x));
        let slope = if squares > 0.0 { products / squares } else { 0.0 };
        pairs().map(|(x, y)| y - slope * x).collect()
    }

    /// Returns the variance of the residuals of `p`. The line has two parameters.
    fn variance(&self, p: usize) -> f64 {
        let squares = self.residuals(p, &self.reference(p)).into_iter().map(|d| d * d);
        squares.sum::<f64>() / (self.blocks.len() - 2) as f64
    }

    /// Returns whether the variance of `p` exceeds the variance that its neighbors predict.
    fn exceeds(&self, variances: &[f64], p: usize, sigmas: f64) -> bool {
        if self.means[p] < MIN_BLOCK_SPIKES {
            return false;
        }
        let judged = self.neighbors(p, 2).filter(|q| self.means[*q] > 0.0);
        let mut shares: Vec<f64> = judged.map(|q| variances[q] / self.means[q]).collect();
        let neighbors = shares.len();
        let share = median(&mut shares);
        // Without neighbors, the share is NaN.
        if share.is_nan() || share > MAX_NEIGHBOR_FANO {
            return false;
        }
        let predicted = (share * self.means[p]).max(ROUNDING_VARIANCE);
        variances[p] > predicted * variance_limit(self.blocks.len(), self.means[p], neighbors, sigmas)
    }

    /// Returns whether the changes of `p` and `q` are correlated. `reference` is the reference of `p`.
    fn has_same_changes(&self, p: usize, q: usize, reference: &[f64]) -> bool {
        let (mut products, mut squares) = (0.0, [0.0; 2]);
        for (a, b) in self.residuals(p, reference).into_iter().zip(self.residuals(q, reference)) {
            products += a * b;
            squares[0] += a * a;
            squares[1] += b * b;
        }
        f64::abs(products) > MAX_NEIGHBOR_CORRELATION * (squares[0] * squares[1]).sqrt()
    }
}

/// Returns the ratio of the variances of a pixel and its neighbors that chance exceeds with the probability of `sigmas`
/// standard deviations.
///
/// For `k` blocks with `n` spikes each, the relative variance of `V` is `r = 2 / (k - 2) + 1 / (k n)`. The second term is
/// the kurtosis of Poisson counts, which are less regular than the spikes of a pixel that integrates charge. By Wilson
/// and Hilferty, the cube root of `V` is normally distributed with the mean `1 - r / 9` and the variance `r / 9`. The
/// median of `j` neighbors has `pi / (2 j)` times this variance.
fn variance_limit(blocks: usize, spikes: f64, neighbors: usize, sigmas: f64) -> f64 {
    let blocks = blocks as f64;
    let ninth = (2.0 / (blocks - 2.0) + 1.0 / (blocks * spikes)) / 9.0;
    let of_median = std::f64::consts::FRAC_PI_2 / neighbors as f64;
    (1.0 - ninth + sigmas * (ninth * (1.0 + of_median)).sqrt()).powi(3)
}

#[cfg(test)]
mod tests {
    use super::*;
    use spikelane::{Geometry, SpikeFrames};
    use spikelane_io::formats::Layout;

    const WIDTH: usize = 48;
    const HEIGHT: usize = 40;

    /// Returns uniform random numbers from 0 to 1 (SplitMix64).
    fn uniforms(seed: u64) -> impl FnMut() -> f64 {
        let mut state = seed;
        move || {
            state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mut z = state;
            z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
            ((z ^ z >> 31) >> 11) as f64 / (1_u64 << 53) as f64
        }
    }

    /// Returns a stream of pixels that integrate `light(x, y, readout)` in spikes per readout. Each threshold is uniformly
    /// distributed around 1 with the standard deviation `noise`. A `noise` of 1 gives independent readouts.
    fn stream(
        seed: u64,
        readouts: usize,
        noise: f64,
        light: impl Fn(usize, usize, usize) -> f64,
    ) -> StreamReader {
        let mut next = uniforms(seed);
        let mut charge: Vec<f64> = (0..WIDTH * HEIGHT).map(|_| next()).collect();
        let mut threshold = vec![1.0; WIDTH * HEIGHT];
        let mut dense = Vec::new();
        for t in 0..readouts {
            for p in 0..WIDTH * HEIGHT {
                let rate = light(p % WIDTH, p / WIDTH, t);
                charge[p] += rate;
                let fires = if noise == 1.0 { next() < rate } else { charge[p] >= threshold[p] };
                if fires {
                    charge[p] -= threshold[p];
                    threshold[p] = 1.0 + noise * 12_f64.sqrt() * (next() - 0.5);
                }
                dense.push(u8::from(fires));
            }
        }
        let geometry = Geometry::new(WIDTH as u32, HEIGHT as u32).unwrap();
        let frames = SpikeFrames::from_dense(geometry, &dense).unwrap();
        StreamReader::from_bytes("test", frames.into_bytes(), Some(Layout::DatTop), Some(geometry)).unwrap()
    }

    fn blinking_positions(reader: &StreamReader) -> Vec<[usize; 2]> {
        let pixels = blinking_pixels(reader, &mut |_| {}).unwrap();
        pixels.into_iter().map(|p| [p % WIDTH, p / WIDTH]).collect()
    }

    /// A gradient from 0.06 to 0.22 spikes per readout.
    fn gradient(x: usize) -> f64 {
        0.06 + 0.16 * x as f64 / WIDTH as f64
    }

    #[test]
    fn pixels_that_switch_between_two_levels_are_found() {
        // Each pixel switches at random after 300 readouts on average. The last one is in the corner.
        let blinking = [[5, 7], [20, 20], [40, 31], [0, 0], [47, 39]];
        let mut next = uniforms(7);
        let mut levels = vec![Vec::new(); blinking.len()];
        for level in &mut levels {
            let mut is_high = false;
            for _ in 0..8000 {
                is_high ^= next() < 1.0 / 300.0;
                level.push(is_high);
            }
        }
        for noise in [0.05, 0.3] {
            let reader = stream(1, 8000, noise, |x, y, t| match blinking.iter().position(|b| *b == [x, y]) {
                Some(i) => gradient(x) * if levels[i][t] { 1.3 } else { 0.7 },
                None => gradient(x),
            });
            let mut expected = blinking.to_vec();
            expected.sort_by_key(|[x, y]| y * WIDTH + x);
            assert_eq!(blinking_positions(&reader), expected, "noise {noise}");
        }
    }

    #[test]
    fn intact_pixels_do_not_blink() {
        for (seed, noise) in [(2, 0.0), (3, 0.05), (4, 0.3), (5, 1.0)] {
            for readouts in [31, 1000, 8000] {
                let reader = stream(seed, readouts, noise, |x, _, _| gradient(x));
                assert_eq!(blinking_positions(&reader), [[0; 2]; 0], "noise {noise}, {readouts} readouts");
            }
        }
    }

    #[test]
    fn flicker_drift_and_a_lamp_with_a_corner_are_not_blinking() {
        let wave = |t: usize, period: f64| (std::f64::consts::TAU * t as f64 / period).sin();
        let drift = stream(6, 8000, 0.1, |x, _, t| gradient(x) * (1.0 + t as f64 / 8000.0));
        let flicker = stream(7, 8000, 0.1, |x, _, t| gradient(x) * (1.0 + 0.5 * wave(t, 700.0)));
        let lamp = stream(8, 8000, 0.1, |x, y, t| {
            let is_lamp = (10..30).contains(&x) && (8..30).contains(&y);
            gradient(x) * if is_lamp { 1.0 + 0.5 * wave(t, 900.0) } else { 1.0 }
        });
        for reader in [drift, flicker, lamp] {
            assert_eq!(blinking_positions(&reader), [[0; 2]; 0]);
        }
    }

    #[test]
    fn a_hot_pixel_under_changing_light_is_not_blinking() {
        let reader = stream(12, 8000, 0.1, |x, y, t| {
            let light = gradient(x) * if t > 3000 { 2.0 } else { 1.0 };
            if [x, y] == [20, 20] { light + 0.2 } else { light }
        });
        assert_eq!(blinking_positions(&reader), [[0; 2]; 0]);
    }

    #[test]
    fn moving_objects_are_not_blinking() {
        let spot = stream(9, 8000, 0.1, |x, y, t| {
            let distance = (x as f64 - t as f64 / 180.0).hypot(y as f64 - 20.0);
            if distance < 3.0 { 0.3 } else { gradient(x) }
        });
        let bar = stream(10, 8000, 0.1, |x, _, t| if x.abs_diff(t / 200) < 2 { 0.3 } else { gradient(x) });
        let texture = stream(11, 8000, 0.1, |x, y, t| {
            let (u, v) = (x + t / 400, y + t / 900);
            0.05 + 0.2 * ((u * 7919 + v * 104_729) % 97) as f64 / 97.0
        });
        for (name, reader) in [("spot", spot), ("bar", bar), ("texture", texture)] {
            assert_eq!(blinking_positions(&reader), [[0; 2]; 0], "{name}");
        }
    }
}
