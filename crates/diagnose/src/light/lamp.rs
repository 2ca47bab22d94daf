//! The deviations of the light from the stated light, as independent parameters.
//!
//! The light of recording `k` is the stated light times `1 + e_k`. A recording without sources has a lamp of its own, and `e_k`
//! is the deviation of this lamp. A recording with sources has `e_k = sum_s w_ks z_s + r_k`: `w_ks` is the share of source `s` in
//! the stated light, `z_s` the deviation of the source in all recordings, and `r_k` the deviation from one recording to another.

use crate::recordings::recorded_scene::RecordedScene;
use crate::recordings::setup::Setup;
use nalgebra::{DMatrix, DVector};

/// What a deviation belongs to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum LampKind {
    /// The lamp of one recording.
    Recording,
    /// A source of one or several recordings.
    Source(String),
    /// The sources of one recording, from one recording to another.
    Repetition,
}

/// A relative deviation of the light.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Lamp {
    pub kind: LampKind,
    /// The recordings that it lights, each with its share of the stated light.
    pub shares: Vec<(usize, f64)>,
    /// Standard deviation of the relative deviation, as it is known before the recordings are seen.
    pub uncertainty: f64,
    /// The deviation at which sensors are simulated.
    pub offset: f64,
}

/// Returns the lamps and sources of all lit recordings, at the found light.
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

/// Returns the recordings of stated light above zero. The light of an unknown scene follows from its rates.
fn lit(setup: &Setup) -> impl Iterator<Item = (usize, &RecordedScene)> {
    let is_lit = |(_, s): &(usize, &RecordedScene)| s.brightness() > 0.0 && s.static_scene.is_none();
    setup.recordings.iter().enumerate().filter(is_lit)
}

/// Moves the found light of recordings with sources to the sums of the sources that agree best with all recordings. Returns
/// whether there are sources.
pub(crate) fn sum_sources(setup: &mut Setup) -> bool {
    let lamps = lamps_of(setup);
    for (k, recording) in setup.recordings.iter_mut().enumerate() {
        if !recording.sources.sources.is_empty() {
            recording.light_offset = summed(&lamps, k);
        }
    }
    lamps.iter().any(Lamp::is_source)
}

/// The deviation of recording `k` by its sources.
fn summed(lamps: &[Lamp], k: usize) -> f64 {
    let of_lamp =
        |lamp: &Lamp| lamp.shares.iter().filter(|s| s.0 == k).map(|s| s.1 * lamp.offset).sum::<f64>();
    lamps.iter().filter(|lamp| lamp.is_source()).map(of_lamp).sum()
}

/// Fits the deviations of the sources to those of the recordings by least squares.
fn fit_sources(lamps: &mut [Lamp], offsets: &[f64]) {
    let mut sources: Vec<&mut Lamp> = lamps.iter_mut().filter(|lamp| lamp.is_source()).collect();
    if sources.is_empty() {
        return;
    }
    let mut shares = DMatrix::zeros(offsets.len(), sources.len());
    for (s, lamp) in sources.iter().enumerate() {
        lamp.shares.iter().for_each(|(k, share)| shares[(*k, s)] = *share);
    }
    // If the recording of a source alone was excluded, sums may not separate the sources. The small ridge then chooses the
    // least deviations.
    let ridge = DMatrix::identity(sources.len(), sources.len()) * 1e-12;
    let right = shares.transpose() * DVector::from_column_slice(offsets);
    let Some(factor) = (shares.transpose() * &shares + ridge).cholesky() else { return };
    sources.iter_mut().zip(factor.solve(&right).iter()).for_each(|(lamp, z)| lamp.offset = *z);
}
