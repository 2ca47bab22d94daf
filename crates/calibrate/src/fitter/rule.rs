//! When threshold noise is redrawn, and what is taken where that is not told.

use super::state::{Fitter, Noise};
use crate::result::Redrawn;
use spikelane::sensor::Sensor;
use spikelane_measure::Estimate;

/// A rule is told if the share of the bias lies within so many errors of it,
const AGREES: f64 = 4.0;
/// and at least so many from the other: one wrong rule in thirty thousand, as far as the error is right.
const EXCLUDED: f64 = 4.0;

impl Fitter<'_> {
    /// Noise redrawn at every readout, or frozen: whichever the dark rate agrees with.
    pub(super) fn choose_redraw(&mut self) {
        let share = self.bias_share;
        let frozen = share.value.is_nan() || share.value < 0.5;
        let [own, other] = if frozen { [0.0, 1.0] } else { [1.0, 0.0] };
        let distance = |rule: f64| (share.value - rule).abs() / share.error;
        self.redrawn_told = distance(own) <= AGREES && distance(other) >= EXCLUDED;
        if self.redrawn_told {
            self.noise.redrawn = if frozen { Redrawn::EveryReset } else { Redrawn::EveryReadout };
            return;
        }
        // The nominal rule: what the thermal noise of a capacitor does.
        self.noise.redrawn = Redrawn::EveryReset;
        let why = if share.error.is_finite() {
            let contradicts = distance(own) > AGREES && distance(other) > AGREES;
            format!(
                "{:.2} +- {:.2} of the rate that a redraw at every readout adds was found{}",
                share.value,
                share.error,
                if contradicts { ", which contradicts both rules" } else { "" }
            )
        } else {
            "too few pixels fired twice in the dark".to_owned()
        };
        self.notes.push(format!(
            "Whether threshold noise is redrawn at every readout or at every reset is not told: {why}. The camera file takes the nominal rule, every reset."
        ));
    }

    /// Where the rule is not told, threshold noise lies between what both give: the nominal value, with an error that holds both. Quanta
    /// are what it leaves of the variance, so they are not told either.
    pub(super) fn take_nominal_noise(&mut self) {
        let kept = self.noise;
        let frozen = self.sigma_t;
        self.noise.redrawn = Redrawn::EveryReadout;
        self.measure_noise();
        let redrawn = self.sigma_t;
        let electrons = Sensor::electrons(self.sensor.capacitance_ff * self.sensor.swing_v);
        self.noise = Noise { light: 1.0 / electrons, ..kept };
        self.electrons = Estimate { value: electrons, error: f64::NAN, samples: 0 };
        let nominal = self.nominal_square().sqrt();
        if !(frozen.error.is_finite() && redrawn.error.is_finite()) {
            self.noise.square = nominal * nominal;
            self.sigma_t = Estimate { value: nominal, error: f64::NAN, samples: 0 };
            return;
        }
        let ends = [frozen, redrawn].map(|e| [e.value - 1.96 * e.error, e.value + 1.96 * e.error]);
        let (low, high) = (ends[0][0].min(ends[1][0]).max(0.0), ends[0][1].max(ends[1][1]));
        let value = nominal.clamp(low, high);
        self.sigma_t =
            Estimate { value, error: (value - low).max(high - value) / 1.96, samples: frozen.samples };
        self.noise.square = value * value;
        let source = if value == nominal { ", thermal noise of the nominal capacitor" } else { "" };
        self.notes.push(format!(
            "Threshold noise lies between {:.3} % and {:.3} % of the threshold, whichever rule holds; the camera file takes {:.3} %{source}.",
            100.0 * low,
            100.0 * high,
            100.0 * value
        ));
    }
}
