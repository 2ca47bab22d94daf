//! Writing a camera file.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::effects::Camera;
use crate::effects::definition::{Form, Param};
use crate::error::{Error, Kind, Result};
use crate::presets::file::WindowTable;
use crate::presets::{light, maps};
use crate::units::Unit;

#[derive(Serialize)]
struct File<'a> {
    name: &'a str,
    source: &'a str,
    sensor: SensorTable,
    #[serde(skip_serializing_if = "Option::is_none")]
    light: Option<light::Table>,
    effects: BTreeMap<&'static str, BTreeMap<&'static str, Value>>,
    maps: maps::Table,
    #[serde(skip_serializing_if = "Option::is_none")]
    window: Option<WindowTable>,
}

#[derive(Serialize)]
struct SensorTable {
    width: usize,
    height: usize,
    readout_rate: String,
    capacitance: String,
    swing: String,
    thresholds_at_full_scale: f64,
}

#[derive(Serialize)]
#[serde(untagged)]
enum Value {
    Number(f64),
    Text(String),
}

impl Value {
    fn of(param: &Param, value: f64) -> Self {
        match param.form {
            Form::Number { unit: Unit::One, .. } if value.is_finite() => Self::Number(value),
            _ => Self::Text(param.format(value)),
        }
    }
}

/// A camera file's text and the map files that belong beside it.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Saved {
    /// The TOML.
    pub text: String,
    /// Names, relative to the camera file, and bytes.
    pub maps: Vec<(String, Vec<u8>)>,
}

/// The camera file of `camera`; [`super::parse`] reads it back.
///
/// # Errors
/// When the camera's maps have another size than its sensor, or that was changed after a window was cut.
pub fn to_toml(camera: &Camera) -> Result<Saved> {
    camera.whole()?;
    let mut saved = Vec::new();
    let effects = camera.effects().iter().map(|effect| {
        let params = effect.definition().params.iter().zip(effect.values());
        let written = params.filter(|(p, v)| !p.came_later || **v != p.neutral);
        let table = written.map(|(p, v)| (p.key, Value::of(p, *v))).collect();
        (effect.name(), table)
    });
    let sensor = &camera.sensor;
    let file = File {
        name: &camera.name,
        source: &camera.source,
        sensor: SensorTable {
            width: camera.whole_geometry().width(),
            height: camera.whole_geometry().height(),
            readout_rate: Unit::Hertz.format(sensor.readout_hz),
            capacitance: Unit::Femtofarad.format(sensor.capacitance_ff),
            swing: Unit::Volt.format(sensor.swing_v),
            thresholds_at_full_scale: sensor.thresholds_at_full_scale,
        },
        light: light::Table::of(&camera.light),
        effects: effects.collect(),
        maps: map_table(camera, &mut saved)?,
        window: camera.place().map(WindowTable::of),
    };
    let text = toml::to_string(&file).map_err(|e| Error::new(Kind::Config, "camera file").found(e))?;
    Ok(Saved { text, maps: saved })
}

fn map_table(camera: &Camera, saved: &mut Vec<(String, Vec<u8>)>) -> Result<maps::Table> {
    let geometry = camera.whole_geometry();
    let mut entry = |name: &str, map: &Option<Vec<f64>>| -> Result<Option<maps::Entry>> {
        let Some(map) = map else { return Ok(None) };
        if map.len() != geometry.pixels() {
            return Err(Error::new(Kind::Config, name)
                .found(format_args!("{} values", map.len()))
                .expected(format_args!("{}, one per pixel of {geometry}", geometry.pixels())));
        }
        let bytes = maps::write(map, geometry)?;
        let entry = maps::Entry { file: format!("{name}.npy"), digest: maps::digest(&bytes)? };
        saved.push((entry.file.clone(), bytes));
        Ok(Some(entry))
    };
    let maps = &camera.maps;
    Ok(maps::Table {
        gain: entry("gain", &maps.gain)?,
        dark_pa: entry("dark_pa", &maps.dark_pa)?,
        capacitance_ff: entry("capacitance_ff", &maps.capacitance_ff)?,
        swing_v: entry("swing_v", &maps.swing_v)?,
    })
}
