//! Rates as fractions, so that no frame drifts.

use std::str::FromStr;

use crate::error::{Error, Kind, Result};

/// An exact positive number of events per second.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Rate {
    pub(super) num: u64,
    pub(super) den: u64,
}

impl Rate {
    /// `num / den` per second, in lowest terms.
    ///
    /// # Errors
    /// [`Kind::Usage`] when either is zero or beyond 10^12.
    pub fn new(num: u64, den: u64) -> Result<Self> {
        const MOST: u64 = 1_000_000_000_000;
        if num == 0 || den == 0 || num > MOST || den > MOST {
            return Err(bad_rate(&format!("{num}/{den}")));
        }
        let g = gcd(num, den);
        Ok(Self { num: num / g, den: den / g })
    }

    /// Numerator and denominator in lowest terms.
    #[must_use]
    pub const fn parts(self) -> (u64, u64) {
        (self.num, self.den)
    }

    /// Seconds from frame 0 to frame `frame`.
    #[must_use]
    pub fn seconds(self, frame: u64) -> f64 {
        frame as f64 * self.den as f64 / self.num as f64
    }

    /// The rate in hertz, as near as a float comes.
    #[must_use]
    pub fn hz(self) -> f64 {
        self.num as f64 / self.den as f64
    }
}

fn gcd(a: u64, b: u64) -> u64 {
    if b == 0 { a } else { gcd(b, a % b) }
}

fn bad_rate(text: &str) -> Error {
    Error::new(Kind::Usage, "rate")
        .found(format_args!("`{text}`"))
        .expected("a positive number per second, such as 25, 29.97 or 30000/1001")
}

impl FromStr for Rate {
    type Err = Error;

    /// A whole number, a fraction, or a decimal number with up to six places.
    ///
    /// 23.976, 29.97, 59.94 and 119.88 are read as the NTSC fractions that they
    /// abbreviate (24000/1001 and so on).
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
        let (whole, part) = text.split_once('.').unwrap_or((text, ""));
        if part.len() > 6 {
            return Err(bad());
        }
        let den = 10_u64.pow(part.len() as u32);
        let tail = if part.is_empty() { 0 } else { digits(part)? };
        let num = digits(whole)?.checked_mul(den).and_then(|n| n.checked_add(tail));
        Self::new(num.ok_or_else(bad)?, den).map_err(|_| bad())
    }
}

impl std::fmt::Display for Rate {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if self.den == 1 { write!(f, "{}", self.num) } else { write!(f, "{}/{}", self.num, self.den) }
    }
}
