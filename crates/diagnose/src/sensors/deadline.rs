//! The cache and the time limit of the simulations of a diagnosis.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crate::sensors::cache::SimulationCache;
use spikelane::error::{Error, ErrorKind, Result};

/// The cache and the time limit of simulations.
#[derive(Clone, Debug, Default)]
pub(crate) struct SimulationContext {
    pub cache: Option<SimulationCache>,
    pub deadline: Deadline,
}

/// The time at which the simulations of a diagnosis must end. Clones share one deadline.
#[derive(Clone, Debug, Default)]
pub(crate) struct Deadline(Option<Arc<Limit>>);

#[derive(Debug)]
struct Limit {
    end: Instant,
    is_lifted: AtomicBool,
}

impl Deadline {
    /// Returns the deadline of work that started at `start`. Work without a `limit` has no deadline. The same
    /// applies if the deadline is beyond the range of the clock.
    pub(crate) fn new(start: Instant, limit: Option<Duration>) -> Self {
        let end = limit.and_then(|limit| start.checked_add(limit));
        Self(end.map(|end| Arc::new(Limit { end, is_lifted: AtomicBool::new(false) })))
    }

    /// Returns an error if the deadline has passed. Every simulation calls this function before it starts.
    ///
    /// # Errors
    /// [`ErrorKind::Interrupted`] after the deadline.
    pub(crate) fn check(&self) -> Result<()> {
        match &self.0 {
            Some(limit) if !limit.is_lifted.load(Ordering::Relaxed) && Instant::now() >= limit.end => {
                Err(Error::new(ErrorKind::Interrupted, "the time limit is reached"))
            }
            _ => Ok(()),
        }
    }

    /// Removes the deadline, so that the few simulations of a report can run.
    pub(crate) fn lift(&self) {
        if let Some(limit) = &self.0 {
            limit.is_lifted.store(true, Ordering::Relaxed);
        }
    }
}

/// Returns the value of `result`, or `None` if `result` is the error of the deadline.
///
/// # Errors
/// Any error other than that of the deadline.
pub(crate) fn in_time<T>(result: Result<T>) -> Result<Option<T>> {
    match result {
        Ok(value) => Ok(Some(value)),
        Err(error) if error.kind() == ErrorKind::Interrupted => Ok(None),
        Err(error) => Err(error),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_deadline_ends_work_until_it_is_lifted() {
        let over = Deadline::new(Instant::now(), Some(Duration::ZERO));
        assert!(in_time(over.clone().check()).unwrap().is_none());
        over.lift();
        assert!(over.check().is_ok());
        assert!(Deadline::new(Instant::now(), None).check().is_ok());
        assert!(Deadline::new(Instant::now(), Some(Duration::MAX)).check().is_ok());
    }
}
