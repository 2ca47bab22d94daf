//! Where readouts go.

use std::str::FromStr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use spikelane::error::{Error, Kind, Result};

/// What happens to readouts that a slow consumer has no room for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Policy {
    /// They are lost, as a camera's are, and counted.
    #[default]
    Drop,
    /// The camera waits: nothing is lost, and later readouts are late.
    Block,
}

impl FromStr for Policy {
    type Err = Error;

    /// `drop` or `block`.
    fn from_str(text: &str) -> Result<Self> {
        match text {
            "drop" => Ok(Self::Drop),
            "block" => Ok(Self::Block),
            _ => Err(Error::new(Kind::Usage, "policy")
                .found(format_args!("`{text}`"))
                .expected("drop or block")),
        }
    }
}

/// What became of a burst.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Delivery {
    /// The consumer has it, or the buffer before the consumer.
    Taken,
    /// There was no room for it.
    Dropped,
    /// The consumer has left, or the user has asked to stop.
    Gone,
}

/// A way to a consumer; a thread of its own delivers.
pub trait Sink: Send {
    /// Takes a burst of whole frames of `frame_bytes` bytes, in the order of time.
    ///
    /// # Errors
    /// What the operating system refuses; a consumer that left is none.
    fn deliver(&mut self, frames: &[u8]) -> Result<Delivery>;

    /// Brings what is buffered to the consumer and says that no more will come.
    ///
    /// # Errors
    /// As [`Sink::deliver`].
    fn finish(&mut self) -> Result<()>;
}

/// A request to stop, which may be raised on any thread.
#[derive(Clone, Debug, Default)]
pub struct Stop(Arc<AtomicBool>);

impl Stop {
    /// A request that `flag` raises.
    #[must_use]
    pub fn of(flag: Arc<AtomicBool>) -> Self {
        Self(flag)
    }

    /// Whether it was raised.
    #[must_use]
    pub fn is_raised(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// Between two looks whether a full buffer has room again.
const LOOK: Duration = Duration::from_micros(200);

/// Waits until `ready` says something or a stop is requested, which gives `None`.
pub(super) fn wait<T>(stop: &Stop, mut ready: impl FnMut() -> Option<T>) -> Option<T> {
    loop {
        if let Some(found) = ready() {
            return Some(found);
        }
        if stop.is_raised() {
            return None;
        }
        std::thread::sleep(LOOK);
    }
}
