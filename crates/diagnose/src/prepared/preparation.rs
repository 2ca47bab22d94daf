//! The second stage of a diagnosis. It finds the light of the recordings and the base model for the simulations.

use crate::null_model::baseline::{Baseline, StartingCamera};
use crate::prepared::base_model::BaseModel;
use crate::prepared::base_parameter_fit::rebased;
use crate::prepared::recordings::{HeldOut, Recordings};
use crate::sensors::deadline::{SimulationContext, in_time};
use nalgebra::DVector;
use spikelane::effects::Catalog;
use spikelane::error::Result;
use spikelane_calibrate::ProgressCallback;

/// Recordings at their final light, and the base model with which they are compared.
pub(crate) struct Prepared {
    pub recordings: Recordings,
    pub base: BaseModel,
    /// The camera of the simulations. A fit may have changed its parameters.
    start: StartingCamera,
    seed: u64,
}

impl Prepared {
    /// Finds the light of the recordings and the parameters of the base model. The found light depends on the
    /// camera, so it is found again if a fit changes the parameters. `is_given` states whether the base model is
    /// the camera of the caller.
    pub(crate) fn new(
        mut recordings: Recordings,
        mut base: BaseModel,
        is_given: bool,
        seed: u64,
        context: &SimulationContext,
        progress: ProgressCallback<'_>,
    ) -> Result<Self> {
        let fitted = &mut recordings.fitted;
        fitted.find_light(&base.camera, seed)?;
        let mut start = StartingCamera::new(base.camera.clone(), context);
        // A camera file may have wrong parameters, and published parameters belong to another camera. A fit
        // therefore corrects the parameters. If the input consists of rate maps, no fit corrects them: rate maps show
        // only the spreads between pixels, and a fit would change the spreads until they contain the missing effects.
        if (is_given || base.is_guessed()) && !fitted.setup.has_rate_maps {
            progress("own numbers", 0.02);
            let data = DVector::from_column_slice(&fitted.measured.values);
            let moved = in_time(rebased(&fitted.setup, &base.camera, &data, seed, context))?;
            if let Some(moved) = moved {
                base = base.fitted(&moved.camera)?;
                let is_lit_otherwise = fitted.find_light(&moved.camera, seed)?;
                // The null model can reuse the simulations of the fit only if `find_light` did not change their light.
                start = if is_lit_otherwise { StartingCamera::new(moved.camera, context) } else { moved };
            }
        }
        fitted.sum_sources();
        let has_other_lamps = recordings.held_out == HeldOut::SecondSet;
        recordings.judging.light_as(&fitted.setup, has_other_lamps, &start.camera, seed)?;
        Ok(Self { recordings, base, start, seed })
    }

    /// Makes the first simulations of the null model.
    pub(crate) fn baseline(&self, effects: &Catalog, progress: ProgressCallback<'_>) -> Result<Baseline> {
        let setup = self.recordings.fitted.setup.clone();
        Baseline::first(setup, self.start.clone(), self.seed, effects, progress)
    }
}
