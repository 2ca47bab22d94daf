//! Interval statistics of the plan against the exact law, and against a real camera's flat wall.

use crate::common_oracle::{Estimate, Times, oracle, planned, preset, seeds, spread_light};
use spikelane::Camera;

const LAGS: [usize; 3] = [1, 8, 32];

/// Light that gives a nominal pixel of `camera` this rate, dark current included.
fn light_for(camera: &Camera, rate: f64) -> f64 {
    camera.operating(rate).light.max(0.0)
}

/// The mean over `chosen` pixels of the difference of their `D(n)`; pairs share fixed pattern and light.
fn paired(a: &Times, b: &Times, n: usize, chosen: impl Fn(usize) -> bool) -> Estimate {
    let one = |t: &[u32]| Times { readouts: 0, pixels: vec![t.to_vec()] }.d(n).mean;
    let pairs = a.pixels.iter().zip(&b.pixels).enumerate().filter(|(p, _)| chosen(*p));
    Estimate::of(pairs.map(|(_, (a, b))| one(a) - one(b)).filter(|d| d.is_finite()))
}

/// Both sides see the same 240 pixels under the same light (5 % spread) for 20,000 readouts,
/// with independent noise. Pixels whose exact law expects fewer than 2.4 n spikes are left
/// out on both sides. The standard error comes from the scatter over pixels of the paired
/// difference, 4.5 of them are allowed (30 comparisons: one false alarm in 5,000 runs). What
/// it sees: at rate 0.195 about 0.002 in D(1), 0.004 in D(8) and 0.01 in D(32), so 1 % of the
/// phase variance at dim light and a fifth of it at bright light; the errors are printed.
fn agree(name: &str) {
    let camera = preset(name, 240, 1);
    let readouts = 20_000;
    let model = camera.model(seeds(0)).unwrap();
    for (i, rate) in [0.005, 0.05, 0.195, 0.45, 0.95].into_iter().enumerate() {
        let light = spread_light(light_for(&camera, rate), 0.05, 240, 77);
        let truth = oracle(&model, &light, 500, readouts, 10 + i as u64);
        let found = planned(&camera, seeds(20 + i as u64), &light, 500, readouts);
        let rates = Estimate::of(found.rates().zip(truth.rates()).map(|(a, b)| a - b));
        let expected = |p: usize| {
            let law = model.law(p);
            (law.gain * f64::from(light[p]) + law.dark) / law.threshold * readouts as f64
        };
        eprintln!("{name} {rate}: oracle's rate {}, difference {rates}", truth.rate());
        // Counts of the same mean differ by less than a spike; 4.5 errors of the mean.
        assert!(rates.mean.abs() < 4.5 * rates.error.max(1e-7), "{name} at {rate}: {rates}");
        for n in LAGS {
            let difference = paired(&found, &truth, n, |p| expected(p) > 2.4 * n as f64);
            eprintln!("  D({n}) oracle {}, plan - oracle {difference}", truth.d(n));
            assert!(difference.pixels >= 60, "{name} at {rate}, D({n}): {} pixels", difference.pixels);
            let bound = 4.5 * difference.error.max(1e-6);
            assert!(difference.mean.abs() < bound, "{name} at {rate}, D({n}): {difference}");
        }
    }
}

#[test]
fn physical_has_the_interval_statistics_of_its_exact_law() {
    agree("physical");
}

#[test]
fn scsim_code_has_the_interval_statistics_of_its_exact_law() {
    agree("scsim-code");
}

/// Published for a real 400x250 camera's flat wall at rate 0.195.
const WALL: [(usize, f64); 4] = [(8, 0.1742), (16, 0.1823), (24, 0.1879), (32, 0.1912)];

/// A wall of rate 0.195 whose rates spread by 5 %, of which 2 % are the camera's own gain.
fn wall(camera: &Camera, pixels: usize, seed: u64) -> Vec<f32> {
    spread_light(light_for(camera, 0.195), 0.0458, pixels, seed)
}

