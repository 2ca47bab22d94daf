//! The mosaic of color filters on the pixels of a color camera.
//!
//! A pixel of a color camera is a pixel of a gray camera behind a filter. The filters therefore change only the light of
//! a pixel. The pixel law, the effects and the kernels are the same for both cameras.

use std::str::FromStr;

use crate::count::Count;
use crate::error::{Error, Result, bail, error};
use crate::light::transfer::EXACT_LUMINANCE_WEIGHTS;
use crate::light::{Frame, OwnedSamples};
use crate::spikes::{Crop, Geometry};

/// Maximum number of rows and of columns of a pattern.
const MAX_PATTERN_SIDE: usize = 16;

/// A channel of a mosaic: the pixels with one kind of filter.
///
/// The light of a pixel behind the filter is `gain * (response . rgb) + infrared * luminance`, where `rgb` is linear
/// sRGB and `luminance` is its luminance (ITU-R BT.709). RGB images do not contain infrared light, so the
/// luminance represents it.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Channel {
    /// Letter of the channel in the pattern, `A` to `Z`.
    pub name: char,
    /// Weights of linear red, green and blue.
    pub response: [f64; 3],
    /// Measured sensitivity of the channel, relative to the sensitivity that `response` describes.
    pub gain: f64,
    /// Weight of the infrared light that passes the filter.
    pub infrared: f64,
}

impl Channel {
    /// Returns a channel with the default response of its name, a gain of 1, and no infrared light. The channels R, G and
    /// B have the responses of linear sRGB. The response of W is the mean of the three colors.
    fn from_name(name: char) -> Option<Self> {
        let response = match name {
            'R' => [1.0, 0.0, 0.0],
            'G' => [0.0, 1.0, 0.0],
            'B' => [0.0, 0.0, 1.0],
            'W' => [1.0 / 3.0; 3],
            _ => return None,
        };
        Some(Self { name, response, gain: 1.0, infrared: 0.0 })
    }

    /// Returns the weights of linear red, green and blue in the light of the channel.
    ///
    /// # Examples
    /// ```
    /// use spikelane::sensor::Mosaic;
    /// let mosaic: Mosaic = "RGGB".parse()?;
    /// assert_eq!(mosaic.channels()[1].weights(), [0.0, 1.0, 0.0]);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    #[must_use]
    pub fn weights(&self) -> [f64; 3] {
        std::array::from_fn(|i| self.gain * self.response[i] + self.infrared * EXACT_LUMINANCE_WEIGHTS[i])
    }

    /// Returns the light of the channel for white, which is linear sRGB (1, 1, 1) under the illuminant D65.
    #[must_use]
    pub fn white(&self) -> f64 {
        self.weights().iter().sum()
    }

    /// Returns the light of the channel. Light below 0, which a negative weight can give, is 0.
    fn light(weights: [f32; 3], rgb: [f32; 3]) -> f32 {
        (weights[0] * rgb[0] + weights[1] * rgb[1] + weights[2] * rgb[2]).max(0.0)
    }
}

/// A pattern of color filters that repeats across the sensor.
///
/// A pattern is parsed from the letters of its channels, row by row: `RGGB` for two rows of two letters, `quad-RGGB` for
/// the same pattern with blocks of 2x2 pixels, or `RGBG/GWGW` with one part per row.
///
/// # Examples
/// ```
/// use spikelane::sensor::Mosaic;
/// let mosaic: Mosaic = "BGGR".parse()?;
/// assert_eq!((mosaic.name_at(0, 0), mosaic.name_at(3, 3)), ('B', 'R'));
/// assert_eq!(mosaic.shifted(0, 1).to_string(), "GBRG");
/// assert_eq!("quad-RGGB".parse::<Mosaic>()?.name_at(1, 1), 'R');
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Mosaic {
    rows: usize,
    cols: usize,
    /// Index of the channel of each cell of the pattern, row by row.
    cells: Vec<usize>,
    channels: Vec<Channel>,
}

