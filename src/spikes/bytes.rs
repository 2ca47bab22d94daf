//! Conversion between packed bits and bytes. The byte of a pixel is 0 or 1.

use crate::count::Count;
use crate::error::{Result, error};
use crate::spikes::Geometry;

/// Unpacks consecutive packed frames of `geometry` into `bits`.
///
/// `bits` receives one byte, 0 or 1, for every pixel and readout, row-major, top row first.
///
/// # Examples
/// ```
/// let geometry = spikelane::Geometry::new(4, 2)?;
/// let mut bits = [0u8; 8];
/// spikelane::spikes::unpack(geometry, &[0b1000_0001], &mut bits)?;
/// assert_eq!(bits, [1, 0, 0, 0, 0, 0, 0, 1]);
/// # Ok::<(), spikelane::Error>(())
/// ```
///
/// # Errors
/// Returns [`ErrorKind::Usage`](crate::ErrorKind::Usage) if the slices do not contain equal numbers of whole frames.
pub fn unpack(geometry: Geometry, packed: &[u8], bits: &mut [u8]) -> Result<()> {
    check(geometry, packed.len(), bits.len())?;
    let frames = packed.chunks_exact(geometry.frame_bytes());
    for (packed, bits) in frames.zip(bits.chunks_exact_mut(geometry.pixels())) {
        unpack_frame(packed, bits);
    }
    Ok(())
}

/// Packs one byte for every pixel and readout into packed frames of `geometry`. The bytes are 0 and 1, or 0 and 255.
///
/// # Examples
/// ```
/// let geometry = spikelane::Geometry::new(4, 2)?;
/// let mut packed = [0u8];
/// spikelane::spikes::pack(geometry, &[1, 0, 0, 0, 0, 0, 0, 1], &mut packed)?;
/// assert_eq!(packed, [0b1000_0001]);
/// # Ok::<(), spikelane::Error>(())
/// ```
///
/// # Errors
/// Returns [`ErrorKind::Usage`](crate::ErrorKind::Usage) if the slices do not contain equal numbers of whole frames. Returns
/// [`ErrorKind::Input`](crate::ErrorKind::Input) if a frame contains other bytes than 0 and 1, or 0 and 255. The error contains the position of
/// the first invalid byte.
pub fn pack(geometry: Geometry, bits: &[u8], packed: &mut [u8]) -> Result<()> {
    check(geometry, packed.len(), bits.len())?;
    let frames = packed.chunks_exact_mut(geometry.frame_bytes());
    for (readout, (packed, bits)) in frames.zip(bits.chunks_exact(geometry.pixels())).enumerate() {
        pack_frame(bits, packed).map_err(|p| {
            let (row, col) = (p / geometry.width(), p % geometry.width());
            error!(Input, "readout {readout}, row {row}, col {col}"; found "{}", bits[p];
                expected "0 and 1, or 0 and 255")
        })?;
    }
    Ok(())
}

fn check(geometry: Geometry, packed: usize, bits: usize) -> Result<()> {
    let (frame, pixels) = (geometry.frame_bytes(), geometry.pixels());
    let is_complete = packed.is_multiple_of(frame) && bits.is_multiple_of(pixels);
    if is_complete && packed / frame == bits / pixels {
        return Ok(());
    }
    Err(error!(Usage, "frames"; found "{} for {bits} bits", Count(packed, "packed byte");
        expected "{frame} for every {pixels}, one {geometry} frame"))
}

/// Unpacks one frame, like [`unpack`].
pub fn unpack_frame(packed: &[u8], bits: &mut [u8]) {
    let (words, rest) = bits.as_chunks_mut::<8>();
    for (word, &byte) in words.iter_mut().zip(packed) {
        *word = unpack_byte(byte).to_le_bytes();
    }
    if let Some(&last) = packed.get(words.len()) {
        rest.copy_from_slice(&unpack_byte(last).to_le_bytes()[..rest.len()]);
    }
}

