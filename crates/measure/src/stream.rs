//! Measures a stored stream with all threads.

use super::block::Block;
use super::{Accumulator, Intervals, LightClock, MeasureOptions, Statistics};
use std::sync::Arc;

use spikelane::error::{Error, ErrorKind, Result};
use spikelane::spikes::{Geometry, SpikeFramesRef};
use spikelane::unstable::inputs;
use spikelane::unstable::threads;
use spikelane_io::formats::StreamReader;

/// Number of readouts per read. It equals two counter periods of an accumulator and is at most a quarter of its buffer.
const BATCH_READOUTS: usize = 496;

/// Measures a whole stream in parallel bands of rows.
///
/// Calls `report_readouts` with the number of readouts measured so far. Memory does not grow with the length of the
/// stream.
///
/// # Examples
/// ```
/// use spikelane_io::formats::StreamReader;
/// use spikelane_measure::{MeasureOptions, measure_stream};
/// let geometry = spikelane::Geometry::new(8, 2)?;
/// let reader = StreamReader::from_bytes("mine", [0xff, 0xff, 0, 0].repeat(50), None, Some(geometry))?;
/// let statistics = measure_stream(&reader, &MeasureOptions::without_intervals(), &mut |_| {})?;
/// let counts = statistics.counts.expect("the options select counts");
/// assert!(counts.rate().iter().all(|rate| *rate == 0.5));
/// # Ok::<(), spikelane::Error>(())
/// ```
///
/// # Errors
/// Returns an error if the stream cannot be read, or if the stream is longer than an [`Accumulator`] accepts.
pub fn measure_stream(
    reader: &StreamReader,
    options: &MeasureOptions,
    report_readouts: &mut dyn FnMut(usize),
) -> Result<Statistics> {
    let mut accumulators = band_accumulators(reader.geometry(), options)?;
    push_all(reader, &mut accumulators, report_readouts)?;
    join_accumulators(accumulators)
}

/// Measures the intervals of a whole stream by integrated light, in parallel bands of rows.
///
/// Spike times, and therefore all results, are in ticks of `clock` instead of readouts. The result contains no histogram and no
/// counts of short and long intervals.
///
/// # Examples
/// ```
/// use spikelane_io::formats::StreamReader;
/// use spikelane_measure::{LightClock, measure_intervals_by_light};
/// // The light of the first four readouts is half of the light of the last four. The mean of the changes is 0.
/// let changes = [-1.0 / 3.0, -1.0 / 3.0, -1.0 / 3.0, -1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0];
/// let geometry = spikelane::Geometry::new(8, 1)?;
/// // All pixels fire at readout 3, at readout 5 and at readout 7.
/// let bytes = vec![0, 0, 0, 0xff, 0, 0xff, 0, 0xff];
/// let reader = StreamReader::from_bytes("mine", bytes, None, Some(geometry))?;
/// let clock = LightClock::new(&changes, vec![1.0; 8])?;
/// let intervals = measure_intervals_by_light(&reader, &[1], &clock, &mut |_| {})?;
/// // From the middle of readout 3 to the middle of readout 5: half of 2/3, then 4/3, then half of 4/3.
/// let shortest = intervals.pixel(0).extremes.map_or(0.0, |e| f64::from(e.0) / clock.ticks());
/// assert!((shortest - 7.0 / 3.0).abs() <= 1.0 / clock.ticks());
/// # Ok::<(), spikelane::Error>(())
/// ```
///
/// # Errors
/// Those of [`measure_stream`], and an error if the clock has another number of readouts or pixels than the stream.
pub fn measure_intervals_by_light(
    reader: &StreamReader,
    lags: &[u32],
    clock: &LightClock,
    report_readouts: &mut dyn FnMut(usize),
) -> Result<Intervals> {
    if (clock.readouts(), clock.pixels()) != (reader.readouts(), reader.geometry().pixels()) {
        return Err(Error::new(ErrorKind::Usage, "light clock")
            .found(format_args!("{} readouts of {} pixels", clock.readouts(), clock.pixels()))
            .expected(format_args!(
                "{} readouts of {} pixels",
                reader.readouts(),
                reader.geometry().pixels()
            )));
    }
    let options =
        MeasureOptions { counts: false, frames: false, lags: lags.to_vec(), ..MeasureOptions::default() };
    let clock = Arc::new(clock.clone());
    let accumulators = band_accumulators(reader.geometry(), &options)?;
    let mut accumulators: Vec<Accumulator> = accumulators.into_iter().map(|a| a.with_clock(&clock)).collect();
    push_all(reader, &mut accumulators, report_readouts)?;
    let Some(intervals) = join_accumulators(accumulators)?.intervals else {
        unreachable!("intervals are measured")
    };
    Ok(intervals)
}

