//! The report of a recording, and the JSON of the report for `spikelane measure` and Python.

use serde_json::{Value, json};

use super::{ERROR_MEANING, MeasuredRecording, ReportedStatistic, SceneMotion};
use crate::{
    CellSummary, FrameTotalLine, Summary, frame_total_lines, summarize, summarize_cells, summarize_mosaic,
};
use spikelane::error::{Error, ErrorKind, Result};
use spikelane::sensor::Mosaic;
use spikelane::unstable::threads;

/// All reported results of a recording.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct MeasurementReport {
    /// Rates, non-uniformities and defects.
    pub summary: Summary,
    /// Summaries of the cells of the mosaic. Empty for a gray camera.
    pub cells: Vec<CellSummary>,
    /// All statistics with their errors.
    pub statistics: Vec<ReportedStatistic>,
    /// Whether the scene moved.
    pub scene_motion: SceneMotion,
    /// The most prominent lines in the spectrum of the frame totals.
    pub frame_total_lines: Vec<FrameTotalLine>,
}

impl MeasuredRecording {
    /// Computes all reported results.
    ///
    /// # Errors
    /// Those of [`summarize`] and [`frame_total_lines`].
    pub fn report(&self) -> Result<MeasurementReport> {
        self.report_with_mosaic(None)
    }

    /// Computes all reported results. If the camera has a mosaic, pixels are compared only with pixels that have the same
    /// filter, and the report has a summary of each cell of the pattern.
    ///
    /// # Errors
    /// Those of [`summarize`] and [`frame_total_lines`].
    pub fn report_with_mosaic(&self, mosaic: Option<&Mosaic>) -> Result<MeasurementReport> {
        let (summary, cells) = match mosaic {
            Some(mosaic) => {
                (summarize_mosaic(&self.statistics, mosaic)?, summarize_cells(&self.statistics, mosaic)?)
            }
            None => (summarize(&self.statistics)?, Vec::new()),
        };
        let of_readouts = || threads::join(|| self.scene_motion(), || frame_total_lines(&self.statistics));
        let (statistics, (motion, lines)) = threads::join(|| self.report_statistics(&summary), of_readouts);
        Ok(MeasurementReport { statistics, summary, cells, scene_motion: motion, frame_total_lines: lines? })
    }
}

impl MeasurementReport {
    /// Returns the report as JSON. A value that was not determined has no key.
    ///
    /// # Errors
    /// [`ErrorKind::Config`] if a value cannot be serialized, which does not occur in practice.
    pub fn to_json(&self) -> Result<Value> {
        let wrong = |e: serde_json::Error| Error::new(ErrorKind::Config, "measurement").found(e);
        let summary = &self.summary;
        let mut result = json!({
            "error_meaning": ERROR_MEANING, "readouts": summary.readouts,
            "statistics": serde_json::to_value(&self.statistics).map_err(wrong)?,
            "defects": serde_json::to_value(&summary.defects).map_err(wrong)?,
            "scene_motion": serde_json::to_value(self.scene_motion).map_err(wrong)?,
            "frame_total_lines": self.frame_total_lines.iter().map(line_json).collect::<Vec<_>>(),
        });
        if !self.cells.is_empty() {
            result["cells"] = self.cells.iter().map(CellSummary::to_json).collect();
        }
        if summary.temporal_rate_sd.is_finite() {
            result["temporal_rate_sd"] = json!(summary.temporal_rate_sd);
        }
        Ok(result)
    }
}

fn line_json(spectral_line: &FrameTotalLine) -> Value {
    let mut line = json!({
        "frequency": spectral_line.line.frequency, "power": spectral_line.line.power, "prominence": spectral_line.line.prominence,
    });
    if let Some(k) = spectral_line.harmonic {
        line["harmonic_of_pixel_rate"] = json!(k);
    }
    line
}
