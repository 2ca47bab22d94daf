//! Recordings of real cameras, against the mean of their other readouts.

use std::ops::Range;
use std::path::Path;

use spikelane::reconstruct::tfp;
use spikelane::{Geometry, Packed};
use spikelane_io::formats::{Layout, Reader};

use super::score::{Row, row};

/// Spikes per readout outside of `used`.
pub(crate) fn mean_of_others(packed: Packed, used: Range<usize>) -> Vec<f32> {
    let all = packed.readouts();
    let (counted, within) = (all as f32, used.len() as f32);
    let whole = tfp(packed, all / 2, all).unwrap();
    let middle = used.start + used.len() / 2;
    let window = tfp(packed, middle, used.len() / 2).unwrap();
    whole.iter().zip(window).map(|(a, b)| (a * counted - b * within) / (counted - within)).collect()
}

/// The scene stands still in these rows of the static recording.
pub(crate) const STILL: Range<usize> = 100..180;

pub(crate) fn rows(folder: &Path) -> Vec<Row> {
    let size = Geometry::new(400, 250).unwrap();
    let still = Reader::open(&folder.join("static_400x250x300.dat"), Some(Layout::Dat), Some(size)).unwrap();
    let dim = Reader::open(&folder.join("lowlight_250x250x120.npz"), None, None).unwrap();
    let area = STILL.start * size.width()..STILL.end * size.width();
    let pixels = dim.geometry().pixels();
    [
        pair("outdoors, still rows, 300 readouts", &still, area),
        pair("low light, 120 readouts", &dim, 0..pixels),
    ]
    .into_iter()
    .flatten()
    .collect()
}

/// Against the other readouts, and against all of them, which holds the picture's own.
fn pair(name: &str, reader: &Reader, area: Range<usize>) -> [Row; 2] {
    let geometry = reader.geometry();
    let mut bytes = vec![0; reader.readouts() * geometry.frame_bytes()];
    reader.read_frames(0, &mut bytes).unwrap();
    let packed = Packed::new(geometry, &bytes).unwrap();
    let all = tfp(packed, packed.readouts() / 2, packed.readouts()).unwrap();
    [
        row(&format!("{name}, to the others"), packed, area.clone(), &|used| mean_of_others(packed, used)),
        row(&format!("{name}, to all"), packed, area, &|_| all.clone()),
    ]
}
