//! One function per case and instruction set, compiled with the instructions of that set.

#![cfg_attr(
    target_arch = "x86_64",
    allow(unsafe_code, reason = "instructions that tokens prove the CPU to have")
)]

use crate::kernels::Job;
use crate::plan::StateTile;

/// The arguments of a kernel call, and the token of an instruction set.
struct JobCall<'a, 'b, 'c, T> {
    token: T,
    job: &'a Job<'a>,
    state: &'b mut StateTile<'c>,
    out: &'b mut [u8],
}

/// Defines the entry of an instruction set in a separate module.
///
/// The compiler generates the code of different modules on different CPU cores. The entries of all instruction sets are
/// half of this crate's code, so separate modules shorten the build.
macro_rules! entry {
    ($(#[$doc:meta])* $name:ident: $module:ident::$token:ident = $proof:expr, $cases:ident $(, $features:literal)?) => {
        pub(super) use $name::$name;

        mod $name {
            use crate::kernels::Job;
            use crate::kernels::body::{self, Entry};
            use crate::kernels::entry::JobCall;
            use crate::kernels::isa::$module::$token;
            use crate::plan::StateTile;

            $(#[$doc])*
            pub(in crate::kernels) fn $name(job: &Job<'_>, state: &mut StateTile<'_>, out: &mut [u8]) {
                body::$cases(job, JobCall { token: $proof, job, state, out });
            }

            impl Entry for JobCall<'_, '_, '_, $token> {
                fn enter<const CASE: u8>(self) {
                    $(#[target_feature(enable = $features)])?
                    #[inline(never)]
                    fn enter<const CASE: u8>(
                        token: $token,
                        job: &Job<'_>,
                        state: &mut StateTile<'_>,
                        out: &mut [u8],
                    ) {
                        body::run::<_, CASE>(token, job, state, out);
                    }
                    entry!(@call $($features)? enter::<CASE>(self.token, self.job, self.state, self.out));
                }
            }
        }
    };
    (@call $features:literal $enter:expr) => {
        // SAFETY: the token proves the features that the function is compiled with.
        unsafe { $enter }
    };
    (@call $enter:expr) => {
        $enter
    };
}

// Nearly every x86 CPU has at least SSE4.1, so the portable vectors rarely run on x86. The functions for common cases
// are omitted, because they would increase the compile time of all kernels by a fifth.
#[cfg(target_arch = "x86_64")]
entry! {
    /// Runs the job with the vectors of the `wide` crate.
    portable: portable::Portable = Portable, by_general_case
}

#[cfg(not(target_arch = "x86_64"))]
entry! {
    /// Runs the job with the vectors of the `wide` crate.
    portable: portable::Portable = Portable, by_case
}

#[cfg(target_arch = "x86_64")]
entry! {
    /// Runs the job with 128-bit vectors.
    sse41: sse41::Sse41 = Sse41::detect().expect("the sse4.1 backend needs SSE4.1"), by_case, "sse4.1"
}

#[cfg(target_arch = "x86_64")]
entry! {
    /// Runs the job with 256-bit vectors.
    avx2: avx2::Avx2 = Avx2::detect().expect("the avx2 backend needs AVX2"), by_case, "avx2"
}

#[cfg(target_arch = "x86_64")]
entry! {
    /// Runs the job with 512-bit vectors.
    avx512: avx512_token::Avx512 = Avx512::detect().expect("the avx512 backend needs AVX-512 F, BW and VBMI"), by_case,
    "avx512f,avx512bw,avx512vbmi"
}
