//! Labels as KITTI's tracking benchmark has them: `SPLIT/kitti/label_02/ID.txt`, and `SPLIT/kitti/calib/ID.txt`.

use std::fmt::Write as _;

use super::links::put;
use crate::frames::{LabelledFrame, Lens};
use crate::{DatasetOptions, Entry};
use spikelane::error::{Error, Kind, Result};
use spikelane::unstable::inputs::{InnerPath, PlainName, read_text};

/// Writes both into the folder of the split.
pub(super) fn write(
    options: &DatasetOptions,
    entry: &Entry,
    camera: &Lens,
    frames: &[LabelledFrame],
) -> Result<()> {
    let mut text = String::new();
    for (index, frame) in frames.iter().enumerate() {
        let name = PlainName::number(frame.readout, 6).with(".kitti.txt");
        let path = entry.path().join("labels").join(name).below(&options.output, options.access())?;
        let own = read_text(&path, "KITTI's labels")?;
        let lines = tracked(index, frame, &own);
        text += &lines.ok_or_else(|| {
            Error::new(Kind::Corrupt, path.display())
                .found("other vehicles")
                .expected("those of labels.json")
                .remedy("make the sequence again")
        })?;
    }
    let folder = InnerPath::from(entry.split.name()).join("kitti");
    let name = entry.id.with(".txt");
    put(&options.output, &folder.join("label_02").join(&name), text.as_bytes())?;
    put(&options.output, &folder.join("calib").join(&name), calib(camera).as_bytes())
}

/// The lines of a readout with frame and track before them. The tracking benchmark counts truncation in three steps.
fn tracked(index: usize, frame: &LabelledFrame, own: &str) -> Option<String> {
    let mut text = String::new();
    let mut lines = own.lines();
    for b in frame.seen() {
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

/// The camera's matrices: four cameras that are one, no rectification, and a lidar in the camera's place, its axes
/// forward, left and up.
///
/// KITTI counts pixels from the middle of the first one.
fn calib(camera: &Lens) -> String {
    let f = camera.focal_px;
    let [x, y] = camera.centre_px.map(|c| c - 0.5);
    let mut text = String::new();
    for n in 0..4 {
        let _ = writeln!(text, "P{n}: {f:e} 0 {x:e} 0 0 {f:e} {y:e} 0 0 0 1 0");
    }
    text + "R0_rect: 1 0 0 0 1 0 0 0 1\nTr_velo_to_cam: 0 -1 0 0 0 0 -1 0 1 0 0 0\n\
            Tr_imu_to_velo: 1 0 0 0 0 1 0 0 0 0 1 0\n"
}
