//! Compares block matching with slow loops and with known motion.

use spikelane::{ErrorKind, Geometry};
use spikelane_benchmark::block_matching::{BlockMatching, flow_between_images, flow_between_readouts};

/// Returns uniform random numbers from -0.5 to 0.5.
fn random(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed;
    move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 53) as f64 - 0.5
    }
}

/// The light of a textured scene at any position: waves with periods of 7 to 90 pixels in twelve directions. Like in natural
/// images, the amplitude grows with the period.
fn light(x: f64, y: f64) -> f64 {
    let wave = |k: i32| {
        let (period, angle) = (7.0 * 1.26_f64.powi(k), 2.4 * f64::from(k));
        let position = x * angle.cos() + y * angle.sin();
        period / 40.0 * (std::f64::consts::TAU * position / period + f64::from(k * k)).sin()
    };
    (0..12).map(wave).sum()
}

/// Returns an image of the scene after a displacement to the right and downward.
fn image(geometry: Geometry, [right, down]: [f64; 2]) -> Vec<f32> {
    let width = geometry.width();
    let at = |p: usize| light((p % width) as f64 - right, (p / width) as f64 - down) as f32;
    (0..geometry.pixels()).map(at).collect()
}

/// Returns the mean error, and the share of errors above 1 pixel, of the pixels at least `margin` pixels from the border.
fn errors(flow: &[[f32; 2]], geometry: Geometry, truth: [f64; 2], margin: usize) -> (f64, f64) {
    let (w, h) = (geometry.width(), geometry.height());
    let pixels = (margin..h - margin).flat_map(|y| (margin..w - margin).map(move |x| y * w + x));
    let error = |p: usize| {
        let [u, v] = flow[p].map(f64::from);
        (u - truth[0]).hypot(v - truth[1])
    };
    let all: Vec<f64> = pixels.map(error).collect();
    let count = all.len() as f64;
    (all.iter().sum::<f64>() / count, all.iter().filter(|error| **error > 1.0).count() as f64 / count)
}

/// A displacement of 13 pixels is beyond the search of one level. In this pyramid of four levels, the coarsest level finds
/// displacements of up to 2 x 8 pixels. Where one wave dominates, the displacement along its crests is hardly determined.
/// Elsewhere, the error of a fraction is a tenth of a pixel. A search that misses a level of the pyramid is wrong by at
/// least two pixels at most pixels. The margin keeps the blocks of the coarser levels inside both images.
#[test]
fn uniform_motion_is_found_over_the_range_of_the_pyramid() {
    let geometry = Geometry::new(240, 200).unwrap();
    let first = image(geometry, [0.0; 2]);
    for truth in [[0.0, 0.0], [3.25, -1.75], [-9.5, 6.0], [13.0, -8.5]] {
        let second = image(geometry, truth);
        let flow = flow_between_images(&first, &second, geometry, BlockMatching::default()).unwrap();
        let (mean, wrong) = errors(&flow, geometry, truth, 60);
        assert!(mean < 0.3 && wrong < 0.05, "{truth:?}: mean {mean}, wrong {wrong}");
    }
}

/// Computes the mean squared difference of two blocks pixel by pixel.
fn difference(
    [first, second]: [&[f32]; 2],
    geometry: Geometry,
    radius: i64,
    at: [i64; 2],
    d: [i64; 2],
) -> Option<f64> {
    let (w, h) = (geometry.width() as i64, geometry.height() as i64);
    let value = |image: &[f32], x: i64, y: i64| {
        ((0..w).contains(&x) && (0..h).contains(&y)).then(|| f64::from(image[(y * w + x) as usize]))
    };
    let (mut sum, mut pixels) = (0.0, 0);
    for (j, i) in (-radius..=radius).flat_map(|j| (-radius..=radius).map(move |i| (j, i))) {
        let (x, y) = (at[0] + i, at[1] + j);
        if let (Some(a), Some(b)) = (value(first, x, y), value(second, x + d[0], y + d[1])) {
            sum += (a - b).powi(2);
            pixels += 1;
        }
    }
    (4 * pixels >= (2 * radius + 1).pow(2)).then(|| sum / pixels as f64)
}

