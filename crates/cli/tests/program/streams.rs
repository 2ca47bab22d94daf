//! Commands on streams and cameras, from outside.

use crate::program_support::Place;

/// 400x250, so that every layout but one holds it.
const CAMERA: &str = "simulate --source chart --readouts 40 -o a";

#[test]
fn every_layout_converts_there_and_back() {
    let place = Place::new();
    place.good(CAMERA);
    for (layout, ending) in
        [("dat-top", "dat"), ("rows416", "dat"), ("npy-bits", "npy"), ("npy-bytes", "npy"), ("dat", "dat")]
    {
        let there = format!("{layout}.{ending}");
        place.good(&format!("convert a.dat {there} --to {layout}"));
        place.good(&format!("verify {there}"));
        place.good(&format!("convert {there} back-{layout}.dat"));
        assert!(place.read(&format!("back-{layout}.dat")) == place.read("a.dat"), "{layout}");
    }
}

#[test]
fn a_stream_that_is_replaced_leaves_no_sidecar_that_speaks_of_it() {
    let place = Place::new();
    for (stem, readouts) in [("a", 40), ("b", 30)] {
        place.good(&format!("simulate --source chart --readouts {readouts} -o {stem}"));
    }
    place.good("convert b.dat o.dat");
    // More readouts than the sidecar beside it says, from the program that wrote it and from another one.
    place.good("convert a.dat o.dat --force");
    assert_eq!(place.json("o.dat.json")["readouts"], 40);
    place.good("simulate --source chart --readouts 50 -o o --force");
    place.good("verify o.dat");
    assert!(!place.path("o.dat.json").exists());
    // Without leave to overwrite, a file that is no stream stays as it is.
    place.write("d.dat.json", "of somebody");
    place.good("simulate --source chart --readouts 40 -o d");
    assert_eq!(place.read("d.dat.json"), b"of somebody");
    place.good("simulate --source chart --readouts 60 -o c");
    place.good("convert c.dat o.dat --force");
    place.good("verify o.dat");
}

#[test]
fn a_part_is_cut_out_and_keeps_its_origin() {
    let place = Place::new();
    place.good(CAMERA);
    place.good("convert a.dat part.npy --to npy-bytes --readouts 10..30 --crop 100,50,64,32");
    place.good("convert a.dat whole.npy --to npy-bytes");
    let (part, whole) = (place.read("part.npy"), place.read("whole.npy"));
    let (part, whole) = (&part[part.len() - 20 * 64 * 32..], &whole[whole.len() - 40 * 100_000..]);
    for (t, frame) in part.chunks(64 * 32).enumerate() {
        for (row, line) in frame.chunks(64).enumerate() {
            let start = (10 + t) * 100_000 + (50 + row) * 400 + 100;
            assert_eq!(line, &whole[start..start + 64], "readout {t}, row {row}");
        }
    }
    let sidecar = place.json("part.npy.json");
    assert_eq!(sidecar["converted_from"]["readouts"], serde_json::json!([10, 30]));
    assert_eq!(sidecar["converted_from"]["sidecar"]["digest"], place.json("a.json")["digest"]);
    place.refused("convert a.dat b.dat --readouts 30..41", 2, &["a.dat", "0..40"]);
    place.refused("convert a.dat b.dat --crop 390,0,20,20", 2, &["crop"]);
    place.refused("convert a.dat a.dat --force", 2, &["a.dat"]);
}

#[test]
fn inspect_tells_what_is_known_of_an_ideal_stream() {
    let place = Place::new();
    place.picture("grey.png", 32, 16, 51);
    // A fifth of full scale: every pixel fires at every fifth of 100 readouts.
    place.good(
        "simulate grey.png --transfer linear --camera ideal --width 32 --height 16 --readouts 100 -o a",
    );
    let told = place.good("inspect a.dat --digest --png look.png --json").events().pop().unwrap();
    assert_eq!((told["readouts"].as_u64(), told["layout"].as_str()), (Some(100), Some("dat")));
    assert_eq!(told["mean_rate"], 0.2);
    assert_eq!(told["greatest_pixel_rate"], 0.2);
    assert_eq!((told["dead_pixels"].as_u64(), told["digest_matches"].as_bool()), (Some(0), Some(true)));
    assert_eq!(image::open(place.path("look.png")).unwrap().width(), 32);
    // The clean twin's name has a stem of its own, and headerless files need only flags.
    place.write("bare.dat", place.read("a.dat"));
    assert!(place.good("inspect bare.dat --width 32 --height 16").stdout.contains("100 readouts of 32x16"));
}

