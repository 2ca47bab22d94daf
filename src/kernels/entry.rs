//! One function for each case and instruction set, compiled with its instructions.

#![cfg_attr(
    target_arch = "x86_64",
    allow(unsafe_code, reason = "instructions that tokens prove the CPU to have")
)]

use crate::kernels::Job;
use crate::kernels::body::{self, Entry};
use crate::kernels::isa::portable::Portable;
#[cfg(target_arch = "x86_64")]
use crate::kernels::isa::{avx2::Avx2, avx512_token::Avx512, sse41::Sse41};
use crate::plan::StateParts;

/// A job, the state that it edits and the bits that it writes, for an instruction set.
struct Work<'a, 'b, 'c, T> {
    token: T,
    job: &'a Job<'a>,
    state: &'b mut StateParts<'c>,
    out: &'b mut [u8],
}

/// Runs the job with the vectors of the `wide` crate.
pub(super) fn portable(job: &Job<'_>, state: &mut StateParts<'_>, out: &mut [u8]) {
    body::by_case(job, Work { token: Portable, job, state, out });
}

impl Entry for Work<'_, '_, '_, Portable> {
    #[inline(never)]
    fn enter<const CASE: u8>(self) {
        body::run::<_, CASE>(self.token, self.job, self.state, self.out);
    }
}

/// The entry of an instruction set: functions that are compiled with its features, and a token that proves them.
#[cfg(target_arch = "x86_64")]
macro_rules! entry {
    ($(#[$doc:meta])* $name:ident: $token:ty, $features:literal, $expected:literal) => {
        $(#[$doc])*
        pub(super) fn $name(job: &Job<'_>, state: &mut StateParts<'_>, out: &mut [u8]) {
            let token = <$token>::detect().expect($expected);
            body::by_case(job, Work { token, job, state, out });
        }

        impl Entry for Work<'_, '_, '_, $token> {
            fn enter<const CASE: u8>(self) {
                #[target_feature(enable = $features)]
                fn enter<const CASE: u8>(
                    token: $token,
                    job: &Job<'_>,
                    state: &mut StateParts<'_>,
                    out: &mut [u8],
                ) {
                    body::run::<_, CASE>(token, job, state, out);
                }
                // SAFETY: the token proves the features that the function is compiled with.
                unsafe { enter::<CASE>(self.token, self.job, self.state, self.out) }
            }
        }
    };
}

#[cfg(target_arch = "x86_64")]
entry! {
    /// Runs the job with 128-bit vectors.
    sse41: Sse41, "sse4.1", "the sse4.1 backend needs SSE4.1"
}

#[cfg(target_arch = "x86_64")]
entry! {
    /// Runs the job with 256-bit vectors.
    avx2: Avx2, "avx2", "the avx2 backend needs AVX2"
}

#[cfg(target_arch = "x86_64")]
entry! {
    /// Runs the job with 512-bit vectors.
    avx512: Avx512, "avx512f,avx512bw,avx512vbmi", "the avx512 backend needs AVX-512 F, BW and VBMI"
}
