//! Interval statistics of the plan. They are compared with the exact law, and with the recording of a flat wall by a
//! real camera.

use crate::common_oracle::{Estimate, SpikeTimes, oracle, preset, seeds, simulate_times, spread_light};
use spikelane::Camera;

const LAGS: [usize; 3] = [1, 8, 32];

/// Returns the light at which a nominal pixel of `camera` has the rate `rate`. The dark current contributes to this rate.
fn light_for(camera: &Camera, rate: f64) -> f64 {
    camera.operating_point(rate).light.max(0.0)
}

/// Returns the mean difference of `D(n)` between `a` and `b` for the `chosen` pixels. A pixel has equal fixed pattern
/// and light in `a` and `b`.
fn paired(a: &SpikeTimes, b: &SpikeTimes, n: usize, chosen: impl Fn(usize) -> bool) -> Estimate {
    let one = |t: &[u32]| SpikeTimes { readouts: 0, pixels: vec![t.to_vec()] }.interval_sum_variance(n).mean;
    let pairs = a.pixels.iter().zip(&b.pixels).enumerate().filter(|(p, _)| chosen(*p));
    Estimate::from_values(pairs.map(|(_, (a, b))| one(a) - one(b)).filter(|d| d.is_finite()))
}

/// Compares the plan with the exact law for 240 pixels under equal light (5 % spread) for 20,000 readouts.
///
/// The noise of the plan is independent of the noise of the law. The comparison of D(n) excludes pixels for which the
/// law predicts at most 2.4 n spikes. The standard error is computed from the scatter of the paired differences between
/// pixels. The test allows 4.5 standard errors. With 30 comparisons, one false alarm in 5,000 runs is expected.
///
/// At rate 0.195 the test detects differences of about 0.002 in D(1), 0.004 in D(8) and 0.01 in D(32). The test prints
/// the errors of all rates. It detects a change of the phase variance by 1 % in dim light and by a fifth in bright
/// light.
fn check_preset(name: &str) {
    let camera = preset(name, 240, 1);
    let readouts = 20_000;
    let model = camera.model(seeds(0)).unwrap();
    for (i, rate) in [0.005, 0.05, 0.195, 0.45, 0.95].into_iter().enumerate() {
        let light = spread_light(light_for(&camera, rate), 0.05, 240, 77);
        let truth = oracle(&model, &light, 500, readouts, 10 + i as u64);
        let times = simulate_times(&camera, seeds(20 + i as u64), &light, 500, readouts);
        let rates = Estimate::from_values(times.rates().zip(truth.rates()).map(|(a, b)| a - b));
        let expected = |p: usize| {
            let law = model.law(p);
            (law.gain * f64::from(light[p]) + law.dark) / law.threshold * readouts as f64
        };
        eprintln!("{name} {rate}: oracle's rate {}, difference {rates}", truth.rate());
        // With equal mean increments, the spike counts of plan and law differ by less than one spike. The test allows
        // 4.5 standard errors of the mean.
        assert!(rates.mean.abs() < 4.5 * rates.error.max(1e-7), "{name} at {rate}: {rates}");
        for n in LAGS {
            let difference = paired(&times, &truth, n, |p| expected(p) > 2.4 * n as f64);
            eprintln!("  D({n}) oracle {}, plan - oracle {difference}", truth.interval_sum_variance(n));
            assert!(difference.pixels >= 60, "{name} at {rate}, D({n}): {} pixels", difference.pixels);
            let bound = 4.5 * difference.error.max(1e-6);
            assert!(difference.mean.abs() < bound, "{name} at {rate}, D({n}): {difference}");
        }
    }
}

#[test]
fn physical_has_the_interval_statistics_of_its_exact_law() {
    check_preset("physical");
}

#[test]
fn scsim_code_has_the_interval_statistics_of_its_exact_law() {
    check_preset("scsim-code");
}

/// Lags `n` and published values of `D(n)` for the flat wall of a real 400x250 camera, at rate 0.195.
const WALL_GROWTH: [(usize, f64); 4] = [(8, 0.1742), (16, 0.1823), (24, 0.1879), (32, 0.1912)];

/// Returns the light of a wall with rate 0.195. The rates have a spread of 5 %, because sqrt(4.58^2 + 2^2) = 5: the
/// light contributes 4.58 %, and the gain of the camera contributes 2 %.
fn wall_light(camera: &Camera, pixels: usize, seed: u64) -> Vec<f32> {
    spread_light(light_for(camera, 0.195), 0.0458, pixels, seed)
}

