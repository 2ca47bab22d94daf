//! Random cameras: camera files that contain ranges instead of some numbers.

use std::path::Path;

use toml::{Table, Value};

use crate::draws::pattern_rng::PatternRng;
use crate::draws::{RandomStream, Seeds};
use crate::effects::definition::ParamKind;
use crate::effects::{Camera, Catalog};
use crate::error::quoting::toml_fault;
use crate::error::{Result, bail, error, excerpt};
use crate::inputs;
use crate::presets::file::{number_unit, value_text};
use crate::units::Unit;

/// A distribution of cameras. Some numbers of a camera are drawn independently from ranges.
///
/// The text of a distribution is a camera file. Each number of `[sensor]` or of an effect may be a table: `{ uniform =
/// [low, high] }` or `{ log_uniform = [low, high] }`. If the number has a unit, the bounds have this unit too.
///
/// # Examples
/// ```
/// use spikelane::presets::CameraDistribution;
/// let text = "[sensor]\nwidth = 32\nheight = 24\n[effects.prnu]\nsigma = { uniform = [0.01, 0.03] }";
/// let cameras = CameraDistribution::parse(text)?;
/// for seed in 0..5 {
///     let prnu = cameras.draw(seed)?.effect("prnu").cloned().expect("the text has this effect");
///     assert!((0.01..=0.03).contains(&prnu.get("sigma")?));
/// }
/// assert_eq!(cameras.draw(3)?, cameras.draw(3)?);
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct CameraDistribution {
    text: String,
    table: Table,
    ranges: Vec<ParamRange>,
    effects: Catalog,
}

/// A number of the camera file and the range from which it is drawn.
///
/// # Examples
/// ```
/// use spikelane::presets::CameraDistribution;
/// use spikelane::units::Unit;
/// let text = "[sensor]\nswing = { log_uniform = [\"500 mV\", \"2 V\"] }";
/// let cameras = CameraDistribution::parse(text)?;
/// let range = &cameras.ranges()[0];
/// assert_eq!((range.key.as_str(), range.unit, range.low), ("sensor.swing", Unit::Volt, 0.5));
/// // The middle of a logarithmic range is the geometric mean of its bounds.
/// assert!((range.at(0.5) - 1.0).abs() < 1e-12);
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct ParamRange {
    /// Path of the number in the file: `sensor.swing`, `effects.prnu.sigma`.
    pub key: String,
    /// Unit of the bounds.
    pub unit: Unit,
    /// Lower bound.
    pub low: f64,
    /// Upper bound.
    pub high: f64,
    /// Whether the logarithm of the number has a uniform distribution. Otherwise the number itself has a uniform
    /// distribution.
    pub is_logarithmic: bool,
}

impl Default for CameraDistribution {
    /// Returns a distribution of cameras for training networks. Comments in its text explain the ranges.
    fn default() -> Self {
        let text = include_str!("distribution.toml");
        // The text is part of the program and a test parses it, so the fallback is never used.
        Self::parse(text).unwrap_or(Self {
            text: text.to_owned(),
            table: Table::new(),
            ranges: Vec::new(),
            effects: Catalog::new(),
        })
    }
}

impl Catalog {
    /// Parses the text of a distribution. The cameras may have any effect of this catalog.
    ///
    /// # Errors
    /// Returns the errors of [`CameraDistribution::parse`].
    pub fn camera_distribution(&self, text: &str) -> Result<CameraDistribution> {
        CameraDistribution::read(text, self)
    }
}

impl CameraDistribution {
    /// Parses the text of a distribution.
    ///
    /// A camera file without ranges and maps is a distribution that always returns the same camera.
    ///
    /// # Examples
    /// ```
    /// use spikelane::presets::CameraDistribution;
    /// let text = "[effects.dark_current]\nmean = { uniform = [\"0.1 pA\", \"1 pA\"] }";
    /// let cameras = CameraDistribution::parse(text)?;
    /// assert_eq!((cameras.ranges()[0].low, cameras.ranges()[0].high), (0.1, 1.0));
    ///
    /// let without_unit = "[effects.dark_current]\nmean = { uniform = [0.1, 1.0] }";
    /// let error = CameraDistribution::parse(without_unit).unwrap_err();
    /// assert_eq!(error.kind(), spikelane::ErrorKind::Config);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns [`ErrorKind::Config`](crate::ErrorKind::Config) if the text refers to maps, because maps belong to one camera. Returns
    /// [`ErrorKind::Config`](crate::ErrorKind::Config) if the bounds of a range are not two increasing numbers, or if the bounds of a logarithmic
    /// range are not positive. Also returns the errors of [`crate::presets::from_toml`].
    pub fn parse(text: &str) -> Result<Self> {
        Self::read(text, &Catalog::new())
    }

