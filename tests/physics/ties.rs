//! Ties and bounds of the stored charge, compared with exact rational arithmetic. At a tie, the charge equals the
//! threshold exactly.
//!
//! With a hard reset or a clamp, the rate is a discontinuous function of the light, so a tolerance for the rate is
//! useless. The tests instead allow an error of the light and of the clamp.

use crate::common_oracle::{camera_with, preset, seeds, sensor, unpack};
use proptest::prelude::*;
use spikelane::FrameRef;
use spikelane::SimulatorOptions;
use spikelane::unstable::kernels::Samples;
use spikelane::{Backend, Camera, Plan};

/// Half an ulp of f32, relative to the value.
const HALF_ULP: f64 = 1.0 / 16_777_216.0;

/// A fraction, not necessarily in lowest terms.
#[derive(Clone, Copy, Debug)]
struct Ratio(i128, i128);

impl Ratio {
    fn value(self) -> f64 {
        self.0 as f64 / self.1 as f64
    }

    fn times(self, other: Self) -> Self {
        Self(self.0 * other.0, self.1 * other.1)
    }

    /// Returns the number of readouts after which the sum of increments of this size reaches one threshold.
    fn readouts(self) -> i128 {
        (self.1 + self.0 - 1) / self.0
    }

    fn divides_the_threshold(self) -> bool {
        self.1 % self.0 == 0
    }
}

fn lossy_camera(exposure: Ratio, lost: f64) -> Camera {
    let mut camera = preset("spikecv-image", 1, 1);
    camera.sensor.thresholds_at_full_scale = exposure.value();
    let effect = camera.effect("partial_reset").unwrap().clone().with_value("lost_remainder", lost).unwrap();
    camera.with_effect(effect)
}

/// Returns the readouts at which every pixel fires, and the number of steps per threshold of the plan. The pixels start
/// empty under constant light.
fn spikes(camera: &Camera, light: Samples<'_>, readouts: usize, backend: Backend) -> (Vec<Vec<u32>>, u32) {
    let mut camera = camera.clone();
    camera.sensor = spikelane::Sensor { geometry: sensor(light.len() as u32, 1).geometry, ..camera.sensor };
    let geometry = camera.sensor.geometry;
    let plan = Plan::new(&camera, seeds(0)).unwrap();
    let steps = plan.threshold_steps();
    let mut simulator = SimulatorOptions::new().backend(backend).build_from_plan(plan).unwrap();
    let mut bytes = vec![0; readouts * geometry.frame_bytes()];
    simulator.fill(FrameRef::new(light), &mut bytes).unwrap();
    (unpack(&bytes, geometry).pixels, steps)
}

fn backends() -> impl Iterator<Item = Backend> {
    Backend::ALL.into_iter().filter(|b| b.is_available())
}

/// Checks that a pixel with increment `x` fires at the readouts of the exact rule.
///
/// A spike may be one readout early if, at that readout, the exact charge is below the threshold by at most the error
/// of the fixed-point arithmetic.
fn fires_by_the_rule(times: &[u32], x: Ratio, steps: u32, readouts: usize) -> Result<(), String> {
    let exact = x.readouts();
    let short = 1.0 - x.value() * (exact - 1) as f64;
    // The sum of increments may be too large by ten half ulps: one for the light, four for the arithmetic, and five by
    // which increments are raised. In addition, each increment may be too large by one unit of 1/65,536 steps.
    let added = 10.0 * HALF_ULP + (exact - 1) as f64 / 65_536.0 / f64::from(steps);
    let early = exact > 1 && short <= added && times.first() == Some(&(exact as u32 - 2));
    let period = if early { exact - 1 } else { exact };
    let wanted: Vec<u32> =
        (1..).map(|n| (n * period - 1) as u32).take_while(|t| (*t as usize) < readouts).collect();
    if times == wanted {
        return Ok(());
    }
    let first_times = &times[..times.len().min(4)];
    Err(format!(
        "{x:?} is due at every readout {exact}, short of one less by {short:e} ({added:e} allowed): {first_times:?}"
    ))
}

