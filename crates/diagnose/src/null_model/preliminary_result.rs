//! The result of the first simulations, if the set does not agree with the model.

use crate::null_model::limits::score_of;
use crate::null_model::model::NullModel;
use nalgebra::DVector;

/// Deviation and score up to which a set agrees at first sight. The noise comes from a couple of dozen sensors here, so that a statistic of a
/// clean one is 7 of its deviations off once in 2.6 million times, and one of some 250 of them once in ten thousand.
const PLAIN: f64 = 7.0;

/// Share of the best name's score squared from which on a name is likely, and the most that are said.
const NEAR: f64 = 0.35;
const MOST: usize = 5;

/// A preliminary result. The diagnosis then finds weaker effects, fits and compares the effects, and may end with
/// another result.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
#[non_exhaustive]
pub struct PreliminaryResult {
    /// Whether no deviation is significant.
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
    /// Compares `data`, in the coordinates of `null_model`, with the first simulations.
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
        let near = |n: &&(f64, &str)| n.0 > PLAIN && n.0 * n.0 > NEAR * best * best;
        let likely_effects = names.iter().filter(near).map(|n| n.1).take(MOST).collect();
        Self { is_consistent: deviation < PLAIN && best < PLAIN, likely_effects }
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
