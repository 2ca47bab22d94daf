//! From a search's end to what is said of it.

use super::diagnosis::{
    DiagnosedLamp, Diagnosis, Discrepancy, FoundEffect, LampImpact, Parameter, ParameterMismatch, ReportData,
    UnexplainedStatistic, Verdict,
};
use super::next_recording::settle;
use super::notes::{open, unjudged};
use crate::diagnose::fit::draws::MEAN_SIMULATIONS;
use crate::diagnose::fit::fitter::Fitter;
use crate::diagnose::fit::found_lamps::LampPosterior;
use crate::diagnose::fit::interval::{interval, of_data};
use crate::diagnose::fit::unlocated::allowing;
use crate::diagnose::given::about::words;
use crate::diagnose::null::reference::NullModel;
use crate::diagnose::search::contradicted::{Contradicted, Contradictions, contradicted};
use crate::diagnose::search::round::tied;
use crate::diagnose::search::round::{Round, kept};
use crate::diagnose::search::search::Found;
use crate::diagnose::sensors::lamp::{Lamp, LampKind};
use spikelane::effects::Camera;
use spikelane::error::Result;

/// Share of the first excess that all names together must explain where something is left: what the catalog holds
/// leaves a few per cent at most, and a name that stands in for something else leaves a fifth.
const WHOLE: f64 = 0.95;

/// Misfit left, over what sensors of the final model have, from which on that model is a stranger to the data: three deviations of how many
/// events a recording holds, which is what its own sensors differ by.
const STRANGE: f64 = 10.0;

/// The same for a model that leaves more than a hundredth of what there was: what the catalog holds left that much of strong effects
/// or that many times the gap of its own sensors, never both.
const POOR: (f64, f64) = (3.0, 0.99);

/// Share by which a base number moves beside the effects from which on its derivative says nothing of it: row noise of 20 mV, which is not
/// in the camera, makes its threshold noise 3.6 times what it is, its thresholds' spread 0.37, and the light's noise a fifth.
const GAVE_WAY: f64 = 0.45;

/// Names beside a number that the data contradict, at most.
const MOST_TIED: usize = 2;

/// Relative deviation below which a known number is not worth a word.
const WORTH: f64 = 0.02;

