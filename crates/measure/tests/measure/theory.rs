//! Statistics of streams whose statistics are known.

use crate::measure_support::Stream;
use rand_pcg::Pcg64Mcg;
use rand_pcg::rand_core::SeedableRng;
use spikelane_measure::{Intervals, MeasureOptions, Pair, Statistics};

const SIDE: u32 = 64;
const PIXELS: usize = 64 * 64;

/// Rates spread evenly about `rate` by `+-spread`.
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
    // The span of n intervals is floor(n m) or ceil(n m): variance u (1 - u) with
    // u the fraction of n m. Bias from m: below n^2/N^2 = 5e-4 of it at N = 1440.
    // Over a uniform rate spread the mean follows by averaging u (1 - u).
    let rates = spread_rates(0.18, 0.02);
    let statistics = ideal(&rates, 8000);
    for lag in [1, 4, 8, 16, 24, 32] {
        let lattice = |f: &f64| (f64::from(lag) / f).fract() * (1.0 - (f64::from(lag) / f).fract());
        let expected = crate::measure_support::mean(&rates.iter().map(lattice).collect::<Vec<_>>());
        let found = intervals(&statistics).lag_variance(lag, None);
        // The same pixels on both sides: what is left is the bias and the sampling of a
        // finite beat, u(1-u) to about 1/sqrt(N) of a pixel, 0.25/38/64 on the mean.
        assert!((found.value - expected).abs() < 4e-4, "{lag}: {found:?} against {expected}");
    }
}

#[test]
fn an_ideal_integrator_keeps_to_floor_and_ceiling() {
    let statistics = ideal(&spread_rates(0.3, 0.4), 3000);
    let off = intervals(&statistics).off_lattice(None);
    assert_eq!((off.value, off.samples), (0.0, PIXELS));
    let (short, long) = intervals(&statistics).short_and_long(None);
    // Rates are 0.18 to 0.42: intervals 2 to 6, and an interval of 2 with a mean
    // above 3.33 or of 4 with one below 2.5 cannot occur.
    assert_eq!((short.value, long.value), (0.0, 0.0));
}

#[test]
fn time_based_rates_are_as_precise_as_stated() {
    // Error of f: f^2 sqrt(V) / (N - 1), V = 1/6 on average over rates: the rms over 4096
    // pixels has a relative sampling error of about 1 % (uniform-like, light tails).
    let rates = spread_rates(0.2, 0.1);
    let statistics = ideal(&rates, 4000);
    let found = statistics.counts.unwrap().rate_by_time();
    let relative: Vec<f64> = found.iter().zip(&rates).map(|(a, b)| (a / b - 1.0).powi(2)).collect();
    let rms = crate::measure_support::mean(&relative).sqrt() * 4000.0;
    assert!((rms - (1.0_f64 / 6.0).sqrt()).abs() < 0.02, "{rms} / T");
}

#[test]
fn independent_bits_have_geometric_intervals() {
    // Intervals: P(n) = p (1-p)^(n-1), variance (1-p)/p^2, independent. 4096 pixels of
    // N = 900: D(n) tells n (1 - n/N) of it; every statement within 4 of its own errors.
    let (p, readouts) = (0.3, 3000);
    let statistics = random(p, readouts);
    let found = intervals(&statistics);
    let variance = (1.0 - p) / (p * p);
    for lag in [1, 4, 8, 16, 24, 32] {
        let raw = found.lag_variance(lag, None);
        let n = f64::from(lag);
        let biased = variance * n * (1.0 - n / (f64::from(readouts as u32) * p));
        assert!(raw.sigmas_from(biased).abs() < 4.0, "{lag}: {raw:?} {biased}");
        let unbiased = found.unbiased_lag_variance(lag, None);
        assert!(unbiased.sigmas_from(n * variance).abs() < 4.0, "{lag}: {unbiased:?}");
    }
    let noise = found.decompose(None);
    assert!(noise.per_spike.sigmas_from(variance).abs() < 4.0, "{noise:?}");
    assert!(noise.constant.sigmas_from(0.0).abs() < 4.0, "{noise:?}");
    for apart in [1, 2] {
        let auto = found.autocovariance(apart, None);
        let bias = -variance / (p * readouts as f64);
        assert!(auto.sigmas_from(bias).abs() < 4.0, "{auto:?}");
    }
    for length in 1..12 {
        let share = found.lengths().share(length);
        let expected = p * (1.0 - p).powi(length as i32 - 1);
        // Intervals cut off at the end of the stream are the long ones: a bias of
        // order 1/N of the share, 1e-3 of it.
        let allowed = 4.0 * share.error + 2e-3 * expected;
        assert!((share.value - expected).abs() < allowed, "{length}: {share:?} {expected}");
    }
}

#[test]
fn the_correction_recovers_an_integrator_in_a_short_stream() {
    // N = 58 as in a 300-readout recording: raw D(32) of an ideal integrator is a quarter
    // too large. Rates +-5 %: the lattice mean at lags of 8 and more is 1/6 to 2 %.
    let statistics = ideal(&spread_rates(0.195, 0.05), 300);
    let found = intervals(&statistics);
    for lag in [16, 24, 32] {
        let raw = found.lag_variance(lag, None);
        let corrected = found.unbiased_lag_variance(lag, None);
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
        for pair in Pair::ALL {
            let rho = counts.correlation(pair);
            assert!(rho.value.abs() < 4.0 * rho.error, "{pair:?} {rho:?}");
            // 4032 pairs of 2000 readouts: independent bits have 1/sqrt(8e6) = 3.5e-4.
            // Integrators beat slowly, up to 1 per pair: below 1/sqrt(4032) times 1.
            assert!(rho.error > 2e-4 && rho.error < 1.6e-2, "{pair:?} {rho:?}");
        }
    }
}

