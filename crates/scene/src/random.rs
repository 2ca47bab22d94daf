//! Addressed draws: a number is a pure function of seed, purpose and index.
//!
//! Nothing is drawn from a running generator, so that adding a tree never
//! moves a car, and a scene can be built in any order.

use spikelane::unstable::draws::hash::mix64;

/// One purpose's family of draws under one scene seed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Draws {
    key: u64,
}

impl Draws {
    /// The draws of `purpose` under `seed`.
    pub(crate) fn new(seed: u64, purpose: &str) -> Self {
        let name = purpose
            .bytes()
            .fold(0xcbf2_9ce4_8422_2325, |h: u64, b| (h ^ u64::from(b)).wrapping_mul(0x0100_0000_01b3));
        Self { key: mix64(seed.wrapping_add(0x9e37_79b9_7f4a_7c15) ^ mix64(name)) }
    }

    /// The draws of item `index` within this family.
    pub(crate) const fn of(self, index: u64) -> Self {
        Self { key: mix64(self.key ^ mix64(index.wrapping_add(0x9e37_79b9_7f4a_7c15))) }
    }

    /// 64 bits at `index`.
    pub(crate) const fn bits(self, index: u64) -> u64 {
        mix64(self.key.wrapping_add(index.wrapping_mul(0x9e37_79b9_7f4a_7c15)))
    }

    /// Uniform in [0, 1).
    pub(crate) fn unit(self, index: u64) -> f64 {
        (self.bits(index) >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
    }

    /// Uniform in [low, high).
    pub(crate) fn range(self, index: u64, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit(index)
    }

    /// Uniform in [low, high), single precision.
    pub(crate) fn range_f32(self, index: u64, low: f32, high: f32) -> f32 {
        self.range(index, f64::from(low), f64::from(high)) as f32
    }

    /// True with `probability`.
    pub(crate) fn chance(self, index: u64, probability: f64) -> bool {
        self.unit(index) < probability
    }

    /// An index below `count` (which must not be zero).
    pub(crate) fn pick(self, index: u64, count: usize) -> usize {
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
        assert_ne!(a.of(0).bits(0), a.of(1).bits(0));
    }

    #[test]
    fn unit_draws_fill_the_interval_evenly() {
        let a = Draws::new(7, "unit");
        let mean = (0..10_000).map(|i| a.unit(i)).sum::<f64>() / 10_000.0;
        // The mean of 10,000 uniforms has a standard deviation of 0.0029; six of them.
        assert!((mean - 0.5).abs() < 0.018, "mean {mean}");
    }
}
