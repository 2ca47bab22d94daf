//! A stored stream, measured on all threads.

use super::{Accumulator, MeasureOptions, Statistics};
use crate::error::Result;
use crate::formats::Reader;
use crate::inputs;
use crate::spikes::{Geometry, Packed};
use crate::threads;

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
    let mut all = (0..bands).map(band).collect::<Result<Vec<_>>>()?;
    if options.frames {
        let whole = MeasureOptions { counts: false, intervals: false, rows: None, ..options.clone() };
        all.push(Accumulator::new(geometry, &whole)?);
    }
    Ok(all)
}

/// The statistics of such bands. A block that is not full is still to be measured, so that bands end side by side as well.
pub(super) fn joined(accumulators: Vec<Accumulator>) -> Result<Statistics> {
    Statistics::join(threads::map(accumulators, Accumulator::finish))
}
