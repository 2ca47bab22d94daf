//! Tests `evaluate` and `reconstruct` with streams that are too short, and with references that have different transfer
//! functions.

use crate::program_support::{CommandResult, TestFolder};
use serde_json::Value;
use spikelane::{Geometry, SpikeFramesRef};

const SIZE: &str = "--width 96 --height 64";
const PIXELS: usize = 96 * 64;

/// Writes `gt.png`, a smooth image, and `s.dat`, the spikes of integrators. A pixel with the value `code` in the image
/// fires with the rate `0.6 * code / 255`. The layout of `s.dat` stores the top row first. Returns the codes and the
/// bits.
fn write_field(place: &TestFolder, readouts: usize) -> (Vec<u8>, Vec<u8>) {
    let wave = |p: usize| ((p % 96) as f64 / 17.0).sin() * ((p / 96) as f64 / 13.0).cos();
    let codes: Vec<u8> = (0..PIXELS).map(|p| (110.0 + 100.0 * wave(p)) as u8).collect();
    let image = image::GrayImage::from_raw(96, 64, codes.clone()).unwrap();
    image.save(place.path("gt.png")).unwrap();
    let geometry = Geometry::new(96, 64).unwrap();
    let mut bytes = vec![0; readouts * geometry.frame_bytes()];
    for (t, frame) in bytes.chunks_exact_mut(geometry.frame_bytes()).enumerate() {
        for p in 0..PIXELS {
            let (rate, phase) = (0.6 * f64::from(codes[p]) / 255.0, (p as f64 * 0.618).fract());
            if (phase + rate * (t + 1) as f64).floor() > (phase + rate * t as f64).floor() {
                spikelane::spikes::set_bit(frame, p);
            }
        }
    }
    place.write("s.dat", &bytes);
    (codes, bytes)
}

fn evaluate(place: &TestFolder, more: &str) -> Value {
    let line = format!("evaluate s.dat {SIZE} --layout dat-top {more} --json");
    place.run_ok(&line).events().pop().unwrap()
}

fn picture_named<'a>(event: &'a Value, name: &str) -> &'a Value {
    let all = event["pictures"].as_array().unwrap();
    all.iter().find(|p| p["method"] == name).unwrap_or_else(|| panic!("no {name} in {event}"))
}

fn psnr(event: &Value, name: &str) -> f64 {
    picture_named(event, name)["scores"]["psnr_db"].as_f64().unwrap_or_else(|| panic!("{name}: {event}"))
}

/// The test uses the protocol of a published dataset. Spike counts of 41 readouts are divided by the count of white and
/// clipped to 1. PSNR compares the quotients with code / 255.
///
/// The test computes the expected PSNR in f64 from single bits. The program uses f32 rates, and its PSNR differs by at
/// most 1e-4 dB.
#[test]
fn ground_truth_with_light_in_its_codes_is_compared_as_light() {
    let place = TestFolder::new();
    let (codes, bytes) = write_field(&place, 120);
    let packed = SpikeFramesRef::new(Geometry::new(96, 64).unwrap(), &bytes).unwrap();
    let square = |p: usize| {
        let count = (40..=80).filter(|t| packed.get(*t, p / 96, p % 96)).count() as f64;
        ((count / 41.0 / 0.6).min(1.0) - f64::from(codes[p]) / 255.0).powi(2)
    };
    let wanted = -10.0 * ((0..PIXELS).map(square).sum::<f64>() / PIXELS as f64).log10();
    let flags = "--reference gt.png --full-scale-rate 0.6 --window 41";
    let event = evaluate(&place, &format!("{flags} --reference-transfer linear"));
    assert!((psnr(&event, "tfp 41") - wanted).abs() < 1e-3, "{event} for {wanted}");
    assert!(wanted > 30.0 && psnr(&event, "span 41") > wanted + 6.0, "{event}");
    assert_eq!(event["reference"]["transfer"], "linear");
    // If the codes of the reference are interpreted as sRGB or with a gamma of 2.2, they represent other light.
    let other = evaluate(&place, flags);
    assert!(psnr(&other, "tfp 41") < 20.0 && other["reference"]["transfer"] == "srgb", "{other}");
    let root = evaluate(&place, &format!("{flags} --reference-transfer 2.2"));
    assert!((psnr(&root, "tfp 41") - psnr(&other, "tfp 41")).abs() < 3.0, "{root}");
    let text = place.run_ok(&format!("evaluate s.dat {SIZE} {flags} --reference-transfer linear")).stdout;
    assert!(text.contains("transfer linear (--reference-transfer)"), "{text}");
    place.run_refused(&format!("evaluate s.dat {SIZE} {flags} --reference-transfer log"), 2, &["log"]);
    place.run_refused(&format!("evaluate s.dat {SIZE} --reference-transfer linear"), 2, &["--reference"]);
}

