//! Parallel work, and requests to stop work.
//!
//! All parallel work of the library uses this module. `map` and `join` run work in a thread pool that belongs to this
//! process alone. After `fork`, a child process does not have the threads of its parent, so it starts a new pool. If the
//! system limits the number of threads, work runs on the threads that start. If no thread starts, work runs on the
//! calling thread.
//!
//! [`run_until`] can stop work early. The work calls [`check_stop`] from time to time. If a stop was requested,
//! [`check_stop`] unwinds the stack to [`run_until`] and drops all values on the stack. `map` calls [`check_stop`] before
//! each item.

#[cfg(feature = "threads")]
mod parallel;
#[cfg(feature = "threads")]
mod pool;
mod spawn;
mod stop;

#[cfg(feature = "threads")]
pub use parallel::{map, run_observed, thread_count, try_map};
#[cfg(feature = "threads")]
pub use pool::Pool;
pub use spawn::{map_indexed, no_thread_error, spawn, spawn_scoped};
pub use stop::{check_stop, run_until};

#[cfg(feature = "threads")]
pub use parallel::join;

/// Runs both closures in sequence and returns both results.
#[cfg(not(feature = "threads"))]
pub fn join<A, B>(one: impl FnOnce() -> A, other: impl FnOnce() -> B) -> (A, B) {
    (one(), other())
}
