//! Upper limits for the strengths of effects that a diagnosis did not find.
//!
//! `s` is the signature of an effect at a tried amplitude, and `a` is the true amplitude in units of the tried one.
//! The deviation of the statistics from the final model is `r = a s` plus noise. `P` is the dual metric of the
//! final model: it weights with the inverse noise, and it removes the base parameters, the lamps and the found
//! effects. The estimate of `a` is `s^T P r / s^T P s`. Its standard deviation is `1 / sqrt(s^T P s)`. The limit is
//! the estimate, but at least zero, plus 1.645 standard deviations.

use crate::events::locations::Events;
use crate::null_model::metric::Metric;
use crate::null_model::model::NullModel;
use crate::null_model::signature::{AmplitudeEstimate, Signature};
use crate::sensors::model::Knob;
use crate::thresholds::{
    MAX_LINEAR_EXPONENT, MIN_CERTAIN_LENGTH, MIN_INTERPOLATED_SHARE, NORMAL_QUANTILE_95,
};
use nalgebra::DVector;
use spikelane::effects::Definition;
use spikelane::effects::definition::SearchScale;
use spikelane::error::Result;
use spikelane::unstable::threads;

/// The largest strength of an effect that is compatible with the recordings.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
#[non_exhaustive]
pub struct EffectLimit {
    /// Canonical name of the effect.
    pub name: &'static str,
    /// Key of the parameter that is the strength of the effect.
    pub parameter: &'static str,
    /// Upper limit of the strength with 95 % confidence. It is the difference from the value of the model, in the
    /// unit of the parameter. It is the largest of the limits for the tried shapes of the effect, such as time
    /// constants. `None` if, for one of the shapes, the recordings are compatible with `largest_tried`.
    pub limit: Option<f64>,
    /// Median of the limits for the tried shapes. `None` if, for half of the shapes, the recordings are compatible
    /// with `largest_tried`.
    pub median_limit: Option<f64>,
    /// Largest strength that was tried. No larger limit is stated, because the statistics may not be linear beyond
    /// it.
    pub largest_tried: f64,
}

/// Returns a limit for each effect with a signature that fulfills `is_open`. `off` is the deviation of the
/// statistics from the model to which `metric` belongs. `events` contains the located events of the recordings.
pub(crate) fn effect_limits(
    reference: &NullModel,
    metric: &Metric,
    off: &DVector<f64>,
    events: &Events,
    is_open: impl Fn(&Signature) -> bool,
) -> Result<Vec<EffectLimit>> {
    let mut shapes: Vec<Shape<'_>> = Vec::new();
    for signature in reference.signatures.iter().filter(|s| is_open(s)) {
        match shapes.iter_mut().find(|shape| shape.has(signature)) {
            Some(shape) => shape.signatures.push(signature),
            None => shapes.push(Shape { signatures: vec![signature] }),
        }
    }
    let dual = metric.dual(off);
    let tried = threads::try_map(shapes, |shape| shape.estimate(reference, metric, &dual))?;
    let mut effects: Vec<&'static Definition> = tried.iter().map(|shape| shape.effect).collect();
    effects.dedup();
    let limit = |effect: &'static Definition| {
        let own: Vec<&TriedShape> = tried.iter().filter(|shape| shape.effect == effect).collect();
        let counted = events.of(effect).map(|count| count.upper_limit());
        EffectLimit::new(effect, &own, counted)
    };
    Ok(effects.into_iter().filter_map(limit).collect())
}

/// The signatures of one effect that differ only in the amplitude.
struct Shape<'a> {
    signatures: Vec<&'a Signature>,
}

impl Shape<'_> {
    fn has(&self, signature: &Signature) -> bool {
        let (own, other) = (&self.signatures[0].candidate, &signature.candidate);
        own.effect == other.effect && own.at[1..] == other.at[1..]
    }

    /// Estimates the amplitude with each signature that is long enough. A signature that is too short is simulated
    /// a second time in two cases: if it is the strongest one and all are too short, or if the effect is quadratic.
    fn estimate(mut self, reference: &NullModel, metric: &Metric, dual: &DVector<f64>) -> Result<TriedShape> {
        let amplitude = |s: &Signature| s.candidate.at[0].abs();
        self.signatures.sort_by(|a, b| amplitude(a).total_cmp(&amplitude(b)));
        let lengths: Vec<(f64, f64)> =
            self.signatures.iter().map(|s| (amplitude(s), metric.square(&s.mean).sqrt())).collect();
        let effect = self.signatures[0].candidate.effect;
        let is_line = effect.searched_params().any(|(_, search)| search.is_frequency);
        let is_quadratic = is_line || exceeds_linear(&lengths);
        let has_certain = lengths.iter().any(|(_, length)| *length > MIN_CERTAIN_LENGTH);
        let last = self.signatures.len() - 1;
        let mut tried = Vec::new();
        for (i, signature) in self.signatures.iter().enumerate() {
            let is_certain = lengths[i].1 > MIN_CERTAIN_LENGTH;
            let is_required = is_quadratic || (!has_certain && i == last);
            let share = if is_certain {
                signature.amplitude(metric, dual)
            } else if is_required {
                let score_sd = signature.score_sd;
                let second = Signature { score_sd, ..reference.with_second_draw(signature)? };
                second.amplitude(metric, dual)
            } else {
                None
            };
            let (knob, position) = (signature.candidate.knobs[0], signature.candidate.at[0]);
            let share = share.map(|estimate| upper_share(estimate, has_both_signs(&knob)));
            tried.push(TriedAmplitude { knob, position, share });
        }
        Ok(TriedShape { effect, is_quadratic, tried })
    }
}