#[test]
fn the_sidecar_says_how_the_image_of_a_run_was_read() {
    let place = TestFolder::new();
    place.picture("gt.png", 96, 64, 100);
    place.run_ok(&format!(
        "simulate gt.png --transfer linear --camera ideal {SIZE} --readouts 255 --exposure 20000 -o s"
    ));
    let line = "evaluate s.dat --reference gt.png --window 201 --json";
    let event = place.run_ok(line).events().pop().unwrap();
    assert_eq!(
        (&event["reference"]["transfer"], &event["reference"]["transfer_source"]),
        (&"linear".into(), &"the sidecar".into())
    );
    // The rate that an integrator has in 201 readouts is wrong by less than 1/201, so PSNR is at least 40 dB.
    assert!(psnr(&event, "tfp 201") > 40.0, "{event}");
    // The flag has priority over the sidecar. If an image is not the input of the simulation, it has the default
    // transfer function.
    let event = place.run_ok(&format!("{line} --reference-transfer srgb")).events().pop().unwrap();
    assert_eq!(event["reference"]["transfer_source"], "--reference-transfer");
    std::fs::copy(place.path("gt.png"), place.path("other.png")).unwrap();
    let event = place.run_ok("evaluate s.dat --reference other.png --json").events().pop().unwrap();
    assert_eq!(event["reference"]["transfer"], "srgb");
}

/// The detail score of a TFP picture must be about 1, and the detail score of the blurred picture must be below 0.5.
/// This must hold with `--static-scene` and with a reference image.
#[test]
fn blur_lowers_the_detail_score() {
    let place = TestFolder::new();
    let (codes, _) = write_field(&place, 240);
    let fine: Vec<u8> =
        codes.iter().enumerate().map(|(p, c)| c / 2 + 60 * ((p * 7919) % 97 % 2) as u8).collect();
    image::GrayImage::from_raw(96, 64, fine).unwrap().save(place.path("fine.png")).unwrap();
    let line =
        "simulate fine.png --transfer linear --camera physical --width 96 --height 64 --readouts 300 -o f";
    place.run_ok(line);
    for reference_flags in ["--static-scene", "--reference fine.png --reference-transfer linear"] {
        let event = place
            .run_ok(&format!("evaluate f.dat {reference_flags} --window 41 --json"))
            .events()
            .pop()
            .unwrap();
        let score = |name: &str, key: &str| picture_named(&event, name)["scores"][key].as_f64().unwrap();
        let [sharp, soft] = ["tfp 41", "tfp 41 blurred"].map(|name| score(name, "detail_slope"));
        assert!((sharp - 1.0).abs() < 0.05 && soft < 0.5, "{reference_flags}: {sharp} {soft}");
        let [count, span] = ["tfp 41", "span 41"].map(|name| score(name, "high_pass_noise"));
        // The rates of the pixels differ by 2 %. In a comparison with the light, these differences also count as noise.
        assert!(span < 0.8 * count, "{reference_flags}: {count} {span}");
        assert!(score("span 41", "aligned_psnr_db") > score("tfp 41 blurred", "aligned_psnr_db"), "{event}");
    }
    let text = place.run_ok("evaluate f.dat --static-scene").stdout;
    assert!(text.contains("static scene: ") && text.contains("against the truth"), "{text}");
    place.run_refused("evaluate f.dat --static-scene --at 3", 2, &["--at"]);
    place.run_refused("evaluate f.dat --static-scene --reference fine.png", 2, &["--reference"]);
}

