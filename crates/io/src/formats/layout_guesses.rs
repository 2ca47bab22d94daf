//! Compares the current layout and geometry of a stream with alternatives that have the same file length.
//!
//! With a wrong geometry or layout, the file length is often still a whole number of frames, but the decoded frames
//! look like noise. In an image, each row resembles the row above. The rate map (the number of spikes of each pixel)
//! is therefore compared with itself shifted by one row. The correlation is at least 0.9 in most scenes under the
//! right guess, and at most 0.3 under a wrong guess. Uniform and dark recordings have a low correlation under every
//! guess, so a guess is reported as wrong only if an alternative is clearly better.

use crate::formats::layouts::{self, ReadoutAxis};
use crate::formats::{Codec, GeometryOrigin, Layout, StreamReader, size};
use spikelane::error::{Result, Setting, error};
use spikelane::spikes::{Geometry, bit};
use spikelane::unstable::inputs;

mod rate_map;

use rate_map::{BitCounts, CHANCE_Z_THRESHOLD, RateMap};

/// Number of readouts that are examined. The readouts are taken from the middle of the stream.
const SAMPLE_READOUTS: usize = 64;

/// A row correlation below this value does not indicate an image.
const MIN_ROW_CORRELATION: f64 = 0.2;

/// A row correlation below this value means that bright and dark rows alternate. Noise never has a correlation below
/// this value.
const ALTERNATING_ROWS_CORRELATION: f64 = -0.6;

/// The largest number of alternatives in the result.
const MAX_LISTED_GUESSES: usize = 3;

/// The largest array, in bytes, for which the last axis is examined as a possible readout axis. The examination reads
/// the whole array.
const MAX_TRANSPOSED_BYTES: usize = 256 << 20;

/// A combination of layout and geometry with which a file can be read.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct LayoutGuess {
    /// Layout of the file.
    pub layout: Layout,
    /// Width and height.
    pub geometry: Geometry,
    /// Number of whole readouts in the file.
    pub readouts: usize,
    /// Correlation of the rate map with itself shifted by one row. `None` if all pixels have the same rate.
    pub row_correlation: Option<f64>,
    /// Mean difference between neighboring pixels in different bytes, divided by the mean difference between
    /// neighboring pixels in the same byte.
    ///
    /// The byte-edge ratio is about 1 in the right bit order. The ratio is `None` if all pixels have the same rate, or
    /// if a byte does not contain eight pixels.
    pub byte_edge_ratio: Option<f64>,
}

/// The current layout and geometry of a stream, and alternatives that have the same file length.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct LayoutGuesses {
    /// The layout and size with which the stream was opened.
    pub current: LayoutGuess,
    /// The best alternatives, by decreasing row correlation. The list contains at most three layouts or geometries,
    /// and one additional entry for the reversed bit order.
    pub alternatives: Vec<LayoutGuess>,
    /// The alternative that fits the rate map clearly better than the current guess, or `None`.
    pub better_guess: Option<LayoutGuess>,
}

impl LayoutGuess {
    /// Returns whether another guess, with row length `width` and row correlation `rows`, is clearly better than this
    /// guess. `map` is the rate map from which `rows` was computed.
    fn is_beaten_by(&self, map: &RateMap, width: usize, rows: Option<f64>) -> bool {
        let chance = CHANCE_Z_THRESHOLD / (map.pixels() as f64).sqrt();
        rows.is_some_and(|c| {
            let here = self.row_correlation.unwrap_or(0.0);
            // Alternating bright and dark rows are a texture of the scene. They do not indicate a wrong guess.
            let fits_worse = here < c / 2.0 && here > ALTERNATING_ROWS_CORRELATION;
            c >= MIN_ROW_CORRELATION && c > chance && fits_worse && map.is_peak(width, c)
        })
    }
}

