//! Converts the result of a search to a diagnosis.

use crate::fits::fitter::{Fitter, metric_allowing_events};
use crate::fits::interval::{interval, of_data};
use crate::light::lamp::{Lamp, LampKind};
use crate::light::lamp_posterior::LampPosterior;
use crate::null_model::model::NullModel;
use crate::prepared::recordings::PreparedSet;
use crate::search::effect_search::SearchResult;
use crate::search::parameter_mismatch::{Contradicted, Contradictions, contradicted};
use crate::search::round::{Round, Undecided, kept, tied};
use crate::search::state::{Search, TestedFit, values_and_limits};
use crate::sensors::deadline::in_time;
use crate::thresholds::{
    COMPLETE_SHARE, INCOMPLETE_MAX_FLOORS, MAX_AMBIGUOUS_PARAMETERS, MAX_BASE_CHANGE, MAX_FLOORS,
    MAX_UNEXPLAINED_STATISTICS, MEAN_SIMULATIONS, MIN_EXPLAINED_SHARE, MIN_MISMATCH,
};
use crate::verdict::diagnosis::{
    DiagnosedLamp, Diagnosis, Discrepancy, FoundEffect, LampImpact, LimitTest, Parameter, ParameterMismatch,
    ReportData, UnexplainedStatistic, Verdict,
};
use crate::verdict::effect_limits::{EffectLimit, effect_limits};
use crate::verdict::figures::{rate_residuals, set_plots};
use crate::verdict::qualifications::{open_discrepancy_note, set_notes, untested_note};
use crate::verdict::recommended_recordings::recommended_recordings;
use nalgebra::DVector;
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
        take_last_step(&self.fitter, &mut found)?;
        let mut diagnosis = Outcome::new(&self.fitter, &found)?.diagnosis(given)?;
        progress("pictures", 0.95);
        reference.model.context.deadline.lift();
        let fit = &found.last.fit;
        let PreparedSet { set, setup, measured } = &self.recordings.fitted;
        diagnosis.rates = rate_residuals(reference, &found, data, &measured.scans);
        diagnosis.traces.plots = set_plots(reference, set, &measured.scans, (&fit.model, &fit.u))?;
        diagnosis.notes.extend(set_notes(setup, &self.recordings.aside, self.recordings.held_out));
        diagnosis.faults.clone_from(&self.recordings.faults);
        Ok(diagnosis)
    }
}

/// Makes the small step that a linear fit still predicts, if it reduces the cost.
///
/// A set that agrees with the first simulations keeps its calibrated parameters. If the time limit was reached, no
/// step is made.
fn take_last_step(fitter: &Fitter<'_>, found: &mut SearchResult) -> Result<()> {
    if fitter.reference.is_preliminary() || !found.undecided.is_empty() {
        return Ok(());
    }
    let TestedFit { fit, own, .. } = &mut found.last;
    let off = &fitter.data - &own.mean;
    for mut bounds in [fit.bounds(), fit.bounds_of_effects()] {
        for (bound, deviation) in bounds.iter_mut().zip(&own.deviations) {
            (bound.low, bound.high) = (bound.low.max(-2.0 * deviation), bound.high.min(2.0 * deviation));
        }
        let mut next = fit.moved(&own.metric.bounded(&off, &bounds));
        fitter.evaluate(&mut next, MEAN_SIMULATIONS)?;
        if next.cost < fit.cost {
            *fit = next;
            break;
        }
    }
    Ok(())
}

/// Returns whether the final model fails to describe the data. `gaps` contains the discrepancy after each step, and
/// `floor` is the noise floor of the final model.
fn is_inadequate(gaps: &[f64], floor: f64) -> bool {
    let [first, .., last] = gaps else { return false };
    let explained = (first - last) / (first - floor).max(1.0);
    *last > MAX_FLOORS * floor || (*last > INCOMPLETE_MAX_FLOORS * floor && explained < COMPLETE_SHARE)
}

fn mismatch(
    effect: &str,
    p: &Parameter,
    model_value: f64,
    ambiguous_with: Vec<&'static str>,
    is_tentative: bool,
) -> ParameterMismatch {
    ParameterMismatch {
        parameter: format!("{effect}.{}", p.name),
        model_value,
        fitted_value: p.value,
        low: p.low,
        high: p.high,
        ambiguous_with,
        is_tentative,
    }
}

/// The result of a search, with quantities that several parts of a diagnosis require.
struct Outcome<'a> {
    reference: &'a NullModel,
    data: &'a DVector<f64>,
    found: &'a SearchResult,
    last: &'a TestedFit,
    /// Deviation of the fitted set from the mean of the simulated sensors of the final model.
    off: DVector<f64>,
    /// Discrepancies of the fitted set after each step.
    discrepancies: Vec<f64>,
    /// Squared distance between the fitted set and the final model, in the metric in which the numbers of events
    /// are free.
    distance: f64,
    /// Whether the final model does not describe the fitted set.
    is_inadequate: bool,
}

