//! The result of the first simulations if the set does not agree with the model.

use crate::null_model::limits::score_of;
use crate::null_model::model::NullModel;
use crate::thresholds::{MAX_LIKELY_EFFECTS, MAX_PRELIMINARY_Z, MIN_LIKELY_SHARE};
use nalgebra::DVector;

/// A preliminary result. The diagnosis continues: it searches for weaker effects and compares fits of the effects.
/// The final result can differ from the preliminary one.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
#[non_exhaustive]
pub struct PreliminaryResult {
    /// Whether no deviation is significant in the first simulations.
    pub is_consistent: bool,
    /// Effects that resemble the deviations, the most likely first.
    pub likely_effects: Vec<&'static str>,
}

impl PreliminaryResult {
    /// Returns the result as a sentence.
    #[must_use]
    pub fn sentence(&self) -> String {
        match (self.is_consistent, self.likely_effects.as_slice()) {
            (true, _) => {
                "no clear deviation from the model; the search for weaker effects continues".to_owned()
            }
            (false, []) => {
                "a clear deviation that resembles no effect of the catalog; the analysis continues".to_owned()
            }
            (false, names) => format!(
                "a clear deviation, most similar to {}; effects are now fitted and compared",
                names.join(", ")
            ),
        }
    }
}

impl PreliminaryResult {
    /// Compares `data` with the first simulations. `data` are shifted as by [`NullModel::shifted`].
    pub(crate) fn new(null_model: &NullModel, data: &DVector<f64>) -> Self {
        let metric = &null_model.metric;
        let off = data - &null_model.mean;
        let dual = metric.dual(&off);
        let mut names: Vec<(f64, &'static str)> = Vec::new();
        for signature in &null_model.signatures {
            let name = signature.candidate.effect.name;
            let score = score_of(metric, &signature.mean, &dual) / signature.score_sd;
            match names.iter_mut().find(|n| n.1 == name) {
                Some(known) => known.0 = known.0.max(score),
                None => names.push((score, name)),
            }
        }
        names.sort_by(|a, b| b.0.total_cmp(&a.0));
        let best = names.first().map_or(0.0, |n| n.0);
        let deviation = metric.scores(&off).into_iter().fold(0.0, |m: f64, z| m.max(z.abs()));
        let near = |n: &&(f64, &str)| n.0 > MAX_PRELIMINARY_Z && n.0 * n.0 > MIN_LIKELY_SHARE * best * best;
        let likely_effects = names.iter().filter(near).map(|n| n.1).take(MAX_LIKELY_EFFECTS).collect();
        Self { is_consistent: deviation < MAX_PRELIMINARY_Z && best < MAX_PRELIMINARY_Z, likely_effects }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_look_in_words_says_what_follows() {
        let look = |agrees, likely: &[&'static str]| {
            PreliminaryResult { is_consistent: agrees, likely_effects: likely.to_vec() }.sentence()
        };
        assert!(look(true, &[]).starts_with("no clear deviation"));
        assert!(look(false, &["leak", "dead_time"]).contains("most similar to leak, dead_time;"));
        assert!(look(false, &[]).contains("no effect"));
    }
}
