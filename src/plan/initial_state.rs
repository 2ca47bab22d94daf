//! The state before the first readout.

use crate::draws::hash::{self, CounterRng, RoundKey, address_key, pixel_half};
use crate::draws::{RandomStream, Seeds, gauss};
use crate::effects::{Model, StartPhases};
use crate::error::{Result, error};
use crate::pixel::{Law, NoiseSampling};
use crate::plan::Plan;
use crate::plan::dynamics::Dynamics;
use crate::plan::state::{
    ADAPTATION_COLUMN, FRACTION_TOP_BIT, LAG_COLUMN, SLOW_NOISE_COLUMN, SimulatorState, TELEGRAPH_COLUMN,
};
use crate::plan::tables::{NoiseTable, PixelTables};
use crate::spikes::{Crop, Geometry};

/// Readout number of the draw whose noise is frozen before the first readout.
const PRE_START_READOUT: u64 = u64::MAX;

/// The distribution of the charges at the first readout.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct StartDistribution {
    geometry: Geometry,
    phases: StartPhases,
    /// Thresholds of the pixels in nominal thresholds, before rounding to steps.
    thresholds: Vec<f64>,
}

impl StartDistribution {
    pub(super) fn from_model(model: &Model, laws: &[Law]) -> Self {
        Self {
            geometry: model.circuit.geometry,
            phases: model.start_phases(),
            thresholds: laws.iter().map(|law| law.threshold).collect(),
        }
    }

    pub(super) fn window(&self, crop: Crop, geometry: Geometry) -> Self {
        let thresholds = crop.pick(self.geometry, &self.thresholds);
        Self { geometry, phases: self.phases.clone(), thresholds }
    }
}

/// The per-pixel draws of the initial state.
///
/// In a short recording, drawing the initial state takes most of the time. The kernels therefore implement this trait
/// with vectors.
pub(crate) trait StartDraws {
    /// Draws the charges of pixels without surplus, starting at pixel `first`.
    ///
    /// `pixels` contains the exact thresholds (in nominal thresholds) and the rounded thresholds (in steps). The method
    /// writes two values per pixel to `to`: the whole steps relative to the threshold, and the fraction.
    fn charges(
        &self,
        phases: &StartPhases,
        rng: CounterRng,
        first: usize,
        pixels: (&[f64], &[i16]),
        to: (&mut [i16], &mut [i16]),
    );

    /// Draws one normal value per pixel.
    fn normals(&self, round: RoundKey, to: &mut [i16]);
}

/// An implementation that draws one pixel at a time.
pub(crate) struct ScalarDraws;

impl StartDraws for ScalarDraws {
    fn charges(
        &self,
        phases: &StartPhases,
        rng: CounterRng,
        first: usize,
        (exact, thresholds): (&[f64], &[i16]),
        (wholes, fractions): (&mut [i16], &mut [i16]),
    ) {
        let pixels = exact.iter().zip(thresholds).enumerate();
        for ((p, (&exact, &threshold)), (whole, fraction)) in pixels.zip(wholes.iter_mut().zip(fractions)) {
            let fixed = start_charge(phases, rng, first + p, exact, threshold);
            *whole = saturate_to_i16(steps_above_threshold(fixed, threshold));
            *fraction = (fixed as u16 ^ FRACTION_TOP_BIT) as i16;
        }
    }

    fn normals(&self, round: RoundKey, to: &mut [i16]) {
        for (pair, two) in to.chunks_mut(2).enumerate() {
            let bits = hash::hash_bits(address_key(pair as u32), round);
            two.iter_mut().enumerate().for_each(|(p, draw)| *draw = gauss::draw(pixel_half(bits, p)));
        }
    }
}

impl Plan {
    /// Returns the state of the pixels before the first readout.
    ///
    /// # Examples
    /// ```
    /// use spikelane::{Camera, Plan, Seeds, Sensor, Simulator};
    /// let plan = Plan::new(&Camera::ideal(Sensor::new(32, 24, 20_000.0)?), Seeds::default())?;
    /// assert_eq!(plan.initial_state().readout(), 0);
    /// assert_eq!(*Simulator::from_plan(plan.clone()).state(), plan.initial_state());
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    #[must_use]
    pub fn initial_state(&self) -> SimulatorState {
        self.initial_state_with(&ScalarDraws)
    }

