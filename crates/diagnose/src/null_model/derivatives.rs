//! Derivatives of the statistics by the base parameters and by the lamps.

use std::collections::BTreeSet;
use std::ops::Range;
use std::sync::atomic::AtomicUsize;

use crate::light::lamp::Lamp;
use crate::null_model::progress::count;
use crate::null_model::vectors::{average, matrix, shrink};
use crate::recordings::scan::Scan;
use crate::recordings::setup::Setup;
use crate::sensors::model::{Knob, Model, find_base_knob};
use crate::sensors::simulate;
use crate::statistics::measured_set::statistics_vector;
use crate::thresholds::{LAMP_STEP, MANY_PIXELS, MAX_DERIVATIVE_PAIRS, USUAL_PIXELS};
use nalgebra::{DMatrix, DVector};
use spikelane::error::Result;
use spikelane::unstable::threads;

pub(crate) fn pairs(setup: &Setup) -> usize {
    let pixels = setup.geometry.pixels();
    if pixels >= MANY_PIXELS.0 {
        return MANY_PIXELS.1;
    }
    (USUAL_PIXELS.1 * USUAL_PIXELS.0 / pixels.max(1)).clamp(USUAL_PIXELS.1, MAX_DERIVATIVE_PAIRS)
}

/// Returns the step of the derivative by a base parameter, relative to its value.
pub(crate) fn step(knob: &Knob) -> f64 {
    find_base_knob(knob).map_or(0.2, |number| number.step)
}

/// A simulated sensor of the base model: its vector, and the derivative of the vector by the relative light of each
/// lit recording.
pub(crate) struct SimulatedVectors {
    pub vector: DVector<f64>,
    pub lamps: Vec<DVector<f64>>,
}

/// Returns the indices of the lit recordings in ascending order.
pub(crate) fn lit(model: &Model) -> Vec<usize> {
    let all = model.lamps.iter().flat_map(|lamp| lamp.shares.iter().map(|(k, _)| *k));
    all.collect::<BTreeSet<usize>>().into_iter().collect()
}

/// Simulates the vector of a sensor and its derivatives by the relative light of each lit recording. Each
/// derivative requires a new simulation of one recording only. If all vectors are cached, nothing is simulated.
pub(crate) fn with_lamps(setup: &Setup, model: &Model, seed: u64) -> Result<SimulatedVectors> {
    let still = model.sample(&[], &[])?;
    if model.lamps.is_empty() {
        return Ok(SimulatedVectors { vector: simulate::values(setup, &still, seed)?, lamps: Vec::new() });
    }
    let mut scanned: Option<Vec<Scan>> = None;
    let plain = simulate::cached_or(setup, &still, seed, || {
        let scans = scanned.insert(simulate::scans(setup, &still, seed)?);
        Ok(statistics_vector(setup, scans).values)
    })?;
    let mut lamps = Vec::new();
    for k in lit(model) {
        let mut moved = still.clone();
        moved.lamps[k] += LAMP_STEP;
        let values = simulate::cached_or(setup, &moved, seed, || {
            let scans = match &mut scanned {
                Some(scans) => scans,
                None => scanned.insert(simulate::scans(setup, &still, seed)?),
            };
            let own = std::mem::replace(&mut scans[k], simulate::scan_of_recording(setup, &moved, k, seed)?);
            let values = statistics_vector(setup, scans).values;
            scans[k] = own;
            Ok(values)
        })?;
        lamps.push((values - &plain) / LAMP_STEP);
    }
    Ok(SimulatedVectors { vector: plain, lamps })
}

/// Returns the derivatives of the statistics by the deviation of each lamp. Each element of `all` belongs to one
/// simulation and contains the derivatives by the relative light of each lit recording.
pub(crate) fn slopes_of_lamps(all: &[Vec<DVector<f64>>], model: &Model, entries: usize) -> DMatrix<f64> {
    let lit = lit(model);
    let of_recording = |i: usize| average(&all.iter().map(|c| c[i].clone()).collect::<Vec<_>>());
    let of_recordings: Vec<DVector<f64>> = (0..lit.len()).map(of_recording).collect();
    let column = |lamp: &Lamp| {
        let of_share = |(k, share): &(usize, f64)| {
            lit.iter().position(|own| own == k).map(|i| &of_recordings[i] * *share)
        };
        lamp.shares
            .iter()
            .filter_map(of_share)
            .reduce(|a, b| a + b)
            .unwrap_or_else(|| DVector::zeros(entries))
    };
    matrix(&model.lamps.iter().map(column).collect::<Vec<_>>(), entries)
}

