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
    #[must_use]
    pub fn neutral(&'static self) -> Effect {
        Effect::from_definition(self, |p| p.neutral)
    }

    /// Returns this effect with typical parameters.
    #[must_use]
    pub fn typical(&'static self) -> Effect {
        Effect::from_definition(self, |p| p.typical)
    }
}

/// An effect with the values of its parameters.
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
    #[must_use]
    pub fn moments(&self, at: &OperatingPoint) -> Option<Moments> {
        (self.definition.moments)(&self.values, at)
    }

    pub(super) fn edit(&self, sensor: &Sensor, circuit: &mut Circuit, seeds: Seeds) {
        let mut pattern = PatternRng::new(seeds, self.definition.stream());
        (self.definition.edit)(&self.values, sensor, circuit, &mut pattern);
    }

    /// Returns whether this effect has no operations at readouts and only changes the circuits of the pixels.
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
