//! Requests to stop.

use std::cell::RefCell;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::ThreadId;

use crate::error::{Error, Kind, Result};

thread_local! {
    /// The request that the work of this thread obeys.
    static CURRENT: RefCell<Option<Arc<Request>>> = const { RefCell::new(None) };
}

/// Whether some work is to stop.
pub(super) struct Request {
    asked: Box<dyn Fn() -> bool + Send + Sync>,
    /// The thread that called [`until`]; only this one calls `asked`.
    owner: ThreadId,
    raised: AtomicBool,
}

/// The panic payload that unwinds from [`check`] to [`until`]. The panic hook does not run for it.
struct Stopped;

impl Request {
    /// Whether to stop. On the owner's thread this calls `asked`.
    pub(super) fn is_raised(&self) -> bool {
        if !self.raised.load(Ordering::Relaxed) && self.is_own() && (self.asked)() {
            self.raised.store(true, Ordering::Relaxed);
        }
        self.raised.load(Ordering::Relaxed)
    }

    fn is_own(&self) -> bool {
        std::thread::current().id() == self.owner
    }
}

/// Runs `work` until it ends or `asked` returns true.
///
/// This thread calls `asked` whenever the work checks for a stop, and about every 50 ms while other threads work for it.
/// Each function of the library checks at least once per block of 128 readouts, per row of a rendered picture, and per
/// item of parallel work.
///
/// A stop unwinds the stack from such a check to this function, without the panic hook. A program that is built with
/// `panic = "abort"` cannot unwind: there a stop ends the process with an abort, and unfinished files stay under their hidden
/// names. Such a program stops between calls instead.
///
/// # Errors
/// [`Kind::Interrupted`] after a stop; else those of `work`.
pub fn until<T>(
    asked: impl Fn() -> bool + Send + Sync + 'static,
    work: impl FnOnce() -> Result<T>,
) -> Result<T> {
    let owner = std::thread::current().id();
    let request = Request { asked: Box::new(asked), owner, raised: AtomicBool::new(false) };
    let _entered = Entered::new(Some(Arc::new(request)));
    match catch_unwind(AssertUnwindSafe(work)) {
        Ok(result) => result,
        Err(reason) if reason.is::<Stopped>() => Err(Error::new(Kind::Interrupted, "stopped on request")),
        Err(reason) => resume_unwind(reason),
    }
}

/// Returns if the work of this thread may go on; unwinds to [`until`] if not.
pub fn check() {
    let stop = CURRENT.with_borrow(|request| request.as_ref().is_some_and(|r| r.is_raised()));
    // A check while values are dropped must not end the process.
    if stop && !std::thread::panicking() {
        resume_unwind(Box::new(Stopped));
    }
}

/// The request of this thread.
pub(super) fn current() -> Option<Arc<Request>> {
    CURRENT.with_borrow(Clone::clone)
}

/// `work` on another thread, under the request to stop of this one.
#[cfg(feature = "threads")]
pub(super) fn entered<T>(work: impl FnOnce() -> T + Send) -> impl FnOnce() -> T + Send {
    let request = current();
    || {
        let _entered = Entered::new(request);
        work()
    }
}

/// `work` on whichever thread, under the request to stop of this one, which it checks before each item.
#[cfg(feature = "threads")]
pub(super) fn checked<I, T>(work: impl Fn(I) -> T + Sync + Send) -> impl Fn(I) -> T + Sync + Send {
    let request = current();
    move |item| {
        let _entered = Entered::new(request.clone());
        check();
        work(item)
    }
}

/// This thread obeys another request for as long as this value lives.
pub(super) struct Entered(Option<Arc<Request>>);

impl Entered {
    pub(super) fn new(request: Option<Arc<Request>>) -> Self {
        Self(CURRENT.replace(request))
    }
}

impl Drop for Entered {
    fn drop(&mut self) {
        CURRENT.set(self.0.take());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Asks for a stop at the call number `at`, from 1 on; counts the calls.
    fn nth(at: usize) -> (Arc<std::sync::atomic::AtomicUsize>, impl Fn() -> bool + Send + Sync + 'static) {
        let calls = Arc::new(std::sync::atomic::AtomicUsize::new(0));
        let counted = Arc::clone(&calls);
        (calls, move || counted.fetch_add(1, Ordering::SeqCst) + 1 >= at)
    }

    #[test]
    fn work_that_is_not_stopped_returns_its_result() {
        until(
            || false,
            || {
                check();
                Ok(())
            },
        )
        .unwrap();
        check();
    }

    #[test]
    fn a_stop_ends_work_at_its_next_check_and_drops_its_values() {
        let (calls, asked) = nth(3);
        let dropped = Arc::new(());
        let held = Arc::clone(&dropped);
        let stopped = until(asked, || -> Result<()> {
            let _held = held;
            loop {
                check();
            }
        });
        assert_eq!(stopped.unwrap_err().kind(), Kind::Interrupted);
        assert_eq!((calls.load(Ordering::SeqCst), Arc::strong_count(&dropped)), (3, 1));
        // Nothing is stopped any more.
        check();
    }

    #[test]
    fn other_panics_pass_through() {
        let panic = catch_unwind(|| until(|| false, || -> Result<()> { resume_unwind(Box::new("other")) }));
        assert_eq!(panic.unwrap_err().downcast_ref(), Some(&"other"));
    }

    #[test]
    fn inner_work_obeys_its_own_request() {
        let outer = until(
            || false,
            || {
                let inner = until(
                    || true,
                    || {
                        check();
                        Ok(())
                    },
                );
                assert_eq!(inner.unwrap_err().kind(), Kind::Interrupted);
                check();
                Ok(1)
            },
        );
        assert_eq!(outer.unwrap(), 1);
    }

    #[cfg(feature = "threads")]
    #[test]
    fn a_stop_reaches_parallel_work_on_other_threads() {
        let (_, asked) = nth(2);
        let stopped = until(asked, || {
            crate::threads::map(0..4, |_| {
                loop {
                    check();
                    std::thread::yield_now();
                }
            });
            Ok(())
        });
        assert_eq!(stopped.unwrap_err().kind(), Kind::Interrupted);
    }

    #[test]
    fn a_stop_reaches_the_threads_of_indexed_work() {
        let (_, asked) = nth(2);
        let stopped = until(asked, || {
            crate::threads::indexed(3, 3, |_| {
                loop {
                    check();
                    std::thread::yield_now();
                }
            });
            Ok(())
        });
        assert_eq!(stopped.unwrap_err().kind(), Kind::Interrupted);
    }
}
