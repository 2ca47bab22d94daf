//! Parallel work in the thread pool of this process.

use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

use rayon::iter::{IntoParallelIterator, ParallelIterator as _};

use super::pool::Pool;
use super::stop::{self, with_request, with_stop_check};
use crate::error::Result;

/// Interval between two calls of an observer. While the work runs on other threads, stop requests are checked at this
/// interval.
const OBSERVE_PERIOD: Duration = Duration::from_millis(50);

/// Calls `work` with each item in parallel. The results have the order of the items.
pub fn map<I, T>(items: I, work: impl Fn(I::Item) -> T + Sync + Send) -> Vec<T>
where
    I: IntoParallelIterator + Send,
    T: Send,
{
    run(|| items.into_par_iter().map(with_stop_check(work)).collect())
}

/// Calls `work` with each item in parallel, like [`map`]. `work` may fail, and the first error ends the work early.
pub fn try_map<I, T>(items: I, work: impl Fn(I::Item) -> Result<T> + Sync + Send) -> Result<Vec<T>>
where
    I: IntoParallelIterator + Send,
    T: Send,
{
    run(|| items.into_par_iter().map(with_stop_check(work)).collect())
}

/// Runs both closures in parallel and returns both results.
pub fn join<A: Send, B: Send>(one: impl FnOnce() -> A + Send, other: impl FnOnce() -> B + Send) -> (A, B) {
    run(|| rayon::join(with_request(one), with_request(other)))
}

/// Returns the number of threads that execute parallel work.
pub fn thread_count() -> usize {
    match rayon::current_thread_index() {
        Some(_) => rayon::current_num_threads(),
        None => Pool::global().thread_pool().map_or(1, |pool| pool.current_num_threads()),
    }
}

/// Runs `work` on a thread of the pool. If there is no pool, runs `work` on the calling thread.
fn run<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    if rayon::current_thread_index().is_some() {
        return work();
    }
    if stop::current_request().is_some() {
        return run_observed(&mut || {}, work);
    }
    Pool::global().run(work)
}

/// Runs `work` on the pool while the calling thread calls `observe` about every 50 ms.
///
/// If the calling thread belongs to the pool, `work` runs directly on the calling thread and `observe` is not called.
/// Otherwise the waiting thread would be missing from the pool. If there is no pool, `work` also runs on the calling
/// thread.
pub fn run_observed<T: Send>(observe: &mut dyn FnMut(), work: impl FnOnce() -> T + Send) -> T {
    if rayon::current_thread_index().is_some() {
        return work();
    }
    let Some(pool) = Pool::global().thread_pool() else { return work() };
    let request = stop::current_request();
    let (work, mut out) = (with_request(work), None);
    let (end, ended) = channel::<()>();
    pool.in_place_scope(|scope| {
        let out = &mut out;
        scope.spawn(move |_| {
            // If `work` panics, `_end` is dropped too, which ends the loop below. The scope then resumes the panic.
            let _end = end;
            *out = Some(work());
        });
        while ended.recv_timeout(OBSERVE_PERIOD) == Err(RecvTimeoutError::Timeout) {
            observe();
            // On the owner's thread, `is_raised` calls `should_stop`. If the request is raised, the work ends at its
            // next check.
            let _ = request.as_ref().is_some_and(|r| r.is_raised());
        }
    });
    out.unwrap_or_else(|| unreachable!("a scope ends when its work has"))
}
