//! Maps as PNG images embedded in the page.

use super::plot::plot_error;
use spikelane::error::Result;

/// Returns a map as an HTML image element in shades of gray. Black is the 1st percentile and white is the 99th.
///
/// Pixels without a finite value are red. `label` is the alternative text.
///
/// # Errors
/// If the image cannot be encoded.
pub fn heat_map(map: &[f64], width: usize, label: &str) -> Result<String> {
    let mut sorted = crate::finite_values(map);
    sorted.sort_by(f64::total_cmp);
    let at = |share: f64| sorted.get((share * sorted.len() as f64) as usize).copied().unwrap_or(0.0);
    let (low, high) = (at(0.01), at(0.99));
    let scale = 255.0 / (high - low).max(f64::MIN_POSITIVE);
    let color = |v: &f64| {
        let gray = ((v - low) * scale).clamp(0.0, 255.0) as u8;
        if v.is_finite() { [gray; 3] } else { [200, 0, 0] }
    };
    let pixels: Vec<u8> = map.iter().flat_map(color).collect();
    let mut png = std::io::Cursor::new(Vec::new());
    let height = map.len() / width;
    image::write_buffer_with_format(
        &mut png,
        &pixels,
        width as u32,
        height as u32,
        image::ExtendedColorType::Rgb8,
        image::ImageFormat::Png,
    )
    .map_err(plot_error)?;
    Ok(png_image(png.get_ref(), label, (2 * width).clamp(200, 800)))
}

/// Returns a PNG as an image element that is `width` pixels wide. `label` is the alternative text.
#[must_use]
pub fn png_image(png: &[u8], label: &str, width: usize) -> String {
    let label = label.replace(['<', '>', '"', '&'], " ");
    format!(
        "<img alt=\"{label}\" width=\"{width}\" style=\"image-rendering: pixelated\" src=\"data:image/png;base64,{}\">",
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
    #[test]
    fn base64_has_the_vectors_of_its_standard() {
        for (text, coded) in [("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foobar", "Zm9vYmFy")] {
            assert_eq!(super::base64(text.as_bytes()), coded);
        }
    }
}
