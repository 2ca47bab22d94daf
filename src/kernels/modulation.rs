//! Values that differ between readouts but are equal for all tiles of a batch.

use crate::draws::gauss;
use crate::draws::hash::{CounterRng, RoundKey, address_key, hash_bits, pixel_half};
use crate::plan::{Dynamics, Plan, SimulatorState};

/// The factors, offsets and round keys of a batch. A field is empty if the plan does not use it.
#[derive(Clone, Debug, Default)]
pub struct Modulation {
    /// Factor by which the light of each readout is multiplied.
    pub light_factors: Vec<f32>,
    /// Offset of the thresholds of each row, relative to the threshold. The vector contains one value per row for each
    /// readout.
    pub row_offsets: Vec<f32>,
    /// Round keys of the draws for [`Modulation::row_offsets`]. The address of such a draw is the row.
    pub row_noise: Vec<RoundKey>,
    /// Round keys of [`crate::plan::NoiseRngs::comparator_noise`].
    pub comparator_noise: Vec<RoundKey>,
    /// Round keys of [`crate::plan::NoiseRngs::slow_noise`].
    pub slow_noise: Vec<RoundKey>,
    /// Round keys of [`crate::plan::NoiseRngs::telegraph`].
    pub telegraph: [Vec<RoundKey>; 2],
    /// Influence of the spikes before the first readout on the first readout.
    pub feedback: SpikeFeedback,
}

/// The influence of the spikes of one readout on the next readout.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SpikeFeedback {
    /// Number of fired neighbors of every pixel, padded. The vector is empty if the plan has no spike coupling.
    pub fired_neighbors: Vec<i16>,
    /// Offset of all thresholds, relative to the threshold.
    pub droop: f32,
}

impl Modulation {
    pub(super) fn new(plan: &Plan, first: u64, readouts: usize) -> Self {
        let Some(dynamics) = plan.dynamics() else { return Self::default() };
        let rngs = plan.rngs();
        let words = |rng: CounterRng, wanted: bool| -> Vec<RoundKey> {
            let count = if wanted { readouts as u64 } else { 0 };
            (0..count).map(|t| rng.round_key(first.wrapping_add(t))).collect()
        };
        let row = words(rngs.row_noise, dynamics.row_noise != 0.0);
        let factors = dynamics.schedule.map(|schedule| {
            let factor = |t| schedule.factor(first.wrapping_add(t)) as f32;
            (0..readouts as u64).map(factor).collect()
        });
        Self {
            light_factors: factors.unwrap_or_default(),
            row_offsets: row.iter().flat_map(|round| row_offsets(dynamics, *round)).collect(),
            row_noise: row,
            comparator_noise: words(rngs.comparator_noise, dynamics.comparator_noise != 0.0),
            slow_noise: words(rngs.slow_noise, dynamics.slow_noise.is_some()),
            telegraph: rngs.telegraph.map(|rng| words(rng, dynamics.telegraph.is_some())),
            ..Self::default()
        }
    }

    /// Adds the influence of the spikes before the first readout.
    pub(super) fn add_feedback(&mut self, plan: &Plan, state: &SimulatorState) {
        let Some(dynamics) = plan.dynamics().filter(|f| f.has_coupled_pixels()) else { return };
        self.feedback.update(plan, dynamics, &state.fired);
    }
}

impl SpikeFeedback {
    /// Computes the influence of the spikes of one readout on the next readout. `fired` is padded and contains -1 for
    /// each spike.
    #[inline(always)]
    pub(super) fn update(&mut self, plan: &Plan, dynamics: &Dynamics, fired: &[i16]) {
        let geometry = plan.geometry();
        let padded = fired.len();
        let fired = &fired[..geometry.pixels()];
        if dynamics.droop != 0.0 {
            let spikes: i32 = fired.iter().map(|&f| -i32::from(f)).sum();
            self.droop = -(dynamics.droop * (spikes as f32 / geometry.pixels() as f32));
        }
        if dynamics.coupling != 0.0 {
            self.fired_neighbors.resize(padded, 0);
            count_fired_neighbors(fired, geometry.width(), &mut self.fired_neighbors[..geometry.pixels()]);
        }
    }
}

fn row_offsets(dynamics: &Dynamics, round: RoundKey) -> impl Iterator<Item = f32> {
    let offset = move |row: usize| {
        f32::from(gauss::draw(pixel_half(hash_bits(address_key(row as u32 / 2), round), row)))
            * dynamics.row_noise
    };
    (0..dynamics.height()).map(offset)
}

/// Counts the neighbors above, below, left and right of each pixel that have fired. In `fired`, a spike is -1.
#[inline(always)]
fn count_fired_neighbors(fired: &[i16], width: usize, counts: &mut [i16]) {
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

/// Adds the spikes of one neighbor of each pixel.
///
/// Each of the four neighbors has a separate loop over the pixels. In a loop for two neighbors, the second addition
/// would wait for the first addition.
#[inline(always)]
fn add(counts: &mut [i16], fired: &[i16]) {
    counts.iter_mut().zip(fired).for_each(|(count, f)| *count -= f);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fired_neighbors_are_counted_up_to_the_border() {
        let neighbors = |fired: &[i16], width: usize| {
            let mut counts = vec![7; fired.len()];
            count_fired_neighbors(fired, width, &mut counts);
            counts
        };
        // In a 3x3 sensor, the pixel in a corner and the pixel in the center fire.
        let fired = [-1, 0, 0, 0, -1, 0, 0, 0, 0];
        assert_eq!(neighbors(&fired, 3), [0, 2, 0, 2, 0, 1, 0, 1, 0]);
        assert_eq!(neighbors(&[-1, -1, 0], 3), [1, 1, 1]);
        assert_eq!(neighbors(&[-1, -1, 0], 1), [1, 1, 1]);
    }
}
