//! Statistics of single pixels and of rectangles.

use std::ops::Range;

use serde_json::{Value, json};
use spikelane::error::{Result, bail};
use spikelane::spikes::{Crop, SpikeFrames, count_spikes};
use spikelane::unstable::Count;
use spikelane::unstable::threads::check_stop;
use spikelane_io::formats::{Layout, StreamReader, convert_to};
use spikelane_measure::{Accumulator, MeasureOptions, spectrum, total_variation};

/// Largest part of a file that one immediate request reads.
pub(crate) const MAX_REQUEST_BYTES: usize = 256 << 20;

/// Largest number of readouts of a series. A series needs four bytes per readout.
const MAX_SERIES_READOUTS: usize = 1 << 26;

/// Largest number of points of a curve that the page receives.
const MAX_CURVE_POINTS: usize = 1000;

/// Largest segment of a spectrum in readouts.
const MAX_SEGMENT_READOUTS: usize = 8192;

/// Smallest prominence of a spectral line, as for the frame totals of `spikelane-measure`.
const LINE_POWER_RATIO: f64 = 30.0;

/// Longest interval that the histogram counts separately, in readouts.
const LONGEST_BIN: u32 = 1023;

/// Number of readouts per read.
const BATCH_READOUTS: usize = 496;

/// Checks that a request reads at most [`MAX_REQUEST_BYTES`].
pub(crate) fn check_request(reader: &StreamReader, readouts: &Range<usize>) -> Result<()> {
    let limit = (MAX_REQUEST_BYTES / reader.geometry().frame_bytes()).max(1);
    if readouts.len() > limit {
        bail!(Usage, "readouts"; found "{}", Count(readouts.len(), "readout");
            expected "at most {limit} for this size of image");
    }
    Ok(())
}

/// Reads a rectangle of a range of readouts.
fn cropped(reader: &StreamReader, readouts: Range<usize>, crop: Crop) -> Result<SpikeFrames> {
    let mut bytes = Vec::new();
    convert_to(reader, readouts, Some(crop), Layout::DatTop, |part| {
        bytes.extend_from_slice(part);
        Ok(())
    })?;
    SpikeFrames::new(crop.geometry(reader.geometry())?, bytes)
}

/// Returns the spike times of pixel (`x`, `y`), and the interval histograms of the pixel and its neighbors.
pub(crate) fn pixel(reader: &StreamReader, x: usize, y: usize, readouts: Range<usize>) -> Result<Value> {
    check_request(reader, &readouts)?;
    let full = reader.geometry();
    Crop { row: y, col: x, width: 1, height: 1 }.geometry(full)?;
    let (col, row) = (x.saturating_sub(1), y.saturating_sub(1));
    let crop =
        Crop { row, col, width: (x + 2).min(full.width()) - col, height: (y + 2).min(full.height()) - row };
    let frames = cropped(reader, readouts.clone(), crop)?;
    let mut times = vec![Vec::new(); crop.width * crop.height];
    for spike in frames.iter_spikes() {
        times[spike.row * crop.width + spike.col].push(spike.readout);
    }
    let histogram = |times: &[usize]| {
        let mut counts = std::collections::BTreeMap::<usize, u32>::new();
        for pair in times.windows(2) {
            *counts.entry(pair[1] - pair[0]).or_default() += 1;
        }
        counts.into_iter().map(|(length, n)| [length, n as usize]).collect::<Vec<_>>()
    };
    let pixels = times.iter().enumerate().map(|(i, times)| {
        json!({
            "x": crop.col + i % crop.width, "y": crop.row + i / crop.width,
            "spikes": times.len(), "intervals": histogram(times),
        })
    });
    let own = &times[(y - row) * crop.width + (x - col)];
    let own: Vec<usize> = own.iter().map(|t| t + readouts.start).collect();
    Ok(json!({
        "x": x, "y": y, "from": readouts.start, "to": readouts.end, "times": own,
        "pixels": pixels.collect::<Vec<_>>(),
    }))
}

