//! The lamps as parameters of every model.
//!
//! The light of recording `k` is the stated light times `1 + e_k`. The deviation `e_k` is normal about zero, with
//! the stated standard deviation `u_k`. If recordings share sources, the independent parameters are the deviations
//! of the sources ([`Lamp`]), and `e_k` stands for these.
//!
//! Sensors are simulated at offsets `o_k` near the true `e_k`, because many statistics are linear in the light only
//! over a few thousandths. `l_k` is the derivative by `e_k`, and `C` is the noise at known light. The data are
//! shifted by `sum_k l_k o_k`, and the covariance is `C + sum_k u_k^2 l_k l_k^T`. Together, they give the
//! likelihood in which every `e_k` is integrated out about the *stated* light. The found light would be a wrong
//! center of this prior, because it absorbs the bend of a response.

use crate::light::lamp::Lamp;
use crate::null_model::metric::{Bound, Noise};
use crate::sensors::model::Model;
use crate::thresholds::{MAX_LAMP_PULL, MAX_LAMP_STEP, MAX_LINEAR_OFFSET, SMALL_LAMP_DEVIATION};
use nalgebra::{DMatrix, DVector};

/// Returns the changes of the statistics per standard deviation of each lamp, as columns.
pub(crate) fn columns(slopes: &DMatrix<f64>, model: &Model) -> DMatrix<f64> {
    let mut columns = slopes.clone();
    for (mut column, lamp) in columns.column_iter_mut().zip(&model.lamps) {
        column *= lamp.uncertainty;
    }
    columns
}

/// Returns `data` plus the changes of the statistics by the lamp offsets of `model`. Subtract a mean that is
/// simulated at these offsets: the difference equals that of `data` and a mean at the stated light.
pub(crate) fn shifted(data: &DVector<f64>, slopes: &DMatrix<f64>, model: &Model) -> DVector<f64> {
    data + slopes * offsets(&model.lamps)
}

pub(crate) fn offsets(lamps: &[Lamp]) -> DVector<f64> {
    DVector::from_iterator(lamps.len(), lamps.iter().map(|lamp| lamp.offset))
}

/// The deviations of the lamps of one simulated sensor, from standard normal draws.
pub(crate) struct LampDraw {
    /// The deviations, with the uncertainties as standard deviations.
    pub whole: DVector<f64>,
    /// The part of the deviations that is simulated. Its standard deviations are at most [`SMALL_LAMP_DEVIATION`].
    /// Derivatives add the remainder.
    pub simulated: DVector<f64>,
}

impl LampDraw {
    pub(crate) fn new(lamps: &[Lamp], normal: &DVector<f64>) -> Self {
        let whole = DVector::from_fn(lamps.len(), |i, _| lamps[i].uncertainty * normal[i]);
        let small = |i: usize| lamps[i].uncertainty.min(SMALL_LAMP_DEVIATION) * normal[i];
        Self { whole, simulated: DVector::from_fn(lamps.len(), |i, _| small(i)) }
    }

    pub(crate) fn remainder(&self) -> DVector<f64> {
        &self.whole - &self.simulated
    }
}

/// Returns the most likely deviations of `lamps` if the data deviate from a model by `off`. `noise` includes the
/// noise of the lamps.
pub(crate) fn likely_deviations(
    lamps: &[Lamp],
    slopes: &DMatrix<f64>,
    noise: &Noise,
    off: &DVector<f64>,
) -> Vec<f64> {
    let along = slopes.transpose() * noise.solve_vector(off);
    let of = |(lamp, along): (&Lamp, &f64)| {
        let most = MAX_LAMP_PULL * lamp.uncertainty;
        (lamp.uncertainty * lamp.uncertainty * along).clamp(-most, most)
    };
    lamps.iter().zip(along.iter()).map(of).collect()
}

impl Lamp {
    /// Returns `deviation` in units of the uncertainty.
    pub(crate) fn pull(&self, deviation: f64) -> f64 {
        deviation / self.uncertainty.max(1e-9)
    }

    /// Returns the bounds and the prior of the deviation for one step of a fit, in units of the uncertainty. The
    /// center of the prior is the stated light.
    pub(crate) fn bound(&self) -> Bound {
        let place = |e: f64| self.pull(e).clamp(-MAX_LAMP_PULL, MAX_LAMP_PULL);
        Bound {
            low: place(self.offset - MAX_LAMP_STEP),
            high: place(self.offset + MAX_LAMP_STEP),
            leans: 0.0,
            weight: 1.0,
        }
    }
}

impl Model {
    /// Returns whether a deviation in `found` is so far from the offset of its lamp that the derivative by the lamp
    /// does not hold.
    pub(crate) fn needs_offsets(&self, found: &[f64]) -> bool {
        self.lamps.iter().zip(found).any(|(lamp, e)| (lamp.offset - e).abs() > MAX_LINEAR_OFFSET)
    }

    /// Sets the offsets of the lamps to `found` if the derivatives by the lamps do not hold there.
    pub(crate) fn lit_by(&mut self, found: &[f64]) {
        if self.needs_offsets(found) {
            self.lamps.iter_mut().zip(found).for_each(|(lamp, e)| lamp.offset = *e);
        }
    }
}
