//! Tests that every command writes only finite numbers, even for unusual inputs.

use std::collections::BTreeSet;

use crate::finite::inputs::{
    ODD_LIGHT, ODD_RECORDINGS, ODD_STREAMS, OddLight, OddStream, place_with_odd_recording,
};
use crate::program_support::{TestFolder, npy_f32};

/// Runs each command twice, with text output and with JSON output. Returns the non-finite numbers in all outputs.
fn non_finite_values(place: &TestFolder, commands: &[String]) -> Vec<String> {
    let mut wrong = Vec::new();
    for command in commands {
        let mut lines = vec![format!("{command} --json")];
        if !SLOW_COMMANDS.contains(&command.as_str()) {
            lines.insert(0, command.clone());
        }
        for line in lines {
            let ran = place.run(&line);
            assert!((0..=9).contains(&ran.code), "{line}: exit {}", ran.code);
            // These commands print scripts and pages as text, even with `--json`.
            let json = line.ends_with("--json") && !TEXT_ONLY_COMMANDS.iter().any(|c| line.starts_with(c));
            let faults =
                if json { crate::finite::json_text(&ran.stdout) } else { crate::finite::text(&ran.stdout) };
            wrong.extend(
                faults.into_iter().chain(crate::finite::text(&ran.stderr)).map(|f| format!("{line}: {f}")),
            );
        }
    }
    wrong.extend(crate::finite::folder(&place.path("")));
    wrong
}

const TEXT_ONLY_COMMANDS: [&str; 2] = ["completions", "man"];

/// Commands that run only with JSON output, because they take long. They print the same numbers as text. The empty line runs
/// the program without arguments.
const SLOW_COMMANDS: [&str; 2] = ["speed --quick --seconds 0.1", ""];

fn assert_all_finite(wrong: &[String]) {
    assert!(wrong.is_empty(), "{} places, the first: {:#?}", wrong.len(), &wrong[..wrong.len().min(40)]);
}

/// Returns the commands that read a stream but do not measure all of it.
fn reader_commands(odd: &OddStream) -> Vec<String> {
    let size = size_of(odd);
    vec![
        format!("inspect odd.dat {size} --png look.png --force"),
        format!("convert odd.dat out.npy {size} --force"),
        format!("reconstruct odd.dat -o tfp.npy {size} --force"),
        format!("reconstruct odd.dat -o tfi.npy {size} --method tfi --force"),
        format!("reconstruct odd.dat -o isi.npy {size} --method isi --force"),
        format!("reconstruct odd.dat -o span.npy {size} --method span --force"),
        format!("view odd.dat {size} --export view.html --force"),
        format!("evaluate odd.dat {size}"),
        format!("evaluate odd.dat {size} --reference reference.png --full-scale-rate 0.6"),
        format!("compare odd.dat {size} --max-readouts 50 -o compared --force"),
    ]
}

fn measure_commands(odd: &OddStream) -> Vec<String> {
    vec![format!("measure odd.dat {} --report measure.html --force", size_of(odd))]
}

fn size_of(odd: &OddStream) -> String {
    format!("--width {} --height {} --layout dat-top", odd.width, odd.height)
}

fn set_commands() -> Vec<String> {
    let all = [
        "calibrate set.toml -o calibrated --snee --force",
        "compare set.toml ideal physical --max-readouts 50 -o compared --force",
        "diagnose set.toml -o diagnosed --camera physical --force",
    ];
    all.map(str::to_owned).to_vec()
}

fn recorded_set_commands() -> Vec<String> {
    let all = [
        "calibrate recorded/recordings.toml -o calibrated --snee --force",
        "compare recorded/recordings.toml ideal physical --max-readouts 200 -o compared --force",
        "diagnose recorded/recordings.toml -o diagnosed --camera physical --force",
    ];
    all.map(str::to_owned).to_vec()
}

