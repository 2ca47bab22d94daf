//! What moves from readout to readout, the same for all tiles of a batch.

use crate::draws::gauss;
use crate::draws::hash::{Clock, Round, bits, half, key};
use crate::plan::{Moving, Plan, State};

/// Factors, offsets and hash words; each is empty unless the plan asks for it.
#[derive(Clone, Debug, Default)]
pub struct Modulation {
    /// Factor on the light.
    pub factors: Vec<f32>,
    /// Offset of every row's thresholds, relative to them; the rows of a readout follow each other.
    pub rows: Vec<f32>,
    /// Words behind [`Modulation::rows`], addressed by the row.
    pub row: Vec<Round>,
    /// Of [`crate::plan::Clocks::comparator`].
    pub comparator: Vec<Round>,
    /// Of [`crate::plan::Clocks::slow`].
    pub slow: Vec<Round>,
    /// Of [`crate::plan::Clocks::telegraph`].
    pub telegraph: [Vec<Round>; 2],
    /// What the spikes before the first readout do to it.
    pub around: Around,
}

/// What the spikes of one readout do to the next.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Around {
    /// Neighbours of every pixel that fired, padded; empty unless the plan asks for it.
    pub neighbours: Vec<i16>,
    /// Offset of all thresholds, relative to them.
    pub droop: f32,
}

impl Modulation {
    pub(super) fn new(plan: &Plan, first: u64, readouts: usize) -> Self {
        let Some(moving) = plan.moving() else { return Self::default() };
        let clocks = plan.clocks();
        let words = |clock: Clock, wanted: bool| -> Vec<Round> {
            let count = if wanted { readouts as u64 } else { 0 };
            (0..count).map(|t| clock.round(first.wrapping_add(t))).collect()
        };
        let row = words(clocks.row, moving.row_noise != 0.0);
        let factors = moving.schedule.map(|schedule| {
            let factor = |t| schedule.factor(first.wrapping_add(t)) as f32;
            (0..readouts as u64).map(factor).collect()
        });
        Self {
            factors: factors.unwrap_or_default(),
            rows: row.iter().flat_map(|round| rows(moving, *round)).collect(),
            row,
            comparator: words(clocks.comparator, moving.comparator != 0.0),
            slow: words(clocks.slow, moving.slow.is_some()),
            telegraph: clocks.telegraph.map(|clock| words(clock, moving.telegraph.is_some())),
            ..Self::default()
        }
    }

    /// Adds what the spikes of the readout before do to the next.
    pub(super) fn couple(&mut self, plan: &Plan, state: &State) {
        let Some(moving) = plan.moving().filter(|f| f.couples()) else { return };
        self.around.follow(plan, moving, &state.fired);
    }
}

impl Around {
    /// Looks at the spikes of a readout (-1 is one), padded.
    #[inline(always)]
    pub(super) fn follow(&mut self, plan: &Plan, moving: &Moving, fired: &[i16]) {
        let geometry = plan.geometry();
        let padded = fired.len();
        let fired = &fired[..geometry.pixels()];
        if moving.droop != 0.0 {
            let spikes: i32 = fired.iter().map(|&f| -i32::from(f)).sum();
            self.droop = -(moving.droop * (spikes as f32 / geometry.pixels() as f32));
        }
        if moving.coupling != 0.0 {
            self.neighbours.resize(padded, 0);
            count_neighbours(fired, geometry.width(), &mut self.neighbours[..geometry.pixels()]);
        }
    }
}

fn rows(moving: &Moving, round: Round) -> impl Iterator<Item = f32> {
    let offset = move |row: usize| {
        f32::from(gauss::unit(half(bits(key(row as u32 / 2), round), row))) * moving.row_noise
    };
    (0..moving.height()).map(offset)
}

/// How many of the pixels above, below, left and right have fired (-1 is a spike).
#[inline(always)]
fn count_neighbours(fired: &[i16], width: usize, counts: &mut [i16]) {
    counts.fill(0);
    for (p, row) in fired.chunks_exact(width).enumerate().map(|(r, row)| (r * width, row)) {
        let here = &mut counts[p..p + width];
        add(&mut here[1..], row);
        add(here, &row[1..]);
        if p > 0 {
            add(here, &fired[p - width..p]);
        }
        if p + width < fired.len() {
            add(here, &fired[p + width..]);
        }
    }
}

/// One loop for one neighbour: both sides in one loop wait for each other's sums.
#[inline(always)]
fn add(counts: &mut [i16], fired: &[i16]) {
    counts.iter_mut().zip(fired).for_each(|(count, f)| *count -= f);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_are_counted_up_to_the_border() {
        let neighbours = |fired: &[i16], width: usize| {
            let mut counts = vec![7; fired.len()];
            count_neighbours(fired, width, &mut counts);
            counts
        };
        // A spike in the corner of 3x3, and one in the middle.
        let fired = [-1, 0, 0, 0, -1, 0, 0, 0, 0];
        assert_eq!(neighbours(&fired, 3), [0, 2, 0, 2, 0, 1, 0, 1, 0]);
        assert_eq!(neighbours(&[-1, -1, 0], 3), [1, 1, 1]);
        assert_eq!(neighbours(&[-1, -1, 0], 1), [1, 1, 1]);
    }
}