impl Mosaic {
    /// Returns a mosaic with the pattern `pattern` and one response for each channel.
    ///
    /// A channel that `responses` does not contain has the default response of its name.
    ///
    /// # Examples
    /// ```
    /// use spikelane::sensor::Mosaic;
    /// // Complementary colors.
    /// let responses = [('C', [0.0, 0.5, 0.5]), ('M', [0.5, 0.0, 0.5]), ('Y', [0.5, 0.5, 0.0])];
    /// let mosaic = Mosaic::new("CYYM", &responses)?;
    /// assert_eq!(mosaic.channels().len(), 3);
    /// assert_eq!(Mosaic::new("CYYM", &[]).unwrap_err().subject(), "response");
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns [`ErrorKind::Config`](crate::ErrorKind::Config) if the pattern is invalid, if a response is not finite, if the light of a channel
    /// is not positive for white, if a channel has no response, or if the pattern does not contain a channel of
    /// `responses`.
    pub fn new(pattern: &str, responses: &[(char, [f64; 3])]) -> Result<Self> {
        let (rows, cols, letters) = parse_pattern(pattern)?;
        let mut names = letters.clone();
        names.sort_unstable();
        names.dedup();
        // R, G, B and W come first, so the first planes of an RGB pattern are red, green and blue.
        names.sort_by_key(|name| "RGBW".find(*name).unwrap_or(usize::MAX));
        if let Some((name, _)) = responses.iter().find(|(name, _)| !names.contains(name)) {
            return Err(foreign_channel_error("response", *name, pattern));
        }
        let channel = |name: &char| {
            let given = responses.iter().find(|(n, _)| n == name).map(|(_, response)| Channel {
                name: *name,
                response: *response,
                gain: 1.0,
                infrared: 0.0,
            });
            given.or_else(|| Channel::from_name(*name)).ok_or_else(|| {
                error!(Config, "response"; found "no response of the channel {name}";
                    expected "a response for each channel except R, G, B and W")
            })
        };
        let channels = names.iter().map(channel).collect::<Result<Vec<_>>>()?;
        let cell = |letter: &char| names.iter().position(|name| name == letter).unwrap_or_default();
        Self { rows, cols, cells: letters.iter().map(cell).collect(), channels }.validate()
    }

    /// Returns this mosaic with a measured gain and a leak of infrared light for the channel `name`.
    ///
    /// # Examples
    /// ```
    /// use spikelane::sensor::Mosaic;
    /// let mosaic = "RGGB".parse::<Mosaic>()?.with_channel('R', 0.5, 0.1)?;
    /// assert!((mosaic.channels()[0].white() - 0.6).abs() < 1e-12);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns [`ErrorKind::Config`](crate::ErrorKind::Config) if the pattern has no such channel, if a value is not finite or negative, or if the
    /// light of the channel is not positive for white.
    pub fn with_channel(mut self, name: char, gain: f64, infrared: f64) -> Result<Self> {
        let pattern = self.to_string();
        let channel = self.channels.iter_mut().find(|c| c.name == name);
        let channel = channel.ok_or_else(|| foreign_channel_error("gain", name, &pattern))?;
        for (key, value) in [("gain", gain), ("infrared", infrared)] {
            if !(value.is_finite() && value >= 0.0) {
                bail!(Config, "{key}"; found "{value}"; expected "a finite number that is not negative");
            }
        }
        (channel.gain, channel.infrared) = (gain, infrared);
        self.validate()
    }

    fn validate(self) -> Result<Self> {
        for channel in &self.channels {
            if !channel.weights().iter().all(|w| w.is_finite()) || channel.white() <= 0.0 {
                let weights = channel.weights().map(|weight| weight.to_string());
                bail!(Config, "response"; found "{} for the channel {}", weights.join(", "), channel.name;
                    expected "finite weights of red, green and blue whose sum is positive");
            }
        }
        Ok(self)
    }

