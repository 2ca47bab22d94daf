//! Tests of maps, summaries and spectra with synthetic streams.

use crate::measure_support::{Stream, uniform};
use rand_pcg::Pcg64Mcg;
use rand_pcg::rand_core::SeedableRng;
use spikelane_measure::{
    Estimate, MeasureOptions, border_excess, dsnu_prnu, high_pass, line_structure, map_correlations, median,
    median_and_spread, select_uniform, summarize, tiled_mean,
};

const SIDE: usize = 96;

/// Returns a map of uniformly distributed white noise with mean 1 and standard deviation `sd`.
fn white(sd: f64, seed: u64) -> Vec<f64> {
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let reach = sd * 12.0_f64.sqrt();
    (0..SIDE * SIDE).map(|_| 1.0 + reach * (uniform(&mut random) - 0.5)).collect()
}

/// Multiplies each pixel of a map by `factor(row, column)`.
fn shaped(map: &[f64], factor: impl Fn(usize, usize) -> f64) -> Vec<f64> {
    let pixel = |(p, x): (usize, &f64)| x * factor(p / SIDE, p % SIDE);
    map.iter().enumerate().map(pixel).collect()
}

#[test]
fn medians_are_those_of_small_sets() {
    assert_eq!(median(&mut [3.0, 1.0, 2.0]), 2.0);
    assert_eq!(median(&mut [4.0, 1.0, 2.0, 3.0]), 2.5);
    assert!(median(&mut []).is_nan());
    let (center, spread) = median_and_spread(&mut [1.0, 2.0, 3.0, 4.0, 100.0]);
    assert_eq!((center, spread), (3.0, 1.4826));
}

#[test]
fn errors_of_means_of_white_noise_are_sd_over_root_n() {
    // The mean of 9216 pixels with sd 0.1 has the standard error 0.00104. An error estimated from 144 tiles scatters by
    // 6 %, so four standard deviations are about 0.25.
    let map = white(0.1, 1);
    let expected = 0.1 / SIDE as f64;
    for estimate in [Estimate::mean(map.iter().copied()), tiled_mean(&map, SIDE, 8)] {
        assert!((estimate.error / expected - 1.0).abs() < 0.25, "{estimate:?}");
        assert!(estimate.sigmas_from(1.0).abs() < 4.0, "{estimate:?}");
    }
}

#[test]
fn a_high_pass_keeps_white_noise_and_removes_gradients() {
    let noise = white(0.02, 2);
    let tilted = shaped(&noise, |r, c| 1.0 + 0.002 * r as f64 + 0.001 * c as f64);
    let left = high_pass(&tilted, SIDE);
    // The filter removes a gradient exactly only if the whole box of the pixel is inside the map.
    let inner = |p: &usize| (2..SIDE - 2).contains(&(p / SIDE)) && (2..SIDE - 2).contains(&(p % SIDE));
    let sd = |map: &[f64]| {
        let all = Estimate::mean((0..map.len()).filter(inner).map(|p| map[p]));
        all.error * (all.samples as f64).sqrt()
    };
    // The tilt multiplies the noise of each pixel by a factor. The root mean square of this factor over the map is
    // 1.14.
    assert!((sd(&left) / (0.02 * 1.144) - 1.0).abs() < 0.03, "{}", sd(&left));
}

/// Returns a map with `height` rows in which every seventh pixel is missing.
fn with_gaps(width: usize, height: usize) -> Vec<f64> {
    let mut random = Pcg64Mcg::seed_from_u64(width as u64);
    let value = |p: usize, u: f64| if p % 7 == 3 { f64::NAN } else { 1.0 + u };
    (0..width * height).map(|p| value(p, uniform(&mut random))).collect()
}

fn near(actual: f64, expected: f64) -> bool {
    actual.is_nan() && expected.is_nan() || (actual - expected).abs() < 1e-12
}

