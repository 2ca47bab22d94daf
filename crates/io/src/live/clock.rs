//! A clock that tests can replace.

use std::time::{Duration, Instant};

/// A clock that starts at zero and can wait for an instant.
pub trait Clock {
    /// Returns the time since the clock started.
    fn now(&self) -> Duration;

    /// Waits until the clock reads `moment`, but at most for the duration `max_wait`.
    fn wait_until(&mut self, moment: Duration, max_wait: Duration);
}

/// The monotonic clock of the system.
#[derive(Clone, Copy, Debug)]
pub struct SystemClock(Instant);

impl SystemClock {
    /// Creates a clock that reads zero now.
    #[must_use]
    pub fn start() -> Self {
        Self(Instant::now())
    }
}

impl Clock for SystemClock {
    fn now(&self) -> Duration {
        self.0.elapsed()
    }

    fn wait_until(&mut self, moment: Duration, at_most: Duration) {
        std::thread::sleep(moment.saturating_sub(self.now()).min(at_most));
    }
}
