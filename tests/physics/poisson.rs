//! Counted quanta: the kernels' counts are the tables', and nothing jumps where a normal draw takes over.

use crate::common_oracle::{Estimate, camera_with, charges, oracle, planned, seeds};
use spikelane::simulate::FrameRef;
use spikelane::unstable::draws::hash::key;
use spikelane::{Camera, Plan, Simulator};

/// Photons in a nominal threshold: few, so that charge tells their number.
const PHOTONS: f64 = 400.0;

fn camera(width: u32, height: u32) -> Camera {
    let shot: &[(&str, f64)] = &[("strength", 1.0), ("counts", 1.0), ("photons_at_full_scale", PHOTONS)];
    camera_with(width, height, &[("shot_noise", shot)])
}

/// Charge after one readout of empty pixels, divided by a photon's, is the count. It must be the
/// count that the tables draw from that pixel's bits, so the total variation that is proved
/// exactly for the tables (below 2e-4, `draws::poisson`) is the kernels' too. Besides, the counts
/// of 2^20 pixels pass a chi-square test against Poisson: a total variation of 2e-4 spread
/// over 30 cells would add about 0.1 to it, one of 5e-3 more than 100.
#[test]
fn the_kernels_counts_are_the_tables_counts() {
    for mean in [0.3, 2.0, 11.0, 40.0, 63.5] {
        let camera = camera(1024, 1024);
        let pixels = 1024 * 1024;
        let light = vec![(mean / PHOTONS) as f32; pixels];
        let plan = Plan::new(&camera, seeds(6)).unwrap();
        let mut simulator = Simulator::of_plan(plan.clone());
        let mut bytes = vec![0; camera.sensor.geometry.frame_bytes()];
        simulator.push(FrameRef::f32(&light, camera.sensor.geometry), &mut bytes).unwrap();
        let tables = plan.counts().unwrap();
        let prepared = tables.prepare(light[0] * 255.0 * plan.tables().shot.as_ref().unwrap().light[0]);
        let mut histogram = [0.0f64; 128];
        for (p, charge) in charges(&plan, simulator.state()).iter().enumerate() {
            let count = (charge * PHOTONS).round();
            let drawn = tables.draw(prepared, plan.clocks().counts.bits(key(p as u32), 0));
            assert_eq!(count, f64::from(drawn), "pixel {p} at mean {mean}");
            histogram[count as usize] += 1.0;
        }
        let mut probability = (-mean).exp();
        let (mut square, mut cells) = (0.0, 0.0);
        for (k, found) in histogram.iter().enumerate() {
            let expected = probability * f64::from(pixels as u32);
            if expected > 10.0 {
                square += (found - expected).powi(2) / expected;
                cells += 1.0;
            }
            probability *= mean / (k + 1) as f64;
        }
        eprintln!("mean {mean}: chi-square {square:.1} in {cells} cells");
        let bound: f64 = cells + 4.5 * (2.0f64 * cells).sqrt();
        assert!(square < bound, "mean {mean}: {square} in {cells} cells");
    }
}

/// Either side of 64 photons: light 0.16 of a threshold of 400. Rate and phase variance have no step.
/// 400 pixels x 20,000 readouts: D(8) = 1/6 + 8/400/0.16^2 = 0.95, known to about 0.3 % on either
/// side; 4.5 joint errors show a step of 2 % in the variance.
#[test]
fn nothing_jumps_where_the_normal_draw_takes_over() {
    let camera = camera(400, 1).with(spikelane::effects::find("start_phase").unwrap().typical());
    let model = camera.model(seeds(6)).unwrap();
    let run = |quanta: f64| {
        let light = vec![(quanta / PHOTONS) as f32; 400];
        let found = planned(&camera, seeds(7), &light, 100, 20_000);
        let truth = oracle(&model, &light, 100, 20_000, 5);
        let scale =
            |e: Estimate| Estimate { mean: e.mean * quanta.powi(2), error: e.error * quanta.powi(2), ..e };
        let rate = |e: Estimate| Estimate { mean: e.mean / quanta, error: e.error / quanta, ..e };
        eprintln!(
            "{quanta}: D(8) {} oracle {}, rate {} oracle {}",
            found.d(8),
            truth.d(8),
            found.rate(),
            truth.rate()
        );
        assert!(found.d(8).sigmas(truth.d(8), 1e-6).abs() < 4.5);
        assert!(found.rate().sigmas(truth.rate(), 1e-7).abs() < 4.5);
        (scale(found.d(8)), rate(found.rate()))
    };
    let (below, above) = (run(63.9), run(64.1));
    // D(8) f^2 = f^2/6 + 8/400: the first term changes by 0.6 % of itself, 0.13 % of the sum.
    assert!(below.0.sigmas(above.0, 2e-3 * below.0.mean).abs() < 4.5, "{} {}", below.0, above.0);
    assert!(below.1.sigmas(above.1, 1e-9).abs() < 4.5, "{} {}", below.1, above.1);
}
