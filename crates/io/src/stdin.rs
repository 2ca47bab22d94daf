//! Standard input, where a pipe is meant.

use std::io::{self, Read};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use spikelane::error::{Error, Kind};

/// Standard input. While it waits for bytes, a raised `stop` ends the wait with an error of [`Kind::Interrupted`].
#[derive(Debug)]
pub struct Stdin {
    source: Source,
    stop: Arc<AtomicBool>,
}

/// The source has no buffer, since `poll` does not report bytes that already lie in a buffer.
#[cfg(unix)]
type Source = std::fs::File;
#[cfg(not(unix))]
type Source = io::Stdin;

impl Stdin {
    /// # Errors
    /// When the system has no handle left.
    pub fn new(stop: Arc<AtomicBool>) -> io::Result<Self> {
        Ok(Self { source: source()?, stop })
    }
}

impl Read for Stdin {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        while !is_ready(&self.source)? {
            if self.stop.load(Ordering::Relaxed) {
                // The standard library repeats a read whose own error is of the kind `Interrupted`.
                let stopped = Error::new(Kind::Interrupted, "standard input").found("a request to stop");
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

/// Whether a read would return at once, after a wait of at most a tenth of a second.
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
