//! Plain code compiled for the bit-counting instructions of this CPU.

#![cfg_attr(target_arch = "x86_64", allow(unsafe_code, reason = "instructions that were asked for first"))]

#[cfg(target_arch = "x86_64")]
use super::avx512::Avx512Bits;
use super::matrix::Bits;
use super::shorts::{AnyCpu, Shorts};
#[cfg(target_arch = "x86_64")]
use crate::kernels::isa::avx2::Avx2;

/// Work that also wants vectors of 16-bit integers, and bits turned and found.
pub trait Work {
    /// What the work returns.
    type Out;

    /// Mark it `#[inline(always)]`, as what it calls in its loops.
    fn run<S: Shorts, B: Bits>(self, shorts: S, bits: B) -> Self::Out;
}

/// Runs `work` with the widest vectors of 16-bit integers that this CPU has, compiled for AVX2, POPCNT and BMI where it has these, and
/// with the best that it can make of bits.
#[inline]
pub fn counting_with<W: Work>(work: W) -> W::Out {
    #[cfg(target_arch = "x86_64")]
    {
        if let Some(shorts) = Avx2::detect().filter(|_| has()) {
            return match Avx512Bits::detect(shorts) {
                // SAFETY: the CPU has the features that `enter_wide` is compiled with.
                Some(bits) => unsafe { enter_wide(work, bits) },
                // SAFETY: the CPU has the features that `enter` is compiled with.
                None => unsafe { enter(work, shorts) },
            };
        }
    }
    work.run(AnyCpu, AnyCpu)
}

/// Runs `work` so: without these, a count of bits is a dozen operations. The result is the same. Only what is inlined gains, a large closure
/// itself as well: mark it `#[inline(always)]`, and what it calls in its loops.
#[inline]
pub fn counting<R>(work: impl FnOnce() -> R) -> R {
    counting_with(Plain(work))
}

struct Plain<F>(F);

impl<R, F: FnOnce() -> R> Work for Plain<F> {
    type Out = R;

    #[inline(always)]
    fn run<S: Shorts, B: Bits>(self, _: S, _: B) -> R {
        (self.0)()
    }
}

/// Runs `work` compiled for the widest vectors of doubles and of 64-bit integers that this CPU has.
#[inline]
pub fn doubles_with<W: Work>(work: W) -> W::Out {
    #[cfg(target_arch = "x86_64")]
    {
        if has_wide_doubles() {
            // SAFETY: the CPU has the features that `enter_wide_doubles` is compiled with.
            return unsafe { enter_wide_doubles(work) };
        }
        if is_x86_feature_detected!("avx2") {
            // SAFETY: the CPU has the features that `enter_doubles` is compiled with.
            return unsafe { enter_doubles(work) };
        }
    }
    work.run(AnyCpu, AnyCpu)
}

#[cfg(target_arch = "x86_64")]
fn has_wide_doubles() -> bool {
    is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512bw")
        && is_x86_feature_detected!("avx512dq")
        && is_x86_feature_detected!("avx512vl")
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn enter_doubles<W: Work>(work: W) -> W::Out {
    work.run(AnyCpu, AnyCpu)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
fn enter_wide_doubles<W: Work>(work: W) -> W::Out {
    work.run(AnyCpu, AnyCpu)
}

#[cfg(target_arch = "x86_64")]
fn has() -> bool {
    is_x86_feature_detected!("popcnt") && is_x86_feature_detected!("bmi1") && is_x86_feature_detected!("bmi2")
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,popcnt,bmi1,bmi2")]
fn enter<W: Work>(work: W, shorts: Avx2) -> W::Out {
    work.run(shorts, AnyCpu)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(
    enable = "avx2,popcnt,bmi1,bmi2,avx512f,avx512bw,avx512vbmi,avx512vbmi2,avx512vnni,avx512vpopcntdq,gfni"
)]
fn enter_wide<W: Work>(work: W, both: Avx512Bits) -> W::Out {
    work.run(both, both)
}