impl LayoutGuesses {
    /// Returns a warning text that recommends the better guess, or `None` if no alternative is better.
    #[must_use]
    pub fn warning(&self) -> Option<String> {
        let (current, better) = (&self.current, self.better_guess.as_ref()?);
        let as_text = |r: &LayoutGuess| format!("{} in layout {}", r.geometry, r.layout);
        let mut settings = Vec::new();
        if better.geometry != current.geometry {
            settings.push(format!(
                "{} to {} and {} to {}",
                Setting("width"),
                better.geometry.width(),
                Setting("height"),
                better.geometry.height()
            ));
        }
        if better.layout != current.layout {
            settings.push(format!("{} to {}", Setting("layout"), better.layout));
        }
        let number = |found: Option<f64>| found.map_or("not measurable".to_owned(), |c| format!("{c:.2}"));
        let why = if better.byte_edge_ratio.is_some() {
            format!(
                "adjacent pixels differ {} times as much across byte borders as inside bytes; read as {}, the factor is {}",
                number(current.byte_edge_ratio),
                as_text(better),
                number(better.byte_edge_ratio)
            )
        } else {
            format!(
                "adjacent rows do not match (correlation {}); read as {}, adjacent rows match (correlation {})",
                number(current.row_correlation),
                as_text(better),
                number(better.row_correlation)
            )
        };
        Some(format!(
            "read as {}, the stream does not look like an image: {why}; set {}",
            as_text(current),
            settings.join(" and ")
        ))
    }
}

impl StreamReader {
    /// Compares the current layout and geometry with alternatives. The comparison uses 64 readouts from the middle of
    /// the stream.
    ///
    /// # Errors
    /// * [`ErrorKind::Input`](spikelane::ErrorKind::Input) if the file was truncated after the stream was opened.
    /// * [`ErrorKind::Io`](spikelane::ErrorKind::Io) if the file cannot be read.
    pub fn layout_guesses(&self) -> Result<LayoutGuesses> {
        let map = self.rate_map()?;
        let rows = map.row_correlation();
        let current = LayoutGuess {
            layout: self.layout(),
            geometry: self.geometry(),
            readouts: self.readouts(),
            row_correlation: rows,
            byte_edge_ratio: None,
        };
        let mut guesses: Vec<(LayoutGuess, bool)> = Vec::new();
        if self.is_headerless() {
            self.add_other_shapes(&map, &current, &mut guesses);
            self.add_other_cameras(&current, &mut guesses)?;
        } else if self.layout() == Layout::NpyBytes {
            guesses.extend(self.transposed_guess(&current, &map)?);
        }
        guesses.sort_by(|a, b| {
            b.0.row_correlation.unwrap_or(-1.0).total_cmp(&a.0.row_correlation.unwrap_or(-1.0))
        });
        let mut better = guesses.iter().find(|(_, better)| *better).map(|(reading, _)| *reading);
        let (current, turned) = self.compare_bit_orders(current, &map);
        if better.is_none() {
            better = turned;
        }
        let others = guesses.into_iter().map(|(reading, _)| reading).take(MAX_LISTED_GUESSES);
        Ok(LayoutGuesses { current, alternatives: others.chain(turned).collect(), better_guess: better })
    }

    fn is_headerless(&self) -> bool {
        !self.layout().is_array()
    }

    /// Passes up to 64 frames from the middle of the stream to `take`, in the encoding of the file.
    fn sample(&self, mut take: impl FnMut(&[u8])) -> Result<()> {
        let count = SAMPLE_READOUTS.min(self.readouts());
        let first = (self.readouts() - count) / 2;
        self.for_each_stored_piece(first..first + count, |_, frames| {
            frames.into_iter().flat_map(|f| f.chunks_exact(self.codec().frame_bytes())).for_each(&mut take);
            Ok(())
        })
    }

    /// Returns the rate map of the sampled frames.
    fn rate_map(&self) -> Result<RateMap> {
        let (codec, geometry) = (self.codec(), self.geometry());
        if self.layout() == Layout::NpyBytes && codec.layout() == Layout::NpyBytes {
            let mut counts = inputs::zeroed_vec(self.name(), geometry.pixels())?;
            self.sample(|frame| counts.iter_mut().zip(frame).for_each(|(n, b)| *n += u8::from(*b != 0)))?;
            return Ok(RateMap::from_counts(counts, geometry.width()));
        }
        let mut bits = BitCounts::new(codec.frame_bytes())?;
        let is_msb = self.layout().is_msb();
        // [`BitCounts`] counts the least significant bit of each byte first, so the bits of MSB-first layouts are
        // reversed.
        let ordered = |b: &u8| if is_msb { b.reverse_bits() } else { *b };
        self.sample(|frame| bits.add(frame.iter().map(ordered)))?;
        Ok(RateMap::from_bits(codec, bits))
    }

