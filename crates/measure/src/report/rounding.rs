//! Rounding of values to the digits that their errors support.

use std::fmt::{self, Display, Write as _};

/// Magnitudes from this value on, and below [`MIN_PLAIN`], are written with a power of ten.
const MAX_PLAIN: f64 = 1e6;
const MIN_PLAIN: f64 = 1e-3;

/// Number of significant digits of a value without a known error.
const DIGITS_WITHOUT_ERROR: i32 = 4;

/// A value and its error, rounded to two significant digits of the error.
///
/// `Display` writes `0.09960 ± 0.00040`. The alternate form `{:#}` writes `+-` and `e9` for terminals without Unicode.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RoundedValue {
    value: String,
    error: Option<String>,
    exponent: i32,
}

impl RoundedValue {
    /// Returns the value with its power of ten, such as `1.235e-5`, for columns of a table.
    #[must_use]
    pub fn value_column(&self) -> String {
        self.with_power(&self.value)
    }

    /// Returns the error with its power of ten, or an empty text if the error is unknown.
    #[must_use]
    pub fn error_column(&self) -> String {
        self.error.as_ref().map_or_else(String::new, |error| self.with_power(error))
    }

    fn with_power(&self, number: &str) -> String {
        if self.exponent == 0 { number.to_owned() } else { format!("{number}e{}", self.exponent) }
    }
}

impl Display for RoundedValue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let sign = if f.alternate() { "+-" } else { "±" };
        let power = match (self.exponent, f.alternate()) {
            (0, _) => String::new(),
            (n, true) => format!("e{n}"),
            (n, false) => power_of_ten(n),
        };
        match &self.error {
            Some(error) if power.is_empty() => write!(f, "{} {sign} {error}", self.value),
            Some(error) => write!(f, "({} {sign} {error}){power}", self.value),
            None => write!(f, "{}{power}", self.value),
        }
    }
}

/// Returns `" × 10ⁿ"`.
pub(super) fn power_of_ten(exponent: i32) -> String {
    let digits = exponent.to_string().chars().fold(String::new(), |mut text, c| {
        let _ = text.write_char(match c {
            '-' => '⁻',
            '1' => '¹',
            '2' => '²',
            '3' => '³',
            c => char::from_u32('⁰' as u32 + c.to_digit(10).unwrap_or(0)).unwrap_or(c),
        });
        text
    });
    format!(" × 10{digits}")
}

/// Rounds `value` and its standard error to two significant digits of the error.
///
/// An error of 0 is exact and leaves up to six significant digits of the value. If the error is not finite, the value has
/// four significant digits and no error. A value that is not finite is written as `unknown`.
///
/// # Examples
/// ```
/// use spikelane_measure::report::with_error;
/// assert_eq!(with_error(0.0996, 0.0004).to_string(), "0.09960 ± 0.00040");
/// assert_eq!(with_error(123_456.0, 2345.0).to_string(), "123500 ± 2300");
/// assert_eq!(with_error(1.234_56e-5, 2.3e-7).to_string(), "(1.235 ± 0.023) × 10⁻⁵");
/// assert_eq!(format!("{:#}", with_error(2.0, 0.1)), "2.00 +- 0.10");
/// ```
#[must_use]
pub fn with_error(value: f64, error: f64) -> RoundedValue {
    if !value.is_finite() {
        return RoundedValue { value: "unknown".to_owned(), error: None, exponent: 0 };
    }
    let error = error.abs();
    let has_error = error.is_finite();
    let magnitude = if has_error { value.abs().max(error) } else { value.abs() };
    let plain = magnitude == 0.0 || (MIN_PLAIN..MAX_PLAIN).contains(&magnitude);
    let exponent = if plain { 0 } else { decimal_exponent(magnitude, 0) };
    let place = match (has_error, error > 0.0) {
        (true, true) => decimal_exponent(error, 1) - 1,
        (true, false) => (decimal_exponent(value, 5) - 5).min(0),
        (false, _) => (decimal_exponent(value, DIGITS_WITHOUT_ERROR - 1) + 1 - DIGITS_WITHOUT_ERROR).min(0),
    };
    let text = |x: f64| at_place(x, place, exponent);
    match (has_error, error > 0.0) {
        (true, true) => RoundedValue { value: text(value), error: Some(text(error)), exponent },
        (true, false) => RoundedValue {
            value: without_trailing_zeros(&text(value)),
            error: Some("0".to_owned()),
            exponent,
        },
        (false, _) => RoundedValue { value: without_trailing_zeros(&text(value)), error: None, exponent },
    }
}

/// Rounds a value whose error is unknown to four significant digits, without zeros at the end. Integers keep all digits
/// below a million.
///
/// # Examples
/// ```
/// use spikelane_measure::report::without_error;
/// assert_eq!(without_error(0.123_456), "0.1235");
/// assert_eq!((without_error(250.0), without_error(0.3)), ("250".to_owned(), "0.3".to_owned()));
/// ```
#[must_use]
pub fn without_error(value: f64) -> String {
    if value == value.trunc() && value.abs() < MAX_PLAIN {
        return format!("{}", value + 0.0);
    }
    with_error(value, f64::NAN).to_string()
}

