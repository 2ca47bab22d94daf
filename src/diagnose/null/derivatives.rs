//! What the base model's numbers and the lamps move.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::denoised::quiet;
use super::mean::average;
use crate::diagnose::protocol::recorded_set::LAMP;
use crate::diagnose::protocol::recorded_set::Setup;
use crate::diagnose::sensors::base::number_of;
use crate::diagnose::sensors::knob::Knob;
use crate::diagnose::sensors::model::Model;
use crate::diagnose::sensors::simulate;
use crate::diagnose::statistics::all::vector;
use crate::error::Result;

/// Simulations for a derivative, on a sensor of so many pixels, where each tells as much as several, and on one of so many;
/// on a smaller one as many more as it has fewer pixels, up to a limit.
const MANY_PIXELS: (usize, usize) = (20_000, 8);
const USUAL_PIXELS: (usize, usize) = (2304, 16);
const MOST: usize = 64;

pub(in crate::diagnose) fn pairs(setup: &Setup) -> usize {
    let pixels = setup.geometry.pixels();
    if pixels >= MANY_PIXELS.0 {
        return MANY_PIXELS.1;
    }
    (USUAL_PIXELS.1 * USUAL_PIXELS.0 / pixels.max(1)).clamp(USUAL_PIXELS.1, MOST)
}

/// Step for the derivative by a base number, relative to its value.
pub(in crate::diagnose) fn step(knob: &Knob) -> f64 {
    number_of(knob).map_or(0.2, |number| number.step)
}

pub(in crate::diagnose) fn base_jacobian(
    setup: &Setup,
    model: &Model,
    seed: u64,
    baseline: &[DVector<f64>],
    spread: &[f64],
) -> Result<DMatrix<f64>> {
    let n = model.knobs.len();
    let one = |j: usize| -> Result<DVector<f64>> {
        let mut u = vec![0.0; n];
        u[j] = step(&model.knobs[j]);
        let sample = model.sample(&u, &[], setup.scenes.len())?;
        let change = |i: usize| -> Result<DVector<f64>> {
            Ok(DVector::from_vec(simulate::values(setup, &sample, seed + i as u64)?) - &baseline[i])
        };
        let all = (0..pairs(setup)).into_par_iter().map(change).collect::<Result<Vec<_>>>()?;
        Ok(quiet(average(&all), spread, all.len()) / u[j])
    };
    let columns = (0..n).into_par_iter().map(one).collect::<Result<Vec<_>>>()?;
    Ok(DMatrix::from_columns(&columns))
}

/// Changes per standard deviation of each lamp; only its own recording is simulated again.
pub(in crate::diagnose) fn lamp_columns(
    setup: &Setup,
    model: &Model,
    seed: u64,
    entries: usize,
) -> Result<DMatrix<f64>> {
    let still = model.sample(&[], &[], setup.scenes.len())?;
    if model.lamps.is_empty() {
        return Ok(DMatrix::zeros(entries, 0));
    }
    // Small, whatever the lamp's deviation is: the lattices of bright intervals turn back soon.
    let step = 3.0;
    let change = |i: usize| -> Result<Vec<DVector<f64>>> {
        let mut scans = simulate::scans(setup, &still, seed + i as u64)?;
        let plain = DVector::from_vec(vector(setup, &scans).values);
        let mut columns = Vec::new();
        for k in &model.lamps {
            let mut moved = still.clone();
            moved.lamps[*k] = 1.0 + step * LAMP;
            let own = std::mem::replace(
                &mut scans[*k],
                simulate::scan_of_recording(setup, &moved, *k, seed + i as u64)?,
            );
            columns.push((DVector::from_vec(vector(setup, &scans).values) - &plain) / step);
            scans[*k] = own;
        }
        Ok(columns)
    };
    let all = (0..pairs(setup)).into_par_iter().map(change).collect::<Result<Vec<_>>>()?;
    let column = |k: usize| average(&all.iter().map(|c| c[k].clone()).collect::<Vec<_>>());
    Ok(DMatrix::from_columns(&(0..model.lamps.len()).map(column).collect::<Vec<_>>()) * (model.lamp / LAMP))
}
