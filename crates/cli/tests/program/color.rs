//! Tests color cameras: light behind filters, streams with a mosaic, and color pictures.

use image::{ImageFormat, Rgb, RgbImage};

use crate::program_support::TestFolder;

const SIZE: &str = "--width 64 --height 48";

/// Writes a color image with uniform blocks of 8x8 pixels.
fn write_picture(place: &TestFolder) {
    let code = |x: u32, y: u32, factor: u32| (40 + (x / 8 * factor + y / 8 * 31) % 200) as u8;
    let image = RgbImage::from_fn(64, 48, |x, y| Rgb([code(x, y, 23), code(x, y, 37), code(x, y, 53)]));
    image.save_with_format(place.path("picture.png"), ImageFormat::Png).unwrap();
}

/// Writes the camera file `name` with the sections `text`.
fn write_camera(place: &TestFolder, name: &str, text: &str) {
    let sensor = "[sensor]\nwidth = 64\nheight = 48\n";
    let effects = "[effects.prnu]\nsigma = 0.03\n[effects.shot_noise]\nstrength = 1\n[effects.start_phase]\nshare = 1\n";
    place.write(name, format!("{sensor}{text}\n{effects}"));
}

/// Returns the bits of a stream in the layout npy-bytes, one byte per pixel.
fn bits(place: &TestFolder, stem: &str) -> Vec<u8> {
    place.run_ok(&format!("convert {stem}.dat {stem}.npy --force"));
    let bytes = place.read(&format!("{stem}.npy"));
    bytes[bytes.len() - 64 * 48 * 100..].to_vec()
}

#[test]
fn the_pixels_of_a_channel_equal_a_gray_camera_with_the_weights_of_the_channel() {
    let place = TestFolder::new();
    write_picture(&place);
    let responses = [("R", "[0.75, 0.25, 0.0]"), ("G", "[0.0, 1.0, 0.0]"), ("B", "[0.0, 0.25, 0.75]")];
    let table: Vec<String> = responses.iter().map(|(name, weights)| format!("{name} = {weights}")).collect();
    write_camera(
        &place,
        "color.toml",
        &format!("[sensor.mosaic]\npattern = \"GBRG\"\nresponse = {{ {} }}", table.join(", ")),
    );
    place.run_ok("simulate picture.png --camera color.toml --readouts 100 -o color");
    let color = bits(&place, "color");
    for (name, weights) in responses {
        write_camera(&place, "gray.toml", &format!("[light]\nluminance = {weights}"));
        place.run_ok("simulate picture.png --camera gray.toml --readouts 100 -o gray --force");
        let gray = bits(&place, "gray");
        let letter = |p: usize| [["G", "B"], ["R", "G"]][p / 64 % 2][p % 64 % 2];
        let own = (0..color.len()).filter(|i| letter(i % (64 * 48)) == name);
        let (pixels, different) = own.fold((0, 0), |(n, d), i| (n + 1, d + usize::from(color[i] != gray[i])));
        assert!(pixels >= 64 * 48 * 25 && different == 0, "{name}: {different} of {pixels}");
    }
}

#[test]
fn the_sidecar_states_the_mosaic_and_a_crop_its_shifted_pattern() {
    let place = TestFolder::new();
    write_picture(&place);
    place.run_ok(&format!("simulate picture.png --camera ideal {SIZE} --mosaic RGGB --readouts 100 -o a"));
    let mosaic = &place.json("a.json")["mosaic"];
    assert_eq!((mosaic["pattern"].as_str(), mosaic["illuminant"].as_str()), (Some("RGGB"), Some("D65")));
    assert_eq!(mosaic["white"]["R"], 1.0);
    for (crop, pattern) in
        [("0,0,32,32", "RGGB"), ("1,0,32,32", "GRBG"), ("0,1,32,32", "GBRG"), ("3,5,32,32", "BGGR")]
    {
        place.run_ok(&format!("convert a.dat part.dat --crop {crop} --force"));
        assert_eq!(place.json("part.dat.json")["mosaic"]["pattern"], pattern, "{crop}");
    }
    // A camera without filters has no such entry.
    place.run_ok(&format!("simulate picture.png --camera ideal {SIZE} --readouts 100 -o b"));
    assert!(place.json("b.json").get("mosaic").is_none());
}

