//! Sensors of the base model, simulated: those that a first look needs come first.

use super::derivatives::{Changes, changes, pairs, slopes_of_lamps, with_lamps};
use super::first_look::{First, Sketch};
use super::mean::average;
use super::redraw::REDRAWN;
use super::signature::changed_by;
use super::watched::{Stage, count, watched};
use crate::ProgressCallback;
use crate::diagnose::cache::folder::SimulationCache;
use crate::diagnose::protocol::recorded_set::Setup;
use crate::diagnose::sensors::catalog::Candidate;
use crate::diagnose::sensors::model::Model;
use crate::diagnose::sensors::simulate;
use crate::diagnose::statistics::vector::DiagnosticStatistic;
use nalgebra::{DMatrix, DVector};
use spikelane::effects::Camera;
use spikelane::error::Result;
use spikelane::unstable::threads;

/// Simulations at the base model's own numbers.
pub(super) const FIXED: usize = 80;

/// Sensors whose noise a first look goes by.
const FEW: usize = 24;

/// Simulations for a derivative of a first look.
fn few_pairs(setup: &Setup) -> usize {
    (3 * pairs(setup)).div_ceil(8)
}

/// A camera of which some was simulated already: its vectors with the first draws, and what its base numbers change in them.
#[derive(Clone, Debug)]
pub(in crate::diagnose) struct Begun {
    pub camera: Camera,
    pub each: Vec<DVector<f64>>,
    pub changes: Changes,
    /// Where vectors are kept.
    pub kept: Option<SimulationCache>,
}

impl Begun {
    pub(crate) fn of(camera: Camera, kept: Option<&SimulationCache>) -> Self {
        Self { camera, each: Vec::new(), changes: Changes::default(), kept: kept.cloned() }
    }
}

/// The base model under a protocol.
pub(super) struct Simulated {
    pub statistics: Vec<DiagnosticStatistic>,
    pub floors: Vec<f64>,
    pub baseline: Vec<DVector<f64>>,
    pub mean: DVector<f64>,
    /// The deviation of every statistic from one sensor to another.
    pub spread: Vec<f64>,
    pub jacobian: DMatrix<f64>,
    /// Changes per unit of each lamp's deviation.
    pub lamp_slopes: DMatrix<f64>,
    /// What candidates change with the first draws, as far as that was looked at.
    pub signed: Vec<Vec<DVector<f64>>>,
}

/// Shares of the whole time at which the parts of a reference end.
pub(super) struct Stages {
    begin: f64,
    first: f64,
    null: f64,
    redrawn: f64,
    end: f64,
}

pub(super) const STAGES: Stages = Stages { begin: 0.03, first: 0.25, null: 0.48, redrawn: 0.67, end: 0.8 };

impl Stages {
    fn first(&self, pieces: usize) -> Stage {
        Stage { name: "first look", from: self.begin, to: self.first, pieces }
    }

    fn null(&self, pieces: usize) -> Stage {
        Stage { name: "null", from: self.first, to: self.null, pieces }
    }

    pub(super) fn redrawn(&self) -> Stage {
        Stage { name: "null", from: self.null, to: self.redrawn, pieces: REDRAWN }
    }

    pub(super) fn signatures(&self, pieces: usize) -> Stage {
        Stage { name: "signatures", from: self.redrawn, to: self.end, pieces }
    }
}

impl Simulated {
    pub(super) fn of(
        setup: &Setup,
        model: &Model,
        begun: Begun,
        seed: u64,
        candidates: &[Candidate],
        first: Option<First<'_>>,
        progress: ProgressCallback<'_>,
    ) -> Result<Self> {
        let still = model.sample(&[], &[], setup.recordings.len())?;
        let statistics = simulate::statistics(setup, &still, seed)?;
        let floors: Vec<f64> = statistics.iter().map(|s| s.floor).collect();
        let Begun { each: known, changes: mut moved, .. } = begun;
        let (lamped, numbers) = (pairs(setup), model.knobs.len());
        let work = Work { setup, model, seed };
        let asked = if first.is_some() { candidates.len() } else { 0 };
        let few = few_pairs(setup);
        let stage = STAGES.first(FEW.max(lamped) + few * numbers + asked);
        let (mut baseline, lamp_slopes, signed) = watched(&stage, progress, |done| -> Result<_> {
            let drawn = threads::try_map(0..lamped, |i| {
                let drawn = with_lamps(setup, model, seed + i as u64).inspect(|_| count(done))?;
                Ok((drawn.vector, drawn.lamps))
            })?;
            let (mut baseline, lamps): (Vec<_>, Vec<_>) = drawn.into_iter().unzip();
            work.further(&mut baseline, &known, FEW, done)?;
            if moved.count() < few {
                moved.extend(changes(setup, model, seed, &baseline, moved.count()..few, done)?);
            }
            let sign =
                |c: &Candidate| changed_by(c, setup, model, seed, &baseline, 0).inspect(|_| count(done));
            let signed = threads::try_map(&candidates[..asked], sign)?;
            Ok((baseline, slopes_of_lamps(&lamps, model, statistics.len()), signed))
        })?;
        if let Some(first) = first {
            let signatures: Vec<_> = candidates.iter().zip(signed.iter().cloned()).collect();
            let jacobian = moved.jacobian(model, &spread(&baseline));
            let sketch = Sketch {
                baseline: &baseline,
                jacobian,
                lamps: &super::lamps::columns(&lamp_slopes, model),
                floors: &floors,
                signatures: &signatures,
            };
            (first.told)(&sketch.look(&super::lamps::shifted(first.data, &lamp_slopes, model))?);
        }
        let open = (lamped - moved.count().min(lamped)) * numbers + FIXED.saturating_sub(baseline.len());
        watched(&STAGES.null(open), progress, |done| -> Result<()> {
            work.further(&mut baseline, &known, FIXED, done)?;
            if moved.count() < lamped {
                moved.extend(changes(setup, model, seed, &baseline, moved.count()..lamped, done)?);
            }
            Ok(())
        })?;
        let (mean, spread) = (average(&baseline), spread(&baseline));
        let jacobian = moved.jacobian(model, &spread);
        let signed = signed.into_iter().map(|s| vec![s]).collect();
        Ok(Self { statistics, floors, baseline, mean, spread, jacobian, lamp_slopes, signed })
    }
}

/// What is simulated.
#[derive(Clone, Copy)]
struct Work<'a> {
    setup: &'a Setup,
    model: &'a Model,
    seed: u64,
}

impl Work<'_> {
    /// Vectors up to `count` of them, those that are `known` from there.
    fn further(
        self,
        baseline: &mut Vec<DVector<f64>>,
        known: &[DVector<f64>],
        wanted: usize,
        done: &std::sync::atomic::AtomicUsize,
    ) -> Result<()> {
        let still = self.model.sample(&[], &[], self.setup.recordings.len())?;
        let vector = |i: usize| -> Result<DVector<f64>> {
            let vector = match known.get(i) {
                Some(known) => known.clone(),
                None => DVector::from_vec(simulate::values(self.setup, &still, self.seed + i as u64)?),
            };
            count(done);
            Ok(vector)
        };
        let more = threads::try_map(baseline.len()..wanted, vector)?;
        baseline.extend(more);
        Ok(())
    }
}

/// Deviations from one vector to another.
fn spread(vectors: &[DVector<f64>]) -> Vec<f64> {
    let mean = average(vectors);
    let square = |j: usize| vectors.iter().map(|b| (b[j] - mean[j]).powi(2)).sum::<f64>();
    (0..mean.len()).map(|j| (square(j) / (vectors.len() - 1) as f64).sqrt()).collect()
}
