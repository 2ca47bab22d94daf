//! What else a stream without a header could be, judged by its picture.
//!
//! A wrong size or layout fits the length of many files, and shows noise. In a picture a row continues the one
//! above: the rate map correlates with its lower neighbour, by 0.9 and more in most scenes under the right
//! reading, by 0.3 and less under a wrong one. Flat and dark recordings have no such sign; so readings are
//! compared with each other, and one is accused only when another is clearly better.

use crate::formats::layouts::{self, Axes};
use crate::formats::{Codec, Layout, Origin, Reader, size};
use spikelane::error::{Error, Kind, Result};
use spikelane::spikes::{Geometry, bit};
use spikelane::unstable::inputs;

mod map;

use map::{BEYOND_CHANCE, Bits, Map};

/// Readouts that are looked at, from the middle of the stream.
const READOUTS: usize = 64;

/// A correlation below this is no sign of a picture.
const LEAST: f64 = 0.2;

/// A correlation below this is one of rows that alternate, which noise never has.
const OPPOSITE: f64 = -0.6;

/// Other readings that are listed.
const LISTED: usize = 3;

/// Bytes of an array whose other order of axes is looked at: that takes a walk through all of it.
const MAX_TURNED: usize = 256 << 20;

/// One way to read a file.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Reading {
    /// Layout.
    pub layout: Layout,
    /// Width and height.
    pub geometry: Geometry,
    /// Whole readouts.
    pub readouts: usize,
    /// Correlation of the rate map with its lower neighbour; `None` where nothing varies.
    pub rows: Option<f64>,
    /// How many times as much neighbours differ across the edges of bytes as inside them, 1 in the right order of
    /// bits; `None` where nothing varies, or bytes are no eight pixels.
    pub bytes: Option<f64>,
}

/// The reading that was asked for, and others that the file could have.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Readings {
    /// As the stream was opened.
    pub given: Reading,
    /// The best others, by falling correlation of rows.
    pub others: Vec<Reading>,
    /// The other that the picture fits while it does not fit the given one.
    pub better: Option<Reading>,
}

impl Reading {
    /// Whether a map whose rows are `width` apart and correlate by `rows` is clearly better than this reading.
    fn is_beaten_by(&self, map: &Map, width: usize, rows: Option<f64>) -> bool {
        let chance = BEYOND_CHANCE / (map.pixels() as f64).sqrt();
        rows.is_some_and(|c| {
            let here = self.rows.unwrap_or(0.0);
            // Rows that are the opposite of each other are a texture.
            let fits_worse = here < c / 2.0 && here > OPPOSITE;
            c >= LEAST && c > chance && fits_worse && map.is_peak(width, c)
        })
    }
}

impl Readings {
    /// The accusation in words, and what to give instead; `None` when there is none.
    #[must_use]
    pub fn warning(&self) -> Option<String> {
        let (given, better) = (&self.given, self.better.as_ref()?);
        let as_text = |r: &Reading| format!("{} in layout {}", r.geometry, r.layout);
        let mut flags = Vec::new();
        if better.geometry != given.geometry {
            flags.push(format!("--width {} --height {}", better.geometry.width(), better.geometry.height()));
        }
        if better.layout != given.layout {
            flags.push(format!("--layout {}", better.layout));
        }
        let number = |found: Option<f64>| found.map_or("not measurable".to_owned(), |c| format!("{c:.2}"));
        let why = if better.bytes.is_some() {
            format!(
                "neighbours differ {} times as much across bytes as inside them; as {} {} times",
                number(given.bytes),
                as_text(better),
                number(better.bytes)
            )
        } else {
            format!(
                "rows do not continue each other (correlation {}); as {} they do ({})",
                number(given.rows),
                as_text(better),
                number(better.rows)
            )
        };
        Some(format!(
            "read as {} this does not look like a picture: {why}: give {}",
            as_text(given),
            flags.join(" ")
        ))
    }
}

