//! Random numbers without a generator state. Each number is a pure function of seed, purpose and index.
//!
//! The random numbers of one object do not depend on other objects. An additional tree, for example, does not change
//! the random numbers of the cars. A scene can be built in any order.

use spikelane::unstable::draws::hash::mix64;

/// The random numbers for one purpose, derived from one scene seed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Draws {
    key: u64,
}

impl Draws {
    /// Returns the random numbers for `purpose`, derived from `seed`.
    pub(crate) fn new(seed: u64, purpose: &str) -> Self {
        let name = purpose
            .bytes()
            .fold(0xcbf2_9ce4_8422_2325, |h: u64, b| (h ^ u64::from(b)).wrapping_mul(0x0100_0000_01b3));
        Self { key: mix64(seed.wrapping_add(0x9e37_79b9_7f4a_7c15) ^ mix64(name)) }
    }

    /// Returns the random numbers of item `index` within these random numbers.
    pub(crate) const fn item(self, index: u64) -> Self {
        Self { key: mix64(self.key ^ mix64(index.wrapping_add(0x9e37_79b9_7f4a_7c15))) }
    }

    /// Returns the 64 random bits with the address `index`.
    pub(crate) const fn bits(self, index: u64) -> u64 {
        mix64(self.key.wrapping_add(index.wrapping_mul(0x9e37_79b9_7f4a_7c15)))
    }

    /// Returns a uniform random number in [0, 1).
    pub(crate) fn unit(self, index: u64) -> f64 {
        (self.bits(index) >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
    }

    /// Returns a uniform random number in [low, high).
    pub(crate) fn range(self, index: u64, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit(index)
    }

    /// Returns a uniform random number in [low, high) in single precision.
    pub(crate) fn range_f32(self, index: u64, low: f32, high: f32) -> f32 {
        self.range(index, f64::from(low), f64::from(high)) as f32
    }

    /// Returns true with probability `probability`.
    pub(crate) fn chance(self, index: u64, probability: f64) -> bool {
        self.unit(index) < probability
    }

    /// Returns a uniform random integer from 0 to `count` - 1. `count` must not be zero.
    pub(crate) fn index_below(self, index: u64, count: usize) -> usize {
        ((self.unit(index) * count as f64) as usize).min(count - 1)
    }
}

#[cfg(test)]
mod tests {
    use super::Draws;

    #[test]
    fn purposes_and_indices_draw_apart() {
        let a = Draws::new(1, "trees");
        assert_ne!(a.bits(0), Draws::new(1, "cars").bits(0));
        assert_ne!(a.bits(0), Draws::new(2, "trees").bits(0));
        assert_ne!(a.bits(0), a.bits(1));
        assert_ne!(a.item(0).bits(0), a.item(1).bits(0));
    }

    #[test]
    fn unit_draws_fill_the_interval_evenly() {
        let a = Draws::new(7, "unit");
        let mean = (0..10_000).map(|i| a.unit(i)).sum::<f64>() / 10_000.0;
        // The mean of 10,000 uniform random numbers has a standard deviation of 0.0029. The tolerance is six standard
        // deviations.
        assert!((mean - 0.5).abs() < 0.018, "mean {mean}");
    }
}