    /// Returns the number of rows and columns after which the pattern repeats.
    #[must_use]
    pub const fn period(&self) -> (usize, usize) {
        (self.rows, self.cols)
    }

    /// Returns the channels: R, G, B and W if present, then all others in alphabetical order.
    #[must_use]
    pub fn channels(&self) -> &[Channel] {
        &self.channels
    }

    /// Returns the index in [`Mosaic::channels`] of the channel of pixel `(row, col)`.
    #[must_use]
    pub fn channel_at(&self, row: usize, col: usize) -> usize {
        self.cells[row % self.rows * self.cols + col % self.cols]
    }

    /// Returns the letter of the channel of pixel `(row, col)`.
    #[must_use]
    pub fn name_at(&self, row: usize, col: usize) -> char {
        self.channels[self.channel_at(row, col)].name
    }

    /// Returns the mosaic of a window whose first pixel is pixel `(row, col)` of the sensor.
    #[must_use]
    pub fn shifted(&self, row: usize, col: usize) -> Self {
        let cells =
            (0..self.rows).flat_map(|r| (0..self.cols).map(move |c| self.channel_at(row + r, col + c)));
        Self { cells: cells.collect(), ..self.clone() }
    }

    /// Returns the mosaic of the rectangle `crop`.
    #[must_use]
    pub fn crop(&self, crop: Crop) -> Self {
        self.shifted(crop.row, crop.col)
    }

    /// Returns whether the pattern has two rows and two columns with one red, two diagonal green, and one blue pixel.
    #[must_use]
    pub fn is_bayer(&self) -> bool {
        matches!(&*self.to_string(), "RGGB" | "BGGR" | "GRBG" | "GBRG")
    }

    /// Returns the index of the channel of every pixel, row-major.
    ///
    /// # Examples
    /// ```
    /// use spikelane::{Geometry, sensor::Mosaic};
    /// let mosaic: Mosaic = "RGGB".parse()?;
    /// assert_eq!(mosaic.channel_map(Geometry::new(3, 2)?), [0, 1, 0, 1, 2, 1]);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    #[must_use]
    pub fn channel_map(&self, geometry: Geometry) -> Vec<usize> {
        let rows = 0..geometry.height();
        rows.flat_map(|row| (0..geometry.width()).map(move |col| self.channel_at(row, col))).collect()
    }

    /// Returns the light that the pixels receive behind their filters. The frame keeps the colors of `frame`.
    ///
    /// The colors of a frame without [`Frame::rgb`] are gray. The result has 16-bit samples if `frame` has integer samples
    /// and no channel can exceed full scale. Otherwise it has floats.
    ///
    /// # Examples
    /// ```
    /// use spikelane::Geometry;
    /// use spikelane::light::{Frame, OwnedSamples};
    /// use spikelane::sensor::Mosaic;
    /// let geometry = Geometry::new(2, 2)?;
    /// let gray = Frame::new(geometry, OwnedSamples::F32(vec![0.3; 4]))?;
    /// let orange = gray.with_rgb([0.5, 0.25, 0.0].repeat(4))?;
    /// assert_eq!("RGGB".parse::<Mosaic>()?.light(&orange)?.to_f32(), [0.5, 0.25, 0.25, 0.0]);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns [`ErrorKind::Input`](crate::ErrorKind::Input) if the light of a pixel is not finite.
    pub fn light(&self, frame: &Frame) -> Result<Frame> {
        let geometry = frame.geometry();
        let width = geometry.width();
        let weights: Vec<[f32; 3]> = self.channels.iter().map(|c| c.weights().map(|w| w as f32)).collect();
        let mut light = Vec::with_capacity(geometry.pixels());
        // The weights of the rows repeat with the pattern.
        let row_weights =
            |row: usize| (0..width).map(|col| weights[self.channel_at(row, col)]).collect::<Vec<_>>();
        let pattern_rows: Vec<Vec<[f32; 3]>> = (0..self.rows).map(row_weights).collect();
        for row in 0..geometry.height() {
            let row_weights = &pattern_rows[row % self.rows];
            match frame.rgb() {
                Some(rgb) => {
                    let (colors, _) = rgb[3 * row * width..3 * (row + 1) * width].as_chunks::<3>();
                    light.extend(row_weights.iter().zip(colors).map(|(w, rgb)| Channel::light(*w, *rgb)));
                }
                None => light.extend(
                    row_weights
                        .iter()
                        .enumerate()
                        .map(|(col, w)| Channel::light(*w, [frame.get(row, col); 3])),
                ),
            }
        }
        let below_full_scale = |c: &Channel| c.weights().iter().map(|w| w.max(0.0)).sum::<f64>() <= 1.0;
        let is_integer = !matches!(frame.samples(), OwnedSamples::F32(_));
        let samples = if is_integer && self.channels.iter().all(below_full_scale) {
            // The cast limits a value that rounding moved above full scale.
            OwnedSamples::U16(light.iter().map(|x| (x * 65535.0 + 0.5) as u16).collect())
        } else {
            OwnedSamples::F32(light)
        };
        frame.with_samples(samples)
    }