    fn read(text: &str, effects: &Catalog) -> Result<Self> {
        let table: Table = toml::from_str(text)
            .map_err(|e| error!(Config, "camera distribution"; found "{}", toml_fault(&e)))?;
        // Camera files that this crate writes contain the table `[maps]` even if the camera has no maps.
        if table.get("maps").is_some_and(|maps| maps.as_table().is_none_or(|maps| !maps.is_empty())) {
            bail!(Config, "maps"; found "maps in a distribution"; expected "numbers and ranges";
                remedy "remove the maps, or use the camera file of an individual camera");
        }
        let mut ranges = Vec::new();
        for_each_number(&table, &mut |key, value| {
            if let Value::Table(range) = value {
                ranges.push(ParamRange::read(key, range, effects).map_err(|e| e.with_context(excerpt(key)))?);
            }
            Ok(())
        })?;
        let distribution = Self { text: text.to_owned(), table, ranges, effects: effects.clone() };
        // The cameras at both ends of all ranges must be valid, so no single number makes a drawn camera invalid.
        distribution.camera(&|range| range.low)?;
        distribution.camera(&|range| range.high)?;
        Ok(distribution)
    }

    /// Reads the distribution in the file at `path`.
    ///
    /// # Examples
    /// ```
    /// use spikelane::presets::CameraDistribution;
    /// # let folder = tempfile::tempdir().expect("a temporary folder");
    /// # let path = folder.path().join("cameras.toml");
    /// # let write = |text: &str| std::fs::write(&path, text).map_err(|e| spikelane::Error::io(path.display(), e));
    /// write("[effects.prnu]\nsigma = { uniform = [0.01, 0.03] }")?;
    /// let cameras = CameraDistribution::load(&path)?;
    /// assert_eq!(cameras.ranges()[0].key, "effects.prnu.sigma");
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns an error if the file cannot be read, is not a regular file or is larger than 16 MiB.
    /// Also returns the errors of [`Self::parse`].
    pub fn load(path: &Path) -> Result<Self> {
        let text = inputs::read_text(path, "a camera distribution")?;
        Self::parse(&text).map_err(|e| e.with_context(path.display()))
    }

    /// Returns the ranges, sorted by key.
    #[must_use]
    pub fn ranges(&self) -> &[ParamRange] {
        &self.ranges
    }

    /// Returns the text from which the distribution was parsed.
    #[must_use]
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Returns the camera of `seed`. Equal seeds and equal texts give equal cameras.
    ///
    /// Each number depends only on the seed and on its own key. An additional range therefore does not change other
    /// numbers.
    ///
    /// # Errors
    /// Returns an error if the combination of the drawn numbers is not a valid camera.
    pub fn draw(&self, seed: u64) -> Result<Camera> {
        let mut camera = self.camera(&|range| {
            let stream = RandomStream::from_name(&format!("camera distribution/{}", range.key));
            let u = PatternRng::new(Seeds { camera: seed, ..Seeds::default() }, stream).pixel(0).uniform();
            range.at(u)
        })?;
        camera.name = format!("{} {seed}", camera.name);
        Ok(camera)
    }

    fn camera(&self, choose: &dyn Fn(&ParamRange) -> f64) -> Result<Camera> {
        let mut table = self.table.clone();
        for range in &self.ranges {
            let value = choose(range);
            let value = match range.unit {
                Unit::Dimensionless => Value::Float(value),
                unit => Value::String(unit.format(value)),
            };
            set_value(&mut table, &range.key, value);
        }
        let text = toml::to_string(&table).map_err(|e| error!(Config, "camera file"; found "{e}"))?;
        self.effects.camera_from_toml(&text, None)
    }
}

