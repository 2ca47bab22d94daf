//! How a camera model takes the stored codes of pictures as light.

use super::Transfer;
use crate::error::{Error, Kind, Result};

/// What counts as light 1.0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FullScale {
    /// This code of an 8-bit picture, 255 for all codes of any depth used up.
    Code(f64),
    /// The brightest pixel of each frame at the camera's size. A frame without light stays dark.
    Peak,
}

impl FullScale {
    /// All codes used up.
    pub const WHOLE: Self = Self::Code(255.0);
}

impl std::fmt::Display for FullScale {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Code(code) => write!(f, "{code}"),
            Self::Peak => f.write_str("peak"),
        }
    }
}

/// How stored codes become light; the `[light]` table of a camera file.
///
/// The default is a real camera's: nothing is known of codes, so each kind of file is
/// read in its own way, and colours are added up as linear light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrontEnd {
    /// Curve of integer codes; `None` for the one of the kind of file (sRGB in images and video, linear in
    /// arrays). Floats are linear light whatever stands here.
    pub transfer: Option<Transfer>,
    /// Weights of red, green and blue; they add up to 1.
    pub luminance: [f64; 3],
    /// Whether colour becomes a grey code, rounded to a whole code of the picture's depth, before the curve.
    /// Otherwise linear colours are added up.
    pub grey_codes: bool,
    /// What integer codes count as light 1.0.
    pub full_scale: FullScale,
}

impl Default for FrontEnd {
    fn default() -> Self {
        Self {
            transfer: None,
            luminance: [0.2126, 0.7152, 0.0722],
            grey_codes: false,
            full_scale: FullScale::WHOLE,
        }
    }
}

impl FrontEnd {
    /// This front end, if its numbers can describe one.
    ///
    /// # Errors
    /// [`Kind::Config`] for weights that are negative or do not add up to 1 within 0.001, and for a full scale
    /// outside 1 to 65535.
    pub fn validated(self) -> Result<Self> {
        let sum: f64 = self.luminance.iter().sum();
        let whole = (0.999..=1.001).contains(&sum);
        if !whole || self.luminance.iter().any(|w| *w < 0.0) {
            return Err(Error::new(Kind::Config, "luminance")
                .found(self.luminance.map(|w| w.to_string()).join(", "))
                .expected("weights of red, green and blue, zero or more, that add up to 1"));
        }
        match self.full_scale {
            FullScale::Code(code) if !(1.0..=65535.0).contains(&code) => {
                Err(Error::new(Kind::Config, "full_scale")
                    .found(code)
                    .expected("an 8-bit code from 1 to 65535, such as 255, or \"peak\""))
            }
            _ => Ok(self),
        }
    }
}

/// A front end with nothing left to the kind of file: how an input was in fact read.
impl std::fmt::Display for FrontEnd {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.transfer {
            Some(Transfer::Linear) => f.write_str("codes taken as light (linear)")?,
            Some(Transfer::Srgb) => f.write_str("sRGB curve undone")?,
            Some(Transfer::Gamma(g)) => write!(f, "exponent {g} undone")?,
            None => f.write_str("curve by the kind of file")?,
        }
        let [r, g, b] = self.luminance;
        let how = if self.grey_codes { "grey codes" } else { "luminance" };
        write!(f, ", {how} {r:.4} {g:.4} {b:.4}")?;
        match self.full_scale {
            FullScale::Code(code) => write!(f, ", full scale {code}"),
            FullScale::Peak => f.write_str(", full scale at each frame's brightest pixel"),
        }
    }
}
