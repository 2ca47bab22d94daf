//! Plain code compiled for the bit-counting instructions of this CPU.

#![cfg_attr(target_arch = "x86_64", allow(unsafe_code, reason = "instructions that were asked for first"))]

/// Work too large to be inlined of the compiler's own accord: a closure of that size stays a function of its own, without
/// the instructions asked for. [`Self::run`] and what it calls in its loops are `#[inline(always)]`.
pub(crate) trait Work {
    fn run(self);
}

/// Runs `work` compiled with AVX2, POPCNT and BMI where this CPU has them: without, a count of bits is a dozen
/// operations. Only what is inlined into `work` gains; the result is the same.
#[inline]
#[cfg(all(feature = "files", feature = "threads"))]
pub(crate) fn counting<R>(work: impl FnOnce() -> R) -> R {
    #[cfg(target_arch = "x86_64")]
    {
        if has() {
            // SAFETY: the CPU has the features that `enter` is compiled with.
            return unsafe { enter(work) };
        }
    }
    work()
}

/// Runs `work` compiled in the same way.
pub(crate) fn counting_all(work: impl Work) {
    #[cfg(target_arch = "x86_64")]
    {
        if has() {
            // SAFETY: the CPU has the features that `enter_all` is compiled with.
            return unsafe { enter_all(work) };
        }
    }
    work.run();
}

#[cfg(target_arch = "x86_64")]
fn has() -> bool {
    is_x86_feature_detected!("avx2")
        && is_x86_feature_detected!("popcnt")
        && is_x86_feature_detected!("bmi1")
        && is_x86_feature_detected!("bmi2")
}

#[cfg(all(target_arch = "x86_64", feature = "files", feature = "threads"))]
#[target_feature(enable = "avx2,popcnt,bmi1,bmi2")]
fn enter<R>(work: impl FnOnce() -> R) -> R {
    work()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,popcnt,bmi1,bmi2")]
fn enter_all(work: impl Work) {
    work.run();
}
