//! Spikes as a list: one row (x, y, t) for each, as an `.npy` array.

use std::ops::Range;
use std::path::Path;

use crate::formats::convert::batches;
use crate::formats::{Crop, Finished, Reader};
use crate::storage::{Digest, Writer};
use spikelane::error::{Error, Kind, Result};
use spikelane::spikes::{self, firing_pixels};
use spikelane::unstable::npy::{self, Element};

/// Bytes of an event: three numbers of 32 bits.
const EVENT: u64 = 12;

/// The name in arguments and sidecars.
pub const EVENTS: &str = "events";

/// Writes the spikes of `readouts` of `reader`, cropped, as an array of shape (N, 3) of little-endian `i32`: column
/// and row of the pixel, from the upper left corner of the crop, and the readout, the first of the range being 0.
/// Events are sorted by readout, then row, then column. Returns the file and N.
///
/// The stream is read twice: once to count, so that the file has its length from the start.
///
/// # Errors
/// [`Kind::Usage`] when the range or the crop leave the stream, or a readout does not fit in 31 bits;
/// [`Kind::Exists`], [`Kind::Space`] and others as [`StreamWriter::create`](super::StreamWriter::create); those of the reader and of `progress`, which
/// hears how many readouts are written.
pub fn write_events(
    reader: &Reader,
    readouts: Range<usize>,
    crop: Option<Crop>,
    path: &Path,
    force: bool,
    mut progress: impl FnMut(u64) -> Result<()>,
) -> Result<(Finished, u64)> {
    let geometry = crop.map_or(Ok(reader.geometry()), |c| c.geometry(reader.geometry()))?;
    if i32::try_from(readouts.len()).is_err() {
        return Err(Error::new(Kind::Usage, "readouts")
            .found(readouts.len())
            .expected("at most 2147483647 in a list of events")
            .remedy("take a part of them with a range"));
    }
    let mut count = 0;
    batches(reader, readouts.clone(), crop, |packed| {
        count += spikes::count(packed);
        progress(0)
    })?;
    let header = npy::header(Element::I32, &[count, 3]);
    let mut writer = Writer::create(path, header.len() as u64 + EVENT * count, force)?;
    let mut digest = Digest::new();
    let mut put = |bytes: &[u8]| {
        digest.update(bytes);
        writer.write_all(bytes)
    };
    put(&header)?;
    let (width, mut readout, mut rows) = (geometry.width(), 0i32, Vec::new());
    batches(reader, readouts, crop, |packed| {
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
    let finished = Finished { path: done.path, bytes: done.bytes, digest: digest.text(), sync: done.sync };
    Ok((finished, count))
}