impl<'a> Outcome<'a> {
    fn new(fitter: &'a Fitter<'a>, found: &'a SearchResult) -> Result<Self> {
        let Fitter { reference, data } = fitter;
        let TestedFit { fit, own, .. } = &found.last;
        let metric = metric_allowing_events(reference, &fit.events)?;
        let discrepancies = found.discrepancies(0);
        Ok(Self {
            reference,
            data,
            found,
            last: &found.last,
            off: data - &own.mean,
            distance: metric.square(&(data - &fit.mean)),
            is_inadequate: is_inadequate(&discrepancies, own.floor),
            discrepancies,
        })
    }

    fn diagnosis(&self, given: Option<&Camera>) -> Result<Diagnosis> {
        let Self { reference, found, last: TestedFit { fit, own, left, .. }, .. } = self;
        let (effects, mut mismatches) = self.effects();
        let mut notes = Vec::new();
        let contradictions = given.map_or_else(Vec::new, |given| self.base_mismatches(given));
        if !self.has_disturbed_base() {
            mismatches.extend(contradictions);
        } else if !contradictions.is_empty() {
            notes.push(untested_note(&contradictions));
        }
        let is_named = mismatches.iter().any(|m| !m.is_tentative) || effects.iter().any(|e| !e.is_tentative);
        let discrepancy = Discrepancy {
            fitted_set: self.discrepancies.clone(),
            held_out_set: found.discrepancies(1),
            noise_floor: own.floor,
            noise_floor_sd: own.floor_sd,
        };
        let verdict = match (*left, is_named) {
            _ if found.undecided.iter().any(|u| matches!(u, Undecided::Agreement(_))) => Verdict::Undecided,
            (false, true) if discrepancy.is_within_limit() => Verdict::Explained,
            (false, false) => Verdict::Agrees,
            (_, true) => Verdict::PartlyExplained,
            (true, false) => Verdict::Unknown,
        };
        if !left && verdict == Verdict::PartlyExplained {
            notes.push(open_discrepancy_note(&discrepancy));
        }
        let mut camera = fit.model.sample(&fit.u, &[])?.camera;
        camera.name = "diagnosed".to_owned();
        camera.source = "found by diagnose; see diagnosis.json and report.html".to_owned();
        Ok(Diagnosis {
            verdict,
            effects,
            lamps: self.lamps(&mismatches),
            parameter_mismatches: mismatches,
            unexplained: match verdict {
                _ if *left => self.unexplained_statistics(&self.off),
                // No single statistic exceeds its limit. The statistics with the largest held-out deviations are
                // listed instead.
                Verdict::PartlyExplained => self.unexplained_statistics(&self.last.off),
                _ => Vec::new(),
            },
            notes,
            discrepancy,
            tests: self.limit_tests(),
            undecided: found.undecided.iter().map(Undecided::sentence).collect(),
            recommended_recordings: recommended_recordings(reference, &found.rounds),
            limits: self.limits(verdict)?,
            undetectable: reference.not_testable(),
            traces: self.traces(),
            ..Diagnosis::stopped(Vec::new(), camera)
        })
    }

    /// Returns the added effects. If the base model already contains an added effect, the effect is a parameter
    /// mismatch.
    fn effects(&self) -> (Vec<FoundEffect>, Vec<ParameterMismatch>) {
        let TestedFit { fit, own, .. } = self.last;
        let first = self.discrepancies[0];
        let explained_share = (first - self.distance) / (first - own.allowed_floor).max(1.0);
        let is_unconfirmed = self.found.undecided.contains(&Undecided::NecessityOfEffects);
        let (mut effects, mut mismatches) = (Vec::new(), Vec::new());
        for (i, (effect, _)) in fit.effects.iter().enumerate() {
            let (name, round) = (effect.name, kept(&self.found.rounds, effect.name));
            let parameters: Vec<Parameter> = fit.knobs_of(i).map(|j| self.parameter(j)).collect();
            let ambiguous_with =
                round.map_or_else(Vec::new, |r| tied(r).into_iter().map(|e| e.name).collect());
            let share = round.map_or(0.0, |r| r.share);
            let is_tentative = round.is_some_and(|r| r.faint)
                || is_unconfirmed
                || self.is_tentative_share(share, explained_share);
            // If the name is tentative, the fitted value of a base parameter is no evidence of a mismatch.
            if effect.is_base_model
                && !is_tentative
                && let Some(p) = parameters.first()
            {
                let model_value = fit.model.knobs[fit.knobs_of(i).start].value(0.0);
                mismatches.push(mismatch(name, p, model_value, ambiguous_with, false));
                continue;
            }
            let evidence = round.map_or_else(String::new, |r| r.evidence.clone())
                + &fit.located.describe(effect, &self.reference.setup.recordings);
            let step = round.and_then(|r| r.step);
            effects.push(FoundEffect { name, parameters, ambiguous_with, is_tentative, evidence, step });
        }
        (effects, mismatches)
    }