/// The oracle tries every displacement of a single level, and computes in f64. The fast path adds squares in f32. Different
/// noise in both images makes all costs different, so that rounding does not select the displacement. The positions on
/// parabolas differ by less than 1e-3 pixels.
#[test]
fn a_single_level_has_the_displacements_of_an_exhaustive_search() {
    let (geometry, reach, radius, penalty) = (Geometry::new(36, 28).unwrap(), 3_i64, 2_i64, 0.1);
    let (w, h) = (36_i64, 28_i64);
    let mut noise = random(5);
    let mut noisy = |motion| image(geometry, motion).iter().map(|x| x + noise() as f32).collect::<Vec<f32>>();
    let (first, second) = (noisy([0.0; 2]), noisy([1.5, -2.0]));
    let blur = |image: &[f32]| spikelane::reconstruct::gaussian_blur(image, geometry, 1.0);
    let (a, b) = (blur(&first), blur(&second));
    let of_pixel = |p: i64| -> [f64; 2] {
        let at = [p % w, p / w];
        let all = (-reach..=reach).flat_map(|v| (-reach..=reach).map(move |u| [u, v]));
        let cost = |d: [i64; 2]| {
            Some(
                difference([&a, &b], geometry, radius, at, d)?
                    * (1.0 + penalty * (d[0] * d[0] + d[1] * d[1]) as f64),
            )
        };
        let best = all.filter_map(|d| Some((cost(d)?, d))).min_by(|x, y| x.0.total_cmp(&y.0)).unwrap().1;
        [0, 1].map(|axis| {
            let step = |k: i64| {
                let mut d = best;
                d[axis] += k;
                difference([&a, &b], geometry, radius, at, d)
            };
            let fraction = match [step(-1), step(0), step(1)] {
                [Some(before), Some(middle), Some(after)] if before + after > 2.0 * middle => {
                    ((before - after) / 2.0 / (before + after - 2.0 * middle)).clamp(-0.5, 0.5)
                }
                _ => 0.0,
            };
            best[axis] as f64 + fraction
        })
    };
    let wanted: Vec<[f64; 2]> = (0..w * h).map(of_pixel).collect();
    let options = BlockMatching {
        block_radius_px: radius as usize,
        search_radius_px: reach as usize,
        min_coarsest_side_px: 1000,
        distance_penalty: penalty,
    };
    let flow = flow_between_images(&first, &second, geometry, options).unwrap();
    for p in 0..w * h {
        let [x, y] = [p % w, p / w];
        for axis in [0, 1] {
            let mut near: Vec<f64> = (y - 1..=y + 1)
                .flat_map(|y| (x - 1..=x + 1).map(move |x| (x, y)))
                .filter(|(x, y)| (0..w).contains(x) && (0..h).contains(y))
                .map(|(x, y)| wanted[(y * w + x) as usize][axis])
                .collect();
            near.sort_by(f64::total_cmp);
            let (found, wanted) = (f64::from(flow[p as usize][axis]), near[near.len() / 2]);
            assert!((found - wanted).abs() < 1e-3, "pixel {x}, {y}: {found} for {wanted}");
        }
    }
}

#[test]
fn images_without_texture_do_not_move() {
    let geometry = Geometry::new(64, 48).unwrap();
    let flat = vec![0.4; geometry.pixels()];
    let flow = flow_between_images(&flat, &flat, geometry, BlockMatching::default()).unwrap();
    assert_eq!(flow, vec![[0.0; 2]; geometry.pixels()]);
}

/// The camera is ideal, and the light moves by 0.025 pixels per readout. In 80 readouts, the motion is 2 pixels.
#[test]
fn spikes_of_moving_light_have_its_flow() {
    let geometry = Geometry::new(96, 72).unwrap();
    let camera = spikelane::Camera::ideal(spikelane::Sensor::new(96, 72, 20_000.0).unwrap());
    let mut simulator = spikelane::Simulator::new(&camera, spikelane::Seeds::default()).unwrap();
    let mut bytes = Vec::new();
    for t in 0..160 {
        let moved = image(geometry, [0.025 * f64::from(t), 0.0]);
        let light: Vec<f32> = moved.iter().map(|x| 0.5 + x / 16.0).collect();
        bytes.extend_from_slice(simulator.run(&light, 1).unwrap().as_bytes());
    }
    let frames = spikelane::SpikeFramesRef::new(geometry, &bytes).unwrap();
    let flow = flow_between_readouts(frames, [40, 120], 39, BlockMatching::default()).unwrap();
    let (mean, _) = errors(&flow, geometry, [2.0, 0.0], 16);
    assert!(mean < 0.3, "{mean}");
    let beyond = flow_between_readouts(frames, [40, 160], 39, BlockMatching::default());
    assert_eq!(beyond.unwrap_err().kind(), ErrorKind::Usage);
}

#[test]
fn faulty_images_and_options_are_refused() {
    let geometry = Geometry::new(32, 32).unwrap();
    let good = image(geometry, [0.0; 2]);
    let mut broken = good.clone();
    broken[9] = f32::NAN;
    let options = BlockMatching::default();
    for (first, second, options) in [
        (&good[1..], &good[..], options),
        (&good, &broken, options),
        (&good, &good, BlockMatching { block_radius_px: 0, ..options }),
        (&good, &good, BlockMatching { search_radius_px: 65, ..options }),
        (&good, &good, BlockMatching { distance_penalty: f64::NAN, ..options }),
    ] {
        let error = flow_between_images(first, second, geometry, options).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Input, "{error}");
    }
}