    /// Adds guesses that differ from `current` in width and height, but not in the layout and number of pixels.
    fn add_other_shapes(&self, map: &RateMap, current: &LayoutGuess, guesses: &mut Vec<(LayoutGuess, bool)>) {
        let geometry = self.geometry();
        let (pixels, width) = (geometry.pixels(), geometry.width());
        if matches!(self.layout(), Layout::Rows416 | Layout::Rows1024) {
            return;
        }
        // Multiples of the current width are excluded. In a texture that alternates between rows, rows two apart
        // correlate better than neighboring rows, so twice the width would be preferred.
        let shapes = (2..=pixels / 2).filter(|w| pixels.is_multiple_of(*w) && !w.is_multiple_of(width));
        // Sensors have an aspect ratio of at most 8, so other shapes are skipped.
        let is_plausible_width = |w: &usize| w * w <= 8 * pixels && pixels <= 8 * w * w;
        for width in shapes.filter(|w| is_plausible_width(w) || *w == geometry.height()) {
            let side = |n: usize| u32::try_from(n).unwrap_or(u32::MAX);
            let Ok(geometry) = Geometry::new(side(width), side(pixels / width)) else { continue };
            let rows = map.correlation(width);
            let reading = LayoutGuess {
                layout: self.layout(),
                geometry,
                readouts: self.readouts(),
                row_correlation: rows,
                byte_edge_ratio: None,
            };
            guesses.push((reading, current.is_beaten_by(map, width, rows)));
        }
    }

    /// Adds guesses for known cameras and data sets, if their frames differ from the current frames in byte length.
    fn add_other_cameras(&self, current: &LayoutGuess, guesses: &mut Vec<(LayoutGuess, bool)>) -> Result<()> {
        for (width, height, layout) in size::KNOWN_SIZES {
            let Ok(geometry) = Geometry::new(width, height) else { continue };
            let Ok(codec) = Codec::new(layout, geometry) else { continue };
            let same = codec.frame_bytes() == self.codec().frame_bytes();
            if (layout, geometry) == (current.layout, current.geometry) || same {
                continue;
            }
            let (len, frame) = (self.source.len(), codec.frame_bytes());
            let (place, readouts) = if layout == Layout::Rows1024 {
                let head = len.min(4 * frame);
                let Some(start) = layouts::find_rows1024(&self.source, head)?.map(|f| f.leading) else {
                    continue;
                };
                (start, (len - start) / frame)
            } else {
                (0, len / frame)
            };
            let count = SAMPLE_READOUTS.min(readouts);
            if count == 0 {
                continue;
            }
            let start = place + (readouts - count) / 2 * frame;
            let mut bits = BitCounts::new(frame)?;
            self.for_each_piece(start..start + count * frame, frame, |_, frames| {
                frames.chunks_exact(frame).for_each(|f| bits.add(f.iter().copied()));
                Ok(())
            })?;
            let map = RateMap::from_bits(codec, bits);
            let rows = map.row_correlation();
            let better = current.is_beaten_by(&map, map.stride, rows);
            guesses.push((
                LayoutGuess { layout, geometry, readouts, row_correlation: rows, byte_edge_ratio: None },
                better,
            ));
        }
        Ok(())
    }

