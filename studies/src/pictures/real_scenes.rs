//! Scores of recordings of real cameras. An image is compared with the mean of all readouts from which the image is not
//! computed.

use std::ops::Range;
use std::path::Path;

use spikelane::reconstruct::tfp;
use spikelane::{Geometry, SpikeFramesRef};
use spikelane_io::formats::{Layout, StreamReader};

use super::score::{Row, row};

/// Returns the mean spikes per readout of each pixel. The mean excludes the readouts in `used`.
pub(crate) fn mean_of_others(packed: SpikeFramesRef, used: Range<usize>) -> Vec<f32> {
    let all = packed.readouts();
    let (counted, within) = (all as f32, used.len() as f32);
    let full = tfp(packed, all / 2, all).unwrap();
    let middle = used.start + used.len() / 2;
    let window = tfp(packed, middle, used.len() / 2).unwrap();
    full.iter().zip(window).map(|(a, b)| (a * counted - b * within) / (counted - within)).collect()
}

/// Rows of the static recording without motion.
pub(crate) const STATIC_ROWS: Range<usize> = 100..180;

pub(crate) fn rows(folder: &Path) -> Vec<Row> {
    let size = Geometry::new(400, 250).unwrap();
    let still =
        StreamReader::open(&folder.join("static_400x250x300.dat"), Some(Layout::Dat), Some(size)).unwrap();
    let dim = StreamReader::open(&folder.join("lowlight_250x250x120.npz"), None, None).unwrap();
    let area = STATIC_ROWS.start * size.width()..STATIC_ROWS.end * size.width();
    let pixels = dim.geometry().pixels();
    vec![
        recorded_row("outdoors, still rows, 300 readouts", &still, area),
        recorded_row("low light, 120 readouts", &dim, 0..pixels),
    ]
}

/// Scores the images of a recording. The reference of an image is the mean of the readouts from which the image is not
/// computed.
fn recorded_row(name: &str, reader: &StreamReader, area: Range<usize>) -> Row {
    let geometry = reader.geometry();
    let mut bytes = vec![0; reader.readouts() * geometry.frame_bytes()];
    reader.read_frames(0, &mut bytes).unwrap();
    let packed = SpikeFramesRef::new(geometry, &bytes).unwrap();
    row(name, packed, area, &|used| mean_of_others(packed, used))
}
