//! The counter-based hash for all draws at readouts.
//!
//! Each 32-bit word of the hash contains 16 random bits for each of two neighboring pixels. The hash combines the key
//! of the pair of pixels with the readout. The key is a bijection of the pair's index, so different pairs of a sensor
//! have different noise. Random keys would repeat within a megapixel.
//!
//! Each readout contributes three words to the hash: an offset and *two multipliers*. The three words are derived from
//! 64 bits of seed, sequence, stream and readout. With the offset alone, two readouts with equal offsets would have
//! equal noise. One in 2^32 pairs of readouts has equal offsets, so two of 100,000 readouts would probably have equal
//! noise.
//!
//! `docs/why/random.md` tests the quality of the hash. It shows the results of dieharder, and the correlations along
//! pixels, along readouts and between streams.

pub use super::mix::mix64;
use super::random_stream::{RandomStream, Seeds};

/// Returns the key of a 32-bit address. The mapping is a bijection (the finalizer of MurmurHash3).
#[must_use]
#[inline(always)]
pub const fn address_key(address: u32) -> u32 {
    let mut x = address.wrapping_add(0x9e37_79b9);
    x = (x ^ (x >> 16)).wrapping_mul(0x85eb_ca6b);
    x = (x ^ (x >> 13)).wrapping_mul(0xc2b2_ae35);
    x ^ (x >> 16)
}

/// The three words that one readout of one stream contributes to the hash.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(C)]
pub struct RoundKey {
    /// XORed with the key.
    pub offset: u32,
    /// First multiplier, odd.
    pub first: u32,
    /// Second multiplier, odd.
    pub second: u32,
}

/// The generator of the temporal noise of one stream. A draw is a function of key and readout.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CounterRng(u64);

impl CounterRng {
    /// Returns the generator of `stream` for the shot seed and the sequence number.
    #[must_use]
    pub const fn new(seeds: Seeds, stream: RandomStream) -> Self {
        let seed = mix64(seeds.shot.wrapping_add(0x9e37_79b9_7f4a_7c15));
        let sequence = mix64(seed ^ seeds.sequence.wrapping_mul(0xd1b5_4a32_d192_ed03));
        Self(mix64(sequence ^ stream.id()))
    }

    /// Returns the three words of `readout`.
    #[must_use]
    pub const fn round_key(self, readout: u64) -> RoundKey {
        let a = mix64(self.0 ^ mix64(readout.wrapping_add(0x2545_f491_4f6c_dd1d)));
        let b = mix64(a ^ 0x6a09_e667_f3bc_c909);
        RoundKey { offset: a as u32, first: (a >> 32) as u32 | 1, second: b as u32 | 1 }
    }

    /// Returns 32 random bits for the pair with key `key` at readout `readout`.
    #[must_use]
    pub const fn hash_bits(self, key: u32, readout: u64) -> u32 {
        hash_bits(key, self.round_key(readout))
    }

    /// Returns 64 random bits for one pixel, for draws that do not depend on the readout.
    #[must_use]
    #[inline(always)]
    pub const fn pixel_bits(self, pixel: u32) -> u64 {
        mix64(self.0 ^ mix64(pixel as u64 ^ 0x5851_f42d_4c95_7f2d))
    }
}

/// Returns 32 random bits for a pair of pixels. The low half belongs to the even pixel.
#[must_use]
#[inline(always)]
pub const fn hash_bits(key: u32, round_key: RoundKey) -> u32 {
    let mut x = (key ^ round_key.offset).wrapping_mul(round_key.first);
    x = (x ^ (x >> 15)).wrapping_mul(round_key.second);
    x ^ (x >> 16)
}

/// Returns the 16 bits of `pixel` from `bits`, the hash of the pixel's pair.
#[must_use]
pub const fn pixel_half(bits: u32, pixel: usize) -> u16 {
    (bits >> ((pixel & 1) * 16)) as u16
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_key_is_a_bijection_on_every_address_a_sensor_uses() {
        // Each step of `address_key` is invertible. `inverse` applies the inverse steps in reverse order.
        const fn inverse(mut x: u32) -> u32 {
            x ^= x >> 16;
            x = x.wrapping_mul(0x7ed1_b41d);
            x ^= (x >> 13) ^ (x >> 26);
            x = x.wrapping_mul(0xa5cb_9243);
            x ^= x >> 16;
            x.wrapping_sub(0x9e37_79b9)
        }
        for address in (0..u32::MAX).step_by(65_521) {
            assert_eq!(inverse(address_key(address)), address);
        }
    }

    #[test]
    fn rounds_of_different_addresses_differ() {
        let seeds = Seeds { camera: 0, shot: 1, sequence: 2 };
        let rng = |s: Seeds, n: &str| CounterRng::new(s, RandomStream::from_name(n));
        let base = rng(seeds, "shot_noise");
        assert_ne!(base.round_key(0), base.round_key(1));
        assert_ne!(base.round_key(0), rng(seeds, "thermal_noise").round_key(0));
        let other = Seeds { sequence: 3, ..seeds };
        assert_ne!(base.round_key(0), rng(other, "shot_noise").round_key(0));
        let other = Seeds { shot: 2, ..seeds };
        assert_ne!(base.round_key(0), rng(other, "shot_noise").round_key(0));
        let camera = Seeds { camera: 9, ..seeds };
        assert_eq!(base.round_key(0), rng(camera, "shot_noise").round_key(0));
    }
}
