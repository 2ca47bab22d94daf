//! The sensor: geometry, readout rate, nominal circuit, and the conversion from stored codes to light.

mod front_end;
mod mosaic;
mod transfer;

pub use front_end::{FrontEnd, FullScale};
pub use mosaic::{Channel, Mosaic};
pub use transfer::Transfer;

use crate::error::{Result, bail};
use crate::spikes::Geometry;
use crate::units::ELECTRON_FC;

/// A sensor with identical pixels. Effects make the pixels differ.
///
/// # Examples
/// ```
/// use spikelane::Sensor;
/// let sensor = Sensor { capacitance_ff: 5.0, ..Sensor::new(400, 250, 20_000.0)? }.validate()?;
/// // The threshold charge in femtocoulombs: 5 fF times 1.1 V.
/// assert_eq!(sensor.capacitance_ff * sensor.swing_v, 5.5);
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensor {
    /// Width and height in pixels.
    pub geometry: Geometry,
    /// Readouts per second.
    pub readout_hz: f64,
    /// Capacitance of the charge node in femtofarads.
    pub capacitance_ff: f64,
    /// Voltage swing between reset and comparison (`V_rst - V_ref`) in volts.
    pub swing_v: f64,
    /// Charge in nominal thresholds that full-scale light (255, 65535, 1.0) adds per readout.
    pub thresholds_at_full_scale: f64,
}

impl Sensor {
    /// Returns a sensor with the circuit of the SCSim paper.
    ///
    /// The capacitance is 4.348 fF and the swing is 1.1 V. Full-scale light adds one threshold per readout.
    ///
    /// # Examples
    /// ```
    /// let sensor = spikelane::Sensor::new(400, 250, 20_000.0)?;
    /// assert_eq!(sensor.period_s(), 50e-6);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns the errors of [`Geometry::new`], and [`ErrorKind::Config`](crate::ErrorKind::Config) if the readout rate is not positive and finite.
    pub fn new(width: u32, height: u32, readout_hz: f64) -> Result<Self> {
        let sensor = Self {
            geometry: Geometry::new(width, height)?,
            readout_hz,
            capacitance_ff: 4.348,
            swing_v: 1.1,
            thresholds_at_full_scale: 1.0,
        };
        sensor.validate()
    }

    /// Returns this sensor if its values are valid.
    ///
    /// # Examples
    /// ```
    /// use spikelane::Sensor;
    /// let sensor = Sensor::new(400, 250, 20_000.0)?;
    /// let error = Sensor { readout_hz: 0.0, ..sensor }.validate().unwrap_err();
    /// assert_eq!(error.to_string(), "readout rate (Hz): found 0, expected a positive number");
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns [`ErrorKind::Config`](crate::ErrorKind::Config) if the rate, the capacitance or the swing is not positive and finite,
    /// or if the sensitivity is negative or not finite.
    pub fn validate(self) -> Result<Self> {
        let positive = [
            ("readout rate (Hz)", self.readout_hz),
            ("capacitance (fF)", self.capacitance_ff),
            ("voltage swing (V)", self.swing_v),
        ];
        for (what, value) in positive {
            if !(value.is_finite() && value > 0.0) {
                bail!(Config, "{what}"; found "{value}"; expected "a positive number");
            }
        }
        let sensitivity = self.thresholds_at_full_scale;
        if !(sensitivity.is_finite() && sensitivity >= 0.0) {
            bail!(Config, "thresholds at full scale"; found "{sensitivity}"; expected "zero or more");
        }
        Ok(self)
    }

    /// Returns the duration of a readout in seconds.
    ///
    /// # Examples
    /// ```
    /// let sensor = spikelane::Sensor::new(400, 250, 40_000.0)?;
    /// assert_eq!(sensor.period_s(), 25e-6);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    #[must_use]
    pub fn period_s(&self) -> f64 {
        1.0 / self.readout_hz
    }

    /// Returns the number of electrons in a charge of `charge_fc` femtocoulombs.
    ///
    /// # Examples
    /// ```
    /// // The elementary charge is 1.602e-4 fC, so a femtocoulomb has about 6,242 electrons.
    /// assert_eq!(spikelane::Sensor::electrons_from_fc(1.0).round(), 6242.0);
    /// ```
    #[must_use]
    pub fn electrons_from_fc(charge_fc: f64) -> f64 {
        charge_fc / ELECTRON_FC
    }
}
