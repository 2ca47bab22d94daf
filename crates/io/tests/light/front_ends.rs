//! Pictures in color become the light that the programs behind the presets make of them.

use image::{Rgb, RgbImage};
use spikelane::presets;
use spikelane_io::light::{Frame, InputOptions, open};

/// Pillow's convert('L').
fn pillow([r, g, b]: [u8; 3]) -> f64 {
    f64::from((19595 * u32::from(r) + 38470 * u32::from(g) + 7471 * u32::from(b) + 32768) >> 16)
}

/// OpenCV's cvtColor(COLOR_BGR2GRAY) of 8 bits.
fn opencv([r, g, b]: [u8; 3]) -> f64 {
    f64::from((9798 * u32::from(r) + 19235 * u32::from(g) + 3735 * u32::from(b) + 16384) >> 15)
}

/// The light of a color by the original's rule, in full scales; `peak` is the brightest gray code of the picture.
fn expected(name: &str, color: [u8; 3], peak: f64) -> f64 {
    match name {
        "spcs" | "scsim-code" | "scsim-paper" => pillow(color) / 255.0,
        "spikecv-image" => color.iter().map(|&c| f64::from(c)).sum::<f64>() / 3.0 / 255.0,
        "spikingsim" => opencv(color) / peak,
        _ => opencv(color) / 255.0,
    }
}

/// A mean of three codes is kept in 16 bits, to half a step of 1/65535: 7.7e-6. A gray code that is rounded the other way would
/// be off by 4e-3.
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
            let mut source = open(&path, &InputOptions::of(&camera)).unwrap();
            let mut frame = Frame::dark(source.geometry());
            assert!(source.next_frame(&mut frame).unwrap());
            for (color, found) in colors.iter().zip(frame.to_f32()) {
                let wanted = expected(name, *color, peak);
                assert!((f64::from(found) - wanted).abs() < 7.7e-6, "{name} {color:?}: {found} {wanted}");
            }
        }
    }
}
