//! Tests statistics of streams whose expectations are known.

use crate::measure_support::Stream;
use rand_pcg::Pcg64Mcg;
use rand_pcg::rand_core::SeedableRng;
use spikelane_measure::{Intervals, MeasureOptions, NeighborPair, Statistics};

const SIDE: u32 = 64;
const PIXELS: usize = 64 * 64;

/// Returns rates that are uniformly distributed in `rate (1 +- spread)`.
fn spread_rates(rate: f64, spread: f64) -> Vec<f64> {
    let mut random = Pcg64Mcg::seed_from_u64(77);
    (0..PIXELS)
        .map(|_| rate * (1.0 + spread * (2.0 * crate::measure_support::uniform(&mut random) - 1.0)))
        .collect()
}

fn ideal(rates: &[f64], readouts: usize) -> Statistics {
    Stream::integrators(SIDE, SIDE, readouts, rates, 3).measure(&MeasureOptions::default(), &[])
}

fn random(rate: f64, readouts: usize) -> Statistics {
    Stream::bernoulli(SIDE, SIDE, readouts, &vec![rate; PIXELS], 4).measure(&MeasureOptions::default(), &[])
}

fn intervals(statistics: &Statistics) -> &Intervals {
    statistics.intervals.as_ref().unwrap()
}

#[test]
fn an_ideal_integrator_has_the_lattice_variance_of_its_rate() {
    // For a mean interval m, the duration of n intervals is floor(n m) or ceil(n m). The variance of this duration is
    // u (1 - u), where u is the fractional part of n m. Estimating m from N = 1440 intervals causes a relative bias
    // below n^2/N^2 = 5e-4. For uniformly distributed rates, the expectation is the average of u (1 - u).
    let rates = spread_rates(0.18, 0.02);
    let statistics = ideal(&rates, 8000);
    for lag in [1, 4, 8, 16, 24, 32] {
        let lattice = |f: &f64| (f64::from(lag) / f).fract() * (1.0 - (f64::from(lag) / f).fract());
        let expected = crate::measure_support::mean(&rates.iter().map(lattice).collect::<Vec<_>>());
        let variance = intervals(&statistics).lag_variance(lag, None);
        // `variance` and `expected` use the same pixels. They differ by the bias and by the sampling error of u (1 - u)
        // for N = 1440 intervals. The sampling error is about 0.25/sqrt(N) = 0.25/38 per pixel, so 0.25/38/64 for the
        // mean of 64^2 pixels.
        assert!((variance.value - expected).abs() < 4e-4, "{lag}: {variance:?} against {expected}");
    }
}

#[test]
fn an_ideal_integrator_keeps_to_floor_and_ceiling() {
    let statistics = ideal(&spread_rates(0.3, 0.4), 3000);
    let off = intervals(&statistics).off_lattice_share(None);
    assert_eq!((off.value, off.samples), (0.0, PIXELS));
    let (short, long) = intervals(&statistics).short_and_long_shares(None);
    // Rates are 0.18 to 0.42, so intervals are 2 to 6 readouts. A short interval of 2 requires a mean above 3.33. A long
    // interval of 4 requires a mean below 2.5. Both are impossible.
    assert_eq!((short.value, long.value), (0.0, 0.0));
}

#[test]
fn time_based_rates_are_as_precise_as_stated() {
    // A rate f from N spikes has the error f^2 sqrt(V) / (N - 1), where V is the variance of the time from the first to
    // the last spike. The average of V over the rates is 1/6. The relative sampling error of the root mean square over
    // 4096 pixels is about 1 %, because the distribution has light tails.
    let rates = spread_rates(0.2, 0.1);
    let statistics = ideal(&rates, 4000);
    let rates_by_time = statistics.counts.unwrap().rate_by_time();
    let relative: Vec<f64> = rates_by_time.iter().zip(&rates).map(|(a, b)| (a / b - 1.0).powi(2)).collect();
    let rms = crate::measure_support::mean(&relative).sqrt() * 4000.0;
    assert!((rms - (1.0_f64 / 6.0).sqrt()).abs() < 0.02, "{rms} / T");
}

