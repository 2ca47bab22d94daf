//! Compares the light of a drive with complete renders at the same readouts. The drive renders tiles, warps the light
//! between the renders of a tile, and changes light linearly between frames.

use spikelane_dataset::Drive;
use spikelane_io::light::{Frame, Interpolation, Rate, Source};
use spikelane_scene::{Lighting, SamplesPerPixel, Scene, SceneOptions};

const READOUTS: usize = 150;

fn scene(lighting: Lighting) -> Scene {
    let options = SceneOptions::default()
        .with_width(200)
        .with_height(125)
        .with_lighting(Some(lighting))
        .with_duration_s(0.5)
        .with_speed_kmh(Some(70.0));
    Scene::from_seed(6, &options).unwrap()
}

/// Returns the light of each readout in units of white.
fn light(lighting: Lighting, hz: u64, readouts: usize, threads: usize) -> Vec<Vec<f32>> {
    let rate = Rate::new(hz, 1).unwrap();
    let samples = SamplesPerPixel::Sixteen;
    let mut drive =
        Drive::with_frame_per_readout(scene(lighting), rate, readouts as u64, samples, threads).unwrap();
    let mut frame = Frame::dark(drive.geometry());
    let mut all = Vec::new();
    while drive.next_frame(&mut frame).unwrap() {
        all.push(frame.to_f32());
    }
    all
}

fn render_light(lighting: Lighting, t: f64) -> Vec<f32> {
    let scene = scene(lighting);
    let white = scene.white_cd_m2(t, 1).unwrap();
    scene.render(t, SamplesPerPixel::Sixteen, 1).unwrap().light.iter().map(|l| l / white).collect()
}

/// Returns the mean absolute difference between two images. The light is clamped to twice white before the comparison.
fn difference(x: &[f32], y: &[f32]) -> f64 {
    let sum: f64 = x.iter().zip(y).map(|(x, y)| f64::from((x.min(2.0) - y.min(2.0)).abs())).sum();
    sum / x.len() as f64
}

#[test]
fn light_of_readouts_is_that_of_renders_of_their_instants() {
    for lighting in [Lighting::Noon, Lighting::Night] {
        let all = light(lighting, 20_000, READOUTS, 2);
        assert_eq!(all.len(), READOUTS);
        // The first readout of a span is rendered, so it must equal a complete render.
        assert!(difference(&all[0], &render_light(lighting, 0.0)) < 1e-6);
        for readout in [7, 38, 101] {
            let truth = render_light(lighting, readout as f64 / 20_000.0);
            let (drawn, held) = (difference(&all[readout], &truth), difference(&all[0], &truth));
            // With sixteen samples, the position of an edge has an error of about 1/30 px. Two renders of the same edge
            // have different errors.
            assert!(drawn < 0.006, "{}, readout {readout}: {drawn} of white", lighting.name());
            // At night, only the edges of lamps change noticeably, and these edges differ slightly between renders.
            // Therefore the comparison with a constant image is made only at noon.
            let moved = readout > 30 && lighting == Lighting::Noon;
            assert!(!moved || drawn < 0.7 * held, "{}: {drawn}, held {held}", lighting.name());
        }
    }
}

#[test]
fn fast_motion_is_rendered_for_every_readout() {
    // At 50 readouts per second, all objects except the sky move by several pixels per readout.
    let all = light(Lighting::Overcast, 50, 5, 1);
    for (k, drawn) in all.iter().enumerate() {
        let error = difference(drawn, &render_light(Lighting::Overcast, k as f64 / 50.0));
        assert!(error < 1e-3, "frame {k} is off by {error} of white");
    }
}

#[test]
fn threads_change_no_bit_of_a_drives_light() {
    for lighting in [Lighting::Noon, Lighting::Night] {
        assert_eq!(light(lighting, 20_000, 40, 1), light(lighting, 20_000, 40, 3), "{}", lighting.name());
    }
}

/// If every frame were held until the next frame, the light of consecutive readouts would change only at frames.
#[test]
fn light_changes_between_all_readouts() {
    let rate = Rate::new(20_000, 1).unwrap();
    let drive = Drive::new(scene(Lighting::Noon), rate, 100, SamplesPerPixel::Four, 2).unwrap();
    let timeline = drive.timeline(Interpolation::Linear).unwrap();
    let first_readouts = drive.first_readouts();
    assert!(first_readouts.len() > 10 && first_readouts.len() < 90, "{} frames", first_readouts.len());
    for (k, w) in first_readouts.windows(2).enumerate() {
        for readout in w[0]..w[1] {
            let position = timeline.position(readout as u64);
            assert_eq!(position.frame, k as u64);
            let expected = (readout - w[0]) as f32 / (w[1] - w[0]) as f32;
            assert!((position.weight() - expected).abs() < 1e-6);
        }
    }
}
