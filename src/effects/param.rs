//! A parameter of an effect: its key, unit and range, and the values that a diagnosis tries.

use crate::error::{Result, error};
use crate::units::Unit;

use super::search_spec::SearchSpec;

/// The text of an infinite value. Camera files and tables cannot contain infinity as a number.
const UNLIMITED_WORD: &str = "unlimited";

/// The type of a parameter's value.
///
/// # Examples
/// ```
/// use spikelane::effects::definition::ParamKind;
/// use spikelane::{effects, units::Unit};
/// let params = effects::find("dark_current")?.params;
/// assert_eq!(params[0].kind, ParamKind::Number { unit: Unit::Picoampere, low: -1e3, high: 1e6 });
/// assert_eq!(params[2].kind, ParamKind::Choice(&["kept", "zero"]));
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ParamKind {
    /// A number with a unit, in `[low, high]`.
    Number {
        /// Unit in which the value is stored.
        unit: Unit,
        /// Smallest value.
        low: f64,
        /// Largest value.
        high: f64,
    },
    /// One of these words. The stored value is the index of the word.
    Choice(&'static [&'static str]),
}

/// A parameter of an effect, created with [`Param::number`] or [`Param::choice`].
///
/// # Examples
/// ```
/// use spikelane::effects;
/// // The parameters of all effects that are voltages.
/// let voltages = effects::ALL.iter().flat_map(|effect| effect.params).filter(|param| param.range().ends_with(" V"));
/// for param in voltages {
///     assert_eq!(param.parse(&param.format(param.typical))?, param.typical, "{}", param.key);
/// }
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Param {
    /// Key in presets and on the command line.
    pub key: &'static str,
    /// Type, unit and range.
    pub kind: ParamKind,
    /// The value at which the effect does nothing if its other parameters are neutral too.
    ///
    /// A preset may omit a parameter with this value.
    pub neutral: f64,
    /// A realistic value, used by tests and documentation.
    pub typical: f64,
    /// Description of the parameter.
    pub help: &'static str,
    /// The values that a diagnosis tries. With `None`, a diagnosis does not change the parameter from its neutral value.
    pub search: Option<SearchSpec>,
    /// Whether the parameter is written only if it is not neutral.
    ///
    /// Set this field for a parameter that is added to an existing effect. Fingerprints depend on the text of a camera.
    /// The text of an older camera therefore must not change when the new parameter is neutral.
    pub is_omitted_if_neutral: bool,
}

impl Param {
    /// Returns a number with its unit, bounds, neutral and typical value.
    ///
    /// # Examples
    /// ```
    /// use spikelane::{effects::Param, units::Unit};
    /// const DEPTH: Param = Param::number("depth", Unit::Volt, (0.0, 0.5), 0.0, 0.01, "depth of the dip");
    /// assert_eq!(DEPTH.range(), "0 V to 0.5 V");
    /// assert_eq!(DEPTH.parse("20 mV")?, 0.02);
    ///
    /// let error = DEPTH.parse("600 mV").unwrap_err();
    /// assert_eq!(error.to_string(), "depth: found 0.6 V, expected 0 V to 0.5 V");
    /// # Ok::<(), spikelane::Error>(())
    /// ```
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
            kind: ParamKind::Number { unit, low, high },
            neutral,
            typical,
            help,
            search: None,
            is_omitted_if_neutral: false,
        }
    }

    /// Returns a parameter whose value is one of `words`. The first word is the neutral value, and `typical` is the
    /// index of a word.
    ///
    /// # Examples
    /// ```
    /// use spikelane::effects::Param;
    /// const EDGE: Param = Param::choice("edge", &["none", "left", "right"], 1, "affected edge of the sensor");
    /// // The stored value is the index of the word.
    /// assert_eq!(EDGE.parse("right")?, 2.0);
    /// assert_eq!(EDGE.format(EDGE.typical), "left");
    /// assert_eq!(EDGE.range(), "none or left or right");
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    #[must_use]
    pub const fn choice(
        key: &'static str,
        words: &'static [&'static str],
        typical: usize,
        help: &'static str,
    ) -> Self {
        Self {
            key,
            kind: ParamKind::Choice(words),
            neutral: 0.0,
            typical: typical as f64,
            help,
            search: None,
            is_omitted_if_neutral: false,
        }
    }

    /// Returns this number with the values that a diagnosis tries.
    #[must_use]
    pub const fn with_search(mut self, tried: SearchSpec) -> Self {
        self.search = Some(tried);
        self
    }

    /// Omits this parameter from the text of a camera if the parameter is neutral.
    #[must_use]
    pub const fn omit_if_neutral(mut self) -> Self {
        self.is_omitted_if_neutral = true;
        self
    }

    pub(super) fn check(&self, value: f64) -> Result<f64> {
        match self.kind {
            ParamKind::Number { unit, low, high } if !(low..=high).contains(&value) => {
                Err(error!(Config, "{}", self.key; found "{}", self.format(value);
                    expected "{}", format_range(unit, low, high)))
            }
            ParamKind::Choice(words)
                if value.fract() != 0.0 || value < 0.0 || value >= words.len() as f64 =>
            {
                Err(error!(Config, "{}", self.key; found "{value}"; expected "one of {}", words.join(", ")))
            }
            _ => Ok(value),
        }
    }

    /// Parses the text of a value.
    ///
    /// # Errors
    /// Returns [`ErrorKind::Config`](crate::ErrorKind::Config) if the number or its unit is invalid, or if the value is outside the range.
    pub fn parse(&self, text: &str) -> Result<f64> {
        match self.kind {
            ParamKind::Number { .. } if text.trim() == UNLIMITED_WORD => self.check(f64::INFINITY),
            ParamKind::Number { unit, .. } => {
                let value = unit.parse(text).map_err(|e| e.with_context(self.key))?;
                self.check(value)
            }
            ParamKind::Choice(words) => {
                let index = words.iter().position(|w| *w == text.trim());
                index.map(|i| i as f64).ok_or_else(|| {
                    error!(Config, "{}", self.key; found "\"{text}\""; expected "one of {}", words.join(", "))
                })
            }
        }
    }

    /// Returns the text of `value` in the form that [`Param::parse`] reads.
    #[must_use]
    pub fn format(&self, value: f64) -> String {
        match self.kind {
            ParamKind::Number { unit, .. } => format_quantity(unit, value),
            ParamKind::Choice(words) => words[value as usize].to_owned(),
        }
    }

    /// Returns the allowed values as text: a range with its unit, or the words to choose from.
    #[must_use]
    pub fn range(&self) -> String {
        match self.kind {
            ParamKind::Number { unit, low, high } => format_range(unit, low, high),
            ParamKind::Choice(words) => words.join(" or "),
        }
    }
}

/// Returns the text of a quantity, or [`UNLIMITED_WORD`] if it is infinite.
fn format_quantity(unit: Unit, value: f64) -> String {
    if value == f64::INFINITY { UNLIMITED_WORD.to_owned() } else { unit.format(value) }
}

fn format_range(unit: Unit, low: f64, high: f64) -> String {
    format!("{} to {}", format_quantity(unit, low), format_quantity(unit, high))
}
