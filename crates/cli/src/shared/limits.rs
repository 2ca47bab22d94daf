//! Limits of the process that would end it by a signal.

/// Keeps `SIGXFSZ` from ending the process: a file that grows beyond the limit (`ulimit -f`) is then an error of the call
/// that made it grow, which names the file.
pub(crate) fn report_file_size() {
    // Any handler does, such as one that sets a flag which nobody reads. Without one the signal ends the process, as before.
    #[cfg(unix)]
    let _ = signal_hook::flag::register(signal_hook::consts::SIGXFSZ, std::sync::Arc::default());
}
