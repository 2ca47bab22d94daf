//! The light of a drive at every readout: rendered in tiles, carried between, against whole renders.

use spikelane_dataset::Drive;
use spikelane_io::light::{Frame, Rate, Source};
use spikelane_scene::{Lighting, SamplesPerPixel, Scene, SceneOptions};

const READOUTS: usize = 150;

fn scene(lighting: Lighting) -> Scene {
    let options = SceneOptions::default()
        .with_width(200)
        .with_height(125)
        .with_lighting(Some(lighting))
        .with_duration_s(0.5)
        .with_speed_kmh(Some(70.0));
    Scene::random(6, &options).unwrap()
}

/// Light in units of white, frame by frame.
fn light(lighting: Lighting, hz: u64, readouts: usize, threads: usize) -> Vec<Vec<f32>> {
    let rate = Rate::new(hz, 1).unwrap();
    let samples = SamplesPerPixel::Sixteen;
    let mut drive = Drive::new(scene(lighting), rate, readouts as u64, None, samples, threads).unwrap();
    let mut frame = Frame::dark(drive.geometry());
    let mut all = Vec::new();
    while drive.next_frame(&mut frame).unwrap() {
        all.push(frame.to_f32());
    }
    all
}

fn rendered(lighting: Lighting, t: f64) -> Vec<f32> {
    let scene = scene(lighting);
    let white = scene.white_cd_m2();
    scene.render(t, SamplesPerPixel::Sixteen, 1).unwrap().light.iter().map(|l| l / white).collect()
}

/// Mean absolute difference of what a sensor sees, up to twice white.
fn difference(x: &[f32], y: &[f32]) -> f64 {
    let sum: f64 = x.iter().zip(y).map(|(x, y)| f64::from((x.min(2.0) - y.min(2.0)).abs())).sum();
    sum / x.len() as f64
}

#[test]
fn light_of_readouts_is_that_of_renders_of_their_instants() {
    for lighting in [Lighting::Noon, Lighting::Night] {
        let all = light(lighting, 20_000, READOUTS, 2);
        assert_eq!(all.len(), READOUTS);
        // The ends of spans are renders.
        assert!(difference(&all[0], &rendered(lighting, 0.0)) < 1e-6);
        for readout in [7, 38, 101] {
            let truth = rendered(lighting, readout as f64 / 20_000.0);
            let (drawn, held) = (difference(&all[readout], &truth), difference(&all[0], &truth));
            // Sixteen samples put an edge off by a thirtieth of a pixel, in every render anew.
            assert!(drawn < 0.006, "{}, readout {readout}: {drawn} of white", lighting.name());
            // By night little but the edges of lamps changes, which each render puts a little elsewhere.
            let moved = readout > 30 && lighting == Lighting::Noon;
            assert!(!moved || drawn < 0.7 * held, "{}: {drawn}, held {held}", lighting.name());
        }
    }
}

#[test]
fn what_moves_far_from_one_frame_to_the_next_is_rendered_for_each() {
    // At 50 frames a second all but the sky moves by pixels.
    let all = light(Lighting::Overcast, 50, 5, 1);
    for (k, drawn) in all.iter().enumerate() {
        let error = difference(drawn, &rendered(Lighting::Overcast, k as f64 / 50.0));
        assert!(error < 1e-3, "frame {k} is off by {error} of white");
    }
}

#[test]
fn threads_change_no_bit_of_a_drives_light() {
    for lighting in [Lighting::Noon, Lighting::Night] {
        assert_eq!(light(lighting, 20_000, 40, 1), light(lighting, 20_000, 40, 3), "{}", lighting.name());
    }
}
