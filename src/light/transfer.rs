//! From stored codes to linear light, and from colour to luminance.
//!
//! Cameras and files store a picture through a curve that spends more codes on
//! the dark. A sensor collects photons, so the curve is undone first and colours
//! are added up afterwards; the other way round a saturated blue would come out
//! more than twice too bright.

use std::str::FromStr;
use std::sync::OnceLock;

use crate::error::{Error, Kind, Result};

/// Luminance weights of linear red, green and blue: ITU-R BT.709-6, item 3.2
/// (the primaries of sRGB).
pub const LUMINANCE: [f32; 3] = [0.2126, 0.7152, 0.0722];

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

/// A transfer function with its tables; the large one is made when first asked for.
#[derive(Debug)]
pub struct Curve {
    transfer: Transfer,
    table8: [u16; 256],
    table16: OnceLock<Vec<f32>>,
}

impl Curve {
    /// The tables of `transfer`.
    #[must_use]
    pub fn new(transfer: Transfer) -> Self {
        Self { transfer, table8: transfer.table8(), table16: OnceLock::new() }
    }

    /// The function itself.
    #[must_use]
    pub const fn transfer(&self) -> Transfer {
        self.transfer
    }

    /// See [`Transfer::table8`].
    #[must_use]
    pub const fn table8(&self) -> &[u16; 256] {
        &self.table8
    }

    /// See [`Transfer::table16`].
    #[must_use]
    pub fn table16(&self) -> &[f32] {
        self.table16.get_or_init(|| self.transfer.table16())
    }
}

/// The sRGB code in 0 to 1 of light in 0 to 1 (IEC 61966-2-1); light outside is cut.
///
/// The inverse of [`Transfer::Srgb`].
#[must_use]
pub fn srgb_code(light: f32) -> f32 {
    let x = light.clamp(0.0, 1.0);
    if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * libm::powf(x, 1.0 / 2.4) - 0.055 }
}

/// Luminance of linear red, green and blue.
#[must_use]
pub fn luminance(rgb: [f32; 3]) -> f32 {
    LUMINANCE[0] * rgb[0] + LUMINANCE[1] * rgb[1] + LUMINANCE[2] * rgb[2]
}
