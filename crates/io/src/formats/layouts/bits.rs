//! Copies of bit ranges that can start at any bit of a byte.

/// Copies `n` bits, least significant first, from bit `from_bit` of `from` to bit `to_bit` of `to`. All other bits of
/// `to` are unchanged.
///
/// The copy has three steps. The first step fills the first byte of the destination. The second step copies 64-bit
/// words. Each word is shifted together from a 64-bit load and the next byte. The compiler vectorizes the loop over
/// words. The last step copies the remaining bits.
pub(crate) fn copy_bits(to: &mut [u8], to_bit: usize, from: &[u8], from_bit: usize, n: usize) {
    let (mut t, mut f, end) = (to_bit, from_bit, to_bit + n);
    if !t.is_multiple_of(8) && t < end {
        let m = (8 - t % 8).min(end - t);
        put(to, t, take(from, f, m), m);
        (t, f) = (t + m, f + m);
    }
    let words = (end - t) / 64;
    if words > 0 {
        copy_words(&mut to[t / 8..t / 8 + 8 * words], &from[f / 8..], f % 8);
    }
    (t, f) = (t + 64 * words, f + 64 * words);
    if t < end {
        copy_rest(&mut to[t / 8..], from, f, end - t);
    }
}

fn copy_words(to: &mut [u8], from: &[u8], shift: usize) {
    if shift == 0 {
        to.copy_from_slice(&from[..to.len()]);
        return;
    }
    let behind = from[8..=to.len()].iter().step_by(8);
    let words = from.as_chunks::<8>().0.iter().zip(behind);
    for (out, (word, &next)) in to.as_chunks_mut::<8>().0.iter_mut().zip(words) {
        let word = u64::from_le_bytes(*word) >> shift | u64::from(next) << (64 - shift);
        *out = word.to_le_bytes();
    }
}

/// Copies `n` < 64 bits to the start of `to`.
fn copy_rest(to: &mut [u8], from: &[u8], from_bit: usize, n: usize) {
    let (at, shift) = (from_bit / 8, from_bit % 8);
    let mut bytes = [0; 16];
    let used = (shift + n).div_ceil(8);
    bytes[..used].copy_from_slice(&from[at..at + used]);
    let value = ((u128::from_le_bytes(bytes) >> shift) as u64).to_le_bytes();
    to[..n / 8].copy_from_slice(&value[..n / 8]);
    if !n.is_multiple_of(8) {
        let mask = 0xff >> (8 - n % 8);
        put(to, n / 8 * 8, value[n / 8] & mask, n % 8);
    }
}

/// Returns the `m` bits that start at bit `bit`. `m` is 1 to 8.
fn take(from: &[u8], bit: usize, m: usize) -> u8 {
    let (at, shift) = (bit / 8, bit % 8);
    let mut value = from[at] >> shift;
    if shift + m > 8 {
        value |= from[at + 1] << (8 - shift);
    }
    value & (0xff >> (8 - m))
}

/// Sets the `m` bits that start at bit `bit`. All `m` bits must be in one byte.
fn put(to: &mut [u8], bit: usize, value: u8, m: usize) {
    let (at, shift) = (bit / 8, bit % 8);
    let mask = (0xff >> (8 - m)) << shift;
    to[at] = to[at] & !mask | value << shift;
}

/// Clears the padding bits in the last byte of a packed frame.
pub(crate) fn clear_padding(frame: &mut [u8], pixels: usize) {
    if let (Some(last), rest @ 1..) = (frame.last_mut(), pixels % 8) {
        *last &= 0xff >> (8 - rest);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn copying_equals_one_bit_at_a_time(
            from in proptest::collection::vec(any::<u8>(), 40),
            to in proptest::collection::vec(any::<u8>(), 40),
            from_bit in 0usize..64,
            to_bit in 0usize..64,
            n in 0usize..=256,
        ) {
            let mut expected = to.clone();
            for i in 0..n {
                let (f, t) = (from_bit + i, to_bit + i);
                let bit = from[f / 8] >> (f % 8) & 1;
                expected[t / 8] = expected[t / 8] & !(1 << (t % 8)) | bit << (t % 8);
            }
            let mut actual = to;
            copy_bits(&mut actual, to_bit, &from, from_bit, n);
            prop_assert_eq!(actual, expected);
        }
    }
}
