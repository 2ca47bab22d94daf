//! The law of one pixel in `f64`, and the complete list of operations.
//!
//! The law implements Algorithm 1 of the SCSim paper (arXiv 2405.16790) line by line. A choice that the paper leaves
//! open is a value in the data, for example [`NoiseSampling`]. The law is the reference for the physics. It shares no
//! code with the kernels, which compute in integers. Tests compare the statistics of law and kernels.

mod law;
mod pixel_array;
mod terms;

pub use law::{Law, NoNoise, NoiseSource, PixelState};
pub use pixel_array::PixelArray;
pub use terms::{Adaptation, Lag, Schedule, SlowNoise, Surround, Telegraph};

/// The instants at which the threshold noise is drawn.
///
/// # Examples
/// ```
/// use spikelane::pixel::{Law, NoiseSampling};
/// assert_eq!(Law::IDEAL.noise_sampling, NoiseSampling::EveryReset);
///
/// use spikelane::effects;
/// // The effect `thermal_noise` selects the instants with a word.
/// let noise = effects::find("thermal_noise")?.typical().with_text("noise_sampling", "every-readout")?;
/// assert_eq!(noise.get("noise_sampling")?, 1.0);
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum NoiseSampling {
    /// The noise is drawn at every readout, as in Algorithm 1 of the SCSim paper. A low draw then makes a pixel fire
    /// early, so noise with mean zero increases the rate of dim pixels.
    EveryReadout,
    /// The noise is drawn at every reset. Its value then stays frozen until the next reset, like kTC noise.
    EveryReset,
}

/// The unit in which light is counted for shot noise.
///
/// # Examples
/// ```
/// use spikelane::pixel::{Op, Quanta};
/// use spikelane::{Camera, Seeds, Sensor};
/// let mut model = Camera::ideal(Sensor::new(8, 1, 20_000.0)?).model(Seeds::default())?;
/// model.ops.push(Op::LightQuanta { quanta: Quanta::Photons(1000.0), strength: 1.0 });
/// // Full-scale light adds a threshold per readout, which is 1,000 photons.
/// assert_eq!((model.law(0).quanta_light, model.law(0).quantum), (1000.0, 1e-3));
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Quanta {
    /// Electrons, which are counted after the pixel's gain. The nominal circuit determines their number per threshold.
    Electrons,
    /// Photons, which are counted before the pixel's gain. The value is the number of photons that add one nominal
    /// threshold of charge at nominal gain.
    Photons(f64),
}

