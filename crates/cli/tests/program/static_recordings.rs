//! Diagnoses single recordings of static scenes.

use crate::program_support::TestFolder;

const SIMULATE: &str = "simulate gray.png --transfer linear --camera physical --width 64 --height 64";

/// Returns a folder with `gray.png`, in which every pixel fires at every fifth readout.
fn folder() -> TestFolder {
    let folder = TestFolder::new();
    folder.picture("gray.png", 64, 64, 51);
    folder
}

#[test]
fn one_recording_of_the_model_agrees_and_its_limits_are_stated() {
    let folder = folder();
    folder.run_ok(&format!("{SIMULATE} --readouts 300 -o one"));
    let text = folder.run_ok("diagnose one.dat --camera physical -o out").stdout;
    assert!(text.starts_with("agrees"), "{text}");
    for words in
        ["an oscillation below 133 Hz", "no recordings were held out", "not detectable with this set:"]
    {
        assert!(text.contains(words), "no '{words}' in: {text}");
    }
    let diagnosis = folder.json("out/diagnosis.json");
    assert_eq!(diagnosis["provenance"]["recordings"][0]["light"], "a static scene of unknown light");
    assert_eq!(diagnosis["effects"].as_array().map(Vec::len), Some(0));
}

#[test]
fn light_that_flickers_is_a_fault_and_names_no_effect() {
    let folder = folder();
    let flicker = "--effect flicker.depth=0.03 --effect flicker.frequency_hz=1600Hz";
    folder.run_ok(&format!("{SIMULATE} --readouts 300 {flicker} -o one"));
    let text = folder.run_ok("diagnose one.dat --camera physical -o out").stdout;
    assert!(text.contains("fault: one.dat: the light oscillates at 1600.0 Hz by 2.9"), "{text}");
    let diagnosis = folder.json("out/diagnosis.json");
    assert_eq!(diagnosis["verdict"], "unknown");
    assert_eq!(diagnosis["effects"].as_array().map(Vec::len), Some(0));
}

#[test]
fn a_recording_without_a_size_has_the_size_of_the_camera() {
    let folder = TestFolder::new();
    // The length is not a multiple of 12,500 bytes, the frame of 400x250.
    folder.write("cut.dat", vec![0; 12_500 * 300 + 8]);
    let line = "diagnose cut.dat --camera physical";
    folder.run_refused(line, 4, &["3750008 bytes", "12500", "400x250", "'physical'", "--width"]);
    folder.write("whole.dat", vec![0; 12_500 * 300]);
    let line = "diagnose whole.dat --camera physical";
    folder.run_refused(line, 4, &["400x250 from the camera 'physical'", "0 static pixels", "0.0000"]);
}

#[test]
fn a_recording_that_cannot_be_diagnosed_is_refused_with_the_remedy() {
    let folder = folder();
    folder.run_ok(&format!("{SIMULATE} --readouts 120 -o short"));
    folder.write("empty.dat", []);
    folder.write("set.toml", "");
    let refused = |line: &str, code: i32, words: &[&str]| folder.run_refused(line, code, words);
    refused("diagnose short.dat --camera physical", 4, &["120 readouts", "at least 256"]);
    refused("diagnose empty.dat --camera physical", 4, &["an empty file"]);
    refused("diagnose missing.dat --camera physical", 5, &["missing.dat"]);
    refused("diagnose . --camera physical", 2, &["a folder", "spikelane record --template ."]);
    refused("diagnose empty.dat --camera physical --width 8", 2, &["only one of --width and --height"]);
    refused("diagnose set.toml --width 8 --height 8", 2, &["a recording set with --width", "omit --width"]);
}

#[test]
fn one_recording_without_a_camera_is_refused_with_the_flag() {
    let folder = folder();
    folder.run_ok(&format!("{SIMULATE} --readouts 300 -o one"));
    let words = ["a static scene of unknown light and no camera", "--camera", "flat fields of known light"];
    folder.run_refused("diagnose one.dat", 4, &words);
}
