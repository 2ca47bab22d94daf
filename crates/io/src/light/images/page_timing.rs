//! The durations of the pages of an animation.

use crate::light::timestamps;
use spikelane::light::Rate;

/// When the pages of a file are shown.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::light) enum PageTiming {
    /// All pages have one duration.
    Uniform(Rate),
    /// Times of the pages in nanoseconds after the first page.
    Times(Vec<u64>),
}

impl PageTiming {
    /// Returns the timing of pages with `durations` in fractions of a second. Returns `None` if a duration is zero.
    pub(super) fn from_durations(durations: &[(u64, u64)]) -> Option<Self> {
        if durations.iter().any(|(num, den)| *num == 0 || *den == 0) {
            return None;
        }
        let mut times = Vec::with_capacity(durations.len());
        let mut time = 0.0;
        for (num, den) in durations {
            times.push(time);
            time += *num as f64 / *den as f64;
        }
        let (num, den) = *durations.first()?;
        let times = timestamps::nanoseconds(&times).ok()?;
        if timestamps::are_uniform(&times) {
            return Rate::new(den, num).ok().map(Self::Uniform);
        }
        Some(Self::Times(times))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_durations_are_a_rate_and_unequal_durations_are_times() {
        let rate = |num, den| Some(PageTiming::Uniform(Rate::new(num, den).unwrap()));
        assert_eq!(PageTiming::from_durations(&[(1001, 30_000); 3]), rate(30_000, 1001));
        assert_eq!(
            PageTiming::from_durations(&[(1, 10), (3, 10), (1, 10)]),
            Some(PageTiming::Times(vec![0, 100_000_000, 400_000_000]))
        );
        assert_eq!(PageTiming::from_durations(&[(1, 10), (0, 10)]), None);
        assert_eq!(PageTiming::from_durations(&[]), None);
    }
}