#[test]
fn a_high_passed_pixel_is_its_value_less_the_mean_of_its_box() {
    // Two sums of 25 values between 1 and 2 in different order differ by at most 25 roundings of 2^-48. A pixel in the
    // wrong box changes the sum by far more than 1e-12.
    for (width, height) in (1..9).flat_map(|w| (1..9).map(move |h| (w, h))) {
        let map = with_gaps(width, height);
        for (p, value) in high_pass(&map, width).into_iter().enumerate() {
            let (row, column) = (p / width, p % width);
            let within = |q: &usize| row.abs_diff(q / width) <= 2 && column.abs_diff(q % width) <= 2;
            let near_by: Vec<f64> =
                (0..map.len()).filter(within).map(|q| map[q]).filter(|x| x.is_finite()).collect();
            let n = near_by.len() as f64;
            let expected = (map[p] - near_by.iter().sum::<f64>() / n) * (n / (n - 1.0)).sqrt();
            let expected = if n < 2.0 { f64::NAN } else { expected };
            assert!(near(value, expected), "{width}x{height}, pixel {p}: {value}, {expected}");
        }
    }
}

#[test]
fn lines_and_correlations_leave_missing_pixels_out() {
    for (width, height) in [(9, 8), (4, 11), (23, 2)] {
        let map = with_gaps(width, height);
        let mean = |pixels: &mut dyn Iterator<Item = usize>| Estimate::mean(pixels.map(|p| map[p])).value;
        let lines = line_structure(&map, width);
        for (r, value) in lines.rows.iter().enumerate() {
            assert!(near(*value, mean(&mut (r * width..(r + 1) * width))), "row {r}");
        }
        for (c, value) in lines.columns.iter().enumerate() {
            assert!(near(*value, mean(&mut (c..map.len()).step_by(width))), "column {c}");
        }
        let all = Estimate::mean(map.iter().copied());
        let variance = all.error * all.error * all.samples as f64;
        let rho = map_correlations(&map, width);
        let shifts = [(0, 1), (1, 0), (1, 1), (1, -1)];
        for (correlation, (down, right)) in
            [rho.right, rho.lower, rho.diagonal, rho.antidiagonal].into_iter().zip(shifts)
        {
            let product = |p: usize| {
                let column = (p % width).checked_add_signed(right).filter(|c| *c < width)?;
                let other = map.get((p / width + down) * width + column)?;
                Some((map[p] - all.value) * (other - all.value)).filter(|x| x.is_finite())
            };
            let expected = Estimate::mean((0..map.len()).filter_map(product));
            assert_eq!(correlation.samples, expected.samples);
            assert!(near(correlation.value, expected.value / variance), "{down}, {right}: {correlation:?}");
        }
    }
}

#[test]
fn row_and_column_patterns_are_measured_apart() {
    // Columns alternate by +-1 %. The high-pass uses a box of 5 columns and a scale factor. It multiplies an alternation
    // by 1 -+ 1/5, which is at most 1.07 in root mean square.
    let map = shaped(&white(0.02, 3), |_, c| if c % 2 == 0 { 1.01 } else { 0.99 });
    let lines = line_structure(&map, SIDE);
    assert!((0.008..0.012).contains(&lines.column_sd.value), "{:?}", lines.column_sd);
    // The mean of 96 pixels with sd 0.02 has the sd 0.002. After the pixel noise is subtracted, the sd must be below
    // 0.001.
    assert!(lines.row_sd.value < 0.001, "{:?}", lines.row_sd);
    assert!((lines.columns[0] - lines.columns[1] - 0.02).abs() < 4.0 * 0.003);
    assert_eq!((lines.rows.len(), lines.columns.len()), (SIDE, SIDE));
}

