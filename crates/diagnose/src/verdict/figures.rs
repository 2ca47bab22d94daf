//! Figures of the report: rates with residuals, maps, spectra and intervals of the recordings and of the models.

use crate::null_model::model::NullModel;
use crate::recordings::scan::Scan;
use crate::recordings::setup::Setup;
use crate::search::effect_search::SearchResult;
use crate::sensors::model::{Model, Sample};
use crate::sensors::simulate;
use crate::statistics::maps::fit_lines;
use crate::statistics::spectrum::power;
use crate::thresholds::RANGE_SENSORS;
use nalgebra::DVector;
use serde::Serialize;
use spikelane::error::Result;
use spikelane::spikes::{SpikeFramesRef, bit};
use spikelane::unstable::threads;
use spikelane_calibrate::RecordingSet;
use spikelane_measure::report::{PageElement, Plot, PlotPoint, heat_map};

/// Number of bins in which interval lengths are counted.
const INTERVAL_BINS: usize = 40;

/// Length at the upper end of the last bin, in mean intervals of the pixel.
const MAX_RELATIVE_INTERVAL: f64 = 2.0;

/// Number of points of a spectrum, equally spaced in the logarithm of the frequency.
const SPECTRUM_POINTS: usize = 60;

/// Name of the statistic that contains the residuals of the rates.
const RESIDUAL_STATISTIC: &str = "rate against the pixel's line";

/// Value of this statistic if the residual of the rate is 1.
const STATISTIC_UNITS: f64 = 1e3;

/// Points (x, y) of a curve, in ascending order of x.
pub(crate) type Points = Vec<(f64, f64)>;

/// Name of a recording, and points of its curve.
pub type NamedCurve = (String, Points);

/// Data of the plots of one set of recordings or simulations.
#[derive(Clone, Debug, Default)]
pub struct SetPlots {
    /// Number of pixels in a row; `None` without maps.
    pub width: Option<usize>,
    /// Gain, and dark current in thresholds per readout, of every pixel. The top row is first. `None` without
    /// uniform recordings.
    pub maps: Option<[Vec<f64>; 2]>,
    /// Spectrum of one recording: name of the recording, and power as a function of the frequency in hertz. The
    /// unit of the power is that of independent spikes.
    pub spectrum: Option<NamedCurve>,
    /// Lowest and highest power in the spectra of 20 further simulated sensors.
    pub spectrum_range: Option<[Points; 2]>,
    /// Intervals of one recording: name of the recording, and share of the intervals as a function of their length.
    /// The length is relative to the mean interval of the pixel.
    pub intervals: Option<NamedCurve>,
}

/// Returns the plot data of the recordings, of the initial model and of the final model.
pub(crate) fn set_plots(
    reference: &NullModel,
    set: &RecordingSet,
    scans: &[Scan],
    last: (&Model, &[f64]),
) -> Result<Vec<(&'static str, SetPlots)>> {
    let setup = &reference.setup;
    if setup.has_rate_maps || setup.recordings.iter().any(|s| s.static_scene.is_some()) {
        return Ok(Vec::new());
    }
    let base = reference.model.sample(&[], &[])?;
    let model = last.0.sample(last.1, &[])?;
    let data = plots_of(setup, scans, |k| setup.read(set, k))?;
    let simulated = |sample: &Sample| {
        let seed = reference.seed + 90_000;
        plots_of(setup, &simulate::scans(setup, sample, seed)?, |k| simulate::bits(setup, sample, k, seed))
    };
    let range = spectrum_range(reference, &model)?;
    let after = SetPlots { spectrum_range: range, ..simulated(&model)? };
    Ok(vec![("recordings", data), ("model before", simulated(&base)?), ("model after", after)])
}

/// Returns the index of the uniform recording whose spectrum is shown. Its light is nearest to half of saturation.
fn spectrum_recording(setup: &Setup) -> Option<usize> {
    flats(setup).min_by(|a, b| (a.1 - 0.5).abs().total_cmp(&(b.1 - 0.5).abs())).map(|(k, _)| k)
}

/// Returns the indices of the lit uniform recordings, with their light.
fn flats(setup: &Setup) -> impl Iterator<Item = (usize, f64)> {
    setup.recordings.iter().enumerate().filter_map(|(k, s)| Some((k, s.level()?))).filter(|f| f.1 > 0.0)
}

/// Returns the lowest and the highest power at each frequency in the spectra of simulated sensors.
fn spectrum_range(reference: &NullModel, sample: &Sample) -> Result<Option<[Points; 2]>> {
    let setup = &reference.setup;
    let Some(k) = spectrum_recording(setup) else { return Ok(None) };
    let spectrum = |i: usize| {
        let scan = simulate::scan_of_recording(setup, sample, k, reference.seed + 91_000 + i as u64)?;
        Ok(band_means(&scan.totals, setup.readout_hz))
    };
    let all = threads::try_map(0..RANGE_SENSORS, spectrum)?;
    let ends = |pick: fn(f64, f64) -> f64| {
        let at = |i: usize| (all[0][i].0, all.iter().map(|s| s[i].1).reduce(pick).unwrap_or_default());
        (0..all[0].len()).map(at).collect()
    };
    Ok(Some([ends(f64::min), ends(f64::max)]))
}

