//! What a camera makes of the light of scenes: lamps that flicker, few electrons, and a tunnel's end.

use spikelane::effects::Camera;
use spikelane::{Geometry, Packed, Seeds, Simulator, presets};
use spikelane_dataset::Drive;
use spikelane_io::light::{Frame, Rate, Source};
use spikelane_io::simulate::FrameRef;
use spikelane_measure::{Accumulator, Line, MeasureOptions, spectrum};
use spikelane_scene::{Lighting, SamplesPerPixel, Scene, SceneOptions};

const SIZE: (u32, u32) = (64, 40);

fn scene(lighting: Lighting, duration_s: f64, flicker_hz: Option<f64>) -> Scene {
    let options = SceneOptions::default()
        .with_width(SIZE.0)
        .with_height(SIZE.1)
        .with_lighting(Some(lighting))
        .with_duration_s(duration_s)
        .with_speed_kmh(Some(60.0))
        .with_flicker_hz(flicker_hz);
    Scene::random(3, &options).unwrap()
}

fn camera(name: &str, readout_hz: f64) -> Camera {
    let mut camera = presets::builtin(name).unwrap();
    camera.sensor.geometry = Geometry::new(SIZE.0, SIZE.1).unwrap();
    camera.sensor.readout_hz = readout_hz;
    camera
}

/// The most prominent lines of the frame totals of a night drive at 2 kHz.
fn night_lines(flicker_hz: Option<f64>) -> Vec<Line> {
    const READOUTS: usize = 480;
    let camera = camera("physical", 2000.0);
    let mut simulator = Simulator::new(&camera, Seeds { camera: 1, shot: 2, sequence: 0 }).unwrap();
    let (scene, rate) = (scene(Lighting::Night, 0.25, flicker_hz), Rate::new(2000, 1).unwrap());
    let mut drive = Drive::new(scene, rate, READOUTS as u64, None, SamplesPerPixel::Four, 2).unwrap();
    let geometry = drive.geometry();
    let mut measured = Accumulator::new(geometry, &MeasureOptions::only_frames()).unwrap();
    let (mut frame, mut packed) = (Frame::dark(geometry), vec![0; geometry.frame_bytes()]);
    while drive.next_frame(&mut frame).unwrap() {
        let light: Vec<f32> = frame.to_f32().into_iter().map(|v| v.min(1.0)).collect();
        simulator.push(FrameRef::f32(&light, geometry), &mut packed).unwrap();
        measured.push(Packed::new(geometry, &packed).unwrap()).unwrap();
    }
    let totals = measured.finish().frames.unwrap().totals;
    assert_eq!(totals.len(), READOUTS);
    // Segments of 160 readouts: 100 Hz, a twentieth of the rate, is bin 8.
    spectrum(&totals, 160).unwrap().lines(1.0)
}

#[test]
fn flickering_lamps_show_their_line_in_the_frame_totals() {
    let line = night_lines(Some(100.0))[0];
    assert!((line.frequency - 0.05).abs() < 1e-9, "{line:?}");
    assert!(line.prominence > 30.0, "{line:?}");
    // With steady lamps nothing stands there.
    let steady = night_lines(None).into_iter().find(|l| (l.frequency - 0.05).abs() < 1e-9);
    assert!(steady.is_none_or(|l| l.prominence < 15.0), "{steady:?}");
}

/// Mean over pixels of `(variance of the interval - 1/6) / (mean interval squared)`, of pixels whose
/// rate lies in 0.002 to 0.01: one over the quanta in an interval, if only shot noise moves spikes.
fn interval_noise(camera: &Camera, light: &[f32]) -> (f64, usize) {
    const READOUTS: usize = 16_384;
    let geometry = camera.sensor.geometry;
    let mut simulator = Simulator::new(camera, Seeds { camera: 1, shot: 2, sequence: 0 }).unwrap();
    let mut packed = vec![0; READOUTS * geometry.frame_bytes()];
    simulator.push(FrameRef::f32(light, geometry), &mut packed).unwrap();
    let packed = Packed::new(geometry, &packed).unwrap();
    let mut found = Vec::new();
    for p in 0..geometry.pixels() {
        let (row, col) = (p / geometry.width(), p % geometry.width());
        let fired: Vec<f64> = (0..READOUTS).filter(|t| packed.get(*t, row, col)).map(|t| t as f64).collect();
        let intervals: Vec<f64> = fired.windows(2).map(|w| w[1] - w[0]).collect();
        let n = intervals.len() as f64;
        if !(0.002..=0.01).contains(&(n / READOUTS as f64)) {
            continue;
        }
        let mean = intervals.iter().sum::<f64>() / n;
        let variance = intervals.iter().map(|i| (i - mean).powi(2)).sum::<f64>() / (n - 1.0);
        found.push((variance - 1.0 / 6.0) / (mean * mean));
    }
    (found.iter().sum::<f64>() / found.len() as f64, found.len())
}