#[test]
fn correlations_of_a_smoothed_map_are_those_of_its_kernel() {
    // Each entry is the sum of a pixel and its right neighbor. The correlation is 1/2 to the right and 0 elsewhere.
    let noise = white(1.0, 4);
    let map: Vec<f64> = (0..noise.len())
        .map(|p| if p % SIDE + 1 < SIDE { noise[p] + noise[p + 1] } else { f64::NAN })
        .collect();
    let correlations = map_correlations(&map, SIDE);
    assert!((correlations.right.value - 0.5).abs() < 5.0 * correlations.right.error, "{correlations:?}");
    // The error of a correlated map is up to sqrt(1.5) times the error of a white map.
    assert!(correlations.lower.sigmas_from(0.0).abs() < 5.0, "{correlations:?}");
    let white = map_correlations(&noise, SIDE);
    for rho in [white.right, white.lower, white.diagonal, white.antidiagonal] {
        assert!(rho.sigmas_from(0.0).abs() < 4.0, "{rho:?}");
    }
    let diagonal: Vec<f64> =
        (0..noise.len()).map(|p| noise[p] + if p > SIDE { noise[p - SIDE - 1] } else { 0.0 }).collect();
    let correlations = map_correlations(&diagonal, SIDE);
    assert!((correlations.diagonal.value - 0.5).abs() < 0.05 && correlations.antidiagonal.value.abs() < 0.05);
}

#[test]
fn uniform_areas_are_selected_and_edges_are_not() {
    let map: Vec<f64> = (0..SIDE * SIDE).map(|p| if p % SIDE < 40 { 0.2 } else { 0.5 }).collect();
    let even = select_uniform(&map, SIDE, &(0.1..0.3), 2, 0.05);
    // If a box extends one column past the edge of the area, a fifth of its pixels are outside. Its median and median
    // deviation are then still those of the area. If three fifths were outside, both would change.
    assert_eq!(even.len(), 40 * SIDE);
    // An area with a standard deviation of 10 % is not uniform, even if its median is in the range.
    let rough: Vec<f64> = white(0.1, 9).iter().map(|x| 0.2 * x).collect();
    assert!(select_uniform(&rough, SIDE, &(0.1..0.3), 2, 0.05).len() < SIDE);
}

#[test]
fn bright_border_lines_are_measured() {
    let map = shaped(&white(0.02, 5), |r, c| match (r, c) {
        (_, 0) => 1.15,
        (r, _) if r == SIDE - 1 => 0.9,
        _ => 1.0,
    });
    let [first, last, top, bottom] = border_excess(&map, SIDE);
    assert!(first.sigmas_from(0.15).abs() < 4.0 && first.error < 0.005, "{first:?}");
    assert!(bottom.sigmas_from(-0.1).abs() < 4.5, "{bottom:?}");
    assert!(last.sigmas_from(0.0).abs() < 4.0 && top.sigmas_from(0.0).abs() < 4.0);
}

#[test]
fn a_summary_recovers_the_simulated_pattern() {
    // The dark rate is 0.01 with an sd of 20 %. The flat rate is 0.2 higher with an sd of 2 %. Four pixels have defects.
    let pixels = SIDE * SIDE;
    let dark: Vec<f64> = white(0.2, 6).iter().map(|x| 0.01 * x).collect();
    let mut flat: Vec<f64> = white(0.02, 7).iter().zip(&dark).map(|(x, d)| 0.2 * x + d).collect();
    flat[1000] = 0.0;
    flat[2000] = 1.0;
    flat[3000] = 0.4;
    flat[4000] = 0.1;
    let measure = |rates: &[f64], readouts| {
        let stream = Stream::integrators(96, 96, readouts, rates, 8);
        summarize(&stream.measure(&MeasureOptions::default(), &[])).unwrap()
    };
    let (dark, flat) = (measure(&dark, 6000), measure(&flat, 2000));
    let defects = &flat.defects;
    assert_eq!((&defects.dead, &defects.stuck), (&vec![1000], &vec![2000]));
    assert_eq!((&defects.hot, &defects.weak), (&vec![3000], &vec![4000]));
    assert_eq!(dark.defects.count(), 0);
    assert!((flat.signal.value - 0.21).abs() < 4.0 * flat.signal.error);
    let (dsnu, prnu) = dsnu_prnu(&dark, &flat);
    assert!(dsnu.sigmas_from(0.002).abs() < 4.0, "{dsnu:?}");
    assert!(prnu.sigmas_from(0.02).abs() < 4.0, "{prnu:?}");
    assert!(prnu.error < 0.02 * 0.02 && dsnu.samples == pixels);
    assert!(flat.phase_noise.unwrap().per_spike.value.abs() < 1e-3);
    // The phase error of a rate f over T readouts is 0.41 f / T.
    assert!((flat.temporal_rate_sd / (0.41 * 0.21 / 2000.0) - 1.0).abs() < 0.1);
}

