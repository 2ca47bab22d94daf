//! Maps of the pixels as images with a color bar.

use std::fmt::Write as _;

use super::PageElement;
use super::plot::Axis;
use super::text::EscapedText;
use spikelane::error::{Error, ErrorKind, Result};

/// Colors of the map from the lowest to the highest value. They are perceptually uniform (viridis).
const COLORS: [[u8; 3]; 9] = [
    [68, 1, 84],
    [71, 44, 122],
    [59, 81, 139],
    [44, 113, 142],
    [33, 144, 141],
    [39, 173, 129],
    [92, 200, 99],
    [170, 220, 50],
    [253, 231, 37],
];

/// Color of pixels without a finite value.
const UNKNOWN: [u8; 3] = [220, 0, 60];

/// Largest size of the image in SVG units.
const MAX_SIZE: [f64; 2] = [410.0, 360.0];

/// Number of colored steps of the color bar.
const BAR_STEPS: usize = 48;

/// Returns the color of a value between 0 and 1.
fn color(share: f64) -> [u8; 3] {
    let at = share.clamp(0.0, 1.0) * (COLORS.len() - 1) as f64;
    let low = (at as usize).min(COLORS.len() - 2);
    let [a, b] = [COLORS[low], COLORS[low + 1]];
    let part = at - low as f64;
    std::array::from_fn(|i| (f64::from(a[i]) + part * (f64::from(b[i]) - f64::from(a[i]))).round() as u8)
}

/// Returns a map as a figure with a color bar. The colors span the 1st to the 99th percentile.
///
/// Pixels without a finite value are red. `unit` is the quantity and its unit, as the label of the color bar.
///
/// # Errors
/// If the image cannot be encoded.
pub fn heat_map(title: &str, map: &[f64], width: usize, unit: &str, caption: &str) -> Result<PageElement> {
    let mut sorted = crate::finite_values(map);
    sorted.sort_by(f64::total_cmp);
    let at = |share: f64| sorted.get((share * sorted.len() as f64) as usize).copied().unwrap_or(0.0);
    let axis = Axis::spanning(unit, &[at(0.01), at(0.99)]);
    let pixel = |v: &f64| if v.is_finite() { color(axis.share(*v)) } else { UNKNOWN };
    let pixels: Vec<u8> = map.iter().flat_map(pixel).collect();
    let height = map.len() / width.max(1);
    let mut png = std::io::Cursor::new(Vec::new());
    image::write_buffer_with_format(
        &mut png,
        &pixels,
        width as u32,
        height as u32,
        image::ExtendedColorType::Rgb8,
        image::ImageFormat::Png,
    )
    .map_err(|e| Error::new(ErrorKind::Config, "map").found(e))?;
    let zoom = (MAX_SIZE[0] / width.max(1) as f64).min(MAX_SIZE[1] / height.max(1) as f64);
    let [w, h] = [width, height].map(|n| n as f64 * zoom);
    // A shorter color bar is too short for its label.
    let bar = h.max(140.0);
    let mut svg = format!(
        "<svg class=\"map\" viewBox=\"0 0 {:.0} {:.0}\" preserveAspectRatio=\"xMinYMin meet\" role=\"img\" aria-label=\"{}\"><image width=\"{w:.1}\" height=\"{h:.1}\" style=\"image-rendering:pixelated\" preserveAspectRatio=\"none\" href=\"data:image/png;base64,{}\"/>",
        w + 110.0,
        bar + 16.0,
        EscapedText(title),
        base64(png.get_ref())
    );
    let (left, step) = (w + 34.0, bar / BAR_STEPS as f64);
    for i in 0..BAR_STEPS {
        let [r, g, b] = color(1.0 - (i as f64 + 0.5) / BAR_STEPS as f64);
        let y = 8.0 + step * i as f64;
        let _ = write!(
            svg,
            "<rect x=\"{left:.1}\" y=\"{y:.1}\" width=\"14\" height=\"{:.1}\" fill=\"#{r:02x}{g:02x}{b:02x}\"/>",
            step + 0.3
        );
    }
    let (ticks, factor) = axis.ticks(5);
    for (value, text) in ticks {
        let y = 8.0 + bar * (1.0 - axis.share(value));
        let _ = write!(svg, "<text x=\"{:.1}\" y=\"{:.1}\">{text}</text>", left + 19.0, y + 4.5);
    }
    let _ = write!(
        svg,
        "<text class=\"label\" transform=\"translate({:.1} {:.1}) rotate(-90)\" text-anchor=\"middle\">{}</text></svg>",
        left - 10.0,
        8.0 + bar / 2.0,
        EscapedText(axis.label_in(factor))
    );
    Ok(PageElement::figure(title, svg, caption))
}

/// Returns a PNG as an image element that is `width` pixels wide. `label` is the alternative text.
#[must_use]
pub fn png_image(png: &[u8], label: &str, width: usize) -> String {
    format!(
        "<img alt=\"{}\" width=\"{width}\" src=\"data:image/png;base64,{}\">",
        EscapedText(label),
        base64(png)
    )
}

/// Encodes bytes in base64 (RFC 4648) with padding.
fn base64(bytes: &[u8]) -> String {
    const ALPHABET: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for chunk in bytes.chunks(3) {
        let word = chunk.iter().enumerate().fold(0_u32, |w, (i, b)| w | u32::from(*b) << (16 - 8 * i));
        for i in 0..4 {
            let sextet = (word >> (18 - 6 * i)) as usize & 63;
            text.push(if i <= chunk.len() { ALPHABET[sextet] as char } else { '=' });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_has_the_vectors_of_its_standard() {
        for (text, coded) in [("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foobar", "Zm9vYmFy")] {
            assert_eq!(base64(text.as_bytes()), coded);
        }
    }

    #[test]
    fn brightness_grows_with_the_value() {
        let luminance = |share: f64| {
            let [r, g, b] = color(share).map(f64::from);
            0.2126 * r + 0.7152 * g + 0.0722 * b
        };
        assert!((1..=100).all(|i| luminance(f64::from(i) / 100.0) >= luminance(f64::from(i - 1) / 100.0)));
    }

    #[test]
    fn a_map_without_finite_values_has_a_finite_color_bar() {
        let html = heat_map("t", &[f64::NAN; 4], 2, "u", "").unwrap().to_string();
        assert!(!html.contains("NaN") && html.contains("<image"), "{html}");
    }
}