/// Packs one frame, like [`pack`]. Returns the index of the first pixel with an invalid byte as `Err`.
pub fn pack_frame(bits: &[u8], packed: &mut [u8]) -> Result<(), usize> {
    const LOW: u64 = 0x0101_0101_0101_0101;
    let (words, rest) = bits.as_chunks::<8>();
    // `beyond_one` is 0 if all bytes are 0 or 1. `uneven` is 0 if all bytes are 0 or 255.
    let (mut beyond_one, mut uneven) = (0, 0);
    let mut take = |word: u64| {
        beyond_one |= word & !LOW;
        uneven |= word ^ ((word & LOW) * 0xff);
        pack_word(word)
    };
    for (word, byte) in words.iter().zip(packed.iter_mut()) {
        *byte = take(u64::from_le_bytes(*word));
    }
    if !rest.is_empty() {
        let mut word = [0; 8];
        word[..rest.len()].copy_from_slice(rest);
        packed[words.len()] = take(u64::from_le_bytes(word));
    }
    if beyond_one == 0 || uneven == 0 {
        return Ok(());
    }
    // The first nonzero byte determines the value of a spike.
    let top = bits.iter().copied().find(|&b| b != 0).filter(|&b| b == 255).unwrap_or(1);
    Err(bits.iter().position(|&b| b != 0 && b != top).unwrap_or_default())
}

/// Returns eight bits as eight bytes, lowest bit first. The mask keeps bit k of `byte` in byte k. The addition carries
/// this bit to bit 7 of byte k.
pub fn unpack_byte(byte: u8) -> u64 {
    let selected = (u64::from(byte) * 0x0101_0101_0101_0101) & 0x8040_2010_0804_0201;
    (selected + 0x7f7f_7f7f_7f7f_7f7f) >> 7 & 0x0101_0101_0101_0101
}

/// Returns the positions of the set bits of `word` in ascending order. Bit 0 is the lowest bit.
#[inline(always)]
pub fn set_bits(mut word: u64) -> impl Iterator<Item = u32> {
    std::iter::from_fn(move || {
        let at = (word != 0).then(|| word.trailing_zeros());
        word &= word.wrapping_sub(1);
        at
    })
}

/// Returns eight bytes of 0 or 1 as eight bits.
///
/// In the product, bit 8a of `word` and bit 56 - 7b of the factor meet at bit 56 + 8a - 7b, where a and b are 0 to 7.
/// For a = b = k, this is bit 56 + k. All 64 pairs (a, b) have different product bits, so no carry occurs.
fn pack_word(word: u64) -> u8 {
    ((word & 0x0101_0101_0101_0101).wrapping_mul(0x0102_0408_1020_4080) >> 56) as u8
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spikes::bit;

    #[test]
    fn unpacking_equals_one_bit_at_a_time_and_packing_undoes_it() {
        for (width, height) in [(8, 2), (7, 3), (1, 1), (67, 5), (13, 1)] {
            let geometry = Geometry::new(width, height).unwrap();
            let (pixels, frame) = (geometry.pixels(), geometry.frame_bytes());
            let mut packed: Vec<u8> = (0..3 * frame).map(|i| (i * 167 + 13) as u8).collect();
            if pixels % 8 != 0 {
                packed.chunks_mut(frame).for_each(|f| f[frame - 1] &= (1 << (pixels % 8)) - 1);
            }
            let mut bits = vec![9; 3 * pixels];
            unpack(geometry, &packed, &mut bits).unwrap();
            for (i, &value) in bits.iter().enumerate() {
                let frame = &packed[i / pixels * frame..];
                assert_eq!(value, u8::from(bit(frame, i % pixels)), "{geometry}, byte {i}");
            }
            let mut again = vec![255; packed.len()];
            pack(geometry, &bits, &mut again).unwrap();
            assert_eq!(again, packed, "{geometry}");
        }
    }

    #[test]
    fn other_sizes_and_other_values_are_refused_with_their_place() {
        let geometry = Geometry::new(10, 2).unwrap();
        assert!(unpack(geometry, &[0; 6], &mut [0; 20]).is_err());
        assert!(unpack(geometry, &[0; 4], &mut [0; 80]).is_err());
        let mut bits = [1; 40];
        bits[33] = 2;
        let error = pack(geometry, &bits, &mut [0; 6]).unwrap_err();
        assert_eq!(error.to_string(), "readout 1, row 1, col 3: found 2, expected 0 and 1, or 0 and 255");
    }
}
