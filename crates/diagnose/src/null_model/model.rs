//! The base model under a protocol: mean, noise, derivatives, signatures of effects, and limits for clean sensors.

use crate::light::offsets::{columns, offsets, shifted};
use crate::null_model::baseline::{Baseline, NULL_MODEL_DONE, SENSORS_DONE, StartingCamera};
use crate::null_model::limits::{AGREEMENT, ALARM, Base, Clean, LimitLevel, Limits};
use crate::null_model::metric::{Metric, Noise, noise};
use crate::null_model::posterior_draw::{CleanSensor, posterior_sensors, sensors_of_baseline};
use crate::null_model::progress::{Stage, watched};
use crate::null_model::signature::Signature;
use crate::null_model::vectors::{average, differences, mean_squares};
use crate::recordings::setup::Setup;
use crate::sensors::catalog::Candidate;
use crate::sensors::deadline::{Deadline, SimulationContext};
use crate::sensors::memory::SimulationMemory;
use crate::sensors::model::{Model, Sample};
use crate::sensors::simulate;
use crate::statistics::vector::DiagnosticStatistic;
use crate::thresholds::{
    CALIBRATION_INFORMATION, FIRST_HELD_OUT_SIMULATIONS, FIRST_SIGNATURE_DRAWS, HELD_OUT_SIMULATIONS,
    POSTERIOR_SENSORS, SENSORS, SIGNATURE_DRAWS,
};
use nalgebra::{DMatrix, DVector};
use spikelane::effects::{Camera, Catalog, Definition};
use spikelane::error::Result;
use spikelane::unstable::threads;
use spikelane_calibrate::ProgressCallback;

/// Simulated sensors of one camera model under one protocol. They can be compared with every set that was recorded
/// by this protocol.
#[derive(Clone, Debug)]
pub struct NullModel {
    pub(crate) setup: Setup,
    pub(crate) model: Model,
    pub(crate) statistics: Vec<DiagnosticStatistic>,
    pub(crate) seed: u64,
    /// Vectors of the sensors with exactly the parameters of the model. A complete null model has [`SENSORS`] of
    /// them.
    pub(crate) baseline: Vec<DVector<f64>>,
    pub(crate) mean: DVector<f64>,
    /// Standard deviation of each statistic between the vectors of `baseline`, without floors and without lamps.
    pub(crate) spread: Vec<f64>,
    /// Derivatives of the statistics by the base knobs.
    pub(crate) jacobian: DMatrix<f64>,
    /// Derivatives of the statistics by the deviation of each lamp.
    pub(crate) lamp_slopes: DMatrix<f64>,
    /// Noise of sensors at known light.
    pub(crate) noise_without_lamps: Noise,
    /// Noise that includes the deviations of the lamps.
    pub(crate) noise: Noise,
    pub(crate) metric: Metric,
    /// Root mean square error of each base parameter in fits of clean sensors.
    pub(crate) missed: Vec<f64>,
    pub(crate) signatures: Vec<Signature>,
    /// Effects that this set cannot show at any strength.
    pub(crate) missing: Vec<&'static Definition>,
    /// Limits and noise floor of clean sensors.
    pub(crate) clean: Clean,
    /// Simulated vectors of fitted models, so that no vector is simulated twice.
    remembered: SimulationMemory,
}

impl NullModel {
    /// Simulates sensors like `camera` under the protocol of `setup`, and the signature of each effect of this
    /// library. A signature is the change of the statistics by the effect.
    ///
    /// # Errors
    /// If the camera cannot be simulated at the light of the set.
    pub fn new(setup: Setup, camera: Camera, seed: u64, progress: ProgressCallback<'_>) -> Result<Self> {
        Self::with_effects(setup, camera, seed, &Catalog::new(), progress)
    }

    /// Simulates sensors as [`NullModel::new`] does, with the signatures of all `effects`.
    ///
    /// # Errors
    /// See [`NullModel::new`].
    pub fn with_effects(
        setup: Setup,
        camera: Camera,
        seed: u64,
        effects: &Catalog,
        progress: ProgressCallback<'_>,
    ) -> Result<Self> {
        let baseline = Baseline::first(
            setup,
            StartingCamera::new(camera, &SimulationContext::default()),
            seed,
            effects,
            progress,
        )?;
        Self::complete(baseline, SIGNATURE_DRAWS, progress)
    }