/// An interval of mean T readouts gathers K electrons, whatever the light; the Poisson noise of K
/// quanta moves its end by T / sqrt(K), so `(variance - 1/6) / T^2` is 1 / K. Intervals of one pixel
/// share nothing; 30 to 160 of them on some hundred pixels give the mean to about
/// `sqrt(2 / (100 * 60))`, 2 %; an error of a tenth in K is seen.
#[test]
fn low_light_shows_the_shot_noise_of_its_electrons() {
    let night = scene(Lighting::Night, 1.0, None).render(0.5, SamplesPerPixel::Four, 2).unwrap();
    // Full scale, 1 cd/m2 here, is 180 electrons per readout and one spike in 167 readouts.
    let light: Vec<f32> = night.light.iter().map(|v| v.min(1.0)).collect();
    let ideal = camera("ideal", 20_000.0);
    let electrons = ideal.operating(0.0).electrons;
    let dim = |mut camera: Camera| {
        camera.sensor.thresholds_at_full_scale = 0.006;
        camera
    };
    let shot = spikelane::effects::find("shot_noise").unwrap();
    let noisy = dim(ideal.clone().with(shot.typical()));
    let (found, pixels) = interval_noise(&noisy, &light);
    assert!(pixels > 100, "{pixels}");
    assert!((found * electrons - 1.0).abs() < 0.1, "{found} for {}, {pixels} pixels", 1.0 / electrons);
    let (clean, _) = interval_noise(&dim(ideal), &light);
    assert!(clean.abs() < 0.05 * found, "{clean} without quanta");
}

/// In the tunnel the white is the lamps'. Out of it pixels fire at every readout; when the tunnel's
/// light returns, a pixel that had stored at most 1.5 thresholds has its old rate again at once.
#[test]
fn the_tunnels_exit_saturates_and_the_camera_recovers() {
    const READOUTS: usize = 400;
    let scene = scene(Lighting::Tunnel, 1.6, None);
    let camera = camera("physical", 20_000.0);
    let geometry = camera.sensor.geometry;
    let light = |t: f64| -> Vec<f32> {
        let frame = scene.render(t, SamplesPerPixel::Four, 2).unwrap();
        frame.light.iter().map(|v| (v / scene.white_cd_m2()).min(2.0)).collect()
    };
    let (inside, outside) = (light(0.0), light(1.5));
    let plan = spikelane::Plan::with_light(&camera, Seeds { camera: 1, shot: 2, sequence: 0 }, 2.0).unwrap();
    let mut simulator = Simulator::of_plan(plan);
    let rates = [&inside, &outside, &inside].map(|light| {
        let mut packed = vec![0; READOUTS * geometry.frame_bytes()];
        simulator.push(FrameRef::f32(light, geometry), &mut packed).unwrap();
        let packed = Packed::new(geometry, &packed).unwrap();
        spikelane::reconstruct::tfp(packed, READOUTS / 2, READOUTS).unwrap()
    });
    let saturated: Vec<usize> = (0..geometry.pixels()).filter(|&p| rates[1][p] > 0.999).collect();
    assert!(saturated.len() > geometry.pixels() / 2, "{} pixels saturate", saturated.len());
    let was_dark: Vec<usize> = saturated.into_iter().filter(|&p| inside[p] < 0.5).collect();
    assert!(was_dark.len() > 100, "{} of them were not bright before", was_dark.len());
    // A rate over 400 readouts moves by a spike or two: start, stored charge and noise.
    for p in was_dark {
        let change = (rates[2][p] - rates[0][p]).abs() * READOUTS as f32;
        assert!(change < 6.5, "pixel {p}: {} before, {} after", rates[0][p], rates[2][p]);
    }
}
