//! The 24 patches of the ColorChecker, simulated and reconstructed.
//!
//! The 8-bit sRGB codes are those that X-Rite publishes for its ColorChecker Classic under D65 ("sRGB and CIE L*a*b* values
//! of the ColorChecker").

use spikelane::light::{Frame, OwnedSamples, Transfer};
use spikelane::reconstruct::{ColorMatrix, Demosaic, ciede2000, demosaic, lab, span_rates};
use spikelane::sensor::Mosaic;
use spikelane::{Camera, Geometry, Seeds, Sensor, Simulator, presets};

const PATCHES: [[u8; 3]; 24] = [
    [115, 82, 68],
    [194, 150, 130],
    [98, 122, 157],
    [87, 108, 67],
    [133, 128, 177],
    [103, 189, 170],
    [214, 126, 44],
    [80, 91, 166],
    [193, 90, 99],
    [94, 60, 108],
    [157, 188, 64],
    [224, 163, 46],
    [56, 61, 150],
    [70, 148, 73],
    [175, 54, 60],
    [231, 199, 31],
    [187, 86, 149],
    [8, 133, 161],
    [243, 243, 242],
    [200, 200, 200],
    [160, 160, 160],
    [122, 122, 121],
    [85, 85, 85],
    [52, 52, 52],
];

/// Side of a patch in pixels. Pixels within `BORDER` of another patch are ignored.
const SIDE: usize = 16;
const BORDER: usize = 4;
const READOUTS: usize = 2000;

fn mosaic() -> Mosaic {
    let responses = [('R', [0.78, 0.18, 0.04]), ('G', [0.12, 0.76, 0.12]), ('B', [0.03, 0.22, 0.75])];
    let mosaic = Mosaic::new("BGGR", &responses).unwrap();
    mosaic.with_channel('R', 0.7, 0.02).unwrap().with_channel('B', 0.6, 0.01).unwrap()
}

fn linear(patch: usize) -> [f64; 3] {
    PATCHES[patch].map(|code| Transfer::Srgb.light(f64::from(code) / 255.0))
}

fn geometry() -> Geometry {
    Geometry::new(6 * SIDE as u32, 4 * SIDE as u32).unwrap()
}

fn patch_at(p: usize) -> usize {
    let (row, col) = (p / geometry().width(), p % geometry().width());
    row / SIDE * 6 + col / SIDE
}

/// Returns the rates of a camera in front of the chart, or in darkness.
fn rates(camera: &Camera, is_lit: bool) -> Vec<f32> {
    let scale = if is_lit { 1.0 } else { 0.0 };
    let rgb =
        (0..geometry().pixels()).flat_map(|p| linear(patch_at(p)).map(|x| (scale * x) as f32)).collect();
    let frame = Frame::new(geometry(), OwnedSamples::F32(vec![0.0; geometry().pixels()])).unwrap();
    let light = mosaic().light(&frame.with_rgb(rgb).unwrap()).unwrap();
    let spikes = Simulator::new(camera, Seeds::default()).unwrap().run(&light, READOUTS).unwrap();
    span_rates(spikes.view(), READOUTS / 2, READOUTS / 2).unwrap()
}

/// Returns the mean linear color of each patch.
fn patch_colors(rates: &[f32]) -> Vec<[f64; 3]> {
    let mosaic = mosaic();
    let channels = demosaic(rates, geometry(), &mosaic, Demosaic::Malvar).unwrap();
    let rgb = ColorMatrix::from_response(&mosaic).unwrap().apply(&channels);
    let inside = |p: usize| {
        let (row, col) = (p / geometry().width() % SIDE, p % geometry().width() % SIDE);
        [row, col].iter().all(|x| (BORDER..SIDE - BORDER).contains(x))
    };
    let mut colors = vec![[0.0; 3]; 24];
    let weight = 1.0 / ((SIDE - 2 * BORDER) as f64).powi(2);
    for (p, color) in rgb.as_chunks::<3>().0.iter().enumerate().filter(|(p, _)| inside(*p)) {
        colors[patch_at(p)].iter_mut().zip(color).for_each(|(sum, x)| *sum += weight * f64::from(*x));
    }
    colors
}

fn differences(colors: &[[f64; 3]]) -> Vec<f64> {
    colors.iter().enumerate().map(|(patch, color)| ciede2000(lab(*color), lab(linear(patch)))).collect()
}

/// Returns the largest color difference if the rates of the three channels have errors of up to `error(rate)`.
fn largest_difference(patch: usize, error: impl Fn(f64) -> f64) -> f64 {
    let (mosaic, color) = (mosaic(), linear(patch));
    let matrix = ColorMatrix::from_response(&mosaic).unwrap();
    let exact: Vec<f64> =
        mosaic.channels().iter().map(|c| (0..3).map(|i| c.weights()[i] * color[i]).sum()).collect();
    let at_corner = |corner: usize| {
        let shifted = |(k, rate): (usize, &f64)| {
            let sign = if corner >> k & 1 == 0 { 1.0 } else { -1.0 };
            (rate + sign * error(*rate)) as f32
        };
        let rates: Vec<f32> = exact.iter().enumerate().map(shifted).collect();
        let rgb = matrix.apply(&rates);
        ciede2000(lab([0, 1, 2].map(|i| f64::from(rgb[i]))), lab(color))
    };
    (0..8).map(at_corner).fold(0.0, f64::max)
}

#[test]
fn an_ideal_camera_reproduces_the_colors_of_the_chart() {
    let camera = Camera::ideal(Sensor { geometry: geometry(), ..Sensor::new(8, 8, 20_000.0).unwrap() });
    let found = differences(&patch_colors(&rates(&camera, true)));
    println!(
        "ideal: mean {:.3}, largest {:.3}",
        found.iter().sum::<f64>() / 24.0,
        found.iter().fold(0.0, |a, b| f64::max(a, *b))
    );
    for (patch, difference) in found.iter().enumerate() {
        // A span of T readouts between two spikes has an error below one readout. At least 1900 of 2000 readouts are
        // between the first and the last spike of the darkest patch.
        let bound = largest_difference(patch, |rate| rate / 1900.0 + 1e-6);
        assert!(*difference <= bound, "patch {patch}: {difference}, bound {bound}");
    }
}

#[test]
fn a_noisy_camera_reproduces_the_colors_of_the_chart_after_dark_subtraction() {
    let mut camera = presets::builtin("physical").unwrap();
    camera.sensor.geometry = geometry();
    let lit = patch_colors(&rates(&camera, true));
    let dark = patch_colors(&rates(&camera, false));
    let signal: Vec<[f64; 3]> =
        lit.iter().zip(&dark).map(|(lit, dark)| std::array::from_fn(|i| lit[i] - dark[i])).collect();
    let found = differences(&signal);
    println!(
        "noisy: mean {:.3}, largest {:.3}",
        found.iter().sum::<f64>() / 24.0,
        found.iter().fold(0.0, |a, b| f64::max(a, *b))
    );
    for (patch, difference) in found.iter().enumerate() {
        // The gains have a standard deviation of 2 %, and a patch has at least 16 pixels of each channel, so five standard errors
        // of the mean are 2.5 %. The rounding of spikes to readouts adds two readouts in 2000.
        let bound = largest_difference(patch, |rate| 0.025 * rate + 2.0 / 2000.0);
        assert!(*difference <= bound, "patch {patch}: {difference}, bound {bound}");
    }
}