#[test]
fn copied_spikes_show_as_coincidence_at_their_lag() {
    // Each pixel with an even column repeats 5 % of the spikes of its left neighbour one
    // readout later: correlation 0.05 (1-p)/(1-p) for half of the pairs.
    let mut stream = Stream::bernoulli(SIDE, SIDE, 1500, &vec![0.1; PIXELS], 9);
    let copies = Stream::bernoulli(SIDE, SIDE, 1500, &vec![0.05; PIXELS], 10);
    for t in (1..1500).rev() {
        for p in (0..PIXELS).filter(|p| p % 64 % 2 == 1) {
            stream.frames[t][p] |= stream.frames[t - 1][p - 1] && copies.frames[t][p];
        }
    }
    let counts = stream.measure(&MeasureOptions::without_intervals(), &[]).counts.unwrap();
    let rho = counts.correlation(Pair::RightAfter);
    // 32 of 63 pairs per row; OR with own spikes takes a tenth: 0.05 * 0.9 * 32/63 = 0.0229,
    // less the 2 % by which the copies raise the other's variance.
    assert!((rho.value - 0.0226).abs() < 4.0 * rho.error + 4e-4, "{rho:?}");
    assert!(rho.value > 20.0 * rho.error, "{rho:?}");
    for pair in [Pair::Right, Pair::RightBefore, Pair::Lower, Pair::LowerAfter] {
        let other = counts.correlation(pair);
        assert!(other.value.abs() < 4.0 * other.error, "{pair:?} {other:?}");
    }
}

#[test]
fn totals_of_independent_bits_are_binomial() {
    let statistics = random(0.2, 3000);
    let frames = statistics.frames.unwrap();
    let n = PIXELS as f64;
    assert!(frames.mean_total().sigmas_from(0.2 * n).abs() < 4.0);
    assert!(frames.total_variance().sigmas_from(0.16 * n).abs() < 4.0);
    for covariance in [frames.row_covariance(), frames.column_covariance()] {
        assert!(covariance.sigmas_from(0.0).abs() < 4.0, "{covariance:?}");
    }
    let transient = frames.start_transient(32).unwrap();
    assert!(transient.sigmas_from(0.0).abs() < 4.0, "{transient:?}");
    assert!(frames.nearly_equal(0.5).is_empty());
}

#[test]
fn noise_of_single_rows_shows_and_flicker_does_not() {
    // Every row has its own rate at each readout, 0.2 +- 0.05 (rows) and the same for all
    // rows (flicker). Covariance of halves of 32 pixels: (32 * 0.05)^2 = 2.56.
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
        let stream = Stream::of(SIDE, SIDE, frames);
        let frames = stream.measure(&MeasureOptions::only_frames(), &[]).frames.unwrap();
        let expected = if per_row { 2.56 } else { 0.0 };
        let found = frames.row_covariance();
        assert!(found.sigmas_from(expected).abs() < 4.0, "{per_row} {found:?}");
        assert!(found.error < 0.05);
    }
}

#[test]
fn a_lost_and_a_repeated_readout_are_found() {
    let mut stream = Stream::integrators(SIDE, SIDE, 2000, &spread_rates(0.2, 0.05), 6);
    stream.frames.remove(700);
    let copy = stream.frames[1200].clone();
    stream.frames.insert(1201, copy);
    let statistics = stream.measure(&MeasureOptions::default(), &[]);
    let frames = statistics.frames.as_ref().unwrap();
    assert_eq!(frames.nearly_equal(0.5), [1201]);
    // 800 intervals end at a readout, with a standard error of 0.4/28 = 0.014. A lost readout
    // shortens those around it by 1, and those that end on a copy have length 1 where
    // 5 is the mean.
    let (low, _) = intervals(&statistics).deviation_extremes().unwrap();
    assert_eq!(low.readout, 1201);
    assert!((low.mean + 4.0).abs() < 0.1, "{low:?}");
    let all = intervals(&statistics).deviations(100);
    let lost = all.iter().find(|d| d.readout == 701).unwrap();
    assert!((lost.mean + 1.0).abs() < 0.1, "{lost:?}");
    let quiet = all.iter().filter(|d| d.readout < 699 && d.sigmas.abs() > 5.0).count();
    assert_eq!(quiet, 0);
}

#[test]
fn halves_tell_a_drift() {
    // The rate grows by 2 % at the split.
    let rates = spread_rates(0.2, 0.1);
    let faster: Vec<f64> = rates.iter().map(|r| r * 1.02).collect();
    let mut stream = Stream::integrators(SIDE, SIDE, 1500, &rates, 1);
    stream.frames.extend(Stream::integrators(SIDE, SIDE, 1500, &faster, 2).frames);
    let options = MeasureOptions::default().with_split(Some(1500));
    let statistics = stream.measure(&options, &[]);
    let halves = intervals(&statistics).halves().unwrap();
    let change = halves.rate[1].iter().zip(&halves.rate[0]).map(|(b, a)| b / a - 1.0);
    let found = spikelane_measure::Estimate::mean(change);
    // The interval across the seam is off by up to one interval of 300: no mean shift.
    assert!(found.sigmas_from(0.02).abs() < 4.0, "{found:?}");
    assert!(found.error < 1e-4);
}
