//! Images as a table of rates and one index per pixel, which is shorter than one float per pixel.
//!
//! The encoding consists of little-endian numbers: bytes per index as u32, length of the table as u32, the table as f32,
//! and the indices. Without a table, the bytes per index and the length are 0, and the rates follow as f32.
//!
//! An index is a number of spikes or of readouts. The images equal those of [`Method::image`], but they need less memory
//! and no arithmetic with floats.

use std::borrow::Cow;
use std::ops::Range;

use spikelane::error::{Result, bail};
use spikelane::spikes::span_rate;
use spikelane::unstable::inputs;
use spikelane::unstable::kernels::{SearchOrder, SpikeTimes, Tally, first_spikes};
use spikelane::unstable::spikes::unpack_frame;
use spikelane::unstable::threads::join;
use spikelane_io::formats::StreamReader;

use crate::picture::Method;

/// Number of readouts on each side of the center that a TFI image reads first. Most pixels fire in these readouts.
const FIRST_SEARCH_READOUTS: usize = 32;

/// Bytes of a frame that a search continues or ends together. [`first_spikes`] also searches this number of bytes at once.
const TILE_BYTES: usize = 64;

/// Bytes per read. Larger reads exceed the caches of many CPUs.
const READ_BYTES: usize = 4 << 20;

/// Returns the image at readout `at`.
///
/// # Errors
/// [`ErrorKind::Usage`](spikelane::ErrorKind::Usage) if `at` is not a readout of the stream, and errors of the reader.
pub(crate) fn encoded_image(
    method: Method,
    reader: &StreamReader,
    at: usize,
    window: usize,
) -> Result<Vec<u8>> {
    if at >= reader.readouts() {
        bail!(Usage, "readout {at}"; expected "less than {}", reader.readouts());
    }
    let half = method.half_window(window);
    let (from, to) = (at.saturating_sub(half), (at + half + 1).min(reader.readouts()));
    match method {
        Method::Bits => {
            let mut packed = inputs::zeroed_vec("a readout", reader.geometry().frame_bytes())?;
            reader.read_frame(at, &mut packed)?;
            let mut bits = inputs::zeroed_vec("bits of a readout", reader.geometry().pixels())?;
            unpack_frame(&packed, &mut bits);
            Ok(encode(&[0.0, 1.0], bits.into_iter().map(u32::from)))
        }
        Method::Tfp => {
            let counts = spike_counts(reader, from..to)?;
            let table: Vec<f32> = (0..=to - from).map(|n| n as f32 / (to - from) as f32).collect();
            Ok(encode(&table, counts[..reader.geometry().pixels()].iter().copied()))
        }
        Method::Tfi => {
            let (before, after) = join(
                || search_spikes(reader, from..at + 1, SearchOrder::Backward),
                || search_spikes(reader, at + 1..to, SearchOrder::Forward),
            );
            // Index 0 means that the pixel has no interval.
            let missing = 1.0 / (2.0 * half as f32);
            let table: Vec<f32> =
                std::iter::once(missing).chain((1..=2 * half).map(|n| 1.0 / n as f32)).collect();
            let interval = |(before, after)| if before == 0 || after == 0 { 0 } else { before - 1 + after };
            Ok(encode(&table, before?.into_iter().zip(after?).map(interval)))
        }
        Method::Span if to - from <= MAX_SPAN_TABLE_READOUTS => encoded_span(reader, from..to),
        Method::Span => Ok(encode_rates(&method.image(reader, at, window)?)),
    }
}

/// Longest window whose span rates fit in a table with indices of two bytes.
const MAX_SPAN_TABLE_READOUTS: usize = 362;

const _: () = assert!(span_index(2, MAX_SPAN_TABLE_READOUTS as u32) <= 1 << 16);

/// Returns the index of the rate of a pixel in the table of [`encoded_span`]. The pixel has `spikes` spikes, the last of them
/// `span` readouts after the first.
///
/// Numbers of spikes below 2 come first, because they have no span. Then follow the numbers 2 to `span` + 1 for each span.
const fn span_index(spikes: u32, span: u32) -> u32 {
    if spikes < 2 { spikes } else { span * (span - 1) / 2 + spikes }
}