/// Returns the plot data of one set.
fn plots_of(setup: &Setup, scans: &[Scan], bits: impl Fn(usize) -> Result<Vec<u8>>) -> Result<SetPlots> {
    let intervals = match flats(setup).min_by(|a, b| a.1.total_cmp(&b.1)) {
        Some((k, _)) => Some((setup.recordings[k].name.clone(), interval_lengths(setup, &bits(k)?)?)),
        None => None,
    };
    Ok(SetPlots {
        width: Some(setup.geometry.width()),
        maps: fit_lines(setup, scans).map(|l| [l.gain, l.dark]),
        spectrum: spectrum_recording(setup)
            .map(|k| (setup.recordings[k].name.clone(), band_means(&scans[k].totals, setup.readout_hz))),
        intervals,
        spectrum_range: None,
    })
}

/// Returns the share of the intervals in each bin of length. The length is relative to the mean interval of the
/// pixel.
fn interval_lengths(setup: &Setup, bytes: &[u8]) -> Result<Vec<(f64, f64)>> {
    let frames = SpikeFramesRef::new(setup.geometry, bytes)?;
    let mut bins = [0.0; INTERVAL_BINS];
    for p in 0..setup.geometry.pixels() {
        let times: Vec<usize> =
            frames.iter().enumerate().filter(|(_, f)| bit(f.as_bytes(), p)).map(|(t, _)| t).collect();
        let (Some(first), Some(last)) = (times.first(), times.last()) else { continue };
        let mean = (last - first) as f64 / (times.len() - 1).max(1) as f64;
        for pair in times.windows(2) {
            let place = (pair[1] - pair[0]) as f64 / mean / MAX_RELATIVE_INTERVAL * INTERVAL_BINS as f64;
            bins[(place as usize).min(INTERVAL_BINS - 1)] += 1.0;
        }
    }
    let all = bins.iter().sum::<f64>().max(1.0);
    Ok(bins
        .iter()
        .enumerate()
        .map(|(i, n)| ((i as f64 + 0.5) * MAX_RELATIVE_INTERVAL / INTERVAL_BINS as f64, n / all))
        .collect())
}

/// Returns the mean power in each frequency band. The ratio between the ends of a band is the same for all bands.
fn band_means(totals: &[u32], readout_hz: f64) -> Vec<(f64, f64)> {
    let power = power(totals);
    let n = totals.len().max(1) as f64;
    let edge = |i: usize| (power.len() as f64).powf(i as f64 / SPECTRUM_POINTS as f64);
    let band = |i: usize| {
        let (from, to) = (edge(i).floor() as usize, edge(i + 1).ceil() as usize);
        let part = power.get(from.max(1)..to.min(power.len()))?;
        let mean = part.iter().sum::<f64>() / part.len() as f64;
        (!part.is_empty()).then(|| ((edge(i) * edge(i + 1)).sqrt() * readout_hz / n, mean))
    };
    (0..SPECTRUM_POINTS).filter_map(band).collect()
}

