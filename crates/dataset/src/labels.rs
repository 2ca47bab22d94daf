//! Writes and reads the labels of one sequence. Each file name contains the readout number.

use std::fs;
use std::path::Path;

use serde::Deserialize;
use serde_json::{Value, json};

use spikelane::error::{Error, ErrorKind, Result};
use spikelane::unstable::inputs::{InputFile, utf8_bytes};
use spikelane_measure::report::insert_present;
use spikelane_scene::{
    Flow, KeyframePlan, Labels, PinholeCamera, SamplesPerPixel, Scene, VehicleBox, labels,
};

/// Writes a label file to `folder`. The caller renames the folder to its final name after all files are written.
pub(super) fn write_label_file(folder: &Path, name: &str, bytes: &[u8]) -> Result<()> {
    let path = folder.join(name);
    fs::write(&path, bytes).map_err(|e| Error::io(path.display(), e))
}

/// Specifies which labels are written.
pub(super) struct LabelOptions {
    /// Number of readouts between two labeled readouts.
    pub interval_readouts: usize,
    /// Whether KITTI's 16-bit PNG files are also written.
    pub write_kitti: bool,
    /// Number of color samples per pixel of the EXR light. `None` if no EXR files are written.
    pub exr_samples: Option<SamplesPerPixel>,
    pub threads: usize,
}

/// Writes the labels to `folder`. Returns the labeled readouts.
///
/// Forward flow is the flow to the next labeled readout. Backward flow is the flow to the previous labeled readout.
pub(super) fn write_labels(
    scene: &Scene,
    plan: &KeyframePlan,
    wanted: &LabelOptions,
    folder: &Path,
    watch: &mut dyn FnMut() -> Result<()>,
) -> Result<Vec<usize>> {
    fs::create_dir_all(folder).map_err(|e| Error::io(folder.display(), e))?;
    let threads = wanted.threads;
    let readouts: Vec<usize> = (0..plan.readouts.len()).step_by(wanted.interval_readouts).collect();
    let mut coco = labels::CocoAnnotations::default();
    let mut frames = Vec::new();
    let mut before: Option<(usize, Labels)> = None;
    for &readout in &readouts {
        watch()?;
        let stem = format!("{readout:06}");
        let now = labels_at(scene, plan.readouts[readout], wanted, folder, &stem)?;
        let boxes = scene.boxes(&now)?;
        write_maps(folder, &stem, &now, wanted.write_kitti)?;
        write_label_file(folder, &format!("{stem}.kitti.txt"), labels::kitti_box_file(&boxes, 1).as_bytes())?;
        coco.add(&format!("{stem}.png"), readout as u64, &now, &boxes);
        if let Some((earlier, old)) = &before {
            let forward = scene.flow(old, &now, threads)?;
            let backward = scene.flow(&now, old, threads)?;
            write_flow(folder, &format!("{earlier:06}.forward"), &forward, wanted.write_kitti)?;
            write_flow(folder, &format!("{stem}.backward"), &backward, wanted.write_kitti)?;
        }
        frames.push(frame_json(readout, now.t, &scene.camera(now.t)?, &boxes, &readouts));
        before = Some((readout, now));
    }
    let json = |v: &Value| {
        serde_json::to_vec_pretty(v).map_err(|e| Error::new(ErrorKind::Config, folder.display()).found(e))
    };
    write_label_file(folder, "coco.json", &json(&coco.to_json())?)?;
    write_label_file(folder, "labels.json", &json(&json!({ "frames": frames }))?)?;
    Ok(readouts)
}

/// Returns the labels at time `t`. If EXR is enabled, also renders the light at `t` and writes an EXR file.
fn labels_at(scene: &Scene, t: f64, wanted: &LabelOptions, folder: &Path, stem: &str) -> Result<Labels> {
    let Some(samples) = wanted.exr_samples else { return scene.labels(t, wanted.threads) };
    let drawn = scene.render(t, samples, wanted.threads)?;
    let light = labels::exr_image(&drawn.rgb, drawn.labels.width, drawn.labels.height)?;
    write_label_file(folder, &format!("{stem}.light.exr"), &light)?;
    Ok(drawn.labels)
}

fn write_maps(folder: &Path, stem: &str, now: &Labels, kitti: bool) -> Result<()> {
    if kitti {
        let depth = labels::kitti_depth(&now.depth_m, now.width, now.height)?;
        write_label_file(folder, &format!("{stem}.depth.kitti.png"), &depth)?;
    }
    let shape = [now.height, now.width];
    write_label_file(folder, &format!("{stem}.depth.npy"), &labels::npy_depth(now)?)?;
    write_label_file(folder, &format!("{stem}.instance.npy"), &labels::npy_u32(&shape, &now.instance)?)?;
    write_label_file(folder, &format!("{stem}.semantic.npy"), &labels::npy_u8(&shape, &now.semantic)?)
}