/// All 256 gray levels fire at the readouts of the exact rule. The test uses the exposure of the preset and other
/// exposures.
///
/// If the threshold is a multiple of the increment, the pixel fires when the charge equals the threshold. The test checks
/// 1,100 readouts on all backends.
#[test]
fn every_gray_of_a_hard_reset_fires_at_the_readout_of_the_exact_rule() {
    let grays: Vec<u8> = (0..=255).collect();
    for exposure in [Ratio(1, 2), Ratio(1, 1), Ratio(1, 3), Ratio(7, 10), Ratio(255, 256)] {
        for backend in backends() {
            let (counts, _) = spikes(&lossy_camera(exposure, 1.0), Samples::U8(&grays), 1100, backend);
            assert!(counts[0].is_empty(), "the dark fires");
            for (gray, times) in counts.iter().enumerate().skip(1) {
                let period = exposure.times(Ratio(gray as i128, 255)).readouts() as u32;
                let wanted: Vec<u32> = (1..).map(|n| n * period - 1).take_while(|t| *t < 1100).collect();
                assert_eq!(times, &wanted, "gray {gray} at {exposure:?} on {backend}: due every {period}");
            }
        }
    }
}

/// The threshold is twice full scale. The test uses the 16-bit codes that divide this threshold, and adjacent codes.
#[test]
fn codes_of_sixteen_bits_fire_at_ties_and_their_neighbors_do_not() {
    let divisors = (1..=65_535u32).filter(|v| 131_070 % v == 0 && *v >= 66);
    let codes: Vec<u16> = divisors.flat_map(|v| [v - 1, v, (v + 1).min(65_535)]).map(|v| v as u16).collect();
    for backend in backends() {
        let (counts, _) = spikes(&lossy_camera(Ratio(1, 2), 1.0), Samples::U16(&codes), 4200, backend);
        for (code, times) in codes.iter().zip(&counts) {
            let period = Ratio(i128::from(*code), 131_070).readouts() as u32;
            let wanted: Vec<u32> = (1..).map(|n| n * period - 1).take_while(|t| *t < 4200).collect();
            assert_eq!(times, &wanted, "code {code} on {backend}: due every {period}");
        }
    }
}

