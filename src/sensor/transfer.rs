//! The tone curve between stored codes and light.

use std::str::FromStr;

use crate::error::{Error, ErrorKind, Result};

/// The function that converts codes, 0 to 1, to light, 0 to 1.
///
/// # Examples
/// ```
/// use spikelane::light::Transfer;
/// // A code of one half is much less than half of the light.
/// assert_eq!(Transfer::Linear.light(0.5), 0.5);
/// assert_eq!(Transfer::Gamma(2.0).light(0.5), 0.25);
/// assert_eq!((Transfer::Srgb.light(0.5) * 1000.0).round(), 214.0);
///
/// assert_eq!("2.2".parse::<Transfer>()?, Transfer::Gamma(2.2));
/// assert_eq!("rec709".parse::<Transfer>().unwrap_err().kind(), spikelane::ErrorKind::Usage);
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Transfer {
    /// Light equals the code.
    Linear,
    /// The curve of IEC 61966-2-1. It is linear for codes up to 0.04045 and a power function with exponent 2.4 above.
    Srgb,
    /// Light is the code to the power of the exponent in this variant. The exponent is positive and finite.
    Gamma(f64),
}

impl Transfer {
    /// Returns the light of a code.
    ///
    /// The curve is also defined for codes above 1. A negative code has negative light, so a later check can detect the
    /// error.
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

    /// Returns the light of every 8-bit code as 16-bit values, rounded to nearest.
    ///
    /// # Examples
    /// ```
    /// let table = spikelane::light::Transfer::Srgb.table8();
    /// assert_eq!((table[0], table[255]), (0, 65535));
    /// // sRGB assigns more than half of its codes to the darkest quarter of the light.
    /// assert!(table[136] < 65535 / 4);
    /// ```
    #[must_use]
    pub fn table8(self) -> [u16; 256] {
        std::array::from_fn(|i| (self.light(i as f64 / 255.0) * 65535.0 + 0.5) as u16)
    }

    /// Returns the light of every 16-bit code. Code 65535 has light 1.0.
    ///
    /// The light is returned as floats, because 16-bit integers are too coarse: adjacent dark 16-bit codes of sRGB
    /// differ by only a thirteenth of a linear 16-bit step.
    #[must_use]
    pub fn table16(self) -> Vec<f32> {
        (0..=u16::MAX).map(|i| self.light(f64::from(i) / 65535.0) as f32).collect()
    }
}

impl FromStr for Transfer {
    type Err = Error;

    /// Parses `linear`, `srgb`, or the exponent as a number.
    fn from_str(text: &str) -> Result<Self> {
        match text {
            "linear" => return Ok(Self::Linear),
            "srgb" => return Ok(Self::Srgb),
            _ => {}
        }
        match text.parse::<f64>() {
            Ok(g) if (0.1..=10.0).contains(&g) => Ok(Self::Gamma(g)),
            _ => Err(Error::new(ErrorKind::Usage, "transfer function")
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
