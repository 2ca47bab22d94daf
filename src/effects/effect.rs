//! An effect with the values of its parameters.

use crate::draws::Seeds;
use crate::draws::pattern_rng::PatternRng;
use crate::error::Result;
use crate::pixel::Op;
use crate::sensor::Sensor;

use super::circuit::Circuit;
use super::definition::{Definition, Moments, OperatingPoint};
use super::param::Param;

impl Definition {
    /// Returns this effect with neutral parameters.
    ///
    /// # Examples
    /// ```
    /// use spikelane::effects;
    /// let prnu = effects::find("prnu")?.neutral();
    /// assert!(prnu.is_neutral());
    /// assert_eq!(prnu.values(), [1.0, 0.0]); // mean gain and spread
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    #[must_use]
    pub fn neutral(&'static self) -> Effect {
        Effect::from_definition(self, |p| p.neutral)
    }

    /// Returns this effect with typical parameters.
    ///
    /// # Examples
    /// ```
    /// use spikelane::effects;
    /// let flicker = effects::find("flicker")?.typical();
    /// assert_eq!((flicker.get("depth")?, flicker.get("frequency_hz")?), (0.02, 100.0));
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    #[must_use]
    pub fn typical(&'static self) -> Effect {
        Effect::from_definition(self, |p| p.typical)
    }
}

/// An effect with the values of its parameters.
///
/// # Examples
/// ```
/// use spikelane::effects;
/// let dark = effects::find("dark_current")?.neutral().with_text("mean", "500 fA")?.with_value("sigma", 0.1)?;
/// // Values are in the unit of the parameter: picoamperes.
/// assert_eq!((dark.get("mean")?, dark.get("sigma")?), (0.5, 0.1));
/// assert_eq!(dark.definition().params[0].key, "mean");
///
/// let error = dark.with_value("sigma", -0.1).unwrap_err();
/// assert_eq!(error.to_string(), "dark_current: sigma: found -0.1 pA, expected 0 pA to 1000000 pA");
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Effect {
    definition: &'static Definition,
    values: Vec<f64>,
}

impl Effect {
    fn from_definition(definition: &'static Definition, value: fn(&Param) -> f64) -> Self {
        Self { definition, values: definition.params.iter().map(value).collect() }
    }

    /// Returns the definition of this effect.
    #[must_use]
    pub fn definition(&self) -> &'static Definition {
        self.definition
    }

    /// Returns the canonical name.
    #[must_use]
    pub fn name(&self) -> &'static str {
        self.definition.name
    }

    /// Returns the values in the order of [`Definition::params`].
    #[must_use]
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// Returns the value of parameter `key` in the unit of the parameter.
    ///
    /// # Errors
    /// Returns [`ErrorKind::Config`](crate::ErrorKind::Config) if there is no such parameter.
    pub fn get(&self, key: &str) -> Result<f64> {
        Ok(self.values[self.definition.param_index(key)?])
    }

    /// Returns this effect with parameter `key` set to `value`. The unit of `value` is the unit of the parameter.
    ///
    /// # Errors
    /// Returns [`ErrorKind::Config`](crate::ErrorKind::Config) if the effect has no parameter `key`, or if `value` is
    /// outside the range of the parameter.
    pub fn with_value(mut self, key: &str, value: f64) -> Result<Self> {
        let index = self.definition.param_index(key)?;
        let checked = self.definition.params[index].check(value);
        self.values[index] = checked.map_err(|e| e.with_context(self.name()))?;
        Ok(self)
    }

    /// Returns this effect with parameter `key` parsed from `text`, for example from `"6.36 mV"`.
    ///
    /// # Examples
    /// ```
    /// use spikelane::effects;
    /// let flicker = effects::find("flicker")?.typical();
    /// let fast = flicker.clone().with_text("frequency_hz", "1.2 kHz")?;
    /// assert_eq!(fast.get("frequency_hz")?, 1200.0);
    /// assert_eq!(flicker.with_text("frequency_hz", "1200").unwrap_err().kind(), spikelane::ErrorKind::Config);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns [`ErrorKind::Config`](crate::ErrorKind::Config) if the effect has no parameter `key`, if `text` has a
    /// wrong unit, or if the value is outside the range of the parameter.
    pub fn with_text(mut self, key: &str, text: &str) -> Result<Self> {
        let index = self.definition.param_index(key)?;
        let parsed = self.definition.params[index].parse(text);
        self.values[index] = parsed.map_err(|e| e.with_context(self.name()))?;
        Ok(self)
    }

    /// Returns whether every parameter is neutral.
    #[must_use]
    pub fn is_neutral(&self) -> bool {
        self.definition.params.iter().zip(&self.values).all(|(p, v)| p.neutral == *v)
    }

    /// Predicts the changes that this effect causes in the spike statistics, or returns `None` if there is no closed form.
    ///
    /// # Examples
    /// ```
    /// use spikelane::{Camera, Sensor, effects};
    /// let camera = Camera::ideal(Sensor::new(64, 48, 20_000.0)?);
    /// let prnu = effects::find("prnu")?.neutral().with_value("sigma", 0.02)?;
    /// let moments = prnu.moments(&camera.operating_point(0.2)).expect("this effect has a closed form");
    /// assert!((moments.spatial_variance - 0.02f64.powi(2)).abs() < 1e-12);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    #[must_use]
    pub fn moments(&self, at: &OperatingPoint) -> Option<Moments> {
        (self.definition.moments)(&self.values, at)
    }

    pub(super) fn edit(&self, sensor: &Sensor, circuit: &mut Circuit, seeds: Seeds) {
        let mut pattern = PatternRng::new(seeds, self.definition.stream());
        (self.definition.edit)(&self.values, sensor, circuit, &mut pattern);
    }

    /// Returns whether this effect has no operations at readouts and only changes the circuits of the pixels.
    ///
    /// # Examples
    /// ```
    /// use spikelane::{Sensor, effects};
    /// let sensor = Sensor::new(64, 48, 20_000.0)?;
    /// assert!(effects::find("prnu")?.typical().is_fixed_pattern(&sensor));
    /// assert!(!effects::find("shot_noise")?.typical().is_fixed_pattern(&sensor));
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    #[must_use]
    pub fn is_fixed_pattern(&self, sensor: &Sensor) -> bool {
        self.definition.typical().ops(sensor).is_empty()
    }

    pub(super) fn ops(&self, sensor: &Sensor) -> Vec<Op> {
        (self.definition.ops)(&self.values, sensor)
    }
}

impl PartialEq for Effect {
    fn eq(&self, other: &Self) -> bool {
        self.definition == other.definition && self.values == other.values
    }
}
