//! Copies a range of readouts or a crop of a stream to another layout.

use std::ops::Range;
use std::sync::mpsc;

use crate::formats::layouts::copy_bits;
use crate::formats::{Codec, Layout, StreamReader, StreamSummary, StreamWriter};
use spikelane::error::{Result, bail};
use spikelane::spikes::{Crop, Geometry};
use spikelane::unstable::{Count, threads};

/// Number of bytes of packed frames in one batch.
const BATCH_BYTES: usize = 1 << 20;

/// Copies the rectangle `crop` of the packed frame `from` to the packed frame `to`. `from` has the size `geometry`.
fn crop_frame(crop: Crop, geometry: Geometry, from: &[u8], to: &mut [u8]) {
    to.fill(0);
    for row in 0..crop.height {
        let start = (crop.row + row) * geometry.width() + crop.col;
        copy_bits(to, row * crop.width, from, start, crop.width);
    }
}

/// Copies the frames of `readouts` from `reader` to `writer`, then finishes `writer`. If `crop` is given, only this
/// rectangle of each frame is copied. Memory use does not depend on the length of the stream.
///
/// After each batch, `progress` receives the number of readouts written. If `progress` returns an error, the
/// conversion stops and the incomplete output is removed.
///
/// # Examples
/// ```
/// use spikelane::{Geometry, spikes::Crop};
/// use spikelane_io::formats::{Layout, StreamReader, StreamWriter, convert};
/// # let folder = tempfile::tempdir().map_err(|e| spikelane::Error::io("a folder", e))?;
/// # let path = folder.path().join("part.npy");
/// // Three readouts of 8x2 pixels. The right half of the readouts 1 and 2 becomes an array of bytes.
/// let reader = StreamReader::from_bytes("mine", vec![0, 0, 0xf0, 0, 0, 0], None, Some(Geometry::new(8, 2)?))?;
/// let crop = Crop { row: 0, col: 4, width: 4, height: 2 };
/// let writer = StreamWriter::create(&path, Layout::NpyBytes, Geometry::new(4, 2)?, 2, false)?;
/// assert_eq!(convert(&reader, 1..3, Some(crop), writer, |_| Ok(()))?.spikes, 4);
/// assert_eq!(StreamReader::open(&path, None, None)?.readouts(), 2);
/// # Ok::<(), spikelane::Error>(())
/// ```
///
/// # Errors
/// * [`ErrorKind::Usage`](spikelane::ErrorKind::Usage) if the range or the crop exceeds the stream of `reader`.
/// * [`ErrorKind::Usage`](spikelane::ErrorKind::Usage) if `writer` expects another geometry or number of readouts than the copied frames have.
/// * Errors of the reader, the writer and `progress`.
pub fn convert(
    reader: &StreamReader,
    readouts: Range<usize>,
    crop: Option<Crop>,
    mut writer: StreamWriter,
    mut progress: impl FnMut(u64) -> Result<()>,
) -> Result<StreamSummary> {
    let from = reader.geometry();
    let to = crop.map_or(Ok(from), |c| c.geometry(from))?;
    // A range beyond the end of the stream must fail before any frame is read.
    reader.frames(readouts.clone())?;
    if writer.geometry() != to || writer.readouts() != readouts.len() as u64 {
        bail!(Usage, "output stream";
            found "{} of {}", Count(writer.readouts(), "readout"), writer.geometry();
            expected "{} of {to}", Count(readouts.len(), "readout"));
    }
    for_each_batch(reader, readouts, crop, |packed| {
        writer.write_frames(writer.written(), packed)?;
        progress(writer.written())
    })?;
    writer.finish()
}

