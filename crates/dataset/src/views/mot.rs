//! Tracks as MOTChallenge's text: `SPLIT/mot/ID/gt/gt.txt` and `seqinfo.ini`.

use std::fmt::Write as _;

use super::links::put;
use crate::frames::LabelledFrame;
use crate::{DatasetOptions, Entry};
use spikelane::error::Result;
use spikelane::unstable::inputs::InnerPath;

/// MOT's class of cars; it has none for buses and trucks.
const VEHICLE: u32 = 3;

/// A line a vehicle and frame: frame, track, left, top, width, height, 1, class, visibility. Frames are the labelled
/// readouts, counted from 1; so are pixels.
pub(super) fn text(frames: &[LabelledFrame]) -> String {
    let mut text = String::new();
    for (frame, labelled) in (1..).zip(frames) {
        for b in labelled.seen() {
            let [x0, y0, x1, y1] = b.amodal_in_image;
            // Writing to a string cannot fail.
            let _ = writeln!(
                text,
                "{frame},{},{:.2},{:.2},{:.2},{:.2},1,{VEHICLE},{:.4}",
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

/// Writes both into the folder of the split.
pub(super) fn write(options: &DatasetOptions, entry: &Entry, frames: &[LabelledFrame]) -> Result<()> {
    let folder = InnerPath::from(entry.split.name()).join("mot").join(&entry.id);
    put(&options.output, &folder.join("gt/gt.txt"), text(frames).as_bytes())?;
    let Some(first) = frames.first() else { return Ok(()) };
    // Frames a second: labels are evenly spaced.
    let every = frames.get(1).map_or(1, |next| next.readout.saturating_sub(first.readout).max(1));
    let info = format!(
        "[Sequence]\nname={}\nimDir=img1\nframeRate={}\nseqLength={}\nimWidth={}\nimHeight={}\nimExt=.png\n",
        entry.id,
        options.camera.sensor.readout_hz / every as f64,
        frames.len(),
        first.camera.width,
        first.camera.height
    );
    put(&options.output, &folder.join("seqinfo.ini"), info.as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frames::{Lens, Seen};

    #[test]
    fn pixels_and_frames_count_from_one_and_what_is_hidden_is_left_out() {
        let seen = |track_id, visible_pixels| Seen {
            track_id,
            class: "Car".into(),
            amodal_in_image: [0.0, 2.0, 10.0, 6.5],
            visible_pixels,
            occlusion: 0.25,
            truncation: 0.0,
            centre_camera_m: [0.0, 0.0, 9.0],
        };
        let camera = Lens { focal_px: 1.0, centre_px: [5.0, 5.0], width: 10, height: 10, speed_mps: 1.0 };
        let frame = |readout, boxes| LabelledFrame { readout, camera: camera.clone(), boxes };
        let found = text(&[frame(0, vec![seen(7, 3), seen(8, 0)]), frame(20, vec![seen(7, 1)])]);
        assert_eq!(found, "1,7,1.00,3.00,10.00,4.50,1,3,0.7500\n2,7,1.00,3.00,10.00,4.50,1,3,0.7500\n");
    }
}
