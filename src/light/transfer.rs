//! Conversion from stored codes to linear light, and from color to luminance.
//!
//! Cameras and files store an image through a tone curve that assigns more codes to dark light. A sensor collects
//! photons, so the tone curve is inverted before the colors are summed. In the opposite order, a saturated blue would be
//! more than twice too bright.

use std::sync::OnceLock;

pub use crate::sensor::Transfer;

/// Luminance weights of linear red, green and blue: ITU-R BT.709-6, item 3.2
/// (the primaries of sRGB).
pub const LUMINANCE_WEIGHTS: [f32; 3] =
    [EXACT_LUMINANCE_WEIGHTS[0] as f32, EXACT_LUMINANCE_WEIGHTS[1] as f32, EXACT_LUMINANCE_WEIGHTS[2] as f32];

/// [`LUMINANCE_WEIGHTS`] in double precision.
pub(crate) const EXACT_LUMINANCE_WEIGHTS: [f64; 3] = [0.2126, 0.7152, 0.0722];

/// A transfer function with its lookup tables. The 16-bit table is computed when it is first used.
///
/// # Examples
/// ```
/// use spikelane::light::{ToneCurve, Transfer};
/// let curve = ToneCurve::new(Transfer::Gamma(2.0));
/// // Code 51 is a fifth of full scale and has a 25th of the light: 65535 / 25, rounded.
/// assert_eq!(curve.table8()[51], 2621);
/// assert_eq!(curve.table16()[65535], 1.0);
/// ```
#[derive(Debug)]
pub struct ToneCurve {
    transfer: Transfer,
    table8: [u16; 256],
    table16: OnceLock<Vec<f32>>,
}

impl ToneCurve {
    /// Returns the tone curve of `transfer`.
    ///
    /// # Examples
    /// ```
    /// use spikelane::light::{ToneCurve, Transfer};
    /// let curve = ToneCurve::new(Transfer::Linear);
    /// assert_eq!(curve.transfer(), Transfer::Linear);
    /// assert!(curve.table8().iter().enumerate().all(|(code, light)| usize::from(*light) == 257 * code));
    /// ```
    #[must_use]
    pub fn new(transfer: Transfer) -> Self {
        Self { transfer, table8: transfer.table8(), table16: OnceLock::new() }
    }

    /// Returns the transfer function.
    #[must_use]
    pub const fn transfer(&self) -> Transfer {
        self.transfer
    }

    /// Returns the table of 8-bit codes, see [`Transfer::table8`].
    #[must_use]
    pub const fn table8(&self) -> &[u16; 256] {
        &self.table8
    }

    /// Returns the table of 16-bit codes, see [`Transfer::table16`].
    #[must_use]
    pub fn table16(&self) -> &[f32] {
        self.table16.get_or_init(|| self.transfer.table16())
    }
}

/// Returns the sRGB code of `light` (IEC 61966-2-1). Code and light are 0 to 1, and other light is clamped.
///
/// This function is the inverse of [`Transfer::Srgb`].
///
/// # Examples
/// ```
/// use spikelane::light::{Transfer, srgb_code};
/// // A fifth of the light needs almost half of the codes.
/// let code = srgb_code(0.2);
/// assert_eq!((code * 255.0).round(), 124.0);
/// assert!((Transfer::Srgb.light(code.into()) - 0.2).abs() < 1e-6);
/// ```
#[must_use]
pub fn srgb_code(light: f32) -> f32 {
    let x = light.clamp(0.0, 1.0);
    if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * libm::powf(x, 1.0 / 2.4) - 0.055 }
}

/// Returns the luminance of linear red, green and blue.
///
/// # Examples
/// ```
/// use spikelane::light::{LUMINANCE_WEIGHTS, luminance};
/// assert_eq!(luminance([0.0, 1.0, 0.0]), LUMINANCE_WEIGHTS[1]);
/// assert!((luminance([0.5; 3]) - 0.5).abs() < 1e-6);
/// ```
#[must_use]
pub fn luminance(rgb: [f32; 3]) -> f32 {
    LUMINANCE_WEIGHTS[0] * rgb[0] + LUMINANCE_WEIGHTS[1] * rgb[1] + LUMINANCE_WEIGHTS[2] * rgb[2]
}

/// Returns [`srgb_code`] as a byte, where 255 is white.
///
/// The function reads a table, which is faster than the formula of [`srgb_code`] and gives the same byte.
pub fn srgb_byte(light: f32) -> u8 {
    let table = SRGB_BYTE_TABLE.get_or_init(SrgbByteTable::new);
    // The cast saturates and converts NaN to 0.
    let mut code = table.starts[((light * SEARCH_STEPS as f32) as usize).min(SEARCH_STEPS)];
    while light >= table.min_light[usize::from(code) + 1] {
        code += 1;
    }
    code
}

/// Number of steps into which [`SrgbByteTable`] divides the light. For each step, the table contains the code at which
/// the search for the code of a value starts.
const SEARCH_STEPS: usize = 4096;

static SRGB_BYTE_TABLE: std::sync::OnceLock<SrgbByteTable> = std::sync::OnceLock::new();

/// The smallest light of every code, and the code at the start of every step of light.
struct SrgbByteTable {
    min_light: [f32; 257],
    starts: Vec<u8>,
}

impl SrgbByteTable {
    fn new() -> Self {
        let byte = |light: f32| (srgb_code(light) * 255.0 + 0.5) as u8;
        // The entry after code 255 remains NaN. A comparison with NaN is false, so the search ends at code 255.
        let mut from = [f32::NAN; 257];
        from[0] = 0.0;
        for code in 1..=255u8 {
            // The bit patterns of positive floats increase with their values, so a binary search in the bit patterns
            // finds the smallest light.
            let (mut below, mut above) = (0u32, 1f32.to_bits());
            while above - below > 1 {
                let middle = below.midpoint(above);
                if byte(f32::from_bits(middle)) >= code { above = middle } else { below = middle }
            }
            from[usize::from(code)] = f32::from_bits(above);
        }
        Self {
            min_light: from,
            starts: (0..=SEARCH_STEPS).map(|i| byte(i as f32 / SEARCH_STEPS as f32)).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{srgb_byte, srgb_code};

    #[test]
    fn bytes_are_the_curve_rounded() {
        let step = |i: u32| i as f32 / 1_000_003.0;
        for x in (0..1_100_000).map(step).chain([-1.0, f32::NAN, f32::INFINITY, 1e-30]) {
            assert_eq!(srgb_byte(x), (srgb_code(x) * 255.0 + 0.5) as u8, "{x}");
        }
    }
}
