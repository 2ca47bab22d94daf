//! Quantities with units, and the text form of quantities.
//!
//! Inside the crate a quantity is an `f64`. The ending of its name states the unit (`capacitance_ff`, `dark_pa`).
//! In presets and on the command line a quantity is a text such as `"4.348 fF"`. Only a dimensionless quantity may be a
//! bare number.

use crate::error::{Error, Result, error};

/// Charge of an electron in femtocoulombs (CODATA 2018, exact).
pub(crate) const ELECTRON_FC: f64 = 1.602_176_634e-4;

/// Boltzmann's constant in joules per kelvin (CODATA 2018, exact).
pub const BOLTZMANN_J_PER_K: f64 = 1.380_649e-23;

/// The unit in which a parameter is stored.
///
/// # Examples
/// ```
/// use spikelane::units::Unit;
/// assert_eq!(Unit::Hertz.parse("20 kHz")?, 20_000.0);
/// assert_eq!(Unit::Dimensionless.parse("25 %")?, 0.25);
/// assert_eq!(Unit::Femtofarad.format(4.348), "4.348 fF");
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// No dimension: a ratio, a probability or a count.
    Dimensionless,
    /// Volts.
    Volt,
    /// Femtofarads.
    Femtofarad,
    /// Femtocoulombs.
    Femtocoulomb,
    /// Picoamperes.
    Picoampere,
    /// Kelvins.
    Kelvin,
    /// Hertz.
    Hertz,
    /// Readout periods.
    Readout,
    /// Electrons, or photons if the parameter counts photons.
    Electron,
    /// Pixels.
    Pixel,
}

/// The symbols of a unit. Each symbol has the factor that converts a value with this symbol to the stored unit.
type Suffixes = &'static [(&'static str, f64)];

impl Unit {
    /// Returns the symbol of the stored unit, which is empty for [`Unit::Dimensionless`].
    ///
    /// # Examples
    /// ```
    /// use spikelane::units::Unit;
    /// assert_eq!((Unit::Volt.symbol(), Unit::Dimensionless.symbol()), ("V", ""));
    /// ```
    #[must_use]
    pub fn symbol(self) -> &'static str {
        self.suffixes().first().map_or("", |s| s.0)
    }

    fn suffixes(self) -> Suffixes {
        match self {
            Self::Dimensionless => &[],
            Self::Volt => &[("V", 1.0), ("mV", 1e-3), ("uV", 1e-6), ("nV", 1e-9)],
            Self::Femtofarad => &[("fF", 1.0), ("pF", 1e3), ("aF", 1e-3)],
            Self::Femtocoulomb => &[("fC", 1.0), ("pC", 1e3), ("aC", 1e-3)],
            Self::Picoampere => &[("pA", 1.0), ("nA", 1e3), ("fA", 1e-3)],
            Self::Kelvin => &[("K", 1.0)],
            Self::Hertz => &[("Hz", 1.0), ("kHz", 1e3), ("MHz", 1e6)],
            Self::Readout => &[("readouts", 1.0), ("readout", 1.0)],
            Self::Electron => &[("electrons", 1.0), ("photons", 1.0), ("e", 1.0)],
            Self::Pixel => &[("px", 1.0), ("pixels", 1.0)],
        }
    }

    /// Parses `text`: a number followed by one of this unit's symbols.
    ///
    /// A dimensionless value has no symbol or the symbol `%`.
    ///
    /// # Examples
    /// ```
    /// use spikelane::units::Unit;
    /// assert_eq!(Unit::Volt.parse("500 mV")?, 0.5);
    ///
    /// let error = Unit::Volt.parse("500").unwrap_err();
    /// assert_eq!(error.to_string(), "quantity: found \"500\", expected a number with its unit (V, mV, uV, nV)");
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns [`ErrorKind::Config`](crate::ErrorKind::Config) if the number is malformed or not finite, or if its unit is missing or wrong.
    pub fn parse(self, text: &str) -> Result<f64> {
        let text = text.trim();
        let split = text
            .char_indices()
            .find(|&(i, c)| {
                let exponent = matches!(c, 'e' | 'E')
                    && text[i + 1..].starts_with(|d: char| d.is_ascii_digit() || "+-".contains(d));
                !(c.is_ascii_digit() || "+-._".contains(c) || exponent)
            })
            .map_or(text.len(), |(i, _)| i);
        let (number, suffix) = (text[..split].trim(), text[split..].trim());
        let value: f64 =
            number.parse().ok().filter(|v: &f64| v.is_finite()).ok_or_else(|| self.parse_error(text))?;
        if matches!(self, Self::Dimensionless) {
            return match suffix {
                "" => Ok(value),
                "%" => Ok(value / 100.0),
                _ => Err(self.parse_error(text)),
            };
        }
        let factor = self.suffixes().iter().find(|s| s.0 == suffix);
        factor.map(|&(_, factor)| value * factor).ok_or_else(|| self.parse_error(text))
    }

    /// Returns `value` with its symbol, in a form that [`Unit::parse`] reads back exactly.
    ///
    /// # Examples
    /// ```
    /// use spikelane::units::Unit;
    /// assert_eq!(Unit::Picoampere.format(0.4442), "0.4442 pA");
    /// assert_eq!(Unit::Dimensionless.format(0.02), "0.02");
    /// ```
    #[must_use]
    pub fn format(self, value: f64) -> String {
        match self.symbol() {
            "" => format!("{value}"),
            symbol => format!("{value} {symbol}"),
        }
    }

    fn parse_error(self, text: &str) -> Error {
        let expected = match self {
            Self::Dimensionless => "a number without a unit".to_owned(),
            _ => {
                let names: Vec<_> = self.suffixes().iter().map(|s| s.0).collect();
                format!("a number with its unit ({})", names.join(", "))
            }
        };
        error!(Config, "quantity"; found "\"{text}\""; expected "{expected}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_printed_quantity_reads_back_to_the_same_bits() {
        for unit in [Unit::Volt, Unit::Femtofarad, Unit::Dimensionless, Unit::Hertz] {
            for value in [0.0, -0.0076, 1.0 / 3.0, 9.644e-9, 2e4] {
                let text = unit.format(value);
                assert_eq!(unit.parse(&text).unwrap().to_bits(), value.to_bits(), "{text}");
            }
        }
    }

    #[test]
    fn prefixes_scale_and_foreign_units_are_refused() {
        assert!((Unit::Volt.parse("6.36 mV").unwrap() - 6.36e-3).abs() < 1e-18);
        assert!((Unit::Hertz.parse("20kHz").unwrap() - 2e4).abs() < 1e-9);
        assert!((Unit::Electron.parse("2e4 e").unwrap() - 2e4).abs() < 1e-9);
        for wrong in ["1", "1 A", "mV", "1 V V", "inf V", "nan V", ""] {
            assert!(Unit::Volt.parse(wrong).is_err(), "{wrong}");
        }
        assert!(Unit::Dimensionless.parse("3 V").is_err());
    }
}