    /// Returns the null model for a search. It completes the simulations of the base model and simulates sensors
    /// whose parameters come from their posterior.
    ///
    /// If `signature_draws` is [`FIRST_SIGNATURE_DRAWS`], the search later makes the second draw of the candidates
    /// that it compares.
    pub(crate) fn complete(
        mut baseline: Baseline,
        signature_draws: usize,
        progress: ProgressCallback<'_>,
    ) -> Result<Self> {
        baseline.complete(signature_draws, progress)?;
        let Baseline { setup, model, seed, floors, .. } = &baseline;
        let (mean, jacobian, lamp_slopes) = (baseline.mean(), baseline.jacobian(), baseline.lamp_slopes());
        let lamps = columns(&lamp_slopes, model);
        let of_baseline: Vec<DVector<f64>> = baseline.vectors.iter().map(|s| s - &mean).collect();
        let rough = Metric::new(&noise(&of_baseline, floors)?.with_columns(&lamps)?, jacobian.clone());
        let stage =
            Stage { name: "null", from: SENSORS_DONE, to: NULL_MODEL_DONE, pieces: POSTERIOR_SENSORS };
        let sensors = watched(&stage, progress, |done| {
            posterior_sensors(setup, model, &lamp_slopes, *seed, &rough, done)
        })?;
        let residual = |d: &CleanSensor| &d.vector - &mean - &jacobian * &d.base - &lamp_slopes * &d.lamps;
        let mut residuals: Vec<DVector<f64>> = sensors.iter().map(residual).collect();
        residuals.extend(of_baseline);
        Self::from_sensors(baseline, &sensors, &residuals, ALARM)
    }

    /// Returns the null model of the first simulations. A set that is within its limits agrees with the model.
    pub(crate) fn preliminary(baseline: &Baseline) -> Result<Self> {
        let (mean, lamp_slopes) = (baseline.mean(), baseline.lamp_slopes());
        let sensors =
            sensors_of_baseline(&baseline.vectors, &mean, &baseline.model, &lamp_slopes, baseline.seed);
        let residual = |d: &CleanSensor| &d.vector - &mean - &lamp_slopes * &d.lamps;
        let residuals: Vec<DVector<f64>> = sensors.iter().map(residual).collect();
        Self::from_sensors(baseline.clone(), &sensors, &residuals, AGREEMENT)
    }

    fn from_sensors(
        baseline: Baseline,
        sensors: &[CleanSensor],
        residuals: &[DVector<f64>],
        level: LimitLevel,
    ) -> Result<Self> {
        let (mean, spread) = (baseline.mean(), baseline.spread());
        let (jacobian, lamp_slopes) = (baseline.jacobian(), baseline.lamp_slopes());
        let Baseline { setup, model, seed, statistics, floors, vectors, signatures, missing, .. } = baseline;
        let lamps = columns(&lamp_slopes, &model);
        let noise_without_lamps = noise(residuals, &floors)?;
        let full = noise_without_lamps.with_columns(&lamps)?;
        let metric = Metric::new(&full, jacobian.clone());
        let signature = |(candidate, each)| Signature::new(candidate, each, &spread);
        let simulated = signatures.into_iter().filter(|(_, each)| !each.is_empty());
        let signatures = simulated.map(signature).collect();
        let mut null = Self {
            clean: Clean::default(),
            missed: missed(&metric, sensors, &mean),
            setup,
            model,
            statistics,
            seed,
            baseline: vectors,
            mean,
            spread,
            jacobian,
            lamp_slopes,
            noise_without_lamps,
            noise: full,
            metric,
            signatures,
            missing,
            remembered: SimulationMemory::default(),
        };
        null.clean = Clean::new(sensors, residuals, &lamps, &floors, null.base(), level)?;
        null.signatures.iter_mut().zip(&null.clean.score_sds).for_each(|(s, sd)| s.score_sd = *sd);
        Ok(null)
    }

