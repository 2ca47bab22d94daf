//! Estimates the smallest detectable strength of each effect.

use crate::fits::fit::Fit;
use crate::null_model::model::NullModel;
use crate::null_model::signature::{Signature, reach};
use crate::thresholds::{
    MAX_LINEAR_LENGTH, MAX_PROJECTED_COSINE, MIN_EXPECTED_EVENTS, MIN_SIGNATURE_SQUARE, ONSET_STEPS,
};
use nalgebra::DVector;
use spikelane::effects::{Definition, EventKind};
use spikelane::error::Result;

/// Smallest efficient score, in standard deviations, at which an effect counts as detectable.
pub const DETECTION_SCORE: f64 = 5.0;

/// The smallest strength at which an effect can be distinguished from a change of the calibrated parameters and
/// from the most similar other effect.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Detectability {
    /// Canonical name of the effect.
    pub name: &'static str,
    /// Key of the parameter that is the strength of the effect.
    pub parameter: &'static str,
    /// Smallest detectable strength. It is the difference from the value without the effect, in the unit of the
    /// parameter.
    pub strength: f64,
    /// The most similar other effect.
    pub nearest_candidate: &'static str,
    /// Cosine of the angle between the signatures of both effects.
    pub cosine: f64,
}

impl NullModel {
    /// Returns the smallest detectable strength of every effect.
    ///
    /// The strength is the median over the tried shapes of the effect, for example time constants. For effects with
    /// a frequency, it is the largest value. Squared lengths and cosines come from products of two different
    /// simulations, so their noise averages out.
    #[must_use]
    pub fn detectabilities(&self) -> Vec<Detectability> {
        self.effects().into_iter().filter_map(|effect| self.detectability_of(effect)).collect()
    }