/// Returns the mean rate of a rectangle over time, and its spectrum. `progress` receives the number of readouts read.
pub(crate) fn rate_over_time(
    reader: &StreamReader,
    crop: Crop,
    readouts: Range<usize>,
    progress: &dyn Fn(usize),
) -> Result<Value> {
    if readouts.len() > MAX_SERIES_READOUTS {
        bail!(Usage, "readouts of a region"; found "{}", Count(readouts.len(), "readout");
            expected "at most {MAX_SERIES_READOUTS}"; remedy "choose a shorter range");
    }
    let pixels = crop.geometry(reader.geometry())?.pixels();
    let mut totals = Vec::with_capacity(readouts.len());
    let mut pixel_counts = vec![0_u32; pixels];
    let mut at = readouts.start;
    while at < readouts.end {
        check_stop();
        let end = readouts.end.min(at + BATCH_READOUTS);
        for frame in &cropped(reader, at..end, crop)? {
            totals.push(count_spikes(frame.as_bytes()) as u32);
            frame.firing_pixels().for_each(|p| pixel_counts[p] += 1);
        }
        at = end;
        progress(at - readouts.start);
    }
    let bin = totals.len().div_ceil(MAX_CURVE_POINTS);
    let mean = |part: &[u32]| part.iter().map(|n| f64::from(*n)).sum::<f64>() / (part.len() * pixels) as f64;
    let rates: Vec<f64> = totals.chunks(bin).map(mean).collect();
    let segment = (totals.len() / 4).min(MAX_SEGMENT_READOUTS) & !1;
    let spectrum_json = if segment < 64 {
        Value::Null
    } else {
        let spectrum = spectrum(&totals, segment)?;
        let resolution = 1.0 / segment as f64;
        let pixel_rates: Vec<f64> =
            pixel_counts.iter().map(|n| f64::from(*n) / totals.len() as f64).collect();
        // The window spreads a drift of the light over the lowest bins.
        let is_line = |l: &&spikelane_measure::SpectralLine| {
            l.frequency * segment as f64 > 3.5 && l.prominence.is_finite() && l.power > 0.0
        };
        let lines = spectrum.lines(LINE_POWER_RATIO);
        let lines = lines.iter().filter(is_line).take(5).map(|l| {
            json!({
                "frequency": l.frequency, "prominence": l.prominence,
                "harmonic": l.harmonic_of(&pixel_rates, resolution),
            })
        });
        json!({
            "segment": segment, "power": spectrum.power, "lines": lines.collect::<Vec<_>>(),
        })
    };
    Ok(json!({
        "from": readouts.start, "to": readouts.end, "bin": bin, "rates": rates, "mean_rate": mean(&totals),
        "pixels": pixels, "spectrum": spectrum_json,
    }))
}

/// The intervals of a rectangle.
struct IntervalShares {
    total: u64,
    /// Share of the intervals of each length.
    shares: Vec<f64>,
}

impl IntervalShares {
    fn measure(reader: &StreamReader, crop: Crop, readouts: Range<usize>) -> Result<Self> {
        let geometry = crop.geometry(reader.geometry())?;
        let options = MeasureOptions {
            counts: false,
            frames: false,
            longest_bin: LONGEST_BIN,
            ..MeasureOptions::default()
        };
        let mut accumulator = Accumulator::new(geometry, &options)?;
        for start in readouts.clone().step_by(BATCH_READOUTS) {
            let end = readouts.end.min(start + BATCH_READOUTS);
            accumulator.push(cropped(reader, start..end, crop)?.view())?;
        }
        let intervals = accumulator.finish().intervals;
        let histogram = intervals.as_ref().map(|intervals| intervals.histogram());
        Ok(Self {
            total: histogram.map_or(0, |histogram| histogram.counts().iter().sum()),
            shares: histogram.map_or_else(Vec::new, |histogram| histogram.shares()),
        })
    }
}

/// Smallest mean change in readouts that turns the intervals of `a` into the intervals of `b`. It equals the sum of the
/// absolute differences of the cumulative shares.
fn earth_mover(a: &[f64], b: &[f64]) -> f64 {
    let mut difference = 0.0;
    a.iter()
        .zip(b)
        .map(|(a, b)| {
            difference += a - b;
            difference.abs()
        })
        .sum()
}

