//! Tests messages about input and output files: wrong layouts, damaged files, extensions, times and sizes.

use crate::program_support::{TestFolder, exists, npy_f32};
use image::{GrayImage, Luma};
use spikelane::unstable::npy::{Element, to_bytes};

/// Writes an image of 64x48 pixels with smooth hills.
fn hills(place: &TestFolder, name: &str) {
    let level = |x: u32, y: u32| {
        let (x, y) = (f64::from(x), f64::from(y));
        130.0 + 60.0 * (x / 9.0 + y / 19.0).sin() + 40.0 * (y / 6.0 - x / 29.0).cos()
    };
    GrayImage::from_fn(64, 48, |x, y| Luma([level(x, y) as u8])).save(place.path(name)).unwrap();
}

/// Creates a folder with `bare.dat`. This stream has 60 readouts of 64x48 pixels and no sidecar.
fn with_stream() -> TestFolder {
    let place = TestFolder::new();
    hills(&place, "hills.png");
    place.run_ok("simulate hills.png --width 64 --height 48 --camera ideal --readouts 60 -o a");
    place.write("bare.dat", place.read("a.dat"));
    place
}

#[test]
fn every_command_that_opens_a_stream_warns_of_exchanged_sides() {
    let place = with_stream();
    for command in ["inspect", "measure", "convert", "reconstruct", "evaluate", "compare", "view"] {
        let rest = match command {
            "convert" => "new.npy",
            "reconstruct" => "-o new.png",
            "compare" => "ideal",
            "view" => "--export new.html",
            _ => "",
        };
        let wrong = place.run(&format!("{command} bare.dat {rest} --width 48 --height 64"));
        assert!(wrong.stderr.contains("set --width to 64 and --height to 48"), "{command}: {}", wrong.stderr);
    }
    let right = place.run_ok("inspect bare.dat --width 64 --height 48");
    assert_eq!(right.stderr, "");
    assert!(
        right.stdout.contains("64x48, as specified") && right.stdout.contains("(as read)"),
        "{}",
        right.stdout
    );
    let event = place.run_ok("inspect bare.dat --width 48 --height 64 --json").events().pop().unwrap();
    let best =
        event["layout_guesses"].as_array().unwrap().iter().find(|r| r["is_selected"] == false).unwrap();
    assert_eq!((best["width"].as_u64(), best["height"].as_u64()), (Some(64), Some(48)));
}

#[test]
fn a_set_with_a_cut_recording_says_so() {
    let place = TestFolder::new();
    place.picture("dark.png", 32, 24, 0);
    place.run_ok("simulate dark.png --width 32 --height 24 --readouts 100 -o run");
    let complete = place.read("run.dat");
    place.write("dark.dat", &complete[..complete.len() - 10]);
    place.write(
        "set.toml",
        "width = 32\nheight = 24\nreadout_hz = 20000\n[[recording]]\nfile = \"dark.dat\"\nlight = 0.0\n",
    );
    // One level is too few for a camera, but the damaged file is reported first.
    for command in ["calibrate set.toml -o out", "compare set.toml ideal -o out", "diagnose set.toml -o out"]
    {
        let ran = place.run(command);
        assert!(ran.stderr.contains("ends inside readout 99"), "{command}: {}", ran.stderr);
    }
}

#[test]
fn every_stream_that_is_written_has_a_sidecar() {
    let place = TestFolder::new();
    place.run_ok("record ideal --width 32 --height 24 --readouts 100 -o set");
    for layout in ["spikecv", "spike-zoo"] {
        place.run_ok(&format!(
            "dataset --scene-preset tiny --sequences 1 --images-per-scene 3 --label-every 0 --width 64 --height 48 --test-share 0 \
             --dataset-layout {layout} -o {layout}"
        ));
    }
    let mut streams = 0;
    for folder in [
        "set",
        "spikecv/train/spike",
        "spikecv/train/clean",
        "spike-zoo/train/spike",
        "spike-zoo/train/clean",
    ] {
        for entry in std::fs::read_dir(place.path(folder)).unwrap() {
            let path = entry.unwrap().path();
            if path.extension().is_some_and(|e| e == "dat") {
                let name = path.display().to_string();
                assert!(place.run_ok(&format!("inspect {name}")).stdout.contains(".json"), "{name}");
                place.run_ok(&format!("verify {name}"));
                streams += 1;
            }
        }
    }
    assert_eq!(streams, 12 + 4);
    // Without sidecars, the size comes from the configuration file in the parent folder.
    std::fs::remove_file(place.path("spikecv/train/spike/scene-0000.json")).unwrap();
    let ran = place.run_ok("inspect spikecv/train/spike/scene-0000.dat");
    assert!(ran.stderr.contains("64x48 from") && ran.stdout.contains("config.yaml"), "{}", ran.stderr);
}

