//! What an effect is: names, parameters with units and ranges, and three functions.

use crate::draws::pattern::Pattern;
use crate::draws::{Seeds, Stream};
use crate::error::{Error, Kind, Result};
use crate::pixel::Op;
use crate::sensor::Sensor;
use crate::units::Unit;

use super::circuit::Circuit;

/// The word for a number without a limit, which no camera file and no table writes as one.
const UNLIMITED: &str = "unlimited";

/// How a parameter's value is written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Form {
    /// A number in a unit, within `[low, high]`.
    Number {
        /// Unit in which the value is stored.
        unit: Unit,
        /// Smallest value.
        low: f64,
        /// Largest value.
        high: f64,
    },
    /// One of these words; stored as its index.
    Choice(&'static [&'static str]),
}

/// One parameter of an effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Param {
    /// Key in presets and on the command line.
    pub key: &'static str,
    /// How it is written.
    pub form: Form,
    /// The value at which the effect does nothing (with the others at theirs),
    /// and the one that a preset need not name.
    pub neutral: f64,
    /// A realistic value, used by tests and documentation.
    pub typical: f64,
    /// What it means.
    pub help: &'static str,
}

impl Param {
    /// A number with its unit, bounds, neutral and typical value.
    #[must_use]
    pub const fn number(
        key: &'static str,
        unit: Unit,
        (low, high): (f64, f64),
        neutral: f64,
        typical: f64,
        help: &'static str,
    ) -> Self {
        Self { key, form: Form::Number { unit, low, high }, neutral, typical, help }
    }

    /// A word out of `words`; the first is the neutral one.
    #[must_use]
    pub const fn choice(
        key: &'static str,
        words: &'static [&'static str],
        typical: usize,
        help: &'static str,
    ) -> Self {
        Self { key, form: Form::Choice(words), neutral: 0.0, typical: typical as f64, help }
    }

    fn check(&self, value: f64) -> Result<f64> {
        match self.form {
            Form::Number { unit, low, high } if !(low..=high).contains(&value) => {
                Err(Error::new(Kind::Config, self.key)
                    .found(self.format(value))
                    .expected(range(unit, low, high)))
            }
            Form::Choice(words) if value.fract() != 0.0 || value < 0.0 || value >= words.len() as f64 => {
                Err(Error::new(Kind::Config, self.key)
                    .found(value)
                    .expected(format_args!("one of {}", words.join(", "))))
            }
            _ => Ok(value),
        }
    }

    /// Reads the value from its text.
    ///
    /// # Errors
    /// When the unit, the range or the word is wrong.
    pub fn parse(&self, text: &str) -> Result<f64> {
        match self.form {
            Form::Number { .. } if text.trim() == UNLIMITED => self.check(f64::INFINITY),
            Form::Number { unit, .. } => {
                let value = unit.parse(text).map_err(|e| e.within(self.key))?;
                self.check(value)
            }
            Form::Choice(words) => {
                let index = words.iter().position(|w| *w == text.trim());
                index.map(|i| i as f64).ok_or_else(|| {
                    Error::new(Kind::Config, self.key)
                        .found(format_args!("\"{text}\""))
                        .expected(format_args!("one of {}", words.join(", ")))
                })
            }
        }
    }

    /// The text of `value`, as [`Param::parse`] reads it.
    #[must_use]
    pub fn format(&self, value: f64) -> String {
        match self.form {
            Form::Number { unit, .. } => quantity(unit, value),
            Form::Choice(words) => words[value as usize].to_owned(),
        }
    }

    /// What the parameter may be, in words: a range with its unit, or the words to choose from.
    #[must_use]
    pub fn range(&self) -> String {
        match self.form {
            Form::Number { unit, low, high } => range(unit, low, high),
            Form::Choice(words) => words.join(" or "),
        }
    }
}

/// The text of a quantity, or the word for one without a limit.
fn quantity(unit: Unit, value: f64) -> String {
    if value == f64::INFINITY { UNLIMITED.to_owned() } else { unit.format(value) }
}

