//! Readouts that were lost, found by the spikes that went with them.
//!
//! A pixel fires regularly. Where a readout is lost, those that would have fired in it have an interval of twice the usual length
//! less one, all at the same time, and nothing else that a camera does looks so: pixels that miss a spike do so each by itself, and a
//! light that falters does so for longer. Pixels that fire at most readouts are regular in those at which they do not.

use std::ops::Range;

use rayon::prelude::*;

use super::bits::PixelBits;
use super::recorded::Scene;
use super::scan::BANDS;
use super::wave::Stretch;

/// Mean interval from which on a missing spike shows: twice 2.3 less one is more than three.
const SHORTEST: f64 = 2.3;

/// Length of an interval with a spike missing, in mean ones.
const MISSING: Range<f64> = 1.4..2.6;

/// Fewest spikes of a pixel that tell its mean interval.
const FEWEST: usize = 4;

/// Spikes that must be expected to go with a readout: of as many, none has fewer than [`SEEN`] of them in five hundred. With eleven, as in the
/// dark of 48x48 pixels, one in six was not found, and one that is not found is far beyond what the model strays by.
const EXPECTED: f64 = 30.0;

/// Share of them that must be seen, and how many times what is seen just before or after.
const SEEN: f64 = 0.45;
const SHARP: f64 = 4.0;

/// The times of one light, each a list of stretches.
pub(super) type Periods = Vec<Vec<Range<usize>>>;

/// The times in which a scene's light rests.
pub(super) fn periods(scene: &Scene, stretches: &[Stretch], readouts: usize) -> Periods {
    if scene.constant() {
        return vec![vec![0..readouts]];
    }
    let Some(first) = stretches.first() else { return Vec::new() };
    // What comes before the first step has no stretch.
    let all = std::iter::once((!first.bright, 0..first.from))
        .chain(stretches.iter().map(|s| (s.bright, s.from..s.to)));
    let all: Vec<(bool, Range<usize>)> = all.collect();
    [false, true].map(|bright| all.iter().filter(|s| s.0 == bright).map(|s| s.1.clone()).collect()).into()
}

/// The first readouts behind lost ones, none of them next to one of `repeated`, of which the spikes are missing too; `None` where too few
/// spikes go with a readout.
pub(super) fn lost(
    bits: &PixelBits,
    periods: &[Vec<Range<usize>>],
    repeated: &[usize],
) -> Option<Vec<usize>> {
    let all: Option<Vec<Vec<usize>>> = periods.iter().map(|period| of_light(bits, period)).collect();
    let mut all = all.filter(|a| !a.is_empty())?.concat();
    all.retain(|t| repeated.iter().all(|r| r.abs_diff(*t) > 2));
    all.sort_unstable();
    Some(all)
}

