//! Tests how a camera responds to the light of scenes. The tests cover flickering lamps, few electrons, and the exit
//! of a tunnel.

use spikelane::effects::Camera;
use spikelane::{Geometry, Seeds, Simulator, SpikeFramesRef, presets};
use spikelane_dataset::Drive;
use spikelane_io::light::{Frame, Rate, Source};
use spikelane_io::simulate::FrameRef;
use spikelane_measure::{Accumulator, MeasureOptions, SpectralLine, spectrum};
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
    Scene::from_seed(3, &options).unwrap()
}

fn camera(name: &str, readout_hz: f64) -> Camera {
    let mut camera = presets::builtin(name).unwrap();
    camera.sensor.geometry = Geometry::new(SIZE.0, SIZE.1).unwrap();
    camera.sensor.readout_hz = readout_hz;
    camera
}

/// Returns the most prominent spectral lines of the number of spikes per frame, for a night drive at 2 kHz.
fn night_lines(flicker_hz: Option<f64>) -> Vec<SpectralLine> {
    const READOUTS: usize = 480;
    let camera = camera("physical", 2000.0);
    let mut simulator = Simulator::new(&camera, Seeds { camera: 1, shot: 2, sequence: 0 }).unwrap();
    let (scene, rate) = (scene(Lighting::Night, 0.25, flicker_hz), Rate::new(2000, 1).unwrap());
    let mut drive =
        Drive::with_frame_per_readout(scene, rate, READOUTS as u64, SamplesPerPixel::Four, 2).unwrap();
    let geometry = drive.geometry();
    let mut measured = Accumulator::new(geometry, &MeasureOptions::frames_only()).unwrap();
    let (mut frame, mut packed) = (Frame::dark(geometry), vec![0; geometry.frame_bytes()]);
    while drive.next_frame(&mut frame).unwrap() {
        let light: Vec<f32> = frame.to_f32().into_iter().map(|v| v.min(1.0)).collect();
        simulator.fill(&light, &mut packed).unwrap();
        measured.push(SpikeFramesRef::new(geometry, &packed).unwrap()).unwrap();
    }
    let totals = measured.finish().frames.unwrap().totals;
    assert_eq!(totals.len(), READOUTS);
    // A segment has 160 readouts. The frequency 100 Hz is 1/20 of the readout rate, so the line of this frequency is in
    // bin 160 / 20 = 8.
    spectrum(&totals, 160).unwrap().lines(1.0)
}

#[test]
fn flickering_lamps_show_their_line_in_the_frame_totals() {
    let line = night_lines(Some(100.0))[0];
    assert!((line.frequency - 0.05).abs() < 1e-9, "{line:?}");
    assert!(line.prominence > 30.0, "{line:?}");
    // If the lamps do not flicker, noise may cause a weak line at 100 Hz, which is 0.05 of the readout rate.
    let steady = night_lines(None).into_iter().find(|l| (l.frequency - 0.05).abs() < 1e-9);
    assert!(steady.is_none_or(|l| l.prominence < 15.0), "{steady:?}");
}

/// For each pixel, computes `(variance of the interval - 1/6) / (mean interval)^2`. Returns the mean of these values,
/// and the number of pixels. The rounding of both ends of an interval to whole readouts causes the variance 1/6.
///
/// Only pixels with a rate between 0.002 and 0.01 are included. If shot noise is the only noise, the returned mean is 1
/// / K, where K is the number of quanta per interval.
fn interval_noise(camera: &Camera, light: &[f32]) -> (f64, usize) {
    const READOUTS: usize = 16_384;
    let geometry = camera.sensor.geometry;
    let mut simulator = Simulator::new(camera, Seeds { camera: 1, shot: 2, sequence: 0 }).unwrap();
    let mut packed = vec![0; READOUTS * geometry.frame_bytes()];
    simulator.fill(FrameRef::new(light), &mut packed).unwrap();
    let packed = SpikeFramesRef::new(geometry, &packed).unwrap();
    let mut noise = Vec::new();
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
        noise.push((variance - 1.0 / 6.0) / (mean * mean));
    }
    (noise.iter().sum::<f64>() / noise.len() as f64, noise.len())
}

