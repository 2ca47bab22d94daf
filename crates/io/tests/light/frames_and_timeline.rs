//! Tests of frames, transfer functions, the timeline and the built-in chart.

use proptest::prelude::*;
use spikelane::unstable::chart;
use spikelane::{ErrorKind, Geometry};
use spikelane_io::light::natural_cmp;
use spikelane_io::light::{
    Chart, Frame, Interpolation, OwnedSamples, Rate, Source, Timeline, Transfer, luminance,
};

fn geometry(w: u32, h: u32) -> Geometry {
    Geometry::new(w, h).unwrap()
}

/// The sRGB transfer function of IEC 61966-2-1, computed with `powf` of the standard library.
fn srgb(code: f64) -> f64 {
    if code <= 0.04045 { code / 12.92 } else { ((code + 0.055) / 1.055).powf(2.4) }
}

#[test]
fn eight_bit_tables_are_within_half_a_code_of_the_formula() {
    type Formula = fn(f64) -> f64;
    let exact: [(Transfer, Formula); 3] =
        [(Transfer::Srgb, srgb), (Transfer::Linear, |x| x), (Transfer::Gamma(2.2), |x| x.powf(2.2))];
    for (transfer, formula) in exact {
        for (code, &light) in transfer.table8().iter().enumerate() {
            let wanted = formula(code as f64 / 255.0) * 65535.0;
            // The last bits of the two `pow` functions may differ, so the tolerance includes 1e-6.
            assert!((f64::from(light) - wanted).abs() <= 0.5 + 1e-6, "{transfer} {code}");
        }
    }
}

#[test]
fn sixteen_bit_tables_are_the_formula_rounded_to_a_float() {
    for (code, &light) in Transfer::Srgb.table16().iter().enumerate() {
        let wanted = srgb(code as f64 / 65535.0);
        // Rounding to f32 multiplies a value by a factor between 1 - 2^-24 and 1 + 2^-24.
        assert!((f64::from(light) - wanted).abs() <= wanted * 6e-8, "{code}");
    }
}

#[test]
fn linear_eight_bit_codes_reach_full_scale_exactly() {
    let table = Transfer::Linear.table8();
    assert!((0..256).all(|c| usize::from(table[c]) == 257 * c));
}

#[test]
fn luminance_of_primaries_is_their_weight_and_white_is_one() {
    assert_eq!(luminance([1.0, 0.0, 0.0]), 0.2126);
    assert_eq!(luminance([0.0, 1.0, 0.0]), 0.7152);
    assert_eq!(luminance([0.0, 0.0, 1.0]), 0.0722);
    assert!((luminance([1.0; 3]) - 1.0).abs() < 1e-6);
}

#[test]
fn transfer_names_are_read_and_nonsense_is_a_usage_error() {
    assert_eq!("srgb".parse::<Transfer>().unwrap(), Transfer::Srgb);
    assert_eq!("linear".parse::<Transfer>().unwrap(), Transfer::Linear);
    assert_eq!("2.2".parse::<Transfer>().unwrap(), Transfer::Gamma(2.2));
    for bad in ["", "SRGB ", "0", "-1", "nan", "inf", "rec709"] {
        assert_eq!(bad.parse::<Transfer>().unwrap_err().kind(), ErrorKind::Usage, "{bad}");
    }
}

#[test]
fn a_bad_float_is_named_by_row_col_and_value() {
    for bad in [f32::NAN, -0.25, f32::INFINITY] {
        let mut light = vec![0.5; 12];
        light[7] = bad;
        let error = Frame::new(geometry(4, 3), OwnedSamples::F32(light)).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Input);
        let text = error.to_string();
        assert!(text.contains("row 1, col 3") && text.contains(&bad.to_string()), "{text}");
    }
}

#[test]
fn a_frame_of_the_wrong_length_is_refused() {
    let error = Frame::new(geometry(4, 3), OwnedSamples::U8(vec![0; 11])).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Input);
}

