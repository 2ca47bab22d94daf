//! What a diagnosis says.

use serde::Serialize;

use super::candidates::MISFITS;
use super::interval::{interval, of_data};
use super::own::MEAN;
use super::reference::Reference;
use super::search::Found;
use super::settle::{settle, tied};
use super::tournament::Round;
use crate::effects::Camera;
use crate::error::Result;

/// Share of the first excess that all names together must explain where something is left: what the catalogue holds
/// leaves a few per cent at most, and a name that stands in for something else leaves a fifth.
const WHOLE: f64 = 0.95;

/// Misfit left, over what sensors of the final model have, from which on that model is a stranger to the data: three deviations of how many
/// events a recording holds, which is what its own sensors differ by.
const STRANGE: f64 = 10.0;

/// The same for a model that leaves more than a hundredth of what there was: what the catalogue holds left that much of strong effects
/// or that many times the gap of its own sensors, never both.
const POOR: (f64, f64) = (3.0, 0.99);

/// Relative deviation below which a known number is not worth a word.
const WORTH: f64 = 0.02;

/// The verdict.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// Nothing is above its limit.
    Agrees,
    /// Effects or misfits are named, and nothing is left.
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
    /// Whether the name explains less than half of what is there, and so is a likeness only.
    pub resembles: bool,
    /// What speaks for it.
    pub evidence: String,
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
    /// On the others.
    pub heldout: Vec<f64>,
    /// What the final model's own sensors have.
    pub floor: f64,
    /// Standard deviation of the floor.
    pub floor_sd: f64,
}

/// Everything that is said.
#[derive(Clone, Debug, Serialize)]
pub struct Diagnosis {
    /// In one word.
    pub verdict: Verdict,
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
    /// Where the held-out data come from, and other remarks.
    pub notes: Vec<String>,
    /// The camera with the effects added.
    #[serde(skip)]
    pub camera: Camera,
    /// Plots' numbers.
    #[serde(skip)]
    pub traces: Traces,
}

