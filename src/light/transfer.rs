//! From stored codes to linear light, and from colour to luminance.
//!
//! Cameras and files store a picture through a curve that spends more codes on
//! the dark. A sensor collects photons, so the curve is undone first and colours
//! are added up afterwards; the other way round a saturated blue would come out
//! more than twice too bright.

use std::sync::OnceLock;

pub use crate::sensor::Transfer;

/// Luminance weights of linear red, green and blue: ITU-R BT.709-6, item 3.2
/// (the primaries of sRGB).
pub const LUMINANCE: [f32; 3] = [0.2126, 0.7152, 0.0722];

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

/// [`srgb_code`] as a byte, 255 for white: the same as computing it, at a fraction of the cost.
pub fn srgb_byte(light: f32) -> u8 {
    let table = BYTES.get_or_init(Bytes::new);
    // A float becomes the nearest integer that there is, and what is no number 0.
    let mut code = table.starts[((light * STEPS as f32) as usize).min(STEPS)];
    while light >= table.from[usize::from(code) + 1] {
        code += 1;
    }
    code
}

/// Steps of light from which the search for a code starts.
const STEPS: usize = 4096;

static BYTES: std::sync::OnceLock<Bytes> = std::sync::OnceLock::new();

/// The least light of every code, and the code of every step of light.
struct Bytes {
    from: [f32; 257],
    starts: Vec<u8>,
}

impl Bytes {
    fn new() -> Self {
        let byte = |light: f32| (srgb_code(light) * 255.0 + 0.5) as u8;
        // Nothing reaches what is no number: behind the last code there is none.
        let mut from = [f32::NAN; 257];
        from[0] = 0.0;
        for code in 1..=255u8 {
            // Bits of positive floats rise with them.
            let (mut below, mut least) = (0u32, 1f32.to_bits());
            while least - below > 1 {
                let middle = below.midpoint(least);
                if byte(f32::from_bits(middle)) >= code { least = middle } else { below = middle }
            }
            from[usize::from(code)] = f32::from_bits(least);
        }
        Self { from, starts: (0..=STEPS).map(|i| byte(i as f32 / STEPS as f32)).collect() }
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
