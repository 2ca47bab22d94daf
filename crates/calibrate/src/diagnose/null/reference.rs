//! What a set of a given protocol looks like under the base model: mean, noise, what each number
//! moves, how each candidate shows, and how far clean sensors stray.

use super::first_look::First;
use super::known::CALIBRATED;
use super::lamps::columns;
use super::limits::{Base, Clean, Limits};
use super::mean::average;
use super::metric::{Metric, Noise, noise};
use super::redraw::{Redrawn, redraw};
use super::signature::{Signature, changed_by};
use super::simulated::{Begun, FIXED, STAGES, Simulated};
use super::watched::{count, watched};
use crate::ProgressCallback;
use crate::diagnose::protocol::recorded_set::Setup;
use crate::diagnose::sensors::catalog::{Candidate, candidates, looked_for};
use crate::diagnose::sensors::model::Model;
use crate::diagnose::sensors::remembered::Remembered;
use crate::diagnose::sensors::simulate;
use crate::diagnose::statistics::entry::DiagnosticStatistic;
use nalgebra::{DMatrix, DVector};
use spikelane::effects::{Camera, Catalog, Definition};
use spikelane::error::Result;
use spikelane::unstable::threads;

/// Simulations of a set that judges, where it is another half or has other light.
const HALVES: usize = 24;

/// Simulations of a candidate's signature.
const SIGNATURE: usize = 2;

/// Simulated sensors of one kind under one protocol. They serve for every set that was recorded by that protocol.
#[derive(Clone, Debug)]
pub struct NullModel {
    pub(in crate::diagnose) setup: Setup,
    pub(in crate::diagnose) model: Model,
    pub(in crate::diagnose) statistics: Vec<DiagnosticStatistic>,
    pub(in crate::diagnose) seed: u64,
    /// Vectors of the first [`FIXED`] seeds.
    pub(in crate::diagnose) baseline: Vec<DVector<f64>>,
    pub(in crate::diagnose) mean: DVector<f64>,
    /// The deviation of every statistic from one of these to another, without floors and lamps.
    pub(in crate::diagnose) spread: Vec<f64>,
    /// Changes per unit of the base knobs.
    pub(in crate::diagnose) jacobian: DMatrix<f64>,
    /// Changes per unit of each lamp's deviation.
    pub(in crate::diagnose) lamp_slopes: DMatrix<f64>,
    /// Noise of sensors whose light is known.
    pub(in crate::diagnose) noise_without_lamps: Noise,
    /// Noise, lamps included.
    pub(in crate::diagnose) noise: Noise,
    pub(in crate::diagnose) metric: Metric,
    /// By how much the fit of a clean sensor misses each of the base model's numbers.
    pub(in crate::diagnose) missed: Vec<f64>,
    pub(in crate::diagnose) signatures: Vec<Signature>,
    /// Effects that this set cannot show, whatever their strength.
    pub(in crate::diagnose) missing: Vec<&'static Definition>,
    /// What clean sensors show.
    pub(in crate::diagnose) clean: Clean,
    /// What fitted models were simulated as.
    remembered: Remembered,
}

