//! Vectors that a search has simulated already.
//!
//! Fits from several starts come to one place, a tie is simulated once more with more draws, and every name is looked at again after
//! an exchange. A vector is a function of the camera and the seed alone, so that what is remembered changes no number.

use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};

use nalgebra::DVector;

use super::sample::Sample;
use spikelane::error::Result;

/// Most vectors that are kept, some 60 MB of them.
const MOST: usize = 20_000;

/// The number of the draws, that of the readouts that are lost or repeated for certain, the light of each recording, and a
/// camera's effects with the bits of their values.
type Key = (usize, u64, Vec<u64>, Vec<(&'static str, Vec<u64>)>);

#[derive(Debug, Default)]
pub(in crate::diagnose) struct Remembered(Mutex<HashMap<Key, DVector<f64>>>);

impl Clone for Remembered {
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl Remembered {
    /// The vector of `sample` with draws number `i` under the one protocol that all asked for have.
    pub(crate) fn or(
        &self,
        sample: &Sample,
        i: usize,
        simulate: impl FnOnce() -> Result<DVector<f64>>,
    ) -> Result<DVector<f64>> {
        let bits = |values: &[f64]| values.iter().map(|v| v.to_bits()).collect::<Vec<u64>>();
        let effects = sample.camera.effects().iter().map(|e| (e.definition().name, bits(e.values())));
        let key: Key = (i, sample.pinned.id(), bits(&sample.lamps), effects.collect());
        if let Some(vector) = self.all().get(&key) {
            return Ok(vector.clone());
        }
        let vector = simulate()?;
        let mut all = self.all();
        if all.len() >= MOST {
            all.clear();
        }
        all.insert(key, vector.clone());
        Ok(vector)
    }

    /// A thread that panicked left whole entries or none.
    fn all(&self) -> std::sync::MutexGuard<'_, HashMap<Key, DVector<f64>>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::super::context::SimulationContext;
    use super::super::fixed::Pinned;
    use super::*;
    use crate::diagnose::events::located::Located;
    use spikelane::effects::Camera;

    #[test]
    fn only_the_same_camera_with_the_same_draws_is_remembered() {
        let camera = spikelane::presets::builtin("scsim-code").unwrap();
        let dead = camera.effect(spikelane::effects::dead_time::EFFECT.name).unwrap().clone();
        let other = camera.clone().with_effect(dead.with_value("lost_fraction", 0.0021).unwrap());
        let lost = |at: usize| Arc::new(Located(vec![[Some(vec![at]), None]]));
        let pinned =
            |at: usize| Pinned::new(&lost(at), [&spikelane::effects::dropped_readouts::EFFECT].into_iter());
        let of = |camera: &Camera, pinned| Sample {
            camera: camera.clone(),
            lamps: Vec::new(),
            pinned,
            context: SimulationContext::default(),
        };
        let [plain, other] = [&camera, &other].map(|c| of(c, Pinned::default()));
        let [early, late] = [7, 8].map(|at| of(&camera, pinned(at)));
        let remembered = Remembered::default();
        let mut made = 0;
        let asked = [
            (&plain, 0),
            (&plain, 0),
            (&plain, 1),
            (&other, 0),
            (&plain, 1),
            (&early, 0),
            (&late, 0),
            (&early, 0),
        ];
        for (sample, i) in asked {
            let mut simulate = || {
                made += 1;
                Ok(DVector::from_element(1, f64::from(made)))
            };
            remembered.or(sample, i, &mut simulate).unwrap();
        }
        assert_eq!(made, 5);
        assert_eq!(remembered.or(&plain, 1, || unreachable!()).unwrap()[0], 2.0);
    }
}
