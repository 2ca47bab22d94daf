//! Moving runs of bits that start anywhere.

/// Copies `n` bits, least significant first, from bit `from_bit` of `from` to
/// bit `to_bit` of `to`; other bits of `to` stay.
///
/// Whole words of the destination are assembled from two loads and a shift;
/// copying bit by bit was thirty times slower.
pub(super) fn copy_bits(to: &mut [u8], to_bit: usize, from: &[u8], from_bit: usize, n: usize) {
    let (mut t, mut f, end) = (to_bit, from_bit, to_bit + n);
    if !t.is_multiple_of(8) && t < end {
        let m = (8 - t % 8).min(end - t);
        put(to, t, take(from, f, m), m);
        (t, f) = (t + m, f + m);
    }
    let words = (end - t) / 64;
    let (first, shift) = (f / 8, f % 8);
    if words > 0 {
        let (out, _) = to[t / 8..].as_chunks_mut::<8>();
        for (i, word) in out[..words].iter_mut().enumerate() {
            *word = load(from, first + 8 * i, shift).to_le_bytes();
        }
    }
    (t, f) = (t + 64 * words, f + 64 * words);
    while t < end {
        let m = (end - t).min(8);
        put(to, t, take(from, f, m), m);
        (t, f) = (t + m, f + m);
    }
}

/// 64 bits from bit `shift` of byte `at` on.
fn load(from: &[u8], at: usize, shift: usize) -> u64 {
    let mut word = [0; 8];
    word.copy_from_slice(&from[at..at + 8]);
    let low = u64::from_le_bytes(word) >> shift;
    if shift == 0 {
        low
    } else {
        low | u64::from(from[at + 8]) << (64 - shift)
    }
}

/// `m` bits, 1 to 8, from bit `bit` on.
fn take(from: &[u8], bit: usize, m: usize) -> u8 {
    let (at, shift) = (bit / 8, bit % 8);
    let mut value = from[at] >> shift;
    if shift + m > 8 {
        value |= from[at + 1] << (8 - shift);
    }
    value & (0xff >> (8 - m))
}

/// Sets `m` bits from bit `bit` on, all within one byte.
fn put(to: &mut [u8], bit: usize, value: u8, m: usize) {
    let (at, shift) = (bit / 8, bit % 8);
    let mask = (0xff >> (8 - m)) << shift;
    to[at] = to[at] & !mask | value << shift;
}

/// Zeroes the bits of the last byte of a packed frame that are no pixel.
pub(super) fn clear_padding(frame: &mut [u8], pixels: usize) {
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
            let mut found = to;
            copy_bits(&mut found, to_bit, &from, from_bit, n);
            prop_assert_eq!(found, expected);
        }
    }
}