impl NullModel {
    /// Simulates sensors like `camera` under the protocol of `setup`, and the signature of each effect of this
    /// library.
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
        Self::looked(setup, Begun::of(camera, None), seed, effects, None, progress)
    }

    /// The same; what was simulated of the camera already is not made again, and `first` is looked at as soon as may be.
    pub(in crate::diagnose) fn looked(
        setup: Setup,
        begun: Begun,
        seed: u64,
        effects: &Catalog,
        first: Option<First<'_>>,
        progress: ProgressCallback<'_>,
    ) -> Result<Self> {
        let model = Model::base(begun.camera.clone(), &setup).keeping(begun.kept.as_ref());
        let (all, missing) = tried(&setup, &model, effects);
        let null = Simulated::of(&setup, &model, begun, seed, &all, first, progress)?;
        let Simulated { statistics, floors, baseline, mean, spread, jacobian, lamp_slopes, mut signed } =
            null;
        let lamps = columns(&lamp_slopes, &model);
        let first: Vec<DVector<f64>> = baseline.iter().map(|s| s - &mean).collect();
        let rough = Metric::new(&noise(&first, &floors)?.with_columns(&lamps)?, jacobian.clone());
        let redrawn = watched(&STAGES.redrawn(), progress, |done| {
            redraw(&setup, &model, &lamp_slopes, seed, &rough, done)
        })?;
        let residual = |d: &Redrawn| &d.vector - &mean - &jacobian * &d.base - &lamp_slopes * &d.lamps;
        let mut residuals: Vec<DVector<f64>> = redrawn.iter().map(residual).collect();
        residuals.extend(first);
        let noise_without_lamps = noise(&residuals, &floors)?;
        let full = noise_without_lamps.with_columns(&lamps)?;
        let metric = Metric::new(&full, jacobian.clone());
        let missed = missed(&metric, &redrawn, &mean);
        let mut reference = Self {
            clean: Clean::default(),
            setup,
            model,
            statistics,
            seed,
            baseline,
            mean,
            spread,
            jacobian,
            lamp_slopes,
            noise_without_lamps,
            noise: full,
            metric,
            missed,
            signatures: Vec::new(),
            missing,
            remembered: Remembered::default(),
        };
        signed.resize_with(all.len(), Vec::new);
        let sign = |(c, known): (Candidate, Vec<DVector<f64>>)| reference.signature_from(c, known);
        let work: Vec<_> = all.into_iter().zip(signed).collect();
        reference.signatures = watched(&STAGES.signatures(work.len()), progress, |done| {
            let one = |work| sign(work).inspect(|_| count(done));
            threads::try_map(work, one)
        })?;
        reference.clean = Clean::of(&redrawn, &residuals, &lamps, &floors, reference.base())?;
        Ok(reference)
    }

    fn base(&self) -> Base<'_> {
        Base { mean: &self.mean, jacobian: &self.jacobian, signatures: &self.signatures }
    }

    /// Returns the limits that clean sensors do not exceed.
    #[must_use]
    pub fn limits(&self) -> Limits {
        self.clean.limits
    }

    /// A statistic in words.
    pub(in crate::diagnose) fn words(&self, i: usize) -> (String, String) {
        let s = &self.statistics[i];
        let place =
            s.recording.map_or_else(|| "fitted maps".to_owned(), |k| self.setup.recordings[k].file_name());
        (s.name.to_owned(), place)
    }

    /// How `candidate` shows in a base sensor.
    pub(in crate::diagnose) fn signature(&self, candidate: Candidate) -> Result<Signature> {
        self.signature_from(candidate, Vec::new())
    }

    /// The same, where what it changes with the first draws is `known`.
    fn signature_from(&self, candidate: Candidate, known: Vec<DVector<f64>>) -> Result<Signature> {
        let change =
            |i: usize| changed_by(&candidate, &self.setup, &self.model, self.seed, &self.baseline, i);
        let mut each = known;
        let more = threads::try_map(each.len()..SIGNATURE, change)?;
        each.extend(more);
        Ok(Signature { candidate, mean: average(&each), each })
    }

    /// Mean vector of a fitted model from `count` simulations, of which the first are `known`, with the base model's as control
    /// where that helps.
    pub(in crate::diagnose) fn mean_of(
        &self,
        model: &Model,
        u: &[f64],
        count: usize,
        known: Vec<DVector<f64>>,
    ) -> Result<Means> {
        let sample = model.sample(u, &[], self.setup.recordings.len())?;
        let simulate =
            |i: usize| Ok(DVector::from_vec(simulate::values(&self.setup, &sample, self.seed + i as u64)?));
        let shift = self.lamp_shift(model);
        let one = |i: usize| Ok(self.remembered.or(&sample, i, || simulate(i))? - &shift);
        let mut each = known;
        let more = threads::try_map(each.len()..count.min(FIXED), one)?;
        each.extend(more);
        Ok(Means { mean: self.controlled(&each), each })
    }

    /// Mean vector of a fitted model under another protocol of as many statistics: the other half of the recordings, or the same
    /// scenes with other light.
    pub(in crate::diagnose) fn mean_under(
        &self,
        setup: &Setup,
        model: &Model,
        u: &[f64],
    ) -> Result<DVector<f64>> {
        let sample = model.sample(u, &[], setup.recordings.len())?;
        let shift = self.lamp_shift(model);
        let simulate = |i: usize| {
            Ok(DVector::from_vec(simulate::values(setup, &sample, self.seed + i as u64)?) - &shift)
        };
        Ok(self.controlled(&threads::try_map(0..HALVES, simulate)?))
    }

    fn controlled(&self, each: &[DVector<f64>]) -> DVector<f64> {
        let n = each.len();
        let plain = average(each);
        let change: Vec<DVector<f64>> = each.iter().zip(&self.baseline).map(|(s, b)| s - b).collect();
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

/// What is tried on a set, and the effects that it cannot show, whatever their strength.
fn tried(setup: &Setup, model: &Model, effects: &Catalog) -> (Vec<Candidate>, Vec<&'static Definition>) {
    let longest = setup.recordings.iter().map(|s| s.first_readout + s.readouts).max().unwrap_or(1);
    let mut all = candidates(&model.camera, longest, setup.lowest_line_hz(), effects);
    let mut missing = Vec::new();
    if setup.only_still() {
        missing = looked_for(effects);
        missing.retain(|effect| effect.is_scene_like);
        all.retain(|c| !c.effect.is_scene_like);
    }
    (all, missing)
}

/// Statistics that tell one number follow its chance in one sensor together, the spread of 2,304 gains for one. Where the noise
/// does not hold all of that, the linear deviations are too small.
fn missed(metric: &Metric, redrawn: &[Redrawn], mean: &DVector<f64>) -> Vec<f64> {
    let known = vec![CALIBRATED; metric.directions.ncols()];
    let fitter = metric.clone().knowing(&known);
    let error = |d: &Redrawn| fitter.fit(&(&d.vector - mean)) - &d.base;
    let errors: Vec<DVector<f64>> = redrawn.iter().map(error).collect();
    let square = |j: usize| errors.iter().map(|e| e[j] * e[j]).sum::<f64>() / errors.len() as f64;
    (0..known.len()).map(|j| square(j).sqrt()).collect()
}

/// Simulated vectors and their mean.
pub(in crate::diagnose) struct Means {
    pub mean: DVector<f64>,
    pub each: Vec<DVector<f64>>,
}
