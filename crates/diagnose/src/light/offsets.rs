//! The lamps as parameters of every model.
//!
//! The light of recording `k` is the stated light times `1 + e_k`, and `e_k` is normal about zero with the stated standard
//! deviation `u_k`. If recordings share sources, the independent parameters are the deviations of the sources
//! ([`Lamp`](crate::light::lamp::Lamp)), and `e_k` below stands for these. Sensors are simulated at offsets `o_k`, which are near the true `e_k`, because many statistics are
//! linear in the light over a few thousandths only. The data are moved by `sum_k l_k o_k`, where `l_k` is the derivative by
//! `e_k`, and the covariance is `C + sum_k u_k^2 l_k l_k^T`. Both together are the likelihood with every `e_k` integrated
//! out about the *stated* light. The found light would be a wrong prior, because it absorbs the bend of a response.

use crate::light::lamp::Lamp;
use crate::null_model::metric::{Bound, Noise};
use crate::sensors::model::Model;
use crate::thresholds::{MAX_LAMP_PULL, MAX_LAMP_STEP, MAX_LINEAR_OFFSET, SMALL_LAMP_DEVIATION};
use nalgebra::{DMatrix, DVector};

/// Changes per standard deviation of each lamp.
pub(crate) fn columns(slopes: &DMatrix<f64>, model: &Model) -> DMatrix<f64> {
    let mut columns = slopes.clone();
    for (mut column, lamp) in columns.column_iter_mut().zip(&model.lamps) {
        column *= lamp.uncertainty;
    }
    columns
}

/// `data` as they would be if every lamp had the light that is stated, for a model whose offsets are the lamps' deviations.
pub(crate) fn shifted(data: &DVector<f64>, slopes: &DMatrix<f64>, model: &Model) -> DVector<f64> {
    data + slopes * offsets(&model.lamps)
}

pub(crate) fn offsets(lamps: &[Lamp]) -> DVector<f64> {
    DVector::from_iterator(lamps.len(), lamps.iter().map(|lamp| lamp.offset))
}

/// The deviations of the lamps of one sensor, from standard normal draws.
pub(crate) struct LampDraw {
    /// The deviations, with the uncertainties as standard deviations.
    pub whole: DVector<f64>,
    /// The part that is simulated, with [`SMALL_LAMP_DEVIATION`] at most. Derivatives add the remainder.
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

/// The deviations of `lamps` that are most likely, if a model leaves `off`. `noise` has the noise of the lamps.
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
    /// A deviation in units of the uncertainty.
    pub(crate) fn pull(&self, deviation: f64) -> f64 {
        deviation / self.uncertainty.max(1e-9)
    }

    /// Where a step of a fit may move the deviation, in units of the uncertainty. The prior is about the stated light.
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
    /// Whether a lamp is further from its offset than derivatives hold.
    pub(crate) fn needs_offsets(&self, found: &[f64]) -> bool {
        self.lamps.iter().zip(found).any(|(lamp, e)| (lamp.offset - e).abs() > MAX_LINEAR_OFFSET)
    }

    /// The model at other offsets, if these are further off than derivatives hold.
    pub(crate) fn lit_by(&mut self, found: &[f64]) {
        if self.needs_offsets(found) {
            self.lamps.iter_mut().zip(found).for_each(|(lamp, e)| lamp.offset = *e);
        }
    }
}