/// At every light, an interval ends after K electrons. The mean interval is T readouts. The Poisson noise of K
/// electrons gives the interval a standard deviation of T / sqrt(K). Therefore `(variance - 1/6) / T^2` is 1 / K.
///
/// The intervals of a pixel are independent. There are about 100 pixels with 30 to 160 intervals each. The relative
/// standard error of the mean is therefore about `sqrt(2 / (100 * 60))` = 2 %. The test detects an error of 10 % in K.
#[test]
fn low_light_shows_the_shot_noise_of_its_electrons() {
    let night = scene(Lighting::Night, 1.0, None).render(0.5, SamplesPerPixel::Four, 2).unwrap();
    // Full scale is 1 cd/m2 here. At full scale, a pixel receives 180 electrons per readout and fires once in 167
    // readouts.
    let light: Vec<f32> = night.light.iter().map(|v| v.min(1.0)).collect();
    let ideal = camera("ideal", 20_000.0);
    let electrons = ideal.operating_point(0.0).electrons;
    let dim = |mut camera: Camera| {
        camera.sensor.thresholds_at_full_scale = 0.006;
        camera
    };
    let shot = spikelane::effects::find("shot_noise").unwrap();
    let noisy = dim(ideal.clone().with_effect(shot.typical()));
    let (noise, pixels) = interval_noise(&noisy, &light);
    assert!(pixels > 100, "{pixels}");
    assert!((noise * electrons - 1.0).abs() < 0.1, "{noise} for {}, {pixels} pixels", 1.0 / electrons);
    let (clean, _) = interval_noise(&dim(ideal), &light);
    assert!(clean.abs() < 0.05 * noise, "{clean} without quanta");
}

/// White is fixed at the luminance of surfaces that the tunnel lamps illuminate. Outside the tunnel, pixels fire at every
/// readout.
///
/// A pixel stores at most 1.5 thresholds of charge. When the light of the tunnel returns, the pixel therefore has its
/// rate in the tunnel again immediately.
#[test]
fn the_tunnels_exit_saturates_and_the_camera_recovers() {
    const READOUTS: usize = 400;
    const TUNNEL_WHITE_CD_M2: f32 = 70.0;
    let scene = scene(Lighting::Tunnel, 1.6, None);
    let camera = camera("physical", 20_000.0);
    let geometry = camera.sensor.geometry;
    let light = |t: f64| -> Vec<f32> {
        let frame = scene.render(t, SamplesPerPixel::Four, 2).unwrap();
        frame.light.iter().map(|v| (v / TUNNEL_WHITE_CD_M2).min(2.0)).collect()
    };
    // The drive enters or leaves the tunnel.
    let mean = |light: &[f32]| light.iter().sum::<f32>() / light.len() as f32;
    let mut views = [light(0.0), light(1.5)];
    views.sort_by(|a, b| mean(a).total_cmp(&mean(b)));
    let [inside, outside] = views;
    let plan =
        spikelane::Plan::with_max_light(&camera, Seeds { camera: 1, shot: 2, sequence: 0 }, 2.0).unwrap();
    let mut simulator = Simulator::from_plan(plan);
    let rates = [&inside, &outside, &inside].map(|light| {
        let mut packed = vec![0; READOUTS * geometry.frame_bytes()];
        simulator.fill(FrameRef::new(light), &mut packed).unwrap();
        let packed = SpikeFramesRef::new(geometry, &packed).unwrap();
        spikelane::reconstruct::tfp(packed, READOUTS / 2, READOUTS).unwrap()
    });
    let saturated: Vec<usize> = (0..geometry.pixels()).filter(|&p| rates[1][p] > 0.999).collect();
    assert!(saturated.len() > geometry.pixels() / 2, "{} pixels saturate", saturated.len());
    let was_dark: Vec<usize> = saturated.into_iter().filter(|&p| inside[p] < 0.5).collect();
    assert!(was_dark.len() > 100, "{} of them were not bright before", was_dark.len());
    // The number of spikes in 400 readouts varies by a few spikes, because of the start phase, the stored charge and
    // noise.
    for p in was_dark {
        let change = (rates[2][p] - rates[0][p]).abs() * READOUTS as f32;
        assert!(change < 6.5, "pixel {p}: {} before, {} after", rates[0][p], rates[2][p]);
    }
}
