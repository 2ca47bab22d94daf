//! Reconstructions compared with plain loops that read single bits.

use proptest::prelude::*;
use spikelane::reconstruct::{TfpSequence, isi_map, psnr, span_rates, ssim, tfi, tfi_with_open_pixels, tfp};
use spikelane::{ErrorKind, Geometry, SpikeFramesRef};

prop_compose! {
    /// Returns a sparse or dense stream of a small sensor.
    fn stream()(w in 1_u32..14, h in 1_u32..6, readouts in 1_usize..40, density in 1_u32..9)
        (bits in prop::collection::vec(0_u32..10, w as usize * h as usize * readouts),
         w in Just(w), h in Just(h), density in Just(density)) -> (Geometry, Vec<u8>)
    {
        let geometry = Geometry::new(w, h).unwrap();
        let mut bytes = Vec::new();
        for frame in bits.chunks_exact(geometry.pixels()) {
            let start = bytes.len();
            bytes.resize(start + geometry.frame_bytes(), 0);
            for (p, &x) in frame.iter().enumerate() {
                if x < density {
                    spikelane::spikes::set_bit(&mut bytes[start..], p);
                }
            }
        }
        (geometry, bytes)
    }
}

fn pixels(packed: SpikeFramesRef) -> impl Iterator<Item = (usize, usize)> {
    let g = packed.geometry();
    (0..g.pixels()).map(move |p| (p / g.width(), p % g.width()))
}

fn naive_tfp(packed: SpikeFramesRef, at: usize, half: usize) -> Vec<f32> {
    let near: Vec<_> = (0..packed.readouts()).filter(|t| t.abs_diff(at) <= half).collect();
    pixels(packed)
        .map(|(r, c)| near.iter().filter(|t| packed.get(**t, r, c)).count() as f32 / near.len() as f32)
        .collect()
}

/// Returns the length of the interval that contains `at`. Returns `None` if a spike at either end of the interval is
/// more than `search` readouts away from `at`.
fn naive_interval(packed: SpikeFramesRef, at: usize, search: usize, r: usize, c: usize) -> Option<usize> {
    let fired: Vec<_> = (0..packed.readouts()).filter(|t| packed.get(*t, r, c)).collect();
    let before = *fired.iter().rfind(|t| **t <= at)?;
    let after = *fired.iter().find(|t| **t > at)?;
    (at - before <= search && after - at <= search).then_some(after - before)
}

/// Computes span rates from the list of the spikes in the window. If a pixel has fewer than two spikes, its rate is the
/// number of spikes divided by the number of readouts.
fn naive_span(packed: SpikeFramesRef, at: usize, half: usize) -> Vec<f32> {
    let near: Vec<_> = (0..packed.readouts()).filter(|t| t.abs_diff(at) <= half).collect();
    let rate = |(r, c): (usize, usize)| {
        let fired: Vec<usize> = near.iter().copied().filter(|t| packed.get(*t, r, c)).collect();
        match fired.as_slice() {
            [first, .., last] => (fired.len() - 1) as f64 / (last - first) as f64,
            _ => fired.len() as f64 / near.len() as f64,
        }
    };
    pixels(packed).map(|p| rate(p) as f32).collect()
}

/// Returns whether the interval of a pixel is open because the stream ends.
///
/// The interval is open if a search for a spike fails in at least one direction, and if every failed search reaches an
/// end of the stream.
fn naive_open(packed: SpikeFramesRef, at: usize, search: usize, r: usize, c: usize) -> bool {
    let fires = |t: &usize| packed.get(*t, r, c);
    let before = (0..=at).rev().take(search + 1).any(|t| fires(&t));
    let after = (at + 1..packed.readouts()).take(search).any(|t| fires(&t));
    let (cut_before, cut_after) = (at < search, at + search >= packed.readouts());
    (!before || !after) && (before || cut_before) && (after || cut_after)
}

