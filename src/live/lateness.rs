//! How late readouts were: a histogram that does not grow.

use std::time::Duration;

/// Bits of a value that are kept: a bucket is at most 1/32 of its value wide.
const KEPT: u32 = 6;

/// Delays in microseconds, counted in buckets of which each is exact below 64 us and at most a 32nd wide above.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Lateness {
    counts: Vec<u64>,
    total: u64,
    max: u64,
}

impl Lateness {
    /// Counts a readout that was `late`.
    pub fn record(&mut self, late: Duration) {
        let us = u64::try_from(late.as_micros()).unwrap_or(u64::MAX);
        let at = bucket(us);
        if self.counts.len() <= at {
            self.counts.resize(at + 1, 0);
        }
        self.counts[at] += 1;
        self.total += 1;
        self.max = self.max.max(us);
    }

    /// How many were counted.
    #[must_use]
    pub const fn total(&self) -> u64 {
        self.total
    }

    /// The smallest delay that at least the share `quantile` (0 to 1) of all stays within, rounded up by at most a 32nd; zero
    /// without any.
    #[must_use]
    pub fn quantile(&self, quantile: f64) -> Duration {
        let wanted = (quantile * self.total as f64).ceil().max(1.0) as u64;
        let mut seen = 0;
        for (at, count) in self.counts.iter().enumerate() {
            seen += count;
            if seen >= wanted {
                return Duration::from_micros(greatest(at).min(self.max));
            }
        }
        self.max()
    }

    /// The greatest delay.
    #[must_use]
    pub const fn max(&self) -> Duration {
        Duration::from_micros(self.max)
    }
}

/// The bucket of a value: the value itself below `2^KEPT`, above its leading bits and how many follow them.
fn bucket(us: u64) -> usize {
    let shift = (u64::BITS - us.leading_zeros()).saturating_sub(KEPT);
    // With its leading bit, a shifted value starts at half of the range.
    ((u64::from(shift) << (KEPT - 1)) + (us >> shift)) as usize
}

/// The greatest value of a bucket.
fn greatest(bucket: usize) -> u64 {
    let (bucket, half) = (bucket as u64, 1u64 << (KEPT - 1));
    let shift = (bucket / half).saturating_sub(1);
    let leading = bucket - shift * half;
    ((leading + 1) << shift).wrapping_sub(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_value_lies_in_a_bucket_whose_greatest_is_a_32nd_away_at_most() {
        let mut last = 0;
        for us in (0..5000).chain((13..63).map(|k| (1u64 << k) + 12345)) {
            let (at, top) = (bucket(us), greatest(bucket(us)));
            assert!(top >= us && top - us <= us / 32, "{us}: {top}");
            assert!(at >= last, "{us}");
            assert!(at == 0 || greatest(at - 1) < us, "{us}");
            last = at;
        }
    }

    #[test]
    fn quantiles_of_known_delays() {
        let mut lateness = Lateness::default();
        assert_eq!(lateness.quantile(0.5), Duration::ZERO);
        (1..=1000).for_each(|us| lateness.record(Duration::from_micros(us)));
        for (quantile, exact) in [(0.5, 500), (0.99, 990), (0.999, 999)] {
            let found = lateness.quantile(quantile).as_micros();
            assert!((exact..=exact + exact / 32).contains(&found), "{quantile}: {found}");
        }
        assert_eq!(lateness.quantile(1.0), Duration::from_micros(1000));
        assert_eq!((lateness.max(), lateness.total()), (Duration::from_micros(1000), 1000));
    }
}
