//! Tests that every statistic equals the result of a loop over each pixel and readout, for all sizes, batches and bands.

use crate::measure_support::Stream;
use proptest::prelude::*;
use spikelane::spikes::{Geometry, SpikeFramesRef};
use spikelane_measure::{Accumulator, MeasureOptions, Statistics};

fn options(split: Option<u32>, lags: Vec<u32>, longest_bin: u32) -> MeasureOptions {
    MeasureOptions::default().with_lags(lags).with_longest_bin(longest_bin).with_split(split)
}

/// Returns different rates for adjacent pixels: silent, dim, medium, bright, and a spike at every readout.
fn rates(pixels: usize, level: f64) -> Vec<f64> {
    let sorts = [level, 0.0, 1.0, 0.2, 0.003, level, 0.93, level];
    (0..pixels).map(|p| sorts[p % 8]).collect()
}

fn check(stream: &Stream, options: &MeasureOptions, batches: &[usize]) {
    let statistics = stream.measure(options, batches);
    assert_eq!(statistics.readouts as usize, stream.frames.len());
    stream.check_counts(&statistics);
    stream.check_frames(&statistics);
    stream.check_intervals(&statistics, options);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn any_size_and_batching_equals_visiting_each_bit(
        width in 1_u32..140, height in 1_u32..6, readouts in 0_usize..1300,
        level in 0.0..1.0, regular: bool, seed: u64,
        batches in prop::collection::vec(0_usize..700, 0..5),
        split in prop::option::of(0_u32..1400), lags in prop::collection::vec(1_u32..=64, 0..5),
        longest_bin in 1_u32..40,
    ) {
        let rates = rates((width * height) as usize, level);
        let make = if regular { Stream::integrators } else { Stream::bernoulli };
        let stream = make(width, height, readouts, &rates, seed);
        check(&stream, &options(split, lags, longest_bin), &batches);
    }

    #[test]
    fn bands_joined_equal_the_whole(
        width in 1_u32..140, height in 2_u32..40, readouts in 1_usize..600,
        level in 0.0..1.0, seed: u64, cut in 0.0..1.0, split in prop::option::of(1_u32..600),
    ) {
        let rates = rates((width * height) as usize, level);
        let stream = Stream::bernoulli(width, height, readouts, &rates, seed);
        let options = options(split, vec![3], 20);
        let full = stream.measure(&options, &[]);
        let cut = 1 + (cut * (f64::from(height) - 1.0)) as usize;
        let band = |rows| options.clone().with_rows(Some(rows)).with_frames(false);
        let parts = vec![
            stream.measure(&band(cut..height as usize), &[7, 130]),
            stream.measure(&MeasureOptions::frames_only(), &[]),
            stream.measure(&band(0..cut), &[]),
        ];
        prop_assert_eq!(Statistics::join(parts).unwrap(), full);
    }
}

#[test]
fn long_streams_equal_visiting_each_bit() {
    // A stream of 20,000 readouts uses the fast path over many blocks. One pixel is silent for longer than the fast path
    // allows. One pixel begins to fire late, and one pixel changes its rate.
    let mut stream = Stream::integrators(67, 2, 20_000, &rates(134, 0.31), 5);
    for (t, frame) in stream.frames.iter_mut().enumerate() {
        frame[5] &= !(3_000..16_000).contains(&t);
        frame[7] &= t > 9_000;
        frame[13] &= t < 7_000 || t % 40 == 0;
    }
    let lags = vec![1, 2, 16, 31, 64];
    check(&stream, &options(Some(9_999), lags, 1023), &[1000]);
}

#[test]
fn taller_than_the_vertical_counters_equals_visiting_each_bit() {
    let stream = Stream::bernoulli(3, 1100, 12, &vec![0.95; 3300], 8);
    check(&stream, &options(None, vec![], 10), &[]);
}

#[test]
fn nothing_pushed_is_empty_statistics() {
    let stream = Stream::from_frames(9, 2, Vec::new());
    check(&stream, &MeasureOptions::default(), &[]);
}

#[test]
fn padding_bits_of_a_frame_are_no_pixels() {
    // The sensor has 3x1 pixels, so five bits of its byte are padding. The stream sets all eight bits.
    let geometry = Geometry::new(3, 1).unwrap();
    let mut accumulator = Accumulator::new(geometry, &MeasureOptions::default()).unwrap();
    accumulator.push(SpikeFramesRef::new(geometry, &[0xff; 10]).unwrap()).unwrap();
    let statistics = accumulator.finish();
    assert_eq!(statistics.frames.unwrap().totals, [3; 10]);
    assert_eq!(statistics.counts.unwrap().count, [10; 3]);
}

#[test]
fn series_are_truncated_at_the_limit_and_extremes_are_not() {
    let mut stream = Stream::bernoulli(40, 10, 300, &vec![0.5; 400], 3);
    stream.frames[250] = stream.frames[249].clone();
    let options = MeasureOptions::default().with_series_readouts(100);
    let statistics = stream.measure(&options, &[]);
    let frames = statistics.frames.unwrap();
    assert_eq!((frames.totals.len(), frames.distances.len()), (100, 99));
    let nearest = frames.min_distance().unwrap();
    assert_eq!((nearest.readout, nearest.value), (250, 0));
}

#[test]
fn invalid_options_are_refused_with_a_reason() {
    let geometry = Geometry::new(8, 8).unwrap();
    let refuse = |options: MeasureOptions, word: &str| {
        let error = Accumulator::new(geometry, &options).err().unwrap().to_string();
        assert!(error.contains(word), "{error}");
    };
    let all = MeasureOptions::default;
    refuse(all().with_lags(vec![0]), "1 to 64");
    refuse(all().with_lags(vec![65]), "found 65");
    refuse(all().with_rows(Some(0..4)), "all rows");
    refuse(all().with_rows(Some(4..9)).with_frames(false), "within 0..8");
    refuse(all().with_longest_bin(0), "found 0");
    let mut accumulator = Accumulator::new(geometry, &all()).unwrap();
    let other = Geometry::new(16, 4).unwrap();
    let error = accumulator.push(SpikeFramesRef::new(other, &[0; 8]).unwrap()).unwrap_err();
    assert!(error.to_string().contains("found 16x4, expected 8x8"));
}

#[test]
fn bands_that_do_not_fit_are_not_joined() {
    let stream = Stream::bernoulli(9, 6, 20, &[0.4; 54], 1);
    let band = |rows, lags| {
        let options = MeasureOptions::default().with_rows(Some(rows)).with_frames(false).with_lags(lags);
        stream.measure(&options, &[])
    };
    let refuse = |parts, word: &str| {
        let error = Statistics::join(parts).unwrap_err().to_string();
        assert!(error.contains(word), "{error}");
    };
    refuse(vec![], "none");
    refuse(vec![band(0..2, vec![]), band(3..6, vec![])], "expected rows from 2");
    refuse(vec![band(0..2, vec![]), band(2..6, vec![2])], "different options");
    let frames = stream.measure(&MeasureOptions::frames_only(), &[]);
    refuse(vec![frames.clone(), frames], "two parts");
}
