//! Full scale of arrays: the number that represents light of 1.0, and the recognition of codes that are passed as light.

use std::fmt::Display;

use crate::error::{Error, ErrorKind, Result, Setting};

/// If no full scale is given, float values above this limit may be integer codes.
pub const MAX_FLOAT_LIGHT: f32 = 32.0;

/// Returns `full_scale` if it is finite and positive.
///
/// # Examples
/// ```
/// use spikelane::light::full_scale::check_full_scale;
/// assert_eq!(check_full_scale(4095.0)?, 4095.0);
/// assert!(check_full_scale(0.0).is_err());
/// # Ok::<(), spikelane::Error>(())
/// ```
///
/// # Errors
/// [`ErrorKind::Usage`] for another number.
pub fn check_full_scale(full_scale: f64) -> Result<f64> {
    if full_scale.is_finite() && full_scale > 0.0 {
        return Ok(full_scale);
    }
    Err(Error::new(ErrorKind::Usage, Setting("full_scale"))
        .found(full_scale)
        .expected("a finite number above 0")
        .remedy("set it to the number that is full scale in the array, for example 255"))
}

/// Checks float values for which no full scale was given. `name` names the array or image. `place` follows the value in
/// the message, such as " in frame 3".
///
/// # Examples
/// ```
/// use spikelane::light::full_scale::check_float_light;
/// assert!(check_float_light(&[0.2, 0.5, 40.0], "a lamp", "").is_ok());
/// assert!(check_float_light(&[51.0, 128.0, 255.0], "codes", "").is_err());
/// ```
///
/// # Errors
/// [`ErrorKind::Input`] if the values are probably codes: one of them is above 32, and most values above 0 exceed 1.0.
/// Lamps and highlights may be brighter, because most light beside them is at most 1.0.
pub fn check_float_light(values: &[f32], name: impl Display, place: impl Display) -> Result<()> {
    let max_value = values.iter().copied().fold(0.0, f32::max);
    if max_value <= MAX_FLOAT_LIGHT || max_value.is_infinite() {
        return Ok(());
    }
    let count = |limit: f32| values.iter().filter(|&&v| v > limit).count();
    if 2 * count(1.0) <= count(0.0) {
        return Ok(());
    }
    Err(Error::new(ErrorKind::Input, name)
        .found(format_args!("the value {max_value}{place}"))
        .expected("light with full scale at 1.0")
        .remedy(format_args!(
            "set {0} to 255 if 255 is full scale, or set {0} to 1 if the light is this bright",
            Setting("full_scale")
        )))
}

/// Returns the number of bits and the code of white of samples that probably have fewer than 16 bits. `max` is the
/// largest sample of 16 bits.
///
/// # Examples
/// ```
/// assert_eq!(spikelane::light::full_scale::narrow_codes(4000), Some((12, 4095)));
/// ```
#[must_use]
pub fn narrow_codes(max: u16) -> Option<(u32, u32)> {
    match max {
        0 | 4096.. => None,
        1024.. => Some((12, 4095)),
        256.. => Some((10, 1023)),
        _ => Some((8, 255)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn floats_above_the_limit_are_codes() {
        for (value, is_light) in [(0.0, true), (1.0, true), (32.0, true), (32.1, false), (255.0, false)] {
            let values = [0.0, 0.0, 0.0, value, value / 2.0, 1.0];
            assert_eq!(check_float_light(&values, "a", "").is_ok(), is_light, "{value}");
        }
    }

    #[test]
    fn lamps_in_a_scene_are_light() {
        assert!(check_float_light(&[0.02, 0.3, 0.0, 4000.0, 0.9], "a", "").is_ok());
    }

    #[test]
    fn full_scale_is_finite_and_positive() {
        assert_eq!(check_full_scale(255.0).unwrap(), 255.0);
        for wrong in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert_eq!(check_full_scale(wrong).unwrap_err().kind(), ErrorKind::Usage, "{wrong}");
        }
    }
}
