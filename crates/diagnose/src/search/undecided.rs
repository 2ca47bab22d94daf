//! Questions that a time limit leaves open.

/// A question that the time limit left open.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Undecided {
    /// Whether the recordings agree with the model. The deviations resemble these effects.
    Agreement(Vec<&'static str>),
    /// Whether these effects or others are missing in the final model.
    FurtherEffects(Vec<&'static str>),
    /// Whether each named effect is necessary beside the others.
    NecessityOfEffects,
    /// The numbers of the base model beside the effects.
    BaseNumbers,
}

impl Undecided {
    /// Returns the question as a sentence.
    pub(crate) fn sentence(&self) -> String {
        match self {
            Self::Agreement(names) => {
                format!("whether the recordings agree with the model{}", resemblance(names))
            }
            Self::FurtherEffects(names) => {
                format!("which effects explain the remaining deviations{}", resemblance(names))
            }
            Self::NecessityOfEffects => {
                "whether each effect is necessary beside the others; their names are therefore tentative"
                    .to_owned()
            }
            Self::BaseNumbers => "the base parameters beside the effects".to_owned(),
        }
    }
}

fn resemblance(names: &[&str]) -> String {
    if names.is_empty() { String::new() } else { format!("; most similar: {}", names.join(", ")) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn open_questions_list_similar_effects() {
        assert_eq!(
            Undecided::Agreement(vec!["leak", "dead_time"]).sentence(),
            "whether the recordings agree with the model; most similar: leak, dead_time"
        );
        assert!(Undecided::FurtherEffects(Vec::new()).sentence().ends_with("remaining deviations"));
    }
}
