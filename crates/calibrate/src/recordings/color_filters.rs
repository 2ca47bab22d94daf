//! The color filters of a recorded camera, and the classes of its pixels.
//!
//! The pixels of a class have equal filters. Statistics of the pixels are robust only within a class, because the median
//! over several filters is between their rates and is not a linear function of the light.

use super::observations::Observations;
use spikelane::error::{Error, ErrorKind, Result};
use spikelane::sensor::Mosaic;
use spikelane_measure::{Estimate, detect_mosaic};

/// Color filters of the camera that made a recording set.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum ColorFilters {
    /// The set does not state them. A pattern of 2x2 filters is detected.
    #[default]
    Unknown,
    /// The camera has no color filters.
    Absent,
    /// The camera has the filters of this mosaic.
    Mosaic(Mosaic),
}

impl ColorFilters {
    /// Parses a pattern such as `RGGB`, or `none` for a camera without color filters.
    ///
    /// # Examples
    /// ```
    /// use spikelane_calibrate::ColorFilters;
    /// assert_eq!(ColorFilters::parse("none")?, ColorFilters::Absent);
    /// assert_eq!(ColorFilters::parse("RGGB")?, ColorFilters::Mosaic("RGGB".parse()?));
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns the errors of [`Mosaic::new`].
    pub fn parse(text: &str) -> Result<Self> {
        if text == "none" { Ok(Self::Absent) } else { text.parse().map(Self::Mosaic) }
    }
}

/// The class of every pixel. The classes of a camera with known filters are the channels of its mosaic. All other
/// cameras have four classes, the positions in a cell of 2x2 pixels.
#[derive(Clone, Debug)]
pub(crate) struct PixelClasses {
    mosaic: Mosaic,
    width: usize,
    /// Whether the classes have different filters. A filter reduces the number of photons. The gain of a pixel changes
    /// the charge of a photon.
    pub are_filters: bool,
    /// Whether the set states the filters.
    pub are_declared: bool,
}

/// Letters of the positions in a cell of 2x2 pixels: even row and even column, even row and odd column, odd row and even
/// column, odd row and odd column. Their colors are unknown, so they are not the letters of colors.
const CELL_LETTERS: &str = "KLMN";

impl PixelClasses {
    pub(crate) fn new(filters: &ColorFilters, width: usize, is_detected: bool) -> Self {
        if let ColorFilters::Mosaic(mosaic) = filters {
            return Self { mosaic: mosaic.clone(), width, are_filters: true, are_declared: true };
        }
        let response: Vec<(char, [f64; 3])> =
            CELL_LETTERS.chars().map(|name| (name, [1.0 / 3.0; 3])).collect();
        let Ok(mosaic) = Mosaic::new(CELL_LETTERS, &response) else { unreachable!("the pattern is valid") };
        Self { mosaic, width, are_filters: is_detected, are_declared: false }
    }

    /// Returns the class of pixel `p`.
    pub(crate) fn class(&self, p: usize) -> usize {
        self.mosaic.channel_at(p / self.width, p % self.width)
    }

    /// Returns the number of classes.
    pub(crate) fn count(&self) -> usize {
        self.mosaic.channels().len()
    }

    pub(crate) const fn mosaic(&self) -> &Mosaic {
        &self.mosaic
    }

    /// Returns the index of the cell of the pattern that contains pixel `p`, as row and column.
    pub(crate) fn cell(&self, p: usize) -> [usize; 2] {
        let (rows, cols) = self.mosaic.period();
        [p / self.width / rows, p % self.width / cols]
    }
}

impl Observations {
    /// Returns the two possible Bayer patterns of recordings without stated filters, or `None` if they have no such
    /// pattern. The brightest level without a saturated pixel class shows it.
    #[must_use]
    pub fn detected_mosaics(&self) -> Option<[Mosaic; 2]> {
        if self.filters != ColorFilters::Unknown {
            return None;
        }
        let width = self.geometry.width();
        let classes = PixelClasses::new(&ColorFilters::Unknown, width, false);
        // A rate map of unknown length has no counts.
        let is_usable =
            |l: &&super::observations::LightLevel| l.readouts > 0 && l.typical_rate(&classes) < 1.0;
        let brightest = self.levels.iter().rfind(is_usable)?;
        detect_mosaic(&brightest.spikes, width)
    }