/// What the report shows.
#[derive(Clone, Debug)]
pub struct Traces {
    /// Statistic, recording, deviation before and after, in standard deviations.
    pub deviations: Vec<(String, String, f64, f64)>,
    /// Names with their misfit and whether they tied, by round.
    pub tournament: Vec<Vec<(&'static str, f64, bool)>>,
    /// What was added in each step of the gap, and whether it was kept.
    pub steps: Vec<(&'static str, bool)>,
    /// The recordings, the model before and the model after.
    pub pictures: Vec<(&'static str, super::picture::Picture)>,
}

pub(super) fn outcome(
    reference: &Reference,
    found: &mut Found,
    data: &nalgebra::DVector<f64>,
    given: Option<&Camera>,
) -> Result<Diagnosis> {
    let off = data - &found.own.mean;
    // The last, small step that the linear fit still asks for.
    for mut bounds in [found.fit.bounds(), found.fit.bounds_of_effects()] {
        for (bound, deviation) in bounds.iter_mut().zip(&found.own.deviations) {
            (bound.low, bound.high) = (bound.low.max(-2.0 * deviation), bound.high.min(2.0 * deviation));
        }
        let mut last = found.fit.moved(&found.own.metric.bounded(&off, &bounds));
        reference.evaluate(&mut last, data, MEAN)?;
        if last.cost < found.fit.cost {
            found.fit = last;
            break;
        }
    }
    let interval = |j: usize| parameter(found, j);
    let left = reference.allowing(&found.fit.events)?.square(&(data - &found.fit.mean));
    let whole = (found.train[0] - left) / (found.train[0] - found.own.allowed_floor).max(1.0);
    let strange = strange(&found.train, found.own.floor);
    let (mut effects, mut misfits) = (Vec::new(), Vec::new());
    for (i, (name, _)) in found.fit.effects.iter().enumerate() {
        let round = found.rounds.iter().find(|r| r.accepted && r.winner == *name);
        let parameters: Vec<Parameter> = found.fit.knobs_of(i).map(interval).collect();
        let tied_with = ties(round);
        let share = round.map_or(0.0, |r| r.share);
        let resembles = found.left && (share < 0.5 || whole < WHOLE || strange);
        // A number of the base model that only resembles what is there is no wrong number.
        if MISFITS.contains(name)
            && !resembles
            && let Some(p) = parameters.first()
        {
            let knob = found.fit.model.knobs[found.fit.knobs_of(i).start];
            misfits.push(Misfit {
                parameter: format!("{name}.{}", p.name),
                model: knob.value(0.0),
                fitted: p.value,
                low: p.low,
                high: p.high,
                tied_with,
            });
            continue;
        }
        let after = found.train.get(i + 1).copied().unwrap_or(0.0);
        let evidence = format!(
            "the misfit goes from {:.0} to {after:.0} ({:.0} held out: {:.0})",
            found.train.get(i).copied().unwrap_or(0.0),
            found.heldout.get(i).copied().unwrap_or(0.0),
            found.heldout.get(i + 1).copied().unwrap_or(0.0),
        );
        effects.push(FoundEffect { name, parameters, tied_with, resembles, evidence });
    }
    if let Some(given) = given {
        misfits.extend(base_misfits(reference, found, given));
    }
    let named = !misfits.is_empty() || effects.iter().any(|e| !e.resembles);
    let verdict = match (found.left, named) {
        (false, true) => Verdict::Explained,
        (false, false) => Verdict::Agrees,
        (true, true) => Verdict::PartlyExplained,
        (true, false) => Verdict::Unknown,
    };
    let sample = found.fit.model.sample(&found.fit.u, &[], reference.setup.scenes.len())?;
    let mut camera = sample.camera;
    camera.name = "diagnosed".to_owned();
    camera.source = "found by diagnose; see diagnosis.json and report.html".to_owned();
    Ok(Diagnosis {
        verdict,
        effects,
        misfits,
        unknown: if found.left { unknown(reference, found, data) } else { Vec::new() },
        gap: Gap {
            train: found.train.clone(),
            heldout: found.heldout.clone(),
            floor: found.own.floor,
            floor_sd: found.own.floor_sd,
        },
        settle: settle(reference, &found.rounds),
        not_testable: reference.not_testable(),
        seconds: 0.0,
        notes: Vec::new(),
        camera,
        traces: traces(reference, found, data),
    })
}

/// Whether a model whose own sensors have the gap `floor` is a stranger to data that it brought from the first gap to the last.
fn strange(gaps: &[f64], floor: f64) -> bool {
    let [first, .., last] = gaps else { return false };
    let explained = (first - last) / (first - floor).max(1.0);
    *last > STRANGE * floor || (*last > POOR.0 * floor && explained < POOR.1)
}

impl Found {
    /// What the data say of a number. Of the base model's, what they say alone: that it was calibrated is no evidence against the
    /// calibration.
    fn deviation(&self, j: usize) -> f64 {
        let deviation = self.own.deviations[j];
        if j < self.fit.base_knobs() { of_data(deviation) } else { deviation }
    }
}

fn parameter(found: &Found, j: usize) -> Parameter {
    let (knob, u) = (found.fit.model.knobs[j], found.fit.u[j]);
    let ends = interval(knob.scale, u, found.deviation(j), found.own.additive[j]);
    let ends = ends.map(|u| knob.value(knob.clamped(u)));
    Parameter { name: knob.key, value: knob.value(u), low: ends[0].min(ends[1]), high: ends[0].max(ends[1]) }
}

fn ties(round: Option<&Round>) -> Vec<&'static str> {
    round.map_or_else(Vec::new, |r| tied(r).into_iter().map(|e| e.name).collect())
}

/// Numbers of the given camera that the fit moved.
fn base_misfits(reference: &Reference, found: &Found, given: &Camera) -> Vec<Misfit> {
    let of_knob = |j: usize| {
        let (knob, sd, p) = (found.fit.model.knobs[j], found.deviation(j), parameter(found, j));
        let model = given.effect(knob.effect).and_then(|e| e.get(knob.key).ok()).unwrap_or(knob.centre);
        let off = (p.value - model).abs();
        // A deviation that is as large as the number says nothing about it.
        let told = off > 3.5 * sd * knob.unit && sd * knob.unit < 0.3 * model.abs();
        (told && off > WORTH * model.abs()).then(|| Misfit {
            parameter: format!("{}.{}", knob.effect, knob.key),
            model,
            fitted: p.value,
            low: p.low,
            high: p.high,
            tied_with: Vec::new(),
        })
    };
    (0..reference.model.knobs.len()).filter_map(of_knob).collect()
}

/// The last part of a recording's path.
fn file_name(path: &str) -> String {
    let last = std::path::Path::new(path).file_name();
    last.map_or_else(|| path.to_owned(), |name| name.to_string_lossy().into_owned())
}

impl Reference {
    /// A statistic in words.
    pub(super) fn words(&self, i: usize) -> (String, String) {
        let s = &self.statistics[i];
        let place =
            s.recording.map_or_else(|| "fitted maps".to_owned(), |k| file_name(&self.setup.scenes[k].name));
        (s.name.to_owned(), place)
    }
}

fn unknown(reference: &Reference, found: &Found, data: &nalgebra::DVector<f64>) -> Vec<Unknown> {
    let scores = found.own.metric.scores(&(data - &found.own.mean));
    let mut order: Vec<usize> = (0..scores.len()).collect();
    order.sort_by(|a, b| scores[*b].abs().total_cmp(&scores[*a].abs()));
    let entry = |i: usize| {
        let (name, place) = reference.words(i);
        Unknown { r#where: format!("{place}: {name}"), z: scores[i] }
    };
    order.into_iter().take(6).map(entry).collect()
}

fn traces(reference: &Reference, found: &Found, data: &nalgebra::DVector<f64>) -> Traces {
    let before = reference.metric.scores(&(data - &reference.mean));
    let after = found.own.metric.scores(&(data - &found.own.mean));
    let row = |i: usize| {
        let (name, place) = reference.words(i);
        (name, place, before[i], after[i])
    };
    let entrants = |r: &Round| r.entrants.iter().map(|e| (e.name, e.misfit, e.tied)).collect();
    Traces {
        deviations: (0..before.len()).map(row).collect(),
        tournament: found.rounds.iter().map(entrants).collect(),
        steps: found.rounds.iter().map(|r| (r.winner, r.accepted)).collect(),
        pictures: Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::strange;

    #[test]
    fn a_model_is_a_stranger_where_it_leaves_much_in_its_own_terms_and_in_the_datas() {
        assert!(!strange(&[1000.0], 10.0), "nothing was added");
        assert!(strange(&[1e6, 3e4, 2100.0], 200.0), "ten times its own gap");
        assert!(!strange(&[1e6, 1500.0], 200.0), "a thousandth is left");
        assert!(strange(&[1e6, 6e4], 15e3), "four times its own gap, and a twentieth");
        assert!(!strange(&[1e4, 500.0], 200.0), "a twentieth, but hardly more than its own gap");
    }
}
