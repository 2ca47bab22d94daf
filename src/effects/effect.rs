//! An effect with its numbers.

use crate::draws::Seeds;
use crate::draws::pattern::Pattern;
use crate::error::Result;
use crate::pixel::Op;
use crate::sensor::Sensor;

use super::circuit::Circuit;
use super::definition::{Definition, Moments, Operating};
use super::param::Param;

impl Definition {
    /// An effect with neutral parameters.
    #[must_use]
    pub fn neutral(&'static self) -> Effect {
        Effect::of(self, |p| p.neutral)
    }

    /// An effect with typical parameters.
    #[must_use]
    pub fn typical(&'static self) -> Effect {
        Effect::of(self, |p| p.typical)
    }
}

/// An effect with its parameters' values.
#[derive(Clone, Debug)]
pub struct Effect {
    definition: &'static Definition,
    values: Vec<f64>,
}

impl Effect {
    fn of(definition: &'static Definition, value: fn(&Param) -> f64) -> Self {
        Self { definition, values: definition.params.iter().map(value).collect() }
    }

    /// What this effect is.
    #[must_use]
    pub fn definition(&self) -> &'static Definition {
        self.definition
    }

    /// Canonical name.
    #[must_use]
    pub fn name(&self) -> &'static str {
        self.definition.name
    }

    /// Values in the order of [`Definition::params`].
    #[must_use]
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// The value of `key`, in the parameter's unit.
    ///
    /// # Errors
    /// When there is no such parameter.
    pub fn get(&self, key: &str) -> Result<f64> {
        Ok(self.values[self.definition.index(key)?])
    }

    /// This effect with `key` set to `value`, in the parameter's unit.
    ///
    /// # Errors
    /// When there is no such parameter, or the value lies outside its range.
    pub fn with(mut self, key: &str, value: f64) -> Result<Self> {
        let index = self.definition.index(key)?;
        let checked = self.definition.params[index].check(value);
        self.values[index] = checked.map_err(|e| e.within(self.name()))?;
        Ok(self)
    }

    /// This effect with `key` read from `text`, for instance `"6.36 mV"`.
    ///
    /// # Errors
    /// When there is no such parameter, or the text has a wrong unit or range.
    pub fn with_text(mut self, key: &str, text: &str) -> Result<Self> {
        let index = self.definition.index(key)?;
        let parsed = self.definition.params[index].parse(text);
        self.values[index] = parsed.map_err(|e| e.within(self.name()))?;
        Ok(self)
    }

    /// Whether every parameter is neutral.
    #[must_use]
    pub fn is_neutral(&self) -> bool {
        self.definition.params.iter().zip(&self.values).all(|(p, v)| p.neutral == *v)
    }

    /// What this effect adds for an observer, where a closed form exists.
    #[must_use]
    pub fn moments(&self, at: &Operating) -> Option<Moments> {
        (self.definition.moments)(&self.values, at)
    }

    pub(super) fn edit(&self, sensor: &Sensor, circuit: &mut Circuit, seeds: Seeds) {
        let mut pattern = Pattern::new(seeds, self.definition.stream());
        (self.definition.edit)(&self.values, sensor, circuit, &mut pattern);
    }

    /// Whether it makes pixels differ and names no operation at readouts.
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