/// Writes the frames of `readouts`, reduced to `crop`, from `reader` in `layout` to `output`, header included. This
/// function is for outputs that are not files, such as standard output.
///
/// `output` receives consecutive parts of the stream.
///
/// # Errors
/// * [`ErrorKind::Usage`](spikelane::ErrorKind::Usage) if the range is empty, if the range or the crop exceeds the stream, or if the layout does not
///   support the geometry.
/// * Errors of the reader and of `output`.
pub fn convert_to(
    reader: &StreamReader,
    readouts: Range<usize>,
    crop: Option<Crop>,
    layout: Layout,
    mut output: impl FnMut(&[u8]) -> Result<()>,
) -> Result<()> {
    let geometry = crop.map_or(Ok(reader.geometry()), |c| c.geometry(reader.geometry()))?;
    let codec = Codec::new(layout, geometry)?;
    // A range beyond the end of the stream must fail before the header is written.
    reader.frames(readouts.clone())?;
    output(&layout.header(geometry, readouts.len() as u64)?)?;
    let mut encoded = Vec::new();
    for_each_batch(reader, readouts, crop, |packed| {
        encoded.resize(packed.len() / geometry.frame_bytes() * codec.frame_bytes(), 0);
        codec.encode(packed, &mut encoded)?;
        output(&encoded)
    })
}

/// Passes the packed frames of `readouts` to `take` in batches of about 1 MiB. If `crop` is given, the frames contain
/// only this rectangle. While `take` processes a batch, a second thread reads the next batch.
///
/// # Errors
/// * [`ErrorKind::Usage`](spikelane::ErrorKind::Usage) if the range or the crop exceeds the stream.
/// * Errors of the reader and of `take`.
pub(super) fn for_each_batch(
    reader: &StreamReader,
    readouts: Range<usize>,
    crop: Option<Crop>,
    mut take: impl FnMut(&[u8]) -> Result<()>,
) -> Result<()> {
    let to = crop.map_or(Ok(reader.geometry()), |c| c.geometry(reader.geometry()))?;
    // A range beyond the end of the stream must fail before any frame is read.
    reader.frames(readouts.clone())?;
    let step = (BATCH_BYTES / reader.geometry().frame_bytes().max(to.frame_bytes())).max(1);
    let mut full_frames = Vec::new();
    let (first, end) = (readouts.clone().step_by(step), readouts.end);
    let read = move |first: usize, frames: &mut Vec<u8>| {
        read(reader, first..end.min(first + step), crop.map(|c| (c, to)), &mut full_frames, frames)
    };
    std::thread::scope(|scope| {
        let (full, next) = mpsc::sync_channel(1);
        // Used buffers return to the reading thread, so the reading thread does not allocate a buffer for every batch.
        let (empty, again) = mpsc::channel::<Vec<u8>>();
        let batches = first.clone();
        let ahead = threads::spawn_scoped(scope, "read", (read, full), move |(mut read, full)| {
            for first in batches {
                let mut frames = again.try_recv().unwrap_or_default();
                let read = read(first, &mut frames);
                // If `take` failed, the receiver is dropped and `send` returns an error.
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

/// Reads the packed frames of `readouts` into `frames`. If `crop` is given, the whole frames are read into
/// `full_frames`, and only the crop is copied to `frames`.
fn read(
    reader: &StreamReader,
    readouts: Range<usize>,
    crop: Option<(Crop, Geometry)>,
    full_frames: &mut Vec<u8>,
    frames: &mut Vec<u8>,
) -> Result<()> {
    let (geometry, size) = (reader.geometry(), reader.geometry().frame_bytes());
    let all = if crop.is_some() { &mut *full_frames } else { &mut *frames };
    all.resize(readouts.len() * size, 0);
    reader.read_frames(readouts.start, all)?;
    if let Some((crop, to)) = crop {
        frames.resize(readouts.len() * to.frame_bytes(), 0);
        let pairs = full_frames.chunks_exact(size).zip(frames.chunks_exact_mut(to.frame_bytes()));
        pairs.for_each(|(a, b)| crop_frame(crop, geometry, a, b));
    }
    Ok(())
}
