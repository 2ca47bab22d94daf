//! Tests that color images produce the same light as the programs that the presets model.

use image::{Rgb, RgbImage};
use spikelane::presets;
use spikelane_io::light::{Frame, InputOptions, open};

/// Computes gray as `convert('L')` of Pillow does.
fn pillow([r, g, b]: [u8; 3]) -> f64 {
    f64::from((19595 * u32::from(r) + 38470 * u32::from(g) + 7471 * u32::from(b) + 32768) >> 16)
}

/// Computes gray as `cvtColor(COLOR_BGR2GRAY)` of OpenCV does for 8 bits.
fn opencv([r, g, b]: [u8; 3]) -> f64 {
    f64::from((9798 * u32::from(r) + 19235 * u32::from(g) + 3735 * u32::from(b) + 16384) >> 15)
}

/// Returns the light of a color in units of full scale. The function computes the light like the program that the
/// preset `name` models. `peak` is the largest gray code of the image.
fn expected(name: &str, color: [u8; 3], peak: f64) -> f64 {
    match name {
        "spcs" | "scsim-code" | "scsim-paper" => pillow(color) / 255.0,
        "spikecv-image" => color.iter().map(|&c| f64::from(c)).sum::<f64>() / 3.0 / 255.0,
        "spikingsim" => opencv(color) / peak,
        _ => opencv(color) / 255.0,
    }
}

/// The mean of three codes is stored in 16 bits with an error of half a step, which is 0.5 / 65535 = 7.6e-6. A gray
/// code that is rounded in the wrong direction would cause an error of 4e-3.
#[test]
fn pictures_become_the_light_of_the_original_programs() {
    let gray = [40, 77, 128, 160, 201, 230].map(|code| [code; 3]);
    let color = [[201, 40, 30], [30, 150, 60], [60, 70, 220], [230, 210, 90], [90, 30, 120], [12, 160, 170]];
    let names = [
        "spcs",
        "spikecv",
        "spike-zoo",
        "spikecv-image",
        "scsim-code",
        "scsim-paper",
        "neuspike",
        "spikingsim",
    ];
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("picture.png");
    for colors in [gray, color] {
        RgbImage::from_fn(colors.len() as u32, 1, |x, _| Rgb(colors[x as usize])).save(&path).unwrap();
        let peak = colors.iter().map(|&c| opencv(c)).fold(0.0, f64::max);
        for name in names {
            let mut camera = presets::builtin(name).unwrap();
            camera.sensor = spikelane::Sensor::new(colors.len() as u32, 1, 20_000.0).unwrap();
            let mut source = open(&path, &InputOptions::from_camera(&camera)).unwrap();
            let mut frame = Frame::dark(source.geometry());
            assert!(source.next_frame(&mut frame).unwrap());
            for (color, actual) in colors.iter().zip(frame.to_f32()) {
                let wanted = expected(name, *color, peak);
                assert!((f64::from(actual) - wanted).abs() < 7.7e-6, "{name} {color:?}: {actual} {wanted}");
            }
        }
    }
}