    /// Returns whether an effect that explains `share` of the excess is tentative because a significant discrepancy
    /// remains. All added effects together explain `explained_share`.
    fn is_tentative_share(&self, share: f64, explained_share: f64) -> bool {
        self.last.left && (share < 0.5 || explained_share < MIN_EXPLAINED_SHARE || self.is_inadequate)
    }

    /// Returns whether the recordings do not determine the base parameters, because the added effects change these
    /// parameters or the noise strongly.
    ///
    /// Rate maps contain no temporal noise, so their base parameters are always determined.
    fn has_disturbed_base(&self) -> bool {
        let TestedFit { fit, own, .. } = self.last;
        let mut numbers = fit.u[..fit.base_knobs()].iter().zip(&own.deviations);
        let is_changed = numbers.any(|(u, deviation)| u.abs() > MAX_BASE_CHANGE.max(3.0 * deviation));
        !fit.effects.is_empty() && !self.reference.setup.has_rate_maps && (is_changed || fit.is_noisy())
    }

    /// Returns the value and the interval of parameter `j`. For a base parameter, the interval excludes the prior.
    /// The prior comes from the calibration, so it is no evidence about the calibration.
    fn parameter(&self, j: usize) -> Parameter {
        let TestedFit { fit, own, .. } = self.last;
        let deviation = own.deviations[j];
        let deviation = if j < fit.base_knobs() { of_data(deviation) } else { deviation };
        self.parameter_at(j, fit.u[j], deviation)
    }

    fn parameter_at(&self, j: usize, u: f64, deviation: f64) -> Parameter {
        let TestedFit { fit, own, .. } = self.last;
        let knob = fit.model.knobs[j];
        if let Some(count) = fit.count(j) {
            let [low, high] = count.interval();
            return Parameter { name: knob.key, value: count.rate(), low, high };
        }
        let [a, b] = interval(knob.scale, u, deviation, own.additive[j]).map(|u| knob.value(knob.clamped(u)));
        Parameter { name: knob.key, value: knob.value(u), low: a.min(b), high: a.max(b) }
    }

    /// Returns the light of the recordings and of the sources, with the influence of each lamp on the named
    /// parameters.
    fn lamps(&self, mismatches: &[ParameterMismatch]) -> Vec<DiagnosedLamp> {
        let TestedFit { fit, own, .. } = self.last;
        let lamps = &fit.model.lamps;
        if lamps.is_empty() {
            return Vec::new();
        }
        let uncertainties: Vec<f64> = lamps.iter().map(|lamp| lamp.uncertainty).collect();
        let moved = own.metric.bounded(&self.off, &fit.bounds());
        let slopes = &self.reference.lamp_slopes;
        let posterior = LampPosterior::new(&own.metric, slopes, &uncertainties, &self.off, &moved);
        let name = |j: usize| format!("{}.{}", fit.model.knobs[j].effect.name, fit.model.knobs[j].key);
        let is_named =
            |j: &usize| *j >= fit.base_knobs() || mismatches.iter().any(|m| m.parameter == name(*j));
        let impact = |k: usize, j: usize| {
            let (knob, u) = (fit.model.knobs[j], fit.u[j]);
            let change = knob.value(knob.clamped(u + posterior.impacts[(j, k)])) - knob.value(u);
            LampImpact { parameter: name(j), change }
        };
        let scenes = &self.reference.setup.recordings;
        let of = |(k, lamp): (usize, &Lamp)| {
            let source = match &lamp.kind {
                LampKind::Recording => None,
                LampKind::Source(name) => Some(name.clone()),
                LampKind::Repetition => return None,
            };
            // The share of a source is largest in the recording in which it is alone.
            let (alone, _) = *lamp.shares.iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
            let deviation = posterior.deviations[k];
            Some(DiagnosedLamp {
                file: scenes[alone].file_name(),
                source,
                light: scenes[alone].light_description(),
                uncertainty: lamp.uncertainty,
                deviation,
                error: posterior.errors[k],
                pull: if lamp.uncertainty > 0.0 { deviation / lamp.uncertainty } else { 0.0 },
                impacts: (0..fit.u.len()).filter(is_named).map(|j| impact(k, j)).collect(),
            })
        };
        lamps.iter().enumerate().filter_map(of).collect()
    }

