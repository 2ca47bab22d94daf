//! Parallel work, and requests to stop it.
//!
//! All parallel work of the library goes through this module: `map` and `join` run it in a thread pool that belongs to
//! this process alone. A child process of `fork` has none of its parent's threads, so it makes a pool anew. Where the
//! system limits threads, work runs on as many as there are, at last on the calling thread.
//!
//! [`until`] stops work early. The work calls `check`, which does not return once a stop is requested: it unwinds to
//! [`until`], and values on the way are dropped as after an error. `map` checks before each item.

#[cfg(feature = "threads")]
mod parallel;
#[cfg(feature = "threads")]
mod pool;
mod spawn;
mod stop;

#[cfg(feature = "threads")]
pub use parallel::{count, map, run_observed, try_map};
#[cfg(feature = "threads")]
pub use pool::Pool;
pub use spawn::{indexed, no_thread, spawn, spawn_scoped};
pub use stop::check;
pub use stop::until;

/// Runs both, in parallel where threads are enabled, and returns both results.
#[cfg(feature = "threads")]
pub use parallel::join;

/// Runs both, one after the other, and returns both results.
#[cfg(not(feature = "threads"))]
pub fn join<A, B>(one: impl FnOnce() -> A, other: impl FnOnce() -> B) -> (A, B) {
    (one(), other())
}