impl Reader {
    /// Compares the way this stream is read with others that its bytes allow, by 64 readouts from its middle.
    ///
    /// # Errors
    /// [`Kind::Input`] when the file was shortened since it was opened, [`Kind::Io`] when it cannot be read.
    pub fn readings(&self) -> Result<Readings> {
        let map = self.map()?;
        let rows = map.rows();
        let given = Reading {
            layout: self.layout(),
            geometry: self.geometry(),
            readouts: self.readouts(),
            rows,
            bytes: None,
        };
        let mut found: Vec<(Reading, bool)> = Vec::new();
        if self.is_headerless() {
            self.shapes(&map, &given, &mut found);
            self.cameras(&given, &mut found)?;
        } else if self.layout() == Layout::NpyBytes {
            found.extend(self.turned(&given, &map)?);
        }
        found.sort_by(|a, b| b.0.rows.unwrap_or(-1.0).total_cmp(&a.0.rows.unwrap_or(-1.0)));
        let mut better = found.iter().find(|(_, better)| *better).map(|(reading, _)| *reading);
        let (given, turned) = self.bit_orders(given, &map);
        if better.is_none() {
            better = turned;
        }
        let others = found.into_iter().map(|(reading, _)| reading).take(LISTED);
        Ok(Readings { given, others: others.chain(turned).collect(), better })
    }

    fn is_headerless(&self) -> bool {
        !self.layout().is_array()
    }

    /// Hands up to 64 frames from the middle to `take`, as the file has them.
    fn sample(&self, mut take: impl FnMut(&[u8])) -> Result<()> {
        let count = READOUTS.min(self.readouts());
        let first = (self.readouts() - count) / 2;
        self.stored(first..first + count, |_, frames| {
            frames.into_iter().flat_map(|f| f.chunks_exact(self.codec().frame_bytes())).for_each(&mut take);
            Ok(())
        })
    }

    /// The rate map of the sample.
    fn map(&self) -> Result<Map> {
        let (codec, geometry) = (self.codec(), self.geometry());
        if self.layout() == Layout::NpyBytes && codec.layout() == Layout::NpyBytes {
            let mut counts = inputs::zeroed(self.name(), geometry.pixels())?;
            self.sample(|frame| counts.iter_mut().zip(frame).for_each(|(n, b)| *n += u8::from(*b != 0)))?;
            return Ok(Map::plain(counts, geometry.width()));
        }
        let mut bits = Bits::new(codec.frame_bytes())?;
        let is_msb = self.layout().is_msb();
        // The lowest bit first.
        let ordered = |b: &u8| if is_msb { b.reverse_bits() } else { *b };
        self.sample(|frame| bits.add(frame.iter().map(ordered)))?;
        Ok(Map::of(codec, bits))
    }

    /// The same frames with other sides.
    fn shapes(&self, map: &Map, given: &Reading, found: &mut Vec<(Reading, bool)>) {
        let geometry = self.geometry();
        let (pixels, width) = (geometry.pixels(), geometry.width());
        if matches!(self.layout(), Layout::Rows416 | Layout::Rows1024) {
            return;
        }
        // Every second row is a neighbour too, and a texture that alternates would look better so.
        let shapes = (2..=pixels / 2).filter(|w| pixels.is_multiple_of(*w) && !w.is_multiple_of(width));
        // No sensor is more than eight times as wide as high, or as high as wide.
        let usual = |w: &usize| w * w <= 8 * pixels && pixels <= 8 * w * w;
        for width in shapes.filter(|w| usual(w) || *w == geometry.height()) {
            let side = |n: usize| u32::try_from(n).unwrap_or(u32::MAX);
            let Ok(geometry) = Geometry::new(side(width), side(pixels / width)) else { continue };
            let rows = map.correlation(width);
            let reading =
                Reading { layout: self.layout(), geometry, readouts: self.readouts(), rows, bytes: None };
            found.push((reading, given.is_beaten_by(map, width, rows)));
        }
    }

