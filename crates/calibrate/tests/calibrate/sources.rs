//! Tests recording sets whose light comes from sources that add up.

use spikelane::{Camera, Geometry, Seeds, effects, presets};
use spikelane_calibrate::{CalibrateOptions, Calibration, Protocol, RecordingSet, calibrate, measure_levels};

fn parse(recordings: &str) -> spikelane::error::Result<RecordingSet> {
    let set = format!("width = 8\nheight = 8\nreadout_hz = 20000.0\nlight_uncertainty = 0.01\n{recordings}");
    RecordingSet::parse(&set, "recordings".into())
}

fn recording(file: &str, light: f64, sources: &[&str]) -> String {
    format!("[[recording]]\nfile = \"{file}\"\nlight = {light:?}\nsources = {sources:?}\n")
}

#[test]
fn sources_without_a_sum_and_sums_within_the_uncertainty_are_accepted() {
    let dark = recording("dark", 0.0, &[]);
    let [a, b] = [recording("a", 0.2, &["a"]), recording("b", 0.1, &["b"])];
    parse(&[dark.as_str(), &a].concat()).unwrap();
    // The sum deviates by 2 %, and its standard deviation is 1.2 %.
    parse(&[dark.as_str(), &a, &b, &recording("ab", 0.306, &["a", "b"])].concat()).unwrap();
}

#[test]
fn impossible_sources_are_rejected_with_the_cause() {
    let dark = recording("dark", 0.0, &[]);
    let [a, b] = [recording("a", 0.2, &["a"]), recording("b", 0.1, &["b"])];
    let wave = "[[recording]]\nfile = \"s\"\nlight = { kind = \"square\", high = 0.8, low = 0.1, half_period = 9 }\nsources = [\"a\"]\n";
    let cases = [
        (recording("dark", 0.0, &["a"]) + &a, "a in the dark"),
        (format!("{dark}{a}{wave}"), "light that is not uniform"),
        (dark.clone() + &recording("a", 0.2, &["a", "a"]), "a twice"),
        (format!("{dark}{a}{}", recording("c", 0.25, &["a"])), "a alone, as in a"),
        (a.clone(), "no dark recording"),
        (format!("{dark}{a}{}", recording("ab", 0.3, &["a", "b"])), "b, which no recording has alone"),
        (format!("{dark}{a}{b}{}", recording("ab", 0.33, &["a", "b"])), "light 0.33, and light 0.3"),
        (format!("source_repeatability = 0.0\n{dark}"), "source_repeatability"),
    ];
    for (set, cause) in cases {
        let error = parse(&set).unwrap_err().to_string();
        assert!(error.contains(cause), "{cause}: {error}");
    }
}

/// Records the additive protocol with sources that are off by 3 %.
fn recorded(camera: &Camera, seed: u64) -> Calibration {
    let start = effects::find("start_phase").unwrap().neutral().with_value("share", 1.0).unwrap();
    let mut camera = camera.clone().with_effect(start);
    camera.sensor.geometry = Geometry::new(40, 40).unwrap();
    let protocol = Protocol { lamp_error: 0.03, ..Protocol::additive(3000) };
    let folder = tempfile::tempdir().unwrap();
    let seeds = Seeds { camera: seed, shot: seed, sequence: 0 };
    let path = protocol.record(&camera, seeds, folder.path(), false, &mut |_, _| {}).unwrap().path;
    let set = RecordingSet::open(&path).unwrap();
    assert_eq!((set.recordings.len(), set.light_uncertainty), (13, Some(0.03)));
    let observed = measure_levels(&set, &mut |_, _| {}).unwrap();
    calibrate(&observed, &CalibrateOptions::default()).unwrap()
}

/// The common scale has an error of 3 % over the square root of eight sources, which its stated error contains. Threshold noise
/// has an error of 2 %, and it does not depend on the light.
#[test]
fn sums_of_sources_off_by_3_percent_add_up_on_a_linear_camera() {
    let camera = presets::builtin("scsim-code").unwrap();
    for seed in [3, 4] {
        let found = recorded(&camera, seed);
        let additivity = found.additivity.as_ref().unwrap();
        let [first, .., last] = additivity.sums.as_slice() else { panic!("{additivity:?}") };
        assert_eq!((first.sources.join("+"), last.sources.join("+")), ("a1+b1".into(), "a4+b4".into()));
        for sum in &additivity.sums {
            let z = sum.residual.value / sum.residual.error;
            assert!(z.abs() < 4.0 && sum.residual.error < 3e-4, "{sum:?}");
        }
        let z = additivity.curvature.value / additivity.curvature.error;
        assert!(z.abs() < 4.0 && !found.is_nonlinear, "{additivity:?}");
        let gain = found.population.mean_a;
        let truth = camera.effect("prnu").unwrap().get("mean").unwrap();
        // The mean gain of 1,600 pixels with a spread of 7 % has an error of 0.2 %.
        assert!(
            (gain.value / truth - 1.0).abs() < 4.0 * (gain.error / gain.value + 0.002),
            "{gain:?} {truth}"
        );
        let noise = camera.effect("thermal_noise").unwrap().get("sigma").unwrap() / camera.sensor.swing_v;
        assert!(
            (found.sigma_t.value - noise).abs() < 4.0 * found.sigma_t.error,
            "{:?} {noise}",
            found.sigma_t
        );
    }
}

#[test]
fn a_bend_of_3_thousandths_is_measured_with_sources_off_by_3_percent() {
    let bend =
        effects::find("response_nonlinearity").unwrap().neutral().with_value("quadratic", -0.003).unwrap();
    let found = recorded(&presets::builtin("scsim-code").unwrap().with_effect(bend), 5);
    let curvature = found.additivity.unwrap().curvature;
    assert!((curvature.value + 0.003).abs() < 4.0 * curvature.error, "{curvature:?}");
    assert!(curvature.error < 5e-4 && found.is_nonlinear, "{curvature:?}");
    assert!(found.notes.iter().any(|n| n.contains("not the sum of the responses")), "{:?}", found.notes);
}
