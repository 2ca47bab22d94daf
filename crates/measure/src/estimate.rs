//! Estimates with standard errors, and robust statistics of maps.

/// A value with its standard error.
///
/// # Examples
/// ```
/// use spikelane_measure::Estimate;
/// let estimate = Estimate { value: 10.3, error: 0.1, samples: 25 };
/// assert!((estimate.sigmas_from(10.0) - 3.0).abs() < 1e-9);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Estimate {
    /// The value; NaN if nothing was measured.
    pub value: f64,
    /// The standard error; NaN if the data do not determine it.
    pub error: f64,
    /// Number of samples (pixels, pairs, rows).
    pub samples: usize,
}

impl Estimate {
    /// Returns the mean of the finite samples.
    ///
    /// The standard error is `sd / sqrt(n)`, where `sd^2` is the unbiased variance. It is valid for independent
    /// samples.
    ///
    /// # Examples
    /// ```
    /// use spikelane_measure::Estimate;
    /// let mean = Estimate::mean([1.0, 2.0, 3.0, f64::NAN]);
    /// // The variance of three samples is 1, so the error of the mean is 1 / sqrt(3).
    /// assert_eq!((mean.value, mean.samples), (2.0, 3));
    /// assert!((mean.error - 1.0 / 3f64.sqrt()).abs() < 1e-12);
    /// ```
    #[must_use]
    pub fn mean(samples: impl IntoIterator<Item = f64>) -> Self {
        // Welford's update needs one pass. It loses no digits if the mean is large.
        let (mut n, mut mean, mut squares) = (0_usize, 0.0, 0.0);
        for x in samples.into_iter().filter(|x| x.is_finite()) {
            n += 1;
            let delta = x - mean;
            mean += delta / n as f64;
            squares += delta * (x - mean);
        }
        let value = if n == 0 { f64::NAN } else { mean };
        let error = match n {
            0 | 1 => f64::NAN,
            n => (squares / (n as f64 - 1.0) / n as f64).sqrt(),
        };
        Self { value, error, samples: n }
    }

    /// Returns the number of standard errors by which the value exceeds `expected`.
    #[must_use]
    pub fn sigmas_from(self, expected: f64) -> f64 {
        (self.value - expected) / self.error
    }
}

/// Returns the ratio of two sums over pixels, `r = X / Y`. The standard error comes from the scatter of square tiles.
///
/// `side` is the side of a tile in pixels. Tile `b` of `B` tiles adds `x_b` to `X` and `y_b` to `Y`. The standard error
/// of `r = X / Y` is `sqrt(B/(B-1) sum (x_b - r y_b)^2) / |Y|`. This is the linearized ratio estimator, the closed form
/// of a bootstrap over tiles.
pub(super) fn tiled_ratio(
    pixels: usize,
    width: usize,
    side: usize,
    of_pixel: impl Fn(usize) -> Option<(f64, f64)>,
) -> Estimate {
    let across = width.div_ceil(side);
    let mut tiles = vec![(0.0, 0.0, 0_usize); across * (pixels / width).div_ceil(side)];
    for p in 0..pixels {
        if let Some((x, y)) = of_pixel(p) {
            let tile = &mut tiles[p / width / side * across + p % width / side];
            *tile = (tile.0 + x, tile.1 + y, tile.2 + 1);
        }
    }
    tiles.retain(|tile| tile.2 > 0);
    let x: f64 = tiles.iter().map(|t| t.0).sum();
    let y: f64 = tiles.iter().map(|t| t.1).sum();
    let value = x / y;
    let squares: f64 = tiles.iter().map(|t| (t.0 - value * t.1).powi(2)).sum();
    let b = tiles.len() as f64;
    let error = if tiles.len() < 2 { f64::NAN } else { (b / (b - 1.0) * squares).sqrt() / y.abs() };
    Estimate { value, error, samples: tiles.iter().map(|t| t.2).sum() }
}

/// Returns the mean of the finite entries of a row-major map. `width` is the number of entries per row.
///
/// The standard error comes from the scatter of tiles of `side` x `side` pixels. It is valid if entries more than one
/// tile apart are uncorrelated.
#[must_use]
pub fn tiled_mean(map: &[f64], width: usize, side: usize) -> Estimate {
    let of_pixel = |p: usize| map[p].is_finite().then_some((map[p], 1.0));
    tiled_ratio(map.len(), width, side.max(1), of_pixel)
}

/// Returns the finite entries of a map.
#[must_use]
pub fn finite_values(map: &[f64]) -> Vec<f64> {
    map.iter().copied().filter(|x| x.is_finite()).collect()
}

/// Returns the median of finite values, or NaN if `values` is empty. Reorders the values.
///
/// For an even number of values the median is the mean of the two middle values.
///
/// # Examples
/// ```
/// assert_eq!(spikelane_measure::median(&mut [3.0, 1.0, 100.0]), 3.0);
/// assert_eq!(spikelane_measure::median(&mut [4.0, 1.0, 3.0, 2.0]), 2.5);
/// assert!(spikelane_measure::median(&mut []).is_nan());
/// ```
#[must_use]
pub fn median(values: &mut [f64]) -> f64 {
    let (n, upper) = (values.len(), upper_median(values));
    if n == 0 || n % 2 == 1 {
        return upper;
    }
    let lower = values[..n / 2].iter().copied().fold(f64::NEG_INFINITY, f64::max);
    f64::midpoint(lower, upper)
}

/// Returns the median of an odd number of values, or the larger middle value of an even number of values. Returns NaN if
/// `values` is empty. Reorders the values.
pub fn upper_median(values: &mut [f64]) -> f64 {
    match values.len() {
        0 => f64::NAN,
        n => *values.select_nth_unstable_by(n / 2, f64::total_cmp).1,
    }
}

/// Returns the median and a robust standard deviation. Reorders the values.
///
/// The robust deviation is `1.4826` times the median absolute deviation. For a normal distribution it equals the
/// standard deviation, and its relative standard error is `1.17 / sqrt(n)` for `n` values.
///
/// # Examples
/// ```
/// // The outlier changes neither the median nor the robust deviation.
/// let (median, spread) = spikelane_measure::median_and_spread(&mut [1.0, 2.0, 3.0, 4.0, 1000.0]);
/// assert_eq!((median, spread), (3.0, 1.4826));
/// ```
#[must_use]
pub fn median_and_spread(values: &mut [f64]) -> (f64, f64) {
    let center = median(values);
    let mut deviations: Vec<f64> = values.iter().map(|x| (x - center).abs()).collect();
    (center, 1.4826 * median(&mut deviations))
}
