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