    /// Returns the state before the first readout in which the pixels have given charges instead of drawn charges.
    ///
    /// `shares` contains the charge of each pixel as a share of the pixel's threshold. The charge is rounded down to
    /// 1/65,536 step. Use the state to start from the charges of another simulator.
    ///
    /// # Examples
    /// ```
    /// use spikelane::{Camera, Plan, Seeds, Sensor, Simulator};
    /// let plan = Plan::new(&Camera::ideal(Sensor::new(32, 24, 20_000.0)?), Seeds::default())?;
    /// let state = plan.initial_state_with_charges(&[0.75; 32 * 24])?;
    /// let mut simulator = Simulator::from_plan(plan);
    /// simulator.set_state(state)?;
    /// // A fifth of full scale: with three quarters of the threshold, every pixel fires at the second readout.
    /// let spikes = simulator.run(&[51u8; 32 * 24], 2)?;
    /// assert_eq!((spikes.get(0, 0, 0), spikes.get(1, 0, 0)), (false, true));
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`ErrorKind::Input`](crate::ErrorKind::Input) if the number of shares is not the number of pixels, or if a share is not in 0 to below 1.
    pub fn initial_state_with_charges(&self, shares: &[f64]) -> Result<SimulatorState> {
        let wrong = |found: String| error!(Input, "start charges"; found "{found}");
        let pixels = self.geometry.pixels();
        if shares.len() != pixels {
            return Err(wrong(format!("{} values", shares.len())).expected(format_args!("{pixels} values")));
        }
        if let Some(p) = shares.iter().position(|share| !(0.0..1.0).contains(share)) {
            return Err(wrong(format!("{} at pixel {p}", shares[p]))
                .expected("a share of the threshold from 0 to below 1"));
        }
        let mut state = self.initial_state();
        let thresholds = &self.tables().threshold;
        for (p, (share, threshold)) in shares.iter().zip(thresholds).enumerate() {
            let fixed = (share * f64::from(*threshold) * 65_536.0) as i64;
            state.charge[p] = saturate_to_i16(steps_above_threshold(fixed, *threshold));
            state.fraction[p] = (fixed as u16 ^ FRACTION_TOP_BIT) as i16;
            if let Some(surplus) = state.surplus.get_mut(p) {
                *surplus = 0;
            }
        }
        Ok(state)
    }

    /// Returns the state before the first readout, drawn by `draws`.
    pub(crate) fn initial_state_with(&self, draws: &impl StartDraws) -> SimulatorState {
        let (tables, rules, dynamics) = (self.tables(), self.rules(), self.dynamics());
        let padded = self.padded_pixels();
        let asks_fired = rules.lost_increment != 0.0 || dynamics.is_some_and(Dynamics::has_coupled_pixels);
        let waits = rules.release_share != 0;
        let mut state = SimulatorState {
            charge: vec![-1; padded],
            fraction: vec![FRACTION_TOP_BIT as i16; padded],
            surplus: if rules.counts_surplus { vec![0; padded] } else { Vec::new() },
            fired: if asks_fired { vec![0; padded] } else { Vec::new() },
            // Initially no noise is pending, as if the camera had been in the dark.
            pending_noise: if waits { vec![0; padded] } else { Vec::new() },
            pending_noise_fraction: if waits { vec![FRACTION_TOP_BIT as i16; padded] } else { Vec::new() },
            ..SimulatorState::default()
        };
        draw_charges(&mut state, &self.start_distribution, self.seeds, &tables.threshold, draws);
        if rules.noise_sampling == NoiseSampling::EveryReset {
            freeze_noise(&mut state, self.seeds, tables, draws);
        }
        if let Some(dynamics) = dynamics {
            init_slow_state(&mut state, self.seeds, dynamics);
        }
        if self.faults.repeat_probability != 0 {
            state.last_frame = vec![0; self.geometry.frame_bytes().div_ceil(2)];
        }
        state
    }
}

/// Draws the charges of all pixels.
fn draw_charges(
    state: &mut SimulatorState,
    origin: &StartDistribution,
    seeds: Seeds,
    thresholds: &[i16],
    draws: &impl StartDraws,
) {
    let rng = CounterRng::new(seeds, RandomStream::from_name("start_phase"));
    if state.surplus.is_empty() {
        let pixels = origin.thresholds.len();
        let to = (&mut state.charge[..pixels], &mut state.fraction[..pixels]);
        draws.charges(&origin.phases, rng, 0, (&origin.thresholds, &thresholds[..pixels]), to);
        return;
    }
    let pixels = origin.thresholds.iter().zip(thresholds).enumerate();
    let outs = state.charge.iter_mut().zip(&mut state.fraction).zip(&mut state.surplus);
    for ((p, (&exact, &threshold)), ((whole, fraction), surplus)) in pixels.zip(outs) {
        let fixed = start_charge(&origin.phases, rng, p, exact, threshold);
        let (mut above, size) = (steps_above_threshold(fixed, threshold), i64::from(threshold));
        if above >= 0 {
            let thresholds = (above / size + 1).min(i64::from(i16::MAX));
            above -= thresholds * size;
            *surplus = thresholds as i16;
        }
        *whole = saturate_to_i16(above);
        *fraction = (fixed as u16 ^ FRACTION_TOP_BIT) as i16;
    }
}