fn range(unit: Unit, low: f64, high: f64) -> String {
    format!("{} to {}", quantity(unit, low), quantity(unit, high))
}

/// The values of an effect's parameters, in the order of its definition.
pub type Values<'a> = &'a [f64];

/// Where an observer looks: a pixel at a mean increment per readout.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Operating {
    /// Light in full scales.
    pub light: f64,
    /// Charge per readout that light adds, in nominal thresholds.
    pub from_light: f64,
    /// Charge per readout that the dark current adds, in nominal thresholds.
    pub from_dark: f64,
    /// Electrons in a nominal threshold.
    pub electrons: f64,
    /// Nominal threshold voltage in volts.
    pub swing_v: f64,
    /// Nominal capacitance in femtofarads.
    pub capacitance_ff: f64,
    /// Readout period in seconds.
    pub period_s: f64,
}

impl Operating {
    /// Mean charge per readout in thresholds: the ideal rate below saturation.
    #[must_use]
    pub fn increment(&self) -> f64 {
        self.from_light + self.from_dark
    }
}

/// What an effect adds to what an observer sees, to lowest order in its strength.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Moments {
    /// Added mean rate in spikes per readout.
    pub rate: f64,
    /// Added variance of the charge between two spikes, in thresholds squared:
    /// the growth of `D(n)` per interval times the squared rate.
    pub phase_variance: f64,
    /// Added variance over the pixels of the relative rate.
    pub spatial_variance: f64,
}

/// An effect: the extension point of the model. One file holds one of these.
#[derive(Debug)]
pub struct Definition {
    /// Canonical name in presets, on the command line and in reports.
    pub name: &'static str,
    /// One sentence of physics.
    pub summary: &'static str,
    /// Where the formula comes from.
    pub source: &'static str,
    /// Parameters, in the order of [`Values`].
    pub params: &'static [Param],
    /// Edits the circuit of every pixel; costs nothing at run time.
    pub edit: fn(Values<'_>, &Sensor, &mut Circuit, &mut Pattern),
    /// Names the operations that every readout carries out.
    pub ops: fn(Values<'_>, &Sensor) -> Vec<Op>,
    /// Predicts what an observer sees, where a closed form exists.
    pub moments: fn(Values<'_>, &Operating) -> Option<Moments>,
}

/// For effects that do not edit the circuit.
pub fn no_edit(_: Values<'_>, _: &Sensor, _: &mut Circuit, _: &mut Pattern) {}

/// For effects that need no operation at run time.
pub fn no_ops(_: Values<'_>, _: &Sensor) -> Vec<Op> {
    Vec::new()
}

impl Definition {
    /// The stream of this effect's draws.
    #[must_use]
    pub fn stream(&self) -> Stream {
        Stream::named(self.name)
    }

    /// The place of parameter `key`.
    ///
    /// # Errors
    /// When there is none; the error lists those there are.
    pub fn index(&self, key: &str) -> Result<usize> {
        self.params.iter().position(|p| p.key == key).ok_or_else(|| {
            let keys: Vec<_> = self.params.iter().map(|p| p.key).collect();
            Error::new(Kind::Config, format_args!("effect {}", self.name))
                .found(format_args!("parameter \"{key}\""))
                .expected(format_args!("one of {}", keys.join(", ")))
                .or_nearest(key, keys)
        })
    }

    /// An effect with neutral parameters.
    #[must_use]
    pub fn neutral(&'static self) -> Effect {
        Effect { definition: self, values: self.params.iter().map(|p| p.neutral).collect() }
    }

    /// An effect with typical parameters.
    #[must_use]
    pub fn typical(&'static self) -> Effect {
        Effect { definition: self, values: self.params.iter().map(|p| p.typical).collect() }
    }
}

/// An effect with its parameters' values.
#[derive(Clone, Debug)]
pub struct Effect {
    definition: &'static Definition,
    values: Vec<f64>,
}

impl Effect {
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
        self.name() == other.name() && self.values == other.values
    }
}
