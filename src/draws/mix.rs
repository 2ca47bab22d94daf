//! One bijection of 64 bits, on which names and hashes stand.

/// A bijection of 64 bits in which every input bit moves every output bit
/// (the finaliser "variant 13" of Stafford, as used by splitmix64).
#[must_use]
#[inline(always)]
pub const fn mix64(mut x: u64) -> u64 {
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}