fn light_commands(size: &str) -> Vec<String> {
    vec![
        format!(
            "simulate in/light.npy -o run --readouts-per-frame 7 {size} --clean --interpolation linear --force"
        ),
        format!("simulate in/light.npy -o flow --readouts-per-frame 3 {size} --interpolation flow --force"),
        format!(
            "simulate in/light.npy -o one --readouts-per-frame 7 --readouts 1 {size} --camera scsim-code --force"
        ),
        format!("simulate in/light.npy -o planned --readouts-per-frame 7 {size} --dry-run"),
        "verify run.json".to_owned(),
        "evaluate run.dat".to_owned(),
        "inspect run.dat --digest".to_owned(),
        "convert run.dat converted.npy --readouts 1..5 --force".to_owned(),
        // The command reads the light before it starts Python.
        "check spikezoo in/light.npy --code . --python ./no-python".to_owned(),
    ]
}

/// Runs a baseline on a stream with hardly any light.
fn benchmark_commands() -> Vec<String> {
    let all = [
        "benchmark list tiny.toml",
        "benchmark generate tiny.toml -o suite --resume",
        "benchmark verify suite",
        "benchmark run suite --baseline tfi -o tfi --resume",
        "benchmark run suite --baseline tfp -o tfp --resume",
        "benchmark score suite tfp --force",
        "benchmark report tfi/score.json tfp/score.json --suite suite -o report --force",
        "benchmark verify tfi/score.json --suite suite",
    ];
    all.map(str::to_owned).to_vec()
}

fn dataset_commands(size: &str) -> Vec<String> {
    vec![
        format!("dataset --from in -o set {size} --readouts-per-frame 3 --test-share 0"),
        format!("dataset --from in -o set {size} --readouts-per-frame 3 --test-share 0 --resume"),
        "evaluate set".to_owned(),
    ]
}

fn inputless_commands() -> Vec<String> {
    let all = [
        "record physical -o recorded --width 8 --height 6 --readouts 300 --force",
        "record scsim-code -o gray --protocol gray --width 8 --height 6 --readouts 20 --force",
        "record physical -o planned --dry-run",
        "record ideal -o planned --dry-run",
        "scene -o street --width 32 --height 20 --frames 2 --lighting night --force",
        "dataset -o drives --sequences 1 --images-per-scene 3 --width 32 --height 20 --label-every 1 --npy --exr --kitti --test-share 0",
        "dataset -o drives --dry-run --resume --sequences 1 --images-per-scene 3 --width 32 --height 20",
        "dataset plan -o cut --sequences 2 --images-per-scene 3 --width 32 --height 20 --label-every 1 --sequences-per-shard 1",
        "dataset run cut --shards all",
        "dataset status cut",
        "dataset merge cut",
        "dataset stats cut --report cut.html --force",
        "simulate --builtin-light objects -o objects --width 32 --height 20 --readouts 10 --force",
        "simulate --builtin-light chart -o chart --width 32 --height 20 --readouts 10 --force",
        "live --builtin-light chart --readouts 60 --width 32 --height 20 --sink shm:./ring",
        "evaluate drives",
        "partials",
        "preset list",
        "preset show physical",
        "preset show scsim-code",
        "effects",
        "effects leak",
        "calibrate recorded/recordings.toml -o calibrated --force",
        "completions bash",
        "man",
    ];
    all.into_iter().chain(SLOW_COMMANDS).map(str::to_owned).collect()
}

#[test]
fn every_command_is_run_here() {
    let lines = [
        reader_commands(&ODD_STREAMS[0]),
        measure_commands(&ODD_STREAMS[0]),
        set_commands(),
        recorded_set_commands(),
        light_commands(""),
        dataset_commands(""),
        benchmark_commands(),
        inputless_commands(),
    ];
    let first = |line: &String| line.split(' ').next().unwrap_or_default().to_owned();
    let mut run: BTreeSet<String> = lines.concat().iter().map(first).filter(|c| !c.is_empty()).collect();
    run.insert("help".to_owned());
    let help = TestFolder::new().run_ok("--help").stdout;
    let (_, rest) = help.split_once("Commands:\n").expect("the list of commands");
    let listed = rest.lines().take_while(|l| !l.is_empty());
    let name = |l: &str| l.strip_prefix("  ").filter(|l| !l.starts_with(' ')).map(first_word);
    let known: BTreeSet<String> = listed.filter_map(name).collect();
    assert_eq!(run, known);
}

