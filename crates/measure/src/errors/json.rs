//! What a recording says, as the JSON of `spikelane measure` and of Python.

use serde_json::{Value, json};

use super::{MEANING, Motion, Recording, Told};
use crate::{Summary, TotalsLine, frame_total_lines, summarise};
use spikelane::error::{Error, Kind, Result};
use spikelane::unstable::threads;

/// Everything that is told of a recording.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Said {
    /// Rates, spreads and defects.
    pub summary: Summary,
    /// Every statistic with its errors.
    pub told: Vec<Told>,
    /// Whether the scene moved.
    pub motion: Motion,
    /// The strongest lines in the spectrum of frame totals.
    pub lines: Vec<TotalsLine>,
}

impl Recording {
    /// Works out everything that is told.
    ///
    /// # Errors
    /// As [`summarise`], and where the spectrum of the totals cannot be told.
    pub fn said(&self) -> Result<Said> {
        let summary = summarise(&self.statistics)?;
        let of_readouts = || threads::join(|| self.motion(), || frame_total_lines(&self.statistics));
        let (told, (motion, lines)) = threads::join(|| self.told_with(&summary), of_readouts);
        Ok(Said { told, summary, motion, lines: lines? })
    }
}

impl Said {
    /// As JSON; what cannot be told has no key.
    ///
    /// # Errors
    /// Never, in practice: every value has a text.
    pub fn to_json(&self) -> Result<Value> {
        let wrong = |e: serde_json::Error| Error::new(Kind::Config, "measurement").found(e);
        let summary = &self.summary;
        let mut result = json!({
            "meaning": MEANING, "readouts": summary.readouts,
            "statistics": serde_json::to_value(&self.told).map_err(wrong)?,
            "defects": serde_json::to_value(&summary.defects).map_err(wrong)?,
            "scene": serde_json::to_value(self.motion).map_err(wrong)?,
            "frame_total_lines": self.lines.iter().map(line).collect::<Vec<_>>(),
        });
        if summary.temporal_of_rate.is_finite() {
            result["temporal_of_rate"] = json!(summary.temporal_of_rate);
        }
        Ok(result)
    }
}

fn line(found: &TotalsLine) -> Value {
    let mut line = json!({
        "frequency": found.line.frequency, "power": found.line.power, "prominence": found.line.prominence,
    });
    if let Some(k) = found.harmonic {
        line["harmonic_of_pixel_rate"] = json!(k);
    }
    line
}
