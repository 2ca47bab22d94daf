//! A thread pool that a child process starts again after `fork`.

use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::thread::{Builder, JoinHandle};
use std::{fmt, io};

use rayon::iter::{IndexedParallelIterator as _, IntoParallelIterator as _, ParallelIterator as _};
use rayon::{ThreadBuilder, ThreadPool, ThreadPoolBuilder};

use super::spawn::STACK_BYTES;
use super::stop::{with_request, with_stop_check};
use crate::error::{Result, bail};

/// Largest number of threads of a pool.
const MAX_THREADS: usize = 4096;

/// Threads that simulators share. A clone uses the same threads.
///
/// Threads do not survive a `fork`, so a child process starts new threads at the next use. If the system starts fewer
/// threads than requested, work runs on the started threads. If no thread starts, work runs on the calling thread.
///
/// # Examples
/// ```
/// use spikelane::simulate::Pool;
/// use spikelane::{Camera, Sensor, SimulatorOptions};
/// let pool = Pool::new(2)?;
/// let camera = Camera::ideal(Sensor::new(128, 96, 20_000.0)?);
/// // Two simulators share two threads.
/// let options = SimulatorOptions::new().pool(&pool);
/// let (mut left, mut right) = (options.build(&camera)?, options.build(&camera)?);
/// assert_eq!(left.run(&[40u8; 128 * 96], 20)?, right.run(&[40u8; 128 * 96], 20)?);
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone)]
pub struct Pool {
    threads: usize,
    process_threads: Arc<Mutex<Option<ProcessThreads>>>,
}

/// The threads of one process.
struct ProcessThreads {
    process: u32,
    threads: Option<Arc<ThreadPool>>,
}

impl Drop for ProcessThreads {
    fn drop(&mut self) {
        // A child process has no threads of its parent, and locks of these threads stay locked forever. Ending the pool
        // could therefore block, so the pool is leaked instead.
        if self.process != std::process::id() {
            std::mem::forget(self.threads.take());
        }
    }
}

impl Pool {
    /// Returns a pool of `threads` threads. The threads start when the pool is first used. With 0 or 1, the calling
    /// thread does the work.
    ///
    /// # Examples
    /// ```
    /// use spikelane::simulate::Pool;
    /// assert_eq!(Pool::new(4)?.threads(), 4);
    /// let error = Pool::new(5000).unwrap_err();
    /// assert_eq!(error.to_string(), "threads: found 5000, expected at most 4096; use the number of cores");
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns [`ErrorKind::Usage`](crate::ErrorKind::Usage) if `threads` exceeds 4096.
    pub fn new(threads: usize) -> Result<Self> {
        if threads > MAX_THREADS {
            bail!(Usage, "threads"; found "{threads}"; expected "at most {MAX_THREADS}";
                remedy "use the number of cores");
        }
        Ok(Self::with_threads(threads.max(1)))
    }

    fn with_threads(threads: usize) -> Self {
        Self { threads, process_threads: Arc::default() }
    }

