//! Tests of an effect of another crate: in camera files, in the simulator and in a diagnosis.

use outside_effect::WEAK_SUPPLY;
use spikelane::effects::{self, Catalog, Definition};
use spikelane::{Camera, ErrorKind, Geometry, Seeds, Sensor, Simulator, presets};
use spikelane_calibrate::{Protocol, RecordingSet};
use spikelane_diagnose::{DiagnoseOptions, ReadoutSelection, diagnose};

fn catalog() -> Catalog {
    Catalog::new().with_definition(&WEAK_SUPPLY).unwrap()
}

/// Returns the camera of SCSim's published code with a small sensor.
fn plain_camera() -> Camera {
    let mut camera = presets::builtin("scsim-code").unwrap().without_effect("capacitor_mismatch");
    camera.sensor.geometry = Geometry::new(24, 24).unwrap();
    camera
        .with_effect(effects::find("shot_noise").unwrap().neutral().with_value("strength", 1.0).unwrap())
        .with_effect(effects::find("start_phase").unwrap().typical())
}

fn weak_supply_camera(sag: f64) -> Camera {
    plain_camera().with_effect(WEAK_SUPPLY.neutral().with_value("sag", sag).unwrap())
}

fn bits(camera: &Camera) -> Vec<u8> {
    let mut simulator = Simulator::new(camera, Seeds::default()).unwrap();
    let geometry = camera.sensor.geometry;
    let mut bits = vec![0u8; 400 * geometry.frame_bytes()];
    let light = vec![51u8; geometry.pixels()];
    simulator.fill(&light, &mut bits).unwrap();
    bits
}

#[test]
fn a_camera_file_with_the_effect_loads_where_it_is_passed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("camera.toml");
    std::fs::write(&path, presets::to_toml(&weak_supply_camera(0.02)).unwrap().text).unwrap();
    let path = path.to_str().unwrap();
    let refused = presets::load(path).unwrap_err();
    assert!(refused.kind() == ErrorKind::Config && refused.to_string().contains("weak_supply"), "{refused}");
    let loaded = catalog().load(path).unwrap();
    assert_eq!(loaded.effect("weak_supply"), weak_supply_camera(0.02).effect("weak_supply"));
    assert_eq!(bits(&loaded), bits(&weak_supply_camera(0.02)));
    let bytes = presets::to_bytes(&loaded).unwrap();
    assert_eq!(catalog().camera_from_bytes(&bytes).unwrap(), loaded);
}

#[test]
fn a_distribution_draws_numbers_of_the_effect() {
    let text = "[effects.weak_supply]\nsag = { uniform = [0.01, 0.05] }";
    assert!(presets::CameraDistribution::parse(text).is_err());
    let drawn = catalog().camera_distribution(text).unwrap().draw(3).unwrap();
    assert!((0.01..0.05).contains(&drawn.effect("weak_supply").unwrap().get("sag").unwrap()));
}

#[test]
fn a_neutral_effect_is_none_and_another_one_moves_bits() {
    assert_eq!(bits(&weak_supply_camera(0.0)), bits(&plain_camera()));
    assert_ne!(bits(&weak_supply_camera(0.02)), bits(&plain_camera()));
}

#[test]
fn a_name_that_the_library_has_is_refused() {
    static LEAK: Definition = Definition::new("leak", "Another leak.", "this test", &[]);
    let refused = Catalog::new().with_definition(&LEAK).unwrap_err();
    assert!(refused.kind() == ErrorKind::Config && refused.to_string().contains("leak"), "{refused}");
    let camera = Camera::ideal(Sensor::new(8, 8, 20_000.0).unwrap()).with_effect(LEAK.neutral());
    assert_eq!(Simulator::new(&camera, Seeds::default()).unwrap_err().kind(), ErrorKind::Config);
}

#[test]
#[allow(clippy::field_reassign_with_default, reason = "holds when the struct is closed to literals, too")]
fn a_diagnosis_that_knows_the_effect_finds_it_by_its_name() {
    let folder = tempfile::tempdir().unwrap();
    // The effect is strong, so fewer and shorter recordings than recommended are sufficient.
    let mut protocol = Protocol::recommended(1000);
    protocol.recordings.retain(|(stem, _)| {
        ["dark", "flat_0300", "flat_1000", "flat_3000", "flat_6000", "checker"].contains(&stem.as_str())
    });
    let sets = [0, 1].map(|sequence| {
        let seeds = Seeds { camera: 5, shot: 6, sequence: 1000 * sequence };
        let take = folder.path().join(format!("{sequence}"));
        protocol
            .record(&weak_supply_camera(0.03), seeds, &take, false, &mut |_, _| {})
            .map(|set| RecordingSet::open(&set.path).unwrap())
            .unwrap()
    });
    let (camera, effects) = (plain_camera(), catalog());
    let mut options = DiagnoseOptions::default();
    options.camera = Some(&camera);
    options.effects = Some(&effects);
    options.readout_selection = ReadoutSelection::All;
    options.seed = 7;
    let diagnosis = diagnose(&sets[0], Some(&sets[1]), options, &mut |_, _| {}).unwrap();
    let named: Vec<&str> = diagnosis.effects.iter().filter(|e| !e.is_tentative).map(|e| e.name).collect();
    assert_eq!(
        named,
        ["weak_supply"],
        "{:?} {:?} {:?}",
        diagnosis.verdict,
        diagnosis.effects,
        diagnosis.unexplained
    );
    let sag = &diagnosis.effects[0].parameters[0];
    // The fitted parameter has an error of a few percent.
    assert!(sag.name == "sag" && (sag.value / 0.03 - 1.0).abs() < 0.25, "{sag:?}");
    assert!(diagnosis.camera.effect("weak_supply").is_some());
}