proptest! {
    #[test]
    fn span_equals_listing_the_spikes((g, bytes) in stream(), at in 0_usize..40, half in 0_usize..50) {
        let packed = SpikeFramesRef::new(g, &bytes).unwrap();
        let at = at % packed.readouts();
        let rates = span_rates(packed, at, half).unwrap();
        prop_assert!(rates.iter().all(|r| (0.0..=1.0).contains(r)));
        prop_assert_eq!(rates, naive_span(packed, at, half));
    }

    #[test]
    fn intervals_left_open_are_those_that_an_end_cuts(
        (g, bytes) in stream(), at in 0_usize..40, search in 1_usize..25,
    ) {
        let packed = SpikeFramesRef::new(g, &bytes).unwrap();
        let at = at % packed.readouts();
        let wanted = pixels(packed).filter(|(r, c)| naive_open(packed, at, search, *r, *c)).count();
        let tfi = tfi_with_open_pixels(packed, at, search).unwrap();
        prop_assert_eq!(tfi.open_pixels, wanted);
        prop_assert!(wanted > 0 || tfi.is_measurable());
    }

    #[test]
    fn tfp_equals_counting((g, bytes) in stream(), at in 0_usize..40, half in 0_usize..50) {
        let packed = SpikeFramesRef::new(g, &bytes).unwrap();
        let at = at % packed.readouts();
        prop_assert_eq!(tfp(packed, at, half).unwrap(), naive_tfp(packed, at, half));
    }

    #[test]
    fn a_sliding_window_equals_a_fresh_one(
        (g, bytes) in stream(), half in 0_usize..8, moves in prop::collection::vec(0_usize..40, 1..12),
    ) {
        let packed = SpikeFramesRef::new(g, &bytes).unwrap();
        let mut sequence = TfpSequence::new(packed, half);
        for at in moves {
            let at = at % packed.readouts();
            sequence.move_to(at).unwrap();
            prop_assert_eq!(sequence.image(), naive_tfp(packed, at, half));
        }
    }

    #[test]
    fn tfi_equals_searching((g, bytes) in stream(), at in 0_usize..40, search in 1_usize..25) {
        let packed = SpikeFramesRef::new(g, &bytes).unwrap();
        let at = at % packed.readouts();
        let wanted: Vec<f32> = pixels(packed)
            .map(|(r, c)| naive_interval(packed, at, search, r, c).unwrap_or(2 * search))
            .map(|n| 1.0 / n as f32)
            .collect();
        prop_assert_eq!(tfi(packed, at, search).unwrap(), wanted);
    }

    #[test]
    fn isi_map_equals_searching((g, bytes) in stream(), at in 0_usize..40) {
        let packed = SpikeFramesRef::new(g, &bytes).unwrap();
        let at = at % packed.readouts();
        let wanted: Vec<u32> = pixels(packed)
            .map(|(r, c)| naive_interval(packed, at, usize::MAX, r, c).unwrap_or(0) as u32)
            .collect();
        prop_assert_eq!(isi_map(packed, at).unwrap(), wanted);
    }
}

#[test]
fn bits_beyond_the_last_pixel_are_not_looked_at() {
    let bytes = vec![0xff; 3];
    let packed = SpikeFramesRef::new(Geometry::new(3, 1).unwrap(), &bytes).unwrap();
    assert_eq!(tfp(packed, 1, 1).unwrap(), [1.0; 3]);
    assert_eq!(isi_map(packed, 1).unwrap(), [1; 3]);
}

#[test]
fn readouts_beyond_the_stream_and_an_empty_search_are_usage_errors() {
    let packed = SpikeFramesRef::new(Geometry::new(8, 1).unwrap(), &[0; 4]).unwrap();
    assert_eq!(tfp(packed, 4, 1).unwrap_err().kind(), ErrorKind::Usage);
    assert_eq!(tfi(packed, 4, 1).unwrap_err().kind(), ErrorKind::Usage);
    assert_eq!(tfi(packed, 0, 0).unwrap_err().kind(), ErrorKind::Usage);
    assert_eq!(isi_map(packed, 4).unwrap_err().kind(), ErrorKind::Usage);
    assert_eq!(span_rates(packed, 4, 1).unwrap_err().kind(), ErrorKind::Usage);
}

