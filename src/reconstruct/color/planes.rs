//! Demosaicing: all channels of every pixel from the values of a mosaic.

use super::menon::{self, reflected};
use crate::count::Count;
use crate::error::{Result, bail};
use crate::sensor::Mosaic;
use crate::spikes::Geometry;
use crate::variants::named_variants;

/// A method of demosaicing.
///
/// # Examples
/// ```
/// use spikelane::reconstruct::Demosaic;
/// assert_eq!("bilinear".parse::<Demosaic>()?, Demosaic::Bilinear);
/// assert_eq!(Demosaic::Menon.to_string(), "menon");
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Demosaic {
    /// Weighted mean of the nearest pixels of the channel. The weights decrease linearly with the distance in rows and in columns.
    #[default]
    Bilinear,
    /// Linear filters of 5x5 pixels that correct a bilinear value with the gradient of the pixel's own channel.
    ///
    /// Source: Malvar, He and Cutler, "High-quality linear interpolation for demosaicing of Bayer-patterned color
    /// images", ICASSP 2004.
    Malvar,
    /// Interpolation along rows or columns, whichever has the smaller gradients, with a refining step.
    ///
    /// Source: Menon, Andriani and Calvagno, "Demosaicing with directional filtering and a posteriori decision", IEEE
    /// Transactions on Image Processing 16 (1), 2007.
    Menon,
}

named_variants!(Demosaic, "demosaicing" { Bilinear = "bilinear", Malvar = "malvar", Menon = "menon" });

/// Returns all channels of every pixel, row-major. The channels of a pixel are adjacent, in the order of
/// [`Mosaic::channels`].
///
/// `values` contains one value per pixel, such as a rate, row-major. A pixel keeps the value of its own channel with
/// [`Demosaic::Bilinear`] and [`Demosaic::Malvar`]. [`Demosaic::Malvar`] and [`Demosaic::Menon`] can
/// return values below the smallest and above the largest value.
///
/// # Examples
/// ```
/// use spikelane::Geometry;
/// use spikelane::reconstruct::{Demosaic, demosaic};
/// // A uniform orange: red 0.5, green 0.25, blue 0.
/// let values = [0.5, 0.25, 0.5, 0.25, 0.25, 0.0, 0.25, 0.0];
/// let colors = demosaic(&values, Geometry::new(4, 2)?, &"RGGB".parse()?, Demosaic::Bilinear)?;
/// assert_eq!(colors, [0.5, 0.25, 0.0].repeat(8));
/// # Ok::<(), spikelane::Error>(())
/// ```
///
/// # Errors
/// * [`ErrorKind::Input`](crate::ErrorKind::Input) if the number of values differs from the number of pixels, or if the image has no pixel of a
///   channel.
/// * [`ErrorKind::Usage`](crate::ErrorKind::Usage) if the method is not bilinear, and the pattern is not a Bayer pattern or the image is smaller
///   than 5x5 pixels.
pub fn demosaic(values: &[f32], geometry: Geometry, mosaic: &Mosaic, method: Demosaic) -> Result<Vec<f32>> {
    if values.len() != geometry.pixels() {
        bail!(Input, "values of a mosaic"; found "{}", Count(values.len(), "value");
            expected "{}, one per pixel of {geometry}", geometry.pixels());
    }
    if method == Demosaic::Bilinear {
        return bilinear(values, geometry, mosaic);
    }
    if !mosaic.is_bayer() {
        bail!(Usage, "demosaicing"; found "{method} for the pattern {mosaic}";
            expected "RGGB, BGGR, GRBG or GBRG"; remedy "use bilinear, which supports every pattern");
    }
    if geometry.width() < 5 || geometry.height() < 5 {
        bail!(Usage, "demosaicing"; found "{method} for {geometry} pixels"; expected "at least 5x5 pixels";
            remedy "use bilinear, which supports every size");
    }
    match method {
        Demosaic::Malvar => Ok(malvar(values, geometry, mosaic)),
        _ => Ok(menon::demosaic(values, geometry, mosaic)),
    }
}

