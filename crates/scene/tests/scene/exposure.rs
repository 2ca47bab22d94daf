//! Tests of the exposure during a drive that leaves a tunnel.

use spikelane_scene::{Exposure, Labels, Lighting, SamplesPerPixel, Scene, SceneOptions, Semantic};

/// A drive that leaves the tunnel after about half of its duration.
const SEED: u64 = 1;
const DURATION_S: f64 = 3.0;

fn tunnel_drive(exposure: Exposure) -> Scene {
    let options = SceneOptions::default()
        .with_width(64)
        .with_height(40)
        .with_lighting(Some(Lighting::Tunnel))
        .with_duration_s(DURATION_S)
        .with_speed_kmh(Some(60.0))
        .with_exposure(exposure);
    Scene::from_seed(SEED, &options).unwrap()
}

/// Returns the fraction of the pixels that show the sky.
fn sky_share(labels: &Labels) -> f64 {
    let sky = labels.semantic.iter().filter(|&&s| s == Semantic::Sky as u8).count();
    sky as f64 / labels.semantic.len() as f64
}

/// The instants of the drive, 0.1 s apart.
fn instants() -> Vec<f64> {
    (0..=30).map(|k| DURATION_S * f64::from(k) / 30.0).collect()
}

#[test]
fn white_rises_with_a_lag_when_a_drive_leaves_a_tunnel() {
    let scene = tunnel_drive(Exposure::Automatic);
    assert!(sky_share(&scene.labels(0.0, 1).unwrap()) < 0.02, "the drive starts in the tunnel");
    assert!(sky_share(&scene.labels(DURATION_S, 1).unwrap()) > 0.1, "the drive ends outside");
    let white: Vec<f64> =
        instants().into_iter().map(|t| f64::from(scene.white_cd_m2(t, 2).unwrap())).collect();
    let (first, last) = (white[0], white[white.len() - 1]);
    assert!(last > 10.0 * first, "white rises from {first} to {last} cd/m2");
    // With a time constant of 0.3 s, log white covers at most 1 - exp(-1/3) = 0.28 of its distance to the metered value in
    // 0.1 s. The metered value never exceeds the brightest light of a white surface in the sun, 90,000 lux * 1.15 / pi.
    let brightest = 90_000.0 * 1.15 / std::f64::consts::PI;
    for w in white.windows(2) {
        let largest_step = (1.0 - (-1.0f64 / 3.0).exp()) * (brightest / w[0]).ln();
        assert!((w[1] / w[0]).ln() <= largest_step, "white jumps from {} to {} cd/m2", w[0], w[1]);
    }
}

#[test]
fn a_locked_exposure_keeps_the_white_of_the_start() {
    let start = tunnel_drive(Exposure::Automatic).white_cd_m2(0.0, 2).unwrap();
    let locked = tunnel_drive(Exposure::Locked);
    for t in instants() {
        assert_eq!(locked.white_cd_m2(t, 1).unwrap(), start, "at {t} s");
    }
}

#[test]
fn no_image_of_a_drive_through_a_tunnel_is_blank() {
    let scene = tunnel_drive(Exposure::Automatic);
    for t in instants() {
        let white = scene.white_cd_m2(t, 2).unwrap();
        let frame = scene.render(t, SamplesPerPixel::Four, 2).unwrap();
        let share = |is_counted: &dyn Fn(f32) -> bool| {
            let count = frame.light.iter().filter(|&&light| is_counted(light / white)).count();
            count as f64 / frame.light.len() as f64
        };
        let (white_share, black_share) = (share(&|x| x >= 1.0), share(&|x| x < 0.002));
        assert!(white_share < 0.5, "{white_share} of the pixels are white at {t} s");
        assert!(black_share < 0.5, "{black_share} of the pixels are black at {t} s");
    }
}

#[test]
fn seed_search() {
    for seed in 0..24 {
        let options = SceneOptions::default()
            .with_width(64).with_height(40).with_lighting(Some(Lighting::Tunnel)).with_duration_s(DURATION_S)
            .with_speed_kmh(Some(60.0));
        let scene = Scene::from_seed(seed, &options).unwrap();
        let s: Vec<f64> = [0.0, 1.0, 1.5, 2.0, 3.0].map(|t| (sky_share(&scene.labels(t, 1).unwrap()) * 1000.0).round() / 1000.0).to_vec();
        println!("{seed}: {s:?} {:.0} {:.0}", scene.white_cd_m2(0.0, 2).unwrap(), scene.white_cd_m2(3.0, 2).unwrap());
    }
}