    /// The cameras whose frames have other lengths.
    fn cameras(&self, given: &Reading, found: &mut Vec<(Reading, bool)>) -> Result<()> {
        for (width, height, layout) in size::KNOWN {
            let Ok(geometry) = Geometry::new(width, height) else { continue };
            let Ok(codec) = Codec::new(layout, geometry) else { continue };
            let same = codec.frame_bytes() == self.codec().frame_bytes();
            if (layout, geometry) == (given.layout, given.geometry) || same {
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
            let count = READOUTS.min(readouts);
            if count == 0 {
                continue;
            }
            let start = place + (readouts - count) / 2 * frame;
            let mut bits = Bits::new(frame)?;
            self.pieces(start..start + count * frame, frame, |_, frames| {
                frames.chunks_exact(frame).for_each(|f| bits.add(f.iter().copied()));
                Ok(())
            })?;
            let map = Map::of(codec, bits);
            let rows = map.rows();
            let better = given.is_beaten_by(&map, map.stride, rows);
            found.push((Reading { layout, geometry, readouts, rows, bytes: None }, better));
        }
        Ok(())
    }

    /// An array whose readouts lie along its last axis, where nobody gave a size that would tell.
    fn turned(&self, given: &Reading, here: &Map) -> Result<Option<(Reading, bool)>> {
        let (a, b, c) = (self.readouts(), self.geometry().height(), self.geometry().width());
        let few = a.checked_mul(b).and_then(|n| n.checked_mul(c)).is_some_and(|n| n <= MAX_TURNED);
        let turned = Axes::Last.meaning([a as u64, b as u64, c as u64]);
        let Some((readouts, geometry)) = turned.filter(|_| *self.origin() == Origin::Header && few) else {
            return Ok(None);
        };
        let (count, packed) = (READOUTS.min(c), self.codec().layout() == Layout::DatTop);
        let first = (c - count) / 2;
        let mut counts = inputs::buffer(self.name(), a * b)?;
        self.stored(0..a, |_, frames| {
            for frame in frames.into_iter().flat_map(|f| f.chunks_exact(self.codec().frame_bytes())) {
                let fires = |p: usize| if packed { bit(frame, p) } else { frame[p] != 0 };
                counts.extend(
                    (0..b).map(|row| (0..count).filter(|t| fires(row * c + first + t)).count() as u8),
                );
            }
            Ok(())
        })?;
        let map = Map::plain(counts, b);
        // Read wrongly, one of the sides is time: along the other one the picture may still continue.
        let both = |map: &Map| Some(map.rows()?.min(map.correlation(1)?));
        let wrong = Reading { rows: both(here), ..*given };
        let better = wrong.is_beaten_by(&map, b, both(&map).filter(|_| wrong.rows.is_some()));
        Ok(Some((Reading { geometry, readouts: readouts as usize, rows: map.rows(), ..*given }, better)))
    }

    /// The same frames with the bits of each byte the other way round, where the picture says so.
    fn bit_orders(&self, given: Reading, map: &Map) -> (Reading, Option<Reading>) {
        let Some(layout) = self.layout().other_bit_order() else { return (given, None) };
        let seams = map.seams();
        let given = Reading { bytes: seams.lowest_first(), ..given };
        (given, seams.turned().map(|c| Reading { layout, bytes: Some(c), ..given }))
    }
}

/// Refuses an array of bytes that were taken for pixels and hold eight of them.
///
/// # Errors
/// [`Kind::Input`] when many bytes are neither 0 nor the value of a spike; those of reading the file.
pub(super) fn refuse_packed(reader: &Reader) -> Result<()> {
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
    let mut bits = Bits::new(reader.codec().frame_bytes())?;
    reader.sample(|frame| bits.add(frame.iter().copied()))?;
    let seams = Map::plain(bits.0, 8 * reader.geometry().width()).seams();
    let told = |c: Option<f64>| c.map_or("unknown".to_owned(), |c| format!("{c:.2}"));
    let (low, high) = (told(seams.lowest_first()), told(seams.highest_first()));
    let remedy = if seams.turned().is_some() {
        format!(
            "its picture fits --layout npy-bits-msb, as numpy.packbits packs (neighbours differ {high} times as much \
             across bytes as inside them, {low} times with the lowest bit first)"
        )
    } else if seams.fits_here() {
        format!(
            "its picture fits --layout npy-bits, lowest bit first (neighbours differ {low} times as much across bytes \
             as inside them, {high} times with the highest bit first)"
        )
    } else {
        "name --layout npy-bits-msb (numpy.packbits) or npy-bits (bitorder='little')".to_owned()
    };
    Err(Error::new(Kind::Input, reader.name())
        .found(format_args!("bytes such as {value}, which hold eight pixels each, or light"))
        .expected("0 and 1, or 0 and 255")
        .remedy(format_args!("{remedy}; light is for 'spikelane simulate'")))
}
