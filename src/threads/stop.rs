//! Requests to stop work.

use std::cell::RefCell;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::ThreadId;

use crate::error::{Result, error};

thread_local! {
    /// The request that applies to the work of this thread.
    static CURRENT_REQUEST: RefCell<Option<Arc<StopRequest>>> = const { RefCell::new(None) };
}

/// A request to stop some work.
pub(super) struct StopRequest {
    should_stop: Box<dyn Fn() -> bool + Send + Sync>,
    /// The thread that called [`run_until`]. Only this thread calls `should_stop`.
    owner: ThreadId,
    is_raised: AtomicBool,
}

/// The panic payload that unwinds from [`check_stop`] to [`run_until`]. The panic hook does not run for this payload.
struct StopPayload;

impl StopRequest {
    /// Returns whether a stop is requested. On the thread that called [`run_until`], this function calls `should_stop`.
    pub(super) fn is_raised(&self) -> bool {
        if !self.is_raised.load(Ordering::Relaxed) && self.is_own() && (self.should_stop)() {
            self.is_raised.store(true, Ordering::Relaxed);
        }
        self.is_raised.load(Ordering::Relaxed)
    }

    fn is_own(&self) -> bool {
        std::thread::current().id() == self.owner
    }
}

/// Runs `work` until it ends or `should_stop` returns true.
///
/// The calling thread calls `should_stop` whenever its work checks for a stop. While the calling thread waits for other
/// threads, it calls `should_stop` about every 50 ms. Each function of the library checks at least once per block of
/// 128 readouts, per row of a rendered picture and per item of parallel work.
///
/// A stop unwinds the stack from [`check_stop`] to this function, without the panic hook. A program that is built with
/// `panic = "abort"` cannot unwind: a stop aborts the process, and unfinished files keep their hidden names. A program
/// with `panic = "abort"` should therefore stop between calls instead.
///
/// # Errors
/// Returns [`ErrorKind::Interrupted`](crate::ErrorKind::Interrupted) after a stop. Otherwise returns the error of `work`.
pub fn run_until<T>(
    should_stop: impl Fn() -> bool + Send + Sync + 'static,
    work: impl FnOnce() -> Result<T>,
) -> Result<T> {
    let owner = std::thread::current().id();
    let request =
        StopRequest { should_stop: Box::new(should_stop), owner, is_raised: AtomicBool::new(false) };
    let _entered = RequestScope::new(Some(Arc::new(request)));
    match catch_unwind(AssertUnwindSafe(work)) {
        Ok(result) => result,
        Err(reason) if reason.is::<StopPayload>() => Err(error!(Interrupted, "stopped on request")),
        Err(reason) => resume_unwind(reason),
    }
}

/// Returns if no stop is requested. Otherwise unwinds to [`run_until`].
pub fn check_stop() {
    let stop = CURRENT_REQUEST.with_borrow(|request| request.as_ref().is_some_and(|r| r.is_raised()));
    // During a panic, destructors may call this function. A second unwind would abort the process, so the stop is
    // ignored.
    if stop && !std::thread::panicking() {
        resume_unwind(Box::new(StopPayload));
    }
}

/// Returns the request that applies to this thread.
pub(super) fn current_request() -> Option<Arc<StopRequest>> {
    CURRENT_REQUEST.with_borrow(Clone::clone)
}

/// Wraps `work` for another thread. The stop request of the calling thread then also applies to the thread that runs
/// `work`.
#[cfg(feature = "threads")]
pub(super) fn with_request<T>(work: impl FnOnce() -> T + Send) -> impl FnOnce() -> T + Send {
    let request = current_request();
    || {
        let _entered = RequestScope::new(request);
        work()
    }
}

/// Wraps `work` for any thread. The stop request of the calling thread then also applies to the thread that runs
/// `work`, which checks for a stop before each item.
#[cfg(feature = "threads")]
pub(super) fn with_stop_check<I, T>(work: impl Fn(I) -> T + Sync + Send) -> impl Fn(I) -> T + Sync + Send {
    let request = current_request();
    move |item| {
        let _entered = RequestScope::new(request.clone());
        check_stop();
        work(item)
    }
}

/// Replaces the request that applies to this thread until this value is dropped.
pub(super) struct RequestScope(Option<Arc<StopRequest>>);

impl RequestScope {
    pub(super) fn new(request: Option<Arc<StopRequest>>) -> Self {
        Self(CURRENT_REQUEST.replace(request))
    }
}

impl Drop for RequestScope {
    fn drop(&mut self) {
        CURRENT_REQUEST.set(self.0.take());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ErrorKind;

    /// Returns a counter of calls, and a closure that returns true from call number `at` onward. The first call has
    /// number 1.
    fn nth(at: usize) -> (Arc<std::sync::atomic::AtomicUsize>, impl Fn() -> bool + Send + Sync + 'static) {
        let calls = Arc::new(std::sync::atomic::AtomicUsize::new(0));
        let counted = Arc::clone(&calls);
        (calls, move || counted.fetch_add(1, Ordering::SeqCst) + 1 >= at)
    }

    #[test]
    fn work_that_is_not_stopped_returns_its_result() {
        run_until(
            || false,
            || {
                check_stop();
                Ok(())
            },
        )
        .unwrap();
        check_stop();
    }

    #[test]
    fn a_stop_ends_work_at_its_next_check_and_drops_its_values() {
        let (calls, should_stop) = nth(3);
        let dropped = Arc::new(());
        let captured = Arc::clone(&dropped);
        let stopped = run_until(should_stop, || -> Result<()> {
            let _held = captured;
            loop {
                check_stop();
            }
        });
        assert_eq!(stopped.unwrap_err().kind(), ErrorKind::Interrupted);
        assert_eq!((calls.load(Ordering::SeqCst), Arc::strong_count(&dropped)), (3, 1));
        // Outside of `run_until` there is no request, so `check_stop` returns.
        check_stop();
    }

    #[test]
    fn other_panics_pass_through() {
        let panic =
            catch_unwind(|| run_until(|| false, || -> Result<()> { resume_unwind(Box::new("other")) }));
        assert_eq!(panic.unwrap_err().downcast_ref(), Some(&"other"));
    }

    #[test]
    fn inner_work_obeys_its_own_request() {
        let outer = run_until(
            || false,
            || {
                let inner = run_until(
                    || true,
                    || {
                        check_stop();
                        Ok(())
                    },
                );
                assert_eq!(inner.unwrap_err().kind(), ErrorKind::Interrupted);
                check_stop();
                Ok(1)
            },
        );
        assert_eq!(outer.unwrap(), 1);
    }

    #[cfg(feature = "threads")]
    #[test]
    fn a_stop_reaches_parallel_work_on_other_threads() {
        let (_, should_stop) = nth(2);
        let stopped = run_until(should_stop, || {
            crate::threads::map(0..4, |_| {
                loop {
                    check_stop();
                    std::thread::yield_now();
                }
            });
            Ok(())
        });
        assert_eq!(stopped.unwrap_err().kind(), ErrorKind::Interrupted);
    }

    #[test]
    fn a_stop_reaches_the_threads_of_indexed_work() {
        let (_, should_stop) = nth(2);
        let stopped = run_until(should_stop, || {
            crate::threads::map_indexed(3, 3, |_| {
                loop {
                    check_stop();
                    std::thread::yield_now();
                }
            });
            Ok(())
        });
        assert_eq!(stopped.unwrap_err().kind(), ErrorKind::Interrupted);
    }
}