/// Returns a dark surface with a bright square, a slanted edge that the optics blur over three pixels, and a bright line of
/// one pixel.
fn scene_with_edges(r: usize, c: usize) -> f64 {
    let slanted = (c as f64 - 60.0 - 0.3 * r as f64).clamp(-1.5, 1.5) / 3.0 + 0.5;
    match (r, c) {
        (20..50, 15..45) => 1.8,
        (70, 5..55) => 1.7,
        _ => 0.6 + 0.9 * slanted,
    }
}

#[test]
fn edges_of_a_scene_are_no_defects() {
    let rates: Vec<f64> = shaped(&white(0.02, 21), scene_with_edges).iter().map(|x| 0.2 * x).collect();
    let find = |rates: &[f64]| {
        let stream = Stream::integrators(96, 96, 2000, rates, 22);
        summarize(&stream.measure(&MeasureOptions::default(), &[])).unwrap().defects
    };
    // Only the ends of the line, two pixels each, look like pixels with defects.
    let line_ends = [5, 6, 53, 54].map(|c| 70 * SIDE + c);
    let clean = find(&rates);
    assert!(clean.hot.iter().all(|p| line_ends.contains(p)), "{:?}", clean.hot);
    assert_eq!((clean.weak.len(), clean.dead.len()), (0, 0));
    // Defects inside the square and on the dark side of the slanted edge.
    let mut faulty = rates;
    for (row, col, factor) in [(30, 30, 1.5), (40, 30, 0.5), (30, 66, 4.0)] {
        faulty[row * SIDE + col] *= factor;
    }
    let found = find(&faulty);
    let hot: Vec<usize> = found.hot.into_iter().filter(|p| !line_ends.contains(p)).collect();
    assert_eq!(hot, [(30, 30), (30, 66)].map(|(r, c)| r * SIDE + c));
    assert_eq!(found.weak, [40 * SIDE + 30]);
}

#[test]
fn a_band_cannot_be_summarized() {
    let stream = Stream::bernoulli(8, 8, 20, &[0.5; 64], 1);
    let band = MeasureOptions::default().with_rows(Some(0..4)).with_frames(false);
    let error = summarize(&stream.measure(&band, &[])).unwrap_err();
    assert!(error.to_string().contains("rows 0..4"));
}

#[test]
fn the_spectrum_holds_the_variance_and_shows_a_line() {
    use spikelane_measure::spectrum;
    // The totals are uniform white noise of variance 100, plus a sine of amplitude 5 at frequency 1/50.
    let mut random = Pcg64Mcg::seed_from_u64(11);
    let totals: Vec<u32> = (0..40_000)
        .map(|t| {
            let sine = 5.0 * (std::f64::consts::TAU * f64::from(t) / 50.0).sin();
            (1000.5 + sine + 1200.0_f64.sqrt() * (uniform(&mut random) - 0.5)) as u32
        })
        .collect();
    let measured = spectrum(&totals, 1000).unwrap();
    assert_eq!((measured.segments, measured.power.len()), (79, 501));
    // The variance is 100 + 12.5 + 1/12, where 1/12 is the rounding. 79 segments of 500 bins measure it to below 1 %.
    let all: f64 = measured.power[1..].iter().sum();
    assert!((all / 112.6 - 1.0).abs() < 0.03, "{all}");
    let lines = measured.lines(8.0);
    assert_eq!(lines[0].frequency, 0.02);
    // With a Hann window the central bin contains two thirds of the power of a line, which is 8.33. Noise adds 0.3.
    assert!((lines[0].power - 8.5).abs() < 0.6, "{:?}", lines[0]);
    assert!(lines.iter().all(|l| (l.frequency - 0.02).abs() < 0.0021));
    assert!(spectrum(&totals, 7).is_err() && spectrum(&totals[..10], 16).is_err());
}