/// Rounds a value and its interval to two significant digits of half the interval.
///
/// # Examples
/// ```
/// use spikelane_measure::report::with_interval;
/// assert_eq!(with_interval(0.8123, 0.752, 0.871), "0.812 (0.752 to 0.871)");
/// ```
#[must_use]
pub fn with_interval(value: f64, low: f64, high: f64) -> String {
    let half = (high - low) / 2.0;
    let [value, low, high] = [value, low, high].map(|x| with_error(x, half));
    let power = if value.exponent == 0 { String::new() } else { power_of_ten(value.exponent) };
    // Each of the three values may have another power of ten. The interval then states its own powers.
    if low.exponent == value.exponent && high.exponent == value.exponent {
        return format!("{} ({} to {}){power}", value.value, low.value, high.value);
    }
    let own = |r: &RoundedValue| {
        let power = if r.exponent == 0 { String::new() } else { power_of_ten(r.exponent) };
        format!("{}{power}", r.value)
    };
    format!("{} ({} to {})", own(&value), own(&low), own(&high))
}

/// Returns the exponent of `x` after it is rounded to `digits` digits behind its first digit. Returns 0 for 0.
fn decimal_exponent(x: f64, digits: i32) -> i32 {
    let text = format!("{:.*e}", digits.max(0) as usize, x.abs());
    text.rsplit('e').next().and_then(|e| e.parse().ok()).unwrap_or(0)
}

/// Writes `x` divided by `10^exponent`, rounded to multiples of `10^place`.
fn at_place(x: f64, place: i32, exponent: i32) -> String {
    // A number of 64 bits has at most 17 significant digits.
    let decimals = (exponent - place).clamp(0, 16) as usize;
    let scaled = if exponent == 0 { x } else { x / 10_f64.powi(exponent) };
    let text = if place > exponent {
        let step = 10_f64.powi(place - exponent);
        format!("{:.0}", (scaled / step).round() * step)
    } else {
        format!("{scaled:.decimals$}")
    };
    let is_zero = text.chars().all(|c| matches!(c, '-' | '0' | '.'));
    if is_zero { text.trim_start_matches('-').to_owned() } else { text }
}

fn without_trailing_zeros(text: &str) -> String {
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text.to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_have_two_digits_of_their_errors() {
        // Cases worked out by hand.
        for (value, error, text) in [
            (0.0996, 0.0004, "0.09960 ± 0.00040"),
            (0.5, 0.0996, "0.50 ± 0.10"),
            (-0.0049, 0.12, "0.00 ± 0.12"),
            (-0.05, 0.12, "-0.05 ± 0.12"),
            (99.96, 0.25, "99.96 ± 0.25"),
            (123_456.0, 2345.0, "123500 ± 2300"),
            (7.0, 12.0, "7 ± 12"),
            (3.0, 1234.0, "0 ± 1200"),
            (1.0 / 3.0, 1e-9, "0.3333333333 ± 0.0000000010"),
        ] {
            assert_eq!(with_error(value, error).to_string(), text);
        }
    }

    #[test]
    fn an_exact_value_keeps_its_digits() {
        assert_eq!(with_error(0.25, 0.0).to_string(), "0.25 ± 0");
        assert_eq!(with_error(20_000.0, 0.0).to_string(), "20000 ± 0");
        assert_eq!(with_error(0.0, 0.0).to_string(), "0 ± 0");
    }

    #[test]
    fn huge_and_tiny_values_have_a_power_of_ten() {
        assert_eq!(with_error(1.234_56e9, 2.3e6).to_string(), "(1.2346 ± 0.0023) × 10⁹");
        assert_eq!(with_error(1.234_56e-5, 2.3e-7).to_string(), "(1.235 ± 0.023) × 10⁻⁵");
        assert_eq!(with_error(0.0, 1e-12).to_string(), "(0.0 ± 1.0) × 10⁻¹²");
        assert_eq!(format!("{:#}", with_error(6.02e23, 1e21)), "(6.020 +- 0.010)e23");
    }

    #[test]
    fn a_number_that_is_not_finite_is_never_written() {
        assert_eq!(with_error(f64::NAN, 1.0).to_string(), "unknown");
        assert_eq!(with_error(f64::INFINITY, f64::NAN).to_string(), "unknown");
        assert_eq!(with_error(0.123_456, f64::INFINITY).to_string(), "0.1235");
    }

    #[test]
    fn the_ends_of_an_interval_have_the_digits_of_its_value() {
        assert_eq!(with_interval(0.007_44, 0.003_42, 0.011_46), "0.0074 (0.0034 to 0.0115)");
        assert_eq!(with_interval(8.2, 6.574_67, 9.950_68), "8.2 (6.6 to 10.0)");
        assert_eq!(with_interval(2480.0, 2100.0, 2900.0), "2480 (2100 to 2900)");
    }
}
