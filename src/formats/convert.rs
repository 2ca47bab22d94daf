//! From one file into another: layout, range of readouts, crop.

use std::ops::Range;

use crate::error::{Error, Kind, Result};
use crate::formats::layouts::copy_bits;
use crate::formats::{Finished, Reader, StreamWriter};
use crate::spikes::{Crop, Geometry};

/// Bytes of packed frames in hand at a time.
const BATCH: usize = 4 << 20;

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

/// Hands the packed frames of `readouts`, cropped, to `take`, some megabytes at a time.
///
/// # Errors
/// [`Kind::Usage`] when the range or the crop leave the stream; otherwise those of the reader and of `take`.
pub(super) fn batches(
    reader: &Reader,
    readouts: Range<usize>,
    crop: Option<Crop>,
    mut take: impl FnMut(&[u8]) -> Result<()>,
) -> Result<()> {
    let from = reader.geometry();
    let to = crop.map_or(Ok(from), |c| c.geometry(from))?;
    // Refuses a range beyond the end before anything is read.
    reader.frames(readouts.clone())?;
    let (size, cut_size) = (from.frame_bytes(), to.frame_bytes());
    let step = (BATCH / size).max(1).min(readouts.len().max(1));
    let mut packed = vec![0; step * size];
    let mut cut_out = crop.map(|_| vec![0; step * cut_size]).unwrap_or_default();
    for first in readouts.clone().step_by(step) {
        let frames = step.min(readouts.end - first);
        let packed = &mut packed[..frames * size];
        reader.read_frames(first, packed)?;
        reader.release(first..first + frames);
        let out = match crop {
            None => &*packed,
            Some(crop) => {
                let out = &mut cut_out[..frames * cut_size];
                let pairs = packed.chunks_exact(size).zip(out.chunks_exact_mut(cut_size));
                pairs.for_each(|(a, b)| cut(crop, from, a, b));
                &*out
            }
        };
        take(out)?;
    }
    Ok(())
}
