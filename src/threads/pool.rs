//! A thread pool that a child process makes anew.

use std::fmt;
use std::io;
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::thread::{Builder, JoinHandle};

use rayon::iter::{IndexedParallelIterator as _, IntoParallelIterator as _, ParallelIterator as _};
use rayon::{ThreadBuilder, ThreadPool, ThreadPoolBuilder};

use super::spawn::STACK_BYTES;
use super::stop::{checked, entered};
use crate::error::{Error, Kind, Result};

/// The most threads of a pool.
const MAX_THREADS: usize = 4096;

/// Threads that simulators share. A clone has the same threads.
///
/// Threads do not survive a `fork`: a child process makes its own at the next use. Where the system has fewer threads left
/// than the pool is for, work runs on those, at last on the calling thread.
#[derive(Clone)]
pub struct Pool {
    threads: usize,
    made: Arc<Mutex<Option<Made>>>,
}

/// The threads of one process.
struct Made {
    process: u32,
    threads: Option<Arc<ThreadPool>>,
}

impl Drop for Made {
    fn drop(&mut self) {
        // A child process cannot end the parent's threads, and a lock of theirs may be held for good.
        if self.process != std::process::id() {
            std::mem::forget(self.threads.take());
        }
    }
}

impl Pool {
    /// A pool for `threads` threads, which start at the first use. For 0 and 1 the caller's thread does the work.
    ///
    /// # Errors
    /// When `threads` exceeds 4096.
    pub fn new(threads: usize) -> Result<Self> {
        if threads > MAX_THREADS {
            return Err(Error::new(Kind::Usage, "threads")
                .found(threads)
                .expected(format_args!("at most {MAX_THREADS}"))
                .remedy("give the number of cores"));
        }
        Ok(Self::of(threads.max(1)))
    }

    fn of(threads: usize) -> Self {
        Self { threads, made: Arc::default() }
    }

    /// The pool that the library's own parallel work uses: a thread for each CPU, or as many as `RAYON_NUM_THREADS` says.
    pub(super) fn of_process() -> &'static Self {
        static POOL: OnceLock<Pool> = OnceLock::new();
        if let Some(pool) = POOL.get() {
            return pool;
        }
        let named = std::env::var("RAYON_NUM_THREADS").ok().and_then(|n| n.parse().ok());
        let cpus = || std::thread::available_parallelism().map_or(1, usize::from);
        let pool = Self::of(named.filter(|n| *n > 0).unwrap_or_else(cpus).min(MAX_THREADS));
        POOL.get_or_init(|| pool)
    }

    /// The number of threads that the pool is for.
    #[must_use]
    pub fn threads(&self) -> usize {
        self.threads
    }

    /// Calls `work` with each item, in parallel.
    pub fn for_each<I: Send>(&self, items: Vec<I>, work: impl Fn(I) + Sync + Send) {
        if self.threads == 1 {
            return items.into_iter().for_each(work);
        }
        self.run(|| items.into_par_iter().with_max_len(1).for_each(checked(work)));
    }

    /// Runs `work` with this pool as the one that rayon's functions use.
    pub(super) fn run<T: Send>(&self, work: impl FnOnce() -> T + Send) -> T {
        match self.started() {
            Some(pool) => pool.install(entered(work)),
            None => work(),
        }
    }

    /// The threads of this process. Without any, the calling thread becomes a pool of its own.
    pub(super) fn started(&self) -> Option<Arc<ThreadPool>> {
        let process = std::process::id();
        let known = |slot: &Option<Made>| {
            slot.as_ref().filter(|made| made.process == process).and_then(|made| made.threads.clone())
        };
        if let Some(pool) = known(&self.lock()) {
            return Some(pool);
        }
        // Not under the lock: a fork meanwhile would leave it locked in the child.
        let Some(pool) = start(self.threads, spawn) else {
            alone();
            return None;
        };
        let mut slot = self.lock();
        if let Some(earlier) = known(&slot) {
            return Some(earlier);
        }
        let pool = Arc::new(pool);
        *slot = Some(Made { process, threads: Some(Arc::clone(&pool)) });
        Some(pool)
    }

    fn lock(&self) -> MutexGuard<'_, Option<Made>> {
        self.made.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl fmt::Debug for Pool {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Pool").field("threads", &self.threads).finish_non_exhaustive()
    }
}

/// Starts one thread of a pool.
fn spawn(thread: ThreadBuilder) -> io::Result<JoinHandle<()>> {
    Builder::new().name("work".into()).stack_size(STACK_BYTES).spawn(|| thread.run())
}

/// As many threads as `spawn` starts, up to `wanted`.
fn start(
    mut wanted: usize,
    spawn: impl Fn(ThreadBuilder) -> io::Result<JoinHandle<()>>,
) -> Option<ThreadPool> {
    while wanted > 0 {
        let mut started = Vec::new();
        let built = ThreadPoolBuilder::new()
            .num_threads(wanted)
            .spawn_handler(|thread| {
                started.push(spawn(thread)?);
                Ok(())
            })
            .build();
        if let Ok(pool) = built {
            return Some(pool);
        }
        // Those that started have been told to end. The next try needs their places.
        wanted = started.len().min(wanted - 1);
        started.into_iter().for_each(|thread| drop(thread.join()));
    }
    None
}

/// Makes this thread the only one of a pool, for as long as it lives.
fn alone() {
    if rayon::current_thread_index().is_none()
        && let Ok(pool) = ThreadPoolBuilder::new().num_threads(1).use_current_thread().build()
    {
        std::mem::forget(pool);
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::*;

    /// A system that starts `limit` threads at a time.
    fn limited(limit: usize) -> impl Fn(ThreadBuilder) -> io::Result<JoinHandle<()>> {
        let running = Arc::new(AtomicUsize::new(0));
        move |thread| {
            if running.fetch_add(1, Ordering::SeqCst) >= limit {
                running.fetch_sub(1, Ordering::SeqCst);
                return Err(io::ErrorKind::WouldBlock.into());
            }
            let running = Arc::clone(&running);
            Ok(std::thread::spawn(move || {
                thread.run();
                running.fetch_sub(1, Ordering::SeqCst);
            }))
        }
    }

    #[test]
    fn a_pool_has_as_many_threads_as_the_system() {
        let threads = |limit| start(4, limited(limit)).map(|pool| pool.current_num_threads());
        assert_eq!([9, 4, 3, 1, 0].map(threads), [Some(4), Some(4), Some(3), Some(1), None]);
    }

    #[test]
    fn a_thread_without_others_does_the_work_alone() {
        let sum = std::thread::spawn(|| {
            alone();
            let own = std::thread::current().id();
            (0..100).into_par_iter().map(|i| (i, std::thread::current().id() == own)).collect::<Vec<_>>()
        });
        assert_eq!(sum.join().unwrap(), (0..100).map(|i| (i, true)).collect::<Vec<_>>());
    }

    #[test]
    fn more_threads_than_a_pool_may_have_are_refused() {
        assert_eq!(Pool::new(MAX_THREADS + 1).unwrap_err().kind(), Kind::Usage);
        assert_eq!(Pool::new(MAX_THREADS).unwrap().threads(), MAX_THREADS);
        assert_eq!(Pool::new(0).unwrap().threads(), 1);
    }
}
