//! The values of a parameter that a diagnosis tries.

/// The scale on which a diagnosis varies a parameter.
///
/// # Examples
/// ```
/// use spikelane::effects;
/// use spikelane::effects::definition::SearchScale;
/// let noise = effects::find("comparator_noise")?;
/// // The variance of the intervals is proportional to the square of the standard deviation.
/// let (sigma, search) = noise.searched_params().next().expect("a diagnosis searches this effect");
/// assert_eq!((sigma.key, search.scale), ("sigma", SearchScale::Square));
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SearchScale {
    /// Linear: the statistics change in proportion to the parameter.
    Linear,
    /// Square: the statistics change in proportion to the square of the parameter. This scale is for standard
    /// deviations.
    Square,
    /// Logarithm, for shapes such as time constants.
    Log,
    /// Logarithm of `1 - x`. The parameter `x` is the share of a quantity that remains after one readout.
    LogComplement,
}

/// The values of a parameter that a diagnosis tries, their range and their scale.
///
/// In the list of an effect's parameters, the first parameter with a search specification is the amplitude. Further
/// parameters with a search specification describe the shape. A diagnosis tries all combinations of the start values.
///
/// Start values of an amplitude increase from weak to strong. At each start value the effect is clearly visible but still
/// nearly linear. The range contains every plausible sensor.
///
/// # Examples
/// ```
/// use spikelane::effects;
/// for effect in effects::ALL {
///     for (param, search) in effect.searched_params() {
///         let (low, high) = search.range;
///         assert!(search.values.iter().all(|value| (low..=high).contains(value)), "{}", param.key);
///     }
/// }
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct SearchSpec {
    /// Scale on which the parameter varies.
    pub scale: SearchScale,
    /// Smallest and largest value.
    pub range: (f64, f64),
    /// Start values. If the list is empty, the only start value is the length of the recording in readouts.
    pub values: &'static [f64],
    /// Whether the parameter is the frequency, in hertz, at which the light oscillates. Oscillating light adds a line
    /// to the spectrum of the frame totals.
    pub is_frequency: bool,
}

impl SearchSpec {
    const fn new(scale: SearchScale, range: (f64, f64), values: &'static [f64]) -> Self {
        assert!(range.0 <= range.1, "a range from the smaller to the larger value");
        Self { scale, range, values, is_frequency: false }
    }

    /// Returns a specification for a strength. The statistics change in proportion to the strength.
    ///
    /// # Examples
    /// ```
    /// use spikelane::effects::{SearchSpec, definition::SearchScale};
    /// const SHARE: SearchSpec = SearchSpec::amplitude((0.0, 0.06), &[0.002, 0.02]);
    /// assert_eq!((SHARE.scale, SHARE.range), (SearchScale::Linear, (0.0, 0.06)));
    /// ```
    #[must_use]
    pub const fn amplitude(range: (f64, f64), values: &'static [f64]) -> Self {
        Self::new(SearchScale::Linear, range, values)
    }

    /// Returns a specification for a standard deviation. The statistics change in proportion to its square.
    ///
    /// # Examples
    /// ```
    /// use spikelane::effects::{SearchSpec, definition::SearchScale};
    /// const SIGMA: SearchSpec = SearchSpec::deviation((0.0, 0.1), &[0.01]);
    /// assert_eq!((SIGMA.scale, SIGMA.values), (SearchScale::Square, &[0.01][..]));
    /// ```
    #[must_use]
    pub const fn deviation(range: (f64, f64), values: &'static [f64]) -> Self {
        Self::new(SearchScale::Square, range, values)
    }

    /// Returns a specification for a positive shape: a time constant, a length or a share of the pixels.
    ///
    /// # Examples
    /// ```
    /// use spikelane::effects::{SearchSpec, definition::SearchScale};
    /// const LENGTH_PX: SearchSpec = SearchSpec::shape((1.0, 100.0), &[3.0, 30.0]);
    /// assert_eq!((LENGTH_PX.scale, LENGTH_PX.values.len()), (SearchScale::Log, 2));
    /// ```
    #[must_use]
    pub const fn shape(range: (f64, f64), values: &'static [f64]) -> Self {
        Self::new(SearchScale::Log, range, values)
    }

    /// Returns a specification for a retention: the fraction of a quantity that remains after one readout, below one.
    ///
    /// # Examples
    /// ```
    /// use spikelane::effects::{SearchSpec, definition::SearchScale};
    /// const RETENTION: SearchSpec = SearchSpec::retention((0.0, 0.999), &[0.9, 0.99]);
    /// assert_eq!(RETENTION.scale, SearchScale::LogComplement);
    /// ```
    #[must_use]
    pub const fn retention(range: (f64, f64), values: &'static [f64]) -> Self {
        Self::new(SearchScale::LogComplement, range, values)
    }

    /// Returns a specification for a frequency of the light, in hertz.
    ///
    /// # Examples
    /// ```
    /// use spikelane::effects::SearchSpec;
    /// const MAINS_HZ: SearchSpec = SearchSpec::frequency((50.0, 120.0), &[100.0, 120.0]);
    /// assert!(MAINS_HZ.is_frequency);
    /// assert!(!SearchSpec::shape(MAINS_HZ.range, MAINS_HZ.values).is_frequency);
    /// ```
    #[must_use]
    pub const fn frequency(range: (f64, f64), values: &'static [f64]) -> Self {
        Self { is_frequency: true, ..Self::new(SearchScale::Log, range, values) }
    }

    /// Returns a specification for a duration in readouts. The start value is the length of the recording.
    ///
    /// # Examples
    /// ```
    /// let duration = spikelane::effects::SearchSpec::recording_length();
    /// // The only start value is the length of the recording.
    /// assert!(duration.values.is_empty());
    /// ```
    #[must_use]
    pub const fn recording_length() -> Self {
        Self::new(SearchScale::Log, (1.0, 1e9), &[])
    }
}
