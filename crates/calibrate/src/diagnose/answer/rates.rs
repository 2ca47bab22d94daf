//! The rates of the uniform recordings as a function of the light, with their residuals.

use serde::Serialize;

use crate::diagnose::null::reference::NullModel;
use crate::diagnose::recording::scan::Scan;
use crate::diagnose::search::search::Found;
use nalgebra::DVector;
use spikelane::error::Result;
use spikelane_measure::report::{Curve, PageElement, ShadedBand, marked_line_plot};

/// Name of the statistic that contains the residuals, in thousandths of the light.
const STATISTIC: &str = "rate against the pixel's line";
const PER_UNIT: f64 = 1e3;

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
    /// Deviation of the rates from the initial model, relative to the light, or to 0.01 for a darker recording. The lines
    /// of the pixels through all levels are subtracted from both.
    pub initial_residual: f64,
    /// Deviation from the final model.
    pub final_residual: f64,
    /// Standard deviation of the residuals between sensors that follow the model, at known light.
    pub error: f64,
}

/// Returns the residuals of all uniform recordings in ascending order of light.
pub(in crate::diagnose) fn rate_residuals(
    reference: &NullModel,
    found: &Found,
    data: &DVector<f64>,
    scans: &[Scan],
) -> Vec<RateResidual> {
    let one = |(i, statistic): (usize, &crate::diagnose::DiagnosticStatistic)| {
        let k = statistic.recording.filter(|_| statistic.name == STATISTIC)?;
        let (recording, scan) = (&reference.setup.recordings[k], scans.get(k)?);
        Some(RateResidual {
            file: recording.file_name(),
            light: recording.level()?,
            mean_rate: scan.pixels.iter().map(|p| p.rate).sum::<f64>() / scan.pixels.len() as f64,
            initial_residual: (data[i] - reference.mean[i]) / PER_UNIT,
            final_residual: (data[i] - found.own.mean[i]) / PER_UNIT,
            error: reference.spread[i] / PER_UNIT,
        })
    };
    let mut rates: Vec<RateResidual> = reference.statistics.iter().enumerate().filter_map(one).collect();
    rates.sort_by(|a, b| a.light.total_cmp(&b.light));
    rates
}

/// Plots the rates and their residuals. Returns nothing for fewer than two recordings.
///
/// # Errors
/// If a plot cannot be drawn.
pub(super) fn rate_figures(rates: &[RateResidual], has_additions: bool) -> Result<Vec<PageElement>> {
    if rates.len() < 2 {
        return Ok(Vec::new());
    }
    let points = |value: &dyn Fn(&RateResidual) -> f64| rates.iter().map(|r| (r.light, value(r))).collect();
    let axis = "stated light, relative to saturation";
    let rate = marked_line_plot(
        "Mean rate",
        (axis, "spikes per readout"),
        &[Curve { name: "recorded", points: points(&|r| r.mean_rate) }],
        None,
    )?;
    let band = ShadedBand {
        name: "simulated sensors",
        low: points(&|r| -200.0 * r.error),
        high: points(&|r| 200.0 * r.error),
    };
    let (before, after) = if has_additions { ("initial model", "final model") } else { ("model", "") };
    let mut curves = vec![Curve { name: before, points: points(&|r| 100.0 * r.initial_residual) }];
    if has_additions {
        curves.push(Curve { name: after, points: points(&|r| 100.0 * r.final_residual) });
    }
    let residual = marked_line_plot("Rate minus model", (axis, "% of the light"), &curves, Some(&band))?;
    Ok(vec![
        PageElement::heading("Rates"),
        PageElement::figure(rate, "Mean rate of all pixels of each uniform recording."),
        PageElement::figure(
            residual,
            "Deviation of the rates from the model at the found light. The band is two standard deviations between simulated sensors. The lines of the pixels through all levels are \
             subtracted from the recordings and from the model, so a wrong gain or dark current does not appear. A \
             curve that leaves the band shows a nonlinear response.",
        ),
    ])
}
