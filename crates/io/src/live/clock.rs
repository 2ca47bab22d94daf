//! Time, so that tests have one of their own.

use std::time::{Duration, Instant};

/// A clock that starts at zero and can be waited for.
pub trait Clock {
    /// Time since the start.
    fn now(&self) -> Duration;

    /// Returns not before `moment`, unless that is further away than `at_most`.
    fn wait_until(&mut self, moment: Duration, at_most: Duration);
}

/// The computer's clock.
#[derive(Clone, Copy, Debug)]
pub struct SystemClock(Instant);

impl SystemClock {
    /// A clock that starts now.
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
