//! Color cameras: the bits of a mosaic, demosaicing, and the colors of a chart.

mod chart;

use serde_json::Value;
use spikelane::light::{Frame, OwnedSamples};
use spikelane::reconstruct::{Demosaic, demosaic, psnr};
use spikelane::sensor::Mosaic;
use spikelane::spikes::Crop;
use spikelane::unstable::kernels::Backend;
use spikelane::{Camera, Geometry, Sensor, SimulatorOptions, SpikeFrames, presets};

/// Returns a color image with smooth and random parts, as floats or as 16-bit samples.
fn colors(geometry: Geometry, is_float: bool) -> Frame {
    let value = |p: usize, c: usize| {
        let noise = (p * 2_654_435_761 + c * 40_503) % 1000;
        ((0.2 * (c + 1) as f64 + 0.3 * (p as f64 * 0.05).sin() + 0.0003 * noise as f64).clamp(0.0, 1.0))
            as f32
    };
    let rgb = (0..geometry.pixels()).flat_map(|p| [0, 1, 2].map(|c| value(p, c))).collect();
    let samples = match is_float {
        true => OwnedSamples::F32(vec![0.5; geometry.pixels()]),
        false => OwnedSamples::U16(vec![30_000; geometry.pixels()]),
    };
    Frame::new(geometry, samples).unwrap().with_rgb(rgb).unwrap()
}

fn run(camera: &Camera, frame: &Frame, backend: Backend, threads: usize) -> SpikeFrames {
    let options = SimulatorOptions::new().backend(backend).threads(threads);
    options.build(camera).unwrap().run(frame, 300).unwrap()
}

#[test]
fn the_bits_of_a_channel_equal_a_gray_run_of_its_light_on_every_backend() {
    let geometry = Geometry::new(53, 18).unwrap();
    let mut camera = presets::builtin("physical").unwrap();
    camera.sensor.geometry = geometry;
    for (pattern, is_float) in [("RGGB", true), ("GBRG", false), ("quad-RGBW", true)] {
        let mosaic = Mosaic::new(pattern, &[('R', [0.7, 0.2, 0.1])]).unwrap();
        let frame = colors(geometry, is_float);
        let light = mosaic.light(&frame).unwrap();
        let map = mosaic.channel_map(geometry);
        for backend in Backend::ALL.into_iter().filter(|backend| backend.is_available()) {
            for threads in [1, 2] {
                let spikes = run(&camera, &light, backend, threads).to_dense();
                for channel in 0..mosaic.channels().len() {
                    let gray = mosaic.channel_light(&frame, channel).unwrap();
                    let expected = run(&camera, &gray, backend, threads).to_dense();
                    let differs =
                        |i: &usize| map[i % geometry.pixels()] == channel && spikes[*i] != expected[*i];
                    let first = (0..spikes.len()).find(differs);
                    assert_eq!(first, None, "{pattern} {backend:?} {threads} channel {channel}");
                }
            }
        }
    }
}

#[test]
fn a_window_has_the_light_and_the_filters_of_its_part_of_the_sensor() {
    let mut camera = Camera::ideal(Sensor::new(32, 24, 20_000.0).unwrap());
    camera.mosaic = Some("GRBG".parse().unwrap());
    let frame = colors(camera.sensor.geometry, true);
    let crop = Crop { row: 3, col: 5, width: 16, height: 8 };
    let part = camera.window(crop).unwrap();
    let rgb = frame.rgb().unwrap().as_chunks::<3>().0;
    let part_rgb: Vec<f32> = crop.pick(frame.geometry(), rgb).concat();
    let geometry = part.sensor.geometry;
    let part_frame = Frame::new(geometry, OwnedSamples::F32(vec![0.5; geometry.pixels()])).unwrap();
    let part_frame = part_frame.with_rgb(part_rgb).unwrap();
    let whole = camera.window_mosaic().unwrap().light(&frame).unwrap();
    let light = part.window_mosaic().unwrap().light(&part_frame).unwrap();
    assert_eq!(light.to_f32(), crop.pick(frame.geometry(), &whole.to_f32()));
}

#[test]
fn demosaiced_images_equal_those_of_another_program() {
    let golden: Value = serde_json::from_str(include_str!("demosaic.json")).unwrap();
    let size = |key: &str| golden[key].as_u64().unwrap() as usize;
    let (side, border) = (size("side"), size("border"));
    let geometry = Geometry::new(side as u32, side as u32).unwrap();
    let codes = golden["codes"].as_array().unwrap();
    let values: Vec<f32> = codes.iter().map(|code| code.as_f64().unwrap() as f32 / 1000.0).collect();
    let cases = golden["cases"].as_array().unwrap();
    assert_eq!(cases.len(), 12);
    for case in cases {
        let (pattern, method) = (case["pattern"].as_str().unwrap(), case["method"].as_str().unwrap());
        let found = demosaic(&values, geometry, &pattern.parse().unwrap(), method.parse().unwrap()).unwrap();
        let expected: Vec<f32> =
            case["colors"].as_array().unwrap().iter().map(|x| x.as_f64().unwrap() as f32).collect();
        let crop = Crop { row: border, col: border, width: side - 2 * border, height: side - 2 * border };
        let inside = crop.pick(geometry, found.as_chunks::<3>().0).concat();
        assert_eq!(inside.len(), expected.len());
        for (i, (found, expected)) in inside.iter().zip(&expected).enumerate() {
            // The golden values have six decimal places. Sums of at most 20 singles below 2 add errors below 2e-6.
            assert!((found - expected).abs() < 5e-6, "{pattern} {method} {i}: {found}, {expected}");
        }
    }
}

/// Returns the PSNR over all colors of a demosaiced zone plate. Its color differences are low-pass.
fn zone_plate_psnr(method: Demosaic) -> f64 {
    let side = 128;
    let geometry = Geometry::new(side, side).unwrap();
    // The local frequency grows to 0.35 cycles per pixel at the border.
    let factor = 0.35 * std::f32::consts::PI / (side as f32 / 2.0);
    let light = |p: usize, c: usize| {
        let (y, x) = ((p as u32 / side) as f32 - 63.5, (p as u32 % side) as f32 - 63.5);
        (0.5 + 0.4 * (factor * (x * x + y * y)).cos()) * [0.9, 0.7, 0.5][c] + 0.0005 * x
    };
    let truth: Vec<f32> = (0..geometry.pixels()).flat_map(|p| [0, 1, 2].map(|c| light(p, c))).collect();
    let mosaic: Mosaic = "RGGB".parse().unwrap();
    let values: Vec<f32> =
        mosaic.channel_map(geometry).iter().enumerate().map(|(p, &c)| light(p, c)).collect();
    let found = demosaic(&values, geometry, &mosaic, method).unwrap();
    psnr(&found, &truth, 1.0).unwrap()
}

#[test]
fn each_better_method_gains_at_least_one_decibel_on_a_zone_plate() {
    let [bilinear, malvar, menon] = Demosaic::ALL.map(zone_plate_psnr);
    println!("zone plate CPSNR: bilinear {bilinear:.2}, malvar {malvar:.2}, menon {menon:.2} dB");
    assert!(malvar > bilinear + 1.0 && menon > malvar + 1.0, "{bilinear} {malvar} {menon}");
}