    /// Returns the light that a sensor without a mosaic would receive if all pixels had the filter of `channel`, which
    /// is an index in [`Mosaic::channels`].
    ///
    /// # Errors
    /// Returns [`ErrorKind::Usage`](crate::ErrorKind::Usage) if there is no such channel, and the errors of [`Mosaic::light`].
    pub fn channel_light(&self, frame: &Frame, channel: usize) -> Result<Frame> {
        if channel >= self.channels.len() {
            bail!(Usage, "channel"; found "{channel}";
                expected "less than {}, the number of channels", self.channels.len());
        }
        // All channels remain, so the type of the samples is the type of `light`.
        Self { rows: 1, cols: 1, cells: vec![channel], channels: self.channels.clone() }.light(frame)
    }
}

impl std::fmt::Display for Mosaic {
    /// Formats the pattern as [`Mosaic::from_str`] parses it. The responses are not included.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let letter = |row: usize, col: usize| self.name_at(row, col);
        let pair = |step: usize| -> String {
            [(0, 0), (0, step), (step, 0), (step, step)].map(|(r, c)| letter(r, c)).iter().collect()
        };
        if (self.rows, self.cols) == (2, 2) {
            return f.write_str(&pair(1));
        }
        let is_quad = (self.rows, self.cols) == (4, 4)
            && (0..16).all(|i| letter(i / 4, i % 4) == letter(i / 8 * 2, i % 4 / 2 * 2));
        if is_quad {
            return write!(f, "quad-{}", pair(2));
        }
        let rows: Vec<String> =
            (0..self.rows).map(|row| (0..self.cols).map(|col| letter(row, col)).collect()).collect();
        f.write_str(&rows.join("/"))
    }
}

impl FromStr for Mosaic {
    type Err = Error;

    /// Parses a pattern whose channels have the default responses.
    ///
    /// # Errors
    /// Returns the errors of [`Mosaic::new`].
    fn from_str(pattern: &str) -> Result<Self> {
        Self::new(pattern, &[])
    }
}

