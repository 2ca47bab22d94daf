//! The cameras of a `dataset.toml`. A camera is given by name, by file, or as a table.

use std::path::Path;

use toml::{Table, Value};

use crate::{Cameras, DatasetOptions};
use spikelane::effects::Camera;
use spikelane::error::{Error, ErrorKind, Result};
use spikelane::presets::{self, CameraDistribution};
use spikelane::units::Unit;
use spikelane::unstable::error::toml_fault;
use spikelane::unstable::inputs::{Access, InnerPath, read_text};

/// Keyword for the library's distribution of training cameras.
const DISTRIBUTION_KEYWORD: &str = "distribution";

/// Returns the first camera, and the rule that assigns a camera to each sequence.
pub(super) fn read(value: &Value, folder: &Path, access: Access) -> Result<(Camera, Cameras)> {
    match value {
        Value::Array(all) => {
            let several = all.iter().map(|v| single_camera(v, folder, access)).collect::<Result<Vec<_>>>()?;
            let first = several.first().cloned().ok_or_else(|| camera_error("an empty list"))?;
            Ok((first, Cameras::List(several)))
        }
        other => match parse_camera(other, folder, access)? {
            ParsedCamera::Camera(camera) => Ok((*camera, Cameras::Single)),
            ParsedCamera::Distribution(drawn) => Ok((drawn.draw(0)?, Cameras::Distribution(drawn))),
        },
    }
}

enum ParsedCamera {
    Camera(Box<Camera>),
    Distribution(CameraDistribution),
}

fn camera_error(found: &str) -> Error {
    Error::new(ErrorKind::Config, "camera").found(found).expected(
        "the name of a preset, a camera file, \"distribution\", a table as in a camera file (`preset` or `file` names the camera that the table changes), or a list of such values",
    )
}

fn single_camera(value: &Value, folder: &Path, access: Access) -> Result<Camera> {
    match parse_camera(value, folder, access)? {
        ParsedCamera::Camera(camera) => Ok(*camera),
        ParsedCamera::Distribution(_) => Err(camera_error("ranges in one of several cameras")),
    }
}

fn parse_camera(value: &Value, folder: &Path, access: Access) -> Result<ParsedCamera> {
    match value {
        Value::String(name) => {
            let (table, at) = camera_table(name, folder, access)?;
            camera_from_table(&table, &at).map_err(|e| e.with_context(name))
        }
        Value::Table(table) => {
            let mut table = table.clone();
            let base = match (table.remove("preset"), table.remove("file")) {
                (None, None) => return camera_from_table(&table, folder),
                (Some(Value::String(name)), None) | (None, Some(Value::String(name))) => name,
                _ => return Err(camera_error("both `preset` and `file`, or a value that is not text")),
            };
            let (mut whole, at) = camera_table(&base, folder, access)?;
            merge(&mut whole, table);
            camera_from_table(&whole, &at)
        }
        other => Err(camera_error(&other.to_string())),
    }
}

/// Returns a preset or a camera file as a table, and the folder that contains the maps of the camera.
fn camera_table(name: &str, folder: &Path, access: Access) -> Result<(Table, std::path::PathBuf)> {
    let (text, at) = if name == DISTRIBUTION_KEYWORD {
        (CameraDistribution::default().text().to_owned(), folder.to_owned())
    } else if let Some(preset) = presets::ALL.iter().find(|p| p.name == name) {
        (preset.text.to_owned(), folder.to_owned())
    } else if name.ends_with(".toml") {
        let path = InnerPath::parse(ErrorKind::Config, "camera", name)
            .map_err(|e| {
                e.remedy("copy the camera file to the folder of dataset.toml, or to a folder inside it")
            })?
            .resolve_in(folder, access)?;
        let text = read_text(&path, "a camera file")?;
        (text, path.parent().unwrap_or(Path::new("")).to_owned())
    } else {
        presets::builtin(name)?;
        return Err(camera_error(name));
    };
    let table =
        toml::from_str(&text).map_err(|e| Error::new(ErrorKind::Config, name).found(toml_fault(&e)))?;
    Ok((table, at))
}

fn merge(base: &mut Table, over: Table) {
    for (key, value) in over {
        match (base.get_mut(&key), value) {
            // A range is never merged with another table. The whole range replaces the old value, or is replaced by
            // the new value.
            (Some(Value::Table(inner)), Value::Table(over)) if !is_range(inner) && !is_range(&over) => {
                merge(inner, over);
            }
            (_, value) => drop(base.insert(key, value)),
        }
    }
}

fn is_range(table: &Table) -> bool {
    table.contains_key("uniform") || table.contains_key("log_uniform")
}

fn camera_from_table(table: &Table, folder: &Path) -> Result<ParsedCamera> {
    let text = toml::to_string(table).map_err(|e| Error::new(ErrorKind::Config, "camera").found(e))?;
    if !table.contains_key("maps") {
        let drawn = CameraDistribution::parse(&text)?;
        if !drawn.ranges().is_empty() {
            return Ok(ParsedCamera::Distribution(drawn));
        }
    }
    presets::from_toml(&text, Some(folder)).map(|camera| ParsedCamera::Camera(Box::new(camera)))
}

/// Returns the cameras of a dataset as a TOML value. Adds the maps of these cameras to `maps`.
pub(super) fn write(options: &DatasetOptions, maps: &mut Vec<(String, Vec<u8>)>) -> Result<Value> {
    match &options.cameras {
        Cameras::Single => camera_value(&options.camera, maps),
        Cameras::List(all) => {
            all.iter().map(|c| camera_value(c, maps)).collect::<Result<_>>().map(Value::Array)
        }
        Cameras::Distribution(drawn) => {
            let mut table = parse_table(drawn.text())?;
            let sensor = &options.camera.sensor;
            let own: Table = [
                ("width".to_owned(), Value::Integer(sensor.geometry.width() as i64)),
                ("height".to_owned(), Value::Integer(sensor.geometry.height() as i64)),
                ("readout_rate".to_owned(), Value::String(Unit::Hertz.format(sensor.readout_hz))),
            ]
            .into_iter()
            .collect();
            merge(&mut table, [("sensor".to_owned(), Value::Table(own))].into_iter().collect());
            Ok(Value::Table(table))
        }
    }
}

fn parse_table(text: &str) -> Result<Table> {
    toml::from_str(text).map_err(|e| Error::new(ErrorKind::Config, "camera").found(toml_fault(&e)))
}

fn camera_value(camera: &Camera, maps: &mut Vec<(String, Vec<u8>)>) -> Result<Value> {
    let saved = presets::to_toml(camera)?;
    for (name, bytes) in saved.maps {
        match maps.iter().find(|(known, _)| *known == name) {
            Some((_, same)) if *same == bytes => {}
            Some(_) => {
                return Err(Error::new(ErrorKind::Config, "cameras of the dataset")
                    .found(format_args!("two maps with the name {name}"))
                    .expected("one map of each name")
                    .remedy("generate one dataset for each camera"));
            }
            None => maps.push((name, bytes)),
        }
    }
    parse_table(&saved.text).map(Value::Table)
}