    /// Returns the classes of the pixels after a check of the declared filters.
    ///
    /// # Errors
    /// [`ErrorKind::Input`] if pixels with equal declared filters have different rates.
    pub(crate) fn checked_pixel_classes(&self) -> Result<PixelClasses> {
        let classes = self.pixel_classes();
        check_declared_mosaic(self, &classes)?;
        Ok(classes)
    }

    /// Returns the classes of the pixels.
    pub(crate) fn pixel_classes(&self) -> PixelClasses {
        PixelClasses::new(&self.filters, self.geometry.width(), self.detected_mosaics().is_some())
    }
}

/// Smallest ratio of the differences between equal filters of the declared pattern to those of a shifted pattern.
const MAX_PHASE_RATIO: f64 = 4.0;

/// Smallest difference between equal filters that contradicts a declaration, in standard errors and as a share of the
/// rate. The share exceeds the difference between the two green pixels of real sensors.
const PHASE_Z_THRESHOLD: f64 = 8.0;
const MIN_PHASE_DIFFERENCE: f64 = 0.03;

/// Checks that pixels with equal declared filters have equal rates. If another phase of the pattern explains the rates,
/// the error names it.
///
/// The check cannot find a swap of red and blue, as between RGGB and BGGR, because the color of the lamps is unknown.
fn check_declared_mosaic(observed: &Observations, classes: &PixelClasses) -> Result<()> {
    let (rows, cols) = classes.mosaic.period();
    let is_usable = |l: &&super::observations::LightLevel| l.light > 0.0 && l.typical_rate(classes) < 1.0;
    let Some(level) = observed.levels.iter().rfind(is_usable).filter(|_| classes.are_declared) else {
        return Ok(());
    };
    let position = |p: usize| p / classes.width % rows * cols + p % classes.width % cols;
    let mut rates = vec![Vec::new(); rows * cols];
    level.rate.iter().enumerate().for_each(|(p, rate)| rates[position(p)].push(*rate));
    let medians: Vec<Estimate> = rates.iter_mut().map(|rates| median_with_error(rates)).collect();
    // The largest difference between two positions with equal filters, in standard errors and relative to their mean.
    let contradiction = |mosaic: &Mosaic| {
        let name = |i: usize| mosaic.name_at(i / cols, i % cols);
        let pairs =
            (0..rows * cols).flat_map(|i| (0..i).map(move |j| (i, j))).filter(|(i, j)| name(*i) == name(*j));
        let difference = |(i, j): (usize, usize)| {
            let [a, b] = [medians[i], medians[j]];
            let difference = (a.value - b.value).abs();
            [difference / (0.5 * (a.value + b.value)), difference / a.error.hypot(b.error)]
        };
        let all: Vec<[f64; 2]> = pairs.map(difference).filter(|d| d[0].is_finite()).collect();
        all.into_iter().fold([0.0_f64; 2], |most, d| if d[0] > most[0] { d } else { most })
    };
    let [difference, z] = contradiction(&classes.mosaic);
    if difference < MIN_PHASE_DIFFERENCE || z < PHASE_Z_THRESHOLD {
        return Ok(());
    }
    let shifts = (0..rows).flat_map(|row| (0..cols).map(move |col| (row, col)));
    let mut agreeing: Vec<String> = shifts
        .map(|(row, col)| classes.mosaic.shifted(row, col))
        .filter(|mosaic| contradiction(mosaic)[0] * MAX_PHASE_RATIO < difference)
        .map(|mosaic| mosaic.to_string())
        .collect();
    agreeing.dedup();
    let error = Error::new(ErrorKind::Input, &level.name)
        .found(format_args!(
            "rates that differ by {:.0} % between pixels with the same filter of the mosaic {}",
            100.0 * difference,
            classes.mosaic
        ))
        .expected("equal mean rates of equal filters");
    Err(match agreeing.is_empty() {
        true => error.remedy("correct the mosaic, or state none"),
        false => error.remedy(format_args!(
            "state the mosaic {}, whose phase agrees with the rates",
            agreeing.join(" or ")
        )),
    })
}

/// Returns the median of `values` with its standard error, from the median absolute deviation of normal values.
fn median_with_error(values: &mut [f64]) -> Estimate {
    let samples = values.len();
    let (value, spread) = spikelane_measure::median_and_spread(values);
    // The error of a median is sqrt(pi / 2) times the error of a mean.
    let error = spread * (std::f64::consts::FRAC_PI_2 / samples as f64).sqrt();
    Estimate { value, error: error.max(f64::MIN_POSITIVE), samples }
}