#[test]
fn reference_images_and_reconstructions_of_a_color_camera_are_in_color() {
    let place = TestFolder::new();
    write_picture(&place);
    place.run_ok(&format!(
        "simulate picture.png --camera ideal {SIZE} --mosaic RGGB --readouts 400 -o a --images-every 400"
    ));
    let original = image::open(place.path("picture.png")).unwrap().into_rgb8();
    assert_eq!(image::open(place.path("a.images/000000.png")).unwrap().into_rgb8(), original);
    for method in ["bilinear", "malvar", "menon"] {
        place.run_ok(&format!(
            "reconstruct a.dat -o a.png --method span --window 399 --white 1 --demosaic {method} --force"
        ));
        let found = image::open(place.path("a.png")).unwrap();
        assert_eq!(found.color(), image::ColorType::Rgb8);
        let found = found.into_rgb8();
        // The centers of the blocks are at least three pixels from another color. A rate has an error below 1 / 380, which
        // is less than 6 codes for codes of at least 40.
        for (x, y) in (0..8).flat_map(|i| (0..6).map(move |j| (8 * i + 3, 8 * j + 3))) {
            let pairs = found.get_pixel(x, y).0.into_iter().zip(original.get_pixel(x, y).0);
            let error = pairs.map(|(a, b)| a.abs_diff(b)).max();
            assert!(error <= Some(6), "{method} {x} {y}: {error:?}");
        }
    }
    place.run_ok("reconstruct a.dat -o a.npy --demosaic malvar");
    assert!(String::from_utf8_lossy(&place.read("a.npy")[..128]).contains("(48, 64, 3)"));
    place.run_ok("reconstruct a.dat -o raw.npy --demosaic none");
    assert!(String::from_utf8_lossy(&place.read("raw.npy")[..128]).contains("(48, 64)"));
}

#[test]
fn color_arrays_are_read_in_color() {
    let place = TestFolder::new();
    let header = "{'descr': '|u1', 'fortran_order': False, 'shape': (1, 48, 64, 3), }";
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend(118u16.to_le_bytes());
    bytes.extend(format!("{header:<117}\n").as_bytes());
    bytes.extend([255, 51, 0].repeat(48 * 64));
    place.write("orange.npy", bytes);
    place.run_ok(&format!("simulate orange.npy --camera ideal {SIZE} --mosaic RGGB --readouts 100 -o a"));
    let all = bits(&place, "a");
    let rate =
        |row: usize, col: usize| (0..100).map(|t| u32::from(all[(t * 48 + row) * 64 + col])).sum::<u32>();
    assert_eq!([rate(0, 0), rate(0, 1), rate(1, 0), rate(1, 1)], [100, 20, 20, 0]);
    // A gray camera adds the colors with the weights of luminance.
    place.run_ok(&format!("simulate orange.npy --camera ideal {SIZE} --readouts 100 -o a --force"));
    let light = 0.2126 + 0.2 * 0.7152;
    let all = bits(&place, "a");
    let spikes = (0..100).map(|t| u32::from(all[t * 48 * 64])).sum::<u32>();
    assert!((f64::from(spikes) - 100.0 * light).abs() <= 1.0, "{spikes}");
}