/// Returns the number of rows and columns of a pattern, and its letters.
fn parse_pattern(pattern: &str) -> Result<(usize, usize, Vec<char>)> {
    let error = || {
        error!(Config, "pattern"; found "\"{pattern}\"";
            expected "RGGB, BGGR, GRBG, GBRG, RGBW, one of them after `quad-`, or rows of capital letters as in RGBG/GWGW")
    };
    let (letters, is_quad) = match pattern.strip_prefix("quad-") {
        Some(rest) => (rest, true),
        None => (pattern, false),
    };
    let rows: Vec<Vec<char>> = if letters.contains('/') {
        letters.split('/').map(|row| row.chars().collect()).collect()
    } else if letters.chars().count() == 4 {
        let all: Vec<char> = letters.chars().collect();
        all.chunks(2).map(<[char]>::to_vec).collect()
    } else {
        return Err(error());
    };
    let cols = rows[0].len();
    let is_valid = (1..=MAX_PATTERN_SIDE).contains(&rows.len())
        && (1..=MAX_PATTERN_SIDE).contains(&cols)
        && rows.iter().all(|row| row.len() == cols && row.iter().all(char::is_ascii_uppercase))
        && !(is_quad && (rows.len(), cols) != (2, 2));
    if !is_valid {
        return Err(error());
    }
    if !is_quad {
        return Ok((rows.len(), cols, rows.concat()));
    }
    let wide = |row: &Vec<char>| row.iter().flat_map(|c| [*c; 2]).collect::<Vec<char>>();
    Ok((4, 4, rows.iter().flat_map(|row| [wide(row), wide(row)]).flatten().collect()))
}

fn foreign_channel_error(key: &str, name: char, pattern: &str) -> Error {
    let mut names: Vec<char> = pattern.trim_start_matches("quad-").chars().filter(|c| *c != '/').collect();
    names.sort_unstable();
    names.dedup();
    let listed = names.iter().map(char::to_string).collect::<Vec<_>>().join(", ");
    error!(Config, "{key}"; found "the channel {name}";
        expected "{} of the pattern {pattern}: {listed}", Count(names.len(), "channel"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ErrorKind;

    #[test]
    fn a_pattern_reads_back_from_its_text() {
        for text in ["RGGB", "BGGR", "GRBG", "GBRG", "RGBW", "quad-RGGB", "quad-BGGR", "quad-RGBW", "RGB/GBR"]
        {
            let mosaic: Mosaic = text.parse().unwrap();
            assert_eq!(mosaic.to_string(), text);
        }
        // A long form is written in its short form.
        assert_eq!("RRGG/RRGG/GGBB/GGBB".parse::<Mosaic>().unwrap().to_string(), "quad-RGGB");
    }

    #[test]
    fn invalid_patterns_are_errors() {
        for text in ["", "RGG", "rggb", "RG/G", "RGGBX", "quad-RGB", "quad-RGB/GBR", "RG/", "R?/GB", "/"] {
            let error = text.parse::<Mosaic>().unwrap_err();
            assert_eq!(error.kind(), ErrorKind::Config, "{text}: {error}");
        }
        let long = "R".repeat(17);
        assert!(format!("{long}/{long}").parse::<Mosaic>().is_err());
    }

    #[test]
    fn a_shift_moves_the_phase_of_the_pattern() {
        let mosaic: Mosaic = "RGB/GBR".parse().unwrap();
        let part = mosaic.shifted(5, 4);
        for (row, col) in (0..9).flat_map(|r| (0..9).map(move |c| (r, c))) {
            assert_eq!(part.name_at(row, col), mosaic.name_at(row + 5, col + 4));
        }
    }

    #[test]
    fn invalid_responses_are_errors() {
        for weights in [[0.0; 3], [f64::NAN, 1.0, 1.0], [-1.0, 0.5, 0.0]] {
            assert!(Mosaic::new("RGGB", &[('R', weights)]).is_err(), "{weights:?}");
        }
        assert!(Mosaic::new("RGGB", &[('W', [1.0; 3])]).is_err());
        let mosaic: Mosaic = "RGGB".parse().unwrap();
        for (name, gain, infrared) in
            [('W', 1.0, 0.0), ('R', -1.0, 0.0), ('R', 0.0, 0.0), ('R', 1.0, f64::NAN)]
        {
            assert!(mosaic.clone().with_channel(name, gain, infrared).is_err(), "{name} {gain} {infrared}");
        }
    }
}
