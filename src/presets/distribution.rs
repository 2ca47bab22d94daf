//! Cameras drawn at random: a camera file whose numbers may be ranges.

use std::path::Path;

use toml::{Table, Value};

use crate::draws::pattern::Pattern;
use crate::draws::{Seeds, Stream};
use crate::effects::definition::Form;
use crate::effects::{Camera, Catalogue};
use crate::error::{Error, Kind, Result};
use crate::inputs;
use crate::presets::file::{number_unit, parse_with, text_of};
use crate::units::Unit;

/// Cameras of which some numbers are drawn from ranges, each independent of the others.
///
/// The text is a camera file in which a number of `[sensor]` or of an effect may be a table instead:
/// `{ uniform = [low, high] }` or `{ log_uniform = [low, high] }`, with units where the number has one.
#[derive(Clone, Debug, PartialEq)]
pub struct Distribution {
    text: String,
    table: Table,
    ranges: Vec<Range>,
    effects: Catalogue,
}

/// A number and what it is drawn from.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Range {
    /// Where it stands in the file: `sensor.swing`, `effects.prnu.sigma`.
    pub key: String,
    /// Unit of the bounds.
    pub unit: Unit,
    /// Lower bound.
    pub low: f64,
    /// Upper bound.
    pub high: f64,
    /// Whether its logarithm is uniform, not the number itself.
    pub logarithmic: bool,
}

impl Default for Distribution {
    /// Cameras to train networks on; see the comments of its text.
    fn default() -> Self {
        let text = include_str!("distribution.toml");
        // The text is part of the program, and a test reads it.
        Self::parse(text).unwrap_or(Self {
            text: text.to_owned(),
            table: Table::new(),
            ranges: Vec::new(),
            effects: Catalogue::new(),
        })
    }
}

impl Distribution {
    /// Reads the text of a distribution; a camera file without maps is one that always gives this camera.
    ///
    /// # Errors
    /// As [`crate::presets::parse`]; when a range is no pair of numbers in rising order, or a logarithmic one does not begin above zero;
    /// when the text refers to maps, which are one camera's.
    pub fn parse(text: &str) -> Result<Self> {
        Self::parse_with(text, &Catalogue::new())
    }

    /// The same for cameras that may have any of `effects`.
    ///
    /// # Errors
    /// As [`Distribution::parse`].
    pub fn parse_with(text: &str, effects: &Catalogue) -> Result<Self> {
        let table: Table = toml::from_str(text)
            .map_err(|e| Error::new(Kind::Config, "camera distribution").found(e.to_string().trim_end()))?;
        // The camera files that are written here have the table also where there is no map.
        if table.get("maps").is_some_and(|maps| maps.as_table().is_none_or(|maps| !maps.is_empty())) {
            return Err(Error::new(Kind::Config, "maps")
                .found("maps in a distribution")
                .expected("numbers and ranges")
                .remedy("maps belong to one camera; use its file"));
        }
        let mut ranges = Vec::new();
        for_each_number(&table, &mut |key, value| {
            if let Value::Table(range) = value {
                ranges.push(Range::read(key, range, effects).map_err(|e| e.within(key))?);
            }
            Ok(())
        })?;
        let whole = Self { text: text.to_owned(), table, ranges, effects: effects.clone() };
        // Both ends are cameras, so that no draw fails for its range.
        whole.camera(&|range| range.low)?;
        whole.camera(&|range| range.high)?;
        Ok(whole)
    }

    /// Reads the file at `path`.
    ///
    /// # Errors
    /// As [`Distribution::parse`]; when it cannot be read, is no regular file, or is larger than 16 MiB.
    pub fn open(path: &Path) -> Result<Self> {
        let text = inputs::read_text(path, "a camera distribution")?;
        Self::parse(&text).map_err(|e| e.within(path.display()))
    }

    /// The numbers that are drawn, in the order of their keys.
    #[must_use]
    pub fn ranges(&self) -> &[Range] {
        &self.ranges
    }

    /// The text that it was read from.
    #[must_use]
    pub fn text(&self) -> &str {
        &self.text
    }