#[test]
fn the_maximum_is_relative_to_full_scale() {
    let max_of = |samples| Frame::new(geometry(2, 1), samples).unwrap().max();
    assert_eq!(max_of(OwnedSamples::U8(vec![51, 255])), 1.0);
    assert_eq!(max_of(OwnedSamples::U16(vec![0, 13107])), 0.2);
    assert_eq!(max_of(OwnedSamples::F32(vec![3.5, 0.0])), 3.5);
}

#[test]
fn a_blend_is_the_straight_line_between_two_frames() {
    let frame = |samples| Frame::new(geometry(2, 1), samples).unwrap();
    let (a, b) = (frame(OwnedSamples::U8(vec![0, 255])), frame(OwnedSamples::U16(vec![65535, 257])));
    let mid = Frame::blend(&a, &b, 0.25).unwrap();
    // The first sample is 65535/4 = 16383.75. The second sample is 65535 - (65535 - 257)/4 = 49215.5. Both are rounded
    // half up.
    assert_eq!(mid.samples(), &OwnedSamples::U16(vec![16384, 49216]));
    let c = frame(OwnedSamples::F32(vec![2.0, 0.0]));
    let mid = Frame::blend(&a, &c, 0.5).unwrap();
    assert_eq!(mid.samples(), &OwnedSamples::F32(vec![1.0, 0.5]));
    assert_eq!(Frame::blend(&a, &b, 1.5).unwrap_err().kind(), ErrorKind::Usage);
}

#[test]
fn numbered_names_sort_by_their_numbers() {
    let mut names = ["img10", "img2", "a", "img2b", "img02", "b1c10", "b1c9", "img"];
    names.sort_by(|a, b| natural_cmp(a, b));
    assert_eq!(names, ["a", "b1c9", "b1c10", "img", "img02", "img2", "img2b", "img10"]);
}

#[test]
fn numbers_beyond_64_bits_still_sort() {
    let (a, b) = ("f99999999999999999999999998", "f99999999999999999999999999");
    assert!(natural_cmp(a, b).is_lt());
}

proptest! {
    #[test]
    fn natural_order_is_a_total_order(a in "[ab01 9]{0,6}", b in "[ab01 9]{0,6}", c in "[ab01 9]{0,6}") {
        prop_assert_eq!(natural_cmp(&a, &b), natural_cmp(&b, &a).reverse());
        prop_assert_eq!(natural_cmp(&a, &b).is_eq(), a == b);
        if natural_cmp(&a, &b).is_le() && natural_cmp(&b, &c).is_le() {
            prop_assert!(natural_cmp(&a, &c).is_le());
        }
    }

    #[test]
    fn each_frame_is_held_for_its_readouts(n in 1_u64..500, readout in 0_u64..1_000_000) {
        let line = Timeline::from_readouts_per_frame(n, Interpolation::Linear).unwrap();
        let moment = line.position(readout);
        prop_assert_eq!((moment.frame, moment.numerator, moment.denominator), (readout / n, readout % n, n));
        prop_assert_eq!(line.readouts(7), Some(7 * n));
    }

    /// The rates `source` and `readout` are frames and readouts per second. Readout `i` is at the position
    /// `i * source / readout` frames, which must be in [frame, frame + 1). The test multiplies both sides by the
    /// denominators and compares 128-bit integers.
    #[test]
    fn a_readout_falls_into_its_frame(
        s in (1_u64..200_000, 1_u64..2_000),
        r in (1_u64..2_000_000, 1_u64..2_000),
        i in 0_u64..10_000_000_000,
    ) {
        let (source, readout) = (Rate::new(s.0, s.1).unwrap(), Rate::new(r.0, r.1).unwrap());
        let line = Timeline::from_rates(source, readout, Interpolation::Linear).unwrap();
        let m = line.position(i);
        let position = u128::from(i) * u128::from(s.0) * u128::from(r.1);
        let unit = u128::from(s.1) * u128::from(r.0);
        prop_assert!(u128::from(m.frame) * unit <= position);
        prop_assert!(position < u128::from(m.frame + 1) * unit);
        // The exact position is frame + numerator / denominator.
        let left = (u128::from(m.frame) * u128::from(m.denominator) + u128::from(m.numerator)) * unit;
        prop_assert_eq!(left, position * u128::from(m.denominator));
        prop_assert!((0.0..=1.0).contains(&m.weight()));
    }

    #[test]
    fn the_first_readout_of_a_frame_is_the_first(
        s in 1_u64..100_000, r in 1_u64..100_000, frame in 1_u64..1_000_000,
    ) {
        let line = Timeline::from_rates(
            Rate::new(s, 1001).unwrap(), Rate::new(r, 7).unwrap(), Interpolation::Hold).unwrap();
        let first = line.first_readout(frame).unwrap();
        prop_assert!(line.position(first).frame >= frame);
        prop_assert!(line.position(first - 1).frame < frame);
    }
}

