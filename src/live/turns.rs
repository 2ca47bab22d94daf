//! Short turns on a core, for a thread that often wakes to do little.
#![cfg_attr(
    target_os = "linux",
    allow(unsafe_code, reason = "a call of the system that no safe crate offers")
)]

/// Asks the scheduler to let the calling thread run soon after it wakes, at the price of short turns; no privilege is
/// needed and its share of the core stays the same. Without it a thread that wakes on a busy core waits for the end of
/// the other's turn, up to a tick of 4 ms. Linux does so from 6.12 on; elsewhere nothing happens.
pub(super) fn shorten() {
    #[cfg(target_os = "linux")]
    linux::shorten();
}

#[cfg(target_os = "linux")]
mod linux {
    /// The shortest turn that Linux takes, in nanoseconds.
    const SHORTEST_NS: u64 = 100_000;

    /// `struct sched_attr` of the kernel, in its first version of 48 bytes.
    #[repr(C)]
    #[derive(Default)]
    struct Attributes {
        size: u32,
        policy: u32,
        flags: u64,
        nice: i32,
        priority: u32,
        runtime: u64,
        deadline: u64,
        period: u64,
    }

    const SIZE: u32 = size_of::<Attributes>() as u32;

    pub(super) fn shorten() {
        let mut now = Attributes { size: SIZE, ..Attributes::default() };
        // SAFETY: the kernel writes at most `SIZE` bytes, all of them plain numbers, into a live exclusive reference of
        // that size; 0 is the calling thread.
        let known = unsafe { libc::syscall(libc::SYS_sched_getattr, 0, &raw mut now, SIZE, 0) } == 0;
        // A user who gave the process a real-time policy has chosen better already.
        if !known || now.policy != libc::SCHED_OTHER as u32 {
            return;
        }
        let wanted = Attributes { runtime: SHORTEST_NS, ..now };
        // SAFETY: the kernel reads `size` bytes of a live value of that size. Where it refuses, turns stay as they are.
        let _ = unsafe { libc::syscall(libc::SYS_sched_setattr, 0, &raw const wanted, 0) };
    }
}