    /// Returns the effects with signatures, in the order in which they are tried.
    pub(crate) fn effects(&self) -> Vec<&'static Definition> {
        let mut effects: Vec<&'static Definition> =
            self.signatures.iter().map(|s| s.candidate.effect).collect();
        effects.dedup();
        effects
    }

    /// Returns the names of the effects that this set cannot show at any strength.
    pub(crate) fn not_testable(&self) -> Vec<&'static str> {
        let strongest = |effect: &&'static Definition| {
            let own = self.signatures.iter().filter(|s| s.candidate.effect == *effect);
            own.map(|s| self.square(s) * reach(s).powi(2)).fold(0.0, f64::max)
                < DETECTION_SCORE * DETECTION_SCORE
        };
        let weak = self.effects().into_iter().filter(strongest);
        weak.chain(self.missing.iter().copied()).map(|effect| effect.name).collect()
    }

    /// Returns the smallest detectable strength of an effect. Returns `None` if the noise hides its signatures.
    pub(crate) fn detectability_of(&self, effect: &'static Definition) -> Option<Detectability> {
        let mut found: Vec<Detectability> = Vec::new();
        for tried in self.signatures.iter().filter(|s| s.candidate.effect == effect) {
            let (nearest, alike) = self.nearest(tried);
            let weak = self.weakened(tried).ok()?;
            let square = self.square(&weak);
            if square < MIN_SIGNATURE_SQUARE {
                continue;
            }
            let length = (square * (1.0 - alike * alike)).sqrt();
            let knob = weak.candidate.knobs[0];
            let u = self.onset(&weak, DETECTION_SCORE / length).ok()?;
            let strength = (knob.value(u) - knob.value(0.0)).abs();
            found.push(Detectability {
                name: effect.name,
                parameter: knob.key,
                strength,
                nearest_candidate: nearest,
                cosine: alike,
            });
        }
        let fewest = self.fewest(effect);
        found.iter_mut().for_each(|f| f.strength = f.strength.max(fewest));
        found.sort_by(|a, b| a.strength.total_cmp(&b.strength));
        // The noise decreases strongly with the frequency, so no median represents all frequencies. The largest
        // strength is used instead.
        let is_line = effect.searched_params().any(|(_, tried)| tried.is_frequency);
        let of_all = if is_line { found.len().saturating_sub(1) } else { found.len() / 2 };
        (!found.is_empty()).then(|| found.swap_remove(of_all))
    }

    /// Returns the effects that resemble a move of the base parameters by `change`, the most similar first. The
    /// signature of each explains at least half of the change of the statistics. Effects of `fit` are excluded.
    pub(crate) fn effects_like(&self, change: &DVector<f64>, fit: &Fit) -> Vec<&'static str> {
        let moved = &self.jacobian * change;
        let dual = self.noise.solve_vector(&moved);
        let square = moved.dot(&dual);
        let share = |s: &Signature| {
            let along = s.mean.dot(&dual);
            let own = s.mean.dot(&self.noise.solve_vector(&s.mean));
            if along > 0.0 && own > 0.0 { along * along / (own * square.max(f64::MIN_POSITIVE)) } else { 0.0 }
        };
        let open = self.signatures.iter().filter(|s| fit.lacks(s) && fit.allows(s));
        let mut alike: Vec<(f64, &'static str)> = open.map(|s| (share(s), s.candidate.effect.name)).collect();
        alike.retain(|(share, _)| *share >= 0.5);
        alike.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut names: Vec<&'static str> = Vec::new();
        for (_, name) in alike {
            if !names.contains(&name) {
                names.push(name);
            }
        }
        names
    }

    /// Returns the smallest strength at which the recordings are expected to contain [`MIN_EXPECTED_EVENTS`] events
    /// of the effect. Returns 0 for an effect without events.
    fn fewest(&self, effect: &Definition) -> f64 {
        let readouts: usize = self.setup.recordings.iter().map(|s| s.readouts).sum();
        match effect.event_kind {
            None => 0.0,
            Some(EventKind::DroppedReadouts | EventKind::RepeatedReadouts) => {
                MIN_EXPECTED_EVENTS / readouts as f64
            }
            Some(EventKind::Pixels) => MIN_EXPECTED_EVENTS / self.setup.geometry.pixels() as f64,
        }
    }

    /// Returns the most similar other effect and the cosine of both signatures. The cosine is limited to
    /// [`MAX_PROJECTED_COSINE`]. Effects that nothing separates are reported as ambiguous when they are found.
    fn nearest(&self, own: &Signature) -> (&'static str, f64) {
        let square = self.square(own);
        let alike = |rival: &Signature| {
            let other = self.square(rival);
            if other < MIN_SIGNATURE_SQUARE || square < MIN_SIGNATURE_SQUARE {
                return 0.0;
            }
            (self.product(own, rival) / (square * other).sqrt()).clamp(-1.0, 1.0)
        };
        let rivals = self.signatures.iter().filter(|s| s.candidate.effect.name != own.candidate.effect.name);
        let nearest = rivals
            .map(|r| (alike(r), r.candidate.effect.name))
            .max_by(|a, b| a.0.abs().total_cmp(&b.0.abs()));
        nearest.map_or(("", 0.0), |(a, n)| (n, a.clamp(-MAX_PROJECTED_COSINE, MAX_PROJECTED_COSINE)))
    }

    /// Returns the signature at a strength that is closer to the smallest detectable one. Few effects are linear
    /// over several powers of ten.
    fn weakened(&self, tried: &Signature) -> Result<Signature> {
        let mut signature = tried.clone();
        for _ in 0..4 {
            let length = self.square(&signature).max(0.0).sqrt();
            if length < MAX_LINEAR_LENGTH {
                break;
            }
            let mut candidate = signature.candidate.clone();
            candidate.at[0] *= (0.5 * MAX_LINEAR_LENGTH / length).max(0.03);
            let weaker = self.signature(candidate)?;
            if self.square(&weaker) < 36.0 {
                break;
            }
            signature = weaker;
        }
        Ok(signature)
    }

    /// Returns the position at which the length of a signature is the small share `share` of its present length.
    ///
    /// The effect of an onset, such as a clamp, grows less than linearly at small strengths. A straight line from
    /// zero would then promise a signature that is too long. The effect must therefore have at least half of the
    /// promised length at three times the position. Otherwise, the result is the smallest position at which it has
    /// this length.
    fn onset(&self, weak: &Signature, share: f64) -> Result<f64> {
        let (mut low, mut high) = (3.0 * share, 1.0);
        let promised = self.square(weak) * low * low;
        let holds = |share: f64| -> Result<bool> {
            let mut candidate = weak.candidate.clone();
            candidate.at[0] *= share;
            Ok(self.square(&self.signature(candidate)?) > 0.25 * promised)
        };
        if low >= high || holds(low)? {
            return Ok(weak.candidate.at[0] * share);
        }
        for _ in 0..ONSET_STEPS {
            let middle = (low * high).sqrt();
            if holds(middle)? { high = middle } else { low = middle }
        }
        Ok(weak.candidate.at[0] * high)
    }

    /// Returns the value of the strength parameter at which the effect is absent.
    pub(crate) fn neutral_of(&self, name: &str) -> Option<f64> {
        let own = self.signatures.iter().find(|s| s.candidate.effect.name == name)?;
        Some(own.candidate.knobs[0].value(0.0))
    }

    /// Returns the largest absolute cosine between any signatures of two effects.
    pub(crate) fn cosine_of(&self, name: &str, other: &str) -> f64 {
        let of = |name: &str| -> Vec<&Signature> {
            self.signatures.iter().filter(|s| s.candidate.effect.name == name).collect()
        };
        let cosine = |a: &Signature, b: &Signature| {
            let squares = [self.square(a), self.square(b)];
            if squares.iter().any(|s| *s < MIN_SIGNATURE_SQUARE) {
                return 0.0;
            }
            (self.product(a, b) / (squares[0] * squares[1]).sqrt()).abs()
        };
        let (own, other) = (of(name), of(other));
        own.iter().flat_map(|a| other.iter().map(|b| cosine(a, b))).fold(0.0, f64::max)
    }

    fn square(&self, s: &Signature) -> f64 {
        let [first, second] = s.two_estimates();
        self.metric.dual(first).dot(second)
    }

    fn product(&self, a: &Signature, b: &Signature) -> f64 {
        let ([a, a_too], [b, b_too]) = (a.two_estimates(), b.two_estimates());
        0.5 * (self.metric.dual(a).dot(b_too) + self.metric.dual(a_too).dot(b))
    }
}
