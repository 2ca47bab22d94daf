//! Curves: one quantity varies, and the scenes and all other quantities stay the same.

use serde::{Deserialize, Serialize};

use spikelane::effects::Camera;
use spikelane::error::{Error, Result};
use spikelane::unstable::inputs::PlainName;
use spikelane_dataset::{Content, DatasetOptions};
use spikelane_scene::Lighting;

use super::{Suite, config_error};

/// The quantity that a curve varies.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Quantity {
    /// Light on the sensor, relative to the camera of the suite, more than 0 and at most 1.
    Light,
    /// Speed of the car with the camera in km/h.
    SpeedKmh,
    /// Readouts per second. The light per second is constant, but a slower camera receives at most the light per readout
    /// of the camera of the suite.
    ReadoutHz,
    /// The only effect of the camera: the name of an effect, `none` or `all`.
    Effect,
    /// Name of a lighting preset of the scenes.
    Lighting,
}

/// A value of the quantity.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct CurveValue {
    /// Text of the value.
    pub label: String,
    /// The value, or the index of the value if the quantity is not a number.
    pub x: f64,
}

/// A quantity and its values.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Curve {
    /// Name.
    pub name: PlainName,
    /// The quantity.
    pub quantity: Quantity,
    /// The values.
    pub values: Vec<CurveValue>,
    /// Number of scenes at each value. They are the first scenes of the scored split.
    pub sequences: u32,
}

/// The point of a curve that a group belongs to.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct CurvePoint {
    /// Name of the curve.
    pub curve: PlainName,
    /// Text of the value.
    pub value: String,
    /// The value, or the index of the value if the quantity is not a number.
    pub x: f64,
}

/// The values `none` and `all` of [`Quantity::Effect`].
const NO_EFFECT: &str = "none";
const ALL_EFFECTS: &str = "all";

impl Quantity {
    /// Returns the name in suite files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Light => "light",
            Self::SpeedKmh => "speed_kmh",
            Self::ReadoutHz => "readout_hz",
            Self::Effect => "effect",
            Self::Lighting => "lighting",
        }
    }

    /// Returns the label of an axis.
    #[must_use]
    pub const fn axis_label(self) -> &'static str {
        match self {
            Self::Light => "light relative to the camera of the suite",
            Self::SpeedKmh => "speed, km/h",
            Self::ReadoutHz => "readout rate, Hz",
            Self::Effect => "effect of the camera",
            Self::Lighting => "lighting",
        }
    }

    /// Returns whether the values are numbers. Otherwise they are names.
    #[must_use]
    pub const fn is_numeric(self) -> bool {
        matches!(self, Self::Light | Self::SpeedKmh | Self::ReadoutHz)
    }

    /// Changes the data set of a group to a value of the quantity.
    pub(super) fn apply(self, value: &CurveValue, options: &mut DatasetOptions) -> Result<()> {
        let refused = |expected: &str| -> Error {
            config_error(format_args!("curve of {}", self.name())).found(&value.label).expected(expected)
        };
        let Content::Scenes(scenes) = &mut options.content else {
            return Err(refused("random scenes"));
        };
        match self {
            Self::SpeedKmh => scenes.speed_kmh = Some(value.x),
            Self::Lighting => {
                let lighting = Lighting::from_name(&value.label).ok_or_else(|| {
                    let names = Lighting::ALL.map(Lighting::name);
                    refused(&names.join(", ")).with_suggestion(&value.label, names)
                })?;
                scenes.lighting = vec![lighting];
            }
            Self::Light => {
                Suite::single_camera(options, self)?;
                if !(value.x > 0.0 && value.x <= 1.0) {
                    return Err(refused("more than 0 and at most 1"));
                }
                options.camera.sensor.thresholds_at_full_scale *= value.x;
            }
            Self::ReadoutHz => {
                Suite::single_camera(options, self)?;
                let sensor = &mut options.camera.sensor;
                let factor = sensor.readout_hz / value.x;
                if !(factor.is_finite() && factor > 0.0) {
                    return Err(refused("a positive number"));
                }
                sensor.thresholds_at_full_scale *= factor.min(1.0);
                sensor.readout_hz = value.x;
            }
            Self::Effect => {
                Suite::single_camera(options, self)?;
                let camera = &options.camera;
                let mut bare = Camera::ideal(camera.sensor);
                (bare.name, bare.source) = (camera.name.clone(), camera.source.clone());
                bare.front_end = camera.front_end;
                options.camera = match value.label.as_str() {
                    ALL_EFFECTS => camera.clone(),
                    NO_EFFECT => bare,
                    name => {
                        let effect = camera.effect(name).ok_or_else(|| {
                            let names = camera.effects().iter().map(spikelane::effects::Effect::name);
                            refused("none, all, or an effect of the camera of the suite")
                                .with_suggestion(name, names)
                        })?;
                        bare.with_effect(effect.clone())
                    }
                };
            }
        }
        Ok(())
    }
}
