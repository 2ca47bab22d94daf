//! Handling of process limits that by default end the process with a signal or a panic.

use std::io::Write as _;
use std::panic::{
    AssertUnwindSafe, Location, PanicHookInfo, catch_unwind, resume_unwind, set_hook, take_hook,
};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use spikelane::{Error, ErrorKind, Result};

/// Prevents the signal `SIGXFSZ` from ending the process.
///
/// With this handler, a write beyond the file size limit (`ulimit -f`) returns an error, which contains the name of the
/// file.
pub(crate) fn ignore_file_size_signal() {
    // Any handler is sufficient. This handler sets a flag that is never read. If the registration fails, the signal
    // still ends the process.
    #[cfg(unix)]
    let _ = signal_hook::flag::register(signal_hook::consts::SIGXFSZ, Arc::default());
}

/// Memory in bytes that the program needs to print its version, with its stack.
const START_BYTES: usize = 4 << 20;

/// Returns whether the process has the memory to start. Otherwise, prints a message without allocations.
pub(crate) fn has_memory_to_start() -> bool {
    let has_memory = Vec::<u8>::new().try_reserve_exact(START_BYTES).is_ok();
    if !has_memory {
        // If standard error is closed, there is nowhere to report it.
        let _ = std::io::stderr().write_all(b"spikelane: not enough memory to start\n");
    }
    has_memory
}

/// Makes the exit code of a failed allocation the code for missing memory, while the returned value lives.
///
/// The library checks allocations whose size depends on the input. When a small allocation fails, the standard library
/// prints a message and calls `abort`. With this handler, the signal `SIGABRT` then ends the process with the exit code.
#[cfg(unix)]
pub(crate) struct AbortHandler(Option<signal_hook::SigId>);

#[cfg(unix)]
impl AbortHandler {
    pub(crate) fn new() -> Self {
        let always = Arc::new(true.into());
        let code = ErrorKind::Memory.exit_code().into();
        // If the registration fails, the signal still ends the process.
        Self(
            signal_hook::flag::register_conditional_shutdown(signal_hook::consts::SIGABRT, code, always).ok(),
        )
    }
}

#[cfg(unix)]
impl Drop for AbortHandler {
    fn drop(&mut self) {
        if let Some(handler) = self.0 {
            signal_hook::low_level::unregister(handler);
        }
    }
}

/// Memory in bytes that a panic needs to print a backtrace. The standard library maps the program and builds tables of its
/// symbols. If one of these allocations fails, the thread waits forever for a lock that it has itself.
const BACKTRACE_BYTES: usize = 256 << 20;

/// Whether a thread panicked while memory was missing.
static PANICKED_WITHOUT_MEMORY: AtomicBool = AtomicBool::new(false);

/// Runs `work`. A panic while memory is missing becomes an error.
///
/// Some libraries panic if an allocation fails. Such a panic removes unfinished files on its way. Every other panic
/// continues after `work`.
///
/// # Errors
/// Errors of `work`, and [`ErrorKind::Memory`].
pub(crate) fn run_within_memory<T>(work: impl FnOnce() -> Result<T>) -> Result<T> {
    PANICKED_WITHOUT_MEMORY.store(false, Ordering::Relaxed);
    let host_hook = Arc::new(take_hook());
    let hook = Arc::clone(&host_hook);
    set_hook(Box::new(move |info| print_panic(info, &**hook)));
    let done = catch_unwind(AssertUnwindSafe(work));
    set_hook(Box::new(move |info| host_hook(info)));
    match done {
        Ok(result) => result,
        Err(_) if PANICKED_WITHOUT_MEMORY.load(Ordering::Relaxed) => {
            Err(Error::new(ErrorKind::Memory, "the command")
                .found("not enough memory")
                .expected("enough free memory")
                .remedy("use a smaller input, a machine with more memory or a higher memory limit"))
        }
        Err(panic) => resume_unwind(panic),
    }
}

/// Prints a panic with `hook`, or without allocations if memory is missing.
fn print_panic(info: &PanicHookInfo<'_>, hook: &dyn Fn(&PanicHookInfo<'_>)) {
    let has_memory = Vec::<u8>::new().try_reserve_exact(BACKTRACE_BYTES).is_ok();
    if has_memory && !info.location().is_some_and(is_failed_allocation) {
        return hook(info);
    }
    PANICKED_WITHOUT_MEMORY.store(true, Ordering::Relaxed);
    if let Some(place) = info.location() {
        // If standard error is closed, there is nowhere to report it.
        let _ = writeln!(std::io::stderr(), "spikelane: not enough memory at {place}");
    }
}

/// Returns whether code at `place` panics only if an allocation fails. The construction of scenes calls the functions of
/// bytemuck that allocate.
fn is_failed_allocation(place: &Location<'_>) -> bool {
    place.file().contains("bytemuck") && place.file().ends_with("allocation.rs")
}
