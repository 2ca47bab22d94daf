//! One function for each case and instruction set, compiled with its instructions.

#![cfg_attr(
    target_arch = "x86_64",
    allow(unsafe_code, reason = "instructions that tokens prove the CPU to have")
)]

use crate::kernels::Job;
use crate::plan::StateParts;

/// A job, the state that it edits and the bits that it writes, for an instruction set.
struct Work<'a, 'b, 'c, T> {
    token: T,
    job: &'a Job<'a>,
    state: &'b mut StateParts<'c>,
    out: &'b mut [u8],
}

/// An instruction set's entry in a module of its own: the compiler hands what it has to generate to its cores module by module,
/// and these functions are half of all that this crate has.
macro_rules! entry {
    ($(#[$doc:meta])* $name:ident: $room:ident::$token:ident = $proof:expr, $cases:ident $(, $features:literal)?) => {
        pub(super) use $name::$name;

        mod $name {
            use crate::kernels::Job;
            use crate::kernels::body::{self, Entry};
            use crate::kernels::entry::Work;
            use crate::kernels::isa::$room::$token;
            use crate::plan::StateParts;

            $(#[$doc])*
            pub(in crate::kernels) fn $name(job: &Job<'_>, state: &mut StateParts<'_>, out: &mut [u8]) {
                body::$cases(job, Work { token: $proof, job, state, out });
            }

            impl Entry for Work<'_, '_, '_, $token> {
                fn enter<const CASE: u8>(self) {
                    $(#[target_feature(enable = $features)])?
                    #[inline(never)]
                    fn enter<const CASE: u8>(
                        token: $token,
                        job: &Job<'_>,
                        state: &mut StateParts<'_>,
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

// Nearly every x86 has SSE4.1 or more, so the portable vectors need no functions for common cases there. To compile these
// took a fifth of the time of all kernels.
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
