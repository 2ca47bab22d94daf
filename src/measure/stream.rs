//! A stored stream, measured on all threads.

use rayon::prelude::*;

use super::{Accumulator, MeasureOptions, Statistics};
use crate::error::Result;
use crate::formats::Reader;
use crate::spikes::Packed;

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
    let bands = (2 * rayon::current_num_threads()).clamp(1, geometry.height());
    let rows = |i: usize| i * geometry.height() / bands..(i + 1) * geometry.height() / bands;
    let band = |i| {
        Accumulator::new(geometry, &MeasureOptions { rows: Some(rows(i)), frames: false, ..options.clone() })
    };
    let mut accumulators = (0..bands).map(band).collect::<Result<Vec<_>>>()?;
    if options.frames {
        let whole = MeasureOptions { counts: false, intervals: false, rows: None, ..options.clone() };
        accumulators.push(Accumulator::new(geometry, &whole)?);
    }
    let mut buffer = vec![0; BATCH * geometry.frame_bytes()];
    let mut at = 0;
    while at < reader.readouts() {
        let now = BATCH.min(reader.readouts() - at);
        let bytes = &mut buffer[..now * geometry.frame_bytes()];
        reader.read_frames(at, bytes)?;
        let packed = Packed::new(geometry, bytes)?;
        accumulators.par_iter_mut().try_for_each(|a| a.push(packed))?;
        reader.release(at..at + now);
        at += now;
        tell(at);
    }
    Statistics::join(accumulators.into_iter().map(Accumulator::finish).collect())
}
