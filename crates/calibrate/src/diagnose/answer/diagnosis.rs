//! The words in which a diagnosis is given.

use serde::Serialize;

use super::pictures::Picture;
use crate::diagnose::given::about::About;
use crate::diagnose::lab::fault::Fault;
use crate::diagnose::search::round::{Fate, Step};
use spikelane::effects::Camera;

/// The verdict.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// Nothing is above its limit.
    Agrees,
    /// Effects or misfits are named, nothing is left, and the held-out gap is within [`Gap::limit`].
    Explained,
    /// Something is named, and something is left.
    PartlyExplained,
    /// Nothing that is named explains what is left.
    Unknown,
}

/// A number with its 95 % interval.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Parameter {
    /// Key.
    pub name: &'static str,
    /// In the parameter's unit.
    pub value: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// An effect that was found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FoundEffect {
    /// Canonical name.
    pub name: &'static str,
    /// Fitted numbers.
    pub parameters: Vec<Parameter>,
    /// Names that fit as well within noise.
    pub tied_with: Vec<&'static str>,
    /// Whether the name is a likeness only: it explains less than half of what is there while something is left, or is
    /// weaker beside others than what the set can name.
    pub resembles: bool,
    /// What speaks for it.
    pub evidence: String,
    /// The step of which that tells.
    #[serde(skip)]
    pub(in crate::diagnose) step: Option<Step>,
}

/// A number of the model that the data contradict.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Misfit {
    /// `effect.key`.
    pub parameter: String,
    /// The model's value.
    pub model: f64,
    /// The data's.
    pub fitted: f64,
    /// Lower end of its 95 % interval.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// Names that fit as well within noise.
    pub tied_with: Vec<&'static str>,
}

/// Something that nothing explains.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Unknown {
    /// Recording and statistic.
    pub r#where: String,
    /// Standard deviations.
    pub z: f64,
}

/// Distance of model and data after each step.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Gap {
    /// On the fitted recordings; the first without any added effect.
    pub train: Vec<f64>,
    /// On the others; the same numbers where nothing was held out.
    pub heldout: Vec<f64>,
    /// What the final model's own sensors have.
    pub floor: f64,
    /// Standard deviation of the floor.
    pub floor_sd: f64,
}

impl Gap {
    /// Whether other recordings than the fitted ones judged.
    #[must_use]
    pub fn is_held_out(&self) -> bool {
        self.train != self.heldout
    }

    /// Largest held-out gap of a set that is explained: the floor, and a hundredth of what the first one was beyond it or two
    /// deviations of the floor.
    #[must_use]
    pub fn limit(&self) -> f64 {
        let first = self.heldout.first().map_or(0.0, |first| first - self.floor);
        self.floor + (0.01 * first).max(2.0 * self.floor_sd)
    }

    /// Whether the last held-out gap is within it.
    #[must_use]
    pub fn is_closed(&self) -> bool {
        self.heldout.last().is_none_or(|last| *last <= self.limit())
    }
}

/// Everything that is said.
#[derive(Clone, Debug, Serialize)]
pub struct Diagnosis {
    /// In one word.
    pub verdict: Verdict,
    /// What is wrong in the laboratory: lamps, scenes, files. It was looked for first, and no effect stands for it.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub faults: Vec<Fault>,
    /// Effects that were added.
    pub effects: Vec<FoundEffect>,
    /// Numbers that were wrong.
    pub misfits: Vec<Misfit>,
    /// What is left.
    pub unknown: Vec<Unknown>,
    /// Distances.
    pub gap: Gap,
    /// What to record where names tie.
    pub settle: Vec<String>,
    /// Names that this set cannot show.
    pub not_testable: Vec<&'static str>,
    /// Seconds that it took.
    pub seconds: f64,
    /// Simulations that the cache had, and those that were made; nothing without a cache. It stands in no file, as it is no part of the answer.
    #[serde(skip)]
    pub cached: Option<[usize; 2]>,
    /// Where the held-out data come from, and other remarks.
    pub notes: Vec<String>,
    /// The sets, the camera and the numbers that it began with; nothing of sets that share a reference.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub about: Option<About>,
    /// The camera with the effects added.
    #[serde(skip)]
    pub camera: Camera,
    /// Plots' numbers.
    #[serde(skip)]
    pub traces: Traces,
}

impl Diagnosis {
    /// Of sets that are at fault in so much that nothing can be said of the camera.
    pub(in crate::diagnose) fn stopped(faults: Vec<Fault>, camera: Camera) -> Self {
        Self {
            verdict: Verdict::Unknown,
            faults,
            effects: Vec::new(),
            misfits: Vec::new(),
            unknown: Vec::new(),
            gap: Gap { train: Vec::new(), heldout: Vec::new(), floor: 0.0, floor_sd: 0.0 },
            settle: Vec::new(),
            not_testable: Vec::new(),
            seconds: 0.0,
            cached: None,
            notes: vec![
                "Too few recordings are left to judge the camera: nothing was searched for.".to_owned(),
            ],
            about: None,
            camera,
            traces: Traces::default(),
        }
    }
}

/// What the report shows.
#[derive(Clone, Debug, Default)]
pub struct Traces {
    /// Statistic, recording, deviation before and after, in standard deviations.
    pub deviations: Vec<(String, String, f64, f64)>,
    /// Names with their misfit and whether they tied, by round.
    pub tournament: Vec<Vec<(&'static str, f64, bool)>>,
    /// The winner of each round, and what became of it.
    pub steps: Vec<(&'static str, Fate)>,
    /// What was done before each number of the gap.
    pub gaps: Vec<String>,
    /// The recordings, the model before and the model after.
    pub pictures: Vec<(&'static str, Picture)>,
}
