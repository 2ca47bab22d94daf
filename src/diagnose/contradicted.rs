//! Whether the data contradict a number of the camera that was given.

use nalgebra::DVector;

use super::fit::Fit;
use super::own::MEAN;
use super::reference::Reference;
use super::search::Found;
use crate::error::Result;

/// Rise of the cost with the camera's own number in the place of the fitted one from which on that is contradicted: three and a half
/// deviations.
const CONTRADICTED: f64 = 12.0;

/// Steps of the other numbers while one is held.
const STEPS: usize = 2;

impl Reference {
    /// Whether the data are much less likely with number `j` at position `back`, the others fitted again. That a linear step tells
    /// it by many of its deviations is not enough: beside a `column_pattern` of 0.05 the fit left the spread of the thresholds 19 %
    /// high at a deviation of 3 %, and cost no less there than with the right one.
    pub(super) fn contradicts(
        &self,
        found: &Found,
        data: &DVector<f64>,
        j: usize,
        back: f64,
    ) -> Result<bool> {
        let (metric, fitted) = (&found.own.metric, &found.fit);
        let mut held = fitted.moved(&metric.along(j, back - fitted.u[j]));
        held.u[j] = back;
        self.evaluate(&mut held, data, MEAN)?;
        for _ in 0..STEPS {
            let mut bounds = held.bounds();
            (bounds[j].low, bounds[j].high) = (0.0, 0.0);
            let mut next = held.moved(&metric.bounded(&(data - &held.mean), &bounds));
            self.evaluate(&mut next, data, MEAN)?;
            if next.cost >= held.cost {
                break;
            }
            held = next;
        }
        let cost = |fit: &Fit| self.priced(fit.clone(), data).cost();
        Ok(cost(&held) - cost(fitted) > CONTRADICTED)
    }
}
