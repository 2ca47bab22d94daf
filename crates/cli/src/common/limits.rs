//! Handling of process limits that by default end the process with a signal.

/// Prevents the signal `SIGXFSZ` from ending the process.
///
/// With this handler, a write beyond the file size limit (`ulimit -f`) returns an error, which contains the name of the
/// file.
pub(crate) fn ignore_file_size_signal() {
    // Any handler is sufficient. This handler sets a flag that is never read. If the registration fails, the signal
    // still ends the process.
    #[cfg(unix)]
    let _ = signal_hook::flag::register(signal_hook::consts::SIGXFSZ, std::sync::Arc::default());
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
        let always = std::sync::Arc::new(true.into());
        let code = spikelane::ErrorKind::Memory.exit_code().into();
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
