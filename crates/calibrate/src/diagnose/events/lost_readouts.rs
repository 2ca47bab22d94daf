//! Readouts that were lost, found by the spikes that went with them.
//!
//! A pixel fires regularly. Where a readout is lost, those that would have fired in it have an interval of twice the usual length
//! less one, all at the same time, and nothing else that a camera does looks so: pixels that miss a spike do so each by itself, and a
//! light that falters does so for longer. Pixels that fire at most readouts are regular in those at which they do not.

use std::ops::Range;

use super::missing_spikes::of_light;
use crate::diagnose::protocol::recorded::RecordedScene;
use crate::diagnose::recording::bits::PixelBits;
use crate::diagnose::recording::stretches::Stretch;

/// The times of one light, each a list of stretches.
pub(in crate::diagnose) type Periods = Vec<Vec<Range<usize>>>;

/// The times in which a scene's light rests.
pub(in crate::diagnose) fn periods(scene: &RecordedScene, stretches: &[Stretch], readouts: usize) -> Periods {
    if scene.is_constant() {
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
pub(in crate::diagnose) fn lost(
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
pub(in crate::diagnose) fn completed(mut lost: Vec<usize>, stretches: &[Stretch], half: usize) -> Vec<usize> {
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

#[cfg(test)]
mod tests {
    use super::*;
    use spikelane::spikes::{Geometry, SpikeFramesRef, set_bit};

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
        PixelBits::new(SpikeFramesRef::new(geometry, &bytes).unwrap()).unwrap()
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
    fn two_that_were_lost_close_to_each_other_are_two() {
        // Up to a mean interval and more of the dimmest, where the same pixels lose two spikes. At intervals of less than five readouts,
        // two within two of each other leave most pixels with an interval that they have anyway.
        for (light, nearest) in [(0.05, 1), (0.1, 1), (0.2, 1), (0.3, 3), (0.4, 3), (0.6, 3), (0.9, 1)] {
            for between in nearest..24 {
                let found = lost(&recorded(|_| light, &[700, 700 + between]), &whole(), &[]).unwrap();
                let near = |(f, w): (&usize, usize)| f.abs_diff(w) <= 1;
                let all = found.len() == 2 && found.iter().zip([700, 699 + between]).all(near);
                assert!(all, "{light}, {between}: {found:?}");
            }
        }
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
