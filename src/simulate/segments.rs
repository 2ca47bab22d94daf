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
pub(super) fn stops_before(readouts: usize, left: usize, most: usize) -> bool {
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
