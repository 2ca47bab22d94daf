//! Whether the estimator finds a camera of known truth again, against the Cramer-Rao bound.

mod calibrate_support;

use calibrate_support::{Noise, PUBLISHED, Pixel, level, pixels};
use spikelane::calibrate::{Calibration, Observed, Options, Weighting, calibrate};
use spikelane::spikes::Geometry;

fn observed(noise: &Noise, truth: &[Pixel], width: u32, readouts: u32) -> Observed {
    let one = |k: u32| {
        let light = f64::from(10 * k) / 255.0;
        level(noise, truth, light, readouts, 77 + u64::from(k), light < 0.12)
    };
    Observed {
        geometry: Geometry::new(width, truth.len() as u32 / width).unwrap(),
        readout_hz: 20_000.0,
        levels: (0..25).map(one).collect(),
        others: Vec::new(),
    }
}

/// Bound on the variances of `a` and `d` of a pixel: Fisher information of its rates by time, with the
/// phase noise of each level (light's quanta only where there is light).
fn bound(noise: &Noise, pixel: &Pixel, readouts: u32) -> (f64, f64) {
    let (mut s0, mut s1, mut s2) = (0.0, 0.0, 0.0);
    for k in 0..25 {
        let light = f64::from(10 * k) / 255.0;
        let x = pixel.a() * light + pixel.d();
        if x > 0.983 {
            continue;
        }
        let sigma = noise.sigma_t / pixel.phi;
        let weights = Weighting { threshold: sigma * sigma, light: pixel.a() / noise.photons, dark: 0.0 };
        let v = weights.variance(x, x * f64::from(readouts), pixel.a() * light / x);
        if v > 0.0 {
            s0 += 1.0 / v;
            s1 += light / v;
            s2 += light * light / v;
        }
    }
    let det = s0 * s2 - s1 * s1;
    (s0 / det, s2 / det)
}

struct Score {
    ratio: [f64; 2],
    rmse: [f64; 2],
    coverage: [f64; 2],
}

/// RMSE of all pixels with a dark rate (one spike or more expected, so that a bound exists).
fn score(noise: &Noise, truth: &[Pixel], found: &Calibration, readouts: u32) -> Score {
    let (mut squares, mut bounds, mut inside, mut n) = ([0.0; 2], [0.0; 2], [0.0; 2], 0.0);
    for (pixel, fit) in truth.iter().zip(&found.fits) {
        if pixel.d() * f64::from(readouts) < 3.0 || !fit.a.is_finite() {
            continue;
        }
        let (va, vd) = bound(noise, pixel, readouts);
        let off = [fit.a - pixel.a(), fit.d - pixel.d()];
        for (i, (b, v)) in [(va, fit.var_a), (vd, fit.var_d)].into_iter().enumerate() {
            squares[i] += off[i] * off[i];
            bounds[i] += b;
            inside[i] += f64::from(u8::from(off[i].abs() < 1.96 * v.sqrt()));
        }
        n += 1.0;
    }
    Score {
        ratio: [0, 1].map(|i| (squares[i] / bounds[i]).sqrt()),
        rmse: [0, 1].map(|i| (squares[i] / n).sqrt()),
        coverage: inside.map(|i| i / n),
    }
}

fn spread(values: &[f64]) -> (f64, f64) {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let squares = values.iter().map(|x| (x - mean).powi(2)).sum::<f64>();
    (mean, (squares / (values.len() as f64 - 1.0)).sqrt())
}

fn report(noise: &Noise, truth: &[Pixel], found: &Calibration, readouts: u32) -> Score {
    let s = score(noise, truth, found, readouts);
    println!("{} pixels, {readouts} readouts", truth.len());
    println!("rmse a {:.6} % d {:.4} %", 100.0 * s.rmse[0], 100.0 * s.rmse[1] / noise.dark);
    println!("over the bound {:.3?}, coverage {:.4?}", s.ratio, s.coverage);
    println!("{:#?}", found.population);
    println!("sigma_t {:?} true {}", found.sigma_t, noise.sigma_t);
    println!("electrons {:?}, share {:?}, {:?}", found.electrons, found.bias_share, found.redrawn);
    println!("misfits {} chi2 {:?}", found.misfits.len(), found.chi2_per_freedom());
    println!("levels {:?}", found.levels.iter().map(|l| (l.1.value * 1e6).round() / 1.0).collect::<Vec<_>>());
    s
}

fn check(width: u32, height: u32, readouts: u32, seed: u64) {
    let noise = PUBLISHED;
    let truth = pixels(&noise, (width * height) as usize, seed);
    let found = calibrate(&observed(&noise, &truth, width, readouts), &Options::default()).unwrap();
    let s = report(&noise, &truth, &found, readouts);
    let n = truth.len() as f64;
    // RMSE of n pixels has a relative error of 1/sqrt(2 n), coverage one of sqrt(.05 * .95 / n).
    let slack = 4.0 / (2.0 * n).sqrt();
    assert!(s.ratio.iter().all(|r| *r < 1.15 + slack && *r > 0.95 - slack), "{:?}", s.ratio);
    let slack = 4.0 * (0.05 * 0.95 / n).sqrt();
    assert!(s.coverage.iter().all(|c| (0.92 - slack..0.98 + slack).contains(c)), "{:?}", s.coverage);
    let (mean_a, sd_a) = spread(&truth.iter().map(Pixel::a).collect::<Vec<_>>());
    let (mean_d, sd_d) = spread(&truth.iter().map(Pixel::d).collect::<Vec<_>>());
    let p = &found.population;
    for (found, truth) in [(p.mean_a, mean_a), (p.sd_a, sd_a), (p.mean_d, mean_d), (p.sd_d, sd_d)] {
        assert!((found.value / truth - 1.0).abs() < 5e-3, "{found:?} for {truth}");
    }
    let phi = p.sigma_phi;
    assert!((phi.value - noise.threshold_sd).abs() < 3.0 * phi.error, "{phi:?}");
    assert!((found.sigma_t.value - noise.sigma_t).abs() < 3.0 * found.sigma_t.error, "{:?}", found.sigma_t);
    if n > 9e4 {
        assert!(phi.error / phi.value < 0.025, "{phi:?}");
        assert!(found.sigma_t.error / found.sigma_t.value < 0.005, "{:?}", found.sigma_t);
    }
}

#[test]
fn a_camera_of_known_truth_is_recovered_near_the_bound() {
    check(64, 40, 10_000, 5);
}

#[test]
#[ignore = "400x250 pixels take minutes; the figures of docs/calibration.md"]
fn a_whole_sensor_is_recovered_near_the_bound() {
    check(400, 250, 10_000, 9);
}