/// Returns the figure of the spectra. `curves` contains the name and the points of each curve.
fn spectrum(
    place: &str,
    curves: Vec<(&str, Points)>,
    plots: &[(&'static str, SetPlots)],
    added: bool,
) -> PageElement {
    let range = plots.iter().find_map(|(_, p)| p.spectrum_range.as_ref());
    let title = format!("Spectrum of the number of spikes per readout, {place}");
    let mut plot = Plot::new(title, "frequency, Hz", "power relative to independent spikes").log_x().log_y();
    if let Some([low, high]) = range {
        plot = plot.band("simulated sensors", low.clone(), high.clone());
    }
    let plot = curves.into_iter().fold(plot, |plot, (name, points)| plot.line(name, points));
    let model = if added { "the final model" } else { "the model" };
    plot.figure(match range {
        None => "Power, divided by the power of as many independent spikes.".to_owned(),
        Some(_) => format!(
            "Power, divided by the power of as many independent spikes. The band is the range of {RANGE_SENSORS} simulated sensors of {model}. A recording of such a sensor lies outside the band at one frequency in eleven."
        ),
    })
}

/// Returns the plots of the recordings, of the initial model and of the final model. If no effect was `added`, both
/// models are equal, and only one is shown.
///
/// # Errors
/// If a map cannot be encoded.
pub(crate) fn plot_sections(plots: &[(&'static str, SetPlots)], added: bool) -> Result<Vec<PageElement>> {
    let mut parts = Vec::new();
    let shown: Vec<(&'static str, &SetPlots)> = match plots {
        [recordings, before, _] if !added => vec![(recordings.0, &recordings.1), ("model", &before.1)],
        all => all.iter().map(|(name, p)| (*name, p)).collect(),
    };
    let curves = |of: fn(&SetPlots) -> &Option<NamedCurve>| {
        let all: Vec<(&str, Points)> =
            shown.iter().filter_map(|(name, p)| Some((*name, of(p).as_ref()?.1.clone()))).collect();
        (plots.iter().find_map(|(_, p)| Some(of(p).as_ref()?.0.clone())), all)
    };
    if let (Some(place), all) = curves(|p| &p.intervals) {
        let title = format!("Intervals of {place}");
        let plot = Plot::new(title, "interval, divided by the mean of the pixel", "share of the intervals");
        let plot = all.into_iter().fold(plot, |plot, (name, points)| plot.line(name, points));
        parts.push(plot.figure("Lengths of intervals, each divided by the mean interval of its pixel."));
    }
    if let (Some(place), all) = curves(|p| &p.spectrum) {
        parts.push(spectrum(&place, all, plots, added));
    }
    for (place, (what, unit)) in
        [("gain", "thresholds per readout at light 1"), ("dark current", "thresholds per readout")]
            .into_iter()
            .enumerate()
    {
        let maps: Vec<_> = shown.iter().filter_map(|(n, p)| Some((n, &p.maps.as_ref()?[place]))).collect();
        for (name, map) in maps {
            let width = plots.iter().find_map(|p| p.1.width).unwrap_or(1);
            parts.push(heat_map(
                &format!("Map of the {what}: {name}"),
                map,
                width,
                unit,
                "The colors span the 1st to the 99th percentile.",
            )?);
        }
    }
    Ok(parts)
}

/// The mean rate of a uniform recording, and its deviation from the models.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct RateResidual {
    /// File of the recording.
    pub file: String,
    /// Stated light, relative to saturation.
    pub light: f64,
    /// Mean rate of all pixels in spikes per readout.
    pub mean_rate: f64,
    /// Rate of the recordings minus rate of the initial model, divided by the light or by 0.01, whichever is larger.
    /// Before this, the straight line of rate against light through all levels is subtracted from the rates of each
    /// pixel, in the recordings and in the model.
    pub initial_residual: f64,
    /// Deviation of the rates from the final model, in the same unit.
    pub final_residual: f64,
    /// Standard deviation of the residuals between simulated sensors, at known light.
    pub error: f64,
}

/// Returns the residuals of all uniform recordings in ascending order of light.
pub(crate) fn rate_residuals(
    reference: &NullModel,
    found: &SearchResult,
    data: &DVector<f64>,
    scans: &[Scan],
) -> Vec<RateResidual> {
    let one = |(i, statistic): (usize, &crate::DiagnosticStatistic)| {
        let k = statistic.recording.filter(|_| statistic.name == RESIDUAL_STATISTIC)?;
        let (recording, scan) = (&reference.setup.recordings[k], scans.get(k)?);
        Some(RateResidual {
            file: recording.file_name(),
            light: recording.level()?,
            mean_rate: scan.pixels.iter().map(|p| p.rate).sum::<f64>() / scan.pixels.len() as f64,
            initial_residual: (data[i] - reference.mean[i]) / STATISTIC_UNITS,
            final_residual: (data[i] - found.last.own.mean[i]) / STATISTIC_UNITS,
            error: reference.spread[i] / STATISTIC_UNITS,
        })
    };
    let mut rates: Vec<RateResidual> = reference.statistics.iter().enumerate().filter_map(one).collect();
    rates.sort_by(|a, b| a.light.total_cmp(&b.light));
    rates
}

/// Plots the rates and their residuals. Returns nothing if the set has fewer than two uniform recordings.
pub(super) fn rate_figures(rates: &[RateResidual], has_additions: bool) -> Vec<PageElement> {
    if rates.len() < 2 {
        return Vec::new();
    }
    let line = |value: &dyn Fn(&RateResidual) -> f64| rates.iter().map(|r| (r.light, value(r))).collect();
    let points = |value: &dyn Fn(&RateResidual) -> f64| {
        rates.iter().map(|r| PlotPoint::new(r.light, value(r), 0.0)).collect()
    };
    let axis = "stated light, relative to saturation";
    let rate = Plot::new("Mean rate of each uniform recording", axis, "spikes per readout")
        .points("recorded", points(&|r| r.mean_rate));
    let (before, after) = if has_additions { ("initial model", "final model") } else { ("model", "") };
    let mut residual = Plot::new("Rate of the recordings minus the model", axis, "% of the light")
        .band("simulated sensors", line(&|r| -200.0 * r.error), line(&|r| 200.0 * r.error))
        .points(before, points(&|r| 100.0 * r.initial_residual));
    if has_additions {
        residual = residual.points(after, points(&|r| 100.0 * r.final_residual));
    }
    vec![
        PageElement::heading("Rates, intervals and maps"),
        rate.figure("Mean rate of all pixels."),
        residual.figure(
            "Deviation of the rates from the model at the found light. The band is two standard deviations between simulated sensors. The lines of the pixels through all levels are \
             subtracted from the recordings and from the model, so a wrong gain or dark current does not appear. \
             Points outside the band show a nonlinear response.",
        ),
    ]
}