    /// Returns the pool for the parallel work of the library itself.
    ///
    /// The environment variable `RAYON_NUM_THREADS` sets the number of threads. Without the variable, the pool has one
    /// thread per CPU.
    pub(super) fn global() -> &'static Self {
        static POOL: OnceLock<Pool> = OnceLock::new();
        if let Some(pool) = POOL.get() {
            return pool;
        }
        let named = std::env::var("RAYON_NUM_THREADS").ok().and_then(|n| n.parse().ok());
        let cpus = || std::thread::available_parallelism().map_or(1, usize::from);
        let pool = Self::with_threads(named.filter(|n| *n > 0).unwrap_or_else(cpus).min(MAX_THREADS));
        POOL.get_or_init(|| pool)
    }

    /// Returns the number of threads that the pool was created for.
    #[must_use]
    pub fn threads(&self) -> usize {
        self.threads
    }

    /// Calls `work` with each item, in parallel.
    ///
    /// # Examples
    /// ```
    /// use std::sync::atomic::{AtomicU64, Ordering};
    /// let sum = AtomicU64::new(0);
    /// spikelane::simulate::Pool::new(2)?.for_each((1..=100).collect(), |n| {
    ///     sum.fetch_add(n, Ordering::Relaxed);
    /// });
    /// assert_eq!(sum.into_inner(), 5050);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    pub fn for_each<I: Send>(&self, items: Vec<I>, work: impl Fn(I) + Sync + Send) {
        if self.threads == 1 {
            return items.into_iter().for_each(work);
        }
        self.run(|| items.into_par_iter().with_max_len(1).for_each(with_stop_check(work)));
    }

    /// Runs `work` on this pool. Functions of rayon that `work` calls then use the threads of this pool.
    pub(super) fn run<T: Send>(&self, work: impl FnOnce() -> T + Send) -> T {
        match self.thread_pool() {
            Some(pool) => pool.install(with_request(work)),
            None => work(),
        }
    }

    /// Returns the threads of this process. They start at the first use.
    ///
    /// If no thread starts, the calling thread becomes a pool of one thread, and the result is `None`.
    pub(super) fn thread_pool(&self) -> Option<Arc<ThreadPool>> {
        let process = std::process::id();
        let known = |slot: &Option<ProcessThreads>| {
            slot.as_ref().filter(|cached| cached.process == process).and_then(|cached| cached.threads.clone())
        };
        if let Some(pool) = known(&self.lock()) {
            return Some(pool);
        }
        // The lock is released while threads start. Otherwise, a concurrent `fork` would copy a locked lock to the
        // child.
        let Some(pool) = start(self.threads, spawn) else {
            use_current_thread();
            return None;
        };
        let mut slot = self.lock();
        if let Some(earlier) = known(&slot) {
            return Some(earlier);
        }
        let pool = Arc::new(pool);
        *slot = Some(ProcessThreads { process, threads: Some(Arc::clone(&pool)) });
        Some(pool)
    }

    fn lock(&self) -> MutexGuard<'_, Option<ProcessThreads>> {
        self.process_threads.lock().unwrap_or_else(PoisonError::into_inner)
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

/// Starts as many threads as `spawn` can start, at most `wanted`.
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
        // rayon has already requested the end of the started threads. The system can start other threads only after
        // these threads exit.
        wanted = started.len().min(wanted - 1);
        started.into_iter().for_each(|thread| drop(thread.join()));
    }
    None
}

/// Makes the calling thread the only thread of a pool until this thread ends.
fn use_current_thread() {
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
    use crate::ErrorKind;

    /// Returns a function that starts threads. It fails while `limit` threads run, like a system with this limit.
    fn limited_spawner(limit: usize) -> impl Fn(ThreadBuilder) -> io::Result<JoinHandle<()>> {
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
        let threads = |limit| start(4, limited_spawner(limit)).map(|pool| pool.current_num_threads());
        assert_eq!([9, 4, 3, 1, 0].map(threads), [Some(4), Some(4), Some(3), Some(1), None]);
    }

    #[test]
    fn a_thread_without_others_does_the_work_alone() {
        let sum = std::thread::spawn(|| {
            use_current_thread();
            let caller = std::thread::current().id();
            (0..100).into_par_iter().map(|i| (i, std::thread::current().id() == caller)).collect::<Vec<_>>()
        });
        assert_eq!(sum.join().unwrap(), (0..100).map(|i| (i, true)).collect::<Vec<_>>());
    }

    #[test]
    fn more_threads_than_a_pool_may_have_are_refused() {
        assert_eq!(Pool::new(MAX_THREADS + 1).unwrap_err().kind(), ErrorKind::Usage);
        assert_eq!(Pool::new(MAX_THREADS).unwrap().threads(), MAX_THREADS);
        assert_eq!(Pool::new(0).unwrap().threads(), 1);
    }
}
