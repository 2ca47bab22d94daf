//! Conversion of the result of a search to a diagnosis.

use crate::fits::fitter::{Fitter, metric_allowing_events};
use crate::fits::interval::{interval, of_data};
use crate::light::lamp::{Lamp, LampKind};
use crate::light::lamp_posterior::LampPosterior;
use crate::null_model::model::NullModel;
use crate::prepared::provenance::words;
use crate::prepared::recordings::PreparedSet;
use crate::search::effect_search::SearchResult;
use crate::search::parameter_mismatch::{Contradicted, Contradictions, contradicted};
use crate::search::round::{Round, Undecided, kept, tied};
use crate::search::state::{Search, values_and_limits};
use crate::sensors::deadline::in_time;
use crate::thresholds::{
    COMPLETE_SHARE, INCOMPLETE_MAX_FLOORS, MAX_AMBIGUOUS_PARAMETERS, MAX_BASE_CHANGE, MAX_FLOORS,
    MEAN_SIMULATIONS, MIN_EXPLAINED_SHARE, MIN_MISMATCH,
};
use crate::verdict::diagnosis::{
    DiagnosedLamp, Diagnosis, Discrepancy, FoundEffect, LampImpact, LimitTest, Parameter, ParameterMismatch,
    ReportData, UnexplainedStatistic, Verdict,
};
use crate::verdict::effect_limits::{EffectLimit, effect_limits};
use crate::verdict::figures::{rate_residuals, set_plots};
use crate::verdict::qualifications::{open_discrepancy_note, set_notes, untested_note};
use crate::verdict::recommended_recordings::recommended_recordings;
use spikelane::effects::Camera;
use spikelane::error::Result;
use spikelane_calibrate::ProgressCallback;

impl Search<'_> {
    /// Converts the result of the search to a diagnosis. `given` is the camera of the caller.
    pub(crate) fn diagnosis(
        &self,
        mut found: SearchResult,
        given: Option<&Camera>,
        progress: ProgressCallback<'_>,
    ) -> Result<Diagnosis> {
        let Fitter { reference, data } = &self.fitter;
        let mut diagnosis = outcome(&self.fitter, &mut found, given)?;
        progress("pictures", 0.95);
        reference.model.context.deadline.lift();
        let last = (&found.fit.model, found.fit.u.as_slice());
        let PreparedSet { set, setup, measured } = &self.recordings.fitted;
        diagnosis.rates = rate_residuals(reference, &found, data, &measured.scans);
        diagnosis.traces.plots = set_plots(reference, set, &measured.scans, last)?;
        diagnosis.notes.extend(set_notes(setup, &self.recordings.aside, self.recordings.held_out));
        diagnosis.faults.clone_from(&self.recordings.faults);
        Ok(diagnosis)
    }
}

