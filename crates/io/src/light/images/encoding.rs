//! What a file states about the codes of its pixels.

use moxcms::{ColorProfile, ToneReprCurve};
use spikelane::error::Setting;
use spikelane::light::Transfer;

use crate::light::full_scale::narrow_codes;

/// The codes of the pixels of a file, as the file states them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(in crate::light) struct Encoding {
    /// The transfer function of integer codes.
    pub transfer: Option<Transfer>,
    /// The largest code of the sample type, or `None` for floats.
    pub largest_code: Option<f64>,
    /// The code of white, if the file states another code than the largest code.
    pub white_code: Option<f64>,
    /// The number of significant bits of 16-bit samples in a PNG.
    pub significant_bits: Option<u8>,
}

/// A transfer function of a file, or the reason why it is not used.
pub(in crate::light) type StatedTransfer = std::result::Result<Option<Transfer>, String>;

/// Returns the transfer function of a code of ITU-T H.273, table 3.
///
/// Video and pictures for displays are decoded with the sRGB curve, which is the curve of a display. The camera curves
/// of BT.709, BT.601 and BT.2020 (codes 1, 6, 14 and 15) are therefore read as sRGB.
pub(in crate::light) fn transfer_from_h273(code: u8) -> StatedTransfer {
    match code {
        0 | 2 | 3 => Ok(None),
        1 | 6 | 13 | 14 | 15 => Ok(Some(Transfer::Srgb)),
        4 => Ok(Some(Transfer::Gamma(2.2))),
        5 => Ok(Some(Transfer::Gamma(2.8))),
        8 => Ok(Some(Transfer::Linear)),
        16 => Ok(Some(Transfer::Pq)),
        18 => Ok(Some(Transfer::Hlg)),
        other => Err(format!("the transfer characteristics {other} of ITU-T H.273")),
    }
}

/// Returns the transfer function of an encoding exponent in units of 1/100000, as in the chunk gAMA of PNG.
///
/// The exponent 1/2.2 stands for sRGB in most files, so browsers and libpng read it as sRGB.
pub(super) fn transfer_from_gamma(scaled: u32) -> StatedTransfer {
    let exponent = (1e8 / f64::from(scaled)).round() / 1e3;
    match scaled {
        45_000..=46_000 => Ok(Some(Transfer::Srgb)),
        99_000..=101_000 => Ok(Some(Transfer::Linear)),
        _ if (0.1..=10.0).contains(&exponent) => Ok(Some(Transfer::Gamma(exponent))),
        _ => Err(format!("the exponent {scaled}/100000")),
    }
}

/// Returns the transfer function of an ICC profile.
pub(super) fn transfer_from_icc(profile: &[u8]) -> StatedTransfer {
    let Ok(profile) = ColorProfile::new_from_slice(profile) else {
        return Err("a color profile that cannot be read".to_owned());
    };
    if let Some(code) = profile.cicp.map(|c| c.transfer_characteristics as u8) {
        return transfer_from_h273(code);
    }
    let curve = profile.gray_trc.as_ref().or(profile.green_trc.as_ref());
    curve
        .and_then(known_curve)
        .map_or_else(|| Err("the tone curve of a color profile".to_owned()), |t| Ok(Some(t)))
}

/// Returns the transfer function that equals a curve of a profile within half an 8-bit code.
fn known_curve(curve: &ToneReprCurve) -> Option<Transfer> {
    let samples = |curve: &ToneReprCurve| -> Option<Vec<f64>> {
        let codes = (0..=64).map(|i| f64::from(i) / 64.0);
        match curve {
            ToneReprCurve::Lut(v) if v.is_empty() => Some(codes.collect()),
            ToneReprCurve::Lut(v) if v.len() == 1 => {
                Some(codes.map(|x| Transfer::Gamma(f64::from(v[0]) / 256.0).light(x)).collect())
            }
            ToneReprCurve::Lut(v) => Some(codes.map(|x| look_up(v, x)).collect()),
            ToneReprCurve::Parametric(p) => {
                let p: Vec<f64> = p.iter().map(|&x| f64::from(x)).collect();
                codes.map(|x| parametric(&p, x)).collect()
            }
        }
    };
    let light = samples(curve)?;
    let is = |transfer: &Transfer| {
        light.iter().enumerate().all(|(i, y)| (y - transfer.light(i as f64 / 64.0)).abs() < 0.5 / 255.0)
    };
    let exponent = light[32].ln() / 0.5_f64.ln();
    let gamma = Transfer::Gamma((exponent * 1e3).round() / 1e3);
    let gamma = (0.1..=10.0).contains(&exponent).then_some(gamma);
    [Some(Transfer::Linear), Some(Transfer::Srgb), gamma, Some(Transfer::Pq), Some(Transfer::Hlg)]
        .into_iter()
        .flatten()
        .find(is)
}

/// Returns the linearly interpolated entry of a table of 16-bit values. The code `x` is 0 to 1.
fn look_up(table: &[u16], x: f64) -> f64 {
    let at = x * (table.len() - 1) as f64;
    let (low, part) = (at.floor() as usize, at.fract());
    let entry = |i: usize| f64::from(table[i.min(table.len() - 1)]) / 65535.0;
    entry(low) + part * (entry(low + 1) - entry(low))
}

