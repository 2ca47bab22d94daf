//! The division of segments of light into batches.

use crate::kernels::{Segment, SegmentLight};

/// Returns whether a batch ends before a segment of `readouts` readouts although the batch has space for `left` more
/// readouts.
///
/// `most` is the maximum number of readouts of a batch. A split segment pays the cost of its start twice, and a short
/// part of a segment runs at less than full speed. A batch therefore ends early if the segment fits in the next batch
/// and at least half of this batch is full.
pub fn ends_batch_before(readouts: usize, left: usize, most: usize) -> bool {
    readouts > left && readouts <= most && 2 * left <= most
}

/// Divides segments into batches of at most `most` readouts.
pub(super) fn batches<'a>(segments: &[Segment<'a>], most: usize) -> Vec<Vec<Segment<'a>>> {
    let mut all = vec![Vec::new()];
    let mut room = most;
    for segment in segments {
        let mut rest = *segment;
        if ends_batch_before(rest.readouts, room, most) {
            room = 0;
        }
        while rest.readouts > 0 {
            if room == 0 {
                all.push(Vec::new());
                room = most;
            }
            let now = rest.readouts.min(room);
            let (first, later) = split(rest, now);
            if let Some(batch) = all.last_mut() {
                batch.push(first);
            }
            room -= now;
            rest = later;
        }
    }
    all.retain(|batch| !batch.is_empty());
    all
}

/// Splits a segment into its first `at` readouts and the remaining readouts.
fn split(segment: Segment<'_>, at: usize) -> (Segment<'_>, Segment<'_>) {
    let (first, later) = match segment.light {
        SegmentLight::Hold(_) => (segment.light, segment.light),
        SegmentLight::Linear { from, to, weights } => {
            let (a, b) = weights.split_at(at);
            let between = |weights| SegmentLight::Linear { from, to, weights };
            (between(a), between(b))
        }
    };
    (Segment { readouts: at, light: first }, Segment { readouts: segment.readouts - at, light: later })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernels::Samples;

    /// Returns the readouts of each segment in each batch of at most 48 readouts. `frames` contains the readouts of held
    /// frames.
    fn cut(frames: &[usize]) -> Vec<Vec<usize>> {
        let light = SegmentLight::Hold(Samples::U8(&[0]));
        let segments: Vec<_> = frames.iter().map(|&readouts| Segment { readouts, light }).collect();
        batches(&segments, 48).iter().map(|batch| batch.iter().map(|s| s.readouts).collect()).collect()
    }

    #[test]
    fn a_frame_that_does_not_fit_starts_the_next_batch_when_half_a_batch_is_full() {
        assert_eq!(cut(&[20, 20, 20, 20]), [[20, 20], [20, 20]]);
        // The segments are split for one of two reasons: the batch is less than half full, or the segment does not fit
        // in any batch.
        assert_eq!(cut(&[20, 30]), [vec![20, 28], vec![2]]);
        assert_eq!(cut(&[40, 100]), [vec![40, 8], vec![48], vec![44]]);
        assert_eq!(cut(&[48, 0, 1]), [[48], [1]]);
    }
}
