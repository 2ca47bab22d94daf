//! The statistics of two sets, compared with null models.

use nalgebra::DVector;

use crate::answer::diagnosis::Diagnosis;
use crate::answer::figures::{rate_residuals, set_plots};
use crate::answer::outcome::outcome;
use crate::answer::qualifications::set_notes;
use crate::events::locations::Events;
use crate::fit::fitter::Fitter;
use crate::null_model::reference::NullModel;
use crate::null_model::signature::Signature;
use crate::prepared::prepared_set::DataSplit;
use crate::protocol::extent::RecordingPart;
use crate::search::context::{HeldOutSet, Search};
use crate::search::line_signatures::with_line;
use crate::search::search::{SearchResult, search};
use crate::search::undecided::Undecided;
use crate::sensors::context::in_time;
use spikelane::effects::Camera;
use spikelane::error::Result;
use spikelane_calibrate::ProgressCallback;

/// Source of the held-out recordings.
#[derive(Clone, Copy)]
pub(crate) struct HeldOut {
    pub has_second_set: bool,
    /// Whether the recordings can be cut in two.
    pub is_divisible: bool,
}

impl HeldOut {
    /// Returns whether other recordings than the fitted ones are held out.
    fn is_any(self) -> bool {
        self.has_second_set || self.is_divisible
    }

    pub(crate) fn description(self) -> &'static str {
        match self {
            Self { has_second_set: true, .. } => "a second recording set",
            Self { is_divisible: true, .. } => "the second half of every recording",
            Self { .. } => "none",
        }
    }
}

/// The fitted and the held-out set as vectors of statistics.
#[derive(Clone)]
pub(crate) struct Comparison<'a> {
    split: &'a DataSplit,
    /// Statistics of the fitted set.
    pub fitted: DVector<f64>,
    /// Statistics of the held-out set.
    held_out_statistics: DVector<f64>,
    located: Events,
    parts: [RecordingPart; 2],
    held_out: HeldOut,
}

impl<'a> Comparison<'a> {
    pub(crate) fn new(split: &'a DataSplit, parts: [RecordingPart; 2], held_out: HeldOut) -> Self {
        let [fitted, judging] = [&split.fitted.measured, &split.judging.measured];
        let scenes = &split.fitted.setup.recordings;
        let located = Events::new(fitted.located.clone(), judging.located.clone(), held_out.is_any(), scenes);
        let [fitted, held_out_statistics] = [fitted, judging].map(|m| DVector::from_vec(m.values.clone()));
        Self { split, fitted, held_out_statistics, located, parts, held_out }
    }

    /// Returns the statistics in the coordinates of `reference`, which contains the found light of the recordings.
    pub(crate) fn shifted(&self, reference: &NullModel) -> Self {
        let [fitted, held_out_statistics] =
            [&self.fitted, &self.held_out_statistics].map(|statistics| reference.shifted(statistics));
        Self { fitted, held_out_statistics, ..self.clone() }
    }

    /// Returns the diagnosis of a set that agrees with the first simulations of the model, otherwise `None`.
    ///
    /// The limits of `preliminary` are stricter than those of a search, so a set that agrees here raises no alarm later.
    pub(crate) fn agreement(
        &self,
        preliminary: &NullModel,
        camera: Option<&Camera>,
        progress: ProgressCallback<'_>,
    ) -> Result<Option<Diagnosis>> {
        let shifted = self.shifted(preliminary);
        let signatures = shifted.signatures(preliminary)?;
        let Some(found) = shifted.search(preliminary, &signatures).agreement()? else { return Ok(None) };
        let diagnosis = shifted.diagnosis(preliminary, found, camera, progress)?;
        // All simulations test the parameters of a camera file.
        Ok(Some(diagnosis).filter(|d| d.parameter_mismatches.is_empty()))
    }

    pub(crate) fn search<'b>(&'b self, reference: &'b NullModel, signatures: &'b [Signature]) -> Search<'b> {
        let DataSplit { fitted, judging, .. } = self.split;
        let is_other = self.parts[0] != self.parts[1] || !judging.setup.has_light_of(&fitted.setup);
        let setup = is_other.then_some(&judging.setup);
        let judge = HeldOutSet { data: &self.held_out_statistics, setup, held_out: self.held_out.is_any() };
        let fitter = Fitter { reference, data: &self.fitted };
        Search { fitter, signatures, judge, located: &self.located }
    }

    /// Returns the signatures for a search of the fitted set; after the time limit, those of the null model.
    pub(crate) fn signatures(&self, reference: &NullModel) -> Result<Vec<Signature>> {
        let signatures = in_time(with_line(reference, &self.split.fitted.measured))?;
        Ok(signatures.unwrap_or_else(|| reference.signatures.clone()))
    }

    /// Searches for effects. `start` is the camera from which the base model came.
    pub(crate) fn search_result(
        &self,
        reference: &NullModel,
        start: &Camera,
        progress: ProgressCallback<'_>,
    ) -> Result<SearchResult> {
        let signatures = self.signatures(reference)?;
        let case = self.search(reference, &signatures);
        let mut found = search(&case, progress)?;
        progress("last steps", 0.94);
        if in_time(case.end(&mut found, start))?.is_none() {
            found.undecided.push(Undecided::BaseNumbers);
        }
        Ok(found)
    }

    /// Converts the result of a search to a diagnosis.
    pub(crate) fn diagnosis(
        &self,
        reference: &NullModel,
        mut found: SearchResult,
        camera: Option<&Camera>,
        progress: ProgressCallback<'_>,
    ) -> Result<Diagnosis> {
        let mut diagnosis = outcome(Fitter { reference, data: &self.fitted }, &mut found, camera)?;
        progress("pictures", 0.95);
        reference.model.context.deadline.lift();
        let last = (&found.fit.model, found.fit.u.as_slice());
        let fitted = &self.split.fitted;
        diagnosis.rates = rate_residuals(reference, &found, &self.fitted, &fitted.measured.scans);
        diagnosis.traces.plots = set_plots(reference, &fitted.set, &fitted.measured.scans, last)?;
        let HeldOut { has_second_set, is_divisible } = self.held_out;
        diagnosis.notes.extend(set_notes(&fitted.setup, &self.split.aside, has_second_set, !is_divisible));
        diagnosis.faults.clone_from(&self.split.faults);
        Ok(diagnosis)
    }
}
