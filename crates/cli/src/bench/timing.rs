//! How long things take on a machine that does other things too.

use std::time::{Duration, Instant};

/// Units of work per second: the best of at least three runs within `budget`.
///
/// The best, not the mean: everything that disturbs a run makes it longer.
pub(crate) fn rate(budget: Duration, work: f64, mut run: impl FnMut()) -> f64 {
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

/// Bytes per second that one core reads from memory beyond every cache.
pub(crate) fn read_bandwidth(budget: Duration) -> f64 {
    let words = vec![1u64; 32 << 20];
    let bytes = (words.len() * 8) as f64;
    rate(budget, bytes, || {
        let mut sums = [0u64; 16];
        for chunk in words.chunks_exact(16) {
            for (sum, word) in sums.iter_mut().zip(chunk) {
                *sum ^= word;
            }
        }
        std::hint::black_box(sums);
    })
}
