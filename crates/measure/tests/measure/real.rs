//! A real recording, when `SPIKELANE_REAL_DATA` names the folder it lies in.

use std::path::PathBuf;

use spikelane::spikes::{Geometry, Packed};
use spikelane_measure::{
    Accumulator, MeasureOptions, Pair, Statistics, median_and_spread, select_smooth, summarise,
};

/// The static scene, flipped to the top row first, or why it is skipped.
fn measured() -> Option<Statistics> {
    let Some(folder) = std::env::var_os("SPIKELANE_REAL_DATA") else {
        eprintln!("skipped: SPIKELANE_REAL_DATA is not set");
        return None;
    };
    let bytes = std::fs::read(PathBuf::from(folder).join("static_400x250x300.dat")).unwrap();
    let flipped: Vec<u8> = bytes
        .chunks_exact(12_500)
        .flat_map(|frame| frame.chunks_exact(50).rev().flatten().copied())
        .collect();
    let geometry = Geometry::new(400, 250).unwrap();
    let options = MeasureOptions::default().with_lags(vec![1, 2, 4, 8, 16, 24, 32]).with_split(Some(150));
    let mut accumulator = Accumulator::new(geometry, &options).unwrap();
    accumulator.push(Packed::new(geometry, &flipped).unwrap()).unwrap();
    Some(accumulator.finish())
}

/// The flat wall: even pixels (boxes of 11x11 with a robust spread of at most 6 %, median rate
/// 0.15 to 0.25) inside the rectangle that the wall fills, rows 105 to 194, columns 60 to 339.
/// Its light falls off to the sides, so rates cover more than one period of the lattice
/// of intervals (4.5 to 5.5 readouts), and their mean is 0.20.
fn wall(statistics: &Statistics) -> Vec<usize> {
    let rates = statistics.counts.as_ref().unwrap().rate_by_time();
    let mut even = select_smooth(&rates, 400, &(0.15..0.25), 5, 0.06);
    even.retain(|p| (105..195).contains(&(p / 400)) && (60..340).contains(&(p % 400)));
    even
}

#[test]
fn the_static_scene_has_the_rate_that_was_reported() {
    let Some(statistics) = measured() else { return };
    let summary = summarise(&statistics).unwrap();
    println!("{} outliers, {summary:?}", summary.defects.count());
    assert!((summary.mean_rate.value - 0.2200).abs() < 5e-5, "{:?}", summary.mean_rate);
}

#[test]
fn the_wall_has_the_interval_variance_that_was_reported() {
    let Some(statistics) = measured() else { return };
    let pixels = wall(&statistics);
    let intervals = statistics.intervals.as_ref().unwrap();
    let mut rates: Vec<f64> = pixels.iter().map(|p| intervals.rate_by_time()[*p]).collect();
    println!("{} pixels, rate {:?}", pixels.len(), median_and_spread(&mut rates));
    for lag in intervals.lags() {
        let raw = intervals.lag_variance(*lag, Some(&pixels));
        let unbiased = intervals.unbiased_lag_variance(*lag, Some(&pixels));
        println!("D({lag}) = {raw:?}, unbiased {unbiased:?}");
    }
    let off = intervals.off_lattice(Some(&pixels));
    println!("off {off:?}, short and long {:?}", intervals.short_and_long(Some(&pixels)));
    println!("noise {:?}", intervals.decompose(Some(&pixels)));
    let autos = [1, 2].map(|apart| intervals.autocovariance(apart, Some(&pixels)));
    println!("autocovariance {autos:?}");
    let counts = statistics.counts.as_ref().unwrap();
    println!("correlations {:?}", Pair::ALL.map(|pair| counts.correlation(pair)));
    println!("deviations {:?}", intervals.deviation_extremes());
    let frames = statistics.frames.as_ref().unwrap();
    println!("nearest {:?} farthest {:?}", frames.nearest(), frames.farthest());
    println!("rows {:?} columns {:?}", frames.row_covariance(), frames.column_covariance());
    // Reported: D(1) .1737, D(8) .1742, and 5e-4 to 7e-4 off the lattice, for another choice of
    // wall. D(1) moves by 3 % between parts of the wall, as the lattice does with rate.
    let d = |lag| intervals.unbiased_lag_variance(lag, Some(&pixels)).value;
    assert!((d(1) / 0.1737 - 1.0).abs() < 0.03 && (d(8) / 0.1742 - 1.0).abs() < 0.03);
    assert!((3e-4..2e-3).contains(&off.value));
}
