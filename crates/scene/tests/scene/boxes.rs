//! Tests boxes against the pixels of instance maps, and tests that invalid options are rejected.

use spikelane::ErrorKind;
use spikelane_scene::{DVec3, Lighting, Scene, SceneOptions, Semantic, labels};

fn options() -> SceneOptions {
    SceneOptions::default()
        .with_width(200)
        .with_height(125)
        .with_lighting(Some(Lighting::Noon))
        .with_duration_s(2.0)
}

#[test]
fn visible_boxes_enclose_their_pixels_tightly_and_lie_within_amodal_ones() {
    let mut visible = 0;
    for seed in [11, 12, 13] {
        let scene = Scene::from_seed(seed, &options()).unwrap();
        let l = scene.labels(1.0, 1).unwrap();
        for b in scene.boxes(&l).unwrap() {
            let is_instance = |i: usize| l.instance[i] == b.track_id;
            let pixels: Vec<(usize, usize)> =
                (0..l.instance.len()).filter(|&i| is_instance(i)).map(|i| (i % 200, i / 200)).collect();
            assert_eq!(pixels.len(), b.visible_pixels as usize);
            let Some(v) = b.visible_box else {
                assert!(pixels.is_empty() && b.occlusion == 1.0);
                continue;
            };
            visible += 1;
            let edge = |f: fn(&(usize, usize)) -> usize| {
                (pixels.iter().map(f).min().unwrap() as f32, pixels.iter().map(f).max().unwrap() as f32 + 1.0)
            };
            let (x, y) = (edge(|p| p.0), edge(|p| p.1));
            assert_eq!(v, [x.0, y.0, x.1, y.1]);
            let a = b.amodal_box;
            assert!(a[0] <= v[0] && a[1] <= v[1] && a[2] >= v[2] && a[3] >= v[3], "{a:?} {v:?}");
            assert!((0.0..=1.0).contains(&b.truncation) && (0.0..1.0).contains(&b.occlusion));
        }
    }
    assert!(visible >= 10, "only {visible} vehicles seen");
}

#[test]
fn projected_3d_boxes_contain_the_visible_pixels() {
    let scene = Scene::from_seed(12, &options()).unwrap();
    let l = scene.labels(1.0, 1).unwrap();
    let camera = scene.camera(1.0).unwrap();
    let mut compared = 0;
    for b in scene.boxes(&l).unwrap().iter().filter(|b| b.truncation == 0.0 && b.visible_box.is_some()) {
        let [length, width, height] = b.size_m.map(f64::from);
        let (sin, cos) = b.yaw.sin_cos();
        let mut hull = [f64::MAX, f64::MAX, f64::MIN, f64::MIN];
        for corner in 0..8 {
            let sign = |bit: u32| if corner >> bit & 1 == 0 { -0.5 } else { 0.5 };
            let (x, y) = (sign(0) * length, sign(1) * width);
            let at = DVec3::from(b.center_world_m)
                + DVec3::new(x * cos - y * sin, x * sin + y * cos, sign(2) * height);
            let [u, v, _] = camera.project(at).unwrap();
            hull = [hull[0].min(u), hull[1].min(v), hull[2].max(u), hull[3].max(v)];
        }
        // A pixel extends half a pixel from its center in every direction.
        let a = b.amodal_box.map(f64::from);
        assert!(
            hull[0] <= a[0] + 1.0 && hull[1] <= a[1] + 1.0 && hull[2] >= a[2] - 1.0 && hull[3] >= a[3] - 1.0,
            "{hull:?} {a:?}"
        );
        compared += 1;
    }
    assert!(compared >= 3, "only {compared} whole vehicles");
}

#[test]
fn a_street_without_vehicles_has_no_instances() {
    let scene = Scene::from_seed(14, &options().with_vehicles(Some(0))).unwrap();
    let l = scene.labels(0.5, 1).unwrap();
    assert_eq!(scene.vehicles(), 0);
    assert!(l.instance.iter().all(|&i| i == 0));
    assert!(scene.boxes(&l).unwrap().is_empty());
    assert!(l.semantic.iter().all(|&s| s != Semantic::Car as u8));
}

#[test]
fn kitti_lines_have_fifteen_fields() {
    let scene = Scene::from_seed(12, &options()).unwrap();
    let boxes = scene.boxes(&scene.labels(1.0, 1).unwrap()).unwrap();
    let text = labels::kitti_box_file(&boxes, 1);
    assert!(text.lines().count() > 0);
    for line in text.lines() {
        let fields: Vec<&str> = line.split(' ').collect();
        assert_eq!(fields.len(), 15, "{line}");
        assert!(fields[1..].iter().all(|f| f.parse::<f64>().is_ok()), "{line}");
    }
}

#[test]
fn impossible_cameras_and_speeds_are_refused() {
    let bad = [
        options().with_width(0),
        options().with_fov_deg(Some(180.0)),
        options().with_fov_deg(Some(f64::NAN)),
        options().with_speed_kmh(Some(-5.0)),
        options().with_speed_kmh(Some(4000.0)),
        options().with_duration_s(0.0),
        options().with_flicker_hz(Some(0.0)),
    ];
    for o in bad {
        let error = Scene::from_seed(1, &o).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Usage);
        assert!(error.to_string().contains("expected"), "{error}");
    }
    let scene = Scene::from_seed(1, &options().with_vehicles(Some(0))).unwrap();
    assert_eq!(scene.camera(2.5).unwrap_err().kind(), ErrorKind::Usage);
    assert_eq!(scene.plan_keyframes(1.0, 0.5, 20_000.0, 1).unwrap_err().kind(), ErrorKind::Usage);
}

#[test]
fn a_drive_of_ten_kilometers_is_refused_with_a_remedy() {
    let long = options().with_duration_s(120.0).with_speed_kmh(Some(300.0));
    let error = Scene::from_seed(1, &long).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Usage);
    assert!(error.to_string().contains("shorten or slow down the drive"), "{error}");
}
