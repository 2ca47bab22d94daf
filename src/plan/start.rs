//! The state before the first readout.

use crate::draws::hash::{self, Clock, Round, half, key};
use crate::draws::{Seeds, Stream, gauss};
use crate::effects::{Model, Phases};
use crate::pixel::{Law, Redraw};
use crate::plan::Plan;
use crate::plan::moving::Moving;
use crate::plan::state::{ADAPTED, FLIP, LATE, LOW, SLOW, State};
use crate::plan::tables::{NoiseTable, Tables};
use crate::spikes::{Crop, Geometry};

/// The readout whose draw is frozen before the first one.
const BEFORE_FIRST: u64 = u64::MAX;

/// What charges at the first readout are drawn from.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Origin {
    geometry: Geometry,
    phases: Phases,
    /// Thresholds of the pixels in nominal ones, before they were rounded.
    thresholds: Vec<f64>,
}

impl Origin {
    pub(super) fn of(model: &Model, laws: &[Law]) -> Self {
        Self {
            geometry: model.circuit.geometry,
            phases: model.phases(),
            thresholds: laws.iter().map(|law| law.threshold).collect(),
        }
    }

    pub(super) fn window(&self, crop: Crop, geometry: Geometry) -> Self {
        let thresholds = crop.pick(self.geometry, &self.thresholds);
        Self { geometry, phases: self.phases.clone(), thresholds }
    }
}

/// The draws that every pixel has. They are most of a short recording's work, so that a kernel has faster ones.
pub(crate) trait Draws {
    /// Charges of pixels from `first` on that hold no surplus, whose thresholds are `exact` nominal ones and so many whole steps: whole
    /// steps above the threshold, and the fraction.
    fn charges(
        &self,
        phases: &Phases,
        clock: Clock,
        first: usize,
        pixels: (&[f64], &[i16]),
        to: (&mut [i16], &mut [i16]),
    );

    /// A unit normal value for each pixel.
    fn units(&self, round: Round, to: &mut [i16]);
}

/// One pixel after the other.
pub(crate) struct Plain;

impl Draws for Plain {
    fn charges(
        &self,
        phases: &Phases,
        clock: Clock,
        first: usize,
        (exact, thresholds): (&[f64], &[i16]),
        (wholes, fractions): (&mut [i16], &mut [i16]),
    ) {
        let pixels = exact.iter().zip(thresholds).enumerate();
        for ((p, (&exact, &threshold)), (whole, fraction)) in pixels.zip(wholes.iter_mut().zip(fractions)) {
            let fixed = fixed(phases, clock, first + p, exact, threshold);
            *whole = of_16_bits(above(fixed, threshold));
            *fraction = (fixed as u16 ^ FLIP) as i16;
        }
    }

    fn units(&self, round: Round, to: &mut [i16]) {
        for (pair, two) in to.chunks_mut(2).enumerate() {
            let bits = hash::bits(key(pair as u32), round);
            two.iter_mut().enumerate().for_each(|(p, draw)| *draw = gauss::unit(half(bits, p)));
        }
    }
}

impl Plan {
    /// The pixels' state before the first readout.
    #[must_use]
    pub fn start(&self) -> State {
        self.start_with(&Plain)
    }

    /// The same, by other loops that draw the same.
    pub(crate) fn start_with(&self, draws: &impl Draws) -> State {
        let (tables, rules, moving) = (self.tables(), self.rules(), self.moving());
        let padded = self.padded();
        let asks_fired = rules.lost_increment != 0.0 || moving.is_some_and(Moving::couples);
        let waits = rules.released != 0;
        let mut state = State {
            charge: vec![-1; padded],
            fraction: vec![FLIP as i16; padded],
            surplus: if rules.surplus { vec![0; padded] } else { Vec::new() },
            fired: if asks_fired { vec![0; padded] } else { Vec::new() },
            // Nothing waits at first, as after a lens cap.
            waiting: if waits { vec![0; padded] } else { Vec::new() },
            waiting_fraction: if waits { vec![FLIP as i16; padded] } else { Vec::new() },
            ..State::default()
        };
        charge(&mut state, &self.origin, self.seeds, &tables.threshold, draws);
        if rules.redraw == Redraw::EveryReset {
            freeze(&mut state, self.seeds, tables, draws);
        }
        if let Some(moving) = moving {
            linger(&mut state, self.seeds, moving);
        }
        if self.losses.repeated != 0 {
            state.last = vec![0; self.geometry.frame_bytes().div_ceil(2)];
        }
        state
    }
}

