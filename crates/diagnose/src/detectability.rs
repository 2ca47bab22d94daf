//! Estimates how strong an effect must be before a recording set can name it.

use std::time::Instant;

use crate::faults::fault::Fault;
use crate::null_model::baseline::{Baseline, StartingCamera};
use crate::null_model::detectability::Detectability;
use crate::null_model::model::NullModel;
use crate::prepared::base_model::BaseModel;
use crate::prepared::recordings::{HeldOut, Recordings};
use crate::run::DiagnoseOptions;
use crate::sensors::cache::SimulationCache;
use crate::sensors::deadline::{Deadline, SimulationContext};
use crate::thresholds::SIGNATURE_DRAWS;
use spikelane::effects::Catalog;
use spikelane::error::Result;
use spikelane_calibrate::{ProgressCallback, RecordingSet};

/// The detectability of effects in a recording set.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct DetectabilityReport {
    /// Smallest detectable strength of each effect if a second set of the same scenes is held out. If each
    /// recording is cut into two halves instead, the strength is 1.4 times as large.
    pub detectabilities: Vec<Detectability>,
    /// Effects that the set cannot show at any strength.
    pub undetectable: Vec<&'static str>,
    /// Faults of the recordings; recordings with a fault may be excluded.
    pub faults: Vec<Fault>,
    /// Notes on the parameters of the simulated sensors.
    pub notes: Vec<String>,
}

/// Returns the smallest detectable strength of each effect in `set`. The simulated sensors have the camera of
/// `options`, or parameters that are calibrated from the recordings.
///
/// # Errors
/// If a recording cannot be read or is too short, or the cache folder cannot be created or written to. If the time
/// limit is reached, the error is [`ErrorKind::Interrupted`](spikelane::ErrorKind::Interrupted), because some of
/// the strengths would be missing.
pub fn detectability(
    set: &RecordingSet,
    options: DiagnoseOptions<'_>,
    progress: ProgressCallback<'_>,
) -> Result<DetectabilityReport> {
    let cache = options.cache.map(SimulationCache::open).transpose()?;
    let context = SimulationContext { cache, deadline: Deadline::new(Instant::now(), options.time_limit) };
    progress("reading", 0.0);
    set.check_light_unit()?;
    let mut recordings = Recordings::read([set, set], HeldOut::None, options.readout_selection)?;
    let base = BaseModel::new(&recordings, options.camera)?;
    recordings.fitted.find_light(&base.camera, options.seed)?;
    recordings.fitted.sum_sources();
    let library = Catalog::new();
    let effects = options.effects.unwrap_or(&library);
    let setup = recordings.fitted.setup;
    let start = StartingCamera::new(base.camera, &context);
    let baseline = Baseline::first(setup, start, options.seed, effects, progress)?;
    let reference = NullModel::complete(baseline, SIGNATURE_DRAWS, progress)?;
    Ok(DetectabilityReport {
        detectabilities: reference.detectabilities(),
        undetectable: reference.not_testable(),
        faults: recordings.faults,
        notes: base.notes,
    })
}
