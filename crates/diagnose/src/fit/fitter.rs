//! What fits a model: sensors of the base model, and the data of a set.

use super::fit::Fit;
use super::likelihood::Likelihood;
use super::unlocated;
use crate::null_model::reference::NullModel;
use nalgebra::DVector;
use spikelane::error::Result;

/// Fits models to the data of one set; other files of this room add what it does to a fit.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fitter<'a> {
    pub reference: &'a NullModel,
    pub data: &'a DVector<f64>,
}

impl Fitter<'_> {
    /// Simulates the fit's mean, as far as that has not been done, and compares it with the data.
    pub(crate) fn evaluate(&self, fit: &mut Fit, count: usize) -> Result<()> {
        let known = if fit.at == fit.place() { std::mem::take(&mut fit.each) } else { Vec::new() };
        if known.len() >= count {
            fit.each = known;
            return Ok(());
        }
        let means = self.reference.mean_of(&fit.model, &fit.u, count, known)?;
        let residual = self.data - &means.mean;
        fit.misfit = self.reference.metric.square(&residual);
        fit.mean = means.mean;
        fit.each = means.each;
        fit.at = fit.place();
        fit.events = unlocated::columns(self.reference, fit)?;
        fit.likelihood = Likelihood::of(self.reference, &fit.each, &fit.events)?;
        fit.cost = fit.likelihood.deviance(&residual);
        Ok(())
    }
}
