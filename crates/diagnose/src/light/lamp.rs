//! The deviations of the light from the stated light, as independent parameters.
//!
//! The light of recording `k` is the stated light times `1 + e_k`. If the set states no sources for the recording,
//! the recording has its own lamp, and `e_k` is the deviation of this lamp.
//!
//! If the set states sources, `e_k = sum_s w_ks z_s + r_k`. Here `w_ks` is the share of source `s` in the stated
//! light, and `z_s` is the deviation of source `s`, which is the same in all recordings. The last term `r_k` is a
//! deviation of recording `k` alone, because a source does not repeat its light exactly.

use crate::recordings::recorded_scene::RecordedScene;
use crate::recordings::setup::Setup;
use nalgebra::{DMatrix, DVector};

/// The origin of a deviation of the light.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum LampKind {
    /// The lamp of one recording.
    Recording,
    /// A source that lights one or several recordings.
    Source(String),
    /// The deviation of one recording that its sources do not have in common with other recordings.
    Repetition,
}

/// A relative deviation of the light that is independent of the others.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Lamp {
    pub kind: LampKind,
    /// The recordings that have this deviation, each with the share of the deviating light in its stated light.
    pub shares: Vec<(usize, f64)>,
    /// Standard deviation of the prior of this deviation.
    pub uncertainty: f64,
    /// The deviation at which sensors are simulated.
    pub offset: f64,
}

/// Returns the independent deviations of all lit recordings: lamps, sources and repetitions. Their offsets are
/// those of the found light.
pub(crate) fn lamps_of(setup: &Setup) -> Vec<Lamp> {
    let scenes = &setup.recordings;
    let mut lamps: Vec<Lamp> = Vec::new();
    for (k, scene) in lit(setup) {
        if scene.sources.sources.is_empty() {
            lamps.push(Lamp {
                kind: LampKind::Recording,
                shares: vec![(k, 1.0)],
                uncertainty: scene.light_uncertainty,
                offset: scene.light_offset,
            });
        }
        for source in &scene.sources.sources {
            let kind = LampKind::Source(source.name.clone());
            let share = (k, source.light / scene.brightness());
            match lamps.iter_mut().find(|lamp| lamp.kind == kind) {
                Some(lamp) => lamp.shares.push(share),
                None => {
                    let uncertainty = source.uncertainty;
                    lamps.push(Lamp { kind, shares: vec![share], uncertainty, offset: 0.0 });
                }
            }
        }
    }
    let offsets: Vec<f64> = scenes.iter().map(|s| s.light_offset).collect();
    fit_sources(&mut lamps, &offsets);
    let with_sources = lit(setup).filter(|(_, scene)| !scene.sources.sources.is_empty());
    let repetition = |(k, scene): (usize, &RecordedScene)| Lamp {
        kind: LampKind::Repetition,
        shares: vec![(k, 1.0)],
        uncertainty: scene.sources.repeatability,
        offset: scene.light_offset - summed(&lamps, k),
    };
    let repetitions: Vec<Lamp> = with_sources.map(repetition).collect();
    lamps.extend(repetitions);
    lamps
}

impl Lamp {
    fn is_source(&self) -> bool {
        matches!(self.kind, LampKind::Source(_))
    }
}

/// Returns the indices of the recordings whose stated light is above zero. Static scenes of unknown light are
/// excluded, because their light is estimated from their rates.
fn lit(setup: &Setup) -> impl Iterator<Item = (usize, &RecordedScene)> {
    let is_lit = |(_, s): &(usize, &RecordedScene)| s.brightness() > 0.0 && s.static_scene.is_none();
    setup.recordings.iter().enumerate().filter(is_lit)
}

/// Replaces the found light of each recording with sources by the sum of its sources. The deviations of the sources
/// are those that agree best with the found light of all recordings. Returns whether the set has sources.
pub(crate) fn sum_sources(setup: &mut Setup) -> bool {
    let lamps = lamps_of(setup);
    for (k, recording) in setup.recordings.iter_mut().enumerate() {
        if !recording.sources.sources.is_empty() {
            recording.light_offset = summed(&lamps, k);
        }
    }
    lamps.iter().any(Lamp::is_source)
}

/// Returns the relative deviation of recording `k` that its sources cause.
fn summed(lamps: &[Lamp], k: usize) -> f64 {
    let of_lamp =
        |lamp: &Lamp| lamp.shares.iter().filter(|s| s.0 == k).map(|s| s.1 * lamp.offset).sum::<f64>();
    lamps.iter().filter(|lamp| lamp.is_source()).map(of_lamp).sum()
}

/// Fits the deviations of the sources to the deviations `offsets` of the recordings by least squares.
fn fit_sources(lamps: &mut [Lamp], offsets: &[f64]) {
    let mut sources: Vec<&mut Lamp> = lamps.iter_mut().filter(|lamp| lamp.is_source()).collect();
    if sources.is_empty() {
        return;
    }
    let mut shares = DMatrix::zeros(offsets.len(), sources.len());
    for (s, lamp) in sources.iter().enumerate() {
        lamp.shares.iter().for_each(|(k, share)| shares[(*k, s)] = *share);
    }
    // If the recording of a single source was excluded, the recordings with several sources may not determine each
    // source. Many solutions then fit equally well. The small ridge selects the solution with the smallest
    // deviations.
    let ridge = DMatrix::identity(sources.len(), sources.len()) * 1e-12;
    let right = shares.transpose() * DVector::from_column_slice(offsets);
    let Some(factor) = (shares.transpose() * &shares + ridge).cholesky() else { return };
    sources.iter_mut().zip(factor.solve(&right).iter()).for_each(|(lamp, z)| lamp.offset = *z);
}
