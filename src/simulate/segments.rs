//! Stretches of light, cut into batches.

use crate::error::{Error, Kind, Result};
use crate::kernels::{Light, Segment};
use crate::simulate::frame::Dense;

/// The segment of a way between frames.
pub(super) fn between<'a>(from: &'a Dense<'_>, to: &'a Dense<'_>, weights: &'a [f32]) -> Result<Segment<'a>> {
    if let Some(outside) = weights.iter().find(|w| !(0.0..=1.0).contains(*w)) {
        return Err(Error::new(Kind::Usage, "weights").found(outside).expected("weights within 0 to 1"));
    }
    let light = Light::Between { from: from.samples(), to: to.samples(), weights };
    Ok(Segment { readouts: weights.len(), light })
}

/// Whether a run that has room for `left` of `most` readouts ends before a segment of `readouts`: one that is cut
/// is begun twice, and its shorter part is run at less than the speed of the whole.
pub fn stops_before(readouts: usize, left: usize, most: usize) -> bool {
    readouts > left && readouts <= most && 2 * left <= most
}

/// Cuts segments into runs of at most `most` readouts.
pub(super) fn batches<'a>(segments: &[Segment<'a>], most: usize) -> Vec<Vec<Segment<'a>>> {
    let mut all = vec![Vec::new()];
    let mut room = most;
    for segment in segments {
        let mut rest = *segment;
        if stops_before(rest.readouts, room, most) {
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

/// The first `at` readouts and the others.
pub(super) fn split(segment: Segment<'_>, at: usize) -> (Segment<'_>, Segment<'_>) {
    let (first, later) = match segment.light {
        Light::Held(_) => (segment.light, segment.light),
        Light::Between { from, to, weights } => {
            let (a, b) = weights.split_at(at);
            let between = |weights| Light::Between { from, to, weights };
            (between(a), between(b))
        }
    };
    (Segment { readouts: at, light: first }, Segment { readouts: segment.readouts - at, light: later })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernels::Samples;

    /// Readouts of each segment of each batch of at most 48, for frames that are held so long.
    fn cut(frames: &[usize]) -> Vec<Vec<usize>> {
        let light = Light::Held(Samples::U8(&[0]));
        let segments: Vec<_> = frames.iter().map(|&readouts| Segment { readouts, light }).collect();
        batches(&segments, 48).iter().map(|batch| batch.iter().map(|s| s.readouts).collect()).collect()
    }

    #[test]
    fn a_frame_that_would_be_cut_begins_the_next_batch_where_half_of_one_is_there() {
        assert_eq!(cut(&[20, 20, 20, 20]), [[20, 20], [20, 20]]);
        // Less than half a batch would be left, or the frame fits none.
        assert_eq!(cut(&[20, 30]), [vec![20, 28], vec![2]]);
        assert_eq!(cut(&[40, 100]), [vec![40, 8], vec![48], vec![44]]);
        assert_eq!(cut(&[48, 0, 1]), [[48], [1]]);
    }
}
