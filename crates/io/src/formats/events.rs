//! Spikes as a list of events: one row (x, y, t) per spike, as an `.npy` array.

use std::ops::Range;
use std::path::Path;

use crate::formats::convert::for_each_batch;
use crate::formats::{Crop, StreamReader, StreamSummary};
use crate::storage::{Digest, FileWriter};
use spikelane::error::{Result, Setting, bail};
use spikelane::spikes::{self, firing_pixels};
use spikelane::unstable::npy::{self, Element};

/// Bytes of one event, which consists of three 32-bit integers.
const EVENT_BYTES: u64 = 12;

/// The layout name of event lists in arguments and sidecars.
pub const EVENTS_LAYOUT: &str = "events";

/// Writes the spikes in the range `readouts` of a stream as an `.npy` array of events. If `crop` is given, only
/// spikes in this rectangle are written.
///
/// The array has shape (N, 3) and elements of type little-endian `i32`. The columns contain x, y and the readout
/// number. x and y are 0 at the upper left corner of the crop. Readouts are numbered from 0 at the start of
/// `readouts`. Events are sorted by readout, then by row, then by column.
///
/// The stream is read twice. The first pass counts the spikes, so that the file can be created with its final length.
/// `progress` receives the number of readouts written. During the first pass this number is 0.
///
/// # Examples
/// ```
/// use spikelane_io::formats::{StreamReader, write_events};
/// # let folder = tempfile::tempdir().map_err(|e| spikelane::Error::io("a folder", e))?;
/// # let path = folder.path().join("events.npy");
/// let geometry = spikelane::Geometry::new(8, 1)?;
/// let reader = StreamReader::from_bytes("mine", vec![0b1000_0001, 0, 0b10], None, Some(geometry))?;
/// let summary = write_events(&reader, 0..3, None, &path, false, |_| Ok(()))?;
/// // A header of 128 bytes, and three rows (x, y, t) of 32-bit integers.
/// assert_eq!((summary.spikes, summary.bytes), (3, 128 + 3 * 3 * 4));
/// # Ok::<(), spikelane::Error>(())
/// ```
///
/// # Errors
/// * [`ErrorKind::Usage`](spikelane::ErrorKind::Usage) if the range or the crop exceeds the stream, or if the number of readouts exceeds 2^31 - 1.
/// * [`ErrorKind::Exists`](spikelane::ErrorKind::Exists), [`ErrorKind::Space`](spikelane::ErrorKind::Space) and the other file errors of
///   [`StreamWriter::create`](super::StreamWriter::create).
/// * Errors of the reader and of `progress`.
pub fn write_events(
    reader: &StreamReader,
    readouts: Range<usize>,
    crop: Option<Crop>,
    path: &Path,
    force: bool,
    mut progress: impl FnMut(u64) -> Result<()>,
) -> Result<StreamSummary> {
    let geometry = crop.map_or(Ok(reader.geometry()), |c| c.geometry(reader.geometry()))?;
    if i32::try_from(readouts.len()).is_err() {
        bail!(Usage, "readouts"; found "{}", readouts.len();
            expected "at most 2147483647 readouts in a list of events";
            remedy "select a part of the readouts with {}", Setting("readouts"));
    }
    let mut count = 0;
    for_each_batch(reader, readouts.clone(), crop, |packed| {
        count += spikes::count_spikes(packed);
        progress(0)
    })?;
    let header = npy::header_bytes(Element::I32, &[count, 3]);
    let mut writer = FileWriter::create(path, header.len() as u64 + EVENT_BYTES * count, force)?;
    let mut digest = Digest::new();
    let mut put = |bytes: &[u8]| {
        digest.update(bytes);
        writer.write_all(bytes)
    };
    put(&header)?;
    let (width, mut readout, mut rows) = (geometry.width(), 0i32, Vec::new());
    for_each_batch(reader, readouts, crop, |packed| {
        rows.clear();
        for frame in packed.chunks_exact(geometry.frame_bytes()) {
            for p in firing_pixels(frame) {
                let event = [(p % width) as i32, (p / width) as i32, readout];
                rows.extend(event.iter().flat_map(|n| n.to_le_bytes()));
            }
            readout += 1;
        }
        put(&rows)?;
        progress(readout as u64)
    })?;
    let done = writer.finish()?;
    Ok(StreamSummary {
        path: done.path,
        bytes: done.bytes,
        digest: digest.to_text(),
        spikes: count,
        sync_time: done.sync_time,
    })
}