/// Returns the image of the rates between the first and the last spike in a window.
fn encoded_span(reader: &StreamReader, window: Range<usize>) -> Result<Vec<u8>> {
    let geometry = reader.geometry();
    let mut frames = inputs::zeroed_vec("readouts", window.len() * geometry.frame_bytes())?;
    reader.read_frames(window.start, &mut frames)?;
    let times = Tally::new(&frames, geometry.frame_bytes()).spike_times();
    let count = |spikes: u32| (f64::from(spikes) / window.len() as f64) as f32;
    let mut table = vec![count(0), count(1)];
    for span in 1..window.len() as u32 {
        table.extend((2..=span + 1).map(|n| span_rate(n, 0, span).map_or(count(n), |rate| rate as f32)));
    }
    let index = |t: &SpikeTimes| span_index(t.spikes, t.last - t.first);
    Ok(encode(&table, times[..geometry.pixels()].iter().map(index)))
}

/// Returns the number of readouts per read.
fn piece_readouts(reader: &StreamReader) -> usize {
    (READ_BYTES / reader.geometry().frame_bytes()).max(8)
}

/// Returns the spikes of every bit position of a frame in a range of readouts.
pub(crate) fn spike_counts(reader: &StreamReader, readouts: Range<usize>) -> Result<Vec<u32>> {
    let bytes = reader.geometry().frame_bytes();
    let piece = piece_readouts(reader).min(readouts.len());
    let mut frames = inputs::zeroed_vec("readouts", piece * bytes)?;
    let mut counts = inputs::zeroed_vec("numbers of spikes", 8 * bytes)?;
    for start in readouts.clone().step_by(piece) {
        let frames = &mut frames[..piece.min(readouts.end - start) * bytes];
        reader.read_frames(start, frames)?;
        Tally::new(frames, bytes).add(&mut counts);
    }
    Ok(counts)
}

/// Returns the number of the first readout with a spike for every pixel, counted from 1 in the order of the search. The
/// number is 0 if a pixel does not fire. Reads no further readouts after all pixels have a spike.
fn search_spikes(reader: &StreamReader, readouts: Range<usize>, order: SearchOrder) -> Result<Vec<u32>> {
    let (bytes, pixels) = (reader.geometry().frame_bytes(), reader.geometry().pixels());
    let largest = piece_readouts(reader).max(FIRST_SEARCH_READOUTS).min(readouts.len());
    let mut frames = inputs::zeroed_vec("readouts", largest * bytes)?;
    let mut numbers = inputs::zeroed_vec("numbers of readouts", pixels)?;
    // The tiles with pixels that have not fired yet. Often these are few after the first reads.
    let mut tiles: Vec<usize> = (0..bytes.div_ceil(TILE_BYTES)).collect();
    let (mut done, mut piece) = (0, FIRST_SEARCH_READOUTS.min(largest));
    while done < readouts.len() && !tiles.is_empty() {
        let count = piece.min(readouts.len() - done);
        let start = match order {
            SearchOrder::Forward => readouts.start + done,
            SearchOrder::Backward => readouts.end - done - count,
        };
        let frames = &mut frames[..count * bytes];
        reader.read_frames(start, frames)?;
        let bytes_of = |tile: usize| tile * TILE_BYTES..bytes.min((tile + 1) * TILE_BYTES);
        let pixels_of = |tile: usize| 8 * TILE_BYTES * tile..pixels.min(8 * TILE_BYTES * (tile + 1));
        let searched_bytes = tiles.iter().map(|t| bytes_of(*t).len()).sum();
        let searched_pixels = tiles.iter().map(|t| pixels_of(*t).len()).sum();
        let searched = match searched_bytes == bytes {
            true => Cow::Borrowed(&*frames),
            false => Cow::Owned(frames.chunks_exact(bytes).fold(Vec::new(), |mut all, frame| {
                tiles.iter().for_each(|t| all.extend_from_slice(&frame[bytes_of(*t)]));
                all
            })),
        };
        let found = first_spikes(&searched, searched_bytes, searched_pixels, order);
        let mut found_of_tiles = found.chunks(8 * TILE_BYTES);
        tiles.retain(|tile| {
            let found = found_of_tiles.next().unwrap_or_default();
            let mut has_silent_pixels = false;
            for (number, found) in numbers[pixels_of(*tile)].iter_mut().zip(found) {
                let later = if *found == 0 { 0 } else { found + done as u32 };
                *number = if *number == 0 { later } else { *number };
                has_silent_pixels |= *number == 0;
            }
            has_silent_pixels
        });
        done += count;
        piece = largest;
    }
    Ok(numbers)
}

