//! Readouts that were repeated, found by pixels that do what they do not do twice running.

use std::ops::Range;

use super::lost_readouts::Periods;
use crate::diagnose::recording::bits::{PixelBits, count_between};
use crate::diagnose::recording::scan::Scan;
use spikelane::spikes::{SpikeFramesRef, bit};

/// Mean number of bits that change from one readout to the next from which on readouts are compared.
const CHANGING: f64 = 4.0;

/// Pixels that an equal readout must have whose doing the same twice running is no chance.
const PLAIN: usize = 2;

/// Readouts that are those before them once more, in the same light; `None` where hardly anything changes, or no light rests.
pub(in crate::diagnose) fn repeated(
    frames: SpikeFramesRef<'_>,
    bits: &PixelBits,
    scan: &Scan,
    periods: &Periods,
) -> Option<Vec<usize>> {
    let changes = scan.changes.iter().map(|c| f64::from(*c)).sum::<f64>() / scan.changes.len().max(1) as f64;
    if changes < CHANGING || periods.is_empty() {
        return None;
    }
    let mut all: Vec<usize> = periods.iter().flat_map(|light| again(frames, bits, scan, light)).collect();
    all.sort_unstable();
    Some(all)
}

/// Those in the times of one light. A pixel that fires at fewer than half of the readouts does not fire twice running, and one that fires at
/// more does not miss twice running. A dead one always misses and tells nothing, nor does one that is bright at other times: in the dark
/// behind a fall no pixel of a sensor may fire for a while.
fn again(frames: SpikeFramesRef<'_>, bits: &PixelBits, scan: &Scan, light: &[Range<usize>]) -> Vec<usize> {
    let length: usize = light.iter().map(Range::len).sum();
    let count = |p: usize| light.iter().map(|r| count_between(bits.pixel(p), r.start, r.end) as usize).sum();
    let counts: Vec<usize> = (0..scan.pixels.len()).map(count).collect();
    let bytes = scan.geometry.frame_bytes();
    let tells = |frame: &[u8], p: usize| {
        let own = if bit(frame, p) { counts[p] } else { length - counts[p] };
        2 * own < length
    };
    let again = |t: &usize| {
        let frame = &frames.as_bytes()[t * bytes..(t + 1) * bytes];
        scan.changes[*t - 1] == 0 && (0..counts.len()).filter(|p| tells(frame, *p)).count() >= PLAIN
    };
    light.iter().flat_map(|r| r.start + 1..r.end).filter(again).collect()
}

#[cfg(test)]
mod tests {
    use super::super::places::put_in;
    use super::*;
    use crate::diagnose::recording::scan::{Look, scan};
    use spikelane::spikes::{Geometry, set_bit};

    /// 16x16 pixels of which the first eight never fire, and every `period`-th of the others at each readout.
    fn shown(period: usize, again: &[usize]) -> Option<Vec<usize>> {
        let geometry = Geometry::new(16, 16).unwrap();
        let mut bytes = vec![0; 400 * geometry.frame_bytes()];
        for (t, frame) in bytes.chunks_exact_mut(geometry.frame_bytes()).enumerate() {
            (8..256).filter(|p| (p + t) % period == 0).for_each(|p| set_bit(frame, p));
        }
        let places = [None, Some(again)];
        put_in(&mut bytes, geometry.frame_bytes(), &places, 0);
        told(geometry, &bytes, &vec![std::iter::once(0..400).collect()])
    }

    fn told(geometry: Geometry, bytes: &[u8], periods: &Periods) -> Option<Vec<usize>> {
        let frames = SpikeFramesRef::new(geometry, bytes).unwrap();
        repeated(frames, &PixelBits::new(frames).unwrap(), &scan(frames, Look::default()).unwrap(), periods)
    }

    #[test]
    fn readouts_that_repeat_the_one_before_are_found_in_every_light() {
        // After two in succession every third pixel fires as it did before them.
        for (period, again) in
            [(3, vec![17, 301]), (5, vec![17, 18, 301]), (60, vec![17, 18]), (120, vec![17, 301])]
        {
            assert_eq!(shown(period, &again), Some(again), "every {period}th");
            assert_eq!(shown(period, &[]), Some(Vec::new()), "every {period}th");
        }
        assert_eq!(shown(1, &[17]), None, "what never changes cannot be told");
    }

    /// Two pixels fire at two of three bright readouts, the others now and then; none does for 60 readouts after the light goes.
    #[test]
    fn silence_after_a_fall_of_the_light_repeats_nothing() {
        let geometry = Geometry::new(16, 16).unwrap();
        let mut bytes = vec![0; 400 * geometry.frame_bytes()];
        for (t, frame) in bytes.chunks_exact_mut(geometry.frame_bytes()).enumerate() {
            let bright = t < 320;
            (0..2).filter(|p| bright && (p + t) % 3 != 0).for_each(|p| set_bit(frame, p));
            (2..256).filter(|p| (bright || t > 380) && (p + t) % 5 == 0).for_each(|p| set_bit(frame, p));
        }
        let lights = |at: usize| vec![std::iter::once(0..at).collect(), std::iter::once(at..400).collect()];
        assert_eq!(told(geometry, &bytes, &lights(320)), Some(Vec::new()));
        let one = told(geometry, &bytes, &vec![std::iter::once(0..400).collect()]).unwrap();
        assert!(one.len() > 50, "taken for one light, the silence looks repeated: {one:?}");
        put_in(&mut bytes, geometry.frame_bytes(), &[None, Some(&[17, 390])], 0);
        assert_eq!(told(geometry, &bytes, &lights(320)), Some(vec![17, 390]), "in both lights");
        assert_eq!(told(geometry, &bytes, &Vec::new()), None, "no light rests");
    }
}
