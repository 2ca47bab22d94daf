//! Clean sensors whose parameters deviate from the base model as they do after a calibration.

use std::sync::atomic::AtomicUsize;

use crate::light::offsets::LampDraw;
use crate::null_model::metric::Metric;
use crate::null_model::progress::count;
use crate::null_model::vectors::normal_vectors;
use crate::recordings::setup::Setup;
use crate::sensors::model::Model;
use crate::sensors::simulate;
use crate::thresholds::POSTERIOR_SENSORS;
use nalgebra::{DMatrix, DVector};
use spikelane::error::Result;
use spikelane::unstable::threads;

/// A simulated sensor without missing effects. Its parameters and lamps may differ from those of the base model.
pub(crate) struct CleanSensor {
    /// Positions of the base parameters of this sensor.
    pub base: DVector<f64>,
    /// Relative deviations of the lamps of this sensor.
    pub lamps: DVector<f64>,
    pub vector: DVector<f64>,
}

/// Simulates sensors whose parameters are drawn from the posterior and whose lamps have errors. `rough` is a metric
/// with the derivatives by the base parameters as directions.
pub(crate) fn posterior_sensors(
    setup: &Setup,
    model: &Model,
    lamp_slopes: &DMatrix<f64>,
    seed: u64,
    rough: &Metric,
    done: &AtomicUsize,
) -> Result<Vec<CleanSensor>> {
    let n = model.knobs.len();
    let root = rough.covariance().cholesky().map_or_else(|| DMatrix::zeros(n, n), |c| c.l());
    let one = |i: usize| -> Result<CleanSensor> {
        let own = seed + 10_000 + i as u64;
        let mut draw = normal_vectors(own, "diagnose");
        let base = &root * draw(n);
        let lamps = LampDraw::new(&model.lamps, &draw(model.lamps.len()));
        let sample = model.sample(base.as_slice(), lamps.simulated.as_slice())?;
        let vector = simulate::values(setup, &sample, own)? + lamp_slopes * lamps.remainder();
        count(done);
        Ok(CleanSensor { base, lamps: lamps.whole, vector })
    };
    threads::try_map(0..POSTERIOR_SENSORS, one)
}

/// Returns clean sensors from the vectors of the base model, without further simulations. Each receives drawn
/// errors of the lamps, whose effect is computed with the derivatives by the lamps.
///
/// The mean of `n` vectors contains each of them. A vector is therefore closer to this mean than a new sensor, by
/// the factor `sqrt((n - 1) / (n + 1))`. The deviations from the mean are divided by this factor.
pub(super) fn sensors_of_baseline(
    vectors: &[DVector<f64>],
    mean: &DVector<f64>,
    model: &Model,
    lamp_slopes: &DMatrix<f64>,
    seed: u64,
) -> Vec<CleanSensor> {
    let n = vectors.len() as f64;
    let stretch = ((n + 1.0) / (n - 1.0)).sqrt();
    let one = |(i, vector): (usize, &DVector<f64>)| {
        let normal = normal_vectors(seed + 20_000 + i as u64, "diagnose")(model.lamps.len());
        let lamps = LampDraw::new(&model.lamps, &normal).whole;
        let vector = mean + (vector - mean) * stretch + lamp_slopes * &lamps;
        CleanSensor { base: DVector::zeros(model.knobs.len()), lamps, vector }
    };
    vectors.iter().enumerate().map(one).collect()
}
