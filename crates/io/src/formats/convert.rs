//! From one file into another: layout, range of readouts, crop.

use std::ops::Range;
use std::sync::mpsc;

use crate::formats::layouts::copy_bits;
use crate::formats::{Finished, Reader, StreamWriter};
use spikelane::error::{Error, Kind, Result};
use spikelane::spikes::{Crop, Geometry};
use spikelane::unstable::threads;

/// Bytes of packed frames in hand at a time.
const BATCH: usize = 1 << 20;

/// Cuts the rectangle out of one packed frame of geometry `of`.
fn cut(crop: Crop, of: Geometry, from: &[u8], to: &mut [u8]) {
    to.fill(0);
    for row in 0..crop.height {
        let start = (crop.y + row) * of.width() + crop.x;
        copy_bits(to, row * crop.width, from, start, crop.width);
    }
}

/// Writes `readouts` of `reader`, cropped, into `writer` and finishes it, in constant
/// memory. After each batch `progress` hears how many readouts are done; its error stops
/// the conversion, and nothing is left behind.
///
/// # Errors
/// [`Kind::Usage`] when the writer was made for another geometry or number of readouts, or
/// the range or the crop leave the stream; otherwise those of reader, writer and `progress`.
pub fn convert(
    reader: &Reader,
    readouts: Range<usize>,
    crop: Option<Crop>,
    mut writer: StreamWriter,
    mut progress: impl FnMut(u64) -> Result<()>,
) -> Result<Finished> {
    let from = reader.geometry();
    let to = crop.map_or(Ok(from), |c| c.geometry(from))?;
    // Also refuses a range beyond the end before anything is read.
    reader.frames(readouts.clone())?;
    if writer.geometry() != to || writer.readouts() != readouts.len() as u64 {
        return Err(Error::new(Kind::Usage, "output stream")
            .found(format_args!("{} readouts of {}", writer.readouts(), writer.geometry()))
            .expected(format_args!("{} readouts of {to}", readouts.len())));
    }
    batches(reader, readouts, crop, |packed| {
        writer.write_frames(writer.written(), packed)?;
        progress(writer.written())
    })?;
    writer.finish()
}

/// Hands the packed frames of `readouts`, cropped, to `take`, a megabyte at a time: the next are read meanwhile.
///
/// # Errors
/// [`Kind::Usage`] when the range or the crop leave the stream; otherwise those of the reader and of `take`.
pub(super) fn batches(
    reader: &Reader,
    readouts: Range<usize>,
    crop: Option<Crop>,
    mut take: impl FnMut(&[u8]) -> Result<()>,
) -> Result<()> {
    let to = crop.map_or(Ok(reader.geometry()), |c| c.geometry(reader.geometry()))?;
    // Refuses a range beyond the end before anything is read.
    reader.frames(readouts.clone())?;
    let step = (BATCH / reader.geometry().frame_bytes().max(to.frame_bytes())).max(1);
    let mut whole = Vec::new();
    let (first, end) = (readouts.clone().step_by(step), readouts.end);
    let read = move |first: usize, frames: &mut Vec<u8>| {
        read(reader, first..end.min(first + step), crop.map(|c| (c, to)), &mut whole, frames)
    };
    std::thread::scope(|scope| {
        let (full, next) = mpsc::sync_channel(1);
        // Memory goes round, so that none is asked for at each batch.
        let (empty, again) = mpsc::channel::<Vec<u8>>();
        let batches = first.clone();
        let ahead = threads::spawn_scoped(scope, "read", (read, full), move |(mut read, full)| {
            for first in batches {
                let mut frames = again.try_recv().unwrap_or_default();
                let read = read(first, &mut frames);
                // Nobody listens any more where `take` had an error.
                if full.send(read.map(|()| frames)).is_err() {
                    break;
                }
            }
        });
        if let Err((mut read, _)) = ahead {
            let mut frames = Vec::new();
            return first.into_iter().try_for_each(|first| {
                read(first, &mut frames)?;
                take(&frames)
            });
        }
        while let Ok(frames) = next.recv() {
            let frames = frames?;
            take(&frames)?;
            let _ = empty.send(frames);
        }
        Ok(())
    })
}

/// Reads `readouts` into `frames`, or into `whole` and from there what is cropped.
fn read(
    reader: &Reader,
    readouts: Range<usize>,
    crop: Option<(Crop, Geometry)>,
    whole: &mut Vec<u8>,
    frames: &mut Vec<u8>,
) -> Result<()> {
    let (of, size) = (reader.geometry(), reader.geometry().frame_bytes());
    let all = if crop.is_some() { &mut *whole } else { &mut *frames };
    all.resize(readouts.len() * size, 0);
    reader.read_frames(readouts.start, all)?;
    if let Some((crop, to)) = crop {
        frames.resize(readouts.len() * to.frame_bytes(), 0);
        let pairs = whole.chunks_exact(size).zip(frames.chunks_exact_mut(to.frame_bytes()));
        pairs.for_each(|(a, b)| cut(crop, of, a, b));
    }
    Ok(())
}