/// Encodes indices of a table with at most 2^16 entries, so an index fits in two bytes.
fn encode(table: &[f32], indices: impl ExactSizeIterator<Item = u32>) -> Vec<u8> {
    let width = if table.len() <= 256 { 1 } else { 2 };
    let head = 8 + 4 * table.len();
    let mut bytes = Vec::with_capacity(head + width * indices.len());
    bytes.extend((width as u32).to_le_bytes());
    bytes.extend((table.len() as u32).to_le_bytes());
    bytes.extend(table.iter().flat_map(|rate| rate.to_le_bytes()));
    if width == 1 {
        bytes.extend(indices.map(|i| i as u8));
    } else {
        bytes.resize(head + width * indices.len(), 0);
        for (two, i) in bytes[head..].chunks_exact_mut(2).zip(indices) {
            two.copy_from_slice(&(i as u16).to_le_bytes());
        }
    }
    bytes
}

fn encode_rates(rates: &[f32]) -> Vec<u8> {
    let mut bytes = vec![0; 8 + 4 * rates.len()];
    for (four, rate) in bytes[8..].chunks_exact_mut(4).zip(rates) {
        four.copy_from_slice(&rate.to_le_bytes());
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;
    use spikelane::ErrorKind;

    fn decode(bytes: &[u8]) -> Vec<f32> {
        let word = |i: usize| u32::from_le_bytes(bytes[i..i + 4].try_into().unwrap());
        let float = |i: usize| f32::from_bits(word(i));
        let (width, length) = (word(0) as usize, word(4) as usize);
        if width == 0 {
            return (8..bytes.len()).step_by(4).map(float).collect();
        }
        let indices = bytes[8 + 4 * length..].chunks(width);
        indices.map(|b| float(8 + 4 * b.iter().rev().fold(0, |sum, b| sum << 8 | *b as usize))).collect()
    }

    /// Returns a stream of 900 readouts, in which pixel `p` fires with the period `1 + 13 p mod 97`, and every 50th pixel
    /// is silent.
    fn reader(width: u32, height: u32) -> StreamReader {
        let geometry = spikelane::Geometry::new(width, height).unwrap();
        let pixels = geometry.pixels();
        let bit = |t: usize, p: usize| u8::from(p % 50 != 49 && (t + 7 * p).is_multiple_of(1 + 13 * p % 97));
        let dense: Vec<u8> = (0..900).flat_map(|t| (0..pixels).map(move |p| bit(t, p))).collect();
        let frames = spikelane::SpikeFrames::from_dense(geometry, &dense).unwrap();
        let layout = spikelane_io::formats::Layout::DatTop;
        StreamReader::from_bytes("test", frames.into_bytes(), Some(layout), Some(geometry)).unwrap()
    }

    #[test]
    fn the_encoded_image_of_every_method_is_exact() {
        // A read covers all readouts of the small image, and 209 readouts of the large image.
        for reader in [reader(15, 3), reader(400, 400)] {
            for method in [Method::Tfp, Method::Tfi, Method::Span, Method::Bits] {
                for (at, window) in [(0, 1), (450, 41), (3, 161), (899, 300), (450, 361), (500, 900)] {
                    let encoded = encoded_image(method, &reader, at, window).unwrap();
                    let image = method.image(&reader, at, window).unwrap();
                    assert!(decode(&encoded) == image, "{method:?} {at} {window}");
                }
            }
        }
    }

    #[test]
    fn a_short_window_needs_one_byte_per_pixel() {
        let reader = reader(15, 3);
        let bytes = |method, window| encoded_image(method, &reader, 450, window).unwrap().len();
        assert_eq!(bytes(Method::Tfp, 41), 8 + 4 * 42 + 45);
        assert_eq!(bytes(Method::Bits, 1), 8 + 4 * 2 + 45);
        assert_eq!(bytes(Method::Tfi, 300), 8 + 4 * 601 + 2 * 45);
        assert_eq!(bytes(Method::Span, 41), 8 + 4 * (2 + 41 * 40 / 2) + 2 * 45);
    }

    #[test]
    fn a_readout_after_the_end_is_an_error() {
        let error = encoded_image(Method::Tfp, &reader(15, 3), 900, 41).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Usage);
    }
}
