//! The camera of a recording set, as the user describes it.

use serde::{Deserialize, Serialize};
use spikelane::error::{Error, ErrorKind, Result};
use spikelane_measure::report::Table;

/// Largest number of characters of a text in the description.
const MAX_TEXT: usize = 200;

/// Absolute zero in degrees Celsius.
const ABSOLUTE_ZERO_C: f64 = -273.15;

/// Description of the camera that made a recording set. Reports print it. It has no influence on results.
///
/// # Examples
/// ```
/// use spikelane_calibrate::RecordingSet;
/// let text = "width = 400\nheight = 250\nreadout_hz = 20000\n[camera]\nserial = \"0042\"\ntemperature_c = 31.5\n\
///             [[recording]]\nfile = \"dark.dat\"\nlight = 0.0\n";
/// let camera = RecordingSet::parse(text, "recordings".into())?.camera.unwrap();
/// assert_eq!(camera.rows(), [("serial number", "0042".to_owned()), ("temperature", "31.5 °C".to_owned())]);
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct RecordedCamera {
    /// Name or model.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Serial number.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub serial: Option<String>,
    /// Temperature of the sensor during the recordings, in degrees Celsius.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub temperature_c: Option<f64>,
    /// Date of the recordings.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub date: Option<String>,
}

impl RecordedCamera {
    /// Checks that texts are one line each and that the temperature is possible.
    pub(crate) fn check(&self) -> Result<()> {
        let texts =
            [("camera.name", &self.name), ("camera.serial", &self.serial), ("camera.date", &self.date)];
        for (key, text) in texts {
            if let Some(text) = text
                && (text.chars().count() > MAX_TEXT || text.chars().any(char::is_control))
            {
                return Err(Error::new(ErrorKind::Config, key)
                    .found(format_args!("{} characters", text.chars().count()))
                    .expected(format_args!("one line of at most {MAX_TEXT} characters")));
            }
        }
        match self.temperature_c {
            Some(t) if !(t.is_finite() && t > ABSOLUTE_ZERO_C) => {
                Err(Error::new(ErrorKind::Config, "camera.temperature_c")
                    .found(t)
                    .expected("degrees Celsius"))
            }
            _ => Ok(()),
        }
    }

    /// Returns the table of a report.
    pub(crate) fn table(&self) -> Table {
        let mut table = Table::new("Recorded camera", &["property", "value"]);
        self.rows().into_iter().for_each(|(title, text)| table.push_row([title.to_owned(), text]));
        table
    }

    /// Returns the title and the text of each entry.
    #[must_use]
    pub fn rows(&self) -> Vec<(&'static str, String)> {
        let entries = [
            ("recorded camera", self.name.clone()),
            ("serial number", self.serial.clone()),
            ("temperature", self.temperature_c.map(|t| format!("{t} °C"))),
            ("date of the recordings", self.date.clone()),
        ];
        entries.into_iter().filter_map(|(title, text)| Some((title, text?))).collect()
    }
}

#[cfg(test)]
mod tests {
    use crate::RecordingSet;

    fn parsed(camera: &str) -> spikelane::error::Result<RecordingSet> {
        let text = format!(
            "width = 8\nheight = 8\nreadout_hz = 20000\n[camera]\n{camera}\n[[recording]]\nfile = \"dark.dat\"\nlight = 0.0\n"
        );
        RecordingSet::parse(&text, "recordings".into())
    }

    #[test]
    fn a_description_survives_writing_and_reading() {
        let set =
            parsed("name = \"A\"\nserial = \"1\"\ntemperature_c = -3.5\ndate = \"2026-11-27\"").unwrap();
        let again = RecordingSet::parse(&set.to_toml().unwrap(), set.folder.clone()).unwrap();
        assert_eq!(again, set);
        assert_eq!(again.camera.unwrap().rows().len(), 4);
    }

    #[test]
    fn impossible_descriptions_are_rejected_by_key() {
        let cases = [
            ("temperature_c = -300.0", "camera.temperature_c"),
            ("temperature_c = nan", "camera.temperature_c"),
            ("serial = \"1\\u001b[2J\"", "camera.serial"),
            ("name = \"two\\nlines\"", "camera.name"),
        ];
        for (text, key) in cases {
            assert_eq!(parsed(text).unwrap_err().subject(), key, "{text}");
        }
    }
}
