//! Repeated readouts, located by pixels that never have the same bit at two successive readouts otherwise.

use std::ops::Range;

use crate::events::lost_readouts::LightPeriods;
use crate::recordings::bits::{PixelBits, count_between};
use crate::recordings::scan::Scan;
use crate::thresholds::{MIN_MEAN_CHANGES, MIN_UNUSUAL_PIXELS};
use spikelane::spikes::{SpikeFramesRef, bit};

/// Locates the readouts that repeat the previous readout under the same light. Returns `None` if few bits change
/// per readout, or if the light is never constant.
pub(crate) fn locate_repeated(
    frames: SpikeFramesRef<'_>,
    bits: &PixelBits,
    scan: &Scan,
    periods: &LightPeriods,
) -> Option<Vec<usize>> {
    let changes = scan.changes.iter().map(|c| f64::from(*c)).sum::<f64>() / scan.changes.len().max(1) as f64;
    if changes < MIN_MEAN_CHANGES || periods.is_empty() {
        return None;
    }
    let mut all: Vec<usize> =
        periods.iter().flat_map(|light| repeated_under_light(frames, bits, scan, light)).collect();
    all.sort_unstable();
    Some(all)
}

/// Locates repeated readouts under one light.
///
/// A pixel that fires at fewer than half of the readouts does not fire at two successive readouts. A pixel that
/// fires at more than half does not pause at two successive readouts. Such an unusual repetition is evidence for a
/// repeated readout. Other repetitions are not evidence. For example, a dead pixel never fires, and after a fall of
/// the light no pixel may fire for some time.
fn repeated_under_light(
    frames: SpikeFramesRef<'_>,
    bits: &PixelBits,
    scan: &Scan,
    light: &[Range<usize>],
) -> Vec<usize> {
    let length: usize = light.iter().map(Range::len).sum();
    let count = |p: usize| light.iter().map(|r| count_between(bits.pixel(p), r.start, r.end) as usize).sum();
    let counts: Vec<usize> = (0..scan.pixels.len()).map(count).collect();
    let bytes = scan.geometry.frame_bytes();
    let is_unusual = |frame: &[u8], p: usize| {
        let like = if bit(frame, p) { counts[p] } else { length - counts[p] };
        2 * like < length
    };
    let is_repeated = |t: &usize| {
        let frame = &frames.as_bytes()[t * bytes..(t + 1) * bytes];
        scan.changes[*t - 1] == 0
            && (0..counts.len()).filter(|p| is_unusual(frame, *p)).count() >= MIN_UNUSUAL_PIXELS
    };
    light.iter().flat_map(|r| r.start + 1..r.end).filter(is_repeated).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::events::locations::apply_events;
    use crate::recordings::scan::{ScanOptions, scan};
    use spikelane::spikes::{Geometry, set_bit};

    /// Locates repeated readouts in 16x16 simulated pixels. The first eight pixels never fire. At each readout,
    /// every `period`-th of the other pixels fires. `again` contains the readouts that are repeated.
    fn locate_in_pattern(period: usize, again: &[usize]) -> Option<Vec<usize>> {
        let geometry = Geometry::new(16, 16).unwrap();
        let mut bytes = vec![0; 400 * geometry.frame_bytes()];
        for (t, frame) in bytes.chunks_exact_mut(geometry.frame_bytes()).enumerate() {
            (8..256).filter(|p| (p + t) % period == 0).for_each(|p| set_bit(frame, p));
        }
        let places = [None, Some(again)];
        apply_events(&mut bytes, geometry.frame_bytes(), &places, 0);
        locate(geometry, &bytes, &vec![std::iter::once(0..400).collect()])
    }

    fn locate(geometry: Geometry, bytes: &[u8], periods: &LightPeriods) -> Option<Vec<usize>> {
        let frames = SpikeFramesRef::new(geometry, bytes).unwrap();
        locate_repeated(
            frames,
            &PixelBits::new(frames).unwrap(),
            &scan(frames, ScanOptions::default()).unwrap(),
            periods,
        )
    }

    #[test]
    fn repeated_readouts_are_located_at_every_light() {
        // After two successive repetitions, the pattern with period 3 equals the pattern before them.
        for (period, again) in
            [(3, vec![17, 301]), (5, vec![17, 18, 301]), (60, vec![17, 18]), (120, vec![17, 301])]
        {
            assert_eq!(locate_in_pattern(period, &again), Some(again), "every {period}th");
            assert_eq!(locate_in_pattern(period, &[]), Some(Vec::new()), "every {period}th");
        }
        assert_eq!(locate_in_pattern(1, &[17]), None, "constant bits");
    }

    /// While the light is bright, two pixels fire at two of three readouts, and the others fire at one of five.
    /// After the fall of the light, no pixel fires for 60 readouts.
    #[test]
    fn silence_after_a_fall_is_not_a_repetition() {
        let geometry = Geometry::new(16, 16).unwrap();
        let mut bytes = vec![0; 400 * geometry.frame_bytes()];
        for (t, frame) in bytes.chunks_exact_mut(geometry.frame_bytes()).enumerate() {
            let bright = t < 320;
            (0..2).filter(|p| bright && (p + t) % 3 != 0).for_each(|p| set_bit(frame, p));
            (2..256).filter(|p| (bright || t > 380) && (p + t) % 5 == 0).for_each(|p| set_bit(frame, p));
        }
        let lights = |at: usize| vec![std::iter::once(0..at).collect(), std::iter::once(at..400).collect()];
        assert_eq!(locate(geometry, &bytes, &lights(320)), Some(Vec::new()));
        let one = locate(geometry, &bytes, &vec![std::iter::once(0..400).collect()]).unwrap();
        assert!(one.len() > 50, "one light: {one:?}");
        apply_events(&mut bytes, geometry.frame_bytes(), &[None, Some(&[17, 390])], 0);
        assert_eq!(locate(geometry, &bytes, &lights(320)), Some(vec![17, 390]), "in both lights");
        assert_eq!(locate(geometry, &bytes, &Vec::new()), None, "no constant light");
    }
}
