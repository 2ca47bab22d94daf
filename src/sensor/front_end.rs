//! The conversion from the stored codes of an image to light, as a part of the camera model.

use super::Transfer;
use crate::error::{Result, bail, error};
use crate::light::transfer::EXACT_LUMINANCE_WEIGHTS;

/// The stored value that corresponds to light 1.0.
///
/// # Examples
/// ```
/// use spikelane::sensor::FullScale;
/// assert_eq!(FullScale::MAX_CODE, FullScale::Code(255.0));
/// assert_eq!(FullScale::Code(256.0).to_string(), "256");
/// assert_eq!(FullScale::Peak.to_string(), "peak");
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FullScale {
    /// Light 1.0 is this code of an 8-bit image. At any other bit depth the code is scaled: 255 means the largest code.
    Code(f64),
    /// Light 1.0 is the brightest pixel of each frame, after the frame is resized to the camera's size. A frame without
    /// light remains dark.
    Peak,
}

impl FullScale {
    /// Full scale at the largest code.
    pub const MAX_CODE: Self = Self::Code(255.0);

    /// Returns this full scale in the units of an input in which `white` is the value of an 8-bit code 255.
    ///
    /// # Examples
    /// ```
    /// use spikelane::sensor::FullScale;
    /// assert_eq!(FullScale::MAX_CODE.in_units_of(65535.0), FullScale::Code(65535.0));
    /// assert_eq!(FullScale::Code(51.0).in_units_of(65535.0), FullScale::Code(13107.0));
    /// assert_eq!(FullScale::Peak.in_units_of(65535.0), FullScale::Peak);
    /// ```
    #[must_use]
    pub fn in_units_of(self, white: f64) -> Self {
        match self {
            Self::MAX_CODE => Self::Code(white),
            Self::Code(code) => Self::Code(white * code / 255.0),
            Self::Peak => Self::Peak,
        }
    }
}

impl std::fmt::Display for FullScale {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Code(code) => write!(f, "{code}"),
            Self::Peak => f.write_str("peak"),
        }
    }
}

/// The conversion from stored codes to light, which a camera file describes in its `[light]` table.
///
/// The default is for a real camera, whose pixels respond to light and not to codes. Each file is converted by the
/// convention of its file type, and colors are summed as linear light.
///
/// # Examples
/// ```
/// use spikelane::light::Transfer;
/// use spikelane::sensor::{FrontEnd, FullScale};
/// let transfer = Some(Transfer::Gamma(2.2));
/// let front_end = FrontEnd { transfer, full_scale: FullScale::Peak, ..FrontEnd::default() };
/// assert!(front_end.to_string().starts_with("exponent 2.2 inverted, luminance 0.2126 0.7152 0.0722"));
///
/// let mut camera = spikelane::Camera::ideal(spikelane::Sensor::new(64, 48, 20_000.0)?);
/// camera.front_end = front_end;
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrontEnd {
    /// Tone curve of integer codes. `None` selects the curve of the file type: sRGB for images and video, linear for arrays.
    ///
    /// Floats are always linear light.
    pub transfer: Option<Transfer>,
    /// Weights of red, green and blue, which sum to 1.
    pub luminance: [f64; 3],
    /// Whether a color image is first converted to a gray code, rounded to an integer of the image's bit depth. The
    /// tone curve is then inverted for the gray code.
    ///
    /// If this field is `false`, the tone curve of each color is inverted, and the linear colors are summed.
    pub gray_codes: bool,
    /// The definition of light 1.0.
    pub full_scale: FullScale,
}

impl Default for FrontEnd {
    fn default() -> Self {
        Self {
            transfer: None,
            luminance: EXACT_LUMINANCE_WEIGHTS,
            gray_codes: false,
            full_scale: FullScale::MAX_CODE,
        }
    }
}

impl FrontEnd {
    /// Returns this front end if its values are valid.
    ///
    /// # Examples
    /// ```
    /// use spikelane::sensor::FrontEnd;
    /// let equal_weights = FrontEnd { luminance: [1.0 / 3.0; 3], ..FrontEnd::default() };
    /// assert_eq!(equal_weights.validate()?, equal_weights);
    ///
    /// let too_bright = FrontEnd { luminance: [1.0; 3], ..FrontEnd::default() };
    /// assert_eq!(too_bright.validate().unwrap_err().kind(), spikelane::ErrorKind::Config);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns [`ErrorKind::Config`](crate::ErrorKind::Config) if a weight is negative, if the weights do not sum to 1 within 0.001, or if full scale is
    /// outside 1 to 65535.
    pub fn validate(self) -> Result<Self> {
        let sum: f64 = self.luminance.iter().sum();
        let is_normalized = (0.999..=1.001).contains(&sum);
        if !is_normalized || self.luminance.iter().any(|w| *w < 0.0) {
            bail!(Config, "luminance"; found "{}", self.luminance.map(|w| w.to_string()).join(", ");
                expected "weights of red, green and blue that are not negative and sum to 1");
        }
        match self.full_scale {
            FullScale::Code(code) if !(1.0..=65535.0).contains(&code) => {
                Err(error!(Config, "full_scale"; found "{code}";
                    expected "an 8-bit code from 1 to 65535, such as 255, or \"peak\""))
            }
            _ => Ok(self),
        }
    }
}

/// Formats a front end as a description of the conversion that was applied to an input.
impl std::fmt::Display for FrontEnd {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.transfer {
            Some(Transfer::Linear) => f.write_str("linear codes")?,
            Some(Transfer::Srgb) => f.write_str("sRGB curve inverted")?,
            Some(Transfer::Pq) => f.write_str("PQ curve inverted")?,
            Some(Transfer::Hlg) => f.write_str("HLG curve inverted")?,
            Some(Transfer::Gamma(g)) => write!(f, "exponent {g} inverted")?,
            None => f.write_str("curve of the file type")?,
        }
        let [r, g, b] = self.luminance;
        let conversion = if self.gray_codes { "gray codes" } else { "luminance" };
        write!(f, ", {conversion} {r:.4} {g:.4} {b:.4}")?;
        match self.full_scale {
            FullScale::Code(code) => write!(f, ", full scale {code}"),
            FullScale::Peak => f.write_str(", full scale at each frame's brightest pixel"),
        }
    }
}
