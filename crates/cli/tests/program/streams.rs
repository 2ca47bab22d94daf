//! Tests commands that read streams and cameras.

use crate::program_support::TestFolder;

/// Writes a stream of 400x250 pixels. Every layout except `rows1024` supports this size.
const CAMERA: &str = "simulate --builtin-light chart --readouts 40 -o a";

#[test]
fn every_layout_converts_there_and_back() {
    let place = TestFolder::new();
    place.run_ok(CAMERA);
    for (layout, ending) in [
        ("dat-top", "dat"),
        ("rows416", "dat"),
        ("npy-bits", "npy"),
        ("npy-bytes", "npy"),
        ("dat", "dat"),
        ("dat-msb", "dat"),
        ("dat-top-msb", "dat"),
        ("npy-bits-msb", "npy"),
    ] {
        let there = format!("{layout}.{ending}");
        place.run_ok(&format!("convert a.dat {there} --to {layout}"));
        place.run_ok(&format!("verify {there}"));
        place.run_ok(&format!("convert {there} back-{layout}.dat"));
        assert!(place.read(&format!("back-{layout}.dat")) == place.read("a.dat"), "{layout}");
    }
}

#[test]
fn a_stream_that_is_replaced_leaves_no_sidecar_that_speaks_of_it() {
    let place = TestFolder::new();
    for (stem, readouts) in [("a", 40), ("b", 30)] {
        place.run_ok(&format!("simulate --builtin-light chart --readouts {readouts} -o {stem}"));
    }
    place.run_ok("convert b.dat o.dat");
    // The existing sidecar describes a shorter stream. First the same command overwrites the stream, and then another
    // command.
    place.run_ok("convert a.dat o.dat --force");
    assert_eq!(place.json("o.dat.json")["readouts"], 40);
    place.run_ok("simulate --builtin-light chart --readouts 50 -o o --force");
    place.run_ok("verify o.dat");
    assert!(!place.path("o.dat.json").exists());
    // A file that is not a sidecar of this program is not changed without `--force`.
    place.write("d.dat.json", "of somebody");
    place.run_ok("simulate --builtin-light chart --readouts 40 -o d");
    assert_eq!(place.read("d.dat.json"), b"of somebody");
    place.run_ok("simulate --builtin-light chart --readouts 60 -o c");
    place.run_ok("convert c.dat o.dat --force");
    place.run_ok("verify o.dat");
}

#[test]
fn a_part_is_cut_out_and_keeps_its_origin() {
    let place = TestFolder::new();
    place.run_ok(CAMERA);
    place.run_ok("convert a.dat part.npy --to npy-bytes --readouts 10..30 --crop 100,50,64,32");
    place.run_ok("convert a.dat whole.npy --to npy-bytes");
    let (part, full) = (place.read("part.npy"), place.read("whole.npy"));
    let (part, full) = (&part[part.len() - 20 * 64 * 32..], &full[full.len() - 40 * 100_000..]);
    for (t, frame) in part.chunks(64 * 32).enumerate() {
        for (row, line) in frame.chunks(64).enumerate() {
            let start = (10 + t) * 100_000 + (50 + row) * 400 + 100;
            assert_eq!(line, &full[start..start + 64], "readout {t}, row {row}");
        }
    }
    let sidecar = place.json("part.npy.json");
    assert_eq!(sidecar["converted_from"]["readouts"], serde_json::json!([10, 30]));
    assert_eq!(sidecar["converted_from"]["sidecar"]["digest"], place.json("a.json")["digest"]);
    place.run_refused("convert a.dat b.dat --readouts 30..41", 2, &["a.dat", "0..40"]);
    place.run_refused("convert a.dat b.dat --crop 390,0,20,20", 2, &["crop"]);
    place.run_refused("convert a.dat a.dat --force", 2, &["a.dat"]);
}

