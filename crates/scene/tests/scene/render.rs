//! Tests of renders. The bytes must depend on the seed but not on the number of threads, and the light of the presets
//! must be in the documented order.

use spikelane_scene::{Lens, Lighting, SamplesPerPixel, Scene, SceneOptions};

fn options(lighting: Lighting) -> SceneOptions {
    SceneOptions::default().with_width(120).with_height(75).with_lighting(Some(lighting)).with_duration_s(1.0)
}

fn median(mut light: Vec<f32>) -> f32 {
    light.sort_by(f32::total_cmp);
    light[light.len() / 2]
}

#[test]
fn the_same_seed_gives_the_same_bytes_on_any_number_of_threads() {
    for lighting in [Lighting::Noon, Lighting::Night] {
        let scene = Scene::from_seed(21, &options(lighting)).unwrap();
        let one = scene.render(0.5, SamplesPerPixel::Four, 1).unwrap();
        for threads in [2, 3] {
            assert_eq!(one, scene.render(0.5, SamplesPerPixel::Four, threads).unwrap(), "{threads} threads");
        }
        let again = Scene::from_seed(21, &options(lighting)).unwrap();
        assert_eq!(one, again.render(0.5, SamplesPerPixel::Four, 2).unwrap());
        assert_eq!(one.labels, scene.labels(0.5, 2).unwrap());
    }
}

#[test]
fn scenes_of_different_seeds_differ_in_layout_traffic_and_light() {
    let open = options(Lighting::Noon).with_lighting(None);
    let scenes: Vec<Scene> = (0..6).map(|seed| Scene::from_seed(seed, &open).unwrap()).collect();
    for w in scenes.windows(2) {
        let (a, b) = (w[0].labels(0.5, 1).unwrap(), w[1].labels(0.5, 1).unwrap());
        let differ = a.semantic.iter().zip(&b.semantic).filter(|(x, y)| x != y).count();
        assert!(differ > a.semantic.len() / 20, "layouts share all but {differ} pixels");
        assert_ne!(a.instance, b.instance);
        assert_ne!(w[0].camera(0.5).unwrap().speed_mps, w[1].camera(0.5).unwrap().speed_mps);
    }
    let lights: std::collections::HashSet<_> = scenes.iter().map(Scene::lighting).collect();
    assert!(lights.len() >= 3, "six seeds know only {lights:?}");
}

#[test]
fn presets_follow_one_another_from_bright_to_dark() {
    let order = [
        Lighting::Noon,
        Lighting::LowSun,
        Lighting::Overcast,
        Lighting::Rain,
        Lighting::Dusk,
        Lighting::Night,
    ];
    let medians: Vec<f32> = order
        .iter()
        .map(|&l| {
            // The median of several seeds is used, because a building can hide the low sun in a single scene.
            median(
                (1..4)
                    .map(|seed| {
                        median(
                            Scene::from_seed(seed, &options(l))
                                .unwrap()
                                .render(0.5, SamplesPerPixel::Four, 1)
                                .unwrap()
                                .light,
                        )
                    })
                    .collect(),
            )
        })
        .collect();
    let pairs_in_order = [(0, 1), (0, 2), (2, 3), (3, 4), (4, 5)];
    for (a, b) in pairs_in_order {
        assert!(medians[a] > medians[b], "{:?} {} <= {:?} {}", order[a], medians[a], order[b], medians[b]);
    }
    assert!(medians[0] / medians[5] > 1e3, "noon {} against night {}", medians[0], medians[5]);
}

#[test]
fn sixteen_samples_agree_with_four_in_the_mean() {
    let scene = Scene::from_seed(22, &options(Lighting::Noon)).unwrap();
    let mean = |s: SamplesPerPixel| {
        let light = scene.render(0.5, s, 1).unwrap().light;
        assert!(light.iter().all(|l| l.is_finite() && *l >= 0.0));
        light.iter().sum::<f32>() / light.len() as f32
    };
    let (few, many) = (mean(SamplesPerPixel::Four), mean(SamplesPerPixel::Sixteen));
    assert!((few / many - 1.0).abs() < 0.02, "{few} against {many}");
}

/// A street lamp has 12,000 cd/m2 and a headlight 22,000 cd/m2. Sharp light at night is limited to 16 cd/m2.
#[test]
fn colors_of_lamps_are_not_limited() {
    let options = options(Lighting::Night).with_lens(Some(Lens::IDEAL));
    let frame = Scene::from_seed(23, &options).unwrap().render(0.5, SamplesPerPixel::Four, 1).unwrap();
    let weights = spikelane::light::LUMINANCE_WEIGHTS;
    let luminance = |c: &[f32; 3]| c.iter().zip(weights).map(|(x, w)| x * w).sum::<f32>();
    let brightest = frame.rgb.iter().map(luminance).fold(0.0, f32::max);
    let limited = frame.light.iter().copied().fold(0.0, f32::max);
    assert!(brightest > 1_000.0, "{brightest}");
    assert!((15.0..16.01).contains(&limited), "{limited}");
    for (color, light) in frame.rgb.iter().zip(&frame.light).filter(|(_, light)| **light < 1.0) {
        // A pixel below 1 cd/m2 in the mean may contain a sample of a lamp, so its color may be brighter.
        assert!(luminance(color) >= 0.999 * light, "{color:?} for {light}");
    }
}

#[test]
fn light_is_the_luminance_of_the_color_if_no_lamp_is_visible() {
    let frame = Scene::from_seed(23, &options(Lighting::Noon))
        .unwrap()
        .render(0.5, SamplesPerPixel::Four, 1)
        .unwrap();
    let weights = spikelane::light::LUMINANCE_WEIGHTS;
    for (color, light) in frame.rgb.iter().zip(&frame.light) {
        let luminance: f32 = color.iter().zip(weights).map(|(x, w)| x * w).sum();
        // Both are sums of at most 200 rounded products.
        assert!((luminance - light).abs() < 200.0 * f32::EPSILON * light, "{luminance} for {light}");
    }
}

#[test]
fn lamps_that_flicker_change_the_light_of_the_night() {
    let o = options(Lighting::Night).with_flicker_hz(Some(100.0));
    let scene = Scene::from_seed(23, &o).unwrap();
    // During half a flicker period, no object moves by a pixel, but the light of the lamps changes.
    let mean = |t: f64| {
        let light = scene.render(t, SamplesPerPixel::Four, 1).unwrap().light;
        light.iter().map(|l| l.min(5.0)).sum::<f32>() / light.len() as f32
    };
    let levels: Vec<f32> = (0..4).map(|i| mean(0.5 + 0.0025 * f64::from(i))).collect();
    let (low, high) =
        (levels.iter().copied().fold(f32::MAX, f32::min), levels.iter().copied().fold(0.0, f32::max));
    assert!(high / low > 1.02, "{levels:?}");
    let again = mean(0.51);
    assert!((again / levels[0] - 1.0).abs() < 0.05, "a period later {again} against {}", levels[0]);
}
