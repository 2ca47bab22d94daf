//! Labels as KITTI's tracking benchmark has them: `SPLIT/kitti/label_02/ID.txt`, and `SPLIT/kitti/calib/ID.txt`.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use super::links::put;
use crate::dataset::Entry;
use crate::dataset::frames::{LabelledFrame, Lens};
use crate::error::{Error, Kind, Result};

/// Writes both into the folder of a split.
pub(super) fn write(
    split: &Path,
    sequence: &Path,
    entry: &Entry,
    camera: &Lens,
    frames: &[LabelledFrame],
) -> Result<()> {
    let mut text = String::new();
    for (index, frame) in frames.iter().enumerate() {
        let path = sequence.join(format!("labels/{:06}.kitti.txt", frame.readout));
        let own = fs::read_to_string(&path).map_err(|e| Error::io(path.display(), e))?;
        let lines = tracked(index, frame, &own);
        text += &lines.ok_or_else(|| {
            Error::new(Kind::Corrupt, path.display())
                .found("other vehicles")
                .expected("those of labels.json")
                .remedy("make the sequence again")
        })?;
    }
    let (folder, name) = (split.join("kitti"), format!("{}.txt", entry.id));
    put(&folder.join("label_02"), &name, text.as_bytes())?;
    put(&folder.join("calib"), &name, calib(camera).as_bytes())
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
