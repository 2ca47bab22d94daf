//! How strong an effect must be on a set before it can be named.

use super::model::Scale;
use super::reference::{Reference, Signature};

/// Efficient score at which an effect counts as nameable.
pub const SCORE: f64 = 5.0;

/// The smallest strength at which an effect can be told from calibration and from its nearest rival.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Nameable {
    /// Canonical name.
    pub name: &'static str,
    /// Its amplitude's key.
    pub key: &'static str,
    /// Strength, as a difference from the effect's absence.
    pub strength: f64,
    /// The candidate that it is most alike.
    pub nearest: &'static str,
    /// Cosine of the angle between the two.
    pub alike: f64,
}

impl Reference {
    /// Every candidate's smallest nameable strength; the median over the shapes that are tried.
    ///
    /// Lengths and angles come from products of different simulations, whose noise averages out.
    #[must_use]
    pub fn nameable(&self) -> Vec<Nameable> {
        let mut names: Vec<&'static str> = self.signatures.iter().map(|s| s.candidate.name).collect();
        names.dedup();
        names.into_iter().filter_map(|name| self.nameable_one(name)).collect()
    }

    /// Names that this set cannot show, or that the model cannot simulate.
    pub(super) fn not_testable(&self) -> Vec<&'static str> {
        let mut names: Vec<&'static str> = self.signatures.iter().map(|s| s.candidate.name).collect();
        names.dedup();
        let strongest = |name: &&'static str| {
            let own = self.signatures.iter().filter(|s| s.candidate.name == *name);
            own.map(|s| self.square(s) * reach(s).powi(2)).fold(0.0, f64::max) < SCORE * SCORE
        };
        names.into_iter().filter(strongest).chain(self.missing.iter().copied()).collect()
    }

    fn nameable_one(&self, name: &'static str) -> Option<Nameable> {
        let mut found: Vec<Nameable> = Vec::new();
        for own in self.signatures.iter().filter(|s| s.candidate.name == name) {
            let square = self.square(own);
            // A signature that is lost in its own noise says nothing.
            if square < 25.0 {
                continue;
            }
            let rivals = self.signatures.iter().filter(|s| s.candidate.name != name);
            let alike = |rival: &Signature| {
                let other = self.square(rival);
                if other < 25.0 {
                    0.0
                } else {
                    (self.product(own, rival) / (square * other).sqrt()).clamp(-0.999, 0.999)
                }
            };
            let nearest =
                rivals.map(|r| (alike(r), r.candidate.name)).max_by(|a, b| a.0.abs().total_cmp(&b.0.abs()));
            let (alike, nearest) = nearest.unwrap_or((0.0, ""));
            let length = (square * (1.0 - alike * alike)).sqrt();
            let knob = own.candidate.knobs[0];
            let u = own.candidate.at[0] * SCORE / length;
            let strength = (knob.value(u) - knob.value(0.0)).abs();
            found.push(Nameable { name, key: knob.key, strength, nearest, alike });
        }
        found.sort_by(|a, b| a.strength.total_cmp(&b.strength));
        let middle = found.len() / 2;
        (!found.is_empty()).then(|| found.swap_remove(middle))
    }

    fn square(&self, s: &Signature) -> f64 {
        self.metric.dual(&s.each[0]).dot(&s.each[1])
    }

    fn product(&self, a: &Signature, b: &Signature) -> f64 {
        0.5 * (self.metric.dual(&a.each[0]).dot(&b.each[1]) + self.metric.dual(&a.each[1]).dot(&b.each[0]))
    }
}

/// How much further than tried the amplitude can go.
fn reach(s: &Signature) -> f64 {
    let (knob, u) = (s.candidate.knobs[0], s.candidate.at[0]);
    let most = knob.position(if u * knob.unit < 0.0 && knob.scale == Scale::Linear {
        knob.range.0
    } else {
        knob.range.1
    });
    (most / u).abs().max(1.0)
}