/// Draws the charges.
fn charge(state: &mut State, origin: &Origin, seeds: Seeds, thresholds: &[i16], draws: &impl Draws) {
    let clock = Clock::new(seeds, Stream::named("start_phase"));
    if state.surplus.is_empty() {
        let pixels = origin.thresholds.len();
        let to = (&mut state.charge[..pixels], &mut state.fraction[..pixels]);
        draws.charges(&origin.phases, clock, 0, (&origin.thresholds, &thresholds[..pixels]), to);
        return;
    }
    let pixels = origin.thresholds.iter().zip(thresholds).enumerate();
    let outs = state.charge.iter_mut().zip(&mut state.fraction).zip(&mut state.surplus);
    for ((p, (&exact, &threshold)), ((whole, fraction), surplus)) in pixels.zip(outs) {
        let fixed = fixed(&origin.phases, clock, p, exact, threshold);
        let (mut above, size) = (above(fixed, threshold), i64::from(threshold));
        if above >= 0 {
            let thresholds = (above / size + 1).min(i64::from(i16::MAX));
            above -= thresholds * size;
            *surplus = thresholds as i16;
        }
        *whole = of_16_bits(above);
        *fraction = (fixed as u16 ^ FLIP) as i16;
    }
}

/// The charge of pixel `p` in steps x 65,536.
fn fixed(phases: &Phases, clock: Clock, p: usize, exact: f64, threshold: i16) -> i64 {
    let unit = |b: u32| f64::from(b) / 4_294_967_296.0;
    let bits = clock.once(p as u32);
    let charge = phases.charge(exact, unit((bits >> 32) as u32), unit(bits as u32));
    (charge * f64::from(threshold) / exact * 65_536.0) as i64
}

fn above(fixed: i64, threshold: i16) -> i64 {
    (fixed >> 16) - i64::from(threshold)
}

fn of_16_bits(x: i64) -> i16 {
    x.clamp(i64::from(i16::MIN), i64::from(i16::MAX)) as i16
}

/// What lingers, before the first readout: wandering thresholds and switches in their balance.
fn linger(state: &mut State, seeds: Seeds, moving: &Moving) {
    let padded = moving.threshold.len();
    let clock = |name: &str| Clock::new(seeds, Stream::named(name));
    let mut store = |at: usize, value: &dyn Fn(usize) -> f32| {
        let bits: Vec<u32> = (0..padded).map(|p| value(p).to_bits()).collect();
        state.lingering[at] = bits.iter().map(|b| (b >> 16) as i16).collect();
        state.lingering[at + 1] = bits.iter().map(|b| *b as i16).collect();
    };
    if let Some(slow) = moving.slow {
        let clock = clock("slow_threshold_noise/start");
        store(SLOW, &|p| {
            let deviation = f32::from(gauss::unit(clock.once(p as u32) as u16)) * slow.start;
            deviation.clamp(-slow.bound, slow.bound)
        });
    }
    if moving.adaptation.is_some() {
        store(ADAPTED, &|_| 0.0);
    }
    if moving.lag.is_some() {
        store(LATE, &|_| 0.0);
    }
    if moving.telegraph.is_some() {
        let clock = clock("telegraph_dark/start");
        state.lingering[LOW] = (0..padded).map(|p| -((clock.once(p as u32) & 1) as i16)).collect();
    }
}

/// The noise that is frozen until the first reset.
fn freeze(state: &mut State, seeds: Seeds, tables: &Tables, draws: &impl Draws) {
    let round = Clock::new(seeds, Stream::named("thermal_noise")).round(BEFORE_FIRST);
    let mut drawn = vec![0; tables.threshold.len()];
    draws.units(round, &mut drawn);
    match &tables.noise {
        None => {}
        Some(NoiseTable::Whole(table)) => {
            let noise =
                |(&draw, &m): (&i16, &i16)| ((i32::from(draw) * i32::from(m) + (1 << 14)) >> 15) as i16;
            state.held = drawn.iter().zip(table).map(noise).collect();
        }
        Some(NoiseTable::Fine(table)) => {
            let noise = |(&draw, &m): (&i16, &f32)| nearest(f32::from(draw) * m);
            let fixed: Vec<i32> = drawn.iter().zip(table).map(noise).collect();
            state.held = fixed.iter().map(|v| (v >> 16) as i16).collect();
            state.held_fraction = fixed.iter().map(|v| *v as i16).collect();
        }
    }
}

/// The nearest whole number, of two the even one: adding 1.5 * 2^52 leaves no room for a fraction. Where an instruction for it is
/// not certain, `round_ties_even` is a call for each pixel.
fn nearest(x: f32) -> i32 {
    const SHIFT: f64 = 6_755_399_441_055_744.0;
    (f64::from(x) + SHIFT - SHIFT) as i32
}

#[cfg(test)]
mod tests {
    use super::nearest;

    #[test]
    fn the_nearest_whole_number_is_that_of_the_standard_library() {
        let some = (-40_000..40_000).map(|i| i as f32 * 0.25);
        let large = (0..200).map(|i| 1.17_f32.powi(i)).flat_map(|x| [x, -x]);
        for x in some.chain(large) {
            assert_eq!(nearest(x), x.round_ties_even() as i32, "{x}");
        }
    }
}
