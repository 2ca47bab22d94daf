//! Simulations of the base model.
//!
//! [`Baseline::first`] makes a few simulations. They are sufficient to recognize a set that agrees with the model.
//! [`Baseline::complete`] makes the others, which a search for effects requires. The seed of a simulation is
//! determined by its index, so a complete baseline does not depend on the number of first simulations.

use std::sync::atomic::AtomicUsize;

use crate::null_model::derivatives::{Changes, changes, pairs, slopes_of_lamps, with_lamps};
use crate::null_model::progress::{Stage, count, watched};
use crate::null_model::signature::{changed_by, is_mirrored};
use crate::null_model::vectors::{average, spread};
use crate::recordings::setup::Setup;
use crate::sensors::catalog::{Candidate, candidates, searched_effects};
use crate::sensors::deadline::SimulationContext;
use crate::sensors::model::Model;
use crate::sensors::simulate;
use crate::statistics::vector::DiagnosticStatistic;
use crate::thresholds::{FIRST_LAMP_DRAWS, FIRST_SENSORS, FIRST_SIGNATURE_DRAWS, SENSORS};
use nalgebra::{DMatrix, DVector};
use spikelane::effects::{Camera, Catalog, Definition};
use spikelane::error::Result;
use spikelane::unstable::threads;
use spikelane_calibrate::ProgressCallback;

/// Returns the number of simulations per derivative in the first step. Few are sufficient: a base parameter differs
/// from its calibrated value by only one or two of its standard deviations. The noise of the derivative is
/// multiplied by this difference.
fn first_pairs(setup: &Setup) -> usize {
    pairs(setup).div_ceil(6)
}

/// A camera, and those of its simulations that already exist.
#[derive(Clone, Debug)]
pub(crate) struct StartingCamera {
    pub camera: Camera,
    /// Vectors of the simulations with the first seeds.
    pub vectors: Vec<DVector<f64>>,
    pub changes: Changes,
    pub context: SimulationContext,
}

impl StartingCamera {
    /// Returns a camera without simulations.
    pub(crate) fn new(camera: Camera, context: &SimulationContext) -> Self {
        Self { camera, vectors: Vec::new(), changes: Changes::default(), context: context.clone() }
    }
}

/// Simulations of the base model under one protocol.
#[derive(Clone)]
pub(crate) struct Baseline {
    pub setup: Setup,
    pub model: Model,
    pub seed: u64,
    pub statistics: Vec<DiagnosticStatistic>,
    /// Smallest relevant deviation of each statistic, independent of the noise.
    pub floors: Vec<f64>,
    /// Vectors of sensors with exactly the parameters of the model.
    pub vectors: Vec<DVector<f64>>,
    /// Each candidate, with the changes that it causes in the first vectors.
    pub signatures: Vec<(Candidate, Vec<DVector<f64>>)>,
    /// Effects that the set cannot show at any strength.
    pub missing: Vec<&'static Definition>,
    /// Vectors that an earlier fit of the base parameters simulated.
    existing: Vec<DVector<f64>>,
    changes: Changes,
    /// Changes of the first vectors per unit of the deviation of each lit recording.
    lamp_changes: Vec<Vec<DVector<f64>>>,
}

/// Progress of the diagnosis at the start and at the end of the first step. `SENSORS_DONE` is the progress when the
/// sensors of the base model are complete. All values are shares of the total time.
const FIRST_STAGE: (f64, f64) = (0.03, 0.25);
pub(super) const SENSORS_DONE: f64 = 0.48;

/// Progress of the diagnosis when the null model is complete, as a share of the total time.
pub(super) const NULL_MODEL_DONE: f64 = 0.8;

impl Baseline {
    /// Makes the first simulations of the base model, its derivatives and the signatures.
    pub(crate) fn first(
        setup: Setup,
        start: StartingCamera,
        seed: u64,
        effects: &Catalog,
        progress: ProgressCallback<'_>,
    ) -> Result<Self> {
        let StartingCamera { camera, vectors: existing, changes, context } = start;
        let model = Model::base(camera, &setup).with_context(&context);
        let (candidates, missing) = candidates_of(&setup, &model, effects);
        let sample = model.sample(&[], &[])?;
        let statistics = simulate::statistics(&setup, &sample, seed)?;
        let floors = statistics.iter().map(|s| s.floor).collect();
        let signatures: Vec<_> = candidates.into_iter().map(|c| (c, Vec::new())).collect();
        let mut baseline = Self {
            setup,
            model,
            seed,
            statistics,
            floors,
            vectors: Vec::new(),
            signatures,
            missing,
            existing,
            changes,
            lamp_changes: Vec::new(),
        };
        let pairs = first_pairs(&baseline.setup);
        let stage = Stage {
            name: "first look",
            from: FIRST_STAGE.0,
            to: FIRST_STAGE.1,
            pieces: FIRST_SENSORS + pairs * baseline.model.knobs.len() + baseline.signatures.len(),
        };
        watched(&stage, progress, |done| {
            baseline.extend([FIRST_LAMP_DRAWS, FIRST_SENSORS, pairs, FIRST_SIGNATURE_DRAWS], done)
        })?;
        Ok(baseline)
    }