#[test]
fn reconstruct_writes_pictures_arrays_and_folders() {
    let place = Place::new();
    place.picture("grey.png", 32, 16, 51);
    place.good(
        "simulate grey.png --transfer linear --camera ideal --width 32 --height 16 --readouts 100 -o a",
    );
    place.good("reconstruct a.dat --window 51 --at 50 --white 0.2 -o tfp.png");
    let picture = image::open(place.path("tfp.png")).unwrap().into_luma8();
    // 51 readouts hold 10 or 11 spikes: 0.98 of white or white, 253 or 255 in sRGB.
    assert!(picture.pixels().all(|p| p.0[0] >= 252), "{:?}", picture.pixels().map(|p| p.0[0]).min());
    place.good("reconstruct a.dat --method tfi --at 50 -o tfi.npy");
    let values = floats(&place.read("tfi.npy"), 32 * 16);
    assert!(values.iter().all(|v| *v == 0.2));
    place.good("reconstruct a.dat --method isi --every 25 --window 20 -o isi.npy");
    let bytes = place.read("isi.npy");
    assert!(String::from_utf8_lossy(&bytes[..128]).contains("(4, 16, 32)"));
    assert!(floats(&bytes, 4 * 32 * 16).iter().all(|v| *v == 5.0));
    place.good("reconstruct a.dat --every 40 -o frames");
    assert_eq!(std::fs::read_dir(place.path("frames")).unwrap().count(), 2);
    place.refused("reconstruct a.dat --every 40 -o frames", 7, &["frames"]);
    place.refused("reconstruct a.dat --at 100 -o b.png", 2, &["100"]);
    place.refused("reconstruct a.dat -o b.bmp", 2, &["b.bmp"]);
}

fn floats(npy: &[u8], count: usize) -> Vec<f32> {
    let data = &npy[npy.len() - 4 * count..];
    data.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect()
}

#[test]
fn a_camera_file_with_maps_is_one_camera_wherever_its_folder_is() {
    let place = Place::new();
    let size = "--width 32 --height 24";
    place.good(&format!("preset show physical {size} -o one --maps --camera-seed 7"));
    place.good(&format!("simulate --source chart {size} --readouts 50 --camera-seed 7 -o kind"));
    std::fs::rename(place.path("one"), place.path("moved")).unwrap();
    // Its maps are its fixed pattern: the camera seed has nothing left to draw.
    place.good("simulate --source chart --camera moved/camera.toml --camera-seed 99 --readouts 50 -o map");
    assert!(place.read("kind.dat") == place.read("map.dat"));
    // The run keeps the camera beside its stream.
    place.good("simulate --source chart --camera map.camera/camera.toml --readouts 50 -o again");
    assert!(place.read("again.dat") == place.read("map.dat"));
    let mut gain = place.read("moved/gain.npy");
    *gain.last_mut().unwrap() ^= 1;
    place.write("moved/gain.npy", gain);
    place.refused(
        "simulate --source chart --camera moved/camera.toml --readouts 50 -o b",
        9,
        &["gain.npy", "blake3:"],
    );
}

#[test]
fn every_preset_prints_what_simulates_to_the_same_bits() {
    let place = Place::new();
    let list = place.good("preset list --json").events();
    let names: Vec<_> = list.iter().filter_map(|e| e["preset"].as_str()).collect();
    assert_eq!(names.len(), spikelane::presets::ALL.len());
    for name in names {
        place.write("shown.toml", place.good(&format!("preset show {name}")).stdout);
        let line = "--width 24 --height 16 --readouts 40 --force";
        place.good(&format!("simulate --source chart --camera {name} {line} -o a"));
        place.good(&format!("simulate --source chart --camera shown.toml {line} -o b"));
        assert!(place.read("a.dat") == place.read("b.dat"), "{name}");
    }
}

#[test]
fn effects_completions_and_manual_pages_come_out() {
    let place = Place::new();
    let told = place.good("effects --json").events();
    assert_eq!(told.len(), spikelane::effects::ALL.len());
    assert!(place.good("effects prnu").stdout.contains("sigma"));
    assert!(place.good("completions bash").stdout.contains("spikelane"));
    assert!(place.good("man").stdout.contains(".TH"));
    place.good("man --dir pages");
    assert!(place.path("pages/spikelane-simulate.1").exists());
}

#[test]
fn inspect_calls_no_pixel_dead_after_ten_readouts() {
    let place = Place::new();
    // A spike in twenty readouts: half of the pixels are silent for ten.
    place.picture("grey.png", 32, 16, 13);
    place.good(
        "simulate grey.png --transfer linear --camera physical --width 32 --height 16 --readouts 10 -o a",
    );
    let told = place.good("inspect a.dat --json").events().pop().unwrap();
    assert_eq!(told["dead_pixels"], 0);
    assert!(told["silent_pixels"].as_u64() > Some(0), "{told}");
}
