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

/// Returns the values of an array of 32-bit floats.
fn floats(place: &TestFolder, name: &str) -> Vec<f32> {
    let bytes = place.read(name);
    bytes[128..].chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect()
}

#[test]
fn deep_pngs_have_the_srgb_codes_of_the_rates() {
    let place = TestFolder::new();
    write_picture(&place);
    place.run_ok(&format!("simulate picture.png --camera ideal {SIZE} --mosaic RGGB --readouts 200 -o a"));
    // The code of IEC 61966-2-1, from the formula in 64 bits.
    let code = |v: f32| {
        let x = f64::from(v / 0.5).clamp(0.0, 1.0);
        let curve = if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 };
        (curve * 65535.0).round()
    };
    for (demosaic, kind) in [("bilinear", image::ColorType::Rgb16), ("none", image::ColorType::L16)] {
        let line = format!("reconstruct a.dat --demosaic {demosaic} --white 0.5 --force");
        place.run_ok(&format!("{line} -o a.png --bits 16"));
        place.run_ok(&format!("{line} -o a.npy"));
        let picture = image::open(place.path("a.png")).unwrap();
        assert_eq!(picture.color(), kind);
        let codes = match picture {
            image::DynamicImage::ImageLuma16(gray) => gray.into_raw(),
            color => color.into_rgb16().into_raw(),
        };
        let values = floats(&place, "a.npy");
        assert_eq!(codes.len(), values.len());
        // The curve in 32 bits has an error below 1e-6, which is 0.07 codes. Rounding can then differ by one code.
        assert!(
            codes.iter().zip(&values).all(|(c, v)| (f64::from(*c) - code(*v)).abs() <= 1.0),
            "{demosaic}"
        );
        let different = codes.iter().zip(&values).filter(|(c, v)| f64::from(**c) != code(**v)).count();
        assert!(different < codes.len() / 10, "{demosaic}: {different}");
    }
    place.run_ok("reconstruct a.dat -o folder --bits 16 --every 100");
    assert_eq!(image::open(place.path("folder/000000050.png")).unwrap().color(), image::ColorType::Rgb16);
}

#[test]
fn exr_pictures_have_the_values_of_the_array_without_clipping() {
    use exr::prelude::{ReadChannels as _, ReadLayers as _};
    let place = TestFolder::new();
    write_picture(&place);
    place.run_ok(&format!("simulate picture.png --camera ideal {SIZE} --mosaic RGGB --readouts 200 -o a"));
    for (demosaic, names) in [("bilinear", ["B", "G", "R"].as_slice()), ("none", ["Y"].as_slice())] {
        let line = format!("reconstruct a.dat --demosaic {demosaic} --white 0.25 --force");
        place.run_ok(&format!("{line} -o a.exr"));
        place.run_ok(&format!("{line} -o a.npy"));
        let bytes = place.read("a.exr");
        let file = exr::prelude::read().no_deep_data().largest_resolution_level().all_channels();
        let file =
            file.first_valid_layer().all_attributes().from_buffered(std::io::Cursor::new(bytes)).unwrap();
        let channels = &file.layer_data.channel_data.list;
        assert_eq!(channels.iter().map(|c| c.name.to_string()).collect::<Vec<_>>(), names);
        let expected = floats(&place, "a.npy");
        assert!(expected.iter().any(|v| *v > 0.25), "{demosaic}: no value is above white");
        let samples = |name: &str| -> Vec<f32> {
            let channel = channels.iter().find(|c| c.name.eq(name)).unwrap();
            channel.sample_data.values_as_f32().collect()
        };
        let colors = if names.len() == 3 { vec!["R", "G", "B"] } else { vec!["Y"] };
        for (i, name) in colors.iter().enumerate() {
            // A division by 0.25 is exact.
            let own: Vec<f32> = expected.iter().skip(i).step_by(colors.len()).map(|v| v / 0.25).collect();
            assert!(samples(name) == own, "{demosaic} {name}");
        }
    }
    place.run_refused("reconstruct a.dat -o a.exr --every 10", 2, &["--every"]);
}

