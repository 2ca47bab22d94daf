//! Clean sensors whose calibrated numbers are off as a calibration leaves them.

use std::sync::atomic::AtomicUsize;

use super::lamps::LampDraw;
use super::metric::Metric;
use super::watched::count;
use crate::diagnose::protocol::recorded_set::Setup;
use crate::diagnose::sensors::model::Model;
use crate::diagnose::sensors::simulate;
use nalgebra::{DMatrix, DVector};
use spikelane::error::Result;
use spikelane::unstable::draws::pattern_rng::PatternRng;
use spikelane::unstable::draws::{RandomStream, Seeds};
use spikelane::unstable::threads;

/// Simulations with the fitted numbers redrawn from their posterior.
pub(super) const REDRAWN: usize = 120;

pub(in crate::diagnose) struct Redrawn {
    pub base: DVector<f64>,
    /// Deviations of the lamps.
    pub lamps: DVector<f64>,
    pub vector: DVector<f64>,
}

/// Clean sensors whose fitted numbers come from the posterior and whose lamps are off.
pub(in crate::diagnose) fn redraw(
    setup: &Setup,
    model: &Model,
    lamp_slopes: &DMatrix<f64>,
    seed: u64,
    rough: &Metric,
    done: &AtomicUsize,
) -> Result<Vec<Redrawn>> {
    let n = model.knobs.len();
    let root = rough.covariance().cholesky().map_or_else(|| DMatrix::zeros(n, n), |c| c.l());
    let one = |i: usize| -> Result<Redrawn> {
        let own = seed + 10_000 + i as u64;
        let mut normals =
            PatternRng::new(Seeds { camera: own, shot: 0, sequence: 0 }, RandomStream::from_name("diagnose"))
                .normals();
        let mut draw = |count: usize| DVector::from_fn(count, |_, _| normals.next().unwrap_or(0.0));
        let base = &root * draw(n);
        let lamps = LampDraw::new(&model.lamps, &draw(model.lamps.len()));
        let sample = model.sample(base.as_slice(), lamps.simulated.as_slice(), setup.recordings.len())?;
        let values = DVector::from_vec(simulate::values(setup, &sample, own)?);
        let vector = values + lamp_slopes * lamps.remainder();
        count(done);
        Ok(Redrawn { base, lamps: lamps.whole, vector })
    };
    threads::try_map(0..REDRAWN, one)
}