/// Compares `D(n)` in long streams, in which the mean interval of each pixel is well known.
///
/// In a long stream, `D(n)` is 1/6 (quantization at uniform phase) plus n (1/K + kT/(C V^2)) / f^2. Here f = 0.195 is
/// the rate, K = 29,852 is the number of electrons per threshold, and kT/(C V^2) is the thermal noise. For the lags 8,
/// 16, 24 and 32, `D(n)` is 0.1740, 0.1812, 0.1884 and 0.1957. With 20,000 pixels and 3,000 readouts, the standard
/// error is 0.0005. The bound is 0.006.
#[test]
fn physical_has_the_lags_of_a_real_wall() {
    let camera = preset("physical", 200, 100);
    let times = simulate_times(&camera, seeds(3), &wall_light(&camera, 20_000, 5), 500, 3000);
    for (n, real) in WALL_GROWTH {
        let d = times.interval_sum_variance(n);
        let derived = 1.0 / 6.0 + n as f64 * (1.0 / 29_852.0 + 7.69e-7) / 0.195f64.powi(2);
        eprintln!("D({n}): physical {d}, derived {derived:.4}, real {real}");
        assert!(d.error < 0.001, "the test would not see 0.006: {d}");
        assert!((d.mean - real).abs() < 0.006, "D({n}): {d}, real {real}");
        assert!((d.mean - derived).abs() < 0.004, "D({n}): {d}, derived {derived}");
    }
}

/// Compares streams of 300 readouts, in which the mean interval of each pixel is estimated from only 58 spikes.
///
/// The error of a mean interval from 58 spikes increases D(32) to 0.22 in the real recording, in the exact law and in
/// the plan. A short stream must therefore be compared with another stream of equal length.
#[test]
fn physical_has_the_lags_and_outliers_of_its_law_over_three_hundred_readouts() {
    let camera = preset("physical", 200, 50);
    let light = wall_light(&camera, 10_000, 5);
    let times = simulate_times(&camera, seeds(4), &light, 500, 300);
    let truth = oracle(&camera.model(seeds(0)).unwrap(), &light, 500, 300, 6);
    for (n, _) in WALL_GROWTH {
        let difference = paired(&times, &truth, n, |_| true);
        eprintln!(
            "D({n}) over 300 readouts: oracle {}, plan - oracle {difference}",
            truth.interval_sum_variance(n)
        );
        assert!(difference.error < 0.002, "the test would not see 0.01: {difference}");
        assert!(difference.mean.abs() < 4.5 * difference.error, "D({n}): {difference}");
    }
    let (plan, law) = (times.outliers(), truth.outliers());
    eprintln!("outliers: plan {plan:.2e}, oracle {law:.2e}, real 5e-4 to 7e-4");
    // 570,000 intervals contain about 430 outliers, with a standard error of 5 %. 4.5 joint standard errors of plan and
    // law are 30 %.
    assert!((plan / law - 1.0).abs() < 0.3);
    assert!((5e-4 * 2.0 / 3.0..7e-4 * 4.0 / 3.0).contains(&plan), "{plan}");
}

/// Compares the real recording with a simulation of `physical`. Both streams have equal length, and the same pixels are
/// selected from both.
#[test]
fn physical_has_the_lags_of_the_recording_itself() {
    let Ok(folder) = std::env::var("SPIKELANE_REAL_DATA") else {
        eprintln!("skipped: SPIKELANE_REAL_DATA names no folder with recordings");
        return;
    };
    let path = std::path::Path::new(&folder).join("static_400x250x300.dat");
    let path =
        if path.is_file() { path } else { path.with_file_name("real").join(path.file_name().unwrap()) };
    let g = spikelane::Geometry::new(400, 250).unwrap();
    // A `.dat` file stores the rows from bottom to top. Each row has 50 bytes.
    let file = std::fs::read(&path).unwrap();
    let bytes: Vec<u8> =
        file.chunks_exact(g.frame_bytes()).flat_map(|f| f.rchunks_exact(50)).flatten().copied().collect();
    let all = crate::common_oracle::unpack(&bytes, g);
    // The selected pixels show the wall to the right of the center: rows 120 to 159 and columns 260 to 339. Their rates
    // are within 15 % of 0.195.
    let chosen = |p: usize| {
        let rate = all.pixels[p].len() as f64 / all.readouts as f64;
        (120..160).contains(&(p / 400)) && (260..340).contains(&(p % 400)) && (0.166..0.224).contains(&rate)
    };
    let real = SpikeTimes {
        readouts: all.readouts,
        pixels: (0..g.pixels()).filter(|&p| chosen(p)).map(|p| all.pixels[p].clone()).collect(),
    };
    // Each pixel of `physical` receives the light that gives its recorded rate. The recorded rates already contain the
    // camera's gain spread, so the preset's gain spread is removed.
    let camera =
        preset("physical", real.pixels.len() as u32, 1).without_effect("prnu").without_effect("hot_pixels");
    let rates = real.pixels.iter().map(|t| 1.0 / crate::common_oracle::mean_interval(t));
    let light: Vec<f32> = rates.map(|r| light_for(&camera, r) as f32).collect();
    let times = simulate_times(&camera, seeds(8), &light, 500, real.readouts);
    eprintln!("{} pixels, rate {}, spread {:.3}", real.pixels.len(), real.rate(), real.spread());
    for n in [1, 8, 16, 24, 32] {
        let (a, b) = (real.interval_sum_variance(n), times.interval_sum_variance(n));
        eprintln!("D({n}): real {a}, physical {b}");
        assert!(n < 8 || (a.mean - b.mean).abs() < 0.006, "D({n}): real {a}, physical {b}");
    }
    eprintln!("outliers: real {:.2e}, physical {:.2e}", real.outliers(), times.outliers());
}
