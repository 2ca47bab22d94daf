//! Functions that start dedicated threads. If the system cannot start a thread, the caller can do the work in another
//! way.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::{Builder, Scope, ScopedJoinHandle};

use super::stop::{self, RequestScope};
use crate::error::{Error, error};

/// Stack size of a thread in bytes.
///
/// Without optimization, the stack frames of the kernels overflow the usual 2 MiB. The system allocates only pages that
/// are used.
pub(super) const STACK_BYTES: usize = 16 << 20;

/// Starts `work(input)` on a new thread. Returns `input` if the system cannot start a thread.
pub fn spawn<I: Send + 'static>(
    name: &str,
    input: I,
    work: impl FnOnce(I) + Send + 'static,
) -> std::result::Result<(), I> {
    let (give, take) = sync_channel(1);
    match Builder::new().name(name.into()).spawn(move || work(receive_input(&take))) {
        Ok(_) => send_input(&give, input),
        Err(_) => Err(input),
    }
}

/// Starts `work(input)` on a new thread of `scope`. Returns `input` if the system cannot start a thread.
pub fn spawn_scoped<'scope, I: Send + 'scope, T: Send + 'scope>(
    scope: &'scope Scope<'scope, '_>,
    name: &str,
    input: I,
    work: impl FnOnce(I) -> T + Send + 'scope,
) -> std::result::Result<ScopedJoinHandle<'scope, T>, I> {
    let (give, take) = sync_channel(1);
    match Builder::new().name(name.into()).spawn_scoped(scope, move || work(receive_input(&take))) {
        Ok(thread) => send_input(&give, input).map(|()| thread),
        Err(_) => Err(input),
    }
}

/// Calls `work` with each index from 0 to `count - 1`. The calls run on up to `threads` threads, including the calling
/// thread.
///
/// The results are in the order of the arguments.
pub fn map_indexed<T: Send>(threads: usize, count: usize, work: impl Fn(usize) -> T + Sync) -> Vec<T> {
    let threads = threads.min(count);
    let step = |i| {
        stop::check_stop();
        work(i)
    };
    if threads <= 1 {
        return (0..count).map(step).collect();
    }
    let (next, request) = (AtomicUsize::new(0), stop::current_request());
    let take = || {
        let _entered = RequestScope::new(request.clone());
        let mut done = Vec::new();
        loop {
            let i = next.fetch_add(1, Ordering::Relaxed);
            if i >= count {
                return done;
            }
            done.push((i, step(i)));
        }
    };
    let mut done: Vec<(usize, T)> = std::thread::scope(|scope| {
        let builder = || Builder::new().name("work".into()).stack_size(STACK_BYTES);
        let start = |_| builder().spawn_scoped(scope, take).ok();
        let others: Vec<_> = (1..threads).map_while(start).collect();
        let mut done = take();
        for other in others {
            match other.join() {
                Ok(part) => done.extend(part),
                Err(panic) => std::panic::resume_unwind(panic),
            }
        }
        done
    });
    done.sort_unstable_by_key(|(i, _)| *i);
    done.into_iter().map(|(_, t)| t).collect()
}

/// Returns the error for work that requires a separate thread. `work` is a verb phrase that completes "a thread to".
pub fn no_thread_error(work: &str) -> Error {
    error!(Io, "a thread to {work}"; found "the system's limit on threads";
        remedy "raise the limit (ulimit -u; docker run --pids-limit)")
}

/// Sends the input to a thread that has started.
///
/// If a thread does not start, its closure is dropped. The input is therefore not part of the closure: it is sent after
/// the thread has started. If the thread does not start, the caller still has the input.
fn send_input<I>(give: &SyncSender<I>, input: I) -> std::result::Result<(), I> {
    give.send(input).map_err(|e| e.0)
}

fn receive_input<I>(take: &Receiver<I>) -> I {
    take.recv().unwrap_or_else(|_| unreachable!("the input is sent once there is a thread"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn indexed_results_keep_their_order() {
        assert_eq!(map_indexed(3, 100, |i| i * i), (0..100).map(|i| i * i).collect::<Vec<_>>());
    }
}