pub(in crate::diagnose) fn outcome(
    fitter: Fitter<'_>,
    found: &mut Found,
    given: Option<&Camera>,
) -> Result<Diagnosis> {
    let Fitter { reference, data } = fitter;
    let off = data - &found.own.mean;
    // The last, small step that the linear fit still asks for.
    for mut bounds in [found.fit.bounds(), found.fit.bounds_of_effects()] {
        for (bound, deviation) in bounds.iter_mut().zip(&found.own.deviations) {
            (bound.low, bound.high) = (bound.low.max(-2.0 * deviation), bound.high.min(2.0 * deviation));
        }
        let mut last = found.fit.moved(&found.own.metric.bounded(&off, &bounds));
        fitter.evaluate(&mut last, MEAN_SIMULATIONS)?;
        if last.cost < found.fit.cost {
            found.fit = last;
            break;
        }
    }
    let interval = |j: usize| parameter(found, j);
    let left = allowing(reference, &found.fit.events)?.square(&(data - &found.fit.mean));
    let whole = (found.train[0] - left) / (found.train[0] - found.own.allowed_floor).max(1.0);
    let strange = strange(&found.train, found.own.floor);
    let (mut effects, mut misfits) = (Vec::new(), Vec::new());
    for (i, (effect, _)) in found.fit.effects.iter().enumerate() {
        let name = effect.name;
        let round = kept(&found.rounds, name);
        let parameters: Vec<Parameter> = found.fit.knobs_of(i).map(interval).collect();
        let tied_with = ties(round);
        let share = round.map_or(0.0, |r| r.share);
        let faint = round.is_some_and(|r| r.faint);
        let resembles = faint || (found.left && (share < 0.5 || whole < WHOLE || strange));
        // A number of the base model that only resembles what is there is no wrong number.
        if effect.is_base_model
            && !resembles
            && let Some(p) = parameters.first()
        {
            let knob = found.fit.model.knobs[found.fit.knobs_of(i).start];
            misfits.push(ParameterMismatch {
                parameter: format!("{name}.{}", p.name),
                model_value: knob.value(0.0),
                fitted_value: p.value,
                low: p.low,
                high: p.high,
                ambiguous_with: tied_with,
                is_tentative: false,
            });
            continue;
        }
        let evidence = round.map_or_else(String::new, |r| r.evidence.clone())
            + &found.fit.located.words(effect, &reference.setup.recordings);
        let step = round.and_then(|r| r.step);
        effects.push(FoundEffect {
            name,
            parameters,
            ambiguous_with: tied_with,
            is_tentative: resembles,
            evidence,
            step,
        });
    }
    let mut notes = Vec::new();
    let wrong = given.map_or_else(Vec::new, |given| {
        let rest = Rest { left, is_strange: strange };
        base_misfits(reference, found, data, given, &rest)
    });
    if !found.gave_way(reference) {
        misfits.extend(wrong);
    } else if !wrong.is_empty() {
        notes.push(unjudged(&wrong));
    }
    let named = misfits.iter().any(|m| !m.is_tentative) || effects.iter().any(|e| !e.is_tentative);
    let gap = Discrepancy {
        fitted_set: found.train.clone(),
        held_out_set: found.heldout.clone(),
        noise_floor: found.own.floor,
        noise_floor_sd: found.own.floor_sd,
    };
    let verdict = match (found.left, named) {
        (false, true) if gap.is_within_limit() => Verdict::Explained,
        (false, false) => Verdict::Agrees,
        (_, true) => Verdict::PartlyExplained,
        (true, false) => Verdict::Unknown,
    };
    if !found.left && verdict == Verdict::PartlyExplained {
        notes.push(open(&gap));
    }
    let sample = found.fit.model.sample(&found.fit.u, &[], reference.setup.recordings.len())?;
    let mut camera = sample.camera;
    camera.name = "diagnosed".to_owned();
    camera.source = "found by diagnose; see diagnosis.json and report.html".to_owned();
    Ok(Diagnosis {
        verdict,
        faults: Vec::new(),
        provenance: None,
        effects,
        lamps: lamps(reference, found, &(data - &found.own.mean), &misfits),
        parameter_mismatches: misfits,
        unexplained: match verdict {
            _ if found.left => unknown(reference, found, &(data - &found.own.mean)),
            // No single statistic is beyond its limit; these are what the gap of the held-out set comes from.
            Verdict::PartlyExplained => unknown(reference, found, &found.off),
            _ => Vec::new(),
        },
        notes,
        discrepancy: gap,
        recommended_recordings: settle(reference, &found.rounds),
        undetectable: reference.not_testable(),
        seconds: 0.0,
        cache_counts: None,
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
    /// Whether the base model's numbers, or what they move, were others before the effects were known than what they are beside these.
    /// In maps nothing strays from readout to readout, and the camera's numbers stay as they were given.
    fn gave_way(&self, reference: &NullModel) -> bool {
        let mut numbers = self.fit.u[..self.fit.base_knobs()].iter().zip(&self.own.deviations);
        let far = numbers.any(|(u, deviation)| u.abs() > GAVE_WAY.max(3.0 * deviation));
        !self.fit.effects.is_empty() && !reference.setup.has_rate_maps && (far || self.fit.is_noisy())
    }

    /// What the data say of a number. Of the base model's, what they say alone: that it was calibrated is no evidence against the
    /// calibration.
    fn deviation(&self, j: usize) -> f64 {
        let deviation = self.own.deviations[j];
        if j < self.fit.base_knobs() { of_data(deviation) } else { deviation }
    }
}

fn parameter(found: &Found, j: usize) -> Parameter {
    parameter_at(found, j, found.fit.u[j], found.deviation(j))
}

fn parameter_at(found: &Found, j: usize, u: f64, deviation: f64) -> Parameter {
    let knob = found.fit.model.knobs[j];
    if let Some(count) = found.fit.count(j) {
        let [low, high] = count.interval();
        return Parameter { name: knob.key, value: count.rate(), low, high };
    }
    let ends = interval(knob.scale, u, deviation, found.own.additive[j]);
    let ends = ends.map(|u| knob.value(knob.clamped(u)));
    Parameter { name: knob.key, value: knob.value(u), low: ends[0].min(ends[1]), high: ends[0].max(ends[1]) }
}

/// Returns the light of recordings and of sources, and the influence of each lamp on the named parameters.
fn lamps(
    reference: &NullModel,
    found: &Found,
    off: &nalgebra::DVector<f64>,
    mismatches: &[ParameterMismatch],
) -> Vec<DiagnosedLamp> {
    let fit = &found.fit;
    let lamps = &fit.model.lamps;
    if lamps.is_empty() {
        return Vec::new();
    }
    let uncertainties: Vec<f64> = lamps.iter().map(|lamp| lamp.uncertainty).collect();
    let moved = found.own.metric.bounded(off, &fit.bounds());
    let posterior =
        LampPosterior::new(&found.own.metric, &reference.lamp_slopes, &uncertainties, off, &moved);
    let name = |j: usize| format!("{}.{}", fit.model.knobs[j].effect.name, fit.model.knobs[j].key);
    let is_named = |j: &usize| *j >= fit.base_knobs() || mismatches.iter().any(|m| m.parameter == name(*j));
    let impact = |k: usize, j: usize| {
        let (knob, u) = (fit.model.knobs[j], fit.u[j]);
        let change = knob.value(knob.clamped(u + posterior.impacts[(j, k)])) - knob.value(u);
        LampImpact { parameter: name(j), change }
    };
    let scenes = &reference.setup.recordings;
    let of = |(k, lamp): (usize, &Lamp)| {
        let source = match &lamp.kind {
            LampKind::Recording => None,
            LampKind::Source(name) => Some(name.clone()),
            LampKind::Repetition => return None,
        };
        // A source has the recording in which it is alone.
        let (alone, _) = *lamp.shares.iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
        Some(DiagnosedLamp {
            file: scenes[alone].file_name(),
            source,
            light: words(scenes[alone].light),
            uncertainty: lamp.uncertainty,
            deviation: posterior.deviations[k],
            error: posterior.errors[k],
            pull: if lamp.uncertainty > 0.0 { posterior.deviations[k] / lamp.uncertainty } else { 0.0 },
            impacts: (0..fit.u.len()).filter(is_named).map(|j| impact(k, j)).collect(),
        })
    };
    lamps.iter().enumerate().filter_map(of).collect()
}

fn ties(round: Option<&Round>) -> Vec<&'static str> {
    round.map_or_else(Vec::new, |r| tied(r).into_iter().map(|e| e.name).collect())
}

/// What a model with effects leaves of the fitted set.
struct Rest {
    /// Squared distance from the data.
    left: f64,
    is_strange: bool,
}

/// Numbers of the given camera that the data contradict.
///
/// What nothing explains moves the base model's numbers too. A number is therefore stated plainly on the conditions of an effect:
/// the held-out set bears it out, and where something is left, the number explains most of what there was.
fn base_misfits(
    reference: &NullModel,
    found: &Found,
    data: &nalgebra::DVector<f64>,
    given: &Camera,
    rest: &Rest,
) -> Vec<ParameterMismatch> {
    let knobs = &reference.model.knobs;
    let places = reference.model.places_in(given);
    let off = data - &found.fit.mean;
    let Contradictions { numbers, distance } = contradicted(found, &reference.missed, &off, &places);
    let beyond = |explained: f64| explained / (explained + rest.left - found.own.allowed_floor).max(1.0);
    let whole = beyond(distance + found.train[0] - rest.left);
    let misfit = |c: &Contradicted| {
        let knob = knobs[c.number];
        let p = parameter_at(found, c.number, c.position, c.deviation);
        let is_part = found.left && (beyond(c.gain) < 0.5 || whole < WHOLE || rest.is_strange);
        let is_tentative = is_part || !c.is_borne_out;
        let mut alike: Vec<&str> = c.tied.iter().map(|j| knobs[*j].effect.name).collect();
        if is_tentative {
            alike.extend(reference.effects_like(&c.change, &found.fit));
        }
        alike.truncate(MOST_TIED);
        ParameterMismatch {
            parameter: format!("{}.{}", knob.effect.name, knob.key),
            model_value: knob.value_in(given),
            fitted_value: p.value,
            low: p.low,
            high: p.high,
            ambiguous_with: alike,
            is_tentative,
        }
    };
    let worth = |m: &ParameterMismatch| (m.fitted_value - m.model_value).abs() > WORTH * m.model_value.abs();
    numbers.iter().map(misfit).filter(worth).collect()
}

/// The recordings and statistics that are furthest off.
fn unknown(reference: &NullModel, found: &Found, off: &nalgebra::DVector<f64>) -> Vec<UnexplainedStatistic> {
    let scores = found.own.metric.scores(off);
    let mut order: Vec<usize> = (0..scores.len()).collect();
    order.sort_by(|a, b| scores[*b].abs().total_cmp(&scores[*a].abs()));
    let entry = |i: usize| {
        let (name, place) = reference.words(i);
        UnexplainedStatistic { r#where: format!("{place}: {name}"), z: scores[i] }
    };
    order.into_iter().take(6).map(entry).collect()
}

fn traces(reference: &NullModel, found: &Found, data: &nalgebra::DVector<f64>) -> ReportData {
    let before = reference.metric.scores(&(data - &reference.mean));
    let after = found.own.metric.scores(&(data - &found.own.mean));
    let row = |i: usize| {
        let (name, place) = reference.words(i);
        (name, place, before[i], after[i])
    };
    let entrants = |r: &Round| r.entrants.iter().map(|e| (e.name, e.misfit, e.tied)).collect();
    ReportData {
        deviations: (0..before.len()).map(row).collect(),
        tournament: found.rounds.iter().map(entrants).collect(),
        step_outcomes: found.rounds.iter().map(|r| (r.winner, r.fate)).collect(),
        discrepancy_labels: found.steps.clone(),
        plots: Vec::new(),
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