fn outcome(fitter: &Fitter<'_>, found: &mut SearchResult, given: Option<&Camera>) -> Result<Diagnosis> {
    let Fitter { reference, data } = fitter;
    let off = data - &found.own.mean;
    // The linear fit still predicts a small step. It is used if it reduces the cost.
    let steps = [found.fit.bounds(), found.fit.bounds_of_effects()];
    // A set that agrees with the first simulations keeps its calibrated numbers. After the time limit, no step is made.
    let is_final = reference.is_preliminary() || !found.undecided.is_empty();
    for mut bounds in steps.into_iter().filter(|_| !is_final) {
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
    let remaining = metric_allowing_events(reference, &found.fit.events)?.square(&(data - &found.fit.mean));
    let explained_share = (found.train[0] - remaining) / (found.train[0] - found.own.allowed_floor).max(1.0);
    let is_inadequate = is_inadequate(&found.train, found.own.floor);
    let (mut effects, mut mismatches) = (Vec::new(), Vec::new());
    for (i, (effect, _)) in found.fit.effects.iter().enumerate() {
        let name = effect.name;
        let round = kept(&found.rounds, name);
        let parameters: Vec<Parameter> = found.fit.knobs_of(i).map(interval).collect();
        let ambiguous_with = ambiguous_names(round);
        let share = round.map_or(0.0, |r| r.share);
        let is_faint = round.is_some_and(|r| r.faint);
        let is_unconfirmed = found.undecided.contains(&Undecided::NecessityOfEffects);
        let is_tentative = is_faint
            || is_unconfirmed
            || (found.left && (share < 0.5 || explained_share < MIN_EXPLAINED_SHARE || is_inadequate));
        // If the name of a base parameter is tentative, its fitted value is not evidence of a mismatch.
        if effect.is_base_model
            && !is_tentative
            && let Some(p) = parameters.first()
        {
            let knob = found.fit.model.knobs[found.fit.knobs_of(i).start];
            mismatches.push(ParameterMismatch {
                parameter: format!("{name}.{}", p.name),
                model_value: knob.value(0.0),
                fitted_value: p.value,
                low: p.low,
                high: p.high,
                ambiguous_with,
                is_tentative: false,
            });
            continue;
        }
        let evidence = round.map_or_else(String::new, |r| r.evidence.clone())
            + &found.fit.located.describe(effect, &reference.setup.recordings);
        let step = round.and_then(|r| r.step);
        effects.push(FoundEffect { name, parameters, ambiguous_with, is_tentative, evidence, step });
    }
    let mut notes = Vec::new();
    let contradictions = given.map_or_else(Vec::new, |given| {
        let rest = Remainder { distance: remaining, is_inadequate };
        base_mismatches(reference, found, data, given, &rest)
    });
    if !found.has_disturbed_base(reference) {
        mismatches.extend(contradictions);
    } else if !contradictions.is_empty() {
        notes.push(untested_note(&contradictions));
    }
    let is_named = mismatches.iter().any(|m| !m.is_tentative) || effects.iter().any(|e| !e.is_tentative);
    let discrepancy = Discrepancy {
        fitted_set: found.train.clone(),
        held_out_set: found.heldout.clone(),
        noise_floor: found.own.floor,
        noise_floor_sd: found.own.floor_sd,
    };
    let verdict = match (found.left, is_named) {
        _ if found.undecided.iter().any(|u| matches!(u, Undecided::Agreement(_))) => Verdict::Undecided,
        (false, true) if discrepancy.is_within_limit() => Verdict::Explained,
        (false, false) => Verdict::Agrees,
        (_, true) => Verdict::PartlyExplained,
        (true, false) => Verdict::Unknown,
    };
    if !found.left && verdict == Verdict::PartlyExplained {
        notes.push(open_discrepancy_note(&discrepancy));
    }
    let sample = found.fit.model.sample(&found.fit.u, &[])?;
    let mut camera = sample.camera;
    camera.name = "diagnosed".to_owned();
    camera.source = "found by diagnose; see diagnosis.json and report.html".to_owned();
    Ok(Diagnosis {
        verdict,
        faults: Vec::new(),
        provenance: None,
        effects,
        lamps: lamps(reference, found, &(data - &found.own.mean), &mismatches),
        parameter_mismatches: mismatches,
        rates: Vec::new(),
        unexplained: match verdict {
            _ if found.left => unexplained_statistics(reference, found, &(data - &found.own.mean)),
            // No single statistic exceeds its limit. These statistics contribute most to the held-out discrepancy.
            Verdict::PartlyExplained => unexplained_statistics(reference, found, &found.off),
            _ => Vec::new(),
        },
        notes,
        discrepancy,
        tests: limit_tests(reference, found, data),
        undecided: found.undecided.iter().map(Undecided::sentence).collect(),
        recommended_recordings: recommended_recordings(reference, &found.rounds),
        limits: limits(reference, found, data, verdict)?,
        undetectable: reference.not_testable(),
        seconds: 0.0,
        cache_counts: None,
        camera,
        traces: traces(reference, found, data),
    })
}

/// Returns limits for the effects that a model lacks, if the model describes the recordings.
fn limits(
    reference: &NullModel,
    found: &SearchResult,
    data: &nalgebra::DVector<f64>,
    verdict: Verdict,
) -> Result<Vec<EffectLimit>> {
    if !verdict.is_complete() {
        return Ok(Vec::new());
    }
    let off = data - &found.own.mean;
    let limits = effect_limits(reference, &found.own.metric, &off, &found.fit.located, |signature| {
        found.fit.lacks(signature)
    });
    // Without time for further simulations, the diagnosis states no limits.
    Ok(in_time(limits)?.unwrap_or_default())
}

/// Returns whether a model does not describe the data. `gaps` are the discrepancies after each step, and `floor` is
/// the noise floor of the model.
fn is_inadequate(gaps: &[f64], floor: f64) -> bool {
    let [first, .., last] = gaps else { return false };
    let explained = (first - last) / (first - floor).max(1.0);
    *last > MAX_FLOORS * floor || (*last > INCOMPLETE_MAX_FLOORS * floor && explained < COMPLETE_SHARE)
}

impl SearchResult {
    /// Returns whether the added effects change the base parameters, or the noise, so strongly that the base
    /// parameters are not determined.
    ///
    /// Rate maps contain no temporal noise, and the base parameters of such sets remain unchanged.
    fn has_disturbed_base(&self, reference: &NullModel) -> bool {
        let mut numbers = self.fit.u[..self.fit.base_knobs()].iter().zip(&self.own.deviations);
        let is_changed = numbers.any(|(u, deviation)| u.abs() > MAX_BASE_CHANGE.max(3.0 * deviation));
        !self.fit.effects.is_empty() && !reference.setup.has_rate_maps && (is_changed || self.fit.is_noisy())
    }

    /// Returns the standard deviation of knob `j`. For a base parameter, the prior of the calibration is excluded,
    /// because it is not evidence about the calibration itself.
    fn deviation(&self, j: usize) -> f64 {
        let deviation = self.own.deviations[j];
        if j < self.fit.base_knobs() { of_data(deviation) } else { deviation }
    }
}

fn parameter(found: &SearchResult, j: usize) -> Parameter {
    parameter_at(found, j, found.fit.u[j], found.deviation(j))
}

fn parameter_at(found: &SearchResult, j: usize, u: f64, deviation: f64) -> Parameter {
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
    found: &SearchResult,
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

/// Compares the recordings with the limits of the final model.
fn limit_tests(reference: &NullModel, found: &SearchResult, data: &nalgebra::DVector<f64>) -> Vec<LimitTest> {
    const QUANTITIES: [&str; 3] =
        ["total deviation", "largest deviation of a statistic", "largest score of an effect"];
    let values =
        |off: &nalgebra::DVector<f64>| values_and_limits(&found.fit, &found.own, off, &reference.signatures);
    let fitted = values(&(data - &found.own.mean));
    let is_tested = !found.fit.effects.is_empty() && found.train != found.heldout;
    let held_out = is_tested.then(|| values(&found.off));
    let test = |i: usize| LimitTest {
        quantity: QUANTITIES[i],
        fitted_set: fitted[i].0,
        held_out_set: held_out.map(|values| values[i].0),
        limit: fitted[i].1,
        exceedance_probability: reference.limit_probability(),
    };
    (0..QUANTITIES.len()).map(test).collect()
}

fn ambiguous_names(round: Option<&Round>) -> Vec<&'static str> {
    round.map_or_else(Vec::new, |r| tied(r).into_iter().map(|e| e.name).collect())
}

/// What a model with effects leaves of the fitted set.
struct Remainder {
    /// Squared distance from the data.
    distance: f64,
    is_inadequate: bool,
}

/// Returns the parameters of the given camera that the data contradict.
///
/// An effect that is not in the model also moves base parameters. A parameter is therefore tentative unless it fulfills the
/// conditions of an effect: the held-out set confirms it, and if anything is left, the parameter explains most of the
/// initial discrepancy.
fn base_mismatches(
    reference: &NullModel,
    found: &SearchResult,
    data: &nalgebra::DVector<f64>,
    given: &Camera,
    rest: &Remainder,
) -> Vec<ParameterMismatch> {
    let knobs = &reference.model.knobs;
    let places = reference.model.places_in(given);
    let off = data - &found.fit.mean;
    let Contradictions { numbers, distance } = contradicted(found, &reference.missed, &off, &places);
    let share_of =
        |explained: f64| explained / (explained + rest.distance - found.own.allowed_floor).max(1.0);
    let explained_share = share_of(distance + found.train[0] - rest.distance);
    let mismatch = |c: &Contradicted| {
        let knob = knobs[c.number];
        let p = parameter_at(found, c.number, c.position, c.deviation);
        let is_part = found.left
            && (share_of(c.gain) < 0.5 || explained_share < MIN_EXPLAINED_SHARE || rest.is_inadequate);
        let is_tentative = is_part || !c.is_borne_out;
        let mut ambiguous_with: Vec<&str> = c.tied.iter().map(|j| knobs[*j].effect.name).collect();
        if is_tentative {
            ambiguous_with.extend(reference.effects_like(&c.change, &found.fit));
        }
        ambiguous_with.truncate(MAX_AMBIGUOUS_PARAMETERS);
        ParameterMismatch {
            parameter: format!("{}.{}", knob.effect.name, knob.key),
            model_value: knob.value_in(given),
            fitted_value: p.value,
            low: p.low,
            high: p.high,
            ambiguous_with,
            is_tentative,
        }
    };
    let is_reported =
        |m: &ParameterMismatch| (m.fitted_value - m.model_value).abs() > MIN_MISMATCH * m.model_value.abs();
    numbers.iter().map(mismatch).filter(is_reported).collect()
}

/// Returns the statistics with the largest deviations.
fn unexplained_statistics(
    reference: &NullModel,
    found: &SearchResult,
    off: &nalgebra::DVector<f64>,
) -> Vec<UnexplainedStatistic> {
    let scores = found.own.metric.scores(off);
    let mut order: Vec<usize> = (0..scores.len()).collect();
    order.sort_by(|a, b| scores[*b].abs().total_cmp(&scores[*a].abs()));
    let entry = |i: usize| {
        let (name, place) = reference.words(i);
        UnexplainedStatistic { r#where: format!("{place}: {name}"), z: scores[i] }
    };
    order.into_iter().take(6).map(entry).collect()
}

fn traces(reference: &NullModel, found: &SearchResult, data: &nalgebra::DVector<f64>) -> ReportData {
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
    use super::is_inadequate;

    #[test]
    fn a_model_is_inadequate_if_a_large_discrepancy_remains() {
        assert!(!is_inadequate(&[1000.0], 10.0), "nothing was added");
        assert!(is_inadequate(&[1e6, 3e4, 2100.0], 200.0), "ten times its own gap");
        assert!(!is_inadequate(&[1e6, 1500.0], 200.0), "a thousandth is left");
        assert!(is_inadequate(&[1e6, 6e4], 15e3), "four times its own gap, and a twentieth");
        assert!(!is_inadequate(&[1e4, 500.0], 200.0), "a twentieth, but hardly more than its own gap");
    }
}
