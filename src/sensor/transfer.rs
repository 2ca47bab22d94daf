//! The curve by which codes stand for light.

use std::str::FromStr;

use crate::error::{Error, Kind, Result};

/// How codes in 0 to 1 stand for light in 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Transfer {
    /// Codes are light.
    Linear,
    /// The curve of IEC 61966-2-1: linear below 0.04045, then a power of 2.4.
    Srgb,
    /// Light is the code to this power; positive and finite.
    Gamma(f64),
}

impl Transfer {
    /// The light of a code. Codes above 1 go on along the curve, negative codes
    /// keep their sign (so that a check for negative light still sees them).
    #[must_use]
    pub fn light(self, code: f64) -> f64 {
        let x = code.abs();
        let y = match self {
            Self::Linear => x,
            Self::Srgb if x <= 0.04045 => x / 12.92,
            Self::Srgb => libm::pow((x + 0.055) / 1.055, 2.4),
            Self::Gamma(g) => libm::pow(x, g),
        };
        if code < 0.0 { -y } else { y }
    }

    /// 8-bit codes to light at 16 bits, rounded to nearest.
    #[must_use]
    pub fn table8(self) -> [u16; 256] {
        std::array::from_fn(|i| (self.light(i as f64 / 255.0) * 65535.0 + 0.5) as u16)
    }

    /// 16-bit codes to light, 1.0 at code 65535.
    ///
    /// Floats, because sRGB's darkest 16-bit codes are a thirteenth of a linear step apart.
    #[must_use]
    pub fn table16(self) -> Vec<f32> {
        (0..=u16::MAX).map(|i| self.light(f64::from(i) / 65535.0) as f32).collect()
    }
}

impl FromStr for Transfer {
    type Err = Error;

    /// `linear`, `srgb`, or the exponent as a number.
    fn from_str(text: &str) -> Result<Self> {
        match text {
            "linear" => return Ok(Self::Linear),
            "srgb" => return Ok(Self::Srgb),
            _ => {}
        }
        match text.parse::<f64>() {
            Ok(g) if (0.1..=10.0).contains(&g) => Ok(Self::Gamma(g)),
            _ => Err(Error::new(Kind::Usage, "transfer function")
                .found(format_args!("`{text}`"))
                .expected("linear, srgb, or an exponent from 0.1 to 10 such as 2.2")),
        }
    }
}

impl std::fmt::Display for Transfer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Linear => f.write_str("linear"),
            Self::Srgb => f.write_str("srgb"),
            Self::Gamma(g) => write!(f, "{g}"),
        }
    }
}