/// Returns the smallest distance within which every pixel of the sensor has a pixel of `channel`. The distance of two
/// pixels is the larger of their distances in rows and in columns.
fn reach(mosaic: &Mosaic, channel: usize) -> usize {
    let (rows, cols) = mosaic.period();
    let has_channel = |row: usize, col: usize, reach: usize| {
        // Rows and columns are counted from one period before the pixel, because indices must not be negative.
        let (top, left) = (row + rows * (reach / rows + 1) - reach, col + cols * (reach / cols + 1) - reach);
        (0..=2 * reach).any(|r| (0..=2 * reach).any(|c| mosaic.channel_at(top + r, left + c) == channel))
    };
    let cells = || (0..rows).flat_map(|row| (0..cols).map(move |col| (row, col)));
    (0..rows.max(cols))
        .find(|&reach| cells().all(|(row, col)| has_channel(row, col, reach)))
        .unwrap_or(rows.max(cols))
}

fn bilinear(values: &[f32], geometry: Geometry, mosaic: &Mosaic) -> Result<Vec<f32>> {
    let (width, height, channels) = (geometry.width(), geometry.height(), mosaic.channels().len());
    let map = mosaic.channel_map(geometry);
    if let Some(missing) = (0..channels).find(|channel| !map.contains(channel)) {
        bail!(Input, "mosaic";
            found "no pixel of the channel {} in {geometry} pixels", mosaic.channels()[missing].name;
            expected "an image that contains the whole pattern");
    }
    let reaches: Vec<usize> = (0..channels).map(|channel| reach(mosaic, channel)).collect();
    let mut out = vec![0.0; values.len() * channels];
    for (p, colors) in out.chunks_exact_mut(channels).enumerate() {
        let (row, col) = (p / width, p % width);
        for (channel, color) in colors.iter_mut().enumerate() {
            *color = if map[p] == channel {
                values[p]
            } else {
                // At the border, the neighborhood grows until it contains a pixel of the channel.
                (reaches[channel]..width.max(height) + reaches[channel])
                    .find_map(|reach| local_mean(values, &map, [width, height], [row, col], channel, reach))
                    .unwrap_or(0.0)
            };
        }
    }
    Ok(out)
}

/// Returns the mean of the pixels of `channel` within `reach` of a pixel, or `None` if there are none. The weight of a
/// pixel is the product of `reach + 1` minus its distance in rows and `reach + 1` minus its distance in columns.
fn local_mean(
    values: &[f32],
    map: &[usize],
    [width, height]: [usize; 2],
    [row, col]: [usize; 2],
    channel: usize,
    reach: usize,
) -> Option<f32> {
    let (mut sum, mut total) = (0.0, 0.0);
    for r in row.saturating_sub(reach)..(row + reach + 1).min(height) {
        for c in col.saturating_sub(reach)..(col + reach + 1).min(width) {
            if map[r * width + c] == channel {
                let weight = ((reach + 1 - r.abs_diff(row)) * (reach + 1 - c.abs_diff(col))) as f32;
                sum += weight * values[r * width + c];
                total += weight;
            }
        }
    }
    (total > 0.0).then(|| sum / total)
}

