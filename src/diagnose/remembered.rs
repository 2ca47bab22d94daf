//! Vectors that a search has simulated already.
//!
//! Fits from several starts come to one place, a tie is simulated once more with more draws, and every name is looked at again after
//! an exchange. A vector is a function of the camera and the seed alone, so that what is remembered changes no number.

use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};

use nalgebra::DVector;

use crate::effects::Camera;
use crate::error::Result;

/// Most vectors that are kept, some 60 MB of them.
const MOST: usize = 20_000;

/// The number of the draws, and a camera's effects with the bits of their values.
type Key = (usize, Vec<(&'static str, Vec<u64>)>);

#[derive(Debug, Default)]
pub(super) struct Remembered(Mutex<HashMap<Key, DVector<f64>>>);

impl Clone for Remembered {
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl Remembered {
    /// The vector of `camera` with draws number `i` under the one protocol that all asked for have.
    pub fn or(
        &self,
        camera: &Camera,
        i: usize,
        simulate: impl FnOnce() -> Result<DVector<f64>>,
    ) -> Result<DVector<f64>> {
        let bits = |values: &[f64]| values.iter().map(|v| v.to_bits()).collect();
        let key: Key =
            (i, camera.effects().iter().map(|e| (e.definition().name, bits(e.values()))).collect());
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
    use super::*;

    #[test]
    fn only_the_same_camera_with_the_same_draws_is_remembered() {
        let camera = crate::presets::builtin("scsim-code").unwrap();
        let dead = camera.effect("dead_time").unwrap().clone();
        let other = camera.clone().with(dead.with("lost_fraction", 0.0021).unwrap());
        let remembered = Remembered::default();
        let mut made = 0;
        for (camera, i) in [(&camera, 0), (&camera, 0), (&camera, 1), (&other, 0), (&camera, 1)] {
            let mut simulate = || {
                made += 1;
                Ok(DVector::from_element(1, f64::from(made)))
            };
            remembered.or(camera, i, &mut simulate).unwrap();
        }
        assert_eq!(made, 3);
        assert_eq!(remembered.or(&camera, 1, || unreachable!()).unwrap()[0], 2.0);
    }
}
