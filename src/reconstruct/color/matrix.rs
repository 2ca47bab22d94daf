//! Conversion of the channels of a mosaic to linear sRGB.

use crate::error::{Result, bail, error};
use crate::sensor::Mosaic;

/// Smallest determinant of the normalized response at which colors can be separated.
const MIN_DETERMINANT: f64 = 1e-6;

/// A linear conversion of the channels of a mosaic to linear red, green and blue.
///
/// # Examples
/// ```
/// use spikelane::reconstruct::ColorMatrix;
/// use spikelane::sensor::Mosaic;
/// let response = [('R', [0.8, 0.2, 0.0]), ('G', [0.1, 0.8, 0.1]), ('B', [0.0, 0.3, 0.7])];
/// let mosaic = Mosaic::new("RGGB", &response)?.with_channel('B', 0.5, 0.0)?;
/// // White has the light 1, 1 and 0.5.
/// let rgb = ColorMatrix::from_response(&mosaic)?.apply(&[1.0, 1.0, 0.5]);
/// assert!(rgb.iter().all(|x| (x - 1.0).abs() < 1e-6));
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct ColorMatrix {
    /// Three rows of one weight per channel.
    rows: [Vec<f64>; 3],
}

impl ColorMatrix {
    /// Returns the inverse of the spectral response of `mosaic`, which includes the white balance for D65. For more than
    /// three channels, this is the least-squares inverse.
    ///
    /// # Errors
    /// Returns [`ErrorKind::Config`](crate::ErrorKind::Config) if the response does not separate three colors.
    pub fn from_response(mosaic: &Mosaic) -> Result<Self> {
        let response: Vec<[f64; 3]> = mosaic.channels().iter().map(|c| c.weights()).collect();
        // Each channel has the weight 1 for white in the least-squares sum, so a bright channel does not dominate.
        let whites: Vec<f64> = mosaic.channels().iter().map(|c| c.white()).collect();
        let scaled: Vec<[f64; 3]> = response.iter().zip(&whites).map(|(row, w)| row.map(|x| x / w)).collect();
        let normal: [[f64; 3]; 3] =
            std::array::from_fn(|i| std::array::from_fn(|j| scaled.iter().map(|row| row[i] * row[j]).sum()));
        let inverse = inverse(normal).ok_or_else(|| {
            error!(Config, "response"; found "a mosaic {mosaic} that does not separate red, green and blue";
                expected "at least three channels with different responses";
                remedy "reconstruct the channels without a color matrix, or change the response")
        })?;
        let weight =
            |i: usize, k: usize| (0..3).map(|j| inverse[i][j] * scaled[k][j]).sum::<f64>() / whites[k];
        Ok(Self { rows: std::array::from_fn(|i| (0..scaled.len()).map(|k| weight(i, k)).collect()) })
    }

    /// Returns the conversion that divides each of the channels R, G and B by its light for white and ignores all other
    /// channels.
    ///
    /// `white` contains the light of each channel for a white object, in the order of [`Mosaic::channels`].
    ///
    /// # Examples
    /// ```
    /// use spikelane::reconstruct::ColorMatrix;
    /// let balance = ColorMatrix::from_white(&"RGGB".parse()?, &[0.5, 1.0, 0.25])?;
    /// assert_eq!(balance.apply(&[0.25, 0.5, 0.125]), [0.5, 0.5, 0.5]);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns [`ErrorKind::Config`](crate::ErrorKind::Config) if the mosaic lacks R, G or B, or if `white` does not have one positive number for each channel.
    pub fn from_white(mosaic: &Mosaic, white: &[f64]) -> Result<Self> {
        let channels = mosaic.channels();
        if white.len() != channels.len() || !white.iter().all(|w| w.is_finite() && *w > 0.0) {
            let white: Vec<_> = white.iter().map(f64::to_string).collect();
            bail!(Config, "white balance"; found "{}", white.join(", ");
                expected "{} positive numbers, one per channel of {mosaic}", channels.len());
        }
        let row = |name: char| -> Result<Vec<f64>> {
            let k = channels.iter().position(|c| c.name == name).ok_or_else(|| {
                error!(Config, "white balance"; found "a mosaic {mosaic} without the channel {name}";
                    expected "the channels R, G and B")
            })?;
            Ok((0..channels.len()).map(|i| if i == k { 1.0 / white[k] } else { 0.0 }).collect())
        };
        Ok(Self { rows: [row('R')?, row('G')?, row('B')?] })
    }

    /// Converts an image. `colors` contains all channels of each pixel, as [`super::demosaic`] returns them. The result
    /// contains red, green and blue of each pixel, and can contain negative values.
    #[must_use]
    pub fn apply(&self, colors: &[f32]) -> Vec<f32> {
        let sum = |row: &[f64], pixel: &[f32]| {
            row.iter().zip(pixel).map(|(w, x)| w * f64::from(*x)).sum::<f64>() as f32
        };
        colors
            .chunks_exact(self.rows[0].len())
            .flat_map(|p| [0, 1, 2].map(|i| sum(&self.rows[i], p)))
            .collect()
    }
}

/// Returns the inverse of a symmetric matrix with a trace of at most about 3, or `None` if it is singular.
fn inverse(m: [[f64; 3]; 3]) -> Option<[[f64; 3]; 3]> {
    let minor = |i: usize, j: usize| {
        let (r, c) = ([(i + 1) % 3, (i + 2) % 3], [(j + 1) % 3, (j + 2) % 3]);
        m[r[0]][c[0]] * m[r[1]][c[1]] - m[r[0]][c[1]] * m[r[1]][c[0]]
    };
    let determinant: f64 = (0..3).map(|j| m[0][j] * minor(0, j)).sum();
    if determinant.is_nan() || determinant <= MIN_DETERMINANT {
        return None;
    }
    Some(std::array::from_fn(|i| std::array::from_fn(|j| minor(j, i) / determinant)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_matrix_recovers_the_color_from_the_light_of_the_channels() {
        let responses = [('R', [0.7, 0.25, 0.05]), ('G', [0.1, 0.8, 0.1]), ('B', [0.02, 0.2, 0.78])];
        for pattern in ["RGGB", "RGBW"] {
            let mosaic = Mosaic::new(pattern, &responses).unwrap().with_channel('R', 0.4, 0.1).unwrap();
            let matrix = ColorMatrix::from_response(&mosaic).unwrap();
            for color in [[1.0, 1.0, 1.0], [0.9, 0.1, 0.3], [0.0, 0.0, 0.5]] {
                let light = |weights: [f64; 3]| (0..3).map(|i| weights[i] * color[i]).sum::<f64>() as f32;
                let channels: Vec<f32> = mosaic.channels().iter().map(|c| light(c.weights())).collect();
                for (found, expected) in matrix.apply(&channels).iter().zip(color) {
                    assert!((f64::from(*found) - expected).abs() < 1e-5, "{pattern} {color:?}: {found}");
                }
            }
        }
    }

    #[test]
    fn a_response_without_three_colors_is_an_error() {
        for pattern in ["RGGR", "GGGG", "WWWW"] {
            assert!(ColorMatrix::from_response(&pattern.parse().unwrap()).is_err(), "{pattern}");
        }
        assert!(ColorMatrix::from_white(&"RGGR".parse().unwrap(), &[1.0; 2]).is_err());
    }
}
