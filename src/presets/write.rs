//! Serialization of camera files.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::count::Count;
use crate::effects::Camera;
use crate::effects::definition::{Param, ParamKind};
use crate::error::{Result, bail, error};
use crate::presets::file::WindowTable;
use crate::presets::{light, maps, mosaic};
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
    #[serde(skip_serializing_if = "Option::is_none")]
    mosaic: Option<mosaic::Table>,
}

#[derive(Serialize)]
#[serde(untagged)]
enum Value {
    Number(f64),
    Text(String),
}

impl Value {
    fn from_param(param: &Param, value: f64) -> Self {
        match param.kind {
            ParamKind::Number { unit: Unit::Dimensionless, .. } if value.is_finite() => Self::Number(value),
            _ => Self::Text(param.format(value)),
        }
    }
}

/// The text of a camera file, and the map files of the camera.
///
/// # Examples
/// ```
/// # #[cfg(feature = "maps")] {
/// use spikelane::{Camera, Sensor, presets};
/// let mut camera = Camera::ideal(Sensor::new(32, 24, 20_000.0)?);
/// camera.maps.gain = Some(vec![1.0; 32 * 24]);
/// let files = presets::to_toml(&camera)?;
/// assert!(files.text.contains("gain.npy"));
/// assert_eq!(files.maps[0].0, "gain.npy");
/// assert!(files.maps[0].1.starts_with(b"\x93NUMPY"));
/// # }
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct CameraFiles {
    /// Text of the camera file, in TOML.
    pub text: String,
    /// Name and bytes of each map file. Names are relative to the camera file.
    pub maps: Vec<(String, Vec<u8>)>,
}

/// Returns the camera file of `camera`. [`super::from_toml`] parses this file.
///
/// # Examples
/// ```
/// use spikelane::{Camera, Sensor, effects, presets};
/// let camera = Camera::ideal(Sensor::new(32, 24, 20_000.0)?).with_effect(effects::find("prnu")?.typical());
/// let text = presets::to_toml(&camera)?.text;
/// assert!(text.contains("readout_rate = \"20000 Hz\""));
/// assert_eq!(presets::from_toml(&text, None)?, camera);
/// # Ok::<(), spikelane::Error>(())
/// ```
///
/// # Errors
/// Returns [`ErrorKind::Config`](crate::ErrorKind::Config) if the size of a map differs from the sensor. Returns [`ErrorKind::Config`](crate::ErrorKind::Config) if the
/// sensor's size was changed after a window was cut from the sensor. Returns [`ErrorKind::Usage`](crate::ErrorKind::Usage) if the camera has
/// maps and the build lacks the feature `maps`.
pub fn to_toml(camera: &Camera) -> Result<CameraFiles> {
    camera.whole_sensor()?;
    let mut saved = Vec::new();
    let effects = camera.effects().iter().map(|effect| {
        let params = effect.definition().params.iter().zip(effect.values());
        let written = params.filter(|(p, v)| !p.is_omitted_if_neutral || **v != p.neutral);
        let table = written.map(|(p, v)| (p.key, Value::from_param(p, *v))).collect();
        (effect.name(), table)
    });
    let sensor = &camera.sensor;
    let file = File {
        name: &camera.name,
        source: &camera.source,
        sensor: SensorTable {
            width: camera.sensor_geometry().width(),
            height: camera.sensor_geometry().height(),
            readout_rate: Unit::Hertz.format(sensor.readout_hz),
            capacitance: Unit::Femtofarad.format(sensor.capacitance_ff),
            swing: Unit::Volt.format(sensor.swing_v),
            thresholds_at_full_scale: sensor.thresholds_at_full_scale,
            mosaic: camera.mosaic.as_ref().map(mosaic::Table::from_mosaic),
        },
        light: light::Table::from_front_end(&camera.front_end),
        effects: effects.collect(),
        maps: map_table(camera, &mut saved)?,
        window: camera.window_crop().map(WindowTable::from_crop),
    };
    let text = toml::to_string(&file).map_err(|e| error!(Config, "camera file"; found "{e}"))?;
    Ok(CameraFiles { text, maps: saved })
}

fn map_table(camera: &Camera, saved: &mut Vec<(String, Vec<u8>)>) -> Result<maps::Table> {
    let geometry = camera.sensor_geometry();
    let mut entry = |name: &str, map: &Option<Vec<f64>>| -> Result<Option<maps::MapEntry>> {
        let Some(map) = map else { return Ok(None) };
        if map.len() != geometry.pixels() {
            bail!(Config, "{name}"; found "{}", Count(map.len(), "value");
                expected "{}, one per pixel of {geometry}", geometry.pixels());
        }
        let bytes = maps::write(map, geometry)?;
        let entry = maps::MapEntry { file: format!("{name}.npy"), digest: maps::digest(&bytes)? };
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
