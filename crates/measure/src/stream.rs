//! A stored stream, measured on all threads.

use super::block::Block;
use super::{Accumulator, MeasureOptions, Statistics};
use spikelane::error::Result;
use spikelane::spikes::{Geometry, Packed};
use spikelane::unstable::inputs;
use spikelane::unstable::threads;
use spikelane_io::formats::Reader;

/// Readouts read at a time: two turns of an accumulator's counters, a quarter of what it buffers at most.
const BATCH: usize = 496;

/// Statistics of a whole stream, bands of rows side by side.
///
/// `tell` hears how many readouts are done. Memory does not grow with the length of the stream.
///
/// # Errors
/// When the stream cannot be read, or is too long.
pub fn of_stream(
    reader: &Reader,
    options: &MeasureOptions,
    tell: &mut dyn FnMut(usize),
) -> Result<Statistics> {
    let geometry = reader.geometry();
    let mut accumulators = bands(geometry, options)?;
    let mut buffer = inputs::zeroed(reader.name(), BATCH.min(reader.readouts()) * geometry.frame_bytes())?;
    let mut at = 0;
    while at < reader.readouts() {
        let now = BATCH.min(reader.readouts() - at);
        let bytes = &mut buffer[..now * geometry.frame_bytes()];
        reader.read_frames(at, bytes)?;
        let packed = Packed::new(geometry, bytes)?;
        threads::try_map(&mut accumulators, |a| a.push(packed))?;
        at += now;
        tell(at);
    }
    joined(accumulators)
}

/// Accumulators of bands of rows, and one of whole readouts where these are asked for.
pub(super) fn bands(geometry: Geometry, options: &MeasureOptions) -> Result<Vec<Accumulator>> {
    let bands = (2 * threads::count()).clamp(1, geometry.height());
    // Small sensors are not worth the threads' time.
    let bands = bands.min((geometry.pixels() / 2048).max(1));
    let rows = |i: usize| i * geometry.height() / bands..(i + 1) * geometry.height() / bands;
    let band = |i| {
        let rows = Some(rows(i));
        Accumulator::new(geometry, &MeasureOptions { rows, frames: false, ..options.clone() })
    };
    check_memory(geometry, options, bands)?;
    let mut all = (0..bands).map(band).collect::<Result<Vec<_>>>()?;
    if options.frames {
        let whole = MeasureOptions { counts: false, intervals: false, rows: None, ..options.clone() };
        all.push(Accumulator::new(geometry, &whole)?);
    }
    Ok(all)
}

/// Checks that there is memory for what is kept of all pixels, for the maps that are made of it, and for the readouts that
/// `bands` bands of rows buffer.
fn check_memory(geometry: Geometry, options: &MeasureOptions, bands: usize) -> Result<()> {
    /// Copies of the sums: the whole, a half and a quarter of the recording, and a map that is joined from bands.
    const COPIES: usize = 4;
    /// Maps of `f64` that are held at a time.
    const MAPS: usize = 24;
    let [history, sums] = Accumulator::bytes_per_pixel(geometry, options)?;
    let of_pixels = (history + COPIES * sums + MAPS * size_of::<f64>()) * geometry.pixels();
    let buffers = bands * Block::bytes(geometry, geometry.height().div_ceil(bands));
    inputs::check_memory(format_args!("statistics of {geometry} pixels"), of_pixels + buffers)
}

/// The statistics of such bands. A block that is not full is still to be measured, so that bands end side by side as well.
pub(super) fn joined(accumulators: Vec<Accumulator>) -> Result<Statistics> {
    Statistics::join(threads::map(accumulators, Accumulator::finish))
}
