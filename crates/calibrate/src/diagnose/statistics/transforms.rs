//! Fourier transforms that are planned once.

use std::collections::HashMap;
use std::sync::{Arc, LazyLock, Mutex, PoisonError};

use realfft::{RealFftPlanner, RealToComplex};

type Transform = Arc<dyn RealToComplex<f64>>;

/// By the lengths that were planned together: with another plan at hand a planner may take other steps, which round otherwise.
static PLANNED: LazyLock<Mutex<HashMap<Vec<usize>, Vec<Transform>>>> = LazyLock::new(Mutex::default);

/// Transforms of these lengths. Thousands of simulations want the same few, and a plan takes longer than its transform.
pub(in crate::diagnose) fn transforms<const N: usize>(lengths: [usize; N]) -> [Transform; N] {
    let mut planned = PLANNED.lock().unwrap_or_else(PoisonError::into_inner);
    let plan = || {
        let mut planner = RealFftPlanner::new();
        lengths.iter().map(|n| planner.plan_fft_forward(*n)).collect()
    };
    let all = planned.entry(lengths.to_vec()).or_insert_with(plan);
    std::array::from_fn(|i| Arc::clone(&all[i]))
}