    /// Returns the guess in which the last axis of an array is the readout axis. Returns `None` if the geometry was not
    /// determined from the header, or if the array is too large.
    fn transposed_guess(&self, current: &LayoutGuess, here: &RateMap) -> Result<Option<(LayoutGuess, bool)>> {
        let (a, b, c) = (self.readouts(), self.geometry().height(), self.geometry().width());
        let few = a.checked_mul(b).and_then(|n| n.checked_mul(c)).is_some_and(|n| n <= MAX_TRANSPOSED_BYTES);
        let turned = ReadoutAxis::Last.readouts_and_geometry([a as u64, b as u64, c as u64]);
        let Some((readouts, geometry)) = turned.filter(|_| *self.origin() == GeometryOrigin::Header && few)
        else {
            return Ok(None);
        };
        let (count, packed) = (SAMPLE_READOUTS.min(c), self.codec().layout() == Layout::DatTop);
        let first = (c - count) / 2;
        let mut counts = inputs::reserved_vec(self.name(), a * b)?;
        self.for_each_stored_piece(0..a, |_, frames| {
            for frame in frames.into_iter().flat_map(|f| f.chunks_exact(self.codec().frame_bytes())) {
                let fires = |p: usize| if packed { bit(frame, p) } else { frame[p] != 0 };
                counts.extend(
                    (0..b).map(|row| (0..count).filter(|t| fires(row * c + first + t)).count() as u8),
                );
            }
            Ok(())
        })?;
        let map = RateMap::from_counts(counts, b);
        // In the wrong axis order, one of the two image axes is the readout axis. The image can still vary smoothly
        // along the other image axis. Therefore the smaller of the correlations along the two image axes decides.
        let both = |map: &RateMap| Some(map.row_correlation()?.min(map.correlation(1)?));
        let wrong = LayoutGuess { row_correlation: both(here), ..*current };
        let better = wrong.is_beaten_by(&map, b, both(&map).filter(|_| wrong.row_correlation.is_some()));
        Ok(Some((
            LayoutGuess {
                geometry,
                readouts: readouts as usize,
                row_correlation: map.row_correlation(),
                ..*current
            },
            better,
        )))
    }

    /// Returns `current` with the byte-edge ratio of its bit order. Also returns a guess with the reversed bit order if
    /// the reversed order fits the rate map clearly better.
    fn compare_bit_orders(&self, current: LayoutGuess, map: &RateMap) -> (LayoutGuess, Option<LayoutGuess>) {
        let Some(layout) = self.layout().other_bit_order() else { return (current, None) };
        let seams = map.byte_edges();
        let current = LayoutGuess { byte_edge_ratio: seams.lsb_first_ratio(), ..current };
        (
            current,
            seams.reversed_order_ratio().map(|c| LayoutGuess { layout, byte_edge_ratio: Some(c), ..current }),
        )
    }
}

/// Rejects an `npy-bytes` array in which each byte contains eight pixels.
///
/// # Errors
/// * [`ErrorKind::Input`](spikelane::ErrorKind::Input) if more than 10 % of the nonzero bytes are neither 1 nor 255.
/// * Errors of reading the file.
pub(super) fn refuse_packed(reader: &StreamReader) -> Result<()> {
    let (mut lit, mut spikes, mut value) = (0u64, 0u64, None);
    reader.sample(|frame| {
        for &byte in frame.iter().filter(|b| **b != 0) {
            let spike = matches!(byte, 1 | 255);
            (lit, spikes) = (lit + 1, spikes + u64::from(spike));
            value = value.or((!spike).then_some(byte));
        }
    })?;
    if 10 * (lit - spikes) <= lit {
        return Ok(());
    }
    let value = value.unwrap_or_default();
    let mut bits = BitCounts::new(reader.codec().frame_bytes())?;
    reader.sample(|frame| bits.add(frame.iter().copied()))?;
    let seams = RateMap::from_counts(bits.0, 8 * reader.geometry().width()).byte_edges();
    let ratio_text = |c: Option<f64>| c.map_or("unknown".to_owned(), |c| format!("{c:.2}"));
    let (low, high) = (ratio_text(seams.lsb_first_ratio()), ratio_text(seams.msb_first_ratio()));
    let layout = Setting("layout");
    let remedy = if seams.reversed_order_ratio().is_some() {
        format!(
            "set {layout} to npy-bits-msb, which numpy.packbits writes and which fits better (adjacent pixels differ \
             {high} times as much across byte borders as inside bytes; with the lowest bit first {low} times)"
        )
    } else if seams.fits_current_order() {
        format!(
            "set {layout} to npy-bits, lowest bit first, which fits better (adjacent pixels differ {low} times as much \
             across byte borders as inside bytes; with the highest bit first {high} times)"
        )
    } else {
        format!("set {layout} to npy-bits-msb (numpy.packbits) or npy-bits (bitorder='little')")
    };
    Err(error!(Input, "{}", reader.name(); found "bytes such as {value}, which are packed bits or light";
        expected "0 and 1, or 0 and 255"; remedy "{remedy}; simulate an array of light first"))
}
