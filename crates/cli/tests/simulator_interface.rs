//! Tests interfaces that the language bindings use, by comparison with slow equivalents.

use spikelane::Light;
use spikelane::SimulatorOptions;
use spikelane::effects;
use spikelane::presets;
use spikelane::spikes::{self, Crop};
use spikelane::{Camera, Error, ErrorKind, Geometry, Plan, Seeds, Simulator};
use spikelane_io::light::{FlowInterpolator, Frame, Interpolation, OwnedSamples, Rate, Timeline};
use spikelane_io::simulate::{FrameRef, Pool};

const SEEDS: Seeds = Seeds { camera: 5, shot: 6, sequence: 7 };

fn sized_preset(name: &str, width: u32, height: u32) -> Camera {
    let mut camera = presets::builtin(name).unwrap();
    camera.sensor.geometry = Geometry::new(width, height).unwrap();
    camera
}

/// Returns a camera whose effects have every kind of start state and every kind of slow state.
fn camera_with_state(width: u32, height: u32) -> Camera {
    ["image_lag", "slow_threshold_noise", "adaptation", "telegraph_dark", "row_noise", "repeated_readouts"]
        .iter()
        .fold(sized_preset("physical", width, height), |camera, name| {
            camera.with_effect(effects::find(name).unwrap().typical())
        })
}

fn cameras() -> Vec<Camera> {
    let names = presets::ALL.iter().map(|p| p.name);
    names.map(|name| sized_preset(name, 37, 9)).chain([camera_with_state(37, 9)]).collect()
}

fn ramp(geometry: Geometry, k: usize) -> Vec<u8> {
    (0..geometry.pixels()).map(|p| (p * 7 + k * 53) as u8).collect()
}

fn run(simulator: &mut Simulator, readouts: usize) -> Vec<u8> {
    let geometry = simulator.plan().geometry();
    let mut out = vec![0; readouts * geometry.frame_bytes()];
    simulator.fill(FrameRef::new(&ramp(geometry, 1)), &mut out).unwrap();
    out
}

#[test]
fn reseeded_plan_equals_a_new_plan() {
    for camera in cameras() {
        let first = Plan::new(&camera, Seeds { shot: 1, sequence: 2, ..SEEDS }).unwrap();
        assert_eq!(first.with_seeds(SEEDS).unwrap(), Plan::new(&camera, SEEDS).unwrap(), "{}", camera.name);
    }
}

#[test]
fn another_cameras_seed_is_refused_and_changes_nothing() {
    let mut simulator = Simulator::new(&sized_preset("physical", 20, 4), SEEDS).unwrap();
    let error = simulator.restart(Seeds { camera: 9, ..SEEDS }).unwrap_err();
    assert_eq!((error.kind(), &*error.parts().found), (ErrorKind::Usage, "9"));
    assert_eq!(simulator.plan().seeds(), SEEDS);
}

#[test]
fn a_restarted_simulator_gives_the_bits_of_a_new_one() {
    for camera in cameras() {
        let mut used = Simulator::new(&camera, Seeds { sequence: 1, ..SEEDS }).unwrap();
        run(&mut used, 33);
        used.restart(SEEDS).unwrap();
        assert_eq!(used.state().readout(), 0);
        let mut new = Simulator::new(&camera, SEEDS).unwrap();
        assert_eq!(run(&mut used, 150), run(&mut new, 150), "{}", camera.name);
    }
}

/// Returns a camera whose pixels differ. It has no temporal noise.
fn patterned_camera(width: u32, height: u32) -> Camera {
    let names = ["prnu", "smooth_prnu", "column_pattern", "row_pattern", "vignetting", "dead_pixels"];
    let bare = sized_preset("ideal", width, height).without_effect("start_phase");
    names.iter().fold(bare, |camera, name| camera.with_effect(effects::find(name).unwrap().typical()))
}

