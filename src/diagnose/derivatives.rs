//! What the base model's numbers and the lamps move.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::model::{LAMP, Model};
use super::quiet::quiet;
use super::reference::average;
use super::setup::Setup;
use super::vector::vector;
use crate::error::Result;

/// Simulations for a derivative, on a small sensor and on one of this many pixels, where each tells as much as several.
const DERIVATIVE: [usize; 2] = [16, 8];
const LARGE: usize = 20_000;

fn pairs(setup: &Setup) -> usize {
    DERIVATIVE[usize::from(setup.geometry.pixels() >= LARGE)]
}

/// Steps for derivatives of base knobs, relative to their values.
const STEP: f64 = 0.05;

pub(super) fn base_jacobian(
    setup: &Setup,
    model: &Model,
    seed: u64,
    baseline: &[DVector<f64>],
    spread: &[f64],
) -> Result<DMatrix<f64>> {
    let n = model.knobs.len();
    let one = |j: usize| -> Result<DVector<f64>> {
        let mut u = vec![0.0; n];
        // The mean gain moves every lattice of intervals; a small step keeps them in place.
        u[j] = if model.knobs[j].key == "mean" { 0.2 * STEP } else { STEP };
        let sample = model.sample(&u, &[], setup.scenes.len())?;
        let change = |i: usize| -> Result<DVector<f64>> {
            Ok(DVector::from_vec(setup.values(&sample, seed + i as u64)?) - &baseline[i])
        };
        let all = (0..pairs(setup)).into_par_iter().map(change).collect::<Result<Vec<_>>>()?;
        Ok(quiet(average(&all), spread, all.len()) / u[j])
    };
    let columns = (0..n).into_par_iter().map(one).collect::<Result<Vec<_>>>()?;
    Ok(DMatrix::from_columns(&columns))
}

/// Changes per standard deviation of each lamp; only its own recording is simulated again.
pub(super) fn lamp_columns(setup: &Setup, model: &Model, seed: u64, entries: usize) -> Result<DMatrix<f64>> {
    let still = model.sample(&[], &[], setup.scenes.len())?;
    if model.lamps.is_empty() {
        return Ok(DMatrix::zeros(entries, 0));
    }
    let step = 3.0;
    let change = |i: usize| -> Result<Vec<DVector<f64>>> {
        let mut scans = setup.simulate(&still, seed + i as u64)?;
        let plain = DVector::from_vec(vector(setup, &scans).values);
        let mut columns = Vec::new();
        for k in &model.lamps {
            let mut moved = still.clone();
            moved.lamps[*k] = 1.0 + step * LAMP;
            let own = std::mem::replace(&mut scans[*k], setup.scene(&moved, *k, seed + i as u64)?);
            columns.push((DVector::from_vec(vector(setup, &scans).values) - &plain) / step);
            scans[*k] = own;
        }
        Ok(columns)
    };
    let all = (0..pairs(setup)).into_par_iter().map(change).collect::<Result<Vec<_>>>()?;
    let column = |k: usize| average(&all.iter().map(|c| c[k].clone()).collect::<Vec<_>>());
    Ok(DMatrix::from_columns(&(0..model.lamps.len()).map(column).collect::<Vec<_>>()))
}
