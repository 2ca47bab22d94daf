//! Charge that is the threshold exactly, and bounds on stored charge, against exact rational arithmetic.
//!
//! A reset that keeps no remainder, or a clamp, makes the rate jump where the light passes certain values, so here no
//! tolerance on a rate can decide: what is allowed is stated for the light and for the bound themselves.

use crate::common_oracle::{camera_with, preset, seeds, sensor, unpack};
use proptest::prelude::*;
use spikelane::simulate::FrameRef;
use spikelane::unstable::kernels::Samples;
use spikelane::{Backend, Camera, Plan, Simulator};

/// Half an ulp of f32, relative.
const HALF_ULP: f64 = 1.0 / 16_777_216.0;

/// A fraction, in lowest terms or not.
#[derive(Clone, Copy, Debug)]
struct Ratio(i128, i128);

impl Ratio {
    fn value(self) -> f64 {
        self.0 as f64 / self.1 as f64
    }

    fn times(self, other: Self) -> Self {
        Self(self.0 * other.0, self.1 * other.1)
    }

    /// Readouts until so much a readout makes one threshold.
    fn readouts(self) -> i128 {
        (self.1 + self.0 - 1) / self.0
    }

    fn divides_the_threshold(self) -> bool {
        self.1 % self.0 == 0
    }
}

fn losing(exposure: Ratio, lost: f64) -> Camera {
    let mut camera = preset("spikecv-image", 1, 1);
    camera.sensor.thresholds_at_full_scale = exposure.value();
    let effect = camera.effect("partial_reset").unwrap().clone().with("lost_remainder", lost).unwrap();
    camera.with(effect)
}

/// The readouts at which every pixel fires, from an empty start under held light, and the plan's steps.
fn spikes(camera: &Camera, light: Samples<'_>, readouts: usize, backend: Backend) -> (Vec<Vec<u32>>, u32) {
    let mut camera = camera.clone();
    camera.sensor = spikelane::Sensor { geometry: sensor(light.len() as u32, 1).geometry, ..camera.sensor };
    let geometry = camera.sensor.geometry;
    let plan = Plan::new(&camera, seeds(0)).unwrap();
    let steps = plan.steps();
    let mut simulator = Simulator::of_plan(plan).with_backend(backend).unwrap();
    let mut bytes = vec![0; readouts * geometry.frame_bytes()];
    simulator.push(FrameRef::dense(light, geometry), &mut bytes).unwrap();
    (unpack(&bytes, geometry).pixels, steps)
}

fn backends() -> impl Iterator<Item = Backend> {
    Backend::ALL.into_iter().filter(|b| b.available())
}

/// That a pixel which gains `x` a readout fires at every readout of the exact rule, or, where it is short of the threshold
/// by no more than fixed point may add, one earlier.
fn fires_by_the_rule(times: &[u32], x: Ratio, steps: u32, readouts: usize) -> Result<(), String> {
    let exact = x.readouts();
    let short = 1.0 - x.value() * (exact - 1) as f64;
    // The light's own half ulp, four of the arithmetic and five by which increments are raised; a unit for each of them.
    let added = 10.0 * HALF_ULP + (exact - 1) as f64 / 65_536.0 / f64::from(steps);
    let early = exact > 1 && short <= added && times.first() == Some(&(exact as u32 - 2));
    let period = if early { exact - 1 } else { exact };
    let wanted: Vec<u32> =
        (1..).map(|n| (n * period - 1) as u32).take_while(|t| (*t as usize) < readouts).collect();
    if times == wanted {
        return Ok(());
    }
    let found = &times[..times.len().min(4)];
    Err(format!(
        "{x:?} is due at every readout {exact}, short of one less by {short:e} ({added:e} allowed): {found:?}"
    ))
}

