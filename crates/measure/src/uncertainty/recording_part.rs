//! Measures a part of a recording together with the whole recording.

use crate::{Accumulator, Counts, Intervals, Statistics};

/// Kinds of parts. At most one part of each kind can be open at a time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum RecordingPart {
    Half,
    Quarter,
}

/// Begins a part of the recording at the next readout. The function has no effect if `accumulator` does not measure
/// intervals.
pub(super) fn begin(accumulator: &mut Accumulator, part: RecordingPart) {
    flush(accumulator);
    if let Some(state) = &mut accumulator.intervals {
        state.begin_part(part as usize);
    }
}

/// Ends a part at the last readout that was pushed. Returns `None` if the part never began.
///
/// The result contains the intervals of the part, without the histogram of lengths and without the extremes. It also
/// contains the counts of the part, without coincidences.
pub(super) fn end(accumulator: &mut Accumulator, part: RecordingPart) -> Option<Statistics> {
    flush(accumulator);
    let intervals = accumulator.intervals.as_mut()?.end_part(part as usize)?;
    Some(Statistics {
        geometry: accumulator.geometry,
        rows: accumulator.rows.clone(),
        readouts: intervals.readouts(),
        counts: Some(interval_counts(&intervals)),
        frames: None,
        intervals: Some(intervals),
        counts_before_split: None,
    })
}

fn flush(accumulator: &mut Accumulator) {
    if accumulator.intervals.is_some() && accumulator.block.len() > 0 {
        accumulator.process();
    }
}

/// Returns the counts that can be computed from the intervals.
fn interval_counts(intervals: &Intervals) -> Counts {
    let (first, last) = intervals.first_and_last_spikes().unzip();
    Counts {
        geometry: intervals.geometry,
        rows: intervals.rows.clone(),
        readouts: intervals.readouts(),
        count: intervals.spikes().collect(),
        first_spike: first,
        last_spike: last,
        coincidences: Default::default(),
    }
}
