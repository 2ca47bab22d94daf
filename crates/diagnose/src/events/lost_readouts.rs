//! Lost readouts, located by the spikes that are missing with them.
//!
//! A pixel fires at regular intervals of `m` readouts. If one readout is lost, the spikes in it are lost as well.
//! Each pixel that fired in this readout then has an interval of `2 m - 1` readouts, and all these intervals
//! contain the same moment. No other effect causes this pattern. Missed spikes are independent between pixels, and
//! a change of the light lasts longer. For pixels that fire at most readouts, the same rule applies to the readouts
//! without a spike.

use std::ops::Range;

use crate::recordings::bits::{BAND_COUNT, PixelBits, count_between};
use crate::recordings::recorded_scene::RecordedScene;
use crate::recordings::stretches::Stretch;
use crate::thresholds::{
    ADJACENT_SHARE, MAX_MISSING_RUN, MIN_EXPECTED_SPIKES, MIN_FOUND_SHARE, MIN_GAP_INTERVALS, MIN_INTERVALS,
    MIN_MEAN_INTERVAL, MIN_SHARPNESS,
};
use spikelane::unstable::spikes::set_bits;
use spikelane::unstable::threads;

/// Ranges of readouts under the same light. Each element contains all ranges of one light.
pub(crate) type LightPeriods = Vec<Vec<Range<usize>>>;

/// Returns the ranges of readouts for each light of a scene: one light for a constant scene, two for a square wave.
pub(crate) fn constant_periods(
    scene: &RecordedScene,
    stretches: &[Stretch],
    readouts: usize,
) -> LightPeriods {
    if scene.is_constant() {
        return vec![vec![0..readouts]];
    }
    let Some(first) = stretches.first() else { return Vec::new() };
    // The readouts before the first step belong to no stretch. Their light is the opposite of the light of the
    // first stretch.
    let all = std::iter::once((!first.is_bright, 0..first.from))
        .chain(stretches.iter().map(|s| (s.is_bright, s.from..s.to)));
    let all: Vec<(bool, Range<usize>)> = all.collect();
    [false, true].map(|bright| all.iter().filter(|s| s.0 == bright).map(|s| s.1.clone()).collect()).into()
}

/// Returns the first readout after each lost readout. Returns `None` if a lost readout would contain too few spikes
/// to be located. Locations within two readouts of a `repeated` readout are excluded, because spikes are also
/// missing in a repeated readout.
pub(crate) fn locate_lost(
    bits: &PixelBits,
    periods: &[Vec<Range<usize>>],
    repeated: &[usize],
) -> Option<Vec<usize>> {
    let all: Option<Vec<Vec<usize>>> =
        periods.iter().map(|period| locate_under_light(bits, period)).collect();
    let mut all = all.filter(|a| !a.is_empty())?.concat();
    all.retain(|t| repeated.iter().all(|r| r.abs_diff(*t) > 2));
    all.sort_unstable();
    Some(all)
}

/// Adds lost readouts near a step, where too few pixels have spikes on both sides. A wave that is too short has
/// lost readouts. Those that were not located are added at the inner step of the wave.
///
/// A wave lasts from one rise to the next, or from one fall to the next. If the response to rises is delayed, both
/// ends move equally, so the length does not change. `half` is the half period in readouts.
pub(crate) fn complete_waves(mut lost: Vec<usize>, stretches: &[Stretch], half: usize) -> Vec<usize> {
    if lost.is_empty() {
        return lost;
    }
    for wave in stretches.windows(3).step_by(2).filter(|w| w[0].to == w[1].from && w[1].to == w[2].from) {
        let (from, to) = (wave[0].from, wave[2].from);
        let found = lost.iter().filter(|t| (from..to).contains(t)).count();
        let missed = (2 * half).saturating_sub(to - from + found);
        lost.extend(std::iter::repeat_n(wave[1].from - 1, missed));
    }
    lost.sort_unstable();
    lost
}

/// Missing spikes of all pixels. The index of `at` is twice the first readout after the missing spike. `expected`
/// is the expected number of spikes per readout.
#[derive(Clone, Debug)]
struct MissingSpikes {
    at: Vec<u32>,
    expected: f64,
    pixels: usize,
}

