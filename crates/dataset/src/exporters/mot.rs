//! Writes tracks in the text format of MOTChallenge. The files are `SPLIT/mot/ID/gt/gt.txt` and
//! `SPLIT/mot/ID/seqinfo.ini`.

use std::fmt::Write as _;

use crate::hidden_file::write_if_changed;
use crate::labels::LabeledFrame;
use crate::{DatasetOptions, SequenceEntry};
use spikelane::error::Result;
use spikelane::unstable::inputs::InnerPath;

/// MOT's class number of cars. All vehicles have this class, because MOT has no class for buses and trucks.
const VEHICLE_CLASS: u32 = 3;

/// Returns one line per vehicle and frame. The fields are frame, track, left, top, width, height, 1, class and
/// visibility.
///
/// A frame is a labeled readout. Frame numbers and pixel coordinates start at 1.
pub(super) fn track_text(frames: &[LabeledFrame]) -> String {
    let mut text = String::new();
    for (frame, labeled) in (1..).zip(frames) {
        for b in labeled.visible_vehicles() {
            let [x0, y0, x1, y1] = b.clipped_amodal_box;
            // Writing to a string cannot fail, so the result is ignored.
            let _ = writeln!(
                text,
                "{frame},{},{:.2},{:.2},{:.2},{:.2},1,{VEHICLE_CLASS},{:.4}",
                b.track_id,
                x0 + 1.0,
                y0 + 1.0,
                x1 - x0,
                y1 - y0,
                1.0 - b.occlusion
            );
        }
    }
    text
}

/// Writes `gt.txt` and `seqinfo.ini` of a sequence to the folder of its split.
pub(super) fn write(options: &DatasetOptions, entry: &SequenceEntry, frames: &[LabeledFrame]) -> Result<()> {
    let folder = InnerPath::from(entry.split.name()).join("mot").join(&entry.id);
    write_if_changed(&options.output, &folder.join("gt/gt.txt"), track_text(frames).as_bytes())?;
    let Some(first) = frames.first() else { return Ok(()) };
    // `frameRate` is the number of labeled readouts per second. The labeled readouts have constant spacing.
    let every = frames.get(1).map_or(1, |next| next.readout.saturating_sub(first.readout).max(1));
    let info = format!(
        "[Sequence]\nname={}\nimDir=img1\nframeRate={}\nseqLength={}\nimWidth={}\nimHeight={}\nimExt=.png\n",
        entry.id,
        options.camera.sensor.readout_hz / every as f64,
        frames.len(),
        first.camera.width,
        first.camera.height
    );
    write_if_changed(&options.output, &folder.join("seqinfo.ini"), info.as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::labels::{FrameCamera, VehicleLabel};

    #[test]
    fn pixels_and_frames_count_from_one_and_what_is_hidden_is_left_out() {
        let label = |track_id, visible_pixels| VehicleLabel {
            track_id,
            class: "Car".into(),
            clipped_amodal_box: [0.0, 2.0, 10.0, 6.5],
            visible_pixels,
            occlusion: 0.25,
            truncation: 0.0,
            center_camera_m: [0.0, 0.0, 9.0],
        };
        let camera =
            FrameCamera { focal_px: 1.0, center_px: [5.0, 5.0], width: 10, height: 10, speed_mps: 1.0 };
        let frame = |readout, boxes| LabeledFrame { readout, camera: camera.clone(), boxes };
        let text = track_text(&[frame(0, vec![label(7, 3), label(8, 0)]), frame(20, vec![label(7, 1)])]);
        assert_eq!(text, "1,7,1.00,3.00,10.00,4.50,1,3,0.7500\n2,7,1.00,3.00,10.00,4.50,1,3,0.7500\n");
    }
}
