//! Time measurement on a machine that also runs other programs.

use std::time::{Duration, Instant};

/// Returns units of work per second, measured with the fastest run. It makes at least three runs, and more within `budget`.
///
/// The fastest run is used instead of the mean, because other programs only make a run slower.
pub(crate) fn best_rate(budget: Duration, work: f64, mut run: impl FnMut()) -> f64 {
    let start = Instant::now();
    let (mut best, mut runs) = (f64::MAX, 0);
    while runs < 3 || start.elapsed() < budget {
        let begin = Instant::now();
        run();
        best = best.min(begin.elapsed().as_secs_f64());
        runs += 1;
    }
    work / best
}

/// Returns the bytes per second that one core reads from memory. The data exceed all CPU caches.
pub(crate) fn read_bandwidth(budget: Duration) -> f64 {
    let words = vec![1u64; 32 << 20];
    let bytes = (words.len() * 8) as f64;
    best_rate(budget, bytes, || {
        let mut sums = [0u64; 16];
        for chunk in words.chunks_exact(16) {
            for (sum, word) in sums.iter_mut().zip(chunk) {
                *sum ^= word;
            }
        }
        std::hint::black_box(sums);
    })
}