#[test]
fn tfi_at_the_ends_of_a_stream_is_not_measurable() {
    let place = TestFolder::new();
    write_field(&place, 120);
    let flags = "--reference gt.png --full-scale-rate 0.6 --reference-transfer linear";
    for at in [0, 2, 117, 119] {
        let event = evaluate(&place, &format!("{flags} --at {at}"));
        let tfi = picture_named(&event, "tfi");
        assert_eq!(tfi["is_measurable"], false, "{at}");
        assert!(
            tfi.get("scores").is_none() && tfi["reason"].as_str().unwrap().contains("6144 pixels"),
            "{tfi}"
        );
        let text = place.run_ok(&format!("evaluate s.dat {SIZE} {flags} --at {at}")).stdout;
        assert!(text.contains("not measurable: "), "{text}");
    }
    let event = evaluate(&place, flags);
    assert!(psnr(&event, "tfi") > 20.0, "{event}");
    let note = picture_named(&evaluate(&place, "--window 301"), "tfp 301")["note"].clone();
    assert_eq!(note, "the stream has only 120 of the 301 readouts of the window");
    let ran = place.run_ok(&format!("reconstruct s.dat {SIZE} --method tfi --every 20 -o tfi.npy --json"));
    assert_eq!(ran.events().pop().unwrap()["not_measurable"], serde_json::json!([]));
    let ran = place.run_ok(&format!("reconstruct s.dat {SIZE} --method tfi --at 119 -o end.png"));
    assert!(ran.stderr.contains("1 image at readout 119, because"), "{}", ran.stderr);
}

/// In six readouts of a street almost no pixel has an interval. The table must not contain the mean of the few other
/// pixels.
#[test]
fn a_set_averages_no_tfi_that_it_cannot_measure() {
    let place = TestFolder::new();
    place
        .run_ok("dataset --scene-preset tiny --sequences 2 --images-per-scene 6 --label-every 0 --width 64 --height 40 -o set");
    let text = place.run_ok("evaluate set --window 5").stdout;
    assert_eq!(text.matches("tfi            not measurable in any picture").count(), 2, "{text}");
    assert!(text.contains("span 5"), "{text}");
}

fn no_word_but_numbers(ran: &CommandResult) {
    let text = ran.stdout.to_lowercase();
    for word in ["nan", "inf", "null"] {
        assert!(!text.contains(word), "{}", ran.stdout);
    }
}