/// All 256 greys, at the exposure of the preset and at others: a grey that divides the threshold fires when it is reached, and
/// no grey fires sooner or later than the rule says, at any of 1,100 readouts, on any backend.
#[test]
fn every_grey_of_a_hard_reset_fires_at_the_readout_of_the_exact_rule() {
    let greys: Vec<u8> = (0..=255).collect();
    for exposure in [Ratio(1, 2), Ratio(1, 1), Ratio(1, 3), Ratio(7, 10), Ratio(255, 256)] {
        for backend in backends() {
            let (found, _) = spikes(&losing(exposure, 1.0), Samples::U8(&greys), 1100, backend);
            assert!(found[0].is_empty(), "the dark fires");
            for (grey, times) in found.iter().enumerate().skip(1) {
                let period = exposure.times(Ratio(grey as i128, 255)).readouts() as u32;
                let wanted: Vec<u32> = (1..).map(|n| n * period - 1).take_while(|t| *t < 1100).collect();
                assert_eq!(times, &wanted, "grey {grey} at {exposure:?} on {backend}: due every {period}");
            }
        }
    }
}

/// The 16-bit codes that divide a threshold of twice full scale, and their neighbours.
#[test]
fn codes_of_sixteen_bits_fire_at_ties_and_their_neighbours_do_not() {
    let divisors = (1..=65_535u32).filter(|v| 131_070 % v == 0 && *v >= 66);
    let codes: Vec<u16> = divisors.flat_map(|v| [v - 1, v, (v + 1).min(65_535)]).map(|v| v as u16).collect();
    for backend in backends() {
        let (found, _) = spikes(&losing(Ratio(1, 2), 1.0), Samples::U16(&codes), 4200, backend);
        for (code, times) in codes.iter().zip(&found) {
            let period = Ratio(i128::from(*code), 131_070).readouts() as u32;
            let wanted: Vec<u32> = (1..).map(|n| n * period - 1).take_while(|t| *t < 4200).collect();
            assert_eq!(times, &wanted, "code {code} on {backend}: due every {period}");
        }
    }
}

/// A rest that shrinks to nothing keeps a tie a tie: resets that lose half and more fire like hard ones there.
#[test]
fn resets_that_lose_half_and_more_never_miss_a_tie() {
    let light: Vec<f32> = (1..=256).map(|k| 1.0 / k as f32).collect();
    for lost in [0.5, 0.8, 1.0] {
        let (found, _) = spikes(&losing(Ratio(1, 1), lost), Samples::F32(&light), 3000, Backend::best());
        for (period, times) in (1..=256u32).zip(&found) {
            let wanted: Vec<u32> = (1..).map(|n| n * period - 1).take_while(|t| *t < 3000).collect();
            assert_eq!(times, &wanted, "a share of {lost} is lost, light 1/{period}");
        }
    }
}

fn light() -> impl Strategy<Value = (Ratio, f32)> {
    let any = (1..2000i128, 1..2000i128).prop_map(|(a, b)| Ratio(a.min(b), a.max(b)));
    any.prop_filter("a dim pixel needs too long", |r| r.value() > 0.004).prop_map(|r| (r, r.value() as f32))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    /// Light and exposure are any fractions, of which f32 and f64 hold roundings.
    #[test]
    fn a_hard_reset_follows_the_exact_rule_at_any_light(
        lights in proptest::collection::vec(light(), 200),
        exposure in (1..30i128, 1..30i128),
    ) {
        let exposure = Ratio(exposure.0.min(exposure.1), exposure.0.max(exposure.1));
        let samples: Vec<f32> = lights.iter().map(|l| l.1).collect();
        let (found, steps) = spikes(&losing(exposure, 1.0), Samples::F32(&samples), 800, Backend::best());
        for ((ratio, _), times) in lights.iter().zip(&found) {
            fires_by_the_rule(times, exposure.times(*ratio), steps, 800).map_err(TestCaseError::fail)?;
        }
    }

    /// Light of `1/(k exposure)` makes a tie of every pixel.
    #[test]
    fn ties_at_any_exposure_fire_when_they_are_reached(exposure in (1..300i128, 1..300i128), first in 1..300i128) {
        let exposure = Ratio(exposure.0.min(exposure.1), exposure.0.max(exposure.1));
        let needed = first.max((exposure.1 + exposure.0 - 1) / exposure.0);
        let lights: Vec<Ratio> = (needed..needed + 64).map(|k| Ratio(exposure.1, exposure.0 * k)).collect();
        let samples: Vec<f32> = lights.iter().map(|l| l.value() as f32).collect();
        let (found, steps) = spikes(&losing(exposure, 1.0), Samples::F32(&samples), 1300, Backend::best());
        for (ratio, times) in lights.iter().zip(&found) {
            let x = exposure.times(*ratio);
            prop_assert!(x.divides_the_threshold());
            fires_by_the_rule(times, x, steps, 1300).map_err(TestCaseError::fail)?;
        }
    }
}

