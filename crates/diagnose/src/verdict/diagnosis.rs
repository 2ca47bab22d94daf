//! The result of a diagnosis.

use crate::faults::fault::Fault;
use crate::prepared::provenance::Provenance;
use crate::search::round::{EliminationReason, Step, Undecided};
use crate::verdict::effect_limits::EffectLimit;
use crate::verdict::figures::{RateResidual, SetPlots};
use serde::Serialize;
use spikelane::effects::Camera;

/// The verdict of a diagnosis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// No statistic exceeds its limit.
    Agrees,
    /// At least one effect or parameter mismatch is named, and no other deviation is significant. The held-out
    /// discrepancy is within [`Discrepancy::limit`].
    Explained,
    /// At least one effect or parameter mismatch is named, but a significant discrepancy remains.
    PartlyExplained,
    /// A significant discrepancy remains, and no effect or parameter mismatch is named, except tentative ones.
    Unknown,
    /// The time limit was reached before the recordings could be compared with the model.
    Undecided,
}

impl Verdict {
    /// Returns whether the final model describes the recordings.
    #[must_use]
    pub fn is_complete(self) -> bool {
        matches!(self, Self::Agrees | Self::Explained)
    }
}

/// A parameter with its 95 % interval.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Parameter {
    /// Key of the parameter.
    pub name: &'static str,
    /// Value in the parameter's unit.
    pub value: f64,
    /// Lower end of the interval.
    pub low: f64,
    /// Upper end of the interval.
    pub high: f64,
}

/// An effect that the diagnosis found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FoundEffect {
    /// Canonical name of the effect.
    pub name: &'static str,
    /// Fitted parameters.
    pub parameters: Vec<Parameter>,
    /// Effects that explain the recordings equally well within the noise.
    pub ambiguous_with: Vec<&'static str>,
    /// Whether the name is tentative. The usual reasons are two. A significant discrepancy remains, and the effect
    /// explains less than half of the initial one. Or the model has other effects, and this one is weaker than the
    /// set can detect.
    pub is_tentative: bool,
    /// Description of the evidence for the effect.
    pub evidence: String,
    /// The step that `evidence` describes.
    #[serde(skip)]
    pub(crate) step: Option<Step>,
}

/// A parameter of the initial model that the recordings contradict.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ParameterMismatch {
    /// The parameter as `effect.key`.
    pub parameter: String,
    /// Value in the model.
    pub model_value: f64,
    /// Value fitted to the data.
    pub fitted_value: f64,
    /// Lower end of the 95 % interval of the fitted value.
    pub low: f64,
    /// Upper end of the interval.
    pub high: f64,
    /// Effects that explain the recordings equally well within the noise. For a tentative mismatch, also effects
    /// that explain at least half of the change of the statistics by the mismatch.
    pub ambiguous_with: Vec<&'static str>,
    /// Whether the mismatch is tentative. It is tentative if the held-out recordings do not confirm it. It is also
    /// tentative if a significant discrepancy remains and the mismatch explains only a part of the initial one. An
    /// effect that is not in the catalog may have changed the fitted value.
    pub is_tentative: bool,
}

/// The light of a recording or of a source after the diagnosis.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct DiagnosedLamp {
    /// File of the recording. For a source, the recording in which the source is alone.
    pub file: String,
    /// Name of the source. `None` if the set states no sources for the recording. A source has the same deviation
    /// in all recordings.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub source: Option<String>,
    /// Description of the stated light.
    pub light: String,
    /// Relative standard deviation of the light. It is the stated one, or a larger one if the levels contradict the
    /// stated one.
    pub uncertainty: f64,
    /// Relative deviation of the light from the stated light, estimated from all recordings with the final model.
    pub deviation: f64,
    /// Standard deviation of `deviation`.
    pub error: f64,
    /// `deviation` divided by `uncertainty`.
    pub pull: f64,
    /// Influence of this lamp on each named parameter.
    pub impacts: Vec<LampImpact>,
}

/// Influence of a lamp on a fitted parameter.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct LampImpact {
    /// The parameter as `effect.key`.
    pub parameter: String,
    /// Change of the fitted value if the relative light of the lamp increases by its standard deviation `error`.
    pub change: f64,
}

/// A statistic with a significant deviation that the final model does not explain.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct UnexplainedStatistic {
    /// Names of the recording and of the statistic.
    pub r#where: String,
    /// Deviation in standard deviations.
    pub z: f64,
}

/// A comparison of the recordings with a limit of the final model.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct LimitTest {
    /// Name of the compared quantity.
    pub quantity: &'static str,
    /// Value of the fitted recordings.
    pub fitted_set: f64,
    /// Value of the held-out recordings. `None` if they were not tested, because nothing was held out or no effect
    /// was added.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub held_out_set: Option<f64>,
    /// Limit of both values.
    pub limit: f64,
    /// Probability that a sensor that follows the model exceeds the limit. It is 0.05 if the first simulations were
    /// sufficient, and 0.001 otherwise.
    pub exceedance_probability: f64,
}

impl LimitTest {
    /// Returns whether no tested value exceeds the limit.
    #[must_use]
    pub fn passes(&self) -> bool {
        self.fitted_set <= self.limit && self.held_out_set.is_none_or(|value| value <= self.limit)
    }
}

/// Discrepancies between the model and the recordings after each step of the search.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Discrepancy {
    /// Discrepancies of the fitted recordings. The first value is the discrepancy without any added effect.
    pub fitted_set: Vec<f64>,
    /// Discrepancies of the held-out recordings. They equal `fitted_set` if nothing was held out.
    pub held_out_set: Vec<f64>,
    /// Noise floor: the discrepancy of sensors that follow the final model.
    pub noise_floor: f64,
    /// Standard deviation of the noise floor.
    pub noise_floor_sd: f64,
}

