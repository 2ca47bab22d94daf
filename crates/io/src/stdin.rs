//! Standard input whose reads can be interrupted.

use std::io::{self, Read};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use spikelane::error::error;

/// Standard input. If `stop` becomes true while a read waits for bytes, the read fails with
/// [`ErrorKind::Interrupted`](spikelane::ErrorKind::Interrupted).
///
/// `stop` is checked on Unix only.
#[derive(Debug)]
pub struct Stdin {
    source: Source,
    stop: Arc<AtomicBool>,
}

/// The program reads standard input without a buffer, because `poll` would not report bytes that are already in a
/// buffer.
#[cfg(unix)]
type Source = std::fs::File;
#[cfg(not(unix))]
type Source = io::Stdin;

impl Stdin {
    /// Opens standard input. A read checks `stop` while waiting for bytes.
    ///
    /// # Errors
    /// If the system cannot duplicate the file descriptor.
    pub fn new(stop: Arc<AtomicBool>) -> io::Result<Self> {
        Ok(Self { source: source()?, stop })
    }
}

impl Read for Stdin {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        while !is_ready(&self.source)? {
            if self.stop.load(Ordering::Relaxed) {
                // `std::io::Error::other` is used because the standard library retries reads that fail with
                // `io::ErrorKind::Interrupted`.
                let stopped = error!(Interrupted, "standard input"; found "a request to stop");
                return Err(io::Error::other(stopped));
            }
        }
        self.source.read(bytes)
    }
}

#[cfg(unix)]
fn source() -> io::Result<Source> {
    use std::os::fd::AsFd as _;
    io::stdin().as_fd().try_clone_to_owned().map(Source::from)
}

/// Waits at most 0.1 s. Returns whether a read would return without blocking.
#[cfg(unix)]
fn is_ready(source: &Source) -> io::Result<bool> {
    use rustix::event::{PollFd, PollFlags, Timespec, poll};
    let wait = Timespec { tv_sec: 0, tv_nsec: 100_000_000 };
    match poll(&mut [PollFd::new(source, PollFlags::IN)], Some(&wait)) {
        Ok(ready) => Ok(ready > 0),
        Err(rustix::io::Errno::INTR) => Ok(false),
        Err(e) => Err(e.into()),
    }
}

#[cfg(not(unix))]
fn source() -> io::Result<Source> {
    Ok(io::stdin())
}

#[cfg(not(unix))]
fn is_ready(_: &Source) -> io::Result<bool> {
    Ok(true)
}