/// Fractions of a threshold that the exact counts below are kept in.
const UNIT: f64 = (1u128 << 90) as f64;

/// Spikes up to every readout of a pixel without noise that gains `x` a readout and stores at most `bound`, both in thresholds.
fn bounded(x: f64, bound: f64, readouts: usize) -> Vec<u32> {
    // Doubles between 2^-38 and 1 are whole numbers of 2^-90.
    let (x, bound, one) = ((x * UNIT) as i128, (bound * UNIT) as i128, UNIT as i128);
    let (mut charge, mut count) = (0, 0);
    (0..readouts)
        .map(|_| {
            charge = (charge + x).min(bound);
            if charge >= one {
                charge -= one;
                count += 1;
            }
            count
        })
        .collect()
}

/// The same of the plan.
fn clamped(light: &[f32], bound: f64, readouts: usize) -> (Vec<Vec<u32>>, f64) {
    let camera = camera_with(1, 1, &[("saturation_clamp", &[("largest_charge", bound)])]);
    let (times, steps) = spikes(&camera, Samples::F32(light), readouts, Backend::best());
    let counts = times.iter().map(|times| {
        let mut fired = vec![0; readouts];
        times.iter().for_each(|t| fired[*t as usize] = 1);
        fired
            .iter()
            .scan(0, |n, f| {
                *n += f;
                Some(*n)
            })
            .collect()
    });
    (counts.collect(), 1.0 / f64::from(steps))
}

/// What [`clamped`] lies between: the exact rule at the ends of the light's and the bound's intervals. Counts grow with both, so
/// whatever lies within them counts in between.
fn ends(light: f32, bound: f64, step: f64, readouts: usize) -> [Vec<u32>; 2] {
    let x = f64::from(light);
    let error = 4.0 * HALF_ULP * x + 0.5 * step / 65_536.0;
    [bounded(x - error, bound - 0.5 * step, readouts), bounded(x + error, bound + 1.5 * step, readouts)]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    #[test]
    fn a_clamp_counts_like_the_exact_rule_with_a_bound_within_its_stated_interval(
        bound in 1.0..1.99f64,
        lights in proptest::collection::vec(0.3f32..1.0, 64),
    ) {
        let (found, step) = clamped(&lights, bound, 400);
        for (light, counts) in lights.iter().zip(&found) {
            let [low, high] = ends(*light, bound, step, 400);
            let within = counts.iter().zip(low.iter().zip(&high)).all(|(n, (a, b))| a <= n && n <= b);
            prop_assert!(within, "light {light}, bound {bound}: {:?}", (low.last(), counts.last(), high.last()));
        }
    }
}

/// Light of 0.9 and less by parts of a step, below a bound of 1.2 thresholds: what is kept of a step decides whether two increments
/// after the bound make a spike. A bound that were kept to less than nine tenths of a step would count fewer
/// spikes than the plan does somewhere; a bound that is rounded to whole steps counts fewer than the exact one elsewhere.
#[test]
fn the_stated_interval_of_a_clamp_is_reached_at_both_ends() {
    let lights: Vec<f32> = (0..400).map(|i| 0.9 - 1e-7 * i as f32).collect();
    let (found, step) = clamped(&lights, 1.2, 3000);
    assert_eq!(step, 1.0 / 16_320.0);
    let above = lights.iter().zip(&found).filter(|(light, counts)| {
        bounded(f64::from(**light) + 4.0 * HALF_ULP, 1.2 + 0.9 * step, 3000).last() < counts.last()
    });
    assert!(above.count() > 0, "no light shows nine tenths of a step beyond the bound");
    // A bound that lies 0.45 steps above a whole one is rounded down.
    let bound = 1.2 + 0.45 * step;
    let (found, _) = clamped(&lights, bound, 3000);
    let below = lights.iter().zip(&found).filter(|(light, counts)| {
        bounded(f64::from(**light) - 4.0 * HALF_ULP, bound, 3000).last() > counts.last()
    });
    assert!(below.count() > 0, "no light shows that the bound is a whole number of steps");
}
