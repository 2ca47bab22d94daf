//! The color filters of a recorded camera, and the classes of its pixels.
//!
//! The pixels of a class have equal filters. Statistics of the pixels are robust only within a class, because the median
//! over several filters is between their rates and is not a linear function of the light.

use spikelane::error::Result;
use spikelane::sensor::Mosaic;

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
