//! Tests of counted quanta. The kernels draw the counts of the tables. Rate and phase variance are continuous at the
//! light at which normal draws replace counts.

use crate::common_oracle::{Estimate, camera_with, charges, oracle, seeds, simulate_times};
use spikelane::unstable::draws::hash::address_key;
use spikelane::{Camera, Plan, Simulator};

/// Number of photons in a nominal threshold. It is so small that the charge determines the number of photons.
const PHOTONS: f64 = 400.0;

fn camera(width: u32, height: u32) -> Camera {
    let shot: &[(&str, f64)] = &[("strength", 1.0), ("counts", 1.0), ("photons_at_full_scale", PHOTONS)];
    camera_with(width, height, &[("shot_noise", shot)])
}

/// The number of photons is the charge of an empty pixel after one readout, divided by the charge of a photon.
///
/// The measured count must equal the count that the tables return for the random bits of the pixel. `draws::poisson`
/// proves that the total variation between the tables and the Poisson distribution is below 2e-4. Equal counts extend
/// this bound to the kernels. The counts of 2^20 pixels also pass a chi-square test against the Poisson distribution
/// with 30 cells. A total variation of 2e-4 would add about 0.1 to chi-square. A total variation of 5e-3 would add more
/// than 100.
#[test]
fn the_kernels_counts_are_the_tables_counts() {
    for mean in [0.3, 2.0, 11.0, 40.0, 63.5] {
        let camera = camera(1024, 1024);
        let pixels = 1024 * 1024;
        let light = vec![(mean / PHOTONS) as f32; pixels];
        let plan = Plan::new(&camera, seeds(6)).unwrap();
        let mut simulator = Simulator::from_plan(plan.clone());
        let mut bytes = vec![0; camera.sensor.geometry.frame_bytes()];
        simulator.fill(&light, &mut bytes).unwrap();
        let tables = plan.count_tables().unwrap();
        let prepared = tables.prepare(light[0] * 255.0 * plan.tables().shot.as_ref().unwrap().light[0]);
        let mut histogram = [0.0f64; 128];
        for (p, charge) in charges(&plan, simulator.state()).iter().enumerate() {
            let count = (charge * PHOTONS).round();
            let drawn = tables.draw(prepared, plan.rngs().counts.hash_bits(address_key(p as u32), 0));
            assert_eq!(count, f64::from(drawn), "pixel {p} at mean {mean}");
            histogram[count as usize] += 1.0;
        }
        let mut probability = (-mean).exp();
        let (mut square, mut cells) = (0.0, 0.0);
        for (k, observed) in histogram.iter().enumerate() {
            let expected = probability * f64::from(pixels as u32);
            if expected > 10.0 {
                square += (observed - expected).powi(2) / expected;
                cells += 1.0;
            }
            probability *= mean / (k + 1) as f64;
        }
        eprintln!("mean {mean}: chi-square {square:.1} in {cells} cells");
        let bound: f64 = cells + 4.5 * (2.0f64 * cells).sqrt();
        assert!(square < bound, "mean {mean}: {square} in {cells} cells");
    }
}

/// Compares rate and phase variance below and above 64 photons. With a threshold of 400 photons, 64 photons correspond to
/// light 0.16.
///
/// At 64 photons, D(8) is 1/6 + 8/400/0.16^2 = 0.95. With 400 pixels and 20,000 readouts, its standard error is about
/// 0.3 %. The bound is 4.5 joint standard errors of D(8) below and above 64 photons. It detects a step of 2 % in the
/// variance.
#[test]
fn nothing_jumps_where_the_normal_draw_takes_over() {
    let camera = camera(400, 1).with_effect(spikelane::effects::find("start_phase").unwrap().typical());
    let model = camera.model(seeds(6)).unwrap();
    let run = |quanta: f64| {
        let light = vec![(quanta / PHOTONS) as f32; 400];
        let times = simulate_times(&camera, seeds(7), &light, 100, 20_000);
        let truth = oracle(&model, &light, 100, 20_000, 5);
        let scale =
            |e: Estimate| Estimate { mean: e.mean * quanta.powi(2), error: e.error * quanta.powi(2), ..e };
        let rate = |e: Estimate| Estimate { mean: e.mean / quanta, error: e.error / quanta, ..e };
        eprintln!(
            "{quanta}: D(8) {} oracle {}, rate {} oracle {}",
            times.interval_sum_variance(8),
            truth.interval_sum_variance(8),
            times.rate(),
            truth.rate()
        );
        assert!(times.interval_sum_variance(8).sigmas(truth.interval_sum_variance(8), 1e-6).abs() < 4.5);
        assert!(times.rate().sigmas(truth.rate(), 1e-7).abs() < 4.5);
        (scale(times.interval_sum_variance(8)), rate(times.rate()))
    };
    let (below, above) = (run(63.9), run(64.1));
    // With the rate f, D(8) f^2 = f^2/6 + 8/400. Between the two light levels, the term f^2/6 differs by 0.6 %, which
    // is 0.11 % of D(8) f^2.
    assert!(below.0.sigmas(above.0, 2e-3 * below.0.mean).abs() < 4.5, "{} {}", below.0, above.0);
    assert!(below.1.sigmas(above.1, 1e-9).abs() < 4.5, "{} {}", below.1, above.1);
}