/// A partial reset loses a share of the charge that remains above the threshold. If it loses at least half, the pixel
/// fires at ties like a pixel with a hard reset, because the remaining charge stays negligible.
#[test]
fn resets_that_lose_half_and_more_never_miss_a_tie() {
    let light: Vec<f32> = (1..=256).map(|k| 1.0 / k as f32).collect();
    for lost in [0.5, 0.8, 1.0] {
        let (counts, _) =
            spikes(&lossy_camera(Ratio(1, 1), lost), Samples::F32(&light), 3000, Backend::best());
        for (period, times) in (1..=256u32).zip(&counts) {
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

    /// Light and exposure are random fractions, which are rounded to f32 and f64.
    #[test]
    fn a_hard_reset_follows_the_exact_rule_at_any_light(
        lights in proptest::collection::vec(light(), 200),
        exposure in (1..30i128, 1..30i128),
    ) {
        let exposure = Ratio(exposure.0.min(exposure.1), exposure.0.max(exposure.1));
        let samples: Vec<f32> = lights.iter().map(|l| l.1).collect();
        let (counts, steps) = spikes(&lossy_camera(exposure, 1.0), Samples::F32(&samples), 800, Backend::best());
        for ((ratio, _), times) in lights.iter().zip(&counts) {
            fires_by_the_rule(times, exposure.times(*ratio), steps, 800).map_err(TestCaseError::fail)?;
        }
    }

    /// With light of `1/(k exposure)`, every pixel has a tie.
    #[test]
    fn ties_at_any_exposure_fire_when_they_are_reached(exposure in (1..300i128, 1..300i128), first in 1..300i128) {
        let exposure = Ratio(exposure.0.min(exposure.1), exposure.0.max(exposure.1));
        let needed = first.max((exposure.1 + exposure.0 - 1) / exposure.0);
        let lights: Vec<Ratio> = (needed..needed + 64).map(|k| Ratio(exposure.1, exposure.0 * k)).collect();
        let samples: Vec<f32> = lights.iter().map(|l| l.value() as f32).collect();
        let (counts, steps) = spikes(&lossy_camera(exposure, 1.0), Samples::F32(&samples), 1300, Backend::best());
        for (ratio, times) in lights.iter().zip(&counts) {
            let x = exposure.times(*ratio);
            prop_assert!(x.divides_the_threshold());
            fires_by_the_rule(times, x, steps, 1300).map_err(TestCaseError::fail)?;
        }
    }
}

/// One threshold in units of 2^-90 thresholds. [`bounded_spikes`] stores charges in these units.
const FIXED_POINT_ONE: f64 = (1u128 << 90) as f64;

/// Returns the cumulative number of spikes of a noise-free pixel at every readout. `x` is the increment and `bound` is
/// the clamp, both in thresholds.
fn bounded_spikes(x: f64, bound: f64, readouts: usize) -> Vec<u32> {
    // Every double between 2^-38 and 1 is a multiple of 2^-90, so the conversion is exact.
    let (x, bound, one) =
        ((x * FIXED_POINT_ONE) as i128, (bound * FIXED_POINT_ONE) as i128, FIXED_POINT_ONE as i128);
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

/// Returns the cumulative number of spikes of every pixel of the plan at every readout, and the size of a step in
/// thresholds.
fn clamped_spikes(light: &[f32], bound: f64, readouts: usize) -> (Vec<Vec<u32>>, f64) {
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

/// Returns a lower and an upper bound of the counts of [`clamped_spikes`].
///
/// The plan rounds the light and the clamp, so each has an interval of possible values. Counts increase with light and
/// with the clamp. The lower bound is therefore the exact count at the lower ends of both intervals, and the upper
/// bound is the exact count at the upper ends.
fn interval_ends(light: f32, bound: f64, step: f64, readouts: usize) -> [Vec<u32>; 2] {
    let x = f64::from(light);
    let error = 4.0 * HALF_ULP * x + 0.5 * step / 65_536.0;
    [
        bounded_spikes(x - error, bound - 0.5 * step, readouts),
        bounded_spikes(x + error, bound + 1.5 * step, readouts),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    #[test]
    fn a_clamp_counts_like_the_exact_rule_with_a_bound_within_its_stated_interval(
        bound in 1.0..1.99f64,
        lights in proptest::collection::vec(0.3f32..1.0, 64),
    ) {
        let (spike_counts, step) = clamped_spikes(&lights, bound, 400);
        for (light, counts) in lights.iter().zip(&spike_counts) {
            let [low, high] = interval_ends(*light, bound, step, 400);
            let within = counts.iter().zip(low.iter().zip(&high)).all(|(n, (a, b))| a <= n && n <= b);
            prop_assert!(within, "light {light}, bound {bound}: {:?}", (low.last(), counts.last(), high.last()));
        }
    }
}

/// The light is 0.9 thresholds per readout, or lower by fractions of a step. The clamp is 1.2 thresholds.
///
/// A charge at the clamp plus two increments is 1.2 + 2 * 0.9 = 3 thresholds. Whether a pixel reaches this sum depends
/// on the stored fraction of a step. For some light, even a clamp that is 0.9 steps larger gives fewer spikes than the
/// plan. For other light, a clamp that is rounded to whole steps gives fewer spikes than the exact clamp.
#[test]
fn the_stated_interval_of_a_clamp_is_reached_at_both_ends() {
    let lights: Vec<f32> = (0..400).map(|i| 0.9 - 1e-7 * i as f32).collect();
    let (spike_counts, step) = clamped_spikes(&lights, 1.2, 3000);
    assert_eq!(step, 1.0 / 16_320.0);
    let above = lights.iter().zip(&spike_counts).filter(|(light, counts)| {
        bounded_spikes(f64::from(**light) + 4.0 * HALF_ULP, 1.2 + 0.9 * step, 3000).last() < counts.last()
    });
    assert!(above.count() > 0, "no light shows nine tenths of a step beyond the bound");
    // The clamp is 0.45 steps above a whole number of steps, so it is rounded down.
    let bound = 1.2 + 0.45 * step;
    let (spike_counts, _) = clamped_spikes(&lights, bound, 3000);
    let below = lights.iter().zip(&spike_counts).filter(|(light, counts)| {
        bounded_spikes(f64::from(**light) - 4.0 * HALF_ULP, bound, 3000).last() > counts.last()
    });
    assert!(below.count() > 0, "no light shows that the bound is a whole number of steps");
}