impl Discrepancy {
    /// Returns whether the held-out recordings are others than the fitted ones.
    #[must_use]
    pub fn is_held_out(&self) -> bool {
        self.fitted_set != self.held_out_set
    }

    /// Returns the largest held-out discrepancy at which a set counts as explained.
    ///
    /// The limit is the noise floor plus a margin. The margin is 1 % of the initial excess or two standard
    /// deviations of the noise floor, whichever is larger. The initial excess is the first held-out discrepancy
    /// minus the noise floor.
    #[must_use]
    pub fn limit(&self) -> f64 {
        let first = self.held_out_set.first().map_or(0.0, |first| first - self.noise_floor);
        self.noise_floor + (0.01 * first).max(2.0 * self.noise_floor_sd)
    }

    /// Returns whether the last held-out discrepancy is within the limit.
    #[must_use]
    pub fn is_within_limit(&self) -> bool {
        self.held_out_set.last().is_none_or(|last| *last <= self.limit())
    }
}

/// The result of a diagnosis.
#[derive(Clone, Debug, Serialize)]
pub struct Diagnosis {
    /// The verdict.
    pub verdict: Verdict,
    /// Faults of lamps, scenes and files. The diagnosis searches faults before effects, and it adds no effect
    /// because of a fault.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub faults: Vec<Fault>,
    /// Effects that were added to the model.
    pub effects: Vec<FoundEffect>,
    /// Parameters of the model that the data contradict.
    pub parameter_mismatches: Vec<ParameterMismatch>,
    /// The light of each source, and of each lit recording without stated sources.
    pub lamps: Vec<DiagnosedLamp>,
    /// Rates of the uniform recordings, and their deviations from the models, in ascending order of light.
    pub rates: Vec<RateResidual>,
    /// Significant deviations that remain.
    pub unexplained: Vec<UnexplainedStatistic>,
    /// Discrepancies after each step.
    pub discrepancy: Discrepancy,
    /// Comparisons with the limits that decide whether a deviation is significant.
    pub tests: Vec<LimitTest>,
    /// Questions that the time limit left open. The list is empty if the limit was not reached.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub undecided: Vec<String>,
    /// Recordings that would distinguish ambiguous effects.
    pub recommended_recordings: Vec<String>,
    /// Upper limits for the effects of the catalog that were not added. The list is empty unless the model
    /// describes the recordings, as with the verdicts [`Verdict::Agrees`] and [`Verdict::Explained`].
    pub limits: Vec<EffectLimit>,
    /// Effects that this set cannot show at any strength.
    pub undetectable: Vec<&'static str>,
    /// Duration of the diagnosis in seconds.
    pub seconds: f64,
    /// Number of simulations from the cache, and number of new simulations. `None` without a cache. The numbers are
    /// not part of the result, so no file contains them.
    #[serde(skip)]
    pub cache_counts: Option<[usize; 2]>,
    /// Notes, for example on the origin of the held-out data.
    pub notes: Vec<String>,
    /// The recordings, the camera and the initial parameters. `None` if the caller provided a null model.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub provenance: Option<Provenance>,
    /// The camera with the added effects and the fitted parameters.
    #[serde(skip)]
    pub camera: Camera,
    /// Data of the plots.
    #[serde(skip)]
    pub traces: ReportData,
}

impl Diagnosis {
    /// Returns the diagnosis if the time limit is reached before the first simulations are complete.
    pub(crate) fn without_comparison(faults: Vec<Fault>, camera: Camera) -> Self {
        Self {
            verdict: Verdict::Undecided,
            undecided: vec![Undecided::Agreement(Vec::new()).sentence()],
            notes: Vec::new(),
            ..Self::stopped(faults, camera)
        }
    }

    /// Returns the diagnosis of a set with so many faults that no comparison is possible.
    pub(crate) fn stopped(faults: Vec<Fault>, camera: Camera) -> Self {
        Self {
            verdict: Verdict::Unknown,
            faults,
            effects: Vec::new(),
            parameter_mismatches: Vec::new(),
            lamps: Vec::new(),
            rates: Vec::new(),
            unexplained: Vec::new(),
            discrepancy: Discrepancy {
                fitted_set: Vec::new(),
                held_out_set: Vec::new(),
                noise_floor: 0.0,
                noise_floor_sd: 0.0,
            },
            tests: Vec::new(),
            undecided: Vec::new(),
            recommended_recordings: Vec::new(),
            limits: Vec::new(),
            undetectable: Vec::new(),
            seconds: 0.0,
            cache_counts: None,
            notes: vec![
                "Too few recordings without faults remain for a diagnosis: no effects were searched."
                    .to_owned(),
            ],
            provenance: None,
            camera,
            traces: ReportData::default(),
        }
    }
}

/// The data that the report shows.
#[derive(Clone, Debug, Default)]
pub struct ReportData {
    /// One row for each statistic: name, recording, deviation before the diagnosis, and deviation after it.
    /// Deviations are in standard deviations.
    pub deviations: Vec<(String, String, f64, f64)>,
    /// For each round, the compared effects with their discrepancy, and whether they are as likely as the winner.
    pub tournament: Vec<Vec<(&'static str, f64, bool)>>,
    /// The winner of each round and its outcome.
    pub step_outcomes: Vec<(&'static str, EliminationReason)>,
    /// Name of the step that led to each value of the discrepancy.
    pub discrepancy_labels: Vec<String>,
    /// Plots of the recordings, of the initial model and of the final model.
    pub plots: Vec<(&'static str, SetPlots)>,
}
