//! The intervals of one pixel.

use super::pixel::LAGS;
use super::pixel::PixelScan;
use spikelane::unstable::kernels::{BitOps, Positions};

/// Longest interval with a mask of its own in bright light.
const LONGEST: usize = 8;

/// Places that are widened together.
const SIXTEEN: usize = 16;

/// Words that are taken side by side.
const WIDE: usize = 8;

/// The readouts of all `count` spikes of a pixel, in `all`; `places` is for those of a word.
#[inline(always)]
pub(in crate::diagnose) fn times<'a, B: BitOps>(
    b: B,
    words: &[u64],
    count: usize,
    places: &mut Positions,
    all: &'a mut Vec<u32>,
) -> &'a [u32] {
    // What is left over of the last sixteen places is clobbered.
    if all.len() < count + SIXTEEN {
        all.resize(count + SIXTEEN, 0);
    }
    let (mut at, mut base) = (0, 0);
    for word in words {
        let end = at + b.positions(*word, 0, places, 0);
        for sixteen in places.as_chunks::<SIXTEEN>().0 {
            if at >= end {
                break;
            }
            for (time, place) in all[at..at + SIXTEEN].iter_mut().zip(sixteen) {
                *time = base + *place as u32;
            }
            at += SIXTEEN;
        }
        (at, base) = (end, base + 64);
    }
    &all[..count]
}

/// Sum of the squared distances of `lag` intervals from `expected`, none taken as wider than `widest`.
#[inline(always)]
fn squares(ends: &[u32], starts: &[u32], expected: f64, widest: f64) -> f64 {
    let off = |end: u32, start: u32| {
        let off = (f64::from(end - start) - expected).clamp(-widest, widest);
        off * off
    };
    // Eight sums side by side: one would wait for its own last addition.
    let mut sums = [0.0; 8];
    let (wide, rest) = ends.as_chunks::<8>();
    for (e, s) in wide.iter().zip(starts.as_chunks::<8>().0) {
        for i in 0..8 {
            sums[i] += off(e[i], s[i]);
        }
    }
    let mut last = 0.0;
    for (e, s) in rest.iter().zip(&starts[wide.len() * 8..]) {
        last += off(*e, *s);
    }
    sums[0] += last;
    sums.iter().sum()
}

/// Every interval of a dim pixel.
#[inline(always)]
pub(in crate::diagnose) fn intervals(
    times: &[u32],
    mean: f64,
    scan: &mut PixelScan,
    deviations: &mut [[f64; 2]],
) {
    let square = scan.rate * scan.rate;
    // A spike too many or too few must not drown the noise of all others; it is counted below.
    let widest = 3.0 + 0.06 * mean;
    for (k, lag) in LAGS.into_iter().enumerate() {
        let expected = lag as f64 * mean;
        // An integrator without noise: the lag falls on the whole numbers about its mean.
        let part = expected.fract();
        let lattice = part * (1.0 - part);
        let pairs = times.len().saturating_sub(lag);
        let sum = squares(&times[times.len() - pairs..], &times[..pairs], expected, widest);
        scan.variance[k] += square * (sum - pairs as f64 * lattice);
        scan.terms[k] += pairs as f64;
    }
    let (low, high) = (mean.floor() as u32, mean.ceil() as u32);
    let margin = 1 + (0.03 * mean) as u32;
    let (mut past, mut covariance) = ([0.0; 2], [0.0; 2]);
    let (mut shorter, mut longer) = (0, 0);
    for (end, start) in times[1..].iter().zip(times) {
        let length = end - start;
        let off = f64::from(length) - mean;
        let usual = off.clamp(-widest, widest);
        covariance[0] += square * usual * past[0];
        covariance[1] += square * usual * past[1];
        past = [usual, past[0]];
        shorter += u32::from(length + margin < low);
        longer += u32::from(length > high + margin);
        let ends = &mut deviations[*end as usize];
        *ends = [ends[0] + off, ends[1] + 1.0];
    }
    scan.covariance = covariance;
    scan.off_lattice = [shorter, longer];
}

/// Lengths of a bright pixel's intervals by shifted words.
#[inline(always)]
pub(in crate::diagnose) fn bright(words: &[u64], mean: f64, scan: &mut PixelScan) {
    let (low, high) = (mean.floor() as usize, mean.ceil() as usize);
    if high > LONGEST {
        return;
    }
    let (mut shorter, mut within) = ([0; WIDE], [0; WIDE]);
    for w in (0..words.len()).step_by(WIDE) {
        let (open, next) = (wide(words, w), wide(words, w + 1));
        // Where another spike follows after at most so many readouts.
        let mut followed = [0; WIDE];
        for length in 1..=high {
            if length == low {
                for i in 0..WIDE {
                    shorter[i] += u64::from((open[i] & followed[i]).count_ones());
                }
            }
            for i in 0..WIDE {
                followed[i] |= open[i] >> length | next[i] << (64 - length);
            }
        }
        for i in 0..WIDE {
            within[i] += u64::from((open[i] & followed[i]).count_ones());
        }
    }
    let sum = |sums: [u64; WIDE]| sums.iter().sum::<u64>() as u32;
    scan.off_lattice = [sum(shorter), (scan.count - 1).saturating_sub(sum(within))];
}

/// Words from `w` on, zeros behind the end.
#[inline(always)]
fn wide(words: &[u64], w: usize) -> [u64; WIDE] {
    let words = words.get(w..).unwrap_or(&[]);
    let mut wide = [0; WIDE];
    match words.first_chunk::<WIDE>() {
        Some(whole) => wide = *whole,
        None => wide[..words.len()].copy_from_slice(words),
    }
    wide
}

#[cfg(test)]
mod tests {
    use super::*;
    use spikelane::unstable::kernels::{AnyCpu, I16Lanes, MAX_SPIKES, OVERRUN, Task, dispatch_task};

    struct Both<'a>(&'a [u64], f64);

    impl Task for Both<'_> {
        type Out = (Vec<u32>, [u32; 2]);

        fn run<S: I16Lanes, B: BitOps>(self, _: S, b: B) -> Self::Out {
            let count = self.0.iter().map(|w| w.count_ones()).sum();
            let mut scan = PixelScan { count, ..PixelScan::default() };
            bright(self.0, self.1, &mut scan);
            let (mut places, mut all) = ([0; MAX_SPIKES + OVERRUN], Vec::new());
            (times(b, self.0, count as usize, &mut places, &mut all).to_vec(), scan.off_lattice)
        }
    }

    #[test]
    fn times_and_lengths_are_those_that_a_visit_of_each_bit_finds() {
        let mut state = 1_u64;
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            state >> 32
        };
        for step in 1..=7 {
            let mut words = [0; 21];
            let mut t = next() % step;
            while t < 1300 {
                words[t as usize / 64] |= 1 << (t % 64);
                t += step + next() % 2 + if next() % 20 == 0 { next() % 30 } else { 0 };
            }
            let wanted: Vec<u32> =
                (0..21 * 64).filter(|t| words[*t as usize / 64] >> (t % 64) & 1 != 0).collect();
            let mean = step as f64 + 0.5;
            let lengths = || wanted.windows(2).map(|w| w[1] - w[0]);
            let off = [
                lengths().filter(|n| f64::from(*n) < mean.floor()).count() as u32,
                lengths().filter(|n| f64::from(*n) > mean.ceil()).count() as u32,
            ];
            let wanted = (wanted, off);
            assert_eq!(dispatch_task(Both(&words, mean)), wanted, "this CPU, {step}");
            assert_eq!(Both(&words, mean).run(AnyCpu, AnyCpu), wanted, "{step}");
        }
    }
}