#[test]
fn a_window_has_the_bits_of_its_part_of_the_sensor() {
    let full = patterned_camera(61, 40);
    let crop = Crop { row: 5, col: 17, width: 23, height: 31 };
    let mut big = Simulator::new(&full, SEEDS).unwrap();
    let mut small = Simulator::new(&full.window(crop).unwrap(), SEEDS).unwrap();
    let geometry = full.sensor.geometry;
    let light = ramp(geometry, 3);
    let mut all = vec![0; 200 * geometry.frame_bytes()];
    big.fill(&light, &mut all).unwrap();
    let part = small.plan().geometry();
    let mut out = vec![0; 200 * part.frame_bytes()];
    small.fill(FrameRef::new(&crop.pick(geometry, &light)), &mut out).unwrap();
    let (mut all_bits, mut bits) = (vec![0; 200 * geometry.pixels()], vec![0; 200 * part.pixels()]);
    spikes::unpack(geometry, &all, &mut all_bits).unwrap();
    spikes::unpack(part, &out, &mut bits).unwrap();
    let expected: Vec<u8> = all_bits.chunks(geometry.pixels()).flat_map(|f| crop.pick(geometry, f)).collect();
    let differ = bits.iter().zip(&expected).filter(|(a, b)| a != b).count();
    assert_eq!(differ, 0, "of {}", bits.len());
    assert!(bits.contains(&0) && bits.contains(&1));
}

#[test]
fn a_window_has_another_pattern_than_a_sensor_of_its_size() {
    let crop = Crop { row: 5, col: 17, width: 20, height: 20 };
    let window = patterned_camera(61, 40).window(crop).unwrap().model(SEEDS).unwrap();
    assert_ne!(window.circuit.gain, patterned_camera(20, 20).model(SEEDS).unwrap().circuit.gain);
}

#[test]
fn a_window_of_a_plan_is_the_plan_of_the_window() {
    let crop = Crop { row: 2, col: 3, width: 9, height: 6 };
    for camera in cameras() {
        let cut = Plan::new(&camera, SEEDS).unwrap().window(crop).unwrap();
        assert_eq!(cut, Plan::new(&camera.window(crop).unwrap(), SEEDS).unwrap(), "{}", camera.name);
        // Each pixel must have the same noise law in the window of the camera as in the whole camera.
        let (full, part) = (camera.model(SEEDS).unwrap(), camera.window(crop).unwrap().model(SEEDS).unwrap());
        let laws: Vec<_> = (0..37 * 9).map(|p| full.law(p)).collect();
        let expected = crop.pick(camera.sensor.geometry, &laws);
        assert_eq!((0..54).map(|p| part.law(p)).collect::<Vec<_>>(), expected, "{}", camera.name);
    }
}

#[test]
fn a_window_of_a_window_is_one_of_the_whole() {
    let full = patterned_camera(61, 40);
    let outer = full.window(Crop { row: 20, col: 10, width: 30, height: 15 }).unwrap();
    let inner = outer.window(Crop { row: 6, col: 5, width: 8, height: 9 }).unwrap();
    assert_eq!(inner, full.window(Crop { row: 26, col: 15, width: 8, height: 9 }).unwrap());
    assert!(outer.window(Crop { row: 0, col: 25, width: 8, height: 9 }).is_err());
    let mut resized = inner;
    resized.sensor.geometry = Geometry::new(9, 9).unwrap();
    assert_eq!(resized.model(SEEDS).unwrap_err().kind(), ErrorKind::Config);
    assert!(presets::to_toml(&resized).is_err());
}

#[test]
fn a_camera_file_keeps_the_window() {
    let camera = patterned_camera(61, 40).window(Crop { row: 20, col: 10, width: 30, height: 15 }).unwrap();
    let text = presets::to_toml(&camera).unwrap().text;
    assert_eq!(presets::from_toml(&text, None).unwrap(), camera);
    assert!(presets::from_toml("[window]\nrow = 300\ncol = 0\nheight = 1\nwidth = 1", None).is_err());
}