/// Locates lost readouts in the ranges `period` of one light. Returns `None` if a lost readout would contain too
/// few spikes to be located.
pub(crate) fn locate_under_light(bits: &PixelBits, period: &[Range<usize>]) -> Option<Vec<usize>> {
    let pixels = bits.geometry.pixels();
    let rows = pixels.div_ceil(BAND_COUNT);
    let of_band = |band: usize| {
        let mut missing = MissingSpikes { at: vec![0; 2 * bits.readouts + 2], expected: 0.0, pixels: 0 };
        let mut times = Vec::new();
        for p in (band * rows).min(pixels)..((band + 1) * rows).min(pixels) {
            missing.add(bits.pixel(p), period, &mut times);
        }
        missing
    };
    let bands: Vec<MissingSpikes> = threads::map(0..BAND_COUNT, of_band);
    let sum = bands.into_iter().reduce(|mut sum, band| {
        sum.at.iter_mut().zip(band.at).for_each(|(a, b)| *a += b);
        sum.expected += band.expected;
        sum.pixels += band.pixels;
        sum
    })?;
    sum.locate(period)
}

impl MissingSpikes {
    /// Adds the missing spikes of a pixel. `times` is scratch space for the spikes of each range.
    fn add(&mut self, words: &[u64], period: &[Range<usize>], times: &mut Vec<Vec<u32>>) {
        let length: usize = period.iter().map(Range::len).sum();
        let ones: usize = period.iter().map(|r| count_between(words, r.start, r.end) as usize).sum();
        let flip = if 2 * ones > length { u64::MAX } else { 0 };
        times.resize(period.len(), Vec::new());
        for (range, times) in period.iter().zip(times.iter_mut()) {
            collect_spikes(words, flip, range, times);
        }
        let has_interval = |t: &&Vec<u32>| t.len() > 1;
        let (mut span, mut count) = (0, 0);
        for times in times.iter().filter(has_interval) {
            span += times[times.len() - 1] - times[0];
            count += times.len() - 1;
        }
        let mean = f64::from(span) / count as f64;
        if count < MIN_INTERVALS || mean < MIN_MEAN_INTERVAL {
            return;
        }
        self.expected += mean.recip();
        self.pixels += 1;
        let min_gap = ((MIN_GAP_INTERVALS * mean) as u32).max(mean.ceil() as u32);
        for times in times.iter().filter(has_interval) {
            for pair in times.windows(2).filter(|pair| pair[1] - pair[0] > min_gap) {
                self.add_gap(pair[0], pair[1] - pair[0], mean);
            }
        }
    }

    /// Adds the missing spikes of an interval of `gap` readouts that begins at `start`. If `n` readouts are lost,
    /// `n + 1` regular intervals become one interval, which is `n` readouts shorter than their sum.
    fn add_gap(&mut self, start: u32, gap: u32, mean: f64) {
        let n = ((f64::from(gap) - mean) / (mean - 1.0)).round().max(1.0) as u32;
        if n > MAX_MISSING_RUN {
            return;
        }
        for k in 0..n {
            let offset = 2 * (k + 1) * (gap + n) / (n + 1) - 2 * k;
            self.at[(2 * start + offset) as usize] += 1;
        }
    }

    /// Returns the lost readouts. At a lost readout, as many spikes are missing as one readout has, and hardly any
    /// are missing around it.
    fn locate(mut self, period: &[Range<usize>]) -> Option<Vec<usize>> {
        let background = f64::from(self.at.iter().sum::<u32>()) / self.at.len() as f64;
        let reach = 2 + (0.06 * self.mean()) as usize;
        let chance = count_limit(background * (2 * reach + 1) as f64);
        if self.expected < MIN_EXPECTED_SPIKES || chance > 0.8 * self.expected {
            return None;
        }
        let mut found = Vec::new();
        while let Some(i) = self.find_peak(reach, chance, period) {
            let window = i.saturating_sub(reach)..(i + reach + 1).min(self.at.len());
            let window = self.extend_window(window, reach + 1, background);
            found.extend(self.lost_readouts_in(window.clone(), background));
            self.at[window].fill(0);
        }
        Some(found)
    }

    /// Returns the mean interval in readouts.
    fn mean(&self) -> f64 {
        self.pixels as f64 / self.expected
    }

    /// Returns the index in `at` with the largest sum of missing spikes within `reach`, if any sum is large and
    /// sharp enough for a lost readout. `chance` is the sum that chance does not exceed.
    fn find_peak(&self, reach: usize, chance: f64, period: &[Range<usize>]) -> Option<usize> {
        let mean = self.mean();
        // Near the end of a range, only some of the pixels have spikes on both sides.
        let share = |at: usize| {
            let inside = period.iter().filter(|r| r.contains(&at));
            inside.map(|r| (at - r.start).min(r.end - at) as f64 / mean).fold(0.0, f64::max).min(1.0)
        };
        let (sums, width) = (window_sums(&self.at, reach), (2 * reach + 1) as isize);
        let is_strong =
            |i: &usize| f64::from(sums[*i]) >= chance.max(MIN_FOUND_SHARE * self.expected * share(i / 2));
        let is_sharp = |i: &usize| {
            let shifted = |n: isize| sums.get(i.wrapping_add_signed(n * width)).copied();
            let mut neighbors = [-2, -1, 1, 2].map(|n| shifted(n).unwrap_or(0));
            neighbors.sort_unstable();
            // One of the neighboring windows may contain another lost readout.
            f64::from(sums[*i]) >= MIN_SHARPNESS * f64::from(neighbors[2])
        };
        let larger = |best: usize, i: usize| if sums[i] > sums[best] { i } else { best };
        (0..sums.len()).filter(|i| is_strong(i) && is_sharp(i)).reduce(larger)
    }

