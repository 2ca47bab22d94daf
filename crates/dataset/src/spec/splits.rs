//! Assignment of sequences to training, validation and testing.

use serde::{Deserialize, Serialize};

use super::content::Content;
use spikelane::error::{Error, ErrorKind, Result};

/// Purpose of a sequence.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Split {
    /// For training a model.
    #[default]
    Train,
    /// For validation, which selects one of several trained models.
    Validation,
    /// For testing, which evaluates the selected model.
    Test,
}

impl Split {
    /// All splits.
    pub const ALL: [Self; 3] = [Self::Train, Self::Validation, Self::Test];

    /// Returns the name of the split's folder.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Train => "train",
            Self::Validation => "validation",
            Self::Test => "test",
        }
    }
}

/// Fractions of the sequences for validation and testing, each between 0 and 1. All other sequences are for training.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Splits {
    /// Fraction of the sequences for validation.
    #[serde(default)]
    pub validation: f64,
    /// Fraction of the sequences for testing.
    #[serde(default = "default_test_share")]
    pub test: f64,
    /// Whether the fractions apply to every lighting preset separately, with a deviation of at most one scene. Only
    /// scenes support this option.
    #[serde(default)]
    pub stratify_by_lighting: bool,
}

const fn default_test_share() -> f64 {
    0.2
}

impl Splits {
    /// Returns a test fraction of one fifth and a validation fraction of zero.
    pub(crate) const fn default_shares() -> Self {
        Self { validation: 0.0, test: default_test_share(), stratify_by_lighting: false }
    }

    pub(super) fn check(&self, work: &Content) -> Result<()> {
        let shares = [self.validation, self.test, self.validation + self.test];
        if shares.iter().any(|s| !(0.0..=1.0).contains(s)) {
            return Err(Error::new(ErrorKind::Usage, "dataset")
                .found(format_args!(
                    "a share of {} for validation and {} for testing",
                    self.validation, self.test
                ))
                .expected("shares from 0 to 1 with a sum of at most 1"));
        }
        if self.stratify_by_lighting && matches!(work, Content::Inputs(_)) {
            return Err(Error::new(ErrorKind::Usage, "split by lighting")
                .found("input files")
                .expected("generated scenes, whose lighting is known")
                .remedy("omit this setting; the split of each input is drawn independently"));
        }
        Ok(())
    }
}
