//! Tests that labels follow the distortion of the lens.

use spikelane_scene::{Lens, Lighting, Scene, SceneOptions};

const SIZE: [usize; 2] = [200, 125];

fn options(lens: Lens) -> SceneOptions {
    SceneOptions::default()
        .with_width(SIZE[0] as u32)
        .with_height(SIZE[1] as u32)
        .with_lighting(Some(Lighting::Noon))
        .with_duration_s(1.0)
        .with_lens(Some(lens))
}

/// A pixel of the distorted image and the pixel of the pinhole image on the same ray show the same surface. At edges, the
/// center of the nearest pixel may show another surface.
#[test]
fn distorted_and_pinhole_labels_show_the_same_rays() {
    let lens = Lens::from_seed(1).with_corner_distortion(-0.04);
    let bent = Scene::from_seed(8, &options(lens)).unwrap();
    let straight = Scene::from_seed(8, &options(lens)).unwrap().without_distortion();
    let (a, b) = (bent.labels(0.5, 2).unwrap(), straight.labels(0.5, 2).unwrap());
    let (from, to) = (bent.camera(0.5).unwrap().intrinsics, straight.camera(0.5).unwrap().intrinsics);
    let (mut compared, mut same, mut depth_errors, mut largest_shift) = (0, 0, Vec::new(), 0.0f64);
    for i in 0..SIZE[0] * SIZE[1] {
        let at = [(i % SIZE[0]) as f64 + 0.5, (i / SIZE[0]) as f64 + 0.5];
        let [x, y] = to.pixel_of_ray(from.ray_of_pixel(at));
        if x < 0.0 || y < 0.0 || x >= SIZE[0] as f64 || y >= SIZE[1] as f64 {
            continue;
        }
        largest_shift = largest_shift.max((x - at[0]).hypot(y - at[1]));
        let j = y as usize * SIZE[0] + x as usize;
        compared += 1;
        if a.semantic[i] == b.semantic[j] && a.part[i] == b.part[j] {
            same += 1;
            if a.depth_m[i].is_finite() {
                depth_errors.push((a.depth_m[i] / b.depth_m[j] - 1.0).abs());
            }
        }
    }
    assert!(largest_shift > 3.0, "the distortion moves pixels by at most {largest_shift} px");
    assert!(same as f64 > 0.93 * f64::from(compared), "{same} of {compared}");
    depth_errors.sort_by(f32::total_cmp);
    // Half a pixel changes the depth of the road by a few percent.
    let median = depth_errors[depth_errors.len() / 2];
    assert!(median < 0.02, "{median}");
}

#[test]
fn a_scene_without_distortion_has_the_labels_of_a_pinhole_camera() {
    let lens = Lens::from_seed(1);
    let a = Scene::from_seed(9, &options(lens)).unwrap().without_distortion();
    let b = Scene::from_seed(9, &options(Lens::IDEAL)).unwrap();
    assert_eq!(a.lens(), lens.without_distortion());
    assert_eq!(a.labels(0.3, 1).unwrap(), b.labels(0.3, 1).unwrap());
}

#[test]
fn impossible_lenses_are_refused() {
    let bad = [
        Lens::IDEAL.with_blur_px(-1.0),
        Lens::IDEAL.with_blur_px(f32::NAN),
        Lens::IDEAL.with_glare(0.9),
        Lens::IDEAL.with_corner_distortion(0.1),
    ];
    for lens in bad {
        let error = Scene::from_seed(1, &options(lens)).unwrap_err();
        assert_eq!(error.kind(), spikelane::ErrorKind::Usage, "{error}");
    }
}

#[test]
fn a_lens_removes_detail_and_keeps_most_of_the_light() {
    let light = |lens| {
        let scene = Scene::from_seed(8, &options(lens)).unwrap();
        scene.render(0.5, spikelane_scene::SamplesPerPixel::Four, 2).unwrap().light
    };
    let (sharp, blurred) = (light(Lens::IDEAL), light(Lens::IDEAL.with_blur_px(0.5)));
    let detail = |light: &[f32]| light.windows(2).map(|w| f64::from(w[1] - w[0]).powi(2)).sum::<f64>();
    let mean = |light: &[f32]| light.iter().map(|&l| f64::from(l)).sum::<f64>();
    assert!(detail(&blurred) < 0.8 * detail(&sharp));
    assert!((mean(&blurred) / mean(&sharp) - 1.0).abs() < 0.01);
}
