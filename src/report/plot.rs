//! Plots as SVG, maps as PNG inside the page.

use plotters::prelude::*;

use crate::error::{Error, Kind, Result};

/// A named line.
#[derive(Clone, Debug)]
pub struct Curve<'a> {
    /// Name in the legend.
    pub name: &'a str,
    /// Points, by rising x.
    pub points: Vec<(f64, f64)>,
}

const SIZE: (u32, u32) = (800, 420);
const COLOURS: [RGBColor; 8] = [
    RGBColor(0, 0, 0),
    RGBColor(213, 94, 0),
    RGBColor(0, 114, 178),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(120, 120, 120),
];

fn failed(e: impl std::fmt::Display) -> Error {
    Error::new(Kind::Config, "plot").found(e)
}

/// Range of finite values, widened where it is empty.
fn range(values: impl Iterator<Item = f64>) -> std::ops::Range<f64> {
    let finite = values.filter(|v| v.is_finite());
    let (low, high) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    match (low.is_finite(), high > low) {
        (true, true) => low..high + 0.02 * (high - low),
        (true, false) => low - 0.5..high + 0.5,
        _ => 0.0..1.0,
    }
}

/// Lines over common axes.
///
/// # Errors
/// When the plot cannot be laid out.
pub fn curves(title: &str, x: &str, y: &str, curves: &[Curve<'_>]) -> Result<String> {
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
        let all = || curves.iter().flat_map(|c| c.points.iter());
        let mut chart = ChartBuilder::on(&root)
            .caption(title, ("sans-serif", 18))
            .margin(10)
            .x_label_area_size(40)
            .y_label_area_size(64)
            .build_cartesian_2d(range(all().map(|p| p.0)), range(all().map(|p| p.1)))
            .map_err(failed)?;
        chart.configure_mesh().x_desc(x).y_desc(y).light_line_style(WHITE).draw().map_err(failed)?;
        for (i, curve) in curves.iter().enumerate() {
            let colour = COLOURS[i % COLOURS.len()];
            let points = curve.points.iter().copied().filter(|p| p.1.is_finite());
            let drawn = chart.draw_series(LineSeries::new(points, colour.stroke_width(2))).map_err(failed)?;
            drawn
                .label(curve.name)
                .legend(move |(x, y)| PathElement::new(vec![(x, y), (x + 18, y)], colour.stroke_width(2)));
        }
        let place = SeriesLabelPosition::UpperLeft;
        let labels = &mut chart.configure_series_labels();
        labels.position(place).border_style(BLACK).background_style(WHITE.mix(0.8)).draw().map_err(failed)?;
        root.present().map_err(failed)?;
    }
    Ok(svg)
}

/// Histograms over common axes as stepped lines: `(value, share)` of each bin, all of one width.
///
/// # Errors
/// When the plot cannot be laid out.
pub fn bars(title: &str, x: &str, histograms: &[Curve<'_>]) -> Result<String> {
    let stepped = |c: &Curve<'_>| {
        let width = c.points.windows(2).map(|w| w[1].0 - w[0].0).fold(f64::INFINITY, f64::min);
        let half = if width.is_finite() { width / 2.0 } else { 0.5 };
        c.points.iter().flat_map(|(x, y)| [(x - half, *y), (x + half, *y)]).collect()
    };
    let steps: Vec<Curve<'_>> =
        histograms.iter().map(|c| Curve { name: c.name, points: stepped(c) }).collect();
    curves(title, x, "share", &steps)
}

/// A map in grey, from the 1st (black) to the 99th percentile (white), as an image element.
/// `label` is its alternative text.
///
/// # Errors
/// When the image cannot be encoded.
pub fn heat_map(map: &[f64], width: usize, label: &str) -> Result<String> {
    let mut sorted = crate::measure::finite(map);
    sorted.sort_by(f64::total_cmp);
    let at = |share: f64| sorted.get((share * sorted.len() as f64) as usize).copied().unwrap_or(0.0);
    let (low, high) = (at(0.01), at(0.99));
    let scale = 255.0 / (high - low).max(f64::MIN_POSITIVE);
    // A pixel without a value is red.
    let colour = |v: &f64| {
        let grey = ((v - low) * scale).clamp(0.0, 255.0) as u8;
        if v.is_finite() { [grey; 3] } else { [200, 0, 0] }
    };
    let pixels: Vec<u8> = map.iter().flat_map(colour).collect();
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
    .map_err(failed)?;
    let label = label.replace(['<', '>', '"', '&'], " ");
    Ok(format!(
        "<img alt=\"{label}\" width=\"{}\" style=\"image-rendering: pixelated\" src=\"data:image/png;base64,{}\">",
        (2 * width).clamp(200, 800),
        base64(png.get_ref())
    ))
}

/// RFC 4648, with padding.
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
        for (plain, coded) in [("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foobar", "Zm9vYmFy")] {
            assert_eq!(super::base64(plain.as_bytes()), coded);
        }
    }
}
