//! Spectra of the pattern of a map along its rows and its columns, and histograms of its values.

use realfft::RealFftPlanner;

/// Returns the amplitude spectra of a row-major map along the rows and along the columns.
///
/// An entry is a frequency in cycles per pixel, from above 0 to 1/2, and the amplitude: the root of the mean over the lines
/// of `|FFT|^2 / n`, where `n` is the length of a line. White noise with the standard deviation `s` has the amplitude `s` at
/// every frequency, as in the spectrograms of EMVA 1288. The mean of the map is subtracted first. Values that are not finite
/// count as the mean.
///
/// # Examples
/// ```
/// // Alternating columns have all their power at half a cycle per pixel along the rows.
/// let map: Vec<f64> = (0..64).map(|i| if i % 2 == 0 { 1.0 } else { -1.0 }).collect();
/// let [rows, columns] = spikelane_measure::pattern_spectra(&map, 8);
/// assert_eq!(rows.last().unwrap().0, 0.5);
/// assert!((rows.last().unwrap().1 - 8f64.sqrt()).abs() < 1e-9 && rows[0].1 < 1e-9);
/// assert!(columns.iter().all(|c| c.1 < 1e-9));
/// ```
#[must_use]
pub fn pattern_spectra(map: &[f64], width: usize) -> [Vec<(f64, f64)>; 2] {
    let height = map.len().checked_div(width).unwrap_or(0);
    let finite = crate::finite_values(map);
    let mean = finite.iter().sum::<f64>() / finite.len().max(1) as f64;
    let at = |row: usize, column: usize| {
        let value = map[row * width + column];
        if value.is_finite() { value - mean } else { 0.0 }
    };
    let rows = amplitudes(width, (0..height).map(|r| (0..width).map(|c| at(r, c)).collect()));
    let columns = amplitudes(height, (0..width).map(|c| (0..height).map(|r| at(r, c)).collect()));
    [rows, columns]
}

fn amplitudes(length: usize, lines: impl Iterator<Item = Vec<f64>>) -> Vec<(f64, f64)> {
    if length < 2 {
        return Vec::new();
    }
    let transform = RealFftPlanner::<f64>::new().plan_fft_forward(length);
    let mut bins = transform.make_output_vec();
    let (mut power, mut count) = (vec![0.0; bins.len()], 0.0);
    for mut line in lines {
        // The buffers have the lengths of the plan, so the transform does not fail.
        if transform.process(&mut line, &mut bins).is_ok() {
            power.iter_mut().zip(&bins).for_each(|(p, b)| *p += b.norm_sqr());
            count += 1.0;
        }
    }
    let amplitude = |p: &f64| (p / length as f64 / f64::max(count, 1.0)).sqrt();
    power.iter().enumerate().skip(1).map(|(k, p)| (k as f64 / length as f64, amplitude(p))).collect()
}

/// Returns the centers and the shares of `bins` equal bins between the 0.1th and the 99.9th percentile of a map. Values that are not
/// finite are ignored.
///
/// # Examples
/// ```
/// let map: Vec<f64> = (0..1000).map(f64::from).collect();
/// let bins = spikelane_measure::map_histogram(&map, 10);
/// assert!(bins.len() == 10 && (bins[4].1 - 0.1).abs() < 0.002);
/// ```
#[must_use]
pub fn map_histogram(map: &[f64], bins: usize) -> Vec<(f64, f64)> {
    let mut sorted = crate::finite_values(map);
    sorted.sort_by(f64::total_cmp);
    let at = |share: f64| sorted.get((share * sorted.len() as f64) as usize).copied().unwrap_or(0.0);
    // If all values are equal, the range is widened, because the bin width must not be 0.
    let (low, high) = (at(0.001), at(0.999).max(at(0.001) * (1.0 + 1e-3) + 1e-9));
    let step = (high - low) / bins.max(1) as f64;
    let mut shares = vec![0.0; bins.max(1)];
    let last = shares.len() - 1;
    for x in sorted.iter().filter(|x| (low..=high).contains(*x)) {
        shares[(((x - low) / step) as usize).min(last)] += 1.0 / sorted.len() as f64;
    }
    shares.iter().enumerate().map(|(i, n)| (low + (i as f64 + 0.5) * step, *n)).collect()
}