#[test]
fn independent_bits_have_geometric_intervals() {
    // Intervals are independent with P(n) = p (1-p)^(n-1) and variance (1-p)/p^2. Each of 4096 pixels has N = 900
    // intervals. The expectation of D(n) is n (1 - n/N) times the variance. Each estimate must be within 4 standard
    // errors.
    let (p, readouts) = (0.3, 3000);
    let statistics = random(p, readouts);
    let measured = intervals(&statistics);
    let variance = (1.0 - p) / (p * p);
    for lag in [1, 4, 8, 16, 24, 32] {
        let raw = measured.lag_variance(lag, None);
        let n = f64::from(lag);
        let biased = variance * n * (1.0 - n / (f64::from(readouts as u32) * p));
        assert!(raw.sigmas_from(biased).abs() < 4.0, "{lag}: {raw:?} {biased}");
        let unbiased = measured.unbiased_lag_variance(lag, None);
        assert!(unbiased.sigmas_from(n * variance).abs() < 4.0, "{lag}: {unbiased:?}");
    }
    let noise = measured.decompose(None);
    assert!(noise.per_spike.sigmas_from(variance).abs() < 4.0, "{noise:?}");
    assert!(noise.constant.sigmas_from(0.0).abs() < 4.0, "{noise:?}");
    for lag in [1, 2] {
        let auto = measured.autocovariance(lag, None);
        let bias = -variance / (p * readouts as f64);
        assert!(auto.sigmas_from(bias).abs() < 4.0, "{auto:?}");
    }
    for length in 1..12 {
        let share = measured.histogram().share(length);
        let expected = p * (1.0 - p).powi(length as i32 - 1);
        // The end of the stream cuts off mostly long intervals. For N = 900 intervals, the relative bias of a share is
        // of order 1/N, which is 1e-3.
        let allowed = 4.0 * share.error + 2e-3 * expected;
        assert!((share.value - expected).abs() < allowed, "{length}: {share:?} {expected}");
    }
}

#[test]
fn the_unbiased_lag_variance_is_exact_in_a_short_stream() {
    // N = 58 is the number of intervals in a recording of 300 readouts. The raw D(32) of an ideal integrator is a quarter
    // too large. For rates that vary by +-5 %, the mean lattice variance at lags of 8 and more is 1/6 to within 2 %.
    let statistics = ideal(&spread_rates(0.195, 0.05), 300);
    let measured = intervals(&statistics);
    for lag in [16, 24, 32] {
        let raw = measured.lag_variance(lag, None);
        let corrected = measured.unbiased_lag_variance(lag, None);
        let miss = |x: f64| (x - 1.0 / 6.0).abs() * 6.0;
        assert!(miss(corrected.value) < 0.05, "{lag}: {corrected:?}");
        if lag == 32 {
            assert!(miss(raw.value) > 0.15, "{raw:?}");
        }
    }
}

#[test]
fn independent_pixels_do_not_coincide_more_than_chance() {
    for statistics in [random(0.2, 2000), ideal(&spread_rates(0.2, 0.1), 2000)] {
        let counts = statistics.counts.unwrap();
        for pair in NeighborPair::ALL {
            let rho = counts.correlation(pair);
            assert!(rho.value.abs() < 4.0 * rho.error, "{pair:?} {rho:?}");
            // There are 4032 pairs and 2000 readouts. Independent bits have an error of 1/sqrt(8e6) = 3.5e-4. The phase between
            // two integrators changes slowly, so one pair can have a correlation of up to 1. The error is then below
            // 1/sqrt(4032).
            assert!(rho.error > 2e-4 && rho.error < 1.6e-2, "{pair:?} {rho:?}");
        }
    }
}

