//! Parallel work in the pool of this process.

use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

use rayon::iter::{IntoParallelIterator, ParallelIterator as _};

use super::pool::Pool;
use super::stop::{self, checked, entered};
use crate::error::Result;

/// Time between two calls of an observer, and between two looks at a request to stop.
const PERIOD: Duration = Duration::from_millis(50);

/// Calls `work` with each item, in parallel, and collects the results in the items' order.
pub fn map<I, T>(items: I, work: impl Fn(I::Item) -> T + Sync + Send) -> Vec<T>
where
    I: IntoParallelIterator + Send,
    T: Send,
{
    run(|| items.into_par_iter().map(checked(work)).collect())
}

/// As [`map`], for work that may fail. An error ends the work early.
pub fn try_map<I, T>(items: I, work: impl Fn(I::Item) -> Result<T> + Sync + Send) -> Result<Vec<T>>
where
    I: IntoParallelIterator + Send,
    T: Send,
{
    run(|| items.into_par_iter().map(checked(work)).collect())
}

/// Runs both in parallel and returns both results.
pub fn join<A: Send, B: Send>(one: impl FnOnce() -> A + Send, other: impl FnOnce() -> B + Send) -> (A, B) {
    run(|| rayon::join(entered(one), entered(other)))
}

/// The number of threads that share parallel work.
pub fn count() -> usize {
    match rayon::current_thread_index() {
        Some(_) => rayon::current_num_threads(),
        None => Pool::of_process().started().map_or(1, |pool| pool.current_num_threads()),
    }
}

/// Runs `work` on a thread of the pool, where there is one.
fn run<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    if rayon::current_thread_index().is_some() {
        return work();
    }
    if stop::current().is_some() {
        return run_observed(&mut || {}, work);
    }
    Pool::of_process().run(work)
}

/// As `run`; meanwhile this thread calls `observe` about every 50 ms. On a thread of the pool it is not called, since a thread
/// that waits would be missing there.
pub fn run_observed<T: Send>(observe: &mut dyn FnMut(), work: impl FnOnce() -> T + Send) -> T {
    if rayon::current_thread_index().is_some() {
        return work();
    }
    let Some(pool) = Pool::of_process().started() else { return work() };
    let request = stop::current();
    let (work, mut out) = (entered(work), None);
    let (end, ended) = channel::<()>();
    pool.in_place_scope(|scope| {
        let out = &mut out;
        scope.spawn(move |_| {
            // Dropped in a panic too, which the scope passes on.
            let _end = end;
            *out = Some(work());
        });
        while ended.recv_timeout(PERIOD) == Err(RecvTimeoutError::Timeout) {
            observe();
            // The work sees that the request is raised, and ends.
            let _ = request.as_ref().is_some_and(|r| r.is_raised());
        }
    });
    out.unwrap_or_else(|| unreachable!("a scope ends when its work has"))
}