/// One operation that a pixel executes at readouts.
///
/// The list is complete: a new kind of arithmetic requires a new variant. The law, the plan, the reference kernel and the
/// vector kernels destructure the operations and their constants without `..`. If a variant is added, the compiler
/// therefore reports most functions that must handle the new variant. It does not report `Law::max_threshold_offset` and
/// `Dynamics::moves_threshold`.
///
/// # Examples
/// ```
/// use spikelane::pixel::Op;
/// use spikelane::{Camera, Plan, Seeds, Sensor, Simulator};
/// let seeds = Seeds::default();
/// let mut model = Camera::ideal(Sensor::new(8, 1, 20_000.0)?).model(seeds)?;
/// // A hard reset: a spike clears the charge that exceeds the threshold.
/// model.ops.push(Op::Remainder { lost: 1.0 });
/// let mut simulator = Simulator::from_plan(Plan::from_model(&model, seeds, 1.0)?);
/// // At 2/5 of full scale, the charge after three readouts is 6/5 of the threshold.
/// assert_eq!(simulator.run(&[102u8; 8], 30)?.spikes(), 8 * 30 / 3);
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Op {
    /// The light arrives in quanta.
    LightQuanta {
        /// The unit in which the light is counted.
        quanta: Quanta,
        /// Factor by which the variance is multiplied. The physical value is 1.
        strength: f64,
    },
    /// The dark current arrives in electrons.
    DarkQuanta {
        /// Factor by which the variance is multiplied. The physical value is 1.
        strength: f64,
    },
    /// The noise of the quanta is delayed: it becomes charge gradually at several readouts.
    CorrelatedQuanta {
        /// Number of readouts after which a share of 1/e of the noise is still pending.
        time_constant: f64,
    },
    /// The threshold voltage has noise. The noisy threshold is compared with the charge and, after a spike, subtracted
    /// from the charge.
    ThresholdNoise {
        /// Standard deviation in volts.
        sigma_v: f64,
        /// The instants at which the noise is drawn.
        noise_sampling: NoiseSampling,
    },
    /// The first increment after a spike is smaller by this share.
    FirstIncrement {
        /// Lost share, 0 to 1.
        lost: f64,
    },
    /// The charge that remains after a spike is smaller by this share.
    Remainder {
        /// Lost share. 0 is a soft reset, and 1 is a hard reset.
        lost: f64,
    },
    /// The stored charge has an upper limit.
    Ceiling {
        /// Largest charge, in the pixel's own thresholds.
        thresholds: f64,
    },
    /// The readout circuit flips reported bits without changing the charge.
    Flip {
        /// Probability that a spike is not reported.
        missed_spikes: f64,
        /// Probability that a silent readout reports a spike.
        false_spikes: f64,
    },
    /// The effective light is `light (1 + quadratic light)`.
    Response {
        /// Relative change of the light at full scale.
        quadratic: f64,
    },
    /// The light oscillates sinusoidally in time.
    Flicker {
        /// Amplitude relative to the light.
        depth: f64,
        /// Frequency in hertz.
        frequency_hz: f64,
        /// Phase at the first readout, in turns (1 is a full period).
        phase_turns: f64,
    },
    /// The gain of the light changes linearly over a number of readouts, then stays constant.
    Drift {
        /// Relative change at the end of the drift.
        change: f64,
        /// Number of readouts that the drift takes.
        readouts: f64,
    },
    /// Stored charge loses a share at every readout.
    Leak {
        /// Lost share.
        fraction: f64,
    },
    /// The comparison has noise that a reset does not subtract.
    ComparatorNoise {
        /// Standard deviation in the pixel's own thresholds.
        sigma: f64,
    },
    /// A pixel whose charge is close to its threshold at a readout fires with probability 1/2.
    ///
    /// The circuit contains a factor per pixel by which `width` is multiplied.
    ReadoutJitter {
        /// Largest distance between charge and threshold, in the pixel's own thresholds, if the circuit's factor for the
        /// pixel is 1.
        width: f64,
    },
    /// The threshold has noise that all pixels of a row share.
    RowNoise {
        /// Standard deviation in the pixel's own thresholds.
        sigma: f64,
    },
    /// The threshold drifts as an Ornstein-Uhlenbeck process.
    SlowThresholdNoise {
        /// Standard deviation in the pixel's own thresholds.
        sigma: f64,
        /// Number of readouts after which the correlation is 1/e.
        time_constant: f64,
    },
    /// A spike raises the threshold. The rise then decays.
    Adaptation {
        /// Rise per spike in the pixel's own thresholds.
        rise: f64,
        /// Share of the rise that remains after a readout.
        retention: f64,
    },
    /// The dark current switches between two values. The circuit contains the amplitude of each pixel.
    Telegraph {
        /// Probability of switching per readout.
        rate: f64,
    },
    /// A part of the light becomes charge late.
    Lag {
        /// Share of the light that becomes charge late.
        fraction: f64,
        /// Number of readouts after which a share of 1/e of the late light has still not become charge.
        time_constant: f64,
    },
    /// Each pixel exchanges light with its four neighbors.
    Crosstalk {
        /// Share of the pixel's light that the four neighbors receive together.
        share: f64,
    },
    /// A spike adds charge to the four neighbors at the next readout.
    SpikeCoupling {
        /// Charge in the neighbor's own thresholds.
        charge: f64,
    },
    /// The thresholds decrease in proportion to the number of spikes at the previous readout.
    SupplyDroop {
        /// Decrease of the thresholds after a readout in which every pixel fired, in the pixel's own thresholds.
        depth: f64,
    },
    /// Whole readouts are lost.
    DropReadouts {
        /// Probability per readout.
        probability: f64,
    },
    /// Whole readouts are reported with the bits of the previous readout.
    RepeatReadouts {
        /// Probability per readout.
        probability: f64,
    },
    /// The charge at the first readout is random.
    Phase {
        /// Width of a uniform distribution, as a share of the pixel's own threshold.
        share: f64,
        /// Width of a second uniform distribution, in femtocoulombs. The charge is the sum of one draw from each
        /// distribution.
        charge_fc: f64,
    },
}
