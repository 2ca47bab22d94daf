//! Where a diagnosis tries a number of an effect.

/// How steps of a diagnosis become values of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// In proportion: statistics follow the number.
    Linear,
    /// By the square: statistics follow the square of a deviation.
    Square,
    /// By the logarithm: shapes such as time constants.
    Log,
    /// By the logarithm of what is missing to one: what a readout keeps.
    Kept,
}

/// Where a diagnosis tries a number, and how it turns it. The first number of an effect that is tried is its
/// amplitude, the others are its shape; all combinations of their values are tried.
///
/// Values of an amplitude lie where the effect is plain but still nearly linear, weak ones first; the range is the widest in which
/// a sensor is thinkable.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Tried {
    /// How it turns.
    pub scale: Scale,
    /// Smallest and largest value.
    pub range: (f64, f64),
    /// Values to begin at; without any it is the length of the recording in readouts.
    pub values: &'static [f64],
    /// Whether it is a frequency in hertz at which the light swings, so that the totals of frames show it as a line.
    pub is_line: bool,
}

impl Tried {
    const fn new(scale: Scale, range: (f64, f64), values: &'static [f64]) -> Self {
        assert!(range.0 <= range.1, "a range from the smaller to the larger value");
        Self { scale, range, values, is_line: false }
    }

    /// A strength that statistics follow in proportion.
    #[must_use]
    pub const fn amplitude(range: (f64, f64), values: &'static [f64]) -> Self {
        Self::new(Scale::Linear, range, values)
    }

    /// A strength whose square statistics follow: a standard deviation.
    #[must_use]
    pub const fn deviation(range: (f64, f64), values: &'static [f64]) -> Self {
        Self::new(Scale::Square, range, values)
    }

    /// A shape above zero: a time constant, a length, a share of the pixels.
    #[must_use]
    pub const fn shape(range: (f64, f64), values: &'static [f64]) -> Self {
        Self::new(Scale::Log, range, values)
    }

    /// A shape below one: what a readout keeps.
    #[must_use]
    pub const fn kept(range: (f64, f64), values: &'static [f64]) -> Self {
        Self::new(Scale::Kept, range, values)
    }

    /// A frequency at which the light swings, in hertz.
    #[must_use]
    pub const fn line(range: (f64, f64), values: &'static [f64]) -> Self {
        Self { is_line: true, ..Self::new(Scale::Log, range, values) }
    }

    /// A duration that is the length of the recording.
    #[must_use]
    pub const fn recording_length() -> Self {
        Self::new(Scale::Log, (1.0, 1e9), &[])
    }
}
