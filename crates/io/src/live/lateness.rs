//! The delays of delivered readouts.

use std::time::Duration;

use hdrhistogram::Histogram;

/// The longest delay that the histogram resolves, which is one day in microseconds.
const MAX_DELAY_US: u64 = 24 * 3600 * 1_000_000;

/// A histogram of delays in microseconds. Memory use does not depend on the number of delays.
///
/// Delays below 256 us are exact. Larger delays are in buckets whose width is at most 1/128 of the delay. All delays
/// longer than a day are in the last bucket, but [`max`](Self::max) is exact.
#[derive(Clone, Debug, PartialEq)]
pub struct Lateness {
    delays: Histogram<u64>,
    max: Duration,
}

impl Default for Lateness {
    fn default() -> Self {
        let delays = Histogram::new_with_max(MAX_DELAY_US, 2).expect("constants in range");
        Self { delays, max: Duration::ZERO }
    }
}

impl Lateness {
    /// Records the delay of one readout.
    pub fn record(&mut self, late: Duration) {
        let us = u64::try_from(late.as_micros()).unwrap_or(u64::MAX);
        self.delays.saturating_record(us);
        self.max = self.max.max(Duration::from_micros(us));
    }

    /// Returns the number of recorded delays.
    #[must_use]
    pub fn count(&self) -> u64 {
        self.delays.len()
    }

    /// Returns the smallest delay `d` such that at least the fraction `quantile` (0 to 1) of all delays is at most
    /// `d`.
    ///
    /// The returned delay exceeds the exact quantile by at most 1/128 of the quantile. If no delay was recorded, the
    /// returned delay is zero.
    #[must_use]
    pub fn quantile(&self, quantile: f64) -> Duration {
        Duration::from_micros(self.delays.value_at_quantile(quantile)).min(self.max)
    }

    /// Returns the longest delay, in whole microseconds.
    #[must_use]
    pub const fn max(&self) -> Duration {
        self.max
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_of_known_delays() {
        let mut lateness = Lateness::default();
        assert_eq!(lateness.quantile(0.5), Duration::ZERO);
        (1..=1000).for_each(|us| lateness.record(Duration::from_micros(us)));
        for (quantile, exact) in [(0.1, 100), (0.5, 500), (0.99, 990), (0.999, 999)] {
            let estimate = lateness.quantile(quantile).as_micros();
            assert!((exact..=exact + exact / 128).contains(&estimate), "{quantile}: {estimate}");
        }
        assert_eq!(lateness.quantile(1.0), Duration::from_micros(1000));
        assert_eq!((lateness.max(), lateness.count()), (Duration::from_micros(1000), 1000));
    }

    #[test]
    fn a_quantile_is_a_128th_above_its_delay_at_most() {
        for us in (0..5000).chain((13..36).map(|k| (1 << k) + 12345)) {
            let mut lateness = Lateness::default();
            [us, 2 * us + 1].iter().for_each(|us| lateness.record(Duration::from_micros(*us)));
            let estimate = lateness.quantile(0.5).as_micros() as u64;
            assert!((us..=us + us / 128).contains(&estimate), "{us}: {estimate}");
        }
    }

    #[test]
    fn delays_beyond_a_day_keep_their_maximum() {
        let mut lateness = Lateness::default();
        let delays = [Duration::from_secs(1), Duration::from_secs(200_000), Duration::MAX];
        delays.into_iter().for_each(|late| lateness.record(late));
        assert_eq!(lateness.max(), Duration::from_micros(u64::MAX));
        assert!(lateness.quantile(0.5) >= Duration::from_secs(86_400));
    }
}