/// The test uses five kinds of streams: one readout, no spikes, spikes at every readout, very long silence, and too few
/// pixels for a noise estimate.
#[test]
fn whatever_the_stream_all_figures_are_finite() {
    let frame = PIXELS / 8;
    let streams = [("one", 1, 0x55), ("dark", 50, 0), ("all", 50, 0xff), ("long", 700, 0), ("two", 2, 0xff)];
    let place = TestFolder::new();
    place.picture("white.png", 96, 64, 255);
    for (name, readouts, byte) in streams {
        place.write(&format!("{name}.dat"), vec![byte; frame * readouts]);
        for more in [
            "",
            "--reference white.png --full-scale-rate 1 --reference-transfer linear",
            "--window 1 --at 0",
            "--window 4294967295",
        ] {
            for json in ["", "--json"] {
                no_word_but_numbers(&place.run_ok(&format!("evaluate {name}.dat {SIZE} {more} {json}")));
            }
        }
        for method in ["tfp", "span", "tfi", "isi"] {
            let line = format!("reconstruct {name}.dat {SIZE} --method {method} --force --json -o");
            no_word_but_numbers(&place.run_ok(&format!("{line} p.png")));
            place.run_ok(&format!("{line} p.npy --window 4294967295"));
            let npy = place.read("p.npy");
            let values = npy[npy.len() - 4 * PIXELS..].chunks_exact(4);
            assert!(values.map(|b| f32::from_le_bytes(b.try_into().unwrap())).all(f32::is_finite), "{line}");
        }
    }
    // Equal pictures have no finite PSNR, so the output contains only a lower bound.
    let event = place
        .run_ok(&format!("evaluate all.dat {SIZE} --reference white.png --full-scale-rate 1 --json"))
        .events();
    assert_eq!(picture_named(&event[0], "span 33")["scores"]["psnr_db_above"], 144.5);
    place.write("small.dat", vec![0x5a; 2 * 50]);
    no_word_but_numbers(&place.run_ok("evaluate small.dat --width 8 --height 2 --json"));
    place.write("none.dat", b"");
    assert_ne!(place.run(&format!("evaluate none.dat {SIZE}")).code, 0);
}

/// Without a clean stream, the fourth panel of the contact sheet is TFI of the noisy stream.
#[test]
fn the_first_look_shows_only_what_can_be_made() {
    let place = TestFolder::new();
    place.picture("gray.png", 96, 64, 120);
    let mut scores = [3, 300].map(|readouts| {
        place.run_ok(&format!("simulate gray.png {SIZE} --readouts {readouts} --force -o a"));
        let sheet = image::open(place.path("a.png")).unwrap().into_luma8();
        let (w, h) = sheet.dimensions();
        (h / 2..h)
            .flat_map(|y| (w / 2..w).map(move |x| (x, y)))
            .filter(|(x, y)| sheet.get_pixel(*x, *y).0[0] != 24)
            .count()
    });
    scores.sort_unstable();
    assert!(scores[0] < 96 && scores[1] > PIXELS / 2, "{scores:?}");
}

/// Simulates a driving scene with a reference image at every 40th readout. The sidecar lists these images.
fn drive(place: &TestFolder) {
    place.run_ok("simulate --camera physical --width 96 --height 64 --readouts 200 --images-every 40 -o run");
}

fn readout_events(events: &[Value]) -> Vec<&Value> {
    events.iter().filter(|event| event["event"] == "readout").collect()
}

const EVALUATE_AGAINST_LIGHT: &str = "evaluate s.dat --width 96 --height 64 --reference gt.png --reference-transfer linear --full-scale-rate 0.6 --window 41 --json";

/// Returns the events of an evaluation at every 60th of 240 readouts.
fn four_readouts(place: &TestFolder) -> Vec<Value> {
    write_field(place, 240);
    place.run_ok(&format!("{EVALUATE_AGAINST_LIGHT} --every 60")).events()
}

#[test]
fn each_readout_scores_as_if_evaluated_alone() {
    let place = TestFolder::new();
    let events = four_readouts(&place);
    let all = readout_events(&events);
    let at: Vec<_> = all.iter().map(|moment| moment["readout"].as_u64().unwrap()).collect();
    assert_eq!(at, [30, 90, 150, 210]);
    for moment in all {
        let single = place
            .run_ok(&format!("{EVALUATE_AGAINST_LIGHT} --at {}", moment["readout"]))
            .events()
            .pop()
            .unwrap();
        assert_eq!(moment["pictures"], single["pictures"]);
    }
}