#[test]
fn inspect_tells_what_is_known_of_an_ideal_stream() {
    let place = TestFolder::new();
    place.picture("gray.png", 32, 16, 51);
    // The light is a fifth of full scale. Every pixel therefore fires at every fifth of 100 readouts.
    place.run_ok(
        "simulate gray.png --transfer linear --camera ideal --width 32 --height 16 --readouts 100 -o a",
    );
    let event = place.run_ok("inspect a.dat --digest --png look.png --json").events().pop().unwrap();
    assert_eq!((event["readouts"].as_u64(), event["layout"].as_str()), (Some(100), Some("dat")));
    assert_eq!(event["mean_rate"], 0.2);
    assert_eq!(event["max_pixel_rate"], 0.2);
    assert_eq!((event["dead_pixels"].as_u64(), event["digest_matches"].as_bool()), (Some(0), Some(true)));
    assert_eq!(image::open(place.path("look.png")).unwrap().width(), 32);
    // If a file has no header and no sidecar, size flags are sufficient.
    place.write("bare.dat", place.read("a.dat"));
    assert!(place.run_ok("inspect bare.dat --width 32 --height 16").stdout.contains("100 readouts of 32x16"));
}

#[test]
fn reconstruct_writes_pictures_arrays_and_folders() {
    let place = TestFolder::new();
    place.picture("gray.png", 32, 16, 51);
    place.run_ok(
        "simulate gray.png --transfer linear --camera ideal --width 32 --height 16 --readouts 100 -o a",
    );
    place.run_ok("reconstruct a.dat --window 51 --at 50 --white 0.2 -o tfp.png");
    let picture = image::open(place.path("tfp.png")).unwrap().into_luma8();
    // A window of 51 readouts contains 10 or 11 spikes. With 10 spikes, the rate is 0.98 of white, which is code 253 in
    // sRGB. With 11 spikes, the pixel is white, which is code 255.
    assert!(picture.pixels().all(|p| p.0[0] >= 252), "{:?}", picture.pixels().map(|p| p.0[0]).min());
    place.run_ok("reconstruct a.dat --method tfi --at 50 -o tfi.npy");
    let values = floats(&place.read("tfi.npy"), 32 * 16);
    assert!(values.iter().all(|v| *v == 0.2));
    place.run_ok("reconstruct a.dat --method isi --every 25 --window 20 -o isi.npy");
    let bytes = place.read("isi.npy");
    assert!(String::from_utf8_lossy(&bytes[..128]).contains("(4, 16, 32)"));
    assert!(floats(&bytes, 4 * 32 * 16).iter().all(|v| *v == 5.0));
    place.run_ok("reconstruct a.dat --every 40 -o frames");
    assert_eq!(std::fs::read_dir(place.path("frames")).unwrap().count(), 2);
    place.run_refused("reconstruct a.dat --every 40 -o frames", 7, &["frames"]);
    place.run_refused("reconstruct a.dat --at 100 -o b.png", 2, &["100"]);
    place.run_refused("reconstruct a.dat -o b.bmp", 2, &["b.bmp"]);
}

fn floats(npy: &[u8], count: usize) -> Vec<f32> {
    let data = &npy[npy.len() - 4 * count..];
    data.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect()
}

#[test]
fn a_camera_file_with_maps_is_one_camera_wherever_its_folder_is() {
    let place = TestFolder::new();
    let size = "--width 32 --height 24";
    place.run_ok(&format!("preset show physical {size} -o one --maps --camera-seed 7"));
    place.run_ok(&format!("simulate --builtin-light chart {size} --readouts 50 --camera-seed 7 -o kind"));
    std::fs::rename(place.path("one"), place.path("moved")).unwrap();
    // The maps of the camera contain its fixed pattern, so the camera seed has no effect.
    place.run_ok(
        "simulate --builtin-light chart --camera moved/camera.toml --camera-seed 99 --readouts 50 -o map",
    );
    assert!(place.read("kind.dat") == place.read("map.dat"));
    // The simulation writes the camera beside its stream.
    place.run_ok("simulate --builtin-light chart --camera map.camera/camera.toml --readouts 50 -o again");
    assert!(place.read("again.dat") == place.read("map.dat"));
    let mut gain = place.read("moved/gain.npy");
    *gain.last_mut().unwrap() ^= 1;
    place.write("moved/gain.npy", gain);
    place.run_refused(
        "simulate --builtin-light chart --camera moved/camera.toml --readouts 50 -o b",
        9,
        &["gain.npy", "blake3:"],
    );
}

