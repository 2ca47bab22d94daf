//! What a recording says, as the JSON of `spikelane measure` and of Python.

use serde_json::{Value, json};

use super::{MEANING, Recording};
use crate::error::{Error, Kind, Result};
use crate::measure::{TotalsLine, frame_total_lines, summarise};

impl Recording {
    /// Everything that is told; what cannot be told has no key.
    ///
    /// # Errors
    /// As [`summarise`] and [`frame_total_lines`].
    pub fn to_json(&self) -> Result<Value> {
        let wrong = |e: serde_json::Error| Error::new(Kind::Config, "measurement").found(e);
        let summary = summarise(&self.statistics)?;
        let lines: Vec<_> = frame_total_lines(&self.statistics)?.iter().map(line).collect();
        let mut result = json!({
            "meaning": MEANING, "readouts": summary.readouts,
            "statistics": serde_json::to_value(self.told()?).map_err(wrong)?,
            "defects": serde_json::to_value(&summary.defects).map_err(wrong)?,
            "scene": serde_json::to_value(self.motion()).map_err(wrong)?,
            "frame_total_lines": lines,
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
