//! The circuit constants of every pixel, which effects edit.

use crate::sensor::Sensor;
use crate::spikes::Geometry;
use crate::units::ELECTRON_FC;

/// Circuit constants per pixel, row-major, top row first. Each map has one value per pixel.
///
/// # Examples
/// ```
/// use spikelane::effects::circuit::Circuit;
/// let mut circuit = Circuit::nominal(&spikelane::Sensor::new(4, 1, 20_000.0)?);
/// // An effect edits the maps, for example the gain of the last column.
/// circuit.gain[3] *= 0.9;
/// assert_eq!(circuit.gain, [1.0, 1.0, 1.0, 0.9]);
/// assert_eq!(circuit.capacitance_ff, [4.348; 4]);
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Circuit {
    /// Width and height.
    pub geometry: Geometry,
    /// Readout period in seconds.
    pub period_s: f64,
    /// Nominal capacitance in femtofarads.
    pub nominal_ff: f64,
    /// Nominal threshold voltage in volts, including the mean offset of the comparator.
    pub nominal_v: f64,
    /// Charge per readout at full-scale light, in nominal thresholds.
    pub sensitivity: f64,
    /// Capacitance `C + C_S` in femtofarads.
    pub capacitance_ff: Vec<f64>,
    /// Threshold voltage `V_d + V_S` in volts.
    pub swing_v: Vec<f64>,
    /// Conversion gain relative to the nominal one.
    pub gain: Vec<f64>,
    /// Dark current in picoamperes.
    pub dark_pa: Vec<f64>,
    /// Distance of the two values of a switching dark current from the mean current, relative to the mean current.
    ///
    /// A pixel whose dark current does not switch has the distance zero. The map is empty if no pixel's current
    /// switches.
    pub telegraph: Vec<f64>,
    /// Factor by which each pixel multiplies the width of the readout jitter. The map is empty if no pixel has jitter.
    pub jitter_share: Vec<f64>,
}

impl Circuit {
    /// Returns a circuit in which every pixel is nominal.
    ///
    /// # Examples
    /// ```
    /// use spikelane::effects::circuit::Circuit;
    /// let sensor = spikelane::Sensor::new(64, 48, 20_000.0)?;
    /// let circuit = Circuit::nominal(&sensor);
    /// assert!(circuit.swing_v.iter().all(|swing| *swing == sensor.swing_v));
    /// assert!(circuit.dark_pa.iter().all(|current| *current == 0.0));
    /// # Ok::<(), spikelane::Error>(())
    /// ```
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

    /// Returns the constants that all pixels share, with empty maps.
    ///
    /// Use this function if you need only these constants. It allocates no maps.
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
            jitter_share: Vec::new(),
        }
    }

    /// Returns the number of pixels.
    ///
    /// # Examples
    /// ```
    /// let circuit = spikelane::effects::Circuit::nominal(&spikelane::Sensor::new(64, 48, 20_000.0)?);
    /// assert_eq!(circuit.pixels(), 64 * 48);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    #[must_use]
    pub fn pixels(&self) -> usize {
        self.geometry.pixels()
    }

    /// Returns the nominal threshold in femtocoulombs.
    ///
    /// Full-scale light adds this charge per readout if the sensitivity is 1.
    ///
    /// # Examples
    /// ```
    /// let circuit = spikelane::effects::Circuit::nominal(&spikelane::Sensor::new(64, 48, 20_000.0)?);
    /// assert_eq!(circuit.threshold_fc(), 4.348 * 1.1); // fF times V
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    #[must_use]
    pub fn threshold_fc(&self) -> f64 {
        self.nominal_ff * self.nominal_v
    }

    /// Returns the number of electrons in a nominal threshold.
    ///
    /// # Examples
    /// ```
    /// let circuit = spikelane::effects::Circuit::nominal(&spikelane::Sensor::new(64, 48, 20_000.0)?);
    /// // 4.783 fC divided by 1.602e-4 fC.
    /// assert_eq!(circuit.electrons().round(), 29_852.0);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    #[must_use]
    pub fn electrons(&self) -> f64 {
        self.threshold_fc() / ELECTRON_FC
    }

    /// Converts a current in picoamperes to nominal thresholds per readout.
    ///
    /// The charge is `current_pa * period_s * 1e3` femtocoulombs, because 1 pA during 1 ms is 1 fC.
    ///
    /// # Examples
    /// ```
    /// let circuit = spikelane::effects::Circuit::nominal(&spikelane::Sensor::new(64, 48, 20_000.0)?);
    /// // A current that fills the threshold in 100 readouts of 50 us.
    /// let current_pa = circuit.threshold_fc() / (100.0 * 0.05);
    /// assert!((circuit.thresholds_per_readout(current_pa) - 0.01).abs() < 1e-12);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    #[must_use]
    pub fn thresholds_per_readout(&self, current_pa: f64) -> f64 {
        current_pa * self.period_s * 1e3 / self.threshold_fc()
    }

    /// Multiplies each of `values` by `1 + sigma z`, where `z` is the standard normal value of its pixel.
    ///
    /// # Examples
    /// ```
    /// let mut gains = [1.0, 1.0, 2.0];
    /// spikelane::effects::Circuit::apply_spread(&mut gains, 0.25, &[1.0, -1.0, 2.0]);
    /// assert_eq!(gains, [1.25, 0.75, 3.0]);
    /// ```
    pub fn apply_spread(values: &mut [f64], sigma: f64, normals: &[f64]) {
        for (value, z) in values.iter_mut().zip(normals) {
            *value *= 1.0 + sigma * z;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shared_values_need_no_map() {
        let large = Circuit::without_maps(&Sensor::new(1 << 14, 1 << 14, 20_000.0).unwrap());
        let maps = [&large.capacitance_ff, &large.swing_v, &large.gain, &large.dark_pa];
        assert!(maps.iter().all(|map| map.capacity() == 0));
        let one = Circuit::nominal(&Sensor::new(1, 1, 20_000.0).unwrap());
        assert_eq!(
            (large.electrons(), large.thresholds_per_readout(1.0)),
            (one.electrons(), one.thresholds_per_readout(1.0))
        );
    }
}