/// Returns the changes of the vector by one step of each base parameter, for the draws with the numbers `seeds`.
/// `baseline` contains the vectors without the step.
pub(crate) fn changes(
    setup: &Setup,
    model: &Model,
    seed: u64,
    baseline: &[DVector<f64>],
    seeds: Range<usize>,
    done: &AtomicUsize,
) -> Result<Changes> {
    let n = model.knobs.len();
    let one = |j: usize| -> Result<Vec<DVector<f64>>> {
        let sample = model.sample(&stepped(model, j), &[])?;
        let change = |i: usize| -> Result<DVector<f64>> {
            let values = simulate::values(setup, &sample, seed + i as u64)?;
            count(done);
            Ok(values - &baseline[i])
        };
        threads::try_map(seeds.clone(), change)
    };
    Ok(Changes(threads::try_map(0..n, one)?))
}

fn stepped(model: &Model, j: usize) -> Vec<f64> {
    let mut u = vec![0.0; model.knobs.len()];
    u[j] = step(&model.knobs[j]);
    u
}

/// Changes of the vector by one step of each base parameter. The first index is the parameter, and the second index
/// is the simulation.
#[derive(Clone, Debug, Default)]
pub(crate) struct Changes(Vec<Vec<DVector<f64>>>);

impl Changes {
    /// Returns the number of simulations per parameter.
    pub(crate) fn count(&self) -> usize {
        self.0.first().map_or(0, Vec::len)
    }

    /// Adds the changes of further seeds.
    pub(crate) fn extend(&mut self, more: Self) {
        if self.0.is_empty() {
            self.0 = more.0;
            return;
        }
        self.0.iter_mut().zip(more.0).for_each(|(own, more)| own.extend(more));
    }

    /// Returns the derivatives of the statistics by each base knob.
    pub(crate) fn jacobian(&self, model: &Model, spread: &[f64]) -> DMatrix<f64> {
        let column = |(j, all): (usize, &Vec<DVector<f64>>)| {
            shrink(average(all), spread, all.len()) / step(&model.knobs[j])
        };
        matrix(&self.0.iter().enumerate().map(column).collect::<Vec<_>>(), spread.len())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recordings::recorded_scene::RecordedScene;
    use spikelane::spikes::Geometry;
    use spikelane_calibrate::Stimulus;

    /// The cache stores the vector of a moved lamp under its sample. The vector must therefore equal a simulation
    /// of all recordings of this sample.
    #[test]
    fn a_lamp_moves_its_own_recording_as_a_simulation_of_all_says() {
        let scene = |light| RecordedScene {
            name: String::new(),
            light: Stimulus::Level(light),
            readouts: 256,
            first_readout: 0,
            static_scene: None,
            light_uncertainty: 0.01,
            sources: spikelane_calibrate::unstable::Sources::default(),
            light_offset: 0.0,
        };
        let setup = Setup {
            geometry: Geometry::new(16, 16).unwrap(),
            readout_hz: 20_000.0,
            recordings: [0.0, 0.1, 0.3, 0.6].map(scene).into(),
            has_rate_maps: false,
            row_band: None,
            judged_readouts: None,
        };
        let model = Model::base(spikelane::presets::builtin("scsim-code").unwrap(), &setup);
        let drawn = with_lamps(&setup, &model, 3).unwrap();
        let lit = lit(&model);
        assert_eq!((lit.as_slice(), drawn.lamps.len()), ([1, 2, 3].as_slice(), 3));
        for (k, change) in lit.iter().zip(&drawn.lamps) {
            let mut moved = model.sample(&[], &[]).unwrap();
            moved.lamps[*k] += LAMP_STEP;
            let values = simulate::values(&setup, &moved, 3).unwrap();
            assert_eq!(*change, (values - &drawn.vector) / LAMP_STEP);
            assert!(change.amax() > 0.0, "recording {k}");
        }
    }
}
