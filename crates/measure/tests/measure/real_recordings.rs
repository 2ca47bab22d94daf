//! Measures a real recording if the environment variable `SPIKELANE_REAL_DATA` is the path of its folder.

use std::path::PathBuf;

use spikelane::spikes::{Geometry, SpikeFramesRef};
use spikelane_measure::{
    Accumulator, MeasureOptions, NeighborPair, Statistics, median_and_spread, select_uniform, summarize,
};

/// Measures the static scene. The rows are flipped, because the file stores the bottom row first. Returns `None` if the
/// data are absent.
fn measure_static_scene() -> Option<Statistics> {
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
    accumulator.push(SpikeFramesRef::new(geometry, &flipped).unwrap()).unwrap();
    Some(accumulator.finish())
}

/// Returns the pixels of the flat wall that are in uniform areas.
///
/// For each returned pixel, the rates in the 11x11 box around the pixel have a robust spread of at most 6 % and a
/// median of 0.15 to 0.25. The wall covers rows 105 to 194 and columns 60 to 339. Its light decreases toward the sides.
/// The mean rate is 0.20. The mean intervals range from 4.5 to 5.5 readouts and therefore cover more than one period of
/// the lattice variance.
fn wall(statistics: &Statistics) -> Vec<usize> {
    let rates = statistics.counts.as_ref().unwrap().rate_by_time();
    let mut even = select_uniform(&rates, 400, &(0.15..0.25), 5, 0.06);
    even.retain(|p| (105..195).contains(&(p / 400)) && (60..340).contains(&(p % 400)));
    even
}

#[test]
fn the_static_scene_has_the_published_rate() {
    let Some(statistics) = measure_static_scene() else { return };
    let summary = summarize(&statistics).unwrap();
    println!("{} outliers, {summary:?}", summary.defects.count());
    assert!((summary.mean_rate.value - 0.2200).abs() < 5e-5, "{:?}", summary.mean_rate);
}

#[test]
fn the_wall_has_the_published_interval_variance() {
    let Some(statistics) = measure_static_scene() else { return };
    let pixels = wall(&statistics);
    let intervals = statistics.intervals.as_ref().unwrap();
    let mut rates: Vec<f64> = pixels.iter().map(|p| intervals.rate_by_time()[*p]).collect();
    println!("{} pixels, rate {:?}", pixels.len(), median_and_spread(&mut rates));
    for lag in intervals.lags() {
        let raw = intervals.lag_variance(*lag, Some(&pixels));
        let unbiased = intervals.unbiased_lag_variance(*lag, Some(&pixels));
        println!("D({lag}) = {raw:?}, unbiased {unbiased:?}");
    }
    let off = intervals.off_lattice_share(Some(&pixels));
    println!("off {off:?}, short and long {:?}", intervals.short_and_long_shares(Some(&pixels)));
    println!("noise {:?}", intervals.decompose(Some(&pixels)));
    let autos = [1, 2].map(|lag| intervals.autocovariance(lag, Some(&pixels)));
    println!("autocovariance {autos:?}");
    let counts = statistics.counts.as_ref().unwrap();
    println!("correlations {:?}", NeighborPair::ALL.map(|pair| counts.correlation(pair)));
    let frames = statistics.frames.as_ref().unwrap();
    println!("nearest {:?} farthest {:?}", frames.min_distance(), frames.max_distance());
    println!("rows {:?} columns {:?}", frames.row_covariance(), frames.column_covariance());
    // Published values for another region of the wall: D(1) = 0.1737, D(8) = 0.1742, off-lattice share 5e-4 to 7e-4.
    // D(1) varies by 3 % between regions, because it depends on the rate.
    let d = |lag| intervals.unbiased_lag_variance(lag, Some(&pixels)).value;
    assert!((d(1) / 0.1737 - 1.0).abs() < 0.03 && (d(8) / 0.1742 - 1.0).abs() < 0.03);
    assert!((3e-4..2e-3).contains(&off.value));
}
