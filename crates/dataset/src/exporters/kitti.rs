//! Writes labels in the format of KITTI's tracking benchmark. The files are `SPLIT/kitti/label_02/ID.txt` and
//! `SPLIT/kitti/calib/ID.txt`.

use std::fmt::Write as _;

use crate::hidden_file::write_if_changed;
use crate::labels::{FrameCamera, LabeledFrame};
use crate::{DatasetOptions, SequenceEntry};
use spikelane::error::{Error, ErrorKind, Result};
use spikelane::unstable::inputs::{InnerPath, PlainName, read_text};

/// Writes the label file and the calibration file of a sequence to the folder of its split.
pub(super) fn write(
    options: &DatasetOptions,
    entry: &SequenceEntry,
    camera: &FrameCamera,
    frames: &[LabeledFrame],
) -> Result<()> {
    let mut text = String::new();
    for (index, frame) in frames.iter().enumerate() {
        let name = PlainName::from_number(frame.readout, 6).with_ending(".kitti.txt");
        let path = entry.path().join("labels").join(name).resolve_in(&options.output, options.access())?;
        let labels_text = read_text(&path, "KITTI labels")?;
        let lines = track_lines(index, frame, &labels_text);
        text += &lines.ok_or_else(|| {
            Error::new(ErrorKind::Corrupt, path.display())
                .found("different vehicles")
                .expected("the vehicles of labels.json")
                .remedy("generate the sequence again")
        })?;
    }
    let folder = InnerPath::from(entry.split.name()).join("kitti");
    let name = entry.id.with_ending(".txt");
    write_if_changed(&options.output, &folder.join("label_02").join(&name), text.as_bytes())?;
    write_if_changed(&options.output, &folder.join("calib").join(&name), calibration_text(camera).as_bytes())
}

/// Returns the lines of one readout, with frame number and track id at the start of each line. `labels_text` contains
/// the lines of the sequence's label file. Returns `None` if `labels_text` does not contain the same vehicles as
/// `frame`.
///
/// The tracking benchmark has three truncation levels, which replace the truncation value of each line in
/// `labels_text`.
fn track_lines(index: usize, frame: &LabeledFrame, labels_text: &str) -> Option<String> {
    let mut text = String::new();
    let mut lines = labels_text.lines();
    for b in frame.visible_vehicles() {
        let line = lines.next()?;
        let mut parts = line.splitn(3, ' ');
        let (class, _, rest) = (parts.next()?, parts.next()?, parts.next()?);
        if class != b.class {
            return None;
        }
        let truncated = match b.truncation {
            t if t < 0.01 => 0,
            t if t < 0.5 => 1,
            _ => 2,
        };
        let _ = writeln!(text, "{index} {} {class} {truncated} {rest}", b.track_id);
    }
    lines.next().is_none().then_some(text)
}

/// Returns the text of KITTI's calibration file. A KITTI car has four cameras and a lidar. Here, the four cameras are
/// identical and need no rectification. The lidar is at the position of the camera, and its axes point forward, left
/// and up.
///
/// In KITTI files, the center of the first pixel has coordinate 0.
fn calibration_text(camera: &FrameCamera) -> String {
    let f = camera.focal_px;
    let [x, y] = camera.center_px.map(|c| c - 0.5);
    let mut text = String::new();
    for n in 0..4 {
        let _ = writeln!(text, "P{n}: {f:e} 0 {x:e} 0 0 {f:e} {y:e} 0 0 0 1 0");
    }
    text + "R0_rect: 1 0 0 0 1 0 0 0 1\nTr_velo_to_cam: 0 -1 0 0 0 0 -1 0 1 0 0 0\n\
            Tr_imu_to_velo: 1 0 0 0 0 1 0 0 0 0 1 0\n"
}
