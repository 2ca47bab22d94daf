//! The `[sensor.mosaic]` table of a camera file.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::error::{Result, error};
use crate::sensor::Mosaic;

/// The `[sensor.mosaic]` table of a camera file. The keys of the inner tables are letters of the pattern.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Table {
    pattern: String,
    /// Weights of linear red, green and blue.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    response: BTreeMap<String, [f64; 3]>,
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    gain: BTreeMap<String, f64>,
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    infrared: BTreeMap<String, f64>,
}

impl Table {
    pub(crate) fn from_mosaic(mosaic: &Mosaic) -> Self {
        let channels = || mosaic.channels().iter().map(|c| (c.name.to_string(), c));
        Self {
            pattern: mosaic.to_string(),
            response: channels().map(|(name, c)| (name, c.response)).collect(),
            gain: channels().map(|(name, c)| (name, c.gain)).collect(),
            infrared: channels().map(|(name, c)| (name, c.infrared)).collect(),
        }
    }

    pub(crate) fn mosaic(&self) -> Result<Mosaic> {
        let responses = self.response.iter().map(|(name, weights)| Ok((letter("response", name)?, *weights)));
        let mut mosaic = Mosaic::new(&self.pattern, &responses.collect::<Result<Vec<_>>>()?)?;
        for (name, gain) in &self.gain {
            let (name, infrared) = (letter("gain", name)?, self.infrared.get(name).copied().unwrap_or(0.0));
            mosaic = mosaic.with_channel(name, *gain, infrared)?;
        }
        for (name, infrared) in self.infrared.iter().filter(|(name, _)| !self.gain.contains_key(*name)) {
            mosaic = mosaic.with_channel(letter("infrared", name)?, 1.0, *infrared)?;
        }
        Ok(mosaic)
    }
}

fn letter(key: &str, name: &str) -> Result<char> {
    let mut letters = name.chars();
    match (letters.next(), letters.next()) {
        (Some(letter), None) => Ok(letter),
        _ => Err(error!(Config, "{key}"; found "the channel \"{name}\"";
            expected "one letter of the pattern")),
    }
}