#[test]
fn pixels_of_a_mosaic_are_compared_with_pixels_of_the_same_filter() {
    let place = TestFolder::new();
    let image = RgbImage::from_fn(64, 48, |x, y| Rgb([200, 120 + (x / 4) as u8, 60 + (y / 4) as u8]));
    image.save_with_format(place.path("wall.png"), ImageFormat::Png).unwrap();
    place.run_ok(&format!("simulate wall.png --camera ideal {SIZE} --mosaic RGGB --readouts 500 -o a"));
    place.run_ok("convert a.dat undeclared.dat --mosaic none");
    for (file, key) in [("a.dat", "mosaic"), ("undeclared.dat", "detected_mosaics")] {
        let found = place.run_ok(&format!("inspect {file} --json")).events().remove(0);
        assert!(found.get(key).is_some(), "{file}: {found}");
        for defects in ["dead_pixels", "stuck_pixels"] {
            assert_eq!(found[defects], 0, "{file} {defects}");
        }
        let outliers = found["hot_pixels"].as_u64().unwrap() + found["weak_pixels"].as_u64().unwrap();
        assert!(outliers < 64 * 48 / 50, "{file}: {outliers}");
    }
    let found = place.run_ok("inspect undeclared.dat --json").events().remove(0);
    assert_eq!(found["detected_mosaics"], serde_json::json!(["RGGB", "BGGR"]));
    let measured = place.run_ok("measure a.dat --json").events().remove(0);
    let channels: Vec<&str> =
        measured["cells"].as_array().unwrap().iter().filter_map(|c| c["channel"].as_str()).collect();
    assert_eq!(channels, ["R", "G", "G", "B"]);
    // A gray camera has no pattern.
    place.run_ok(&format!("simulate wall.png --camera physical {SIZE} --readouts 500 -o gray"));
    assert!(place.run_ok("inspect gray.dat --json").events()[0].get("detected_mosaics").is_none());
}

#[test]
fn gray_light_is_reported_and_flow_is_refused() {
    let place = TestFolder::new();
    place.picture("gray.png", 64, 48, 128);
    let ran =
        place.run_ok(&format!("simulate gray.png --camera ideal {SIZE} --mosaic BGGR --readouts 20 -o a"));
    assert!(ran.stderr.contains("the light is gray"), "{}", ran.stderr);
    place.run_refused(
        &format!("simulate --builtin-light chart --camera ideal {SIZE} --mosaic BGGR --readouts 20 -o b --interpolation flow"),
        2,
        &["flow", "BGGR"],
    );
    place.run_refused("reconstruct a.dat -o a.gif --window 11", 2, &["--demosaic none"]);
    place.run_refused("reconstruct a.dat -o b.png --mosaic none --demosaic malvar", 2, &["--demosaic"]);
    place.run_refused("inspect a.dat --mosaic rggb", 2, &["--mosaic", "RGGB"]);
}

#[test]
fn a_drive_in_color_has_gray_luminance_and_colored_images() {
    let place = TestFolder::new();
    let drive =
        "simulate --camera ideal --width 48 --height 32 --readouts 8 --images-every 8 --images-format f32";
    place.run_ok(&format!("{drive} --mosaic RGGB -o color"));
    place.run_ok(&format!("{drive} -o gray"));
    let floats = |name: &str| -> Vec<f32> {
        let bytes = place.read(name);
        bytes[128..].chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect()
    };
    let (color, gray) = (floats("color.images/000000.npy"), floats("gray.images/000000.npy"));
    assert_eq!(color.len(), 3 * gray.len());
    let mut colored = 0;
    for (rgb, light) in color.chunks_exact(3).zip(&gray) {
        let luminance = 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2];
        assert!((luminance - light).abs() <= 1e-4 * light.max(0.01), "{rgb:?} {light}");
        colored += usize::from((rgb[0] - rgb[2]).abs() > 0.05 * light);
    }
    assert!(colored > gray.len() / 10, "{colored}");
}

/// Records a set with a color camera whose filters transmit 55 %, 100 % and 40 % of the light of the lamp.
fn record_color_set(place: &TestFolder) {
    let sensor = "name = \"own\"\n[sensor]\nwidth = 48\nheight = 48\n";
    let mosaic = "[sensor.mosaic]\npattern = \"GRBG\"\ngain = { R = 0.55, B = 0.4 }\n";
    let effects = "[effects.prnu]\nsigma = 0.03\n[effects.dark_current]\nmean = \"0.3 pA\"\nsigma = \"0.1 pA\"\n[effects.shot_noise]\nstrength = 1\n[effects.start_phase]\nshare = 1\n";
    place.write("color.toml", format!("{sensor}{mosaic}{effects}"));
    place.run_ok("record --camera color.toml --readouts 1000 -o set");
}