/// Returns the palette and the indices of the first frame of a GIF with one global palette of 256 colors.
fn first_gif_frame(bytes: &[u8]) -> (Vec<[u8; 3]>, Vec<u8>) {
    assert_eq!((&bytes[..6], bytes[10]), (&b"GIF89a"[..], 0xf7));
    let palette = bytes[13..13 + 768].chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect();
    // The extension for repetition has 19 bytes, the extension of the frame 8, and its descriptor 10.
    let mut rest = &bytes[13 + 768 + 19 + 8 + 10..];
    assert_eq!(rest[0], 8);
    rest = &rest[1..];
    let mut data = Vec::new();
    while rest[0] != 0 {
        let length = usize::from(rest[0]);
        data.extend(&rest[1..=length]);
        rest = &rest[length + 1..];
    }
    let mut decoder = weezl::decode::Decoder::new(weezl::BitOrder::Lsb, 8);
    (palette, decoder.decode(&data).unwrap())
}

#[test]
fn animated_images_have_the_colors_of_the_folder() {
    use image::AnimationDecoder as _;
    let place = TestFolder::new();
    write_picture(&place);
    place.run_ok(&format!("simulate picture.png --camera ideal {SIZE} --mosaic RGGB --readouts 200 -o a"));
    let line = "reconstruct a.dat --method span --every 100";
    place.run_ok(&format!("{line} -o folder"));
    place.run_ok(&format!("{line} -o a.webp"));
    place.run_ok(&format!("{line} -o a.gif"));
    let expected = image::open(place.path("folder/000000050.png")).unwrap();
    let decoder = image::codecs::webp::WebPDecoder::new(std::io::Cursor::new(place.read("a.webp"))).unwrap();
    let frames: Vec<_> = decoder.into_frames().map(Result::unwrap).collect();
    assert_eq!(frames.len(), 2);
    assert!(*frames[0].buffer() == expected.to_rgba8());
    let (palette, indices) = first_gif_frame(&place.read("a.gif"));
    assert_eq!(indices.len(), 64 * 48);
    for (index, pixel) in indices.iter().zip(expected.to_rgb8().pixels()) {
        // The palette has six levels of red and blue, and seven of green. Dither selects one of the two nearest levels.
        for (i, step) in [51, 43, 51].into_iter().enumerate() {
            let difference = palette[usize::from(*index)][i].abs_diff(pixel[i]);
            assert!(difference <= step, "{pixel:?} {:?}", palette[usize::from(*index)]);
        }
    }
}

#[test]
fn a_single_recording_is_compared_behind_its_filters() {
    let place = TestFolder::new();
    // Rates of 0.30, 0.16 and 0.10 behind the filters. With a gray camera, no area would be uniform.
    let image = RgbImage::from_pixel(64, 48, Rgb([149, 111, 89]));
    image.save_with_format(place.path("wall.png"), ImageFormat::Png).unwrap();
    place.run_ok(&format!("simulate wall.png --camera physical {SIZE} --mosaic RGGB --readouts 400 -o a"));
    place.run_ok("convert a.dat undeclared.dat --mosaic none");
    let compare = |file: &str| {
        place.run_ok(&format!("compare {file} --camera ideal --camera physical -o {file}.out"));
        place.json(&format!("{file}.out/comparison.json"))
    };
    let (declared, detected) = (compare("a.dat"), compare("undeclared.dat"));
    let letters = |found: &serde_json::Value| -> String {
        found["channels"].as_array().unwrap().iter().filter_map(|c| c["name"].as_str()).collect()
    };
    assert_eq!((letters(&declared), letters(&detected)), ("RGB".to_owned(), "KLMN".to_owned()));
    assert_eq!(declared["pixels"], detected["pixels"]);
    assert!(declared["pixels"].as_u64().unwrap() > 64 * 48 / 2, "{}", declared["pixels"]);
    for (channel, rate) in declared["channels"].as_array().unwrap().iter().zip([0.30, 0.16, 0.10]) {
        assert!((channel["mean_rate"].as_f64().unwrap() / rate - 1.0).abs() < 0.1, "{channel}");
    }
    assert_eq!(declared["models"][0]["name"], "physical");
    assert_eq!(declared["models"], detected["models"]);
}

#[test]
fn a_picture_of_undeclared_filters_has_a_note() {
    let place = TestFolder::new();
    write_picture(&place);
    place.run_ok(&format!("simulate picture.png --camera ideal {SIZE} --mosaic RGGB --readouts 200 -o a"));
    place.run_ok("convert a.dat undeclared.dat --mosaic none");
    let stderr = |line: &str| place.run_ok(line).stderr;
    let note = stderr("reconstruct undeclared.dat -o gray.png");
    assert!(note.contains("RGGB or BGGR; the image is gray"), "{note}");
    assert!(!stderr("reconstruct undeclared.dat -o b.png --mosaic none").contains("alternate"));
    assert!(!stderr("reconstruct a.dat -o c.png --demosaic none").contains("alternate"));
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
    let measured = place.run_ok("measure a.dat --json").events().pop().unwrap();
    let channels: Vec<&str> =
        measured["cells"].as_array().unwrap().iter().filter_map(|c| c["channel"].as_str()).collect();
    assert_eq!(channels, ["R", "G", "G", "B"]);
    // A gray camera has no pattern.
    place.run_ok(&format!("simulate wall.png --camera physical {SIZE} --readouts 500 -o gray"));
    assert!(place.run_ok("inspect gray.dat --json").events()[0].get("detected_mosaics").is_none());
}

