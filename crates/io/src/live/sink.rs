//! Destinations of live readouts.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use spikelane::error::Result;
use spikelane::unstable::named_variants;

/// What a sink does with readouts if the consumer is too slow.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum OverflowPolicy {
    /// The readouts are dropped and counted, as in a real camera.
    #[default]
    Drop,
    /// The sink waits for the consumer. No readout is lost, but later readouts are late.
    Block,
}

named_variants!(OverflowPolicy, "overflow policy" { Drop = "drop", Block = "block" });

/// The outcome of a delivery.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Delivery {
    /// The consumer or the buffer of the sink has accepted the burst.
    Accepted,
    /// The burst was dropped because the buffer was full.
    Dropped,
    /// The consumer has disconnected, or the user has requested a stop.
    Closed,
}

/// A connection to a consumer, used by the delivery thread.
pub trait Sink: Send {
    /// Delivers a burst of whole frames. The frames are in chronological order.
    ///
    /// # Errors
    /// Errors of the operating system. It is not an error if the consumer has disconnected.
    fn deliver(&mut self, frames: &[u8]) -> Result<Delivery>;

    /// Delivers all buffered frames and signals the end of the stream.
    ///
    /// # Errors
    /// As [`Sink::deliver`].
    fn finish(&mut self) -> Result<()>;
}

/// A request to stop, which can be raised on any thread.
#[derive(Clone, Debug, Default)]
pub struct StopFlag(Arc<AtomicBool>);

impl StopFlag {
    /// Creates a request that is raised when `flag` becomes true.
    #[must_use]
    pub fn from_flag(flag: Arc<AtomicBool>) -> Self {
        Self(flag)
    }

    /// Returns whether a stop was requested.
    #[must_use]
    pub fn is_raised(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// Time between two checks whether a full buffer has free space again.
const SPACE_CHECK_INTERVAL: Duration = Duration::from_micros(200);

/// Waits until `ready` returns a value, and returns that value. Returns `None` if a stop is requested first.
pub(super) fn wait_for<T>(stop: &StopFlag, mut ready: impl FnMut() -> Option<T>) -> Option<T> {
    loop {
        if let Some(value) = ready() {
            return Some(value);
        }
        if stop.is_raised() {
            return None;
        }
        std::thread::sleep(SPACE_CHECK_INTERVAL);
    }
}
