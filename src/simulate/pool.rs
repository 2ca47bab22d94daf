use std::sync::Arc;

use crate::error::{Error, Kind, Result};

/// Stack of a thread in bytes. Without optimisation, as in a dependant's debug build, the kernels' frames
/// overflow the usual 2 MiB; what is not touched costs nothing.
const STACK: usize = 16 << 20;

/// Threads that simulators share. A clone is the same threads.
///
/// Threads do not survive a `fork`: a child process makes a pool of its own.
#[derive(Clone, Debug)]
pub struct Pool(pub(super) Option<Arc<rayon::ThreadPool>>);

impl Pool {
    /// `threads` threads; none of their own, and the caller's instead, for 0 and 1.
    ///
    /// # Errors
    /// When the system gives no threads.
    pub fn new(threads: usize) -> Result<Self> {
        if threads <= 1 {
            return Ok(Self(None));
        }
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).stack_size(STACK).build();
        let pool = pool.map_err(|e| Error::new(Kind::Io, "threads").found(e))?;
        Ok(Self(Some(Arc::new(pool))))
    }

    /// How many there are.
    #[must_use]
    pub fn threads(&self) -> usize {
        self.0.as_ref().map_or(1, |pool| pool.current_num_threads())
    }
}