    /// Returns the lost readouts in `window`. The number of missing spikes, divided by the spikes of one readout,
    /// determines how many readouts are lost.
    fn lost_readouts_in(&self, window: Range<usize>, background: f64) -> Vec<usize> {
        let chance = background * window.len() as f64;
        let spikes: Vec<usize> = window.flat_map(|j| std::iter::repeat_n(j, self.at[j] as usize)).collect();
        let count = ((spikes.len() as f64 - chance) / self.expected).round().max(1.0) as usize;
        let center = |s: &[usize]| (0.5 * s.iter().sum::<usize>() as f64 / s.len() as f64).round() as usize;
        spikes.chunks(spikes.len().div_ceil(count)).map(center).collect()
    }

    /// Extends `window` on both sides in steps of `step` elements. The extension ends when the next part contains
    /// only stray missing spikes of the readouts in the window. A part with more missing spikes contains another
    /// lost readout.
    fn extend_window(&self, mut window: Range<usize>, step: usize, background: f64) -> Range<usize> {
        let min_spikes = count_limit(background * step as f64).max(ADJACENT_SHARE * self.expected);
        let has_spikes = |range: Range<usize>| {
            !range.is_empty() && f64::from(self.at[range].iter().sum::<u32>()) >= min_spikes
        };
        while has_spikes(window.start.saturating_sub(step)..window.start) {
            window.start = window.start.saturating_sub(step);
        }
        while has_spikes(window.end..(window.end + step).min(self.at.len())) {
            window.end = (window.end + step).min(self.at.len());
        }
        window
    }
}

/// Returns a limit that a Poisson count with expectation `mean` exceeds with a probability below 1e-8.
fn count_limit(mean: f64) -> f64 {
    mean + 5.6 * mean.sqrt() + 3.5
}

/// Returns, for each element, the sum of the elements at most `reach` away from it.
fn window_sums(at: &[u32], reach: usize) -> Vec<u32> {
    let before: Vec<u32> = std::iter::once(0)
        .chain(at.iter().scan(0, |sum, n| {
            *sum += n;
            Some(*sum)
        }))
        .collect();
    (0..at.len()).map(|i| before[(i + reach + 1).min(at.len())] - before[i.saturating_sub(reach)]).collect()
}

