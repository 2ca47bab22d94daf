//! Simulated vectors in memory.
//!
//! A search simulates the same camera several times. Fits from several starts converge to one point. Tied effects
//! are simulated again with more draws. Replaced effects are tested again. A vector depends only on the camera, the
//! lamps, the located events and the seed, so the memory does not change any result.

use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};

use crate::sensors::model::Sample;
use nalgebra::DVector;
use spikelane::error::Result;

/// Largest number of stored vectors, which take about 60 MB.
const MAX_VECTORS: usize = 20_000;

/// Number of the draws, hash of the located events, light of each recording, and effects with the bits of their
/// values.
type Key = (usize, u64, Vec<u64>, Vec<(&'static str, Vec<u64>)>);

#[derive(Debug, Default)]
pub(crate) struct SimulationMemory(Mutex<HashMap<Key, DVector<f64>>>);

impl Clone for SimulationMemory {
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl SimulationMemory {
    /// Returns the vector of `sample` with the draws of number `i`. If the memory does not contain it, `simulate`
    /// computes it. All calls must use the same protocol.
    pub(crate) fn get_or_simulate(
        &self,
        sample: &Sample,
        i: usize,
        simulate: impl FnOnce() -> Result<DVector<f64>>,
    ) -> Result<DVector<f64>> {
        let bits = |values: &[f64]| values.iter().map(|v| v.to_bits()).collect::<Vec<u64>>();
        let effects = sample.camera.effects().iter().map(|e| (e.definition().name, bits(e.values())));
        let key: Key = (i, sample.pinned.id(), bits(&sample.lamps), effects.collect());
        if let Some(vector) = self.lock().get(&key) {
            return Ok(vector.clone());
        }
        let vector = simulate()?;
        let mut all = self.lock();
        if all.len() >= MAX_VECTORS {
            all.clear();
        }
        all.insert(key, vector.clone());
        Ok(vector)
    }

    /// A lock is valid even if another thread panicked, because each entry is inserted at once.
    fn lock(&self) -> std::sync::MutexGuard<'_, HashMap<Key, DVector<f64>>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::events::locations::{LocatedEvents, PinnedEvents};
    use crate::sensors::deadline::SimulationContext;
    use spikelane::effects::Camera;

    #[test]
    fn only_equal_cameras_and_draws_share_a_vector() {
        let camera = spikelane::presets::builtin("scsim-code").unwrap();
        let dead = camera.effect(spikelane::effects::dead_time::EFFECT.name).unwrap().clone();
        let other = camera.clone().with_effect(dead.with_value("lost_fraction", 0.0021).unwrap());
        let lost = |at: usize| Arc::new(LocatedEvents(vec![[Some(vec![at]), None]]));
        let pinned = |at: usize| {
            PinnedEvents::new(&lost(at), [&spikelane::effects::dropped_readouts::EFFECT].into_iter())
        };
        let of = |camera: &Camera, pinned| Sample {
            camera: camera.clone(),
            lamps: Vec::new(),
            pinned,
            context: SimulationContext::default(),
        };
        let [plain, other] = [&camera, &other].map(|c| of(c, PinnedEvents::default()));
        let [early, late] = [7, 8].map(|at| of(&camera, pinned(at)));
        let memory = SimulationMemory::default();
        let mut made = 0;
        let calls = [
            (&plain, 0),
            (&plain, 0),
            (&plain, 1),
            (&other, 0),
            (&plain, 1),
            (&early, 0),
            (&late, 0),
            (&early, 0),
        ];
        for (sample, i) in calls {
            let mut simulate = || {
                made += 1;
                Ok(DVector::from_element(1, f64::from(made)))
            };
            memory.get_or_simulate(sample, i, &mut simulate).unwrap();
        }
        assert_eq!(made, 5);
        assert_eq!(memory.get_or_simulate(&plain, 1, || unreachable!()).unwrap()[0], 2.0);
    }
}