    /// The camera number `seed`: the same camera for the same seed and text. Each number is a function of the seed
    /// and its own key, so another range more changes no other number.
    ///
    /// # Errors
    /// When the numbers drawn make no camera together.
    pub fn draw(&self, seed: u64) -> Result<Camera> {
        let mut camera = self.camera(&|range| {
            let stream = Stream::named(&format!("camera distribution/{}", range.key));
            let u = Pattern::new(Seeds { camera: seed, ..Seeds::default() }, stream).at(0).uniform();
            range.at(u)
        })?;
        camera.name = format!("{} {seed}", camera.name);
        Ok(camera)
    }

    fn camera(&self, choose: &dyn Fn(&Range) -> f64) -> Result<Camera> {
        let mut table = self.table.clone();
        for range in &self.ranges {
            let value = choose(range);
            let value = match range.unit {
                Unit::One => Value::Float(value),
                unit => Value::String(unit.format(value)),
            };
            put(&mut table, &range.key, value);
        }
        let text = toml::to_string(&table).map_err(|e| Error::new(Kind::Config, "camera file").found(e))?;
        parse_with(&text, None, &self.effects)
    }
}

impl Range {
    fn read(key: &str, table: &Table, effects: &Catalogue) -> Result<Self> {
        let unit = unit_of(key, effects)?;
        let bad = |found: &dyn std::fmt::Display| {
            Error::new(Kind::Config, "range")
                .found(found)
                .expected("{ uniform = [low, high] } or { log_uniform = [low, high] }, low below high")
        };
        let (law, bounds) = match table.iter().next() {
            Some((law, Value::Array(bounds))) if table.len() == 1 => (law, bounds),
            _ => return Err(bad(table)),
        };
        let logarithmic = match law.as_str() {
            "uniform" => false,
            "log_uniform" => true,
            _ => return Err(bad(law)),
        };
        let [low, high] = &bounds[..] else { return Err(bad(table)) };
        let (low, high) = (unit.parse(&text_of(low))?, unit.parse(&text_of(high))?);
        if low >= high || (logarithmic && low <= 0.0) {
            return Err(bad(&format_args!("{} to {}", unit.format(low), unit.format(high)))
                .remedy("a logarithmic range begins above zero; a single number needs no range"));
        }
        Ok(Self { key: key.to_owned(), unit, low, high, logarithmic })
    }

    /// The number at share `u` of the range, 0 to 1.
    #[must_use]
    pub fn at(&self, u: f64) -> f64 {
        let value = if self.logarithmic {
            self.low * libm::exp(u * libm::log(self.high / self.low))
        } else {
            self.low + u * (self.high - self.low)
        };
        value.clamp(self.low, self.high)
    }
}

/// Calls `tell` with the keys of `[sensor]` and of every effect.
fn for_each_number(table: &Table, tell: &mut dyn FnMut(&str, &Value) -> Result<()>) -> Result<()> {
    if let Some(Value::Table(sensor)) = table.get("sensor") {
        sensor.iter().try_for_each(|(key, value)| tell(&format!("sensor.{key}"), value))?;
    }
    let Some(Value::Table(all)) = table.get("effects") else { return Ok(()) };
    for (name, effect) in all {
        let Value::Table(effect) = effect else { continue };
        effect.iter().try_for_each(|(key, value)| tell(&format!("effects.{name}.{key}"), value))?;
    }
    Ok(())
}

fn unit_of(key: &str, effects: &Catalogue) -> Result<Unit> {
    let parts: Vec<&str> = key.split('.').collect();
    let refused = |found: &str| {
        Error::new(Kind::Config, "range").found(found).expected("a number of the sensor or of an effect")
    };
    match parts[..] {
        ["sensor", key] => number_unit(key).ok_or_else(|| refused("a number of pixels")),
        ["effects", name, key] => {
            let definition = effects.find(name)?;
            match definition.params[definition.index(key)?].form {
                Form::Number { unit, .. } => Ok(unit),
                Form::Choice(_) => Err(refused("a choice of words")),
            }
        }
        _ => Err(refused("another key")),
    }
}