/// Collects into `times` the readouts in `range` at which a pixel fires. If `flip` is `u64::MAX`, collects the
/// readouts without a spike instead. [`spike_times`](crate::recordings::scan::spike_times) is faster, but it
/// supports whole recordings only.
fn collect_spikes(words: &[u64], flip: u64, range: &Range<usize>, times: &mut Vec<u32>) {
    times.clear();
    for w in range.start / 64..range.end.div_ceil(64) {
        let mut word = words[w] ^ flip;
        if w == range.start / 64 {
            word &= u64::MAX << (range.start % 64);
        }
        if w == range.end / 64 {
            word &= (1 << (range.end % 64)) - 1;
        }
        times.extend(set_bits(word).map(|bit| 64 * w as u32 + bit));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use spikelane::spikes::{Geometry, SpikeFramesRef, set_bit};

    const READOUTS: usize = 2000;

    fn whole_recording() -> LightPeriods {
        vec![std::iter::once(0..READOUTS).collect()]
    }

    /// Simulates 32x32 pixels under `light`, each with its own gain and with threshold noise of 1 %.
    fn simulated_bits(light: impl Fn(usize) -> f64, left_out: &[usize]) -> PixelBits {
        let geometry = Geometry::new(32, 32).unwrap();
        let mut state = 7_u64;
        let mut uniform = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f64 / f64::from(1 << 24)
        };
        let gains: Vec<f64> = (0..1024).map(|_| 0.9 + 0.2 * uniform()).collect();
        let mut charge: Vec<f64> = (0..1024).map(|_| uniform()).collect();
        let mut bytes = Vec::new();
        for t in 0..READOUTS + left_out.len() {
            let mut frame = vec![0; geometry.frame_bytes()];
            for p in 0..1024 {
                charge[p] += gains[p] * light(t);
                if charge[p] >= 1.0 + 0.02 * (uniform() - 0.5) {
                    charge[p] -= 1.0;
                    set_bit(&mut frame, p);
                }
            }
            if !left_out.contains(&t) {
                bytes.extend(frame);
            }
        }
        PixelBits::new(SpikeFramesRef::new(geometry, &bytes).unwrap()).unwrap()
    }

    #[test]
    fn lost_readouts_are_located_within_one_readout_at_every_light() {
        let left_out = [310, 640, 655, 1402, 1752, 1772];
        // A location is an index into the file, which does not contain the lost readouts.
        let wanted = [310, 639, 653, 1399, 1748, 1767];
        for light in [0.03, 0.1, 0.3, 0.4, 0.6, 0.7, 0.9] {
            let found = locate_lost(&simulated_bits(|_| light, &left_out), &whole_recording(), &[]).unwrap();
            assert_eq!(found.len(), 6, "{light}: {found:?}");
            assert!(found.iter().zip(wanted).all(|(f, w)| f.abs_diff(w) <= 1), "{light}: {found:?}");
        }
    }

    #[test]
    fn two_nearby_lost_readouts_are_separated() {
        // The distances reach one mean interval of the dimmest light, 20 readouts. At this distance, the same
        // pixels lose two spikes. If intervals are shorter than five readouts, two lost readouts at a distance
        // below 3 leave most pixels with a regular interval.
        for (light, nearest) in [(0.05, 1), (0.1, 1), (0.2, 1), (0.3, 3), (0.4, 3), (0.6, 3), (0.9, 1)] {
            for between in nearest..24 {
                let found =
                    locate_lost(&simulated_bits(|_| light, &[700, 700 + between]), &whole_recording(), &[])
                        .unwrap();
                let near = |(f, w): (&usize, usize)| f.abs_diff(w) <= 1;
                let all = found.len() == 2 && found.iter().zip([700, 699 + between]).all(near);
                assert!(all, "{light}, {between}: {found:?}");
            }
        }
    }

    #[test]
    fn oscillating_light_has_no_lost_readouts() {
        let swing = |t: usize| 1.0 + 0.6 * (t as f64 / 40.0).sin();
        for light in [0.03, 0.1, 0.3, 0.55] {
            let swings = locate_lost(&simulated_bits(|t| light * swing(t), &[]), &whole_recording(), &[]);
            assert!(swings.as_ref().is_none_or(Vec::is_empty), "{light}: {swings:?}");
            let steady = locate_lost(&simulated_bits(|_| light, &[]), &whole_recording(), &[]);
            assert_eq!(steady, Some(Vec::new()), "{light}");
        }
    }

    #[test]
    fn lost_readouts_are_located_in_both_lights_of_a_wave() {
        let light = |t: usize| if (t / 500).is_multiple_of(2) { 0.8 } else { 0.05 };
        let periods = [vec![0..500, 999..1499], vec![500..999, 1499..2000]];
        let found = locate_lost(&simulated_bits(light, &[700]), &periods, &[]).unwrap();
        assert!(found.len() == 1 && found[0].abs_diff(700) <= 1, "{found:?}");
        assert_eq!(
            locate_lost(&simulated_bits(light, &[700]), &periods, &[701]),
            Some(Vec::new()),
            "beside a repeated readout"
        );
    }

    #[test]
    fn short_waves_are_completed_with_lost_readouts() {
        let stretch = |is_bright, from, to| Stretch { is_bright, from, to };
        let short = [stretch(false, 500, 999), stretch(true, 999, 1497), stretch(false, 1497, 1997)];
        assert_eq!(complete_waves(vec![700], &short, 500), [700, 998, 998]);
        assert_eq!(
            complete_waves(vec![700, 800, 1200], &short, 500),
            [700, 800, 1200],
            "all lost readouts were located"
        );
        assert!(complete_waves(Vec::new(), &short, 500).is_empty(), "no lost readout was located");
        let late = [stretch(false, 500, 1003), stretch(true, 1003, 1500), stretch(false, 1500, 2003)];
        assert_eq!(complete_waves(vec![1700], &late, 500), [1700], "the response to rises is delayed");
    }

    #[test]
    fn rare_or_permanent_spikes_do_not_locate_lost_readouts() {
        assert_eq!(locate_lost(&simulated_bits(|_| 0.002, &[]), &whole_recording(), &[]), None);
        assert_eq!(locate_lost(&simulated_bits(|_| 2.0, &[]), &whole_recording(), &[]), None);
        assert_eq!(locate_lost(&simulated_bits(|_| 0.5, &[]), &[], &[]), None);
    }
}
