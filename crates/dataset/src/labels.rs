//! Labels of one sequence, each naming its readout.

use std::fs;
use std::path::Path;

use serde_json::{Value, json};

use spikelane::error::{Error, Kind, Result};
use spikelane_measure::report::with_known;
use spikelane_scene::{Camera, Flow, KeyPlan, Labels, SamplesPerPixel, Scene, VehicleBox, labels};

/// Writes a file into a folder that gets its name only when it is complete.
pub(super) fn write(folder: &Path, name: &str, bytes: &[u8]) -> Result<()> {
    let path = folder.join(name);
    fs::write(&path, bytes).map_err(|e| Error::io(path.display(), e))
}

/// Which labels are written, and how.
pub(super) struct Wanted {
    /// Readouts from one labelled readout to the next.
    pub every: usize,
    /// Also KITTI's 16-bit PNGs.
    pub kitti: bool,
    /// Also the light in colour, with this many samples of a pixel.
    pub exr: Option<SamplesPerPixel>,
    pub threads: usize,
}

/// Writes the labels into `folder`; returns the labelled readouts.
///
/// Flow leads to the next labelled readout (forward) and to the previous one (backward).
pub(super) fn write_all(
    scene: &Scene,
    plan: &KeyPlan,
    wanted: &Wanted,
    folder: &Path,
    watch: &mut dyn FnMut() -> Result<()>,
) -> Result<Vec<usize>> {
    fs::create_dir_all(folder).map_err(|e| Error::io(folder.display(), e))?;
    let threads = wanted.threads;
    let readouts: Vec<usize> = (0..plan.readouts.len()).step_by(wanted.every).collect();
    let mut coco = labels::Coco::default();
    let mut frames = Vec::new();
    let mut before: Option<(usize, Labels)> = None;
    for &readout in &readouts {
        watch()?;
        let stem = format!("{readout:06}");
        let now = labels_at(scene, plan.readouts[readout], wanted, folder, &stem)?;
        let boxes = scene.boxes(&now)?;
        maps(folder, &stem, &now, wanted.kitti)?;
        write(folder, &format!("{stem}.kitti.txt"), labels::kitti_text(&boxes, 1).as_bytes())?;
        coco.add(&format!("{stem}.png"), readout as u64, &now, &boxes);
        if let Some((earlier, old)) = &before {
            let forward = scene.flow(old, &now, threads)?;
            let backward = scene.flow(&now, old, threads)?;
            flow(folder, &format!("{earlier:06}.forward"), &forward, wanted.kitti)?;
            flow(folder, &format!("{stem}.backward"), &backward, wanted.kitti)?;
        }
        frames.push(frame(readout, now.t, &scene.camera(now.t)?, &boxes, &readouts));
        before = Some((readout, now));
    }
    let json = |v: &Value| {
        serde_json::to_vec_pretty(v).map_err(|e| Error::new(Kind::Config, folder.display()).found(e))
    };
    write(folder, "coco.json", &json(&coco.json())?)?;
    write(folder, "labels.json", &json(&json!({ "frames": frames }))?)?;
    Ok(readouts)
}

/// The labels at `t`; with EXR the light that belongs to them is drawn too.
fn labels_at(scene: &Scene, t: f64, wanted: &Wanted, folder: &Path, stem: &str) -> Result<Labels> {
    let Some(samples) = wanted.exr else { return scene.labels(t, wanted.threads) };
    let drawn = scene.render(t, samples, wanted.threads)?;
    let light = labels::exr(&drawn.rgb, drawn.labels.width, drawn.labels.height)?;
    write(folder, &format!("{stem}.light.exr"), &light)?;
    Ok(drawn.labels)
}

fn maps(folder: &Path, stem: &str, now: &Labels, kitti: bool) -> Result<()> {
    if kitti {
        let depth = labels::kitti_depth(&now.depth_m, now.width, now.height)?;
        write(folder, &format!("{stem}.depth.kitti.png"), &depth)?;
    }
    let shape = [now.height, now.width];
    write(folder, &format!("{stem}.depth.npy"), &labels::npy_depth(now)?)?;
    write(folder, &format!("{stem}.instance.npy"), &labels::npy_u32(&shape, &now.instance)?)?;
    write(folder, &format!("{stem}.semantic.npy"), &labels::npy_u8(&shape, &now.semantic)?)
}

fn flow(folder: &Path, stem: &str, flow: &Flow, kitti: bool) -> Result<()> {
    if kitti {
        // Hidden pixels stay valid; the mask beside them tells.
        write(folder, &format!("{stem}.kitti.png"), &labels::kitti_flow(flow, true)?)?;
    }
    write(folder, &format!("{stem}.flo"), &labels::flo(flow)?)?;
    let occluded = labels::npy_bool(&[flow.height, flow.width], &flow.occluded)?;
    write(folder, &format!("{stem}.occluded.npy"), &occluded)
}

fn frame(readout: usize, t_s: f64, camera: &Camera, boxes: &[VehicleBox], all: &[usize]) -> Value {
    let at = all.partition_point(|&r| r < readout);
    let (i, p) = (&camera.intrinsics, &camera.pose);
    let rotation = p.rotation.transpose().to_cols_array();
    let about = json!({
        "readout": readout, "t_s": t_s,
        "camera": {
            "focal_px": i.focal_px, "centre_px": i.centre_px, "width": i.width, "height": i.height,
            "position_m": p.position.to_array(), "world_to_camera_rows": rotation, "speed_mps": camera.speed_mps,
        },
        "boxes": boxes.iter().map(vehicle).collect::<Vec<_>>(),
    });
    // The last labelled readout has no next one, the first no previous one.
    let flow = [
        ("flow_forward_to", all.get(at + 1).map(|r| json!(r))),
        ("flow_backward_to", at.checked_sub(1).map(|k| json!(all[k]))),
    ];
    with_known(about, flow)
}

/// A box; one of a vehicle that no pixel sees has no `visible`.
fn vehicle(b: &VehicleBox) -> Value {
    let about = json!({
        "track_id": b.track_id, "class": b.class.kitti(), "amodal": b.amodal,
        "amodal_in_image": b.amodal_in_image, "visible_pixels": b.visible_pixels,
        "alone_pixels": b.alone_pixels, "occlusion": b.occlusion, "truncation": b.truncation,
        "centre_camera_m": b.centre_m, "centre_world_m": b.centre_world_m, "size_m": b.size_m,
        "yaw": b.yaw, "rotation_y": b.rotation_y, "speed_mps": b.speed_mps,
    });
    with_known(about, [("visible", b.visible.map(|v| json!(v)))])
}