/// Simulates a stream slowly: one call of `fill` per readout, with the interpolation weights of the timeline.
fn fill_frame_by_frame(
    camera: &Camera,
    frames: &[FrameRef<'_>],
    timeline: &Timeline,
    readouts: usize,
) -> Vec<u8> {
    let mut simulator = Simulator::new(camera, SEEDS).unwrap();
    let bytes = camera.sensor.geometry.frame_bytes();
    let mut out = vec![0; readouts * bytes];
    for (t, packed) in out.chunks_mut(bytes).enumerate() {
        let moment = timeline.position_within(t as u64, frames.len() as u64).unwrap();
        let frame = moment.frame as usize;
        match frames.get(frame + 1) {
            Some(next) => {
                simulator.fill(Light::linear(frames[frame], *next, &[moment.weight()]), packed).unwrap();
            }
            None => simulator.fill(frames[frame], packed).unwrap(),
        }
    }
    out
}

fn fill_timeline(camera: &Camera, frames: &[FrameRef<'_>], timeline: &Timeline, readouts: usize) -> Vec<u8> {
    let mut simulator = Simulator::new(camera, SEEDS).unwrap();
    let mut out = vec![0; readouts * camera.sensor.geometry.frame_bytes()];
    simulator.fill(Light::sequence(frames, timeline), &mut out).unwrap();
    out
}

#[test]
fn many_frames_in_one_call_are_the_frames_pushed_one_by_one() {
    let rate = |n| Rate::new(n, 1).unwrap();
    for interpolation in [Interpolation::Hold, Interpolation::Linear] {
        let timelines = [
            Timeline::from_readouts_per_frame(1, interpolation).unwrap(),
            Timeline::from_readouts_per_frame(20, interpolation).unwrap(),
            Timeline::from_rates(rate(300), rate(1000), interpolation).unwrap(),
            Timeline::from_rates(rate(2500), rate(1000), interpolation).unwrap(),
        ];
        for camera in
            [sized_preset("physical", 37, 9), sized_preset("ideal", 64, 4), camera_with_state(37, 9)]
        {
            let geometry = camera.sensor.geometry;
            let data: Vec<Vec<u8>> = (0..30).map(|k| ramp(geometry, k)).collect();
            let frames: Vec<_> = data.iter().map(FrameRef::new).collect();
            for timeline in timelines.clone() {
                let readouts = timeline.readouts(30).unwrap() as usize;
                let slow = fill_frame_by_frame(&camera, &frames, &timeline, readouts);
                assert_eq!(fill_timeline(&camera, &frames, &timeline, readouts), slow, "{timeline:?}");
            }
        }
    }
}

#[test]
fn flow_interpolation_follows_the_motion() {
    let camera = sized_preset("physical", 40, 32);
    let geometry = camera.sensor.geometry;
    let square = |at: usize| -> Vec<u8> {
        let lit = |p: usize| (at..at + 9).contains(&(p % 40)) && (8..20).contains(&(p / 40));
        (0..geometry.pixels()).map(|p| if lit(p) { 220 } else { 40 + (p % 7) as u8 }).collect()
    };
    let data = [square(5), square(9), square(13)];
    let frames: Vec<_> = data.iter().map(FrameRef::new).collect();
    let timeline = Timeline::from_readouts_per_frame(8, Interpolation::Flow).unwrap();
    let actual = fill_timeline(&camera, &frames, &timeline, 24);

    let owned: Vec<_> =
        data.iter().map(|f| Frame::new(geometry, OwnedSamples::U8(f.clone())).unwrap()).collect();
    let mut simulator = Simulator::new(&camera, SEEDS).unwrap();
    let mut expected = vec![0; actual.len()];
    for (t, packed) in expected.chunks_mut(geometry.frame_bytes()).enumerate() {
        let (k, part) = (t / 8, t % 8);
        let light = match owned.get(k + 1) {
            Some(next) if part > 0 => FlowInterpolator::new(&owned[k], next)
                .unwrap()
                .interpolate((part as f64 / 8.0) as f32)
                .unwrap(),
            _ => owned[k].clone(),
        };
        let samples = light.samples().as_samples();
        simulator.fill(FrameRef::new(samples), packed).unwrap();
    }
    assert_eq!(actual, expected);
    assert_ne!(
        actual,
        fill_timeline(
            &camera,
            &frames,
            &Timeline::from_readouts_per_frame(8, Interpolation::Hold).unwrap(),
            24
        )
    );
}

#[test]
fn dropped_readouts_fill_the_buffer_or_report_the_count() {
    let drops = effects::find("dropped_readouts").unwrap().neutral().with_value("probability", 0.2).unwrap();
    let camera = sized_preset("physical", 37, 9).with_effect(drops);
    let geometry = camera.sensor.geometry;
    let data: Vec<Vec<u8>> = (0..30).map(|k| ramp(geometry, k)).collect();
    let frames: Vec<_> = data.iter().map(FrameRef::new).collect();
    let timeline = Timeline::from_readouts_per_frame(5, Interpolation::Linear).unwrap();
    let full = fill_timeline(&camera, &frames, &timeline, 150);

    let mut simulator = Simulator::new(&camera, SEEDS).unwrap();
    let mut out = vec![0; full.len()];
    let frames_written = simulator.advance(Light::sequence(&frames, &timeline), 150, &mut out).unwrap();
    assert!((90..150).contains(&frames_written), "{frames_written}");
    assert_eq!(simulator.state().readout(), 150);
    let bytes = geometry.frame_bytes();
    assert_eq!(out[..frames_written * bytes], full[..frames_written * bytes]);
    simulator.fill(frames[29], &mut out[frames_written * bytes..]).unwrap();
    assert_eq!(out, full);
}

#[test]
fn frames_that_cannot_be_light_or_last_too_short_change_nothing() {
    let camera = sized_preset("physical", 10, 4);
    let geometry = camera.sensor.geometry;
    let mut simulator = Simulator::new(&camera, SEEDS).unwrap();
    let before = simulator.state().clone();
    let (good, mut bad) = (vec![0.5; 40], vec![0.5; 40]);
    bad[13] = f32::NAN;
    let timeline = Timeline::from_readouts_per_frame(2, Interpolation::Hold).unwrap();
    let mut out = vec![0; 4 * geometry.frame_bytes()];
    let frames = [FrameRef::new(&good), FrameRef::new(&bad)];
    let error = simulator.fill(Light::sequence(&frames, &timeline), &mut out).unwrap_err();
    assert_eq!(error.parts().subject, "frame 1: light at row 1, col 3");
    let error = simulator.fill(Light::sequence(&frames[..1], &timeline), &mut out).unwrap_err();
    assert_eq!((&*error.parts().subject, &*error.parts().found), ("readouts", "4"));
    assert!(simulator.fill(Light::sequence(&[], &timeline), &mut out).is_err());
    assert_eq!(*simulator.state(), before);
}

#[test]
fn a_watch_that_refuses_stops_between_two_readouts() {
    let camera = sized_preset("physical", 37, 9);
    let geometry = camera.sensor.geometry;
    let data = ramp(geometry, 2);
    let frames = [FrameRef::new(&data)];
    let timeline = Timeline::first_frame();
    let mut out = vec![0; 1000 * geometry.frame_bytes()];
    let mut simulator = Simulator::new(&camera, SEEDS).unwrap();
    let mut stop = |done: usize| match done {
        0..300 => Ok(()),
        _ => Err(Error::new(ErrorKind::Interrupted, "run")),
    };
    let error =
        simulator.fill_observed(Light::sequence(&frames, &timeline), &mut out, &mut stop).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Interrupted);
    let done = simulator.state().readout() as usize * geometry.frame_bytes();
    assert!(done > 0 && done < out.len());
    simulator.fill(Light::sequence(&frames, &timeline), &mut out[done..]).unwrap();
    assert_eq!(out, fill_timeline(&camera, &frames, &timeline, 1000));
}

#[test]
fn simulators_that_share_threads_give_the_bits_of_those_that_do_not() {
    let pool = Pool::new(3).unwrap();
    assert_eq!(pool.threads(), 3);
    let camera = sized_preset("physical", 150, 100);
    let mut shared: Vec<_> =
        (0..3).map(|_| SimulatorOptions::new().seeds(SEEDS).pool(&pool).build(&camera).unwrap()).collect();
    let single = run(&mut Simulator::new(&camera, SEEDS).unwrap(), 140);
    std::thread::scope(|scope| {
        let runs: Vec<_> = shared.iter_mut().map(|s| scope.spawn(|| run(s, 140))).collect();
        runs.into_iter().for_each(|r| assert_eq!(r.join().unwrap(), single));
    });
}

#[test]
fn error_parts_are_accessible() {
    let error = Error::new(ErrorKind::Input, "light").found(3).expected("4").remedy("try");
    let parts = error.parts();
    assert_eq!((parts.kind.name(), &*parts.subject), ("input", "light"));
    assert_eq!((&*parts.found, &*parts.expected, &*parts.remedy), ("3", "4", "try"));
    assert!(error.io_error().is_none());
}

#[test]
fn the_command_runs_inside_another_program() {
    assert_eq!(spikelane_cli::main(["spikelane", "effects", "prnu"]), 0);
    assert_eq!(spikelane_cli::main(["spikelane", "--version"]), 0);
    assert_eq!(spikelane_cli::main(["spikelane", "efects"]), 2);
    assert_eq!(spikelane_cli::main(["spikelane", "inspect", "no such file"]), 5);
}