/// Returns a stream of `readouts` readouts from integrators of rate `f` with 4,096 different start phases.
fn integrators(f: f64, readouts: usize) -> (Geometry, Vec<u8>) {
    let geometry = Geometry::new(64, 64).unwrap();
    let mut bytes = vec![0; readouts * geometry.frame_bytes()];
    for (t, frame) in bytes.chunks_exact_mut(geometry.frame_bytes()).enumerate() {
        for p in 0..4096 {
            let phase = (p as f64 + 0.5) / 4096.0;
            if (phase + f * (t + 1) as f64).floor() > (phase + f * t as f64).floor() {
                spikelane::spikes::set_bit(frame, p);
            }
        }
    }
    (geometry, bytes)
}

/// Returns the mean squared error of the span rate in a window of `w` readouts, for pixels with uniform start phases
/// and rate `f`.
///
/// A window contains `n` intervals, where `n` has one of two values. At rate `f`, the span of `n` intervals is `n / f`
/// readouts, rounded down or up. The probability of rounding up is the fractional part of `n / f`.
fn span_error_squared(f: f64, w: f64) -> f64 {
    let (spikes, one_more) = ((w * f).floor(), (w * f).fract());
    let variance = |n: f64| {
        let (low, up) = ((n / f).floor(), (n / f).fract());
        (1.0 - up) * (n / low - f).powi(2) + up * (n / (low + 1.0) - f).powi(2)
    };
    (1.0 - one_more) * variance(spikes - 1.0) + one_more * variance(spikes)
}

/// In a window of `W` readouts at rate `f`, counting spikes gives a rate with the root mean square error
/// `sqrt(x (1 - x)) / W`, where `x` is the fractional part of `f W`.
///
/// [`span_error_squared`] assumes that the number of intervals and the rounding are independent, which is only
/// approximately true. With 4,096 phases, the measured root mean square error differs from this formula by 1 to 4 % at
/// the tested rates.
#[test]
fn the_span_rate_is_off_by_the_rounding_of_its_ends_only() {
    for f in [0.0713, 0.137, 0.2217, 0.3371] {
        let (g, bytes) = integrators(f, 41);
        let packed = SpikeFramesRef::new(g, &bytes).unwrap();
        let off = |rates: Vec<f32>| {
            (rates.iter().map(|r| (f64::from(*r) - f).powi(2)).sum::<f64>() / 4096.0).sqrt()
        };
        let (by_span, by_count) =
            (off(span_rates(packed, 20, 20).unwrap()), off(tfp(packed, 20, 20).unwrap()));
        let ends = span_error_squared(f, 41.0).sqrt();
        assert!((by_span / ends - 1.0).abs() < 0.06, "{f}: {by_span} for {ends}");
        let x = (41.0 * f).fract();
        let counted = (x * (1.0 - x)).sqrt() / 41.0;
        assert!((by_count / counted - 1.0).abs() < 0.01, "{f}: {by_count} for {counted}");
        assert!(by_span < by_count / 2.0, "{f}: {by_span} and {by_count}");
    }
}

/// In the middle of 100 readouts, all intervals of up to 11 readouts are complete. Five readouts from either end, at
/// least a third of the intervals are open.
#[test]
fn tfi_counts_in_the_middle_of_a_stream_and_not_at_its_ends() {
    let (g, bytes) = integrators(0.0951, 100);
    let packed = SpikeFramesRef::new(g, &bytes).unwrap();
    for (at, wanted) in [(0, false), (5, false), (15, true), (50, true), (85, true), (94, false), (99, false)]
    {
        let tfi = tfi_with_open_pixels(packed, at, 300).unwrap();
        assert_eq!(tfi.is_measurable(), wanted, "at {at}: {} open", tfi.open_pixels);
    }
    // If a pixel is silent in all readouts of the search, its image value is dark, and the interval is not open. The
    // ends of the stream then do not matter.
    let dark = vec![0; 100 * g.frame_bytes()];
    let packed = SpikeFramesRef::new(g, &dark).unwrap();
    assert!(tfi_with_open_pixels(packed, 50, 40).unwrap().is_measurable());
    assert!(!tfi_with_open_pixels(packed, 50, 60).unwrap().is_measurable());
}