#[test]
fn copied_spikes_show_as_coincidence_at_their_lag() {
    // Each pixel in an odd column repeats 5 % of the spikes of its left neighbor one readout later. For such a pixel
    // and its left neighbor, the correlation is about 0.05 (1 - p) = 0.045, where p = 0.1 is the spike probability.
    let mut stream = Stream::bernoulli(SIDE, SIDE, 1500, &vec![0.1; PIXELS], 9);
    let copies = Stream::bernoulli(SIDE, SIDE, 1500, &vec![0.05; PIXELS], 10);
    for t in (1..1500).rev() {
        for p in (0..PIXELS).filter(|p| p % 64 % 2 == 1) {
            stream.frames[t][p] |= stream.frames[t - 1][p - 1] && copies.frames[t][p];
        }
    }
    let counts = stream.measure(&MeasureOptions::without_intervals(), &[]).counts.unwrap();
    let rho = counts.correlation(NeighborPair::RightAfter);
    // 32 of 63 pairs per row have copies. The OR with the pixel's own spikes removes a tenth of the copies, so the
    // correlation is 0.05 * 0.9 * 32/63 = 0.0229. The copies raise the variance of their pixels, which reduces the
    // correlation by 2 %.
    assert!((rho.value - 0.0226).abs() < 4.0 * rho.error + 4e-4, "{rho:?}");
    assert!(rho.value > 20.0 * rho.error, "{rho:?}");
    for pair in
        [NeighborPair::Right, NeighborPair::RightBefore, NeighborPair::Lower, NeighborPair::LowerAfter]
    {
        let other = counts.correlation(pair);
        assert!(other.value.abs() < 4.0 * other.error, "{pair:?} {other:?}");
    }
}

#[test]
fn totals_of_independent_bits_are_binomial() {
    let statistics = random(0.2, 3000);
    let frames = statistics.frames.unwrap();
    let n = PIXELS as f64;
    assert!(frames.total_variance().sigmas_from(0.16 * n).abs() < 4.0);
    for covariance in [frames.row_covariance(), frames.column_covariance()] {
        assert!(covariance.sigmas_from(0.0).abs() < 4.0, "{covariance:?}");
    }
    let transient = frames.start_transient(32).unwrap();
    assert!(transient.sigmas_from(0.0).abs() < 4.0, "{transient:?}");
}

#[test]
fn noise_of_single_rows_shows_and_flicker_does_not() {
    // Rates at each readout are 0.2 +- 0.05. The sign is drawn for each row (`per_row`), or once for all rows (flicker).
    // The covariance of two halves of 32 pixels is (32 * 0.05)^2 = 2.56.
    let mut random = Pcg64Mcg::seed_from_u64(12);
    let mut sign = move || {
        if crate::measure_support::uniform(&mut random) < 0.5 { -0.05 } else { 0.05 }
    };
    for per_row in [true, false] {
        let mut dice = Pcg64Mcg::seed_from_u64(13);
        let frames = (0..2000)
            .map(|_| {
                let flicker = sign();
                let rows: Vec<f64> = (0..64).map(|_| if per_row { sign() } else { flicker }).collect();
                let fires = |p: usize| crate::measure_support::uniform(&mut dice) < 0.2 + rows[p / 64];
                (0..PIXELS).map(fires).collect()
            })
            .collect();
        let stream = Stream::from_frames(SIDE, SIDE, frames);
        let frames = stream.measure(&MeasureOptions::frames_only(), &[]).frames.unwrap();
        let expected = if per_row { 2.56 } else { 0.0 };
        let covariance = frames.row_covariance();
        assert!(covariance.sigmas_from(expected).abs() < 4.0, "{per_row} {covariance:?}");
        assert!(covariance.error < 0.05);
    }
}

#[test]
fn a_repeated_readout_is_found() {
    let mut stream = Stream::integrators(SIDE, SIDE, 2000, &spread_rates(0.2, 0.05), 6);
    let copy = stream.frames[1200].clone();
    stream.frames.insert(1201, copy);
    let frames = stream.measure(&MeasureOptions::frames_only(), &[]).frames.unwrap();
    let nearest = frames.min_distance().unwrap();
    assert_eq!((nearest.readout, nearest.value), (1201, 0));
}