/// Returns the value of a parametric curve (ICC.1:2022, table 68). The number of parameters determines the function.
fn parametric(p: &[f64], x: f64) -> Option<f64> {
    let power = |base: f64| libm::pow(base.max(0.0), p[0]);
    Some(match *p {
        [_] => power(x),
        [_, a, b] => {
            if x >= -b / a {
                power(a * x + b)
            } else {
                0.0
            }
        }
        [_, a, b, c] => {
            if x >= -b / a {
                power(a * x + b) + c
            } else {
                c
            }
        }
        [_, a, b, c, d] => {
            if x >= d {
                power(a * x + b)
            } else {
                c * x
            }
        }
        [_, a, b, c, d, e, f] => {
            if x >= d {
                power(a * x + b) + e
            } else {
                c * x + f
            }
        }
        _ => return None,
    })
}

/// Stores the transfer function in `encoding`, or adds a note that names a transfer function that is not used.
pub(in crate::light) fn store_transfer(
    encoding: &mut Encoding,
    notes: &mut Vec<String>,
    stated: StatedTransfer,
) {
    match stated {
        Ok(transfer) => encoding.transfer = transfer,
        Err(name) => notes.push(format!(
            "the file states {name}, which is not supported and not used; to choose a curve, set {}",
            Setting("transfer")
        )),
    }
}

/// Statistics of the 16-bit codes of pages.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::light) struct CodeScan {
    max: u16,
    /// The bits that are set in at least one code.
    bits: u16,
}

impl CodeScan {
    /// Adds codes.
    pub(in crate::light) fn add(&mut self, codes: impl Iterator<Item = u16>) {
        for code in codes {
            self.max = self.max.max(code);
            self.bits |= code;
        }
    }

    /// Uses the codes to find samples of fewer than 16 bits. If the file states the number of bits, the code of white is
    /// set in `encoding`. Otherwise the function returns a note. `pages` describes the pages of the codes.
    ///
    /// PNG scales samples with fewer bits to 16 bits and states their number of bits in the chunk sBIT. If a code has
    /// lower bits than scaled samples can have, the samples are not scaled.
    pub(in crate::light) fn apply(self, encoding: &mut Encoding, pages: &str) -> Option<String> {
        if let Some(bits) = encoding.significant_bits {
            let white = (1_u32 << bits) - 1;
            let has_lower_bits = self.bits.trailing_zeros() < u32::from(16 - bits);
            if u32::from(self.max) <= white && has_lower_bits {
                encoding.white_code = Some(f64::from(white));
            }
            return None;
        }
        let (bits, white) = narrow_codes(self.max)?;
        Some(format!(
            "no code {pages} exceeds {} of 65535: if the codes have {bits} bits, they are read {} times too small and the light is too dark; to correct it, set {} to {white}",
            self.max,
            65535 / white,
            Setting("full_scale")
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tone_curves_of_profiles_are_recognized() {
        let srgb: Vec<u16> = (0..1024)
            .map(|i| (Transfer::Srgb.light(f64::from(i) / 1023.0) * 65535.0).round() as u16)
            .collect();
        let curves = [
            (ToneReprCurve::Lut(vec![]), Some(Transfer::Linear)),
            (ToneReprCurve::Lut(vec![256]), Some(Transfer::Linear)),
            (ToneReprCurve::Lut(vec![563]), Some(Transfer::Gamma(2.199))),
            (ToneReprCurve::Lut(srgb), Some(Transfer::Srgb)),
            (ToneReprCurve::Lut(vec![0, 65535]), Some(Transfer::Linear)),
            (ToneReprCurve::Parametric(vec![1.8]), Some(Transfer::Gamma(1.8))),
            (
                ToneReprCurve::Parametric(vec![2.4, 1.0 / 1.055, 0.055 / 1.055, 1.0 / 12.92, 0.04045]),
                Some(Transfer::Srgb),
            ),
            (ToneReprCurve::Lut(vec![0, 60000, 65535]), None),
        ];
        for (curve, wanted) in curves {
            assert_eq!(known_curve(&curve), wanted, "{curve:?}");
        }
    }

    #[test]
    fn exponents_of_png_are_inverted() {
        for (scaled, wanted) in [
            (45_455, Transfer::Srgb),
            (100_000, Transfer::Linear),
            (55_556, Transfer::Gamma(1.8)),
            (50_000, Transfer::Gamma(2.0)),
        ] {
            assert_eq!(transfer_from_gamma(scaled), Ok(Some(wanted)));
        }
        assert!(transfer_from_gamma(0).is_err());
    }

    #[test]
    fn scaled_samples_of_a_dark_png_are_not_taken_as_unscaled_samples() {
        let scan = |codes: &[u16]| {
            let mut encoding = Encoding { significant_bits: Some(12), ..Encoding::default() };
            let mut scan = CodeScan::default();
            scan.add(codes.iter().copied());
            assert_eq!(scan.apply(&mut encoding, ""), None);
            encoding.white_code
        };
        assert_eq!(scan(&[16, 2048, 4080]), None);
        assert_eq!(scan(&[1, 2048, 4095]), Some(4095.0));
        assert_eq!(scan(&[1, 2048, 4096]), None);
    }
}
