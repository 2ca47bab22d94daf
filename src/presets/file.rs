//! Parsing of camera files.

use std::path::Path;

use serde::{Deserialize, Serialize};
use toml::{Table, Value};

use crate::effects::{Camera, Catalog, Effect};
use crate::error::quoting::toml_fault;
use crate::error::{Result, bail, error, excerpt};
use crate::presets::maps::{MapFolder, MapSource};
use crate::presets::{default_sensor, light, maps, mosaic};
use crate::sensor::Sensor;
use crate::spikes::{Crop, Geometry};
use crate::units::Unit;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    #[serde(default)]
    name: String,
    #[serde(default)]
    source: String,
    #[serde(default)]
    sensor: SensorTable,
    #[serde(default)]
    light: light::Table,
    #[serde(default)]
    effects: Table,
    #[serde(default)]
    maps: maps::Table,
    window: Option<WindowTable>,
}

/// The rectangle of the sensor that the window contains, in pixels.
#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct WindowTable {
    row: usize,
    col: usize,
    height: usize,
    width: usize,
}

impl WindowTable {
    pub(crate) fn from_crop(crop: Crop) -> Self {
        Self { row: crop.row, col: crop.col, height: crop.height, width: crop.width }
    }

    fn crop(&self) -> Crop {
        Crop { row: self.row, col: self.col, width: self.width, height: self.height }
    }
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct SensorTable {
    width: Option<u32>,
    height: Option<u32>,
    readout_rate: Option<Value>,
    capacitance: Option<Value>,
    swing: Option<Value>,
    thresholds_at_full_scale: Option<Value>,
    mosaic: Option<mosaic::Table>,
}

/// Parses the text of a camera file. `folder` contains the map files.
///
/// # Examples
/// ```
/// use spikelane::presets;
/// let text = "
/// [sensor]
/// width = 64
/// height = 48
/// readout_rate = \"40 kHz\"
/// [effects.prnu]
/// sigma = 0.02
/// ";
/// let camera = presets::from_toml(text, None)?;
/// assert_eq!(camera.sensor.readout_hz, 40_000.0);
/// assert_eq!(camera.effects()[0].get("sigma")?, 0.02);
///
/// let error = presets::from_toml("[sensor]\nreadout_rate = 40000", None).unwrap_err();
/// assert!(error.to_string().contains("a number with its unit (Hz, kHz, MHz)"));
/// # Ok::<(), spikelane::Error>(())
/// ```
///
/// # Errors
/// Returns [`ErrorKind::Config`](crate::ErrorKind::Config) if
/// * the text is not TOML,
/// * a key is unknown,
/// * a unit is wrong or missing,
/// * a value is out of range,
/// * the window is outside the sensor.
///
/// Returns [`ErrorKind::Input`](crate::ErrorKind::Input), [`ErrorKind::Io`](crate::ErrorKind::Io) or [`ErrorKind::Corrupt`](crate::ErrorKind::Corrupt) if a map is invalid, missing or changed.
pub fn from_toml(text: &str, folder: Option<&Path>) -> Result<Camera> {
    Catalog::new().camera_from_toml(text, folder)
}

impl Catalog {
    /// Parses the text of a camera file. The camera may have any effect of this catalog. `folder` contains the map files.
    ///
    /// # Errors
    /// Returns the errors of [`from_toml`].
    pub fn camera_from_toml(&self, text: &str, folder: Option<&Path>) -> Result<Camera> {
        from_toml_and_maps(text, &MapFolder(folder), self)
    }
}

pub(super) fn from_toml_and_maps(text: &str, maps: &dyn MapSource, effects: &Catalog) -> Result<Camera> {
    if text.trim_start().starts_with('{') {
        bail!(Config, "camera file"; found "JSON, as in the sidecar of a stream"; expected "a camera file in TOML";
            remedy "pass the camera file or the preset that the stream was simulated with");
    }
    let file: File = toml::from_str(text).map_err(|e| {
        error!(Config, "camera file"; found "{}", toml_fault(&e);
            remedy "compare the file with the preset `physical`")
    })?;
    let mut camera = Camera::ideal(sensor(&file.sensor).map_err(|e| e.with_context("sensor"))?);
    camera.name = file.name;
    camera.source = file.source;
    camera.front_end = file.light.front_end().map_err(|e| e.with_context("light"))?;
    camera.mosaic = (file.sensor.mosaic.as_ref())
        .map(|table| table.mosaic().map_err(|e| e.with_context("sensor.mosaic")))
        .transpose()?;
    for (name, table) in &file.effects {
        camera = camera.with_effect(
            effect(name, table, effects)
                .map_err(|e| e.with_context(format_args!("effects.{}", excerpt(name))))?,
        );
    }
    camera.maps = file.maps.load(maps, camera.sensor.geometry)?;
    match &file.window {
        None => Ok(camera),
        Some(window) => camera
            .window(window.crop())
            .map_err(|e| error!(Config, "window"; found "{e}"; expected "a rectangle of the sensor")),
    }
}

fn sensor(table: &SensorTable) -> Result<Sensor> {
    let mut sensor = default_sensor()?;
    let geometry = sensor.geometry;
    sensor.geometry = Geometry::new(
        table.width.unwrap_or(geometry.width() as u32),
        table.height.unwrap_or(geometry.height() as u32),
    )
    .map_err(|e| error!(Config, "{e}"))?;
    let quantities = [
        (&table.readout_rate, &mut sensor.readout_hz),
        (&table.capacitance, &mut sensor.capacitance_ff),
        (&table.swing, &mut sensor.swing_v),
        (&table.thresholds_at_full_scale, &mut sensor.thresholds_at_full_scale),
    ];
    for ((key, unit), (value, target)) in SENSOR_UNITS.into_iter().zip(quantities) {
        if let Some(value) = value {
            *target = unit.parse(&value_text(value)).map_err(|e| e.with_context(key))?;
        }
    }
    sensor.validate()
}

/// The keys of `[sensor]` whose values have units. The keys for the number of pixels are not included.
const SENSOR_UNITS: [(&str, Unit); 4] = [
    ("readout_rate", Unit::Hertz),
    ("capacitance", Unit::Femtofarad),
    ("swing", Unit::Volt),
    ("thresholds_at_full_scale", Unit::Dimensionless),
];

/// Returns the unit of a key of `[sensor]`, or `None` if the key has no unit.
pub(super) fn number_unit(key: &str) -> Option<Unit> {
    SENSOR_UNITS.iter().find(|q| q.0 == key).map(|q| q.1)
}

fn effect(name: &str, table: &Value, effects: &Catalog) -> Result<Effect> {
    let mut effect = effects.find(name)?.neutral();
    let Value::Table(table) = table else {
        bail!(Config, "{name}"; found "{table}"; expected "a table of parameters");
    };
    for (key, value) in table {
        effect = effect.with_text(key, &value_text(value))?;
    }
    Ok(effect)
}

/// Returns a value as text that [`Unit::parse`] parses. A bare number becomes a text without a unit.
pub(super) fn value_text(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Float(number) => number.to_string(),
        other => other.to_string(),
    }
}
