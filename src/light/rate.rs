//! Rates as exact fractions. With fractions, the instants of frames do not drift.

use std::str::FromStr;

use crate::error::{Error, Result, error};

/// An exact positive number of events per second.
///
/// # Examples
/// ```
/// use spikelane::light::Rate;
/// let ntsc: Rate = "29.97".parse()?;
/// assert_eq!(ntsc.as_fraction(), (30_000, 1001));
/// // The time of frame 30,000 in seconds is exact.
/// assert_eq!(ntsc.seconds(30_000), 1001.0);
/// assert_eq!("-25".parse::<Rate>().unwrap_err().kind(), spikelane::ErrorKind::Usage);
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Rate {
    pub(super) num: u64,
    pub(super) den: u64,
}

impl Rate {
    /// Returns the rate of `num / den` events per second, in lowest terms.
    ///
    /// # Examples
    /// ```
    /// use spikelane::light::Rate;
    /// // Five frames in two seconds.
    /// let rate = Rate::new(10, 4)?;
    /// assert_eq!((rate.to_string(), rate.hz()), ("5/2".to_string(), 2.5));
    /// assert_eq!(Rate::new(25, 0).unwrap_err().parts().found, "`25/0`");
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns [`ErrorKind::Usage`](crate::ErrorKind::Usage) if either number is zero or greater than 10^12.
    pub fn new(num: u64, den: u64) -> Result<Self> {
        const MAX_TERM: u64 = 1_000_000_000_000;
        if num == 0 || den == 0 || num > MAX_TERM || den > MAX_TERM {
            return Err(bad_rate(&format!("{num}/{den}")));
        }
        let divisor = gcd(num.into(), den.into()) as u64;
        Ok(Self { num: num / divisor, den: den / divisor })
    }

    /// Returns the numerator and the denominator in lowest terms.
    #[must_use]
    pub const fn as_fraction(self) -> (u64, u64) {
        (self.num, self.den)
    }

    /// Returns the number of seconds between frame 0 and frame `frame`.
    #[must_use]
    pub fn seconds(self, frame: u64) -> f64 {
        frame as f64 * self.den as f64 / self.num as f64
    }

    /// Returns the rate in hertz, rounded to a float.
    #[must_use]
    pub fn hz(self) -> f64 {
        self.num as f64 / self.den as f64
    }
}

/// Returns the greatest common divisor.
pub(super) fn gcd(a: u128, b: u128) -> u128 {
    if b == 0 { a } else { gcd(b, a % b) }
}

fn bad_rate(text: &str) -> Error {
    error!(Usage, "rate"; found "`{text}`";
        expected "a positive number per second, such as 25, 29.97 or 30000/1001")
}

impl FromStr for Rate {
    type Err = Error;

    /// Parses a whole number, a fraction, or a decimal number with up to six decimal places.
    ///
    /// 23.976, 29.97, 59.94 and 119.88 are parsed as the exact NTSC fractions, for example 23.976 as 24000/1001.
    fn from_str(text: &str) -> Result<Self> {
        let bad = || bad_rate(text);
        let digits = |s: &str| s.parse::<u64>().map_err(|_| bad());
        for (name, thousands) in [("23.976", 24), ("29.97", 30), ("59.94", 60), ("119.88", 120)] {
            if text == name {
                return Self::new(thousands * 1000, 1001);
            }
        }
        if let Some((num, den)) = text.split_once('/') {
            return Self::new(digits(num)?, digits(den)?).map_err(|_| bad());
        }
        let (integer, part) = text.split_once('.').unwrap_or((text, ""));
        if part.len() > 6 {
            return Err(bad());
        }
        let den = 10_u64.pow(part.len() as u32);
        let tail = if part.is_empty() { 0 } else { digits(part)? };
        let num = digits(integer)?.checked_mul(den).and_then(|n| n.checked_add(tail));
        Self::new(num.ok_or_else(bad)?, den).map_err(|_| bad())
    }
}

impl std::fmt::Display for Rate {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if self.den == 1 { write!(f, "{}", self.num) } else { write!(f, "{}/{}", self.num, self.den) }
    }
}