fn malvar(values: &[f32], geometry: Geometry, mosaic: &Mosaic) -> Vec<f32> {
    let (width, height) = (geometry.width(), geometry.height());
    let mut out = Vec::with_capacity(3 * values.len());
    for row in 0..height {
        for col in 0..width {
            let at =
                |r: isize, c: isize| values[reflected(row, r, height) * width + reflected(col, c, width)];
            let center = at(0, 0);
            let (beside, above) = (at(0, -1) + at(0, 1), at(-1, 0) + at(1, 0));
            let (far_beside, far_above) = (at(0, -2) + at(0, 2), at(-2, 0) + at(2, 0));
            let diagonal = at(-1, -1) + at(-1, 1) + at(1, -1) + at(1, 1);
            let own = mosaic.channel_at(row, col);
            if own == 1 {
                // A green pixel: one color is beside it, the other color is above and below it.
                let horizontal =
                    (5.0 * center + 4.0 * beside - far_beside - diagonal + 0.5 * far_above) / 8.0;
                let vertical = (5.0 * center + 4.0 * above - far_above - diagonal + 0.5 * far_beside) / 8.0;
                let is_red_beside = mosaic.channel_at(row, col + 1) == 0;
                out.extend(if is_red_beside {
                    [horizontal, center, vertical]
                } else {
                    [vertical, center, horizontal]
                });
            } else {
                let green = (4.0 * center + 2.0 * (beside + above) - far_beside - far_above) / 8.0;
                let opposite = (6.0 * center + 2.0 * diagonal - 1.5 * (far_beside + far_above)) / 8.0;
                out.extend(if own == 0 { [center, green, opposite] } else { [opposite, green, center] });
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ErrorKind;

    /// Returns the values of a mosaic that samples an image of planes with `light(row, col, channel)`.
    fn sampled(geometry: Geometry, mosaic: &Mosaic, light: impl Fn(usize, usize, usize) -> f32) -> Vec<f32> {
        let map = mosaic.channel_map(geometry);
        map.iter().enumerate().map(|(p, c)| light(p / geometry.width(), p % geometry.width(), *c)).collect()
    }

    #[test]
    fn a_uniform_color_is_exact_for_every_method_and_pattern() {
        let geometry = Geometry::new(11, 9).unwrap();
        for pattern in ["RGGB", "BGGR", "GRBG", "GBRG", "quad-RGGB", "RGBW", "RGB/GBR"] {
            let mosaic: Mosaic = pattern.parse().unwrap();
            let color = [0.5, 0.25, 0.125, 0.75];
            let values = sampled(geometry, &mosaic, |_, _, channel| color[channel]);
            for method in Demosaic::ALL.into_iter().filter(|m| *m == Demosaic::Bilinear || mosaic.is_bayer())
            {
                let out = demosaic(&values, geometry, &mosaic, method).unwrap();
                let channels = mosaic.channels().len();
                for (i, x) in out.iter().enumerate() {
                    assert!((x - color[i % channels]).abs() < 1e-6, "{pattern} {method} {i}: {x}");
                }
            }
        }
    }

    #[test]
    fn a_linear_ramp_is_exact_inside_the_image() {
        // The filters of all three methods reproduce a plane whose channels have equal slopes.
        let geometry = Geometry::new(16, 14).unwrap();
        let light = |row: usize, col: usize, channel: usize| {
            0.1 + 0.01 * row as f32 + 0.02 * col as f32 + 0.1 * channel as f32
        };
        for pattern in ["RGGB", "BGGR", "GRBG", "GBRG"] {
            let mosaic: Mosaic = pattern.parse().unwrap();
            let values = sampled(geometry, &mosaic, light);
            for method in Demosaic::ALL {
                let out = demosaic(&values, geometry, &mosaic, method).unwrap();
                for row in 5..9 {
                    for col in 5..11 {
                        for channel in 0..3 {
                            let found = out[3 * (row * 16 + col) + channel];
                            let error = (found - light(row, col, channel)).abs();
                            assert!(error < 1e-5, "{pattern} {method} {row} {col} {channel}: {error}");
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn methods_for_bayer_patterns_refuse_other_patterns_and_small_images() {
        let quad: Mosaic = "quad-RGGB".parse().unwrap();
        let bayer: Mosaic = "RGGB".parse().unwrap();
        let (wide, small) = (Geometry::new(8, 8).unwrap(), Geometry::new(4, 8).unwrap());
        for method in [Demosaic::Malvar, Demosaic::Menon] {
            assert_eq!(demosaic(&[0.0; 64], wide, &quad, method).unwrap_err().kind(), ErrorKind::Usage);
            assert_eq!(demosaic(&[0.0; 32], small, &bayer, method).unwrap_err().kind(), ErrorKind::Usage);
        }
        let one = Geometry::new(1, 8).unwrap();
        assert_eq!(
            demosaic(&[0.0; 8], one, &bayer, Demosaic::Bilinear).unwrap_err().kind(),
            ErrorKind::Input
        );
    }
}
