//! Threads of their own, where the system has one left.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::{Builder, Scope, ScopedJoinHandle};

use super::stop::{self, Entered};
use crate::error::{Error, Kind};

/// Stack of a thread in bytes. Without optimization the kernels' frames overflow the usual 2 MiB. Only the pages that are
/// used take memory.
pub(super) const STACK_BYTES: usize = 16 << 20;

/// Starts `work(input)` on a new thread. Returns `input` if the system has no thread left.
pub fn spawn<I: Send + 'static>(
    name: &str,
    input: I,
    work: impl FnOnce(I) + Send + 'static,
) -> std::result::Result<(), I> {
    let (give, take) = sync_channel(1);
    match Builder::new().name(name.into()).spawn(move || work(received(&take))) {
        Ok(_) => sent(&give, input),
        Err(_) => Err(input),
    }
}

/// Starts `work(input)` on a new thread of `scope`. Returns `input` if the system has no thread left.
pub fn spawn_scoped<'scope, I: Send + 'scope, T: Send + 'scope>(
    scope: &'scope Scope<'scope, '_>,
    name: &str,
    input: I,
    work: impl FnOnce(I) -> T + Send + 'scope,
) -> std::result::Result<ScopedJoinHandle<'scope, T>, I> {
    let (give, take) = sync_channel(1);
    match Builder::new().name(name.into()).spawn_scoped(scope, move || work(received(&take))) {
        Ok(thread) => sent(&give, input).map(|()| thread),
        Err(_) => Err(input),
    }
}

/// Calls `work` with 0 to `count - 1` on up to `threads` threads, this one among them, and returns the results in the order of
/// their indices.
pub fn indexed<T: Send>(threads: usize, count: usize, work: impl Fn(usize) -> T + Sync) -> Vec<T> {
    let threads = threads.min(count);
    let step = |i| {
        stop::check();
        work(i)
    };
    if threads <= 1 {
        return (0..count).map(step).collect();
    }
    let (next, request) = (AtomicUsize::new(0), stop::current());
    let take = || {
        let _entered = Entered::new(request.clone());
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

/// The error of work that cannot do without a thread of its own; `work` completes "a thread to".
pub fn no_thread(work: &str) -> Error {
    Error::new(Kind::Io, format_args!("a thread to {work}"))
        .found("the system's limit on threads")
        .remedy("raise the limit (ulimit -u; docker run --pids-limit)")
}

/// A closure that no thread runs is lost, and its input with it. So the input follows once there is a thread.
fn sent<I>(give: &SyncSender<I>, input: I) -> std::result::Result<(), I> {
    give.send(input).map_err(|e| e.0)
}

fn received<I>(take: &Receiver<I>) -> I {
    take.recv().unwrap_or_else(|_| unreachable!("the input is sent once there is a thread"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn indexed_results_keep_their_order() {
        assert_eq!(indexed(3, 100, |i| i * i), (0..100).map(|i| i * i).collect::<Vec<_>>());
    }
}