/// Replaces the value at `key`, a path that is there.
fn put(table: &mut Table, key: &str, value: Value) {
    match key.split_once('.') {
        None => {
            table.insert(key.to_owned(), value);
        }
        Some((first, rest)) => {
            if let Some(Value::Table(inner)) = table.get_mut(first) {
                put(inner, rest, value);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "name = \"a\"\n[sensor]\nthresholds_at_full_scale = { log_uniform = [0.02, 0.6] }\n\
                        [effects.dark_current]\nmean = { uniform = [\"0 pA\", \"500 fA\"] }\nsigma = \"0.1 pA\"";

    #[test]
    fn the_default_is_read_and_draws_cameras_that_can_be_planned() {
        let cameras = Distribution::default();
        assert!(cameras.ranges().len() >= 8);
        for seed in 0..50 {
            let mut camera = cameras.draw(seed).unwrap();
            camera.sensor.geometry = crate::Geometry::new(16, 8).unwrap();
            crate::Plan::new(&camera, Seeds { camera: seed, ..Seeds::default() }).unwrap();
        }
    }

    #[test]
    fn draws_follow_their_law_and_the_seed() {
        let cameras = Distribution::parse(TEXT).unwrap();
        let n = 4000;
        let (mut light, mut dark) = (Vec::new(), Vec::new());
        for seed in 0..n {
            let camera = cameras.draw(seed).unwrap();
            light.push((camera.sensor.thresholds_at_full_scale / 0.02).ln() / 30f64.ln());
            dark.push(camera.effect("dark_current").unwrap().get("mean").unwrap() / 0.5);
        }
        // A uniform share has mean 1/2 and variance 1/12; the standard error of the mean is 0.0046, the
        // correlation's 0.016: five of each.
        for values in [&light, &dark] {
            let mean = values.iter().sum::<f64>() / n as f64;
            let second = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n as f64;
            assert!((mean - 0.5).abs() < 0.023 && (second - 1.0 / 12.0).abs() < 0.006, "{mean} {second}");
        }
        let together: f64 = light.iter().zip(&dark).map(|(a, b)| (a - 0.5) * (b - 0.5)).sum();
        assert!((12.0 * together / n as f64).abs() < 0.08);
        assert_eq!(cameras.draw(3).unwrap(), cameras.draw(3).unwrap());
    }

    #[test]
    fn another_range_changes_no_other_number() {
        let more = format!("{TEXT}\n[effects.prnu]\nsigma = {{ uniform = [0, 0.07] }}");
        let (few, more) = (Distribution::parse(TEXT).unwrap(), Distribution::parse(&more).unwrap());
        let (a, b) = (few.draw(9).unwrap(), more.draw(9).unwrap());
        assert_eq!(a.sensor, b.sensor);
        assert_eq!(a.effect("dark_current"), b.effect("dark_current"));
    }

    #[test]
    fn a_camera_file_is_a_distribution_of_one() {
        let cameras = Distribution::parse("name = \"x\"\n[effects.prnu]\nsigma = 0.02\n[maps]").unwrap();
        assert!(cameras.ranges().is_empty());
        assert_eq!(cameras.draw(1).unwrap().effects(), cameras.draw(2).unwrap().effects());
    }

    #[test]
    fn wrong_ranges_are_refused() {
        let wrong = [
            "[effects.prnu]\nsigma = { uniform = [0.07, 0] }",
            "[effects.prnu]\nsigma = { log_uniform = [0, 0.07] }",
            "[effects.prnu]\nsigma = { normal = [0, 0.07] }",
            "[effects.prnu]\nsigma = { uniform = [0, 0.07, 1] }",
            "[effects.prnu]\nsigma = { uniform = [0, 7] }",
            "[effects.prnu]\nsigma = { uniform = [0, \"7 V\"] }",
            "[effects.prnu]\nsigmma = { uniform = [0, 0.07] }",
            "[effects.shot_noise]\ncounts = { uniform = [0, 1] }",
            "[sensor]\nwidth = { uniform = [10, 20] }",
            "[sensor]\nswing = { uniform = [0, \"1 V\"] }",
            "[maps]\ngain = { file = \"gain.npy\", digest = \"x\" }",
            "[light]\ntransfer = { uniform = [1, 2] }",
            "not toml",
        ];
        for text in wrong {
            assert_eq!(Distribution::parse(text).unwrap_err().kind(), Kind::Config, "{text}");
        }
    }
}