/// Over long streams, where the pixel's mean interval is known, D(n) is 1/6 (quantisation at
/// uniform phase) plus n (1/K + kT/(C V^2)) / f^2, K = 29,852 electrons: .1740, .1812, .1884,
/// .1957. 20,000 pixels x 3,000 readouts give each to 0.0005; the bound is 0.006.
#[test]
fn physical_has_the_lags_of_a_real_wall() {
    let camera = preset("physical", 200, 100);
    let found = planned(&camera, seeds(3), &wall(&camera, 20_000, 5), 500, 3000);
    for (n, real) in WALL {
        let d = found.d(n);
        let derived = 1.0 / 6.0 + n as f64 * (1.0 / 29_852.0 + 7.69e-7) / 0.195f64.powi(2);
        eprintln!("D({n}): physical {d}, derived {derived:.4}, real {real}");
        assert!(d.error < 0.001, "the test would not see 0.006: {d}");
        assert!((d.mean - real).abs() < 0.006, "D({n}): {d}, real {real}");
        assert!((d.mean - derived).abs() < 0.004, "D({n}): {d}, derived {derived}");
    }
}

/// A recording of 300 readouts knows the mean interval of a pixel from 58 spikes only; that
/// alone lifts D(32) to 0.22 for the real recording, the exact law and the plan alike, so
/// such a short stream is compared with another of its length.
#[test]
fn physical_has_the_lags_and_outliers_of_its_law_over_three_hundred_readouts() {
    let camera = preset("physical", 200, 50);
    let light = wall(&camera, 10_000, 5);
    let found = planned(&camera, seeds(4), &light, 500, 300);
    let truth = oracle(&camera.model(seeds(0)).unwrap(), &light, 500, 300, 6);
    for (n, _) in WALL {
        let difference = paired(&found, &truth, n, |_| true);
        eprintln!("D({n}) over 300 readouts: oracle {}, plan - oracle {difference}", truth.d(n));
        assert!(difference.error < 0.002, "the test would not see 0.01: {difference}");
        assert!(difference.mean.abs() < 4.5 * difference.error, "D({n}): {difference}");
    }
    let (plan, law) = (found.outliers(), truth.outliers());
    eprintln!("outliers: plan {plan:.2e}, oracle {law:.2e}, real 5e-4 to 7e-4");
    // 570,000 intervals hold about 430 outliers, known to 5 %; 4.5 joint errors are 30 %.
    assert!((plan / law - 1.0).abs() < 0.3);
    assert!((5e-4 * 2.0 / 3.0..7e-4 * 4.0 / 3.0).contains(&plan), "{plan}");
}

/// The real recording and `physical` under the same statistic, length and choice of pixels.
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
    // The rows of a `.dat` file lie from the bottom to the top, 50 whole bytes each.
    let file = std::fs::read(&path).unwrap();
    let bytes: Vec<u8> =
        file.chunks_exact(g.frame_bytes()).flat_map(|f| f.rchunks_exact(50)).flatten().copied().collect();
    let all = crate::common_oracle::unpack(&bytes, g);
    // The wall, right of its middle: rows 120 to 159, columns 260 to 339, rates within 15 % of 0.195.
    let chosen = |p: usize| {
        let rate = all.pixels[p].len() as f64 / all.readouts as f64;
        (120..160).contains(&(p / 400)) && (260..340).contains(&(p % 400)) && (0.166..0.224).contains(&rate)
    };
    let real = Times {
        readouts: all.readouts,
        pixels: (0..g.pixels()).filter(|&p| chosen(p)).map(|p| all.pixels[p].clone()).collect(),
    };
    // `physical` in the light that gives every pixel the rate it was recorded with; its own
    // gain would widen the spread a second time.
    let camera = preset("physical", real.pixels.len() as u32, 1).without("prnu").without("hot_pixels");
    let rates = real.pixels.iter().map(|t| 1.0 / crate::common_oracle::mean_interval(t));
    let light: Vec<f32> = rates.map(|r| light_for(&camera, r) as f32).collect();
    let found = planned(&camera, seeds(8), &light, 500, real.readouts);
    eprintln!("{} pixels, rate {}, spread {:.3}", real.pixels.len(), real.rate(), real.spread());
    for n in [1, 8, 16, 24, 32] {
        let (a, b) = (real.d(n), found.d(n));
        eprintln!("D({n}): real {a}, physical {b}");
        assert!(n < 8 || (a.mean - b.mean).abs() < 0.006, "D({n}): real {a}, physical {b}");
    }
    eprintln!("outliers: real {:.2e}, physical {:.2e}", real.outliers(), found.outliers());
}
