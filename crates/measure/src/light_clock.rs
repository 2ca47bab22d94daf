//! A clock that advances with the light.
//!
//! Let `x_p (1 + c_p m(t))` be the charge of pixel `p` at readout `t`. `m` is the relative change of the light that all
//! pixels share, and `c_p` is the share of the change that reaches the pixel. The time `t + c_p M(t)`, where `M` is the
//! integral of `m`, advances in proportion to the charge. Measured by this clock, the pixel receives constant light.
//!
//! A spike of readout `t` occurs when the charge passes the threshold, between the start and the end of the readout. Its
//! time is the middle of the readout.

use spikelane::error::{Error, ErrorKind, Result};

/// Largest number of ticks per readout. Rounding to ticks adds a variance of `2 / 12 / 256^2` readouts squared to a span,
/// which is 1.5e-5 of the variance of rounding to readouts.
const MAX_TICKS: u32 = 256;

/// A clock that advances with the light. See [`LightClock::new`].
#[derive(Clone, Debug)]
pub struct LightClock {
    /// Integral of the relative change up to the middle of each readout, in readouts.
    integral: Vec<f32>,
    /// Share of the change that reaches each pixel.
    shares: Vec<f32>,
    ticks: u32,
}

impl LightClock {
    /// Creates a clock.
    ///
    /// `changes` contains the relative change of the light at each readout, -1 or more. `shares` contains, for each pixel,
    /// the ratio of the change of its charge per readout to the change of the light. Dark current reduces this ratio.
    ///
    /// # Examples
    /// ```
    /// use spikelane_measure::LightClock;
    /// let clock = LightClock::new(&[0.5, -0.5], vec![1.0, 0.0])?;
    /// // Pixel 0 has received 1.5 times the mean light of a readout, and half of the light of the second readout.
    /// assert_eq!(clock.time(0, 1), 1.75);
    /// assert_eq!(clock.time(1, 1), 1.5);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`ErrorKind::Usage`] if a number is not finite, or if `changes` is longer than 2^28.
    pub fn new(changes: &[f64], shares: Vec<f32>) -> Result<Self> {
        if changes.len() > super::MAX_READOUTS as usize {
            return Err(Error::new(ErrorKind::Usage, "readouts of a light clock")
                .found(changes.len())
                .expected(format_args!("at most {}", super::MAX_READOUTS)));
        }
        if !(changes.iter().all(|m| m.is_finite()) && shares.iter().all(|c| c.is_finite())) {
            return Err(Error::new(ErrorKind::Usage, "light clock").found("a number that is not finite"));
        }
        let mut sum = 0.0;
        let middle = |m: &f64| {
            sum += m;
            (sum - 0.5 * m) as f32
        };
        let integral = changes.iter().map(middle).collect();
        // The times of all readouts must fit into 31 bits.
        let mut ticks = MAX_TICKS;
        while ticks as usize * (changes.len() + 1) > 1 << 30 && ticks > 1 {
            ticks /= 2;
        }
        Ok(Self { integral, shares, ticks })
    }

    /// Number of readouts.
    #[must_use]
    pub fn readouts(&self) -> usize {
        self.integral.len()
    }

    /// Number of pixels.
    #[must_use]
    pub fn pixels(&self) -> usize {
        self.shares.len()
    }

    /// Number of ticks per readout of mean light.
    #[must_use]
    pub fn ticks(&self) -> f64 {
        f64::from(self.ticks)
    }

    /// Returns the time of a spike of `pixel` at `readout`, in readouts of mean light.
    ///
    /// # Panics
    /// If the clock has no such pixel or readout.
    #[must_use]
    pub fn time(&self, pixel: usize, readout: u32) -> f64 {
        let change = f64::from(self.shares[pixel]) * f64::from(self.integral[readout as usize]);
        f64::from(readout) + 0.5 + change
    }

    /// Replaces the readouts `times[known..]` of the spikes of `pixel` by times in ticks. The preceding entries are the times
    /// of earlier spikes.
    pub(crate) fn convert(&self, pixel: usize, times: &mut [u32], known: usize) {
        // Light is not negative, but the estimate of a change can be below -1. Times never decrease.
        let mut last = known.checked_sub(1).map_or(0, |i| times[i]);
        for time in &mut times[known..] {
            last = last.max((self.time(pixel, *time) * self.ticks()).round() as u32);
            *time = last;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A pixel with the mean charge `x` and the share `c` of a change integrates exactly one threshold between two spikes. By the
    /// clock, each spike is within one readout of a multiple of `1 / x`.
    #[test]
    fn spikes_of_changing_light_are_regular_by_the_clock() {
        let change = |t: usize| 0.5 * (t as f64 / 30.0).sin();
        let changes: Vec<f64> = (0..4000).map(change).collect();
        for (x, share) in [(0.1, 1.0), (0.03, 0.8), (0.3, 0.0)] {
            let clock = LightClock::new(&changes, vec![share as f32]).unwrap();
            let mut charge = 0.0;
            let mut spikes = Vec::new();
            for (t, m) in changes.iter().enumerate() {
                charge += x * (1.0 + share * m);
                if charge >= 1.0 {
                    charge -= 1.0;
                    spikes.push(clock.time(0, t as u32));
                }
            }
            // The middle of a readout is at most half of the largest charge from the crossing of the threshold.
            for (time, crossed) in spikes.iter().zip(1..) {
                assert!((time - f64::from(crossed) / x).abs() <= 0.76, "{x} {share}: {time} {crossed}");
            }
        }
    }

    #[test]
    fn converted_times_never_decrease() {
        let clock = LightClock::new(&[0.0, -1.0, -1.0, 0.0], vec![1.5]).unwrap();
        let mut times = [0, 1, 2, 3];
        clock.convert(0, &mut times, 0);
        assert!(times.is_sorted(), "{times:?}");
    }
}
