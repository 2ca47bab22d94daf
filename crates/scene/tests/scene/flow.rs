//! Tests of flow, depth and warping. The results are compared with geometry and with renders.

use spikelane_scene::{
    DVec3, Flow, KeyframePlan, Labels, Lighting, SamplesPerPixel, Scene, SceneOptions, Semantic, Warp,
};

fn scene(seed: u64, lighting: Lighting) -> Scene {
    let options = SceneOptions::default()
        .with_width(200)
        .with_height(125)
        .with_lighting(Some(lighting))
        .with_duration_s(1.0);
    Scene::from_seed(seed, &options).unwrap()
}

fn median(mut values: Vec<f64>) -> f64 {
    assert!(!values.is_empty());
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// Returns the backward flow at (x, y), interpolated between the four nearest pixel centers. Returns `None` if one of
/// these pixel centers does not show `part`.
fn at(flow: &Flow, labels: &Labels, part: u16, x: f32, y: f32) -> Option<(f32, f32)> {
    let (x, y) = (x - 0.5, y - 0.5);
    let (x0, y0) = (x.floor(), y.floor());
    if x0 < 0.0 || y0 < 0.0 || x0 + 1.0 >= flow.width as f32 || y0 + 1.0 >= flow.height as f32 {
        return None;
    }
    let i = y0 as usize * flow.width + x0 as usize;
    let corners = [i, i + 1, i + flow.width, i + flow.width + 1];
    if corners.iter().any(|&k| labels.part[k] != part) {
        return None;
    }
    let (u, v) = (x - x0, y - y0);
    let mix = |f: &[f32]| {
        let top = f[corners[0]] * (1.0 - u) + f[corners[1]] * u;
        let bottom = f[corners[2]] * (1.0 - u) + f[corners[3]] * u;
        top * (1.0 - v) + bottom * v
    };
    Some((mix(&flow.dx), mix(&flow.dy)))
}

#[test]
fn backward_flow_inverts_forward_flow() {
    for (seed, lighting) in [(1, Lighting::Noon), (2, Lighting::Night)] {
        let scene = scene(seed, lighting);
        let (a, b) = (scene.labels(0.30, 1).unwrap(), scene.labels(0.32, 1).unwrap());
        let forward = scene.flow(&a, &b, 1).unwrap();
        let backward = scene.flow(&b, &a, 1).unwrap();
        let mut errors = Vec::new();
        for i in 0..a.part.len() {
            if forward.is_occluded[i] {
                continue;
            }
            let (x, y) = ((i % 200) as f32 + 0.5, (i / 200) as f32 + 0.5);
            if let Some((bx, by)) = at(&backward, &b, a.part[i], x + forward.dx[i], y + forward.dy[i]) {
                errors.push(f64::from(forward.dx[i] + bx).hypot(f64::from(forward.dy[i] + by)));
            }
        }
        assert!(errors.len() > 15_000, "only {} pixels could be compared", errors.len());
        let median = median(errors);
        assert!(median < 0.05, "seed {seed}: median error {median} px");
    }
}

#[test]
fn depth_and_poses_give_the_flow_of_static_points() {
    let scene = scene(3, Lighting::Overcast);
    let (t0, t1) = (0.5, 0.51);
    let (a, b) = (scene.labels(t0, 1).unwrap(), scene.labels(t1, 1).unwrap());
    let flow = scene.flow(&a, &b, 1).unwrap();
    let (from, to) = (scene.camera(t0).unwrap(), scene.camera(t1).unwrap());
    let k = from.intrinsics;
    let mut worst = 0.0f64;
    for i in (0..a.part.len()).filter(|&i| a.part[i] == 1) {
        let (x, y) = ((i % 200) as f64 + 0.5, (i / 200) as f64 + 0.5);
        let z = f64::from(a.depth_m[i]);
        let [u, v] = k.ray_of_pixel([x, y]);
        let ray = DVec3::new(u, v, 1.0);
        let world = from.pose.rotation.transpose() * (ray * z) + from.pose.position;
        if let Some([u, v, depth]) = to.project(world).filter(|p| p[2] > 1.0) {
            let error = (u - x - f64::from(flow.dx[i])).hypot(v - y - f64::from(flow.dy[i]));
            worst = worst.max(error);
            assert!(depth.is_finite());
        }
    }
    // Both computations start from the same depth, so only rounding errors remain. In single precision, the error of a
    // flow of about 10 px is 1e-6 px.
    assert!(worst < 1e-3, "worst error {worst} px");
}

#[test]
fn unoccluded_points_are_visible_at_the_other_instant() {
    let scene = scene(4, Lighting::Noon);
    let (a, b) = (scene.labels(0.4, 1).unwrap(), scene.labels(0.46, 1).unwrap());
    let flow = scene.flow(&a, &b, 1).unwrap();
    let (mut visible, mut same, mut hidden, mut behind) = (0, 0, 0, 0);
    for i in 0..a.part.len() {
        let (x, y) = ((i % 200) as f32 + 0.5 + flow.dx[i], (i / 200) as f32 + 0.5 + flow.dy[i]);
        if x < 0.0 || y < 0.0 || x >= 200.0 || y >= 125.0 {
            assert!(flow.is_occluded[i], "a point outside the image is occluded");
            continue;
        }
        // Leaves have gaps that are smaller than a pixel, so the nearest pixel center may show another surface.
        if a.semantic[i] == Semantic::Vegetation as u8 {
            continue;
        }
        let j = y as usize * 200 + x as usize;
        if flow.is_occluded[i] {
            hidden += 1;
            behind += usize::from(b.part[j] != a.part[i] || b.depth_m[j] < a.depth_m[i]);
        } else {
            visible += 1;
            same += usize::from(b.part[j] == a.part[i]);
        }
    }
    // The nearest pixel center may be on the other side of an edge. This occurs for a few percent of all pixels.
    assert!(same as f64 > 0.97 * f64::from(visible), "{same} of {visible} visible points keep their part");
    assert!(
        hidden > 20 && behind as f64 > 0.8 * f64::from(hidden),
        "{behind} of {hidden} hidden points are covered"
    );
}

#[test]
fn key_frames_bound_the_motion_between_them() {
    let scene = scene(5, Lighting::Noon);
    let plan = scene.plan_keyframes(0.2, 0.21, 20_000.0, 1).unwrap();
    assert_eq!(plan.readouts.len(), 201);
    assert_eq!((plan.keyframes[0], plan.keyframes[plan.keyframes.len() - 1]), (0, 200));
    assert!(!plan.is_too_fast() && plan.keyframes.len() < 101, "{} keys", plan.keyframes.len());
    check_motion_between_keyframes(&scene, &plan, 7);
    // The fastest point of this drive becomes faster between two samples of the speed.
    let options = SceneOptions::default().with_width(200).with_height(125).with_duration_s(0.6);
    let scene = Scene::from_seed(9, &options).unwrap();
    let plan = scene.plan_keyframes(0.3, 0.33, 20_000.0, 1).unwrap();
    check_motion_between_keyframes(&scene, &plan, 3);
}

fn check_motion_between_keyframes(scene: &Scene, plan: &KeyframePlan, step: usize) {
    for w in plan.keyframes.windows(2).step_by(step) {
        let [a, b] = [w[0], w[1]].map(|k| scene.labels(plan.readouts[k], 1).unwrap());
        let flow = scene.flow(&a, &b, 1).unwrap();
        let max_motion = flow.dx.iter().zip(&flow.dy).map(|(x, y)| x.hypot(*y)).fold(0.0f32, f32::max);
        assert!(max_motion <= 0.25, "{max_motion} px between key frames");
    }
}

/// Returns the mean absolute difference between `x` and `truth`, divided by the mean of `truth`.
fn difference(x: &[f32], truth: &[f32]) -> f64 {
    let sum: f64 = x.iter().zip(truth).map(|(p, q)| f64::from((p - q).abs())).sum();
    sum / truth.iter().map(|&q| f64::from(q)).sum::<f64>()
}

#[test]
fn warped_frames_come_close_to_true_renders() {
    let scene = scene(6, Lighting::LowSun);
    let plan = scene.plan_keyframes(0.5, 0.53, 40_000.0, 1).unwrap();
    let render = |k: usize| scene.render(plan.readouts[k], SamplesPerPixel::Sixteen, 1).unwrap();
    let mut errors = Vec::new();
    for (first, last) in [(2, 3), (2, 26)] {
        let (i, j) = (plan.keyframes[first], plan.keyframes[last]);
        assert!(j - i >= 2, "no readout between keys {i} and {j}");
        let (a, b, truth) = (render(i), render(j), render(i.midpoint(j)));
        let warped = Warp::new(&scene, &a, &b).unwrap().light(plan.readouts[i.midpoint(j)]).unwrap();
        errors.push((difference(&warped, &truth.light), difference(&a.light, &truth.light)));
    }
    let (planned, far) = (errors[0], errors[1]);
    // Most of the remaining error is sampling noise. With sixteen samples per pixel, the position of an edge has an
    // error of up to 1/32 px in each of the three renders.
    assert!(planned.0 < 0.002, "warping is off by {} of the mean", planned.0);
    assert!(planned.0 < planned.1, "{planned:?}");
    // For a motion of six pixels, the error without warping is much larger than the sampling noise.
    assert!(far.0 < 0.7 * far.1, "{far:?}");
}
