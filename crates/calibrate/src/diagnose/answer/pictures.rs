//! What a set looks like: maps, spectra and intervals for the report, of the data and of a model.

use crate::RecordingSet;
use crate::diagnose::null::reference::NullModel;
use crate::diagnose::protocol::recorded_set::Setup;
use crate::diagnose::recording::scan::Scan;
use crate::diagnose::sensors::model::Model;
use crate::diagnose::sensors::sample::Sample;
use crate::diagnose::sensors::simulate;
use crate::diagnose::statistics::lines::lines;
use crate::diagnose::statistics::readouts::power;
use spikelane::error::Result;
use spikelane::spikes::{SpikeFramesRef, bit};
use spikelane::unstable::threads;

/// Bins of an interval's length over its pixel's mean, up to [`LONGEST`].
const BINS: usize = 40;
const LONGEST: f64 = 2.0;

/// Points of a spectrum, equally spaced in the frequency's logarithm.
const POINTS: usize = 60;

/// Further sensors of the final model. A point of yet another one's spectrum lies outside of theirs twice in so many and one.
pub(in crate::diagnose) const FURTHER: usize = 20;

/// Points of a curve, by rising x.
pub(crate) type Points = Vec<(f64, f64)>;

/// The name of a recording, and the points of a curve.
pub type NamedCurve = (String, Points);

/// Plot data of one set.
#[derive(Clone, Debug, Default)]
pub struct SetPlots {
    /// Pixels in a row; `None` without maps.
    pub width: Option<usize>,
    /// Gain, and dark current in thresholds per readout, of every pixel, top row first; `None` without flats.
    pub maps: Option<[Vec<f64>; 2]>,
    /// Spectrum of one recording: its name, and power over frequency in hertz. The power is relative to that of
    /// independent pixels.
    pub spectrum: Option<NamedCurve>,
    /// Lowest and highest power of the spectra of 20 further sensors of the model.
    pub spectrum_range: Option<[Points; 2]>,
    /// Intervals of one recording: its name, and the share of the intervals over their length. The length is relative
    /// to the pixel's mean.
    pub intervals: Option<NamedCurve>,
}

/// Pictures of the data, of the base model and of the final one.
pub(in crate::diagnose) fn pictures(
    reference: &NullModel,
    set: &RecordingSet,
    scans: &[Scan],
    last: (&Model, &[f64]),
) -> Result<Vec<(&'static str, SetPlots)>> {
    let setup = &reference.setup;
    if setup.has_rate_maps || setup.recordings.iter().any(|s| s.static_scene.is_some()) {
        return Ok(Vec::new());
    }
    let base = reference.model.sample(&[], &[], setup.recordings.len())?;
    let model = last.0.sample(last.1, &[], setup.recordings.len())?;
    let data = picture(setup, scans, |k| setup.read(set, k))?;
    let simulated = |sample: &Sample| {
        let seed = reference.seed + 90_000;
        picture(setup, &simulate::scans(setup, sample, seed)?, |k| simulate::bits(setup, sample, k, seed))
    };
    let range = range(reference, &model)?;
    let before = simulated(&base)?;
    let is_same = last.1.iter().all(|u| *u == 0.0);
    let after = if is_same { before.clone() } else { simulated(&model)? };
    let after = SetPlots { spectrum_range: range, ..after };
    Ok(vec![("recordings", data), ("model before", before), ("model after", after)])
}

/// The flat that the spectrum is of: the one nearest to half of full scale.
fn middle(setup: &Setup) -> Option<usize> {
    flats(setup).min_by(|a, b| (a.1 - 0.5).abs().total_cmp(&(b.1 - 0.5).abs())).map(|(k, _)| k)
}

/// Flats and their light.
fn flats(setup: &Setup) -> impl Iterator<Item = (usize, f64)> {
    setup.recordings.iter().enumerate().filter_map(|(k, s)| Some((k, s.level()?))).filter(|f| f.1 > 0.0)
}

fn range(reference: &NullModel, sample: &Sample) -> Result<Option<[Points; 2]>> {
    let setup = &reference.setup;
    let Some(k) = middle(setup) else { return Ok(None) };
    let spectrum = |i: usize| {
        let scan = simulate::scan_of_recording(setup, sample, k, reference.seed + 91_000 + i as u64)?;
        Ok(smooth(&scan.totals, setup.readout_hz))
    };
    let all = threads::try_map(0..FURTHER, spectrum)?;
    let ends = |pick: fn(f64, f64) -> f64| {
        let at = |i: usize| (all[0][i].0, all.iter().map(|s| s[i].1).reduce(pick).unwrap_or_default());
        (0..all[0].len()).map(at).collect()
    };
    Ok(Some([ends(f64::min), ends(f64::max)]))
}

fn picture(setup: &Setup, scans: &[Scan], bits: impl Fn(usize) -> Result<Vec<u8>>) -> Result<SetPlots> {
    let intervals = match flats(setup).min_by(|a, b| a.1.total_cmp(&b.1)) {
        Some((k, _)) => Some((setup.recordings[k].name.clone(), lengths(setup, &bits(k)?)?)),
        None => None,
    };
    Ok(SetPlots {
        width: Some(setup.geometry.width()),
        maps: lines(setup, scans).map(|l| [l.gain, l.dark]),
        spectrum: middle(setup)
            .map(|k| (setup.recordings[k].name.clone(), smooth(&scans[k].totals, setup.readout_hz))),
        intervals,
        spectrum_range: None,
    })
}

/// Shares of intervals by their length over their own pixel's mean.
fn lengths(setup: &Setup, bytes: &[u8]) -> Result<Vec<(f64, f64)>> {
    let frames = SpikeFramesRef::new(setup.geometry, bytes)?;
    let mut bins = [0.0; BINS];
    for p in 0..setup.geometry.pixels() {
        let times: Vec<usize> =
            frames.iter().enumerate().filter(|(_, f)| bit(f.as_bytes(), p)).map(|(t, _)| t).collect();
        let (Some(first), Some(last)) = (times.first(), times.last()) else { continue };
        let mean = (last - first) as f64 / (times.len() - 1).max(1) as f64;
        for pair in times.windows(2) {
            let place = (pair[1] - pair[0]) as f64 / mean / LONGEST * BINS as f64;
            bins[(place as usize).min(BINS - 1)] += 1.0;
        }
    }
    let all = bins.iter().sum::<f64>().max(1.0);
    Ok(bins.iter().enumerate().map(|(i, n)| ((i as f64 + 0.5) * LONGEST / BINS as f64, n / all)).collect())
}

/// Mean power in bands of equal ratio.
fn smooth(totals: &[u32], readout_hz: f64) -> Vec<(f64, f64)> {
    let power = power(totals);
    let n = totals.len().max(1) as f64;
    let edge = |i: usize| (power.len() as f64).powf(i as f64 / POINTS as f64);
    let band = |i: usize| {
        let (from, to) = (edge(i).floor() as usize, edge(i + 1).ceil() as usize);
        let part = power.get(from.max(1)..to.min(power.len()))?;
        let mean = part.iter().sum::<f64>() / part.len() as f64;
        (!part.is_empty()).then(|| ((edge(i) * edge(i + 1)).sqrt() * readout_hz / n, mean))
    };
    (0..POINTS).filter_map(band).collect()
}