fn write_flow(folder: &Path, stem: &str, flow: &Flow, kitti: bool) -> Result<()> {
    if kitti {
        // Occluded pixels are encoded as valid, because a separate mask file marks occluded pixels.
        write_label_file(folder, &format!("{stem}.kitti.png"), &labels::kitti_flow(flow, true)?)?;
    }
    write_label_file(folder, &format!("{stem}.flo"), &labels::flo_flow(flow)?)?;
    let occluded = labels::npy_bool(&[flow.height, flow.width], &flow.is_occluded)?;
    write_label_file(folder, &format!("{stem}.occluded.npy"), &occluded)
}

fn frame_json(
    readout: usize,
    t_s: f64,
    camera: &PinholeCamera,
    boxes: &[VehicleBox],
    all: &[usize],
) -> Value {
    let at = all.partition_point(|&r| r < readout);
    let (i, p) = (&camera.intrinsics, &camera.pose);
    let rotation = p.rotation.transpose().to_cols_array();
    let label_json = json!({
        "readout": readout, "t_s": t_s,
        "camera": {
            "focal_px": i.focal_px, "center_px": i.center_px, "distortion": i.distortion, "width": i.width, "height": i.height,
            "position_m": p.position.to_array(), "world_to_camera_rows": rotation, "speed_mps": camera.speed_mps,
        },
        "boxes": boxes.iter().map(vehicle_json).collect::<Vec<_>>(),
    });
    // The last labeled readout has no forward flow, and the first labeled readout has no backward flow.
    let flow = [
        ("flow_forward_to", all.get(at + 1).map(|r| json!(r))),
        ("flow_backward_to", at.checked_sub(1).map(|k| json!(all[k]))),
    ];
    insert_present(label_json, flow)
}

/// Returns a box as JSON. If the vehicle has no visible pixel, the key `visible` is missing.
fn vehicle_json(b: &VehicleBox) -> Value {
    let label_json = json!({
        "track_id": b.track_id, "class": b.class.kitti(), "amodal_box": b.amodal_box,
        "clipped_amodal_box": b.clipped_amodal_box, "visible_pixels": b.visible_pixels,
        "unoccluded_pixels": b.unoccluded_pixels, "occlusion": b.occlusion, "truncation": b.truncation,
        "center_camera_m": b.center_m, "center_world_m": b.center_world_m, "size_m": b.size_m,
        "yaw": b.yaw, "rotation_y": b.rotation_y, "speed_mps": b.speed_mps,
    });
    insert_present(label_json, [("visible_box", b.visible_box.map(|v| json!(v)))])
}

/// Maximum size in bytes of the `labels.json` of a sequence.
pub(super) const MAX_LABEL_BYTES: u64 = 256 << 20;

/// A labeled readout.
#[derive(Clone, Debug, Deserialize)]
pub(super) struct LabeledFrame {
    pub(super) readout: u64,
    pub(super) camera: FrameCamera,
    pub(super) boxes: Vec<VehicleLabel>,
}

/// The camera at a labeled readout.
#[derive(Clone, Debug, Deserialize)]
pub(super) struct FrameCamera {
    pub(super) focal_px: f64,
    pub(super) center_px: [f64; 2],
    pub(super) width: u64,
    pub(super) height: u64,
    pub(super) speed_mps: f64,
}

/// A vehicle at a labeled readout.
#[derive(Clone, Debug, Deserialize)]
pub(super) struct VehicleLabel {
    pub(super) track_id: u64,
    pub(super) class: String,
    pub(super) clipped_amodal_box: [f64; 4],
    pub(super) visible_pixels: u64,
    pub(super) occlusion: f64,
    pub(super) truncation: f64,
    pub(super) center_camera_m: [f64; 3],
}

impl LabeledFrame {
    /// Returns the vehicles with at least one visible pixel.
    pub(super) fn visible_vehicles(&self) -> impl Iterator<Item = &VehicleLabel> {
        self.boxes.iter().filter(|b| b.visible_pixels > 0)
    }
}

#[derive(Deserialize)]
struct LabelFile {
    frames: Vec<LabeledFrame>,
}

/// Reads the labeled readouts from the `labels.json` of a sequence.
pub(super) fn read_labeled_frames(file: &InputFile) -> Result<Vec<LabeledFrame>> {
    let text = file.read_all("labels", MAX_LABEL_BYTES)?;
    let read: LabelFile = serde_json::from_slice(&utf8_bytes(&text))
        .map_err(|e| Error::new(ErrorKind::Corrupt, file.path().display()).found(e))?;
    Ok(read.frames)
}