#[test]
fn calibrate_writes_the_light_of_each_filter() {
    let place = TestFolder::new();
    record_color_set(&place);
    place.run_ok("calibrate set/recordings.toml -o declared");
    let camera = String::from_utf8(place.read("declared/camera.toml")).unwrap();
    assert!(camera.contains("pattern = \"GRBG\""), "{camera}");
    let mosaic = &place.json("declared/calibration.json")["mosaic"];
    assert_eq!(mosaic["pattern"], "GRBG");
    assert_eq!(mosaic["is_declared"], true);
    for (channel, light) in mosaic["channels"].as_array().unwrap().iter().zip([0.55, 1.0, 0.4]) {
        let found = channel["light"]["value"].as_f64().unwrap();
        // 576 pixels with a gain spread of 3 % have a mean gain with an error of 0.13 %.
        assert!((found / light - 1.0).abs() < 0.01, "{channel}");
    }
    // The sidecars state the filters. The flag has priority over them.
    place.run_refused(
        "calibrate set/recordings.toml --mosaic RGGB -o wrong",
        4,
        &["the same filter of the mosaic RGGB", "GRBG or GBRG"],
    );
    let unfiltered =
        place.run_ok("calibrate set/recordings.toml --mosaic none -o unfiltered --json").events();
    assert!(unfiltered.last().unwrap().get("mosaic").is_none());
}

#[test]
fn compare_reports_each_channel_and_diagnose_refuses_color_filters() {
    let place = TestFolder::new();
    record_color_set(&place);
    let ran = place
        .run_ok("compare set/recordings.toml --camera color.toml --camera ideal --max-readouts 500 -o same");
    assert!(ran.stdout.contains("over the channels RGB"), "{}", ran.stdout);
    let found = place.json("same/comparison.json");
    assert_eq!(found["channels"], serde_json::json!(["R", "G", "B"]));
    // The camera of the recordings is the nearest one.
    assert_eq!(found["models"][0]["name"], "own");
    // A gray camera receives the light behind the filters.
    let ideal = found["models"][1]["response_distance"].as_f64().unwrap();
    assert!(ideal < 0.03, "{ideal}");
    write_camera(&place, "other.toml", "[sensor.mosaic]\npattern = \"BGGR\"");
    place.run_refused("compare set/recordings.toml --camera other.toml -o other", 2, &["BGGR", "GRBG"]);
    place.run_refused("diagnose set/recordings.toml -o diagnosis", 4, &["the mosaic GRBG", "all pixels"]);
}

#[test]
fn evaluate_scores_folders_and_data_sets_in_color() {
    let place = TestFolder::new();
    write_picture(&place);
    place.run_ok(&format!(
        "simulate picture.png --camera ideal {SIZE} --mosaic RGGB --readouts 400 -o a --images-every 100"
    ));
    let one =
        place.run_ok("evaluate a.dat --reference a.images/000200.png --at 200 --json").events().remove(0);
    let folder = place.run_ok("evaluate a.dat --reference a.images --json").events().remove(0);
    let scores = |event: &serde_json::Value| event["color_pictures"].as_array().unwrap().clone();
    assert_eq!(folder["mosaic"], "RGGB");
    assert_eq!(scores(&folder).len(), scores(&one).len());
    // The light is constant, so the pictures of all readouts are nearly equal.
    for (mean, one) in scores(&folder).iter().zip(scores(&one)) {
        assert_eq!((&mean["name"], &mean["demosaicing"]), (&one["name"], &one["demosaicing"]));
        let [mean, one] = [mean, &one].map(|p| p["scores"]["cpsnr_db"].as_f64().unwrap());
        assert!((mean - one).abs() < 1.0, "{mean} {one}");
    }
    place.run_ok("dataset -o set --scene-preset tiny --camera ideal --mosaic RGGB");
    let ran = place.run_ok("evaluate set");
    assert!(
        ran.stdout.contains("noisy, means over 2 sequences in color") && ran.stdout.contains("menon"),
        "{}",
        ran.stdout
    );
}
