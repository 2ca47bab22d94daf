//! A parameter: its key, its unit and range, and where a diagnosis tries it.

use crate::error::{Error, Kind, Result};
use crate::units::Unit;

use super::tried::Tried;

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

/// One parameter of an effect, made by [`Param::number`] or [`Param::choice`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
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
    /// Where a diagnosis tries it; `None` for what stays neutral there.
    pub tried: Option<Tried>,
    /// Whether cameras were written before there was this one: their texts, and what is keyed by them, must not change, so
    /// it is written only where it is not neutral.
    pub came_later: bool,
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
        Self {
            key,
            form: Form::Number { unit, low, high },
            neutral,
            typical,
            help,
            tried: None,
            came_later: false,
        }
    }

    /// A word out of `words`; the first is the neutral one.
    #[must_use]
    pub const fn choice(
        key: &'static str,
        words: &'static [&'static str],
        typical: usize,
        help: &'static str,
    ) -> Self {
        Self {
            key,
            form: Form::Choice(words),
            neutral: 0.0,
            typical: typical as f64,
            help,
            tried: None,
            came_later: false,
        }
    }

    /// This number, which a diagnosis tries too.
    #[must_use]
    pub const fn tried(mut self, tried: Tried) -> Self {
        self.tried = Some(tried);
        self
    }

    /// This parameter, which an effect got after cameras with it had been written.
    #[must_use]
    pub const fn coming_later(mut self) -> Self {
        self.came_later = true;
        self
    }

    pub(super) fn check(&self, value: f64) -> Result<f64> {
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
