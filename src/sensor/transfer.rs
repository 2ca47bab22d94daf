//! The tone curve between stored codes and light.

use std::str::FromStr;

use crate::error::{Error, Result, error};

const PQ_M1: f64 = 2610.0 / 16384.0;
const PQ_M2: f64 = 2523.0 / 4096.0 * 128.0;
const PQ_C1: f64 = 3424.0 / 4096.0;
const PQ_C2: f64 = 2413.0 / 4096.0 * 32.0;
const PQ_C3: f64 = 2392.0 / 4096.0 * 32.0;

const HLG_A: f64 = 0.178_832_77;
const HLG_B: f64 = 1.0 - 4.0 * HLG_A;
/// The value is 0.5 - a ln(4 a).
const HLG_C: f64 = 0.559_910_73;

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
    /// The perceptual quantizer of HDR video: the EOTF of ITU-R BT.2100-2, table 4 (SMPTE ST 2084). Light 1 is
    /// 10,000 cd/m2.
    Pq,
    /// Hybrid log-gamma: the inverse OETF of ITU-R BT.2100-2, table 5. Light 1 is the nominal peak of the scene.
    Hlg,
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
            Self::Pq => {
                let root = libm::pow(x, 1.0 / PQ_M2);
                libm::pow((root - PQ_C1).max(0.0) / (PQ_C2 - PQ_C3 * root), 1.0 / PQ_M1)
            }
            Self::Hlg if x <= 0.5 => x * x / 3.0,
            Self::Hlg => (libm::exp((x - HLG_C) / HLG_A) + HLG_B) / 12.0,
        };
        if code < 0.0 { -y } else { y }
    }

    /// Returns the code of `light`. Both are clamped to the range 0 to 1. This function is the inverse of
    /// [`Transfer::light`].
    #[must_use]
    pub fn code(self, light: f64) -> f64 {
        let x = light.clamp(0.0, 1.0);
        let code = match self {
            Self::Linear => x,
            Self::Srgb if x <= 0.003_130_8 => 12.92 * x,
            Self::Srgb => 1.055 * libm::pow(x, 1.0 / 2.4) - 0.055,
            Self::Gamma(g) => libm::pow(x, 1.0 / g),
            Self::Pq => {
                let power = libm::pow(x, PQ_M1);
                libm::pow((PQ_C1 + PQ_C2 * power) / (1.0 + PQ_C3 * power), PQ_M2)
            }
            Self::Hlg if x <= 1.0 / 12.0 => libm::sqrt(3.0 * x),
            Self::Hlg => HLG_A * libm::log(12.0 * x - HLG_B) + HLG_C,
        };
        code.clamp(0.0, 1.0)
    }

    /// Returns whether most codes have so little light that 16-bit linear samples would lose the dark codes.
    #[must_use]
    pub const fn is_high_dynamic_range(self) -> bool {
        matches!(self, Self::Pq | Self::Hlg)
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

    /// Parses `linear`, `srgb`, `pq`, `hlg`, or the exponent as a number.
    fn from_str(text: &str) -> Result<Self> {
        match text {
            "linear" => return Ok(Self::Linear),
            "srgb" => return Ok(Self::Srgb),
            "pq" => return Ok(Self::Pq),
            "hlg" => return Ok(Self::Hlg),
            _ => {}
        }
        match text.parse::<f64>() {
            Ok(g) if (0.1..=10.0).contains(&g) => Ok(Self::Gamma(g)),
            _ => Err(error!(Usage, "transfer function"; found "`{text}`";
                expected "linear, srgb, pq, hlg, or an exponent from 0.1 to 10 such as 2.2")),
        }
    }
}

impl std::fmt::Display for Transfer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Linear => f.write_str("linear"),
            Self::Srgb => f.write_str("srgb"),
            Self::Pq => f.write_str("pq"),
            Self::Hlg => f.write_str("hlg"),
            Self::Gamma(g) => write!(f, "{g}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Transfer;

    const ALL: [Transfer; 6] = [
        Transfer::Linear,
        Transfer::Srgb,
        Transfer::Gamma(2.2),
        Transfer::Gamma(0.5),
        Transfer::Pq,
        Transfer::Hlg,
    ];

    #[test]
    fn a_code_undoes_the_transfer_function() {
        for transfer in ALL {
            for i in 0..=255_u8 {
                let wanted = f64::from(i) / 255.0;
                let code = transfer.code(transfer.light(wanted));
                assert!((code - wanted).abs() < 1e-6, "{transfer} {i}: {code}");
            }
            assert!(transfer.code(-1.0) < 1e-6 && transfer.code(7.0) > 1.0 - 1e-6, "{transfer}");
        }
    }

    #[test]
    fn hdr_curves_have_the_values_of_the_recommendations() {
        // ITU-R BT.2408-7, table 1: signal levels of 100 cd/m2 and of diffuse white at 203 cd/m2.
        for (light, signal) in [(100.0, 0.508), (203.0, 0.581), (10_000.0, 1.0)] {
            assert!((Transfer::Pq.code(light / 1e4) - signal).abs() < 5e-4, "{light}");
        }
        // ITU-R BT.2100-2, table 5: the two branches meet at 1/12 of the peak. BT.2408-7: diffuse white has the signal 0.75.
        assert!((Transfer::Hlg.light(0.5) - 1.0 / 12.0).abs() < 1e-9);
        assert!((Transfer::Hlg.light(0.500_000_1) - 1.0 / 12.0).abs() < 1e-6);
        assert!((Transfer::Hlg.light(0.75) - 0.265).abs() < 5e-4);
        assert!((Transfer::Hlg.light(1.0) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn names_are_parsed_and_printed() {
        for transfer in ALL {
            assert_eq!(transfer.to_string().parse::<Transfer>().unwrap(), transfer);
        }
    }
}