#[test]
fn every_preset_prints_what_simulates_to_the_same_bits() {
    let place = TestFolder::new();
    let list = place.run_ok("preset list --json").events();
    let names: Vec<_> = list.iter().filter_map(|e| e["preset"].as_str()).collect();
    assert_eq!(names.len(), spikelane::presets::ALL.len());
    for name in names {
        place.write("shown.toml", place.run_ok(&format!("preset show {name}")).stdout);
        let line = "--width 24 --height 16 --readouts 40 --force";
        place.run_ok(&format!("simulate --builtin-light chart --camera {name} {line} -o a"));
        place.run_ok(&format!("simulate --builtin-light chart --camera shown.toml {line} -o b"));
        assert!(place.read("a.dat") == place.read("b.dat"), "{name}");
    }
}

#[test]
fn effects_completions_and_manual_pages_come_out() {
    let place = TestFolder::new();
    let events = place.run_ok("effects --json").events();
    assert_eq!(events.len(), spikelane::effects::ALL.len());
    assert!(place.run_ok("effects prnu").stdout.contains("sigma"));
    assert!(place.run_ok("completions bash").stdout.contains("spikelane"));
    assert!(place.run_ok("man").stdout.contains(".TH"));
    place.run_ok("man --output pages");
    assert!(place.path("pages/spikelane-simulate.1").exists());
}

#[test]
fn inspect_calls_no_pixel_dead_after_ten_readouts() {
    let place = TestFolder::new();
    // The rate is one spike in twenty readouts. Half of the pixels are therefore silent in ten readouts.
    place.picture("gray.png", 32, 16, 13);
    place.run_ok(
        "simulate gray.png --transfer linear --camera physical --width 32 --height 16 --readouts 10 -o a",
    );
    let event = place.run_ok("inspect a.dat --json").events().pop().unwrap();
    assert_eq!(event["dead_pixels"], 0);
    assert!(event["silent_pixels"].as_u64() > Some(0), "{event}");
}

/// Returns the header text and the values of an array of little-endian f32.
fn read_npy(bytes: &[u8]) -> (String, Vec<f32>) {
    let header = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    let values = bytes[header..].chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect();
    (String::from_utf8(bytes[10..header].to_vec()).unwrap(), values)
}

#[test]
fn arrays_of_reconstruct_have_the_shape_of_their_images() {
    let place = TestFolder::new();
    place.run_ok("simulate --builtin-light chart --width 32 --height 24 --readouts 200 -o c");
    place.run_ok("reconstruct c.dat -o one.npy --window 41 --at 60");
    let (header, one) = read_npy(&place.read("one.npy"));
    assert!(header.contains("'<f4'") && header.contains("'fortran_order': False"), "{header}");
    assert!(header.contains("'shape': (24, 32)"), "{header}");
    // TFP is the mean of the readouts in the window.
    place.run_ok("convert c.dat bits.npy --readouts 40..81");
    let spikes = place.read("bits.npy");
    let frames = &spikes[spikes.len() - 41 * 24 * 32..];
    for (p, rate) in one.iter().enumerate() {
        let count: u32 = frames.iter().skip(p).step_by(24 * 32).map(|&b| u32::from(b)).sum();
        assert!((rate - count as f32 / 41.0).abs() < 1e-6, "pixel {p}");
    }
    place.run_ok("reconstruct c.dat -o many.npy --window 41 --every 40");
    let (header, many) = read_npy(&place.read("many.npy"));
    assert!(header.contains("'shape': (5, 24, 32)"), "{header}");
    assert_eq!((many.len(), &many[24 * 32..2 * 24 * 32]), (5 * 24 * 32, &one[..]));
    for name in ["x.npz", "x.tif", "x.jpg"] {
        place.run_refused(&format!("reconstruct c.dat -o {name}"), 2, &[name, ".png, .exr, .npy, .gif"]);
    }
}