impl ParamRange {
    fn read(key: &str, table: &Table, effects: &Catalog) -> Result<Self> {
        let unit = key_unit(key, effects)?;
        let bad = |found: &dyn std::fmt::Display| {
            error!(Config, "range"; found "{found}";
                expected "{{ uniform = [low, high] }} or {{ log_uniform = [low, high] }} with low < high")
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
        let (low, high) = (unit.parse(&value_text(low))?, unit.parse(&value_text(high))?);
        if low >= high || (logarithmic && low <= 0.0) {
            return Err(bad(&format_args!("{} to {}", unit.format(low), unit.format(high)))
                .remedy("a log_uniform range must start above zero; replace an empty range by a number"));
        }
        Ok(Self { key: key.to_owned(), unit, low, high, is_logarithmic: logarithmic })
    }

    /// Returns the number at position `u` of the range. `u` is 0 to 1.
    #[must_use]
    pub fn at(&self, u: f64) -> f64 {
        let value = if self.is_logarithmic {
            self.low * libm::exp(u * libm::log(self.high / self.low))
        } else {
            self.low + u * (self.high - self.low)
        };
        value.clamp(self.low, self.high)
    }
}

/// Calls `visit` with the key and the value of every entry of `[sensor]` and of every effect.
fn for_each_number(table: &Table, visit: &mut dyn FnMut(&str, &Value) -> Result<()>) -> Result<()> {
    if let Some(Value::Table(sensor)) = table.get("sensor") {
        // A mosaic is a table, but not a range.
        let mut numbers = sensor.iter().filter(|(key, _)| *key != "mosaic");
        numbers.try_for_each(|(key, value)| visit(&format!("sensor.{key}"), value))?;
    }
    let Some(Value::Table(all)) = table.get("effects") else { return Ok(()) };
    for (name, effect) in all {
        let Value::Table(effect) = effect else { continue };
        effect.iter().try_for_each(|(key, value)| visit(&format!("effects.{name}.{key}"), value))?;
    }
    Ok(())
}

fn key_unit(key: &str, effects: &Catalog) -> Result<Unit> {
    let parts: Vec<&str> = key.split('.').collect();
    let refused = |found: &str| error!(Config, "range"; found "{found}"; expected "a number of the sensor or of an effect");
    match parts[..] {
        ["sensor", key] => number_unit(key).ok_or_else(|| refused("a range for a number of pixels")),
        ["effects", name, key] => {
            let definition = effects.find(name)?;
            match definition.params[definition.param_index(key)?].kind {
                ParamKind::Number { unit, .. } => Ok(unit),
                ParamKind::Choice(_) => Err(refused("a range for a choice of words")),
            }
        }
        _ => Err(refused("a range for another key")),
    }
}

/// Replaces the value at `key`. The path `key` must exist.
fn set_value(table: &mut Table, key: &str, value: Value) {
    match key.split_once('.') {
        None => {
            table.insert(key.to_owned(), value);
        }
        Some((first, rest)) => {
            if let Some(Value::Table(inner)) = table.get_mut(first) {
                set_value(inner, rest, value);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ErrorKind;

    #[test]
    fn a_distribution_keeps_the_mosaic_of_its_camera() {
        let text = "name = \"a\"\n[sensor]\nthresholds_at_full_scale = { uniform = [0.1, 0.2] }\n\
                    mosaic = { pattern = \"BGGR\", gain = { R = 0.5 } }\n";
        let cameras = CameraDistribution::parse(text).unwrap();
        assert_eq!(cameras.ranges().len(), 1);
        let mosaic = cameras.draw(3).unwrap().mosaic.unwrap();
        assert_eq!((mosaic.to_string().as_str(), mosaic.channels()[0].gain), ("BGGR", 0.5));
        // A range inside the mosaic is an error.
        assert!(CameraDistribution::parse(&text.replace("0.5", "{ uniform = [0.4, 0.6] }")).is_err());
    }

    const TEXT: &str = "name = \"a\"\n[sensor]\nthresholds_at_full_scale = { log_uniform = [0.02, 0.6] }\n\
                        [effects.dark_current]\nmean = { uniform = [\"0 pA\", \"500 fA\"] }\nsigma = \"0.1 pA\"";

    #[test]
    fn the_default_is_read_and_draws_cameras_that_can_be_planned() {
        let cameras = CameraDistribution::default();
        assert!(cameras.ranges().len() >= 8);
        for seed in 0..50 {
            let mut camera = cameras.draw(seed).unwrap();
            camera.sensor.geometry = crate::Geometry::new(16, 8).unwrap();
            crate::Plan::new(&camera, Seeds { camera: seed, ..Seeds::default() }).unwrap();
        }
    }

    #[test]
    fn draws_follow_their_law_and_the_seed() {
        let cameras = CameraDistribution::parse(TEXT).unwrap();
        let n = 4000;
        let (mut light, mut dark) = (Vec::new(), Vec::new());
        for seed in 0..n {
            let camera = cameras.draw(seed).unwrap();
            light.push((camera.sensor.thresholds_at_full_scale / 0.02).ln() / 30f64.ln());
            dark.push(camera.effect("dark_current").unwrap().get("mean").unwrap() / 0.5);
        }
        // A uniform position in a range has mean 1/2 and variance 1/12. Over the drawn cameras, the standard error is
        // 0.0046 for the mean and 0.016 for the correlation. The tolerance is five standard errors.
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
        let (few, more) =
            (CameraDistribution::parse(TEXT).unwrap(), CameraDistribution::parse(&more).unwrap());
        let (a, b) = (few.draw(9).unwrap(), more.draw(9).unwrap());
        assert_eq!(a.sensor, b.sensor);
        assert_eq!(a.effect("dark_current"), b.effect("dark_current"));
    }

    #[test]
    fn a_camera_file_is_a_distribution_of_one() {
        let cameras =
            CameraDistribution::parse("name = \"x\"\n[effects.prnu]\nsigma = 0.02\n[maps]").unwrap();
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
            assert_eq!(CameraDistribution::parse(text).unwrap_err().kind(), ErrorKind::Config, "{text}");
        }
    }
}
