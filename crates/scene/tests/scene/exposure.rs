//! Tests of the exposure during drives through the portal of a tunnel.

use spikelane_scene::{Exposure, Labels, Lighting, SamplesPerPixel, Scene, SceneOptions, Semantic};

/// Seeds of a drive that leaves a tunnel and of a drive that enters a tunnel, each in the first half of its duration.
const LEAVING: u64 = 7;
const ENTERING: u64 = 3;
const DURATION_S: f64 = 4.0;

fn tunnel_drive(seed: u64, exposure: Exposure) -> Scene {
    let options = SceneOptions::default()
        .with_width(64)
        .with_height(40)
        .with_lighting(Some(Lighting::Tunnel))
        .with_duration_s(DURATION_S)
        .with_speed_kmh(Some(90.0))
        .with_exposure(exposure);
    Scene::from_seed(seed, &options).unwrap()
}

/// Returns whether most of the upper half of the image shows the wall of the tunnel.
fn is_inside(labels: &Labels) -> bool {
    let upper = &labels.semantic[..labels.semantic.len() / 2];
    2 * upper.iter().filter(|&&s| s == Semantic::Wall as u8).count() > upper.len()
}

/// The instants of the drive, 0.1 s apart.
fn instants() -> Vec<f64> {
    (0..=40).map(|k| DURATION_S * f64::from(k) / 40.0).collect()
}

fn white_of_drive(scene: &Scene) -> Vec<f64> {
    instants().into_iter().map(|t| f64::from(scene.white_cd_m2(t, 2).unwrap())).collect()
}

/// With a time constant of 0.3 s, log white covers this fraction of its distance to a constant metered value in 0.1 s.
fn share_of_step() -> f64 {
    1.0 - (-1.0f64 / 3.0).exp()
}

#[test]
fn white_rises_with_a_lag_when_a_drive_leaves_a_tunnel() {
    let scene = tunnel_drive(LEAVING, Exposure::Automatic);
    assert!(is_inside(&scene.labels(0.0, 1).unwrap()) && !is_inside(&scene.labels(DURATION_S, 1).unwrap()));
    let white = white_of_drive(&scene);
    let (first, last) = (white[0], white[white.len() - 1]);
    assert!(last > 5.0 * first, "white rises from {first} to {last} cd/m2");
    // No metered value exceeds the light of a white surface in the sun, 90,000 lux * 1.15 / pi.
    let brightest = 90_000.0 * 1.15 / std::f64::consts::PI;
    for w in white.windows(2) {
        let largest_step = share_of_step() * (brightest / w[0]).ln();
        assert!((w[1] / w[0]).ln() <= largest_step, "white jumps from {} to {} cd/m2", w[0], w[1]);
    }
}

#[test]
fn white_falls_with_a_lag_when_a_drive_enters_a_tunnel() {
    let scene = tunnel_drive(ENTERING, Exposure::Automatic);
    assert!(!is_inside(&scene.labels(0.0, 1).unwrap()) && is_inside(&scene.labels(DURATION_S, 1).unwrap()));
    let white = white_of_drive(&scene);
    let (first, last) = (white[0], white[white.len() - 1]);
    assert!(last < first / 50.0, "white falls from {first} to {last} cd/m2");
    // No metered value is below the light of a surface with an albedo of 0.02 under the lamps, 160 lux * 0.02 / pi.
    let darkest = 160.0 * 0.02 / std::f64::consts::PI;
    for w in white.windows(2) {
        let largest_step = share_of_step() * (w[0] / darkest).ln();
        assert!((w[0] / w[1]).ln() <= largest_step, "white jumps from {} to {} cd/m2", w[0], w[1]);
    }
}

#[test]
fn a_locked_exposure_keeps_the_white_of_the_start() {
    let start = tunnel_drive(LEAVING, Exposure::Automatic).white_cd_m2(0.0, 2).unwrap();
    let locked = tunnel_drive(LEAVING, Exposure::Locked);
    for t in instants() {
        assert_eq!(locked.white_cd_m2(t, 1).unwrap(), start, "at {t} s");
    }
}

#[test]
fn no_image_of_a_drive_through_a_portal_is_blank() {
    for seed in [LEAVING, ENTERING] {
        let scene = tunnel_drive(seed, Exposure::Automatic);
        for t in instants() {
            let white = scene.white_cd_m2(t, 2).unwrap();
            let frame = scene.render(t, SamplesPerPixel::Four, 2).unwrap();
            let share = |is_counted: &dyn Fn(f32) -> bool| {
                let count = frame.light.iter().filter(|&&light| is_counted(light / white)).count();
                count as f64 / frame.light.len() as f64
            };
            let (white_share, black_share) = (share(&|x| x >= 1.0), share(&|x| x < 0.002));
            assert!(white_share < 0.5, "scene {seed}: {white_share} of the pixels are white at {t} s");
            assert!(black_share < 0.5, "scene {seed}: {black_share} of the pixels are black at {t} s");
        }
    }
}
