//! Recognizes images in other units than linear light of 0 to 1.

use spikelane::sensor::Transfer;
use spikelane::unstable::Count;
use spikelane_io::light::full_scale::check_float_light;

/// Ratio of the squared errors above which an image is in sRGB codes: 6 dB.
///
/// Images that are too bright for another reason reach this ratio only if their error follows the curve of sRGB.
const MIN_ERROR_RATIO: f64 = 4.0;

/// The unit of an image that is not linear light of 0 to 1.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum OtherUnit {
    /// Most values are above white. The text names the largest value.
    AboveWhite(String),
    /// The image fits the reference much better if its values are decoded as sRGB codes.
    Srgb,
}

/// Returns the unit of an image if the unit is not linear light of 0 to 1. `reference` is linear light.
pub(super) fn other_unit(values: &[f32], reference: &[f32]) -> Option<OtherUnit> {
    if let Err(error) = check_float_light(values, "output", "") {
        return Some(OtherUnit::AboveWhite(error.parts().found.into_owned()));
    }
    let squared_error = |decode: &dyn Fn(f64) -> f64| -> f64 {
        let error = |(v, r): (&f32, &f32)| (decode(f64::from(v.clamp(0.0, 1.0))) - f64::from(*r)).powi(2);
        values.iter().zip(reference).map(error).sum()
    };
    let as_light = squared_error(&|v| v);
    let as_codes = squared_error(&|v| Transfer::Srgb.light(v));
    (as_light > MIN_ERROR_RATIO * as_codes).then_some(OtherUnit::Srgb)
}

/// Returns one note for each unit. `images` are the units of the images, and each image's name.
///
/// A single image can fit better as codes by chance, so more than half of the images must be in sRGB codes.
pub(super) fn unit_notes<'a>(images: impl Iterator<Item = (String, Option<&'a OtherUnit>)>) -> Vec<String> {
    let (mut count, mut srgb, mut above) = (0_u64, 0_u64, Vec::new());
    for (name, unit) in images {
        count += 1;
        match unit {
            Some(OtherUnit::AboveWhite(found)) => above.push(format!("{found} in {name}")),
            Some(OtherUnit::Srgb) => srgb += 1,
            None => {}
        }
    }
    let mut notes = Vec::new();
    if let Some(first) = above.first() {
        notes.push(format!(
            "{} of {}: found {first}, expected light with full scale at 1.0; values above 1 are clipped, so divide the outputs by their value of white",
            above.len(),
            Count(count, "output"),
        ));
    }
    if 2 * srgb > count {
        notes.push(format!(
            "{srgb} of {} fit the references much better as sRGB codes than as linear light; convert the outputs to linear light",
            Count(count, "output"),
        ));
    }
    notes
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene() -> Vec<f32> {
        (0..64).map(|p| 0.05 + 0.9 * (p as f32 / 64.0).powi(2)).collect()
    }

    #[test]
    fn codes_of_255_are_above_white() {
        let codes: Vec<f32> = scene().iter().map(|v| 255.0 * v).collect();
        let unit = other_unit(&codes, &scene());
        assert!(matches!(&unit, Some(OtherUnit::AboveWhite(text)) if text.contains("235.")), "{unit:?}");
    }

    #[test]
    fn srgb_codes_are_recognized() {
        let codes: Vec<f32> = scene().iter().map(|v| Transfer::Srgb.code(f64::from(*v)) as f32).collect();
        assert_eq!(other_unit(&codes, &scene()), Some(OtherUnit::Srgb));
    }

    #[test]
    fn poor_linear_images_are_linear() {
        for (gain, offset) in [(1.0, 0.0), (0.5, 0.0), (1.3, 0.0), (1.0, 0.1), (0.0, 0.5)] {
            let image: Vec<f32> = scene().iter().map(|v| gain * v + offset).collect();
            assert_eq!(other_unit(&image, &scene()), None, "{gain} {offset}");
        }
    }

    #[test]
    fn a_note_needs_one_image_above_white_or_most_images_in_codes() {
        let above = OtherUnit::AboveWhite("the value 254.9".to_owned());
        let notes = |units: &[Option<&OtherUnit>]| {
            unit_notes(units.iter().enumerate().map(|(i, unit)| (format!("test/{i}"), *unit)))
        };
        assert!(notes(&[None, Some(&OtherUnit::Srgb)]).is_empty());
        assert!(notes(&[Some(&OtherUnit::Srgb)])[0].starts_with("1 of 1 output fit"));
        let found = notes(&[None, Some(&above)]);
        assert!(found[0].starts_with("1 of 2 outputs: found the value 254.9 in test/1"), "{found:?}");
    }
}
