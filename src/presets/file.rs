//! Reading a camera file.

use std::path::Path;

use serde::Deserialize;
use toml::Table;
use toml::Value;

use crate::effects::{self, Camera};
use crate::error::{Error, Kind, Result};
use crate::presets::{default_sensor, light, maps};
use crate::sensor::Sensor;
use crate::spikes::Geometry;
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
/// value out of range, or a map missing or changed.
pub fn parse(text: &str, folder: Option<&Path>) -> Result<Camera> {
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
        camera = camera.with(effect(name, table).map_err(|e| e.within(format_args!("effects.{name}")))?);
    }
    camera.maps = file.maps.load(folder, camera.sensor.geometry)?;
    Ok(camera)
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
        ("readout_rate", &table.readout_rate, Unit::Hertz, &mut sensor.readout_hz),
        ("capacitance", &table.capacitance, Unit::Femtofarad, &mut sensor.capacitance_ff),
        ("swing", &table.swing, Unit::Volt, &mut sensor.swing_v),
        (
            "thresholds_at_full_scale",
            &table.thresholds_at_full_scale,
            Unit::One,
            &mut sensor.thresholds_at_full_scale,
        ),
    ];
    for (key, value, unit, target) in quantities {
        if let Some(value) = value {
            *target = unit.parse(&text_of(value)).map_err(|e| e.within(key))?;
        }
    }
    sensor.validated()
}

fn effect(name: &str, table: &Value) -> Result<effects::Effect> {
    let mut effect = effects::find(name)?.neutral();
    let Value::Table(table) = table else {
        return Err(Error::new(Kind::Config, name).found(table).expected("a table of parameters"));
    };
    for (key, value) in table {
        effect = effect.with_text(key, &text_of(value))?;
    }
    Ok(effect)
}

/// A value as the text that [`Unit::parse`] reads: bare numbers keep no unit.
fn text_of(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Float(number) => number.to_string(),
        other => other.to_string(),
    }
}
