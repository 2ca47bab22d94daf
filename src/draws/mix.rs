//! A bijection of 64-bit numbers, used to derive stream numbers and hashes.

/// Returns a bijection of `x` in which every input bit affects every output bit (Stafford's finalizer
/// "variant 13", as in splitmix64).
#[must_use]
#[inline(always)]
pub const fn mix64(mut x: u64) -> u64 {
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}
