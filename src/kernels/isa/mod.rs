//! Vector instruction sets: the trait [`lanes::Lanes`] and its implementors.

#[cfg(target_arch = "x86_64")]
pub(super) mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
#[cfg(target_arch = "x86_64")]
mod avx512_counts;
#[cfg(target_arch = "x86_64")]
pub(super) mod avx512_token;
#[cfg(target_arch = "x86_64")]
pub(super) mod intrinsics;
pub(super) mod lanes;
pub(super) mod portable;
#[cfg(target_arch = "x86_64")]
pub(super) mod sse41;
mod wide_lanes;
