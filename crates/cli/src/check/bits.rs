//! Compares two streams bit by bit.

use serde_json::json;
use spikelane::SpikeFrames;
use spikelane::unstable::Count;
use spikelane::unstable::plan::ErrorBounds;

use super::{Conclusion, Peer, Verdict};

/// Half of the distance between 1 and the next `f32`, and between 1 and the next `f64`.
const F32_ROUNDING: f64 = 1.0 / 16_777_216.0;
const F64_ROUNDING: f64 = 1.0 / 9_007_199_254_740_992.0;

/// The differences that do not contradict equality.
pub(super) enum Tolerance {
    /// Rounding moves spikes. The number is the largest number of differing bits.
    Rounding(f64),
    /// The charge of these pixels equals the threshold at some readout. In all other pixels, the spikes are equal.
    Ties(Vec<bool>),
}

/// Rounding errors of both simulators.
pub(super) struct Exactness {
    /// Error of the charge per readout, relative to this charge.
    relative: f64,
    /// Error of the charge per readout, in thresholds.
    absolute: f64,
}

impl Exactness {
    pub(super) fn new(peer: Peer, bounds: &ErrorBounds) -> Self {
        // Spike-Zoo divides gray codes by 255 in single precision. The other codes compute in double precision.
        let rounding = if peer == Peer::Spikezoo { F32_ROUNDING } else { F64_ROUNDING };
        Self { relative: rounding + bounds.rate_relative, absolute: bounds.rate_absolute }
    }

    /// Returns the largest number of differing bits that rounding explains.
    ///
    /// A spike moves to the next readout if the charge is closer to the threshold than its error. The start charges are
    /// uniform. In each readout, the expected number of such pixels is therefore at most the sum of their errors, in
    /// thresholds. The error of a charge grows with the charge added so far. The start charge is rounded to twice the
    /// absolute error of a readout. A moved spike changes two bits. The number of moved spikes has a Poisson distribution,
    /// whose values exceed its mean by more than five standard deviations and 5 with a probability below 1e-6.
    ///
    /// `charges` contains the sum of the charges that the pixels receive at each readout, in thresholds.
    pub(super) fn tolerance(&self, pixels: usize, charges: &[f64]) -> Tolerance {
        let (mut added, mut moved) = (0.0, 0.0);
        for (readout, charge) in charges.iter().enumerate() {
            added += charge;
            moved += added * self.relative + pixels as f64 * (readout as f64 + 3.0) * self.absolute;
        }
        Tolerance::Rounding(2.0 * (moved + 5.0 * moved.sqrt() + 5.0).floor())
    }
}

/// Compares the streams of another simulator and of a preset.
pub(super) fn compare(peer: &SpikeFrames, own: &SpikeFrames, tolerance: &Tolerance) -> Verdict {
    let bits = peer.geometry().pixels() * peer.readouts();
    let mut differing = vec![0_usize; peer.geometry().pixels()];
    for (a, b) in peer.iter().zip(own.iter()) {
        for (byte, (a, b)) in a.as_bytes().iter().zip(b.as_bytes()).enumerate() {
            let mut difference = a ^ b;
            while difference != 0 {
                differing[8 * byte + difference.trailing_zeros() as usize] += 1;
                difference &= difference - 1;
            }
        }
    }
    let total: usize = differing.iter().sum();
    let mut details = json!({
        "bits": bits, "differing_bits": total, "code_spikes": peer.spikes(), "preset_spikes": own.spikes(),
    });
    let mut text = format!(
        "spikes: code {}, preset {}\nequal bits: {} of {bits}\n",
        peer.spikes(),
        own.spikes(),
        bits - total
    );
    let accepted = match tolerance {
        Tolerance::Ties(has_tie) => {
            let pixels = has_tie.iter().filter(|has_tie| **has_tie).count();
            let outside = differing.iter().zip(has_tie).filter(|(_, has_tie)| !**has_tie);
            let outside: usize = outside.map(|(bits, _)| *bits).sum();
            details["tie_pixels"] = json!(pixels);
            details["differing_bits_outside_ties"] = json!(outside);
            text += &format!(
                "ties: in {} the charge equals the threshold, and the rounding of floats decides; outside, {} differ\n",
                Count(pixels, "pixel"),
                Count(outside, "bit"),
            );
            (outside == 0).then_some(Conclusion::EqualOutsideTies)
        }
        Tolerance::Rounding(limit) => {
            details["max_differing_bits"] = json!(limit);
            text += &format!("rounding errors of both programs explain at most {limit} differing bits\n");
            (total as f64 <= *limit).then_some(Conclusion::EqualWithinRounding)
        }
    };
    let conclusion = if total == 0 { Conclusion::Equal } else { accepted.unwrap_or(Conclusion::Different) };
    Verdict { conclusion, json: details, text }
}

#[cfg(test)]
mod tests {
    use super::*;
    use spikelane::Geometry;

    fn stream(spikes: &[usize]) -> SpikeFrames {
        let mut dense = vec![0; 8 * 100];
        spikes.iter().for_each(|at| dense[*at] = 1);
        SpikeFrames::from_dense(Geometry::new(8, 1).unwrap(), &dense).unwrap()
    }

    /// Rounding moves at most 5 spikes of a short stream, which change 10 bits.
    #[test]
    fn more_differing_bits_than_rounding_explains_are_a_difference() {
        let exactness = Exactness { relative: 1e-7, absolute: 1e-9 };
        let tolerance = exactness.tolerance(8, &[0.8; 100]);
        let all: Vec<usize> = (0..11).map(|k| 17 * k).collect();
        let judge = |spikes: &[usize]| compare(&stream(spikes), &stream(&[]), &tolerance);
        let conclusion = |spikes: &[usize]| judge(spikes).conclusion;
        assert_eq!(conclusion(&[]), Conclusion::Equal);
        assert_eq!(conclusion(&all[..10]), Conclusion::EqualWithinRounding);
        assert_eq!(conclusion(&all), Conclusion::Different);
        assert_eq!(judge(&all).json["differing_bits"], 11);
    }

    #[test]
    fn a_difference_outside_ties_is_a_difference() {
        let tolerance = Tolerance::Ties([[true; 4], [false; 4]].concat());
        let judge = |spike: usize| compare(&stream(&[spike]), &stream(&[]), &tolerance).conclusion;
        assert_eq!(judge(8 + 3), Conclusion::EqualOutsideTies);
        assert_eq!(judge(8 + 4), Conclusion::Different);
    }
}