#[test]
fn ntsc_video_does_not_drift_in_a_day() {
    // A day of 30000/1001 frames per second at 40 kHz has 86400 * 40000 readouts and 86400 * 30000 / 1001 frames.
    let source: Rate = "29.97".parse().unwrap();
    assert_eq!(source.as_fraction(), (30_000, 1001));
    let line = Timeline::from_rates(source, "40000".parse().unwrap(), Interpolation::Hold).unwrap();
    let frames = 86_400_u64 * 30_000 / 1001;
    assert_eq!(line.position(86_400 * 40_000).frame, frames);
    // One frame lasts 40000 * 1001 / 30000 = 1334.67 readouts, so the second frame starts at readout 1335.
    assert_eq!(line.readouts(1), Some(1335));
    assert_eq!(line.readouts(3), Some(4004));
}

#[test]
fn hold_never_blends_and_repeats_the_last_frame() {
    let line = Timeline::from_readouts_per_frame(10, Interpolation::Hold).unwrap();
    assert_eq!(line.position(19).weight(), 0.0);
    let line = Timeline::from_readouts_per_frame(10, Interpolation::Linear).unwrap();
    assert_eq!(line.position(15).weight(), 0.5);
    let last = line.position_within(29, 2).unwrap();
    assert_eq!((last.frame, last.weight()), (1, 0.0));
    assert_eq!(line.position_within(3, 0).unwrap_err().kind(), ErrorKind::Input);
}

#[test]
fn a_still_timeline_never_leaves_its_frame() {
    let line = Timeline::first_frame();
    assert_eq!(line.position(u64::MAX).frame, 0);
    assert_eq!(line.readouts(1), None);
}

#[test]
fn rates_are_read_exactly_and_nonsense_is_refused() {
    let parts = |t: &str| t.parse::<Rate>().unwrap().as_fraction();
    assert_eq!(parts("25"), (25, 1));
    assert_eq!(parts("12.50"), (25, 2));
    assert_eq!(parts("48000/2002"), (24_000, 1001));
    for bad in ["", "0", "-1", "1/0", "nan", "1e3", "99999999999999999999", "1.0000001", "."] {
        assert_eq!(bad.parse::<Rate>().unwrap_err().kind(), ErrorKind::Usage, "{bad}");
    }
}

fn test_chart(w: u32, h: u32) -> Chart {
    Chart::new(geometry(w, h), Rate::new(1000, 1).unwrap(), Some(3)).unwrap()
}

#[test]
fn the_wedge_has_its_levels_at_every_size() {
    for (w, h) in [(16, 16), (400, 250), (333, 17), (17, 333)] {
        let chart = test_chart(w, h);
        let frame = chart.frame_at(0.7);
        for (step, level) in chart::WEDGE_LEVELS.iter().enumerate() {
            let [rows, cols] = chart.wedge_step(step);
            assert!(!rows.is_empty() && !cols.is_empty());
            for (row, col) in rows.flat_map(|r| cols.clone().map(move |c| (r, c))) {
                // Rounding to 16 bits causes an error of up to 0.5 steps.
                assert!((frame.get(row, col) - level).abs() < 0.6 / 65535.0, "{w}x{h} {row} {col}");
            }
        }
    }
}

