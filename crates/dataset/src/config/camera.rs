//! The cameras of a `dataset.toml`: by name, by file, or written out.

use std::path::Path;

use toml::{Table, Value};

use crate::{Cameras, DatasetOptions};
use spikelane::effects::Camera;
use spikelane::error::{Error, Kind, Result};
use spikelane::presets::{self, Distribution};
use spikelane::units::Unit;
use spikelane::unstable::inputs::{Access, InnerPath, read_text};

/// The word for the library's own cameras to train on.
const DISTRIBUTION: &str = "distribution";

/// The first camera and which cameras take sequences.
pub(super) fn read(value: &Value, folder: &Path, access: Access) -> Result<(Camera, Cameras)> {
    match value {
        Value::Array(all) => {
            let several = all.iter().map(|v| single(v, folder, access)).collect::<Result<Vec<_>>>()?;
            let first = several.first().cloned().ok_or_else(|| wrong("an empty list"))?;
            Ok((first, Cameras::Several(several)))
        }
        other => match one(other, folder, access)? {
            Read::Camera(camera) => Ok((*camera, Cameras::One)),
            Read::Drawn(drawn) => Ok((drawn.draw(0)?, Cameras::Drawn(drawn))),
        },
    }
}

enum Read {
    Camera(Box<Camera>),
    Drawn(Distribution),
}

fn wrong(found: &str) -> Error {
    Error::new(Kind::Config, "camera").found(found).expected(
        "the name of a preset, a camera file, \"distribution\", a table as in a camera file (`preset` or `file` in it \
         names what it changes), or a list of these",
    )
}

fn single(value: &Value, folder: &Path, access: Access) -> Result<Camera> {
    match one(value, folder, access)? {
        Read::Camera(camera) => Ok(*camera),
        Read::Drawn(_) => Err(wrong("ranges in one of several cameras")),
    }
}

fn one(value: &Value, folder: &Path, access: Access) -> Result<Read> {
    match value {
        Value::String(name) => {
            let (table, at) = named(name, folder, access)?;
            of_table(&table, &at).map_err(|e| e.within(name))
        }
        Value::Table(table) => {
            let mut table = table.clone();
            let base = match (table.remove("preset"), table.remove("file")) {
                (None, None) => return of_table(&table, folder),
                (Some(Value::String(name)), None) | (None, Some(Value::String(name))) => name,
                _ => return Err(wrong("`preset` and `file` together, or one that is no text")),
            };
            let (mut whole, at) = named(&base, folder, access)?;
            merge(&mut whole, table);
            of_table(&whole, &at)
        }
        other => Err(wrong(&other.to_string())),
    }
}

/// The text of a preset or camera file as a table, and the folder of its maps.
fn named(name: &str, folder: &Path, access: Access) -> Result<(Table, std::path::PathBuf)> {
    let (text, at) = if name == DISTRIBUTION {
        (Distribution::default().text().to_owned(), folder.to_owned())
    } else if let Some(preset) = presets::ALL.iter().find(|p| p.name == name) {
        (preset.text.to_owned(), folder.to_owned())
    } else if name.ends_with(".toml") {
        let path = InnerPath::parse(Kind::Config, "camera", name)
            .map_err(|e| e.remedy("copy the camera file to the folder of dataset.toml, or below it"))?
            .below(folder, access)?;
        let text = read_text(&path, "a camera file")?;
        (text, path.parent().unwrap_or(Path::new("")).to_owned())
    } else {
        presets::builtin(name)?;
        return Err(wrong(name));
    };
    let table = toml::from_str(&text).map_err(|e| Error::new(Kind::Config, name).found(e))?;
    Ok((table, at))
}

fn merge(base: &mut Table, over: Table) {
    for (key, value) in over {
        match (base.get_mut(&key), value) {
            // A range replaces a number whole.
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

fn of_table(table: &Table, folder: &Path) -> Result<Read> {
    let text = toml::to_string(table).map_err(|e| Error::new(Kind::Config, "camera").found(e))?;
    if !table.contains_key("maps") {
        let drawn = Distribution::parse(&text)?;
        if !drawn.ranges().is_empty() {
            return Ok(Read::Drawn(drawn));
        }
    }
    presets::parse(&text, Some(folder)).map(|camera| Read::Camera(Box::new(camera)))
}

/// The cameras of a dataset as they stand in its text; maps are added to `maps`.
pub(super) fn write(options: &DatasetOptions, maps: &mut Vec<(String, Vec<u8>)>) -> Result<Value> {
    match &options.cameras {
        Cameras::One => written(&options.camera, maps),
        Cameras::Several(all) => {
            all.iter().map(|c| written(c, maps)).collect::<Result<_>>().map(Value::Array)
        }
        Cameras::Drawn(drawn) => {
            let mut table = table_of(drawn.text())?;
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

fn table_of(text: &str) -> Result<Table> {
    toml::from_str(text).map_err(|e| Error::new(Kind::Config, "camera").found(e))
}

fn written(camera: &Camera, maps: &mut Vec<(String, Vec<u8>)>) -> Result<Value> {
    let saved = presets::to_toml(camera)?;
    for (name, bytes) in saved.maps {
        match maps.iter().find(|(known, _)| *known == name) {
            Some((_, same)) if *same == bytes => {}
            Some(_) => {
                return Err(Error::new(Kind::Config, "cameras of the dataset")
                    .found(format_args!("two maps of the name {name}"))
                    .expected("one")
                    .remedy("give the cameras one dataset each"));
            }
            None => maps.push((name, bytes)),
        }
    }
    table_of(&saved.text).map(Value::Table)
}
