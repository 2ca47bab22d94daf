//! Reading a camera file.

use std::path::Path;

use serde::{Deserialize, Serialize};
use toml::Table;
use toml::Value;

use crate::effects::{Camera, Catalogue, Effect};
use crate::error::{Error, Kind, Result};
use crate::presets::maps::{Files, Folder};
use crate::presets::{default_sensor, light, maps};
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

/// The part of the sensor that the camera is, in pixels.
#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct WindowTable {
    row: usize,
    col: usize,
    height: usize,
    width: usize,
}

impl WindowTable {
    pub(crate) fn of(crop: Crop) -> Self {
        Self { row: crop.y, col: crop.x, height: crop.height, width: crop.width }
    }

    fn crop(&self) -> Crop {
        Crop { x: self.col, y: self.row, width: self.width, height: self.height }
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
}

/// Reads the text of a camera file; maps are looked for in `folder`.
///
/// # Errors
/// When the text is no TOML, a key is unknown, a unit wrong or missing, a
/// value out of range, a map missing or changed, or the window outside the sensor.
pub fn parse(text: &str, folder: Option<&Path>) -> Result<Camera> {
    parse_with(text, folder, &Catalogue::new())
}

/// The same for a camera file that may have any of `effects`.
///
/// # Errors
/// As [`parse`].
pub fn parse_with(text: &str, folder: Option<&Path>, effects: &Catalogue) -> Result<Camera> {
    parse_maps(text, &Folder(folder), effects)
}

pub(super) fn parse_maps(text: &str, maps: &dyn Files, effects: &Catalogue) -> Result<Camera> {
    let file: File = toml::from_str(text).map_err(|e| {
        Error::new(Kind::Config, "camera file")
            .found(e.to_string().trim_end())
            .remedy("compare with 'spikelane preset show physical'")
    })?;
    let mut camera = Camera::ideal(sensor(&file.sensor).map_err(|e| e.within("sensor"))?);
    camera.name = file.name;
    camera.source = file.source;
    camera.light = file.light.front_end().map_err(|e| e.within("light"))?;
    for (name, table) in &file.effects {
        camera =
            camera.with(effect(name, table, effects).map_err(|e| e.within(format_args!("effects.{name}")))?);
    }
    camera.maps = file.maps.load(maps, camera.sensor.geometry)?;
    match &file.window {
        None => Ok(camera),
        Some(window) => camera
            .window(window.crop())
            .map_err(|e| Error::new(Kind::Config, "window").found(e).expected("a rectangle of the sensor")),
    }
}

fn sensor(table: &SensorTable) -> Result<Sensor> {
    let mut sensor = default_sensor()?;
    let geometry = sensor.geometry;
    sensor.geometry = Geometry::new(
        table.width.unwrap_or(geometry.width() as u32),
        table.height.unwrap_or(geometry.height() as u32),
    )
    .map_err(|e| Error::new(Kind::Config, e.to_string()))?;
    let quantities = [
        (&table.readout_rate, &mut sensor.readout_hz),
        (&table.capacitance, &mut sensor.capacitance_ff),
        (&table.swing, &mut sensor.swing_v),
        (&table.thresholds_at_full_scale, &mut sensor.thresholds_at_full_scale),
    ];
    for ((key, unit), (value, target)) in QUANTITIES.into_iter().zip(quantities) {
        if let Some(value) = value {
            *target = unit.parse(&text_of(value)).map_err(|e| e.within(key))?;
        }
    }
    sensor.validated()
}

/// The numbers of `[sensor]` that have a unit or none, but are no pixels.
const QUANTITIES: [(&str, Unit); 4] = [
    ("readout_rate", Unit::Hertz),
    ("capacitance", Unit::Femtofarad),
    ("swing", Unit::Volt),
    ("thresholds_at_full_scale", Unit::One),
];

/// The unit of a number of `[sensor]`; `None` for another key.
pub(super) fn number_unit(key: &str) -> Option<Unit> {
    QUANTITIES.iter().find(|q| q.0 == key).map(|q| q.1)
}

fn effect(name: &str, table: &Value, effects: &Catalogue) -> Result<Effect> {
    let mut effect = effects.find(name)?.neutral();
    let Value::Table(table) = table else {
        return Err(Error::new(Kind::Config, name).found(table).expected("a table of parameters"));
    };
    for (key, value) in table {
        effect = effect.with_text(key, &text_of(value))?;
    }
    Ok(effect)
}

/// A value as the text that [`Unit::parse`] reads: bare numbers keep no unit.
pub(super) fn text_of(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Float(number) => number.to_string(),
        other => other.to_string(),
    }
}
