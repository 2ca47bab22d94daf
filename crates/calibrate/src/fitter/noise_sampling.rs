//! Chooses when threshold noise is redrawn: at every readout or at every reset. If the data do not determine this rule,
//! nominal noise is used.

use super::state::Fitter;
use spikelane::pixel::NoiseSampling;
use spikelane_measure::Estimate;

/// Largest distance of the redraw share from the share of the chosen rule, 0 or 1, in standard errors.
const AGREEMENT_Z_THRESHOLD: f64 = 4.0;
/// Smallest distance of the redraw share from the share of the rejected rule, 0 or 1, in standard errors. If the
/// standard error is correct, one choice in thirty thousand is wrong.
const EXCLUSION_Z_THRESHOLD: f64 = 4.0;

impl Fitter<'_> {
    /// Chooses the rule whose share is nearest to the estimated redraw share. Share 1 means that the noise is redrawn
    /// at every readout. Share 0 means that the noise is constant between resets.
    pub(super) fn choose_noise_sampling(&mut self) {
        let share = self.redraw_share;
        let frozen = share.value.is_nan() || share.value < 0.5;
        let [chosen, other] = if frozen { [0.0, 1.0] } else { [1.0, 0.0] };
        let distance = |rule: f64| (share.value - rule).abs() / share.error;
        self.is_noise_sampling_identified =
            distance(chosen) <= AGREEMENT_Z_THRESHOLD && distance(other) >= EXCLUSION_Z_THRESHOLD;
        if self.is_noise_sampling_identified {
            self.noise.noise_sampling =
                if frozen { NoiseSampling::EveryReset } else { NoiseSampling::EveryReadout };
            return;
        }
        // The nominal rule is the rule of the thermal noise of a capacitor.
        self.noise.noise_sampling = NoiseSampling::EveryReset;
        let why = if share.error.is_finite() {
            let contradicts =
                distance(chosen) > AGREEMENT_Z_THRESHOLD && distance(other) > AGREEMENT_Z_THRESHOLD;
            format!(
                "the share that is redrawn at every readout is {:.2} +- {:.2}{}",
                share.value,
                share.error,
                if contradicts { ", which contradicts both models" } else { "" }
            )
        } else {
            "too few pixels fired in a steady dark recording".to_owned()
        };
        self.notes.push(format!(
            "The recordings do not show whether threshold noise is redrawn at every readout or at every reset: {why}. The camera file uses the nominal setting, every reset."
        ));
    }

    /// Sets nominal noise. Call this method if the rule is unknown.
    ///
    /// The estimate of the threshold noise depends on whether the noise is redrawn at every readout or at every reset.
    /// The true noise is between these two estimates. The nominal noise is clamped to this range, and its error covers
    /// both estimates. The quanta are computed from the remaining variance. They are therefore unknown too and are set
    /// to their nominal value.
    pub(super) fn use_nominal_noise(&mut self) {
        let previous = self.noise;
        let frozen = self.sigma_t;
        self.noise.noise_sampling = NoiseSampling::EveryReadout;
        self.measure_noise();
        let redrawn = self.sigma_t;
        self.noise = previous;
        self.assume_quanta(self.nominal_quanta()[1]);
        let nominal = self.nominal_noise_variance().sqrt();
        if !(frozen.error.is_finite() && redrawn.error.is_finite()) {
            self.noise.threshold_variance = nominal * nominal;
            self.sigma_t = Estimate { value: nominal, error: f64::NAN, samples: 0 };
            return;
        }
        let ends = [frozen, redrawn].map(|e| [e.value - 1.96 * e.error, e.value + 1.96 * e.error]);
        let (low, high) = (ends[0][0].min(ends[1][0]).max(0.0), ends[0][1].max(ends[1][1]));
        let value = nominal.clamp(low, high);
        self.sigma_t =
            Estimate { value, error: (value - low).max(high - value) / 1.96, samples: frozen.samples };
        self.noise.threshold_variance = value * value;
        let source = if value == nominal { ", thermal noise of the nominal capacitor" } else { "" };
        self.notes.push(format!(
            "Threshold noise is between {:.3} % and {:.3} % of the threshold under both settings; the camera file uses {:.3} %{source}.",
            100.0 * low,
            100.0 * high,
            100.0 * value
        ));
    }
}