/// Adds all readouts of a stream to each accumulator.
fn push_all(
    reader: &StreamReader,
    accumulators: &mut [Accumulator],
    report_readouts: &mut dyn FnMut(usize),
) -> Result<()> {
    let geometry = reader.geometry();
    let mut buffer =
        inputs::zeroed_vec(reader.name(), BATCH_READOUTS.min(reader.readouts()) * geometry.frame_bytes())?;
    let mut at = 0;
    while at < reader.readouts() {
        let now = BATCH_READOUTS.min(reader.readouts() - at);
        let bytes = &mut buffer[..now * geometry.frame_bytes()];
        reader.read_frames(at, bytes)?;
        let packed = SpikeFramesRef::new(geometry, bytes)?;
        threads::try_map(&mut *accumulators, |a| a.push(packed))?;
        at += now;
        report_readouts(at);
    }
    Ok(())
}

/// Returns one accumulator per band of rows. If `options` include frame statistics, one more accumulator measures whole
/// readouts.
pub(super) fn band_accumulators(geometry: Geometry, options: &MeasureOptions) -> Result<Vec<Accumulator>> {
    let bands = (2 * threads::thread_count()).clamp(1, geometry.height());
    // With fewer than about 2048 pixels per band, the overhead of a thread exceeds the saving.
    let bands = bands.min((geometry.pixels() / 2048).max(1));
    let rows = |i: usize| i * geometry.height() / bands..(i + 1) * geometry.height() / bands;
    let band = |i| {
        let rows = Some(rows(i));
        Accumulator::new(geometry, &MeasureOptions { rows, frames: false, ..options.clone() })
    };
    check_memory(geometry, options, bands)?;
    let mut all = (0..bands).map(band).collect::<Result<Vec<_>>>()?;
    if options.frames {
        let frame_options = MeasureOptions { counts: false, intervals: false, rows: None, ..options.clone() };
        all.push(Accumulator::new(geometry, &frame_options)?);
    }
    Ok(all)
}

/// Checks that the memory is sufficient. The required memory contains the sums of all pixels, the maps computed from
/// the sums, and the buffers of `bands` bands of rows.
fn check_memory(geometry: Geometry, options: &MeasureOptions, bands: usize) -> Result<()> {
    /// Copies of the sums that exist at the same time: whole recording, half, quarter, and a map joined from bands.
    const MAX_SUM_COPIES: usize = 4;
    /// Number of `f64` maps that exist at the same time.
    const MAX_MAPS: usize = 24;
    let [history, sums] = Accumulator::bytes_per_pixel(geometry, options)?;
    let of_pixels = (history + MAX_SUM_COPIES * sums + MAX_MAPS * size_of::<f64>()) * geometry.pixels();
    let buffers = bands * Block::bytes(geometry, geometry.height().div_ceil(bands));
    inputs::check_memory(format_args!("statistics of {geometry} pixels"), of_pixels + buffers)
}

/// Finishes the accumulators and joins their statistics. Finishing runs in parallel, because it measures the blocks that
/// are partly filled.
pub(super) fn join_accumulators(accumulators: Vec<Accumulator>) -> Result<Statistics> {
    Statistics::join(threads::map(accumulators, Accumulator::finish))
}