#[test]
fn names_that_do_not_fit_what_is_written_are_refused() {
    let place = with_stream();
    for (rest, word) in [
        ("out.npz", ".npy"),
        ("out.h5", ".npy"),
        ("out.npy --to dat", ".dat"),
        ("out.dat --to events", ".npy"),
    ] {
        place.run_refused(&format!("convert a.dat {rest}"), 2, &["out.", word]);
    }
    let simulate = "simulate hills.png --width 64 --height 48 --readouts 5 -o";
    std::fs::create_dir(place.path("d")).unwrap();
    place.run_ok(&format!("{simulate} d/"));
    assert!(exists(&place.path("d/hills.dat")) && !exists(&place.path("d/.dat")));
    place.run_refused(&format!("{simulate} b.npz"), 2, &["b.npz"]);
    place.run_ok(&format!("{simulate} b.dat"));
    assert!(exists(&place.path("b.dat")) && !exists(&place.path("b.dat.dat")));
}

#[test]
fn events_come_with_a_sidecar_and_are_no_stream() {
    let place = with_stream();
    place.run_ok("convert a.dat e.npy --to events --readouts 10..20");
    assert_eq!(place.json("e.npy.json")["layout"], "events");
    let (header, _) = spikelane::unstable::npy::read_values("e", &place.read("e.npy")).unwrap();
    assert_eq!(place.json("e.npy.json")["spikes"].as_u64(), Some(header.shape[0]));
    place.run_ok("verify e.npy");
    place.run_refused("inspect e.npy", 4, &["events"]);
}

#[test]
fn dat_frames_of_no_whole_bytes_are_said() {
    let place = TestFolder::new();
    let ran = place.run_ok("simulate --builtin-light chart --width 61 --height 45 --readouts 16 -o o");
    assert!(ran.stderr.contains("Spike-Zoo") && ran.stderr.contains("SpikeCV"), "{}", ran.stderr);
    let ran = place.run_ok("convert o.dat o.npy");
    assert!(!ran.stderr.contains("Spike-Zoo"), "{}", ran.stderr);
}

#[test]
fn integers_without_a_full_scale_ask_for_it() {
    let place = TestFolder::new();
    let array = |element, bytes: Vec<[u8; 8]>| to_bytes(element, &[2, 8, 16], bytes.into_iter()).unwrap();
    place.write("i.npy", array(Element::I64, vec![51i64.to_le_bytes(); 256]));
    place.write("d.npy", array(Element::F64, vec![0.2f64.to_le_bytes(); 256]));
    place.write("codes.npy", npy_f32([2, 8, 16], &[51.0; 256]));
    let line = "--width 16 --height 8 --readouts-per-frame 50 --camera ideal";
    place.run_refused(&format!("simulate i.npy {line} -o a"), 4, &["i.npy", "--full-scale"]);
    place.run_refused(&format!("simulate codes.npy {line} -o a"), 4, &["codes.npy", "--full-scale"]);
    for (file, scale) in [("i.npy", "--full-scale 255"), ("codes.npy", "--full-scale 255"), ("d.npy", "")] {
        place.run_ok(&format!("simulate {file} {line} {scale} -o {file}.run"));
        let rate = place.json(&format!("{file}.run.json"))["mean_rate"].as_f64().unwrap();
        // Each pixel has 20 spikes in 100 readouts. The spikes are at different phases.
        assert!((rate - 0.2).abs() < 1e-3, "{file}: {rate}");
    }
}

#[test]
fn a_full_scale_applies_to_pictures() {
    let place = TestFolder::new();
    place.picture("p.png", 16, 8, 10);
    let line = "simulate p.png --size-from-input --camera ideal --transfer linear --readouts 100";
    place.run_ok(&format!("{line} --full-scale 50 -o b"));
    let rate = place.json("b.json")["mean_rate"].as_f64().unwrap();
    // Code 10 of 50 gives 20 spikes in 100 readouts.
    assert!((rate - 0.2).abs() < 1e-3, "{rate}");
    place.run_refused(&format!("{line} --full-scale 0 -o c"), 2, &["--full-scale"]);
}