/// Returns two similar images from a linear congruential generator.
fn pictures(g: Geometry) -> (Vec<f32>, Vec<f32>) {
    let mut state = 7_u32;
    let mut next = move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / 16_777_216.0
    };
    let a: Vec<f32> = (0..g.pixels()).map(|p| (p % 7) as f32 / 10.0 + 0.3 * next()).collect();
    let b = a.iter().map(|x| x + 0.1 * next()).collect();
    (a, b)
}

#[test]
fn psnr_of_a_known_error() {
    // A constant error of a tenth of the peak gives 20 dB. In f32, the difference 0.6 - 0.5 deviates from 0.1 by about
    // 6e-8.
    let value = psnr(&[0.5; 64], &[0.6; 64], 1.0).unwrap();
    assert!((value - 20.0).abs() < 1e-5);
    assert_eq!(psnr(&[0.5; 4], &[0.5; 4], 1.0).unwrap(), f64::INFINITY);
}

#[test]
fn ssim_equals_the_definition_window_by_window() {
    let g = Geometry::new(19, 14).unwrap();
    let (a, b) = pictures(g);
    let gauss = |d: i32| (-f64::from(d * d) / (2.0 * 1.5 * 1.5)).exp();
    let (mut sum, mut windows) = (0.0, 0.0);
    for (top, left) in (0..4).flat_map(|r| (0..9).map(move |c| (r, c))) {
        let cells: Vec<(f64, f64, f64)> = (0..121)
            .map(|i| {
                let (r, c) = (i / 11, i % 11);
                let p = (top + r) * 19 + left + c;
                let weight = gauss(r as i32 - 5) * gauss(c as i32 - 5);
                (weight, f64::from(a[p]), f64::from(b[p]))
            })
            .collect();
        let all: f64 = cells.iter().map(|c| c.0).sum();
        let mean =
            |f: &dyn Fn(f64, f64) -> f64| cells.iter().map(|&(w, x, y)| w * f(x, y)).sum::<f64>() / all;
        let (ma, mb) = (mean(&|x, _| x), mean(&|_, y| y));
        let (va, vb) = (mean(&|x, _| (x - ma).powi(2)), mean(&|_, y| (y - mb).powi(2)));
        let cov = mean(&|x, y| (x - ma) * (y - mb));
        let (c1, c2) = (1e-4, 9e-4);
        sum += (2.0 * ma * mb + c1) * (2.0 * cov + c2) / ((ma * ma + mb * mb + c1) * (va + vb + c2));
        windows += 1.0;
    }
    // `ssim` computes a variance as the difference of a sum of squares and a squared sum. Its rounding error changes a
    // score by about 1e-15 / c2.
    assert!((ssim(&a, &b, g, 1.0).unwrap() - sum / windows).abs() < 1e-10);
}

#[test]
fn ssim_of_a_picture_with_itself_is_one() {
    let g = Geometry::new(30, 20).unwrap();
    let (a, _) = pictures(g);
    assert!((ssim(&a, &a, g, 1.0).unwrap() - 1.0).abs() < 1e-12);
}

#[test]
fn pictures_that_do_not_match_are_usage_errors() {
    let small = Geometry::new(10, 20).unwrap();
    assert_eq!(ssim(&[0.0; 200], &[0.0; 200], small, 1.0).unwrap_err().kind(), ErrorKind::Usage);
    assert_eq!(psnr(&[0.0; 3], &[0.0; 4], 1.0).unwrap_err().kind(), ErrorKind::Usage);
    assert_eq!(psnr(&[0.0; 3], &[0.0; 3], 0.0).unwrap_err().kind(), ErrorKind::Usage);
    assert_eq!(psnr(&[], &[], 1.0).unwrap_err().kind(), ErrorKind::Usage);
}