/// An .npy file with the spikes of a stream of 192x128 pixels, one byte per pixel.
struct Bits(Vec<u8>);

impl Bits {
    const PIXELS: usize = 192 * 128;

    /// Changes the spikes of pixel `p` with `change`, which receives the readout and the spike.
    fn edit(&mut self, p: usize, change: impl Fn(usize, u8) -> u8) {
        let header = self.0.len() % Self::PIXELS;
        for (t, bit) in self.0[header..].iter_mut().skip(p).step_by(Self::PIXELS).enumerate() {
            *bit = change(t, *bit);
        }
    }
}

#[test]
fn a_mosaic_of_a_natural_scene_shows_its_defects_and_few_others() {
    let place = TestFolder::new();
    let sensor = "[sensor]\nwidth = 192\nheight = 128\n[sensor.mosaic]\npattern = \"RGGB\"\n";
    let effects = "[effects.prnu]\nsigma = 0.02\n[effects.shot_noise]\nstrength = 1\n[effects.start_phase]\nshare = 1\n";
    place.write("camera.toml", format!("{sensor}{effects}"));
    place.run_ok("simulate --camera camera.toml --readouts 400 -o a");
    place.run_ok("convert a.dat a.npy");
    let mut bits = Bits(place.read("a.npy"));
    // 32 pixels of each kind, at fixed pseudorandom places: hot pixels fire at every second readout, weak pixels lose seven of
    // eight spikes, and dead pixels are silent.
    let mut state = 1_u32;
    let mut draw = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as usize % Bits::PIXELS
    };
    let [hot, weak, dead]: [Vec<usize>; 3] = std::array::from_fn(|_| (0..32).map(|_| draw()).collect());
    hot.iter().for_each(|p| bits.edit(*p, |t, bit| bit.max(u8::from(t % 2 == 0))));
    weak.iter().for_each(|p| bits.edit(*p, |t, bit| bit * u8::from(t % 8 == 0)));
    dead.iter().for_each(|p| bits.edit(*p, |_, _| 0));
    place.write("b.npy", &bits.0);
    let defects = |file: &str| {
        let measured = place.run_ok(&format!("measure {file} --mosaic RGGB --json")).events().pop().unwrap();
        ["hot", "weak", "dead"]
            .map(|kind| -> Vec<usize> { serde_json::from_value(measured["defects"][kind].clone()).unwrap() })
    };
    // Without defects, 82 of 24,576 pixels are hot or weak: details of the scene of at most three pixels. Without the
    // comparison with the range of the surroundings, 4,047 pixels would be hot or weak.
    let clean: usize = defects("a.dat").iter().map(Vec::len).sum();
    assert!(clean < 24_576 / 200, "{clean}");
    // 23 of 32 pixels of each kind differ by more than the contrast around them.
    let found = defects("b.npy");
    let count = |kind: usize, injected: &[usize]| injected.iter().filter(|p| found[kind].contains(p)).count();
    let counts = [count(0, &hot), count(1, &weak), count(2, &dead)];
    assert!(counts[0] >= 20 && counts[1] >= 20 && counts[2] >= 20, "{counts:?}");
    // No other pixel becomes a defect.
    let all: usize = found.iter().map(Vec::len).sum();
    assert!(all <= clean + 96, "{all}");
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
    place.run_refused("reconstruct a.dat -o a.npy --bits 16", 2, &["--bits", "a.npy"]);
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
    let [color, gray] = ["color", "gray"].map(|name| floats(&place, &format!("{name}.images/000000.npy")));
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
    place.run_ok("dataset -o set --scene-preset tiny --images-per-scene 41 --camera ideal --mosaic RGGB");
    let ran = place.run_ok("evaluate set");
    assert!(
        ran.stdout.contains("noisy, means over 2 sequences in color") && ran.stdout.contains("menon"),
        "{}",
        ran.stdout
    );
}
