//! Runs code that is compiled for the instructions of this CPU.

#![cfg_attr(
    target_arch = "x86_64",
    allow(unsafe_code, reason = "the CPU features are detected before these functions are called")
)]

#[cfg(target_arch = "x86_64")]
use super::avx512::Avx512Bits;
use super::bit_ops::BitOps;
use super::i16_lanes::{AnyCpu, I16Lanes};
#[cfg(target_arch = "x86_64")]
use crate::kernels::isa::avx2::Avx2;

/// Work that uses vectors of 16-bit integers or bit operations.
pub trait Task {
    /// The result of the work.
    type Out;

    /// Runs the work.
    ///
    /// Implementors mark this function `#[inline(always)]`, and every function that it calls in loops.
    fn run<S: I16Lanes, B: BitOps>(self, shorts: S, bits: B) -> Self::Out;
}

/// Runs `work` with the widest vectors of 16-bit integers and the best bit operations of this CPU.
///
/// If the CPU has AVX2, POPCNT and BMI, this function runs a version of `work` that is compiled for these instructions.
#[inline]
pub fn dispatch_task<W: Task>(work: W) -> W::Out {
    #[cfg(target_arch = "x86_64")]
    {
        if let Some(shorts) = Avx2::detect().filter(|_| has_popcnt_bmi()) {
            return match Avx512Bits::detect(shorts) {
                // SAFETY: the CPU has the features that `run_avx512` is compiled with.
                Some(bits) => unsafe { run_avx512(work, bits) },
                // SAFETY: the CPU has the features that `run_avx2` is compiled with.
                None => unsafe { run_avx2(work, shorts) },
            };
        }
    }
    work.run(AnyCpu, AnyCpu)
}

/// Runs the closure `work`, compiled like the work of [`dispatch_task`].
///
/// The CPU affects only the speed, not the result. For example, counting bits takes a dozen operations without POPCNT.
/// Only inlined code is compiled for the instructions of the CPU. Mark a large closure `#[inline(always)]`, and also
/// every function that the closure calls in loops.
#[inline]
pub fn dispatch<R>(work: impl FnOnce() -> R) -> R {
    dispatch_task(ClosureTask(work))
}

struct ClosureTask<F>(F);

impl<R, F: FnOnce() -> R> Task for ClosureTask<F> {
    type Out = R;

    #[inline(always)]
    fn run<S: I16Lanes, B: BitOps>(self, _: S, _: B) -> R {
        (self.0)()
    }
}

/// Runs `work` compiled for the widest vectors of doubles and of 64-bit integers that this CPU has.
#[inline]
pub fn dispatch_f64_task<W: Task>(work: W) -> W::Out {
    #[cfg(target_arch = "x86_64")]
    {
        if has_avx512_f64() {
            // SAFETY: the CPU has the features that `run_avx512_f64` is compiled with.
            return unsafe { run_avx512_f64(work) };
        }
        if is_x86_feature_detected!("avx2") {
            // SAFETY: the CPU has the features that `run_avx2_f64` is compiled with.
            return unsafe { run_avx2_f64(work) };
        }
    }
    work.run(AnyCpu, AnyCpu)
}

#[cfg(target_arch = "x86_64")]
fn has_avx512_f64() -> bool {
    is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512bw")
        && is_x86_feature_detected!("avx512dq")
        && is_x86_feature_detected!("avx512vl")
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn run_avx2_f64<W: Task>(work: W) -> W::Out {
    work.run(AnyCpu, AnyCpu)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
fn run_avx512_f64<W: Task>(work: W) -> W::Out {
    work.run(AnyCpu, AnyCpu)
}

#[cfg(target_arch = "x86_64")]
fn has_popcnt_bmi() -> bool {
    is_x86_feature_detected!("popcnt") && is_x86_feature_detected!("bmi1") && is_x86_feature_detected!("bmi2")
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,popcnt,bmi1,bmi2")]
fn run_avx2<W: Task>(work: W, shorts: Avx2) -> W::Out {
    work.run(shorts, AnyCpu)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(
    enable = "avx2,popcnt,bmi1,bmi2,avx512f,avx512bw,avx512vbmi,avx512vbmi2,avx512vnni,avx512vpopcntdq,gfni"
)]
fn run_avx512<W: Task>(work: W, both: Avx512Bits) -> W::Out {
    work.run(both, both)
}