    /// Makes all further simulations that a search requires. Each signature then has `signature_draws` simulations.
    pub(crate) fn complete(&mut self, signature_draws: usize, progress: ProgressCallback<'_>) -> Result<()> {
        let all = pairs(&self.setup);
        let pieces = SENSORS.saturating_sub(self.vectors.len())
            + all.saturating_sub(self.changes.count()) * self.model.knobs.len()
            + self.signatures.len();
        let stage = Stage { name: "null", from: FIRST_STAGE.1, to: SENSORS_DONE, pieces };
        watched(&stage, progress, |done| self.extend([all, SENSORS, all, signature_draws], done))
    }

    /// Adds simulations until these numbers exist: lamp draws, sensors, pairs per derivative, and draws per
    /// signature.
    fn extend(
        &mut self,
        [lamp_draws, sensors, pairs, signature_draws]: [usize; 4],
        done: &AtomicUsize,
    ) -> Result<()> {
        let Self { setup, model, seed, vectors, existing, lamp_changes, signatures, .. } = self;
        let (setup, model, seed) = (&*setup, &*model, *seed);
        let more = threads::try_map(lamp_changes.len()..lamp_draws, |i| {
            with_lamps(setup, model, seed + i as u64).inspect(|_| count(done))
        })?;
        for drawn in more {
            if lamp_changes.len() == vectors.len() {
                vectors.push(drawn.vector);
            }
            lamp_changes.push(drawn.lamps);
        }
        let sample = model.sample(&[], &[])?;
        let vector = |i: usize| -> Result<DVector<f64>> {
            count(done);
            match existing.get(i) {
                Some(vector) => Ok(vector.clone()),
                None => simulate::values(setup, &sample, seed + i as u64),
            }
        };
        let more = threads::try_map(vectors.len()..sensors, vector)?;
        vectors.extend(more);
        let vectors = &*vectors;
        let known_pairs = self.changes.count();
        if known_pairs < pairs {
            self.changes.extend(changes(setup, model, seed, vectors, known_pairs..pairs, done)?);
        }
        // The first step omits an effect of the opposite sign, because the size of its score is the same.
        let is_first = sensors < SENSORS;
        let is_skipped = |i: usize| {
            is_first && signatures[..i].iter().any(|earlier| is_mirrored(&earlier.0, &signatures[i].0))
        };
        let wanted: Vec<usize> =
            (0..signatures.len()).map(|i| if is_skipped(i) { 0 } else { signature_draws }).collect();
        let sign = |((candidate, each), wanted): (&(Candidate, Vec<DVector<f64>>), &usize)| {
            let one = |i: usize| changed_by(candidate, setup, model, seed, vectors, i);
            threads::try_map(each.len()..*wanted, one).inspect(|_| count(done))
        };
        let more = threads::try_map(signatures.iter().zip(&wanted).collect::<Vec<_>>(), sign)?;
        signatures.iter_mut().zip(more).for_each(|((_, each), more)| each.extend(more));
        Ok(())
    }

    pub(super) fn mean(&self) -> DVector<f64> {
        average(&self.vectors)
    }

    /// Returns the standard deviation of each statistic.
    pub(super) fn spread(&self) -> Vec<f64> {
        spread(&self.vectors)
    }

    /// Returns the derivatives of the statistics by each base parameter.
    pub(super) fn jacobian(&self) -> DMatrix<f64> {
        self.changes.jacobian(&self.model, &self.spread())
    }

    /// Returns the derivatives of the statistics by the deviation of each lamp.
    pub(super) fn lamp_slopes(&self) -> DMatrix<f64> {
        slopes_of_lamps(&self.lamp_changes, &self.model, self.statistics.len())
    }
}

/// Returns the candidates for a set, and the effects that it cannot show at any strength.
fn candidates_of(
    setup: &Setup,
    model: &Model,
    effects: &Catalog,
) -> (Vec<Candidate>, Vec<&'static Definition>) {
    let longest = setup.recordings.iter().map(|s| s.first_readout + s.readouts).max().unwrap_or(1);
    let mut all = candidates(&model.camera, longest, setup.lowest_line_hz(), effects);
    let mut missing = Vec::new();
    if setup.only_still() {
        missing = searched_effects(effects);
        missing.retain(|effect| effect.is_scene_like);
        all.retain(|c| !c.effect.is_scene_like);
    }
    (all, missing)
}