/// Returns the charge of pixel `p` in steps x 65,536.
fn start_charge(phases: &StartPhases, rng: CounterRng, p: usize, exact: f64, threshold: i16) -> i64 {
    let unit = |b: u32| f64::from(b) / 4_294_967_296.0;
    let bits = rng.pixel_bits(p as u32);
    let charge = phases.charge(exact, unit((bits >> 32) as u32), unit(bits as u32));
    (charge * f64::from(threshold) / exact * 65_536.0) as i64
}

fn steps_above_threshold(fixed: i64, threshold: i16) -> i64 {
    (fixed >> 16) - i64::from(threshold)
}

fn saturate_to_i16(x: i64) -> i16 {
    x.clamp(i64::from(i16::MIN), i64::from(i16::MAX)) as i16
}

/// Initializes the slow state. The slow noise and the switching dark currents start with their stationary distributions.
/// All other values start at 0.
fn init_slow_state(state: &mut SimulatorState, seeds: Seeds, dynamics: &Dynamics) {
    let padded = dynamics.threshold.len();
    let rng = |name: &str| CounterRng::new(seeds, RandomStream::from_name(name));
    let mut store = |at: usize, value: &dyn Fn(usize) -> f32| {
        let bits: Vec<u32> = (0..padded).map(|p| value(p).to_bits()).collect();
        state.slow_state[at] = bits.iter().map(|b| (b >> 16) as i16).collect();
        state.slow_state[at + 1] = bits.iter().map(|b| *b as i16).collect();
    };
    if let Some(slow) = dynamics.slow_noise {
        let rng = rng("slow_threshold_noise/start");
        store(SLOW_NOISE_COLUMN, &|p| {
            let deviation = f32::from(gauss::draw(rng.pixel_bits(p as u32) as u16)) * slow.start;
            deviation.clamp(-slow.bound, slow.bound)
        });
    }
    if dynamics.adaptation.is_some() {
        store(ADAPTATION_COLUMN, &|_| 0.0);
    }
    if dynamics.lag.is_some() {
        store(LAG_COLUMN, &|_| 0.0);
    }
    if dynamics.telegraph.is_some() {
        let rng = rng("telegraph_dark/start");
        state.slow_state[TELEGRAPH_COLUMN] =
            (0..padded).map(|p| -((rng.pixel_bits(p as u32) & 1) as i16)).collect();
    }
}

/// Draws the noise that is frozen until the first reset.
fn freeze_noise(state: &mut SimulatorState, seeds: Seeds, tables: &PixelTables, draws: &impl StartDraws) {
    let round = CounterRng::new(seeds, RandomStream::from_name("thermal_noise")).round_key(PRE_START_READOUT);
    let mut drawn = vec![0; tables.threshold.len()];
    draws.normals(round, &mut drawn);
    match &tables.noise {
        None => {}
        Some(NoiseTable::Whole(table)) => {
            let noise =
                |(&draw, &m): (&i16, &i16)| ((i32::from(draw) * i32::from(m) + (1 << 14)) >> 15) as i16;
            state.frozen_noise = drawn.iter().zip(table).map(noise).collect();
        }
        Some(NoiseTable::Fine(table)) => {
            let noise = |(&draw, &m): (&i16, &f32)| round_to_nearest(f32::from(draw) * m);
            let fixed: Vec<i32> = drawn.iter().zip(table).map(noise).collect();
            state.frozen_noise = fixed.iter().map(|v| (v >> 16) as i16).collect();
            state.frozen_noise_fraction = fixed.iter().map(|v| *v as i16).collect();
        }
    }
}

/// Rounds to the nearest integer, ties to even.
///
/// The sum `x + 1.5 * 2^52` has no bits for a fraction, so the addition rounds `x`. `round_ties_even` would be a
/// function call per pixel on targets without a guaranteed rounding instruction.
fn round_to_nearest(x: f32) -> i32 {
    const SHIFT: f64 = 6_755_399_441_055_744.0;
    (f64::from(x) + SHIFT - SHIFT) as i32
}

#[cfg(test)]
mod tests {
    use super::round_to_nearest;

    #[test]
    fn the_nearest_whole_number_is_that_of_the_standard_library() {
        let some = (-40_000..40_000).map(|i| i as f32 * 0.25);
        let large = (0..200).map(|i| 1.17_f32.powi(i)).flat_map(|x| [x, -x]);
        for x in some.chain(large) {
            assert_eq!(round_to_nearest(x), x.round_ties_even() as i32, "{x}");
        }
    }
}
