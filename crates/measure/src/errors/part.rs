//! A part of what an accumulator of intervals takes, measured along with the whole.

use crate::{Accumulator, Counts, Intervals, Statistics};

/// Parts that may be open at a time, each of which begins and ends on its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Part {
    Half,
    Quarter,
}

/// Begins a part at the next readout of `whole`. Nothing happens where it measures no intervals.
pub(super) fn begin(whole: &mut Accumulator, part: Part) {
    flush(whole);
    if let Some(state) = &mut whole.intervals {
        state.begin_part(part as usize);
    }
}

/// Ends a part with the last readout that was pushed: its intervals, without the histogram of lengths and the extremes, and what
/// they tell of its counts, without coincidences. `None` where it never began.
pub(super) fn end(whole: &mut Accumulator, part: Part) -> Option<Statistics> {
    flush(whole);
    let intervals = whole.intervals.as_mut()?.end_part(part as usize)?;
    Some(Statistics {
        geometry: whole.geometry,
        rows: whole.rows.clone(),
        readouts: intervals.readouts(),
        counts: Some(counts(&intervals)),
        frames: None,
        intervals: Some(intervals),
        early_count: None,
    })
}

fn flush(whole: &mut Accumulator) {
    if whole.intervals.is_some() && whole.block.len() > 0 {
        whole.process();
    }
}

/// The counts that a pixel's intervals tell.
fn counts(intervals: &Intervals) -> Counts {
    let (first, last) = intervals.ends().unzip();
    Counts {
        geometry: intervals.geometry,
        rows: intervals.rows.clone(),
        readouts: intervals.readouts(),
        count: intervals.spikes().collect(),
        first,
        last,
        coincidences: Default::default(),
    }
}
