//! Names that are weaker than what a set can name.

use super::context::{Search, TestedFit};
use super::round::tied;
use super::round::{Round, kept_mut};

impl Search<'_> {
    /// Marks names of which less was fitted than the smallest strength that this set can name, and that tie with no other: what
    /// strong effects leave has many shapes, of which a weak name may take some. A `leak` of half that strength came with a wrong
    /// name and stayed when that one was exchanged; of some hundred other names beside others that nothing tied none was as weak.
    pub(crate) fn mark_faint(&self, at: &TestedFit, rounds: &mut [Round]) {
        for (i, (effect, _)) in at.fit.effects.iter().enumerate() {
            let Some(round) = kept_mut(rounds, effect.name) else { continue };
            if !tied(round).is_empty() {
                continue;
            }
            let amplitude = at.fit.knobs_of(i).start;
            let knob = at.fit.model.knobs[amplitude];
            let strength = (knob.value(at.fit.u[amplitude]) - knob.value(0.0)).abs();
            let Some(smallest) = self.fitter.reference.detectability_of(effect).map(|n| n.strength) else {
                continue;
            };
            if strength < smallest {
                round.faint = true;
                round.evidence +=
                    &format!("; a strength of {strength:.2e} where this set can name {smallest:.2e}");
            }
        }
    }
}