/// Returns whether the length of the signature grows faster than the amplitude. `lengths` contains pairs of
/// amplitude and length, the smallest amplitude first. Noise increases the length of the weakest signature, which
/// reduces the growth. Noise therefore cannot make a linear effect look quadratic.
fn exceeds_linear(lengths: &[(f64, f64)]) -> bool {
    let Some((weak, short)) = lengths.first() else { return false };
    let stronger = lengths.iter().find(|(amplitude, _)| *amplitude > 1.01 * weak);
    stronger.is_some_and(|(strong, long)| {
        *long > MIN_CERTAIN_LENGTH && (long / short).ln() > MAX_LINEAR_EXPONENT * (strong / weak).ln()
    })
}

/// An amplitude that was tried, with its limit.
#[derive(Clone, Debug)]
struct TriedAmplitude {
    knob: Knob,
    /// Position of the knob at this amplitude.
    position: f64,
    /// Upper limit of the amplitude, in units of the tried one. `None` if the noise hides the signature.
    share: Option<f64>,
}

impl TriedAmplitude {
    /// Returns the distance of `position` from the value of the model, in the unit of the parameter.
    fn strength(&self, position: f64) -> f64 {
        (self.knob.value(self.knob.clamped(position)) - self.knob.value(0.0)).abs()
    }
}

/// Returns whether the amplitude can be positive or negative.
fn has_both_signs(knob: &Knob) -> bool {
    let [low, high] = [knob.range.0, knob.range.1].map(|end| knob.position(end));
    knob.scale == SearchScale::Linear && low.min(high) < 0.0 && low.max(high) > 0.0
}

fn upper_share(estimate: AmplitudeEstimate, has_both_signs: bool) -> f64 {
    let AmplitudeEstimate { value, sd } = estimate;
    let compatible = if has_both_signs { value.abs() } else { value.max(0.0) };
    compatible + NORMAL_QUANTILE_95 * sd
}

/// The tried amplitudes of one shape of an effect, the smallest first.
#[derive(Clone, Debug)]
struct TriedShape {
    effect: &'static Definition,
    /// Whether the change of the statistics is proportional to the square of the amplitude.
    is_quadratic: bool,
    tried: Vec<TriedAmplitude>,
}

impl TriedShape {
    /// Returns the upper limit of the strength. Returns `None` if the recordings contradict none of the tried
    /// amplitudes.
    ///
    /// The limit comes from the weakest tried amplitude that the recordings contradict. It is interpolated between
    /// zero and this amplitude. The weaker tried amplitudes are compatible with the recordings, so the limit is at
    /// least the strongest of these. If the effect has an onset, the limit is not interpolated.
    fn limit(&self) -> Option<f64> {
        let mut compatible: f64 = 0.0;
        for amplitude in &self.tried {
            match amplitude.share {
                Some(share) if share <= 1.0 => {
                    let is_variance = amplitude.knob.scale == SearchScale::Square;
                    let is_rare_event = amplitude.knob.key == "probability";
                    let share = match self.is_quadratic {
                        _ if self.effect.has_onset => 1.0,
                        true => share.sqrt(),
                        false if is_variance || is_rare_event => share.max(MIN_INTERPOLATED_SHARE),
                        false => share,
                    };
                    return Some(amplitude.strength(share * amplitude.position).max(compatible));
                }
                Some(_) => compatible = compatible.max(amplitude.strength(amplitude.position)),
                None => {}
            }
        }
        None
    }
}