/// Lost readouts with those that shorten a wave though too few pixels have spikes on both sides of them to tell: within a mean interval of a
/// step. Waves are counted from a rise to the next, or from a fall, as a lag may show one of them late.
pub(super) fn completed(mut lost: Vec<usize>, stretches: &[Stretch], half: usize) -> Vec<usize> {
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

/// Spikes that are missing, by twice the readout that would follow, and how many would go with a lost readout.
#[derive(Clone, Debug)]
struct Missing {
    at: Vec<u32>,
    expected: f64,
    pixels: usize,
}

fn of_light(bits: &PixelBits, period: &[Range<usize>]) -> Option<Vec<usize>> {
    let pixels = bits.geometry.pixels();
    let rows = pixels.div_ceil(BANDS);
    let of_band = |band: usize| {
        let mut missing = Missing { at: vec![0; 2 * bits.readouts + 2], expected: 0.0, pixels: 0 };
        let mut times = Vec::new();
        for p in (band * rows).min(pixels)..((band + 1) * rows).min(pixels) {
            missing.add(bits.pixel(p), period, &mut times);
        }
        missing
    };
    let bands: Vec<Missing> = (0..BANDS).into_par_iter().map(of_band).collect();
    let sum = bands.into_iter().reduce(|mut sum, band| {
        sum.at.iter_mut().zip(band.at).for_each(|(a, b)| *a += b);
        sum.expected += band.expected;
        sum.pixels += band.pixels;
        sum
    })?;
    sum.peaks(period)
}

impl Missing {
    /// Adds a pixel's; `times` is room for its spikes by stretch.
    fn add(&mut self, words: &[u64], period: &[Range<usize>], times: &mut Vec<Vec<u32>>) {
        let length: usize = period.iter().map(Range::len).sum();
        let ones: usize =
            period.iter().map(|r| super::bits::count_between(words, r.start, r.end) as usize).sum();
        let flip = if 2 * ones > length { u64::MAX } else { 0 };
        times.resize(period.len(), Vec::new());
        for (range, times) in period.iter().zip(times.iter_mut()) {
            collect(words, flip, range, times);
        }
        let whole = |t: &&Vec<u32>| t.len() > 1;
        let (mut span, mut count) = (0, 0);
        for times in times.iter().filter(whole) {
            span += times[times.len() - 1] - times[0];
            count += times.len() - 1;
        }
        let mean = f64::from(span) / count as f64;
        if count < FEWEST || mean < SHORTEST {
            return;
        }
        self.expected += mean.recip();
        self.pixels += 1;
        let (least, most) = ((MISSING.start * mean) as u32, (MISSING.end * mean) as u32);
        let least = least.max(mean.ceil() as u32);
        for times in times.iter().filter(whole) {
            for pair in times.windows(2) {
                let gap = pair[1] - pair[0];
                if gap > least && gap <= most {
                    self.at[(pair[0] + pair[1] + 1) as usize] += 1;
                }
            }
        }
    }

    /// Readouts at which as many are missing as go with one, and hardly any around.
    fn peaks(mut self, period: &[Range<usize>]) -> Option<Vec<usize>> {
        let length = self.at.len();
        let mean = self.pixels as f64 / self.expected;
        let reach = 2 + (0.06 * mean) as usize;
        let width = 2 * reach + 1;
        let all: u32 = self.at.iter().sum();
        let chance = by_chance(f64::from(all) * width as f64 / length as f64);
        if self.expected < EXPECTED || chance > 0.8 * self.expected {
            return None;
        }
        // Near an edge some pixels have no spike on its other side.
        let share = |at: usize| {
            let inside = period.iter().filter(|r| r.contains(&at));
            inside.map(|r| (at - r.start).min(r.end - at) as f64 / mean).fold(0.0, f64::max).min(1.0)
        };
        let mut found: Vec<usize> = Vec::new();
        loop {
            let around = sums(&self.at, reach);
            let most = |best: usize, i: usize| if around[i] > around[best] { i } else { best };
            let sharp = |i: &usize| {
                let shifted = |n: isize| around.get(i.wrapping_add_signed(n * width as isize)).copied();
                let mut beside = [-2, -1, 1, 2].map(|n| shifted(n).unwrap_or(0));
                beside.sort_unstable();
                // One neighbour may be another lost readout.
                f64::from(around[*i]) >= SHARP * f64::from(beside[2])
            };
            let plain = |i: &usize| f64::from(around[*i]) >= chance.max(SEEN * self.expected * share(i / 2));
            let Some(i) = (0..length).filter(|i| plain(i) && sharp(i)).reduce(most) else { break };
            let window = i.saturating_sub(reach)..(i + reach + 1).min(length);
            // Two that are lost in succession take twice the spikes along.
            let several = (f64::from(around[i]) / self.expected).round().max(1.0) as usize;
            let each = |j: usize| std::iter::repeat_n(j, self.at[j] as usize);
            let spikes: Vec<usize> = window.clone().flat_map(each).collect();
            let centre =
                |s: &[usize]| (0.5 * s.iter().sum::<usize>() as f64 / s.len() as f64).round() as usize;
            found.extend(spikes.chunks(spikes.len().div_ceil(several)).map(centre));
            self.at[window].fill(0);
        }
        Some(found)
    }
}

/// Spikes that are not to be expected at any time where so many are by chance: above one in a hundred million of Poisson's law.
fn by_chance(mean: f64) -> f64 {
    mean + 5.6 * mean.sqrt() + 3.5
}

/// For each entry the sum of those up to `reach` away.
fn sums(at: &[u32], reach: usize) -> Vec<u32> {
    let before: Vec<u32> = std::iter::once(0)
        .chain(at.iter().scan(0, |sum, n| {
            *sum += n;
            Some(*sum)
        }))
        .collect();
    (0..at.len()).map(|i| before[(i + reach + 1).min(at.len())] - before[i.saturating_sub(reach)]).collect()
}

/// The spikes of a pixel in `range`, or with `flip` the readouts without one.
fn collect(words: &[u64], flip: u64, range: &Range<usize>, times: &mut Vec<u32>) {
    times.clear();
    for w in range.start / 64..range.end.div_ceil(64) {
        let mut word = words[w] ^ flip;
        if w == range.start / 64 {
            word &= u64::MAX << (range.start % 64);
        }
        if w == range.end / 64 {
            word &= (1 << (range.end % 64)) - 1;
        }
        while word != 0 {
            times.push(64 * w as u32 + word.trailing_zeros());
            word &= word - 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spikes::{Geometry, Packed, set_bit};

    const READOUTS: usize = 2000;

    fn whole() -> Periods {
        vec![std::iter::once(0..READOUTS).collect()]
    }

    /// 32x32 pixels that gather what `light` says, each with its own gain and noise of a hundredth of a threshold.
    fn recorded(light: impl Fn(usize) -> f64, left_out: &[usize]) -> PixelBits {
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
        PixelBits::new(Packed::new(geometry, &bytes).unwrap())
    }

    #[test]
    fn readouts_that_were_lost_are_found_to_one_at_every_light() {
        let left_out = [310, 640, 655, 1402, 1752, 1772];
        // The lost ones do not count in the file.
        let wanted = [310, 639, 653, 1399, 1748, 1767];
        for light in [0.03, 0.1, 0.3, 0.4, 0.6, 0.7, 0.9] {
            let found = lost(&recorded(|_| light, &left_out), &whole(), &[]).unwrap();
            assert_eq!(found.len(), 6, "{light}: {found:?}");
            assert!(found.iter().zip(wanted).all(|(f, w)| f.abs_diff(w) <= 1), "{light}: {found:?}");
        }
    }

    #[test]
    fn two_that_were_lost_in_succession_are_two() {
        let found = lost(&recorded(|_| 0.1, &[700, 701]), &whole(), &[]).unwrap();
        assert!(found.len() == 2 && found.iter().all(|t| t.abs_diff(700) <= 1), "{found:?}");
    }

    #[test]
    fn a_light_that_falters_loses_nothing() {
        let swing = |t: usize| 1.0 + 0.6 * (t as f64 / 40.0).sin();
        for light in [0.03, 0.1, 0.3, 0.55] {
            let swings = lost(&recorded(|t| light * swing(t), &[]), &whole(), &[]);
            assert!(swings.as_ref().is_none_or(Vec::is_empty), "{light}: {swings:?}");
            let steady = lost(&recorded(|_| light, &[]), &whole(), &[]);
            assert_eq!(steady, Some(Vec::new()), "{light}");
        }
    }

    #[test]
    fn both_lights_of_a_wave_tell_what_was_lost_in_them() {
        let light = |t: usize| if (t / 500).is_multiple_of(2) { 0.8 } else { 0.05 };
        let periods = [vec![0..500, 999..1499], vec![500..999, 1499..2000]];
        let found = lost(&recorded(light, &[700]), &periods, &[]).unwrap();
        assert!(found.len() == 1 && found[0].abs_diff(700) <= 1, "{found:?}");
        assert_eq!(
            lost(&recorded(light, &[700]), &periods, &[701]),
            Some(Vec::new()),
            "beside a repeated one"
        );
    }

    #[test]
    fn a_wave_that_is_shorter_than_its_period_has_lost_more_than_was_seen() {
        let stretch = |bright, from, to| Stretch { bright, from, to };
        let short = [stretch(false, 500, 999), stretch(true, 999, 1497), stretch(false, 1497, 1997)];
        assert_eq!(completed(vec![700], &short, 500), [700, 998, 998]);
        assert_eq!(completed(vec![700, 800, 1200], &short, 500), [700, 800, 1200], "all were seen");
        assert!(completed(Vec::new(), &short, 500).is_empty(), "none was seen anywhere");
        let late = [stretch(false, 500, 1003), stretch(true, 1003, 1500), stretch(false, 1500, 2003)];
        assert_eq!(completed(vec![1700], &late, 500), [1700], "rises show late");
    }

    #[test]
    fn pixels_that_hardly_fire_or_always_do_tell_nothing() {
        assert_eq!(lost(&recorded(|_| 0.002, &[]), &whole(), &[]), None);
        assert_eq!(lost(&recorded(|_| 2.0, &[]), &whole(), &[]), None);
        assert_eq!(lost(&recorded(|_| 0.5, &[]), &[], &[]), None);
    }
}
