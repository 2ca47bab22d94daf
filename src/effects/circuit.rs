//! The circuit of every pixel, which effects edit.

use crate::sensor::Sensor;
use crate::spikes::Geometry;
use crate::units::ELECTRON_FC;

/// Per-pixel constants, row-major, top row first; one entry per pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct Circuit {
    /// Width and height.
    pub geometry: Geometry,
    /// Readout period in seconds.
    pub period_s: f64,
    /// Nominal capacitance in femtofarads.
    pub nominal_ff: f64,
    /// Nominal threshold voltage in volts; a mean offset of the comparator belongs to it.
    pub nominal_v: f64,
    /// Nominal thresholds per readout at full-scale light.
    pub sensitivity: f64,
    /// `C + C_S` in femtofarads.
    pub capacitance_ff: Vec<f64>,
    /// `V_d + V_S` in volts.
    pub swing_v: Vec<f64>,
    /// Conversion gain relative to the nominal one.
    pub gain: Vec<f64>,
    /// Dark current in picoamperes.
    pub dark_pa: Vec<f64>,
    /// Relative distance of both values of a dark current that switches from their mean, zero
    /// where it does not; empty when no pixel's does.
    pub telegraph: Vec<f64>,
    /// Share of the width within which a pixel is undecided at a readout; empty when none is.
    pub undecided: Vec<f64>,
}

impl Circuit {
    /// Pixels that are all nominal.
    #[must_use]
    pub fn nominal(sensor: &Sensor) -> Self {
        let n = sensor.geometry.pixels();
        Self {
            capacitance_ff: vec![sensor.capacitance_ff; n],
            swing_v: vec![sensor.swing_v; n],
            gain: vec![1.0; n],
            dark_pa: vec![0.0; n],
            ..Self::without_maps(sensor)
        }
    }

    /// What all pixels share, and no map: callers that ask pixel by pixel would fill a map each time.
    pub(super) fn without_maps(sensor: &Sensor) -> Self {
        Self {
            geometry: sensor.geometry,
            period_s: sensor.period_s(),
            nominal_ff: sensor.capacitance_ff,
            nominal_v: sensor.swing_v,
            sensitivity: sensor.thresholds_at_full_scale,
            capacitance_ff: Vec::new(),
            swing_v: Vec::new(),
            gain: Vec::new(),
            dark_pa: Vec::new(),
            telegraph: Vec::new(),
            undecided: Vec::new(),
        }
    }

    /// Number of pixels.
    #[must_use]
    pub fn pixels(&self) -> usize {
        self.geometry.pixels()
    }

    /// The nominal threshold in femtocoulombs: what full-scale light adds in a
    /// readout when the sensitivity is one.
    #[must_use]
    pub fn threshold_fc(&self) -> f64 {
        self.nominal_ff * self.nominal_v
    }

    /// Electrons in a nominal threshold.
    #[must_use]
    pub fn electrons(&self) -> f64 {
        self.threshold_fc() / ELECTRON_FC
    }

    /// Nominal thresholds per readout of a current in picoamperes: `I dt`, and pA times ms is fC.
    #[must_use]
    pub fn thresholds_of_pa(&self, current_pa: f64) -> f64 {
        current_pa * self.period_s * 1e3 / self.threshold_fc()
    }

    /// Multiplies `values` of every pixel by one plus `sigma` times a standard normal value.
    pub fn spread(values: &mut [f64], sigma: f64, normals: &[f64]) {
        for (value, z) in values.iter_mut().zip(normals) {
            *value *= 1.0 + sigma * z;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_all_pixels_share_needs_no_map() {
        let large = Circuit::without_maps(&Sensor::new(1 << 14, 1 << 14, 20_000.0).unwrap());
        let maps = [&large.capacitance_ff, &large.swing_v, &large.gain, &large.dark_pa];
        assert!(maps.iter().all(|map| map.capacity() == 0));
        let one = Circuit::nominal(&Sensor::new(1, 1, 20_000.0).unwrap());
        assert_eq!(
            (large.electrons(), large.thresholds_of_pa(1.0)),
            (one.electrons(), one.thresholds_of_pa(1.0))
        );
    }
}
