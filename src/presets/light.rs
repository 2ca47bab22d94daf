//! The `[light]` table of a camera file.

use serde::{Deserialize, Serialize};
use toml::Value;

use crate::error::{Error, Result, error};
use crate::sensor::{FrontEnd, FullScale, Transfer};

/// The `[light]` table of a camera file, which describes a [`FrontEnd`]. Missing keys have default values.
#[derive(Clone, Debug, Default, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Table {
    #[serde(skip_serializing_if = "Option::is_none")]
    transfer: Option<Value>,
    #[serde(skip_serializing_if = "Option::is_none")]
    luminance: Option<[f64; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    gray_codes: Option<bool>,
    #[serde(skip_serializing_if = "Option::is_none")]
    full_scale: Option<Value>,
}

impl Table {
    /// Returns the table for a front end, or `None` if the front end equals the default.
    pub(crate) fn from_front_end(light: &FrontEnd) -> Option<Self> {
        (*light != FrontEnd::default()).then(|| Self {
            transfer: light.transfer.map(|t| match t {
                Transfer::Gamma(exponent) => Value::Float(exponent),
                named => Value::String(named.to_string()),
            }),
            luminance: Some(light.luminance),
            gray_codes: Some(light.gray_codes),
            full_scale: Some(match light.full_scale {
                FullScale::Code(code) => Value::Float(code),
                FullScale::Peak => Value::String("peak".to_owned()),
            }),
        })
    }

    pub(crate) fn front_end(&self) -> Result<FrontEnd> {
        let default = FrontEnd::default();
        let light = FrontEnd {
            transfer: self.transfer.as_ref().map(transfer).transpose()?,
            luminance: self.luminance.unwrap_or(default.luminance),
            gray_codes: self.gray_codes.unwrap_or(default.gray_codes),
            full_scale: self.full_scale.as_ref().map_or(Ok(default.full_scale), full_scale)?,
        };
        light.validate()
    }
}

fn transfer(value: &Value) -> Result<Transfer> {
    let text = match value {
        Value::String(text) => text.clone(),
        other => other.to_string(),
    };
    // The accepted words are those of the command line. The kind is changed to `Config`, because the error is in a file.
    text.parse().map_err(|e: Error| error!(Config, "transfer"; found "{e}"))
}

fn full_scale(value: &Value) -> Result<FullScale> {
    match value {
        Value::Float(code) => Ok(FullScale::Code(*code)),
        Value::Integer(code) => Ok(FullScale::Code(*code as f64)),
        Value::String(word) if word == "peak" => Ok(FullScale::Peak),
        other => Err(error!(Config, "full_scale"; found "{other}";
            expected "the 8-bit code that is light 1.0, such as 255, or \"peak\"")),
    }
}