#[test]
fn the_means_of_moments_are_their_means() {
    let place = TestFolder::new();
    let events = four_readouts(&place);
    let all = readout_events(&events);
    let means = events.last().unwrap();
    for name in ["tfp 41", "tfp 41 blurred", "span 41", "tfi", "reference"] {
        for key in ["psnr_db", "ssim", "detail_slope", "high_pass_noise"] {
            let values: Vec<f64> =
                all.iter().filter_map(|moment| picture_named(moment, name)["scores"][key].as_f64()).collect();
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            let score = picture_named(means, name)["scores"][key].as_f64();
            assert!(values.is_empty() == score.is_none(), "{name} {key}");
            assert!(
                score.is_none_or(|score| (score - mean).abs() < 1e-9),
                "{name} {key}: {score:?} for {mean}"
            );
        }
    }
}

#[test]
fn images_named_by_their_readouts_say_where_to_look() {
    let place = TestFolder::new();
    drive(&place);
    let events = place.run_ok("evaluate run.dat --reference run.images --window 41 --json").events();
    let all = readout_events(&events);
    let at: Vec<_> = all.iter().map(|moment| moment["readout"].as_u64().unwrap()).collect();
    assert_eq!(at, [40, 80, 120, 160]);
    for moment in all {
        let at = moment["readout"].as_u64().unwrap();
        let line =
            format!("evaluate run.dat --reference run.images/{at:06}.png --at {at} --window 41 --json");
        assert_eq!(moment["pictures"], place.run_ok(&line).events().pop().unwrap()["pictures"]);
    }
    let text = place.run_ok("evaluate run.dat --reference run.images --window 41").stdout;
    assert!(text.contains("means over 4 readouts, 40 to 160"), "{text}");
    assert!(text.contains("excluded: 1 of 5, whose windows exceed"), "{text}");
}

#[test]
fn only_the_kinds_that_are_asked_for_are_made() {
    let place = TestFolder::new();
    write_field(&place, 120);
    let event = evaluate(&place, "--method span --method tfi --window 21");
    let names: Vec<_> = event["pictures"].as_array().unwrap().iter().map(|p| p["method"].clone()).collect();
    assert_eq!(names, ["span 21", "tfi"]);
}

#[test]
fn moments_that_cannot_be_are_refused() {
    let place = TestFolder::new();
    drive(&place);
    std::fs::create_dir(place.path("none")).unwrap();
    place.run_refused("evaluate run.dat --reference none", 4, &["none", "000100.png"]);
    place.run_refused("evaluate run.dat --reference run.images --every 40", 2, &["--every", "run.images"]);
    place.run_refused("evaluate run.dat --reference run.images --at 40", 2, &["--at", "run.images"]);
    place.run_refused("evaluate run.dat --every 40 --at 3", 2, &["--at"]);
    place.write("dark.dat", vec![0; 200 * PIXELS / 8]);
    let line = format!("evaluate dark.dat {SIZE} --static-scene --every 40 --window 21");
    place.run_refused(&line, 4, &["dark.dat", "without detail"]);
    place.run_refused("evaluate run.dat --every 300 --window 401", 4, &["run.dat", "--window"]);
    std::fs::copy(place.path("run.images/000040.png"), place.path("run.images/40.png")).unwrap();
    place.run_refused("evaluate run.dat --reference run.images", 4, &["two images of readout 40"]);
    std::fs::rename(place.path("run.images/40.png"), place.path("run.images/900.png")).unwrap();
    place.run_refused("evaluate run.dat --reference run.images", 4, &["900", "200"]);
}

#[test]
fn a_data_set_names_windows_that_exceed_its_streams() {
    let place = TestFolder::new();
    let dataset = "dataset --scene-preset tiny --sequences 2 --images-per-scene 6 --label-every 0 --width 64 --height 40";
    place.run_ok(&format!("{dataset} -o set"));
    let ran = place.run_ok("evaluate set --method tfp --window 9");
    let note = "note: tfp 9: the stream has only 6 of the 9 readouts of the window (2 of 2 sequences)";
    assert!(ran.stdout.contains(note), "{}", ran.stdout);
    let ran = place.run_ok("evaluate set --method tfp --window 5");
    assert!(!ran.stdout.contains("note"), "{}", ran.stdout);
}