impl EffectLimit {
    /// Combines the limits of the shapes of an effect. `counted` is the limit from counted events, which replaces
    /// them. Returns `None` if the effect has no tried amplitude.
    fn new(effect: &'static Definition, shapes: &[&TriedShape], counted: Option<f64>) -> Option<Self> {
        let all = || shapes.iter().flat_map(|shape| &shape.tried);
        let parameter = all().next()?.knob.key;
        let largest_tried = all().map(|t| t.strength(t.position)).fold(0.0, f64::max);
        let of_shape = |shape: &&TriedShape| shape.limit().unwrap_or(f64::INFINITY);
        let mut limits: Vec<f64> = match counted {
            Some(limit) => vec![limit],
            None => shapes.iter().map(of_shape).collect(),
        };
        limits.sort_by(f64::total_cmp);
        let stated = |limit: Option<&f64>| limit.copied().filter(|limit| *limit <= largest_tried);
        Some(Self {
            name: effect.name,
            parameter,
            limit: stated(limits.last()),
            // If the number of shapes is even, this is the larger of the two middle limits.
            median_limit: stated(limits.get(limits.len() / 2)),
            largest_tried,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use spikelane::effects::{image_lag, saturation_clamp};

    /// Returns a shape with the given positions and limits. An amplitude is 0.01 times its position, and a limit is
    /// in units of its amplitude.
    fn shape(effect: &'static Definition, amplitudes: &[(f64, Option<f64>)]) -> TriedShape {
        let (scale, range) = (SearchScale::Linear, (0.0, 1.0));
        let knob = Knob { effect, key: "x", scale, center: 0.0, unit: 0.01, range };
        let tried = |&(position, share): &(f64, _)| TriedAmplitude { knob, position, share };
        TriedShape { effect, is_quadratic: false, tried: amplitudes.iter().map(tried).collect() }
    }

    fn lag(amplitudes: &[(f64, Option<f64>)]) -> TriedShape {
        shape(&image_lag::EFFECT, amplitudes)
    }

    fn assert_limit(shape: &TriedShape, expected: f64) {
        let found = shape.limit().unwrap();
        assert!((found - expected).abs() < 1e-12, "{found} instead of {expected}");
    }

    #[test]
    fn a_limit_is_a_share_of_the_weakest_amplitude_beyond_it() {
        assert_limit(&lag(&[(1.0, Some(0.4)), (5.0, Some(0.1))]), 0.004);
        assert_limit(&lag(&[(1.0, Some(1.5)), (5.0, Some(0.4))]), 0.02);
        // The recordings are compatible with 0.01, so 0.005 is not a limit.
        assert_limit(&lag(&[(1.0, Some(1.5)), (5.0, Some(0.1))]), 0.01);
        assert_limit(&lag(&[(1.0, None), (5.0, Some(0.1))]), 0.005);
    }

    #[test]
    fn the_limit_of_a_quadratic_effect_is_interpolated_by_the_square() {
        let quadratic = TriedShape { is_quadratic: true, ..lag(&[(1.0, Some(0.25))]) };
        assert_limit(&quadratic, 0.005);
        assert!(exceeds_linear(&[(1.0, 11.4), (3.75, 85.0), (18.75, 541.0)]));
        assert!(!exceeds_linear(&[(1.0, 6.0), (5.0, 16.3), (5.0, 16.0), (20.0, 207.0)]));
        assert!(!exceeds_linear(&[(1.0, 60.0)]));
        assert!(!exceeds_linear(&[(1.0, 0.5), (5.0, 8.0)]), "noise");
    }

    #[test]
    fn the_limit_of_a_standard_deviation_is_not_far_below_the_tried_one() {
        let mut noise = lag(&[(1.0, Some(0.001))]);
        noise.tried[0].knob.scale = SearchScale::Square;
        assert_limit(&noise, 0.01 * MIN_INTERPOLATED_SHARE.sqrt());
        noise.tried[0].share = Some(0.25);
        assert_limit(&noise, 0.005);
    }

    #[test]
    fn no_limit_is_stated_beyond_the_strongest_amplitude() {
        let open = lag(&[(1.0, None), (5.0, Some(1.01))]);
        let found = EffectLimit::new(&image_lag::EFFECT, &[&open], None).unwrap();
        assert_eq!((found.limit, found.median_limit, found.largest_tried), (None, None, 0.05));
    }

    #[test]
    fn the_limit_of_several_shapes_is_the_largest() {
        let limits = |shares: [f64; 3]| {
            let shapes = shares.map(|share| lag(&[(1.0, Some(share))]));
            let found = EffectLimit::new(&image_lag::EFFECT, &shapes.each_ref(), None).unwrap();
            [found.limit, found.median_limit]
        };
        assert_eq!(limits([0.25, 1.0, 0.5]), [Some(0.01), Some(0.005)]);
        assert_eq!(limits([0.25, 1.9, 0.5]), [None, Some(0.005)]);
    }

    #[test]
    fn the_limit_of_an_effect_with_an_onset_is_an_amplitude_that_was_tried() {
        assert_limit(&shape(&saturation_clamp::EFFECT, &[(3.0, Some(0.1)), (7.0, Some(0.01))]), 0.03);
    }

    #[test]
    fn a_deviation_of_the_wrong_sign_leaves_the_limit_of_the_noise() {
        let estimate = AmplitudeEstimate { value: -0.5, sd: 0.2 };
        assert!((upper_share(estimate, false) - 0.329).abs() < 1e-12);
        assert!((upper_share(estimate, true) - 0.829).abs() < 1e-12);
    }
}
