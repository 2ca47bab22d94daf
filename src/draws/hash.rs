//! The counter hash behind every draw that is made anew at each readout.
//!
//! One 32-bit word serves two neighbouring pixels (16 bits each). Its key is a
//! bijection of the pair's index, so no two pairs of a sensor ever share their
//! noise; random keys would repeat within a megapixel. The readout enters as
//! three words derived from 64 bits of seed, sequence, stream and readout: an
//! offset and *two multipliers*. A readout that entered as an offset alone
//! would make any two readouts whose offsets collide (one in 2^32 pairs, so
//! expected within 100,000 readouts) copies of each other.
//!
//! `docs/why/random.md` has the evidence: dieharder, and correlations along
//! pixels, along readouts and between streams.

pub use super::mix::mix64;
use super::stream::{Seeds, Stream};

/// The key of one 32-bit address: a bijection (the finaliser of MurmurHash3).
#[must_use]
#[inline(always)]
pub const fn key(address: u32) -> u32 {
    let mut x = address.wrapping_add(0x9e37_79b9);
    x = (x ^ (x >> 16)).wrapping_mul(0x85eb_ca6b);
    x = (x ^ (x >> 13)).wrapping_mul(0xc2b2_ae35);
    x ^ (x >> 16)
}

/// What one readout of one stream contributes to the hash.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(C)]
pub struct Round {
    /// Combined with the key by exclusive or.
    pub offset: u32,
    /// First multiplier, odd.
    pub first: u32,
    /// Second multiplier, odd.
    pub second: u32,
}

/// The temporal noise of one stream: gives the [`Round`] of any readout.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Clock(u64);

impl Clock {
    /// The clock of `stream` under the shot seed and the sequence number.
    #[must_use]
    pub const fn new(seeds: Seeds, stream: Stream) -> Self {
        let seed = mix64(seeds.shot.wrapping_add(0x9e37_79b9_7f4a_7c15));
        let sequence = mix64(seed ^ seeds.sequence.wrapping_mul(0xd1b5_4a32_d192_ed03));
        Self(mix64(sequence ^ stream.id()))
    }

    /// The words of `readout`.
    #[must_use]
    pub const fn round(self, readout: u64) -> Round {
        let a = mix64(self.0 ^ mix64(readout.wrapping_add(0x2545_f491_4f6c_dd1d)));
        let b = mix64(a ^ 0x6a09_e667_f3bc_c909);
        Round { offset: a as u32, first: (a >> 32) as u32 | 1, second: b as u32 | 1 }
    }

    /// 32 random bits for `key` at `readout`.
    #[must_use]
    pub const fn bits(self, key: u32, readout: u64) -> u32 {
        bits(key, self.round(readout))
    }

    /// 64 random bits for one pixel, for draws that are made once.
    #[must_use]
    #[inline(always)]
    pub const fn once(self, pixel: u32) -> u64 {
        mix64(self.0 ^ mix64(pixel as u64 ^ 0x5851_f42d_4c95_7f2d))
    }
}

/// 32 random bits: the low half belongs to the even pixel of a pair.
#[must_use]
#[inline(always)]
pub const fn bits(key: u32, round: Round) -> u32 {
    let mut x = (key ^ round.offset).wrapping_mul(round.first);
    x = (x ^ (x >> 15)).wrapping_mul(round.second);
    x ^ (x >> 16)
}

/// The 16 bits of `pixel` out of its pair's hash.
#[must_use]
pub const fn half(bits: u32, pixel: usize) -> u16 {
    (bits >> ((pixel & 1) * 16)) as u16
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_key_is_a_bijection_on_every_address_a_sensor_uses() {
        // Each step of `key` is invertible; walking it backwards proves it.
        const fn inverse(mut x: u32) -> u32 {
            x ^= x >> 16;
            x = x.wrapping_mul(0x7ed1_b41d);
            x ^= (x >> 13) ^ (x >> 26);
            x = x.wrapping_mul(0xa5cb_9243);
            x ^= x >> 16;
            x.wrapping_sub(0x9e37_79b9)
        }
        for address in (0..u32::MAX).step_by(65_521) {
            assert_eq!(inverse(key(address)), address);
        }
    }

    #[test]
    fn rounds_of_different_addresses_differ() {
        let seeds = Seeds { camera: 0, shot: 1, sequence: 2 };
        let clock = |s: Seeds, n: &str| Clock::new(s, Stream::named(n));
        let base = clock(seeds, "shot_noise");
        assert_ne!(base.round(0), base.round(1));
        assert_ne!(base.round(0), clock(seeds, "thermal_noise").round(0));
        let other = Seeds { sequence: 3, ..seeds };
        assert_ne!(base.round(0), clock(other, "shot_noise").round(0));
        let other = Seeds { shot: 2, ..seeds };
        assert_ne!(base.round(0), clock(other, "shot_noise").round(0));
        let camera = Seeds { camera: 9, ..seeds };
        assert_eq!(base.round(0), clock(camera, "shot_noise").round(0));
    }
}