fn first_word(line: &str) -> String {
    line.split(' ').next().unwrap_or_default().to_owned()
}

fn check_odd_streams(commands: fn(&OddStream) -> Vec<String>) {
    let mut faults = Vec::new();
    for odd in &ODD_STREAMS {
        let place = odd.place();
        faults.extend(
            non_finite_values(&place, &commands(odd)).into_iter().map(|w| format!("{}: {w}", odd.name)),
        );
    }
    assert_all_finite(&faults);
}

#[test]
fn of_odd_streams_every_reader_says_finite_numbers() {
    check_odd_streams(reader_commands);
}

#[test]
fn of_odd_streams_measure_says_finite_numbers() {
    check_odd_streams(measure_commands);
}

#[test]
fn of_sets_of_odd_streams_calibration_comparison_and_diagnosis_say_finite_numbers() {
    check_odd_streams(|_| set_commands());
}

#[test]
fn of_recorded_sets_with_an_odd_recording_every_number_is_finite() {
    let mut faults = Vec::new();
    for odd in ODD_RECORDINGS {
        let place = place_with_odd_recording(odd);
        let commands = recorded_set_commands();
        let calibrated = place.run(&commands[0]);
        assert_eq!(calibrated.code == 0, odd.2, "{}: {}", odd.0, calibrated.stderr);
        faults.extend(non_finite_values(&place, &commands).into_iter().map(|w| format!("{}: {w}", odd.0)));
    }
    assert_all_finite(&faults);
}

/// Creates a folder with unusual light. Returns the folder and the size flags for its frames.
fn place_with_odd_light((_, shape, value): OddLight) -> (TestFolder, String) {
    let [frames, height, width] = shape;
    let values: Vec<f32> = (0..frames * height * width).map(value).collect();
    let place = TestFolder::new();
    std::fs::create_dir(place.path("in")).unwrap();
    place.write("in/light.npy", npy_f32(shape, &values));
    (place, format!("--width {width} --height {height}"))
}

#[test]
fn of_odd_light_every_maker_leaves_finite_numbers() {
    let mut faults = Vec::new();
    for light in ODD_LIGHT {
        for commands in [light_commands, dataset_commands] {
            let (place, size) = place_with_odd_light(light);
            faults.extend(
                non_finite_values(&place, &commands(&size)).into_iter().map(|w| format!("{}: {w}", light.0)),
            );
        }
    }
    assert_all_finite(&faults);
}

#[test]
fn what_is_drawn_recorded_and_printed_holds_finite_numbers() {
    let place = TestFolder::new();
    assert_all_finite(&non_finite_values(&place, &inputless_commands()));
}

#[test]
fn benchmarks_hold_finite_numbers() {
    let place = TestFolder::new();
    place.write("tiny.toml", crate::benchmark::short_suite(2).replace("[0.1, 1.0]", "[1e-6, 1.0]"));
    assert_all_finite(&non_finite_values(&place, &benchmark_commands()));
}

#[test]
fn non_finite_values_are_detected() {
    assert_eq!(crate::finite::text("rate NaN +- 1\nrate 1 +- -inf\ninformation").len(), 2);
    assert_eq!(crate::finite::json_text("{\"a\": [1, null], \"b\": \"inf\"}").len(), 2);
    assert_eq!(crate::finite::npy(&npy_f32([1, 1, 2], &[1.0, f32::NAN])).len(), 1);
    let flow: Vec<u8> =
        [202_021.25_f32, 0.0, 0.0, 1.0, f32::INFINITY].iter().flat_map(|v| v.to_le_bytes()).collect();
    assert_eq!(crate::finite::flo(&flow).len(), 1);
}