    fn base(&self) -> Base<'_> {
        Base { mean: &self.mean, jacobian: &self.jacobian, signatures: &self.signatures }
    }

    /// Returns the limits that clean sensors hardly ever exceed.
    #[must_use]
    pub fn limits(&self) -> Limits {
        self.clean.limits
    }

    /// Returns a copy whose simulations end at `deadline`.
    pub(crate) fn within(&self, deadline: &Deadline) -> Self {
        let mut copy = self.clone();
        copy.model.context.deadline = deadline.clone();
        copy
    }

    /// Returns `data` plus the changes by the lamp offsets of this model; see `light/offsets.rs`.
    pub(crate) fn shifted(&self, data: &DVector<f64>) -> DVector<f64> {
        shifted(data, &self.lamp_slopes, &self.model)
    }

    /// Returns the vector that must be subtracted from simulated vectors of `model`. They then compare with data
    /// that were shifted by the lamp offsets of this null model ([`NullModel::shifted`]).
    pub(crate) fn lamp_shift(&self, model: &Model) -> DVector<f64> {
        &self.lamp_slopes * (offsets(&model.lamps) - offsets(&self.model.lamps))
    }

    /// Returns whether the null model comes from the first simulations only.
    pub(crate) fn is_preliminary(&self) -> bool {
        self.baseline.len() < SENSORS
    }

    /// Returns the probability that a clean sensor exceeds a given limit.
    pub(crate) fn limit_probability(&self) -> f64 {
        if self.is_preliminary() { AGREEMENT.probability } else { ALARM.probability }
    }

    /// Returns the name of statistic `i` and its recording.
    pub(crate) fn words(&self, i: usize) -> (String, String) {
        let s = &self.statistics[i];
        let place =
            s.recording.map_or_else(|| "fitted maps".to_owned(), |k| self.setup.recordings[k].file_name());
        (s.name.to_owned(), place)
    }

    /// Returns the signature of `candidate`. It has as many simulations as the other signatures.
    pub(crate) fn signature(&self, candidate: Candidate) -> Result<Signature> {
        let draws = if self.is_preliminary() { FIRST_SIGNATURE_DRAWS } else { SIGNATURE_DRAWS };
        self.signature_with(candidate, Vec::new(), draws)
    }

    /// Returns the signature with two simulations. The second one is made if `signature` has only one.
    pub(crate) fn with_second_draw(&self, signature: &Signature) -> Result<Signature> {
        if signature.each.len() >= SIGNATURE_DRAWS {
            return Ok(signature.clone());
        }
        self.signature_with(signature.candidate.clone(), signature.each.clone(), SIGNATURE_DRAWS)
    }

    fn signature_with(
        &self,
        candidate: Candidate,
        mut each: Vec<DVector<f64>>,
        draws: usize,
    ) -> Result<Signature> {
        let sample = candidate.sample(&self.model)?;
        let change = |i: usize| Ok(self.remembered(&sample, i)? - &self.baseline[i]);
        let more = threads::try_map(each.len()..draws, change)?;
        each.extend(more);
        Ok(Signature::new(candidate, each, &self.spread))
    }

    /// Returns the mean vector of a fitted model from `count` simulations, of which `known` contains the first
    /// ones. For each statistic, the vectors of the base model serve as a control variate if this reduces the
    /// noise.
    pub(crate) fn mean_of(
        &self,
        model: &Model,
        u: &[f64],
        count: usize,
        known: Vec<DVector<f64>>,
    ) -> Result<Means> {
        let sample = model.sample(u, &[])?;
        let shift = self.lamp_shift(model);
        let one = |i: usize| Ok(self.remembered(&sample, i)? - &shift);
        let mut each = known;
        let more = threads::try_map(each.len()..count.min(SENSORS), one)?;
        each.extend(more);
        Ok(Means { mean: self.controlled(&each), each })
    }

    /// Returns the mean vector of a fitted model under another protocol with the same statistics. Examples are the
    /// other half of the recordings, and the same scenes with other light.
    pub(crate) fn mean_under(&self, setup: &Setup, model: &Model, u: &[f64]) -> Result<DVector<f64>> {
        let sample = model.sample(u, &[])?;
        let shift = self.lamp_shift(model);
        let halves = if self.is_preliminary() { FIRST_HELD_OUT_SIMULATIONS } else { HELD_OUT_SIMULATIONS };
        let simulate = |i: usize| Ok(simulate::values(setup, &sample, self.seed + i as u64)? - &shift);
        Ok(self.controlled(&threads::try_map(0..halves, simulate)?))
    }

    /// Returns the vector of `sample` with the draws of number `i`. Each vector is simulated only once.
    fn remembered(&self, sample: &Sample, i: usize) -> Result<DVector<f64>> {
        let simulate = || simulate::values(&self.setup, sample, self.seed + i as u64);
        self.remembered.get_or_simulate(sample, i, simulate)
    }

    fn controlled(&self, each: &[DVector<f64>]) -> DVector<f64> {
        let n = each.len();
        let plain = average(each);
        let change = differences(each, &self.baseline);
        let controlled = average(&change) + &self.mean;
        let spread = |rows: &[DVector<f64>], center: f64, j: usize| {
            rows.iter().map(|r| (r[j] - center).powi(2)).sum::<f64>()
        };
        DVector::from_fn(plain.len(), |j, _| {
            let close = spread(&change, controlled[j] - self.mean[j], j) < spread(each, plain[j], j);
            if n < 2 || close { controlled[j] } else { plain[j] }
        })
    }
}

/// Returns the root mean square error of each base parameter in fits of clean sensors.
///
/// A parameter of a single sensor deviates by chance, for example the spread of its 2,304 gains. All statistics
/// that depend on the parameter then deviate together. The noise may lack a part of these correlations. The
/// standard deviations of the linear fit would then be too small.
fn missed(metric: &Metric, sensors: &[CleanSensor], mean: &DVector<f64>) -> Vec<f64> {
    let known = vec![CALIBRATION_INFORMATION; metric.directions.ncols()];
    let fitter = metric.clone().knowing(&known);
    let error = |d: &CleanSensor| fitter.fit(&(&d.vector - mean)) - &d.base;
    mean_squares(&sensors.iter().map(error).collect::<Vec<_>>()).iter().map(|square| square.sqrt()).collect()
}

/// Simulated vectors and their mean.
pub(crate) struct Means {
    pub mean: DVector<f64>,
    pub each: Vec<DVector<f64>>,
}
