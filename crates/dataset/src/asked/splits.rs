//! Which sequences are for training, for validation and for testing.

use serde::{Deserialize, Serialize};

use super::work::Work;
use spikelane::error::{Error, Kind, Result};

/// What a sequence is for.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Split {
    /// To train with.
    #[default]
    Train,
    /// To choose between what was trained.
    Validation,
    /// To judge with.
    Test,
}

impl Split {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Train, Self::Validation, Self::Test];

    /// The name of its folder.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Train => "train",
            Self::Validation => "validation",
            Self::Test => "test",
        }
    }
}

/// Shares of the sequences, each 0 to 1; what is left is for training.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Splits {
    /// For validation.
    #[serde(default)]
    pub validation: f64,
    /// For testing.
    #[serde(default = "a_fifth")]
    pub test: f64,
    /// Whether every light has its share, to within one scene: of drawn scenes alone.
    #[serde(default)]
    pub by_light: bool,
}

const fn a_fifth() -> f64 {
    0.2
}

impl Splits {
    /// A fifth for testing, the rest for training.
    pub(crate) const fn usual() -> Self {
        Self { validation: 0.0, test: a_fifth(), by_light: false }
    }

    pub(super) fn check(&self, work: &Work) -> Result<()> {
        let shares = [self.validation, self.test, self.validation + self.test];
        if shares.iter().any(|s| !(0.0..=1.0).contains(s)) {
            return Err(Error::new(Kind::Usage, "dataset")
                .found(format_args!(
                    "a share of {} for validation, {} for testing",
                    self.validation, self.test
                ))
                .expected("shares from 0 to 1, at most 1 together"));
        }
        if self.by_light && matches!(work, Work::Inputs(_)) {
            return Err(Error::new(Kind::Usage, "split by light")
                .found("given inputs")
                .expected("drawn scenes, whose light is known")
                .remedy("leave it out: each input draws its split on its own"));
        }
        Ok(())
    }
}
