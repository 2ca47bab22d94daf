//! `.npy`: a NumPy array, (T,H,ceil(W/8)) of packed bits or (T,H,W) of bytes 0 and 1.

use crate::error::{Error, Kind, Result};
use crate::formats::bits::copy_bits;
use crate::npy::{self, Element, Header};
use crate::spikes::Geometry;

pub(super) use crate::npy::MAGIC;

/// What a header says of an array of bytes in C order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Array {
    pub(super) shape: [u64; 3],
    /// Elements are declared `bool`: surely not packed bits.
    pub(super) is_bool: bool,
    /// Bytes before the data.
    pub(super) start: usize,
}

impl Array {
    /// Bytes of the data, `None` when no machine could hold them.
    pub(super) fn data_bytes(&self) -> Option<u64> {
        self.shape.iter().try_fold(1u64, |a, &b| a.checked_mul(b))
    }
}

/// A header for an array of `u8`.
pub(super) fn header(shape: &[u64; 3]) -> Vec<u8> {
    npy::header(Element::U8, shape)
}

/// Reads a header. `name` is the file, for errors.
pub(super) fn parse(name: &str, bytes: &[u8]) -> Result<Array> {
    meaning(name, &Header::parse(name, bytes)?)
}

/// What a header means for a stream.
pub(super) fn meaning(name: &str, header: &Header) -> Result<Array> {
    let bad = |found: String| {
        Error::new(Kind::Input, name)
            .found(found)
            .expected("a .npy array of u8 or bool in C order with three axes")
    };
    // int8 is what SpikeCV's matrices are; 0 and 1 look the same in it.
    if !matches!(header.element, Element::Bool | Element::U8 | Element::I8) {
        return Err(
            bad(format!("elements of type {}", header.element)).remedy("save a.astype(numpy.uint8), 0 and 1")
        );
    }
    if header.fortran {
        return Err(bad("Fortran order".into()).remedy("save numpy.ascontiguousarray(a)"));
    }
    let shape =
        <[u64; 3]>::try_from(&header.shape[..]).map_err(|_| bad(format!("shape {:?}", header.shape)))?;
    Ok(Array { shape, is_bool: header.element == Element::Bool, start: header.start })
}

/// Bytes of a frame of packed bits: each row starts at a whole byte.
pub(super) fn bits_frame(geometry: Geometry) -> usize {
    geometry.height() * geometry.width().div_ceil(8)
}

pub(super) fn encode_bits(geometry: Geometry, packed: &[u8], file: &mut [u8]) {
    let width = geometry.width();
    if width.is_multiple_of(8) {
        file.copy_from_slice(packed);
        return;
    }
    file.fill(0);
    for (r, row) in file.chunks_exact_mut(width.div_ceil(8)).enumerate() {
        copy_bits(row, 0, packed, r * width, width);
    }
}

pub(super) fn decode_bits(geometry: Geometry, file: &[u8], packed: &mut [u8]) {
    let width = geometry.width();
    if width.is_multiple_of(8) {
        packed.copy_from_slice(file);
        return;
    }
    packed.fill(0);
    for (r, row) in file.chunks_exact(width.div_ceil(8)).enumerate() {
        copy_bits(packed, r * width, row, 0, width);
    }
}

/// One byte, 0 or 1, per pixel.
pub(super) fn encode_bytes(packed: &[u8], file: &mut [u8]) {
    let (words, rest) = file.as_chunks_mut::<8>();
    for (word, &byte) in words.iter_mut().zip(packed) {
        *word = spread(byte);
    }
    if let Some(&last) = packed.get(words.len()) {
        rest.copy_from_slice(&spread(last)[..rest.len()]);
    }
}

/// Packs bytes that must be 0 or 1; `Err` holds the first pixel that is neither.
pub(super) fn decode_bytes(file: &[u8], packed: &mut [u8]) -> Result<(), usize> {
    let (words, rest) = file.as_chunks::<8>();
    let mut seen = 0;
    for (word, byte) in words.iter().zip(packed.iter_mut()) {
        let word = u64::from_le_bytes(*word);
        seen |= word;
        *byte = gather(word);
    }
    if !rest.is_empty() {
        let mut word = [0; 8];
        word[..rest.len()].copy_from_slice(rest);
        let word = u64::from_le_bytes(word);
        seen |= word;
        packed[words.len()] = gather(word);
    }
    if seen & 0xfefe_fefe_fefe_fefe == 0 {
        return Ok(());
    }
    Err(file.iter().position(|&b| b > 1).unwrap_or_default())
}

/// Eight bits as eight bytes: keep bit k in byte k, then carry any bit into bit 7.
fn spread(byte: u8) -> [u8; 8] {
    let kept = (u64::from(byte) * 0x0101_0101_0101_0101) & 0x8040_2010_0804_0201;
    ((kept + 0x7f7f_7f7f_7f7f_7f7f) >> 7 & 0x0101_0101_0101_0101).to_le_bytes()
}

/// Eight bytes of 0 or 1 as bits: the product moves bit 8k to bit 56 + k, and no two
/// partial products meet (8a - 7b = 8c - 7d has no other solution below 8).
fn gather(word: u64) -> u8 {
    ((word & 0x0101_0101_0101_0101).wrapping_mul(0x0102_0408_1020_4080) >> 56) as u8
}