#[test]
fn an_animated_webp_has_the_images_of_a_folder() {
    use image::AnimationDecoder as _;
    let place = TestFolder::new();
    place.run_ok("simulate --builtin-light chart --width 33 --height 24 --readouts 200 -o c");
    let pictures = "reconstruct c.dat --window 41 --every 40";
    place.run_ok(&format!("{pictures} -o folder"));
    place.run_ok(&format!("{pictures} -o a.webp --fps 30"));
    let bytes = place.read("a.webp");
    let decoder = image::codecs::webp::WebPDecoder::new(std::io::Cursor::new(&bytes)).unwrap();
    let frames: Vec<_> = decoder.into_frames().map(Result::unwrap).collect();
    assert_eq!(frames.len(), 5);
    for (k, frame) in frames.iter().enumerate() {
        let file = place.path(&format!("folder/{:09}.png", 20 + 40 * k));
        let expected = image::open(file).unwrap().into_rgba8();
        assert!(*frame.buffer() == expected, "frame {k}");
    }
    // 30 frames per second are 33, 34, 33, ... ms.
    let total: f64 = frames.iter().map(|f| f.delay().numer_denom_ms().0 as f64).sum();
    assert!((total - 5.0 * 1000.0 / 30.0).abs() <= 0.5, "{total} ms");
}

#[test]
fn an_animated_image_refuses_what_its_format_cannot_have() {
    let place = TestFolder::new();
    place.run_ok("simulate --builtin-light chart --width 32 --height 24 --readouts 40 -o c");
    place.run_refused("reconstruct c.dat -o a.gif --every 4 --fps 60", 2, &["--fps", "50", ".webp"]);
    assert!(!place.path("a.gif").exists());
}

#[test]
fn a_window_that_exceeds_the_stream_is_reported() {
    let place = TestFolder::new();
    place.run_ok("simulate --builtin-light chart --width 32 --height 24 --readouts 20 -o c");
    let stderr = |line: &str| place.run_ok(&format!("{line} --force")).stderr;
    let short = stderr("reconstruct c.dat -o a.png --window 100");
    assert!(short.contains("the stream has 20 readouts, fewer than the window of 101"), "{short}");
    let edge = stderr("reconstruct c.dat -o a.png --window 9 --at 2");
    assert!(
        edge.contains("window of 9") && edge.contains("at readout 2, the stream contains 7 readouts"),
        "{edge}"
    );
    let whole = stderr("reconstruct c.dat -o a.png --window 9");
    assert!(!whole.contains("note"), "{whole}");
    assert!(!stderr("reconstruct c.dat -o a --every 4 --window 4").contains("fewer"));
    place.run_refused("reconstruct c.dat -o b.png --at 20", 2, &["readout 20", "less than 20"]);
    let scores = place.run_ok("evaluate c.dat --window 100").stdout;
    assert!(scores.contains("the stream has only 20 of the 101 readouts"), "{scores}");
    place.run_refused("evaluate c.dat --at 20", 2, &["less than 20"]);
    place.run_refused("evaluate c.dat --window 100 --every 2", 4, &["20 readouts", "--window"]);
    for range in ["30..", "10..30", "30..40"] {
        place.run_refused(&format!("inspect c.dat --readouts {range}"), 2, &["20"]);
        place.run_refused(&format!("convert c.dat d.dat --readouts {range}"), 2, &["20"]);
    }
}