#[test]
fn folders_say_what_is_missing_what_was_left_out_and_when_pictures_were() {
    let place = TestFolder::new();
    std::fs::create_dir(place.path("in")).unwrap();
    for n in [1, 2, 4, 5] {
        place.picture(&format!("in/{n:03}.png"), 16, 8, 40 * n);
    }
    place.write("in/notes.doc", "x");
    let line = "--width 16 --height 8 --camera ideal";
    let ran = place.run_ok(&format!("simulate in {line} -o a"));
    for words in [
        "number 3 is missing",
        "1 entry is not an image and ignored: notes.doc",
        "each frame lasts 20 readouts",
    ] {
        assert!(ran.stderr.contains(words), "{words}: {}", ran.stderr);
    }
    assert_eq!(place.json("a.json")["light"]["interpolation"], "linear");
    assert_eq!(place.json("a.json")["readouts"], 80);
    place.write("in/timestamps.txt", "0.0\n0.01\n0.03\n0.07\n");
    place.run_ok(&format!("simulate in {line} -o b"));
    // The last frame begins at 0.07 s. It lasts 0.04 s, as long as the frame before it. The stream of 0.11 s therefore
    // has 2200 readouts at 20 kHz.
    assert_eq!(place.json("b.json")["readouts"], 2200);
    let ran = place.run_ok(&format!("simulate in {line} --readouts-per-frame 10 -o c"));
    assert!(ran.stderr.contains("are not used"), "{}", ran.stderr);
    place.write("in/timestamps.txt", "0.0\n0.01\n");
    place.run_refused(&format!("simulate in {line} -o d"), 4, &["timestamps.txt", "2 times", "4 images"]);
}

#[test]
fn the_size_may_be_the_inputs_and_small_parts_are_said() {
    let place = with_stream();
    let ran = place.run_ok("simulate hills.png --size-from-input --readouts 5 -o whole");
    assert_eq!((place.json("whole.json")["width"].as_u64(), ran.stderr.contains("shows")), (Some(64), false));
    let ran = place.run_ok("simulate hills.png --width 48 --height 48 --readouts 5 -o part");
    assert!(ran.stderr.contains("shows 75 % of each 64x48 image"), "{}", ran.stderr);
    place.run_refused(
        "simulate hills.png --size-from-input --width 3 --readouts 5 -o b",
        2,
        &["--size-from-input"],
    );
}

#[test]
fn a_data_set_of_inputs_says_what_it_left_out() {
    let place = TestFolder::new();
    std::fs::create_dir_all(place.path("in/clip")).unwrap();
    hills(&place, "in/clip/1.bmp");
    hills(&place, "in/clip/2.bmp");
    hills(&place, "in/clip/4.bmp");
    hills(&place, "in/clip/5.bmp");
    place.write("in/readme.doc", "x");
    let ran = place.run_ok("dataset --from in -o set --width 32 --height 32 --test-share 0");
    for words in [
        "1 file is ignored, which is neither a video nor an image of a sequence: readme.doc",
        "number 3 is missing",
        "shows 75 %",
    ] {
        assert!(ran.stderr.contains(words), "{words}: {}", ran.stderr);
    }
    assert_eq!(std::fs::read_dir(place.path("set/sequences")).unwrap().count(), 1);
}

#[test]
fn a_folder_of_own_recordings_leads_to_a_calibration() {
    let place = TestFolder::new();
    place.run_ok("record physical --width 24 --height 16 --readouts 2000 -o made");
    std::fs::create_dir(place.path("own")).unwrap();
    for file in ["dark.dat", "flat_1000.dat", "flat_3000.dat", "flat_6000.dat"] {
        std::fs::copy(place.path(&format!("made/{file}")), place.path(&format!("own/{file}"))).unwrap();
    }
    place.run_refused("calibrate own/dark.dat", 2, &["own/dark.dat", "record --template own"]);
    place.run_ok("record --template own --width 24 --height 16");
    let text = String::from_utf8(place.read("own/recordings.toml")).unwrap();
    // Recordings are sorted from dark to bright. The program does not guess the light.
    let files: Vec<_> = text.lines().filter(|l| l.starts_with("file")).collect();
    assert!(files[0].contains("dark") && files[3].contains("6000"), "{text}");
    place.run_refused("calibrate own/recordings.toml -o a", 3, &["own/recordings.toml", "light"]);
    let mut levels = ["0.0", "0.1", "0.3", "0.6"].into_iter();
    let lines: Vec<_> =
        text.lines()
            .map(|l| {
                if l == "light = \"?\"" {
                    format!("light = {}", levels.next().unwrap())
                } else {
                    l.to_owned()
                }
            })
            .collect();
    place.write("own/recordings.toml", lines.join("\n"));
    place.run_ok("calibrate own/recordings.toml -o a");
    place.run_refused("record --template own --width 24 --height 16", 7, &["own/recordings.toml"]);
}