    /// Compares the recordings with the limits of the final model.
    fn limit_tests(&self) -> Vec<LimitTest> {
        const QUANTITIES: [&str; 3] =
            ["total deviation", "largest deviation of a statistic", "largest score of an effect"];
        let TestedFit { fit, own, off, .. } = self.last;
        let values = |off| values_and_limits(fit, own, off, &self.reference.signatures);
        let fitted = values(&self.off);
        let is_tested = !fit.effects.is_empty() && self.discrepancies != self.found.discrepancies(1);
        let held_out = is_tested.then(|| values(off));
        let test = |i: usize| LimitTest {
            quantity: QUANTITIES[i],
            fitted_set: fitted[i].0,
            held_out_set: held_out.map(|values| values[i].0),
            limit: fitted[i].1,
            exceedance_probability: self.reference.limit_probability(),
        };
        (0..QUANTITIES.len()).map(test).collect()
    }

    /// Returns upper limits for the effects that the final model lacks. The list is empty unless the model
    /// describes the recordings.
    fn limits(&self, verdict: Verdict) -> Result<Vec<EffectLimit>> {
        if !verdict.is_complete() {
            return Ok(Vec::new());
        }
        let TestedFit { fit, own, .. } = self.last;
        let limits = effect_limits(self.reference, &own.metric, &self.off, &fit.located, |s| fit.lacks(s));
        // If there is no time for further simulations, no limits are stated.
        Ok(in_time(limits)?.unwrap_or_default())
    }

    /// Returns the parameters of the given camera that the data contradict.
    ///
    /// A missing effect also changes fitted base parameters. A mismatch is therefore tentative unless it fulfills
    /// the same conditions as an effect. The held-out set must confirm it. If a significant discrepancy remains,
    /// the mismatch must also explain most of the initial discrepancy.
    fn base_mismatches(&self, given: &Camera) -> Vec<ParameterMismatch> {
        let Self { reference, last: TestedFit { fit, own, .. }, .. } = self;
        let knobs = &reference.model.knobs;
        let places = reference.model.places_in(given);
        let off = self.data - &fit.mean;
        let Contradictions { numbers, distance } = contradicted(self.found, &reference.missed, &off, &places);
        let share_of = |explained: f64| explained / (explained + self.distance - own.allowed_floor).max(1.0);
        let explained_share = share_of(distance + self.discrepancies[0] - self.distance);
        let of = |c: &Contradicted| {
            let knob = knobs[c.number];
            let p = self.parameter_at(c.number, c.position, c.deviation);
            let is_tentative = self.is_tentative_share(share_of(c.gain), explained_share) || !c.is_borne_out;
            let mut ambiguous_with: Vec<&str> = c.tied.iter().map(|j| knobs[*j].effect.name).collect();
            if is_tentative {
                ambiguous_with.extend(reference.effects_like(&c.change, fit));
            }
            ambiguous_with.truncate(MAX_AMBIGUOUS_PARAMETERS);
            mismatch(knob.effect.name, &p, knob.value_in(given), ambiguous_with, is_tentative)
        };
        let is_reported = |m: &ParameterMismatch| {
            (m.fitted_value - m.model_value).abs() > MIN_MISMATCH * m.model_value.abs()
        };
        numbers.iter().map(of).filter(is_reported).collect()
    }

    /// Returns the statistics with the largest deviations.
    fn unexplained_statistics(&self, off: &DVector<f64>) -> Vec<UnexplainedStatistic> {
        let scores = self.last.own.metric.scores(off);
        let mut order: Vec<usize> = (0..scores.len()).collect();
        order.sort_by(|a, b| scores[*b].abs().total_cmp(&scores[*a].abs()));
        let entry = |i: usize| {
            let (name, place) = self.reference.words(i);
            UnexplainedStatistic { r#where: format!("{place}: {name}"), z: scores[i] }
        };
        order.into_iter().take(MAX_UNEXPLAINED_STATISTICS).map(entry).collect()
    }

    fn traces(&self) -> ReportData {
        let before = self.reference.metric.scores(&(self.data - &self.reference.mean));
        let after = self.last.own.metric.scores(&self.off);
        let row = |i: usize| {
            let (name, place) = self.reference.words(i);
            (name, place, before[i], after[i])
        };
        let entrants = |r: &Round| r.entrants.iter().map(|e| (e.name, e.misfit, e.tied)).collect();
        ReportData {
            deviations: (0..before.len()).map(row).collect(),
            tournament: self.found.rounds.iter().map(entrants).collect(),
            step_outcomes: self.found.rounds.iter().map(|r| (r.winner, r.fate)).collect(),
            discrepancy_labels: self.found.steps.iter().map(|step| step.label.clone()).collect(),
            plots: Vec::new(),
        }
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