/// Returns the interval distributions of a rectangle of two streams, and their distances. Intervals above 1023 readouts
/// count as 1024.
pub(crate) fn interval_distances(
    streams: [&StreamReader; 2],
    crop: Crop,
    readouts: [Range<usize>; 2],
) -> Result<Value> {
    let mut measured = Vec::new();
    for (reader, range) in streams.iter().zip(&readouts) {
        check_request(reader, range)?;
        measured.push(IntervalShares::measure(reader, crop, range.clone())?);
    }
    // The distance between the two halves of a stream is the distance that noise causes.
    let half = readouts[0].start + readouts[0].len() / 2;
    let halves = [readouts[0].start..half, half..readouts[0].end];
    let mut half_shares = Vec::new();
    for range in halves {
        half_shares.push(IntervalShares::measure(streams[0], crop, range)?.shares);
    }
    let [a, b] = [0, 1].map(|i| &measured[i].shares);
    let listed = |shares: &[f64]| {
        let longest = shares.iter().rposition(|s| *s > 0.0).map_or(0, |i| i + 1);
        shares[..longest].to_vec()
    };
    let mean_and_variance = |shares: &[f64]| {
        let mean: f64 = shares.iter().enumerate().map(|(n, s)| n as f64 * s).sum();
        let variance: f64 = shares.iter().enumerate().map(|(n, s)| (n as f64 - mean).powi(2) * s).sum();
        [mean, variance]
    };
    Ok(json!({
        "shares": [listed(a), listed(b)], "intervals": [measured[0].total, measured[1].total],
        "mean_and_variance": [mean_and_variance(a), mean_and_variance(b)],
        "total_variation": total_variation(a, b), "earth_mover": earth_mover(a, b),
        "total_variation_floor": total_variation(&half_shares[0], &half_shares[1]),
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use spikelane::Geometry;

    fn reader(bytes: Vec<u8>) -> StreamReader {
        StreamReader::from_bytes("test", bytes, Some(Layout::DatTop), Some(Geometry::new(8, 2).unwrap()))
            .unwrap()
    }

    #[test]
    fn a_pixel_has_its_spike_times_and_the_intervals_of_its_neighbors() {
        // Pixel (1, 1) fires at readouts 0, 2 and 5, and pixel (0, 0) at every readout.
        let bytes = [1, 2, 1, 0, 1, 2, 1, 0, 1, 0, 1, 2].to_vec();
        let value = pixel(&reader(bytes), 1, 1, 0..6).unwrap();
        assert_eq!(value["times"], json!([0, 2, 5]));
        assert_eq!(value["pixels"].as_array().unwrap().len(), 6);
        assert_eq!(value["pixels"][0], json!({"x": 0, "y": 0, "spikes": 6, "intervals": [[1, 5]]}));
        assert_eq!(value["pixels"][4]["intervals"], json!([[2, 1], [3, 1]]));
        assert!(pixel(&reader(vec![0; 4]), 8, 0, 0..2).is_err());
    }

    #[test]
    fn the_rate_of_a_rectangle_counts_only_its_bits() {
        // 512 readouts with a period of 8: four readouts with two spikes in the rectangle, four with none.
        let frames = |i: usize| if i % 8 < 4 { [0b0001_1110, 0xff] } else { [0b0000_0010, 0xff] };
        let bytes = (0..512).flat_map(frames).collect();
        let crop = Crop { row: 0, col: 3, width: 2, height: 1 };
        let value = rate_over_time(&reader(bytes), crop, 0..512, &|_| {}).unwrap();
        assert_eq!(value["mean_rate"], 0.5);
        assert_eq!(value["rates"][3], 1.0);
        assert_eq!(value["spectrum"]["lines"][0]["frequency"], 0.125);
    }

    #[test]
    fn equal_streams_have_no_distance_and_a_constant_shift_has_its_length() {
        // Every pixel fires every second readout, or every third.
        let every = |n: usize| reader((0..600).flat_map(|i| [if i % n == 0 { 255 } else { 0 }; 2]).collect());
        let crop = Crop { row: 0, col: 0, width: 8, height: 2 };
        let between = |a, b| interval_distances([&every(a), &every(b)], crop, [0..600, 0..600]).unwrap();
        assert_eq!(between(2, 2)["total_variation"], 0.0);
        assert_eq!(between(2, 3)["total_variation"], 1.0);
        assert_eq!(between(2, 3)["earth_mover"], 1.0);
    }
}