#[test]
fn the_chart_moves_and_comes_to_its_end() {
    let mut chart = test_chart(400, 250);
    let (mut a, mut b) = (Frame::dark(chart.geometry()), Frame::dark(chart.geometry()));
    assert!(chart.next_frame(&mut a).unwrap() && chart.next_frame(&mut b).unwrap());
    assert_ne!(a, b);
    assert!(chart.next_frame(&mut b).unwrap());
    assert!(!chart.next_frame(&mut b).unwrap());
    assert_eq!(b, chart.frame_at(0.002));
}

#[test]
fn the_chart_repeats_with_its_patterns() {
    // In 4 s, the star rotates 8 times. The fine bars move by 2 chart widths of 50 bars, so by 2 * 50 = 100 bars. The
    // coarse bars move by 10 chart widths of 12.5 bars, so by 10 * 12.5 = 125 bars. All these numbers are whole, so
    // the chart is unchanged. The tolerance of 2e-3 corresponds to a rounding error of 1e-4 pixels at the steepest
    // edge.
    let chart = test_chart(400, 250);
    let (start, end) = (chart.frame_at(0.0), chart.frame_at(4.0));
    for (a, b) in start.to_f32().iter().zip(end.to_f32()) {
        assert!((a - b).abs() < 2e-3);
    }
}

#[test]
fn the_chart_averages_the_bars_to_their_mean_light() {
    // All bars have the same width. For a whole number of periods, the mean light is therefore (0.02 + 0.85) / 2 =
    // 0.435 at every position of the bars.
    let chart = test_chart(400, 250);
    for seconds in [0.0, 0.001, 0.0137] {
        let frame = chart.frame_at(seconds);
        // Row 180 is inside the coarse bars. Columns 240 to 367 contain 4 periods of 32 columns.
        let mean = (240..368).map(|col| frame.get(180, col)).sum::<f32>() / 128.0;
        assert!((mean - 0.435).abs() < 1e-3, "{mean}");
    }
}

#[test]
fn a_chart_too_small_is_refused() {
    let error = Chart::new(geometry(15, 16), Rate::new(1, 1).unwrap(), None).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Usage);
}

#[test]
fn frames_come_at_their_times() {
    let starts = [0, 10_000_000, 30_000_000, 70_000_000];
    let line = Timeline::from_times(&starts, "20000".parse().unwrap(), Interpolation::Linear).unwrap();
    // The last frame has the same duration as the frame before.
    let start = |k: u64| starts.get(k as usize).copied().unwrap_or(70_000_000 + (k.max(3) - 3) * 40_000_000);
    for readout in 0..5000_u64 {
        let time = readout * 50_000;
        let frame = (0..).take_while(|&k| start(k) <= time).last().unwrap();
        let weight = (time - start(frame)) as f64 / (start(frame + 1) - start(frame)) as f64;
        let moment = line.position(readout);
        assert_eq!(moment.frame, frame, "{readout}");
        assert!((f64::from(moment.weight()) - weight).abs() < 1e-7, "{readout}");
    }
    assert_eq!([1, 2, 3, 4].map(|k| line.first_readout(k)), [200, 600, 1400, 2200].map(Some));
    assert_eq!(line.readouts(4), Some(2200));
    // If the rates have no common divisor, each frame must still begin where the previous frame ends.
    let odd = Timeline::from_times(
        &[0, 33_366_667, 66_733_333, 166_733_333],
        "30000/1001".parse().unwrap(),
        Interpolation::Hold,
    );
    let odd = odd.unwrap();
    for frame in 1..9 {
        let first = odd.first_readout(frame).unwrap();
        assert!(odd.position(first).frame >= frame && odd.position(first - 1).frame < frame, "{frame}");
    }
    for bad in [&[0][..], &[1, 2], &[0, 5, 5]] {
        assert!(Timeline::from_times(bad, "20000".parse().unwrap(), Interpolation::Hold).is_err());
    }
}
