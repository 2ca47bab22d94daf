//! Progress of work that runs on all threads.

use std::sync::atomic::{AtomicUsize, Ordering};

use spikelane::unstable::threads;
use spikelane_calibrate::ProgressCallback;

/// A stage of a diagnosis: its name, its start and its end as shares of the total time, and its number of pieces of
/// work.
pub(crate) struct Stage {
    pub name: &'static str,
    pub from: f64,
    pub to: f64,
    pub pieces: usize,
}

/// Runs `work` and reports its progress to `progress` in the meantime. `work` must count each complete piece.
pub(crate) fn watched<T: Send>(
    stage: &Stage,
    progress: ProgressCallback<'_>,
    work: impl FnOnce(&AtomicUsize) -> T + Send,
) -> T {
    let done = AtomicUsize::new(0);
    let mut told = || {
        let share = done.load(Ordering::Relaxed) as f64 / stage.pieces.max(1) as f64;
        progress(stage.name, stage.from + (stage.to - stage.from) * share.min(1.0));
    };
    told();
    let out = threads::run_observed(&mut told, || work(&done));
    told();
    out
}

/// Counts a complete piece.
pub(crate) fn count(done: &AtomicUsize) {
    done.fetch_add(1, Ordering::Relaxed);
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn work_is_told_of_until_it_is_done() {
        let stage = Stage { name: "null", from: 0.2, to: 0.6, pieces: 8 };
        let mut told = Vec::new();
        let sum: usize = watched(&stage, &mut |name, share| told.push((name.to_owned(), share)), |done| {
            let piece = |i: usize| {
                std::thread::sleep(Duration::from_millis(60));
                count(done);
                i
            };
            threads::map(0..8, piece).into_iter().sum()
        });
        assert_eq!(sum, 28);
        assert_eq!(told.first(), Some(&("null".to_owned(), 0.2)));
        assert_eq!(told.last(), Some(&("null".to_owned(), 0.6)));
        assert!(told.len() > 2 && told.windows(2).all(|w| w[0].1 <= w[1].1), "{told:?}");
    }
}
