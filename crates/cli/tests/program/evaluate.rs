//! What `evaluate` and `reconstruct` say of streams that they cannot judge whole, and of light in other curves.

use crate::program_support::{Place, Ran};
use serde_json::Value;
use spikelane::{Geometry, Packed};

const SIZE: &str = "--width 96 --height 64";
const PIXELS: usize = 96 * 64;

/// Codes of a smooth picture, 0 to 255, and `readouts` readouts of integrators of rate `0.6 code / 255`, by the
/// layout that needs no flip.
fn field(place: &Place, readouts: usize) -> (Vec<u8>, Vec<u8>) {
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

fn evaluate(place: &Place, more: &str) -> Value {
    let line = format!("evaluate s.dat {SIZE} --layout dat-top {more} --json");
    place.good(&line).events().pop().unwrap()
}

fn named<'a>(told: &'a Value, name: &str) -> &'a Value {
    let all = told["pictures"].as_array().unwrap();
    all.iter().find(|p| p["picture"] == name).unwrap_or_else(|| panic!("no {name} in {told}"))
}

fn psnr(told: &Value, name: &str) -> f64 {
    named(told, name)["marks"]["psnr_db"].as_f64().unwrap_or_else(|| panic!("{name}: {told}"))
}

/// The protocol of a published data set: PSNR of counts over 41 readouts, divided by the rate of white and cut,
/// against code / 255. Written here in f64 over single bits; f32 rates are good to 1e-4 dB.
#[test]
fn ground_truth_with_light_in_its_codes_is_compared_as_light() {
    let place = Place::new();
    let (codes, bytes) = field(&place, 120);
    let packed = Packed::new(Geometry::new(96, 64).unwrap(), &bytes).unwrap();
    let square = |p: usize| {
        let count = (40..=80).filter(|t| packed.get(*t, p / 96, p % 96)).count() as f64;
        ((count / 41.0 / 0.6).min(1.0) - f64::from(codes[p]) / 255.0).powi(2)
    };
    let wanted = -10.0 * ((0..PIXELS).map(square).sum::<f64>() / PIXELS as f64).log10();
    let flags = "--clear gt.png --full 0.6 --window 41";
    let told = evaluate(&place, &format!("{flags} --clear-transfer linear"));
    assert!((psnr(&told, "tfp 41") - wanted).abs() < 1e-3, "{told} for {wanted}");
    assert!(wanted > 30.0 && psnr(&told, "span 41") > wanted + 6.0, "{told}");
    assert_eq!(told["clear"]["transfer"], "linear");
    // Read as sRGB the same codes are another light, and one said to have a root for its curve yet another.
    let other = evaluate(&place, flags);
    assert!(psnr(&other, "tfp 41") < 20.0 && other["clear"]["transfer"] == "srgb", "{other}");
    let root = evaluate(&place, &format!("{flags} --clear-transfer 2.2"));
    assert!((psnr(&root, "tfp 41") - psnr(&other, "tfp 41")).abs() < 3.0, "{root}");
    let text = place.good(&format!("evaluate s.dat {SIZE} {flags} --clear-transfer linear")).stdout;
    assert!(text.contains("transfer linear (--clear-transfer)"), "{text}");
    place.refused(&format!("evaluate s.dat {SIZE} {flags} --clear-transfer log"), 2, &["log"]);
    place.refused(&format!("evaluate s.dat {SIZE} --clear-transfer linear"), 2, &["--clear"]);
}

#[test]
fn the_sidecar_says_how_the_image_of_a_run_was_read() {
    let place = Place::new();
    place.picture("gt.png", 96, 64, 100);
    place.good(&format!(
        "simulate gt.png --transfer linear --camera ideal {SIZE} --readouts 255 --exposure 20000 -o s"
    ));
    let line = "evaluate s.dat --clear gt.png --window 201 --json";
    let told = place.good(line).events().pop().unwrap();
    assert_eq!(
        (&told["clear"]["transfer"], &told["clear"]["transfer_from"]),
        (&"linear".into(), &"the sidecar".into())
    );
    // An integrator counted over 201 readouts is off by less than 1/201 in its rate: 40 dB and better.
    assert!(psnr(&told, "tfp 201") > 40.0, "{told}");
    // The flag is above the sidecar, and a picture that the run did not begin with has the usual curve.
    let told = place.good(&format!("{line} --clear-transfer srgb")).events().pop().unwrap();
    assert_eq!(told["clear"]["transfer_from"], "--clear-transfer");
    std::fs::copy(place.path("gt.png"), place.path("other.png")).unwrap();
    let told = place.good("evaluate s.dat --clear other.png --json").events().pop().unwrap();
    assert_eq!(told["clear"]["transfer"], "srgb");
}

/// Integrators without noise: beside the picture of the other readouts, or the light itself, a count is sharp and a blur of it is not.
#[test]
fn a_blur_is_told_by_its_detail() {
    let place = Place::new();
    let (codes, _) = field(&place, 240);
    let fine: Vec<u8> =
        codes.iter().enumerate().map(|(p, c)| c / 2 + 60 * ((p * 7919) % 97 % 2) as u8).collect();
    image::GrayImage::from_raw(96, 64, fine).unwrap().save(place.path("fine.png")).unwrap();
    let line =
        "simulate fine.png --transfer linear --camera physical --width 96 --height 64 --readouts 300 -o f";
    place.good(line);
    for beside in ["--still", "--clear fine.png --clear-transfer linear"] {
        let told = place.good(&format!("evaluate f.dat {beside} --window 41 --json")).events().pop().unwrap();
        let of = |name: &str, key: &str| named(&told, name)["marks"][key].as_f64().unwrap();
        let [sharp, soft] = ["tfp 41", "tfp 41 blurred"].map(|name| of(name, "detail_slope"));
        assert!((sharp - 1.0).abs() < 0.05 && soft < 0.5, "{beside}: {sharp} {soft}");
        let [count, span] = ["tfp 41", "span 41"].map(|name| of(name, "high_pass_noise"));
        // Beside the light itself the 2 % by which pixels differ count as well.
        assert!(span < 0.8 * count, "{beside}: {count} {span}");
        assert!(of("span 41", "aligned_psnr_db") > of("tfp 41 blurred", "aligned_psnr_db"), "{told}");
    }
    let text = place.good("evaluate f.dat --still").stdout;
    assert!(text.contains("still scene: ") && text.contains("beside the truth"), "{text}");
    place.refused("evaluate f.dat --still --at 3", 2, &["--at"]);
    place.refused("evaluate f.dat --still --clear fine.png", 2, &["--clear"]);
}

#[test]
fn tfi_at_the_ends_of_a_stream_is_not_measurable() {
    let place = Place::new();
    field(&place, 120);
    let flags = "--clear gt.png --full 0.6 --clear-transfer linear";
    for at in [0, 2, 117, 119] {
        let told = evaluate(&place, &format!("{flags} --at {at}"));
        let tfi = named(&told, "tfi");
        assert_eq!(tfi["measurable"], false, "{at}");
        assert!(
            tfi.get("marks").is_none() && tfi["reason"].as_str().unwrap().contains("6144 pixels"),
            "{tfi}"
        );
        let text = place.good(&format!("evaluate s.dat {SIZE} {flags} --at {at}")).stdout;
        assert!(text.contains("not measurable here"), "{text}");
    }
    let told = evaluate(&place, flags);
    assert!(psnr(&told, "tfi") > 20.0, "{told}");
    let note = named(&evaluate(&place, "--window 301"), "tfp 301")["note"].clone();
    assert_eq!(note, "the stream holds 120 of the 301 readouts");
    let ran = place.good(&format!("reconstruct s.dat {SIZE} --method tfi --every 20 -o tfi.npy --json"));
    assert_eq!(ran.events().pop().unwrap()["not_measurable"], serde_json::json!([]));
    let ran = place.good(&format!("reconstruct s.dat {SIZE} --method tfi --at 119 -o end.png"));
    assert!(ran.stderr.contains("readout 119 not to be trusted"), "{}", ran.stderr);
}

/// Six readouts close hardly an interval of a street; a table of means must not hold what is left.
#[test]
fn a_set_averages_no_tfi_that_it_cannot_measure() {
    let place = Place::new();
    place.good("dataset --kind tiny --sequences 2 --images 6 --label-every 0 --width 64 --height 40 -o set");
    let text = place.good("evaluate set --window 5").stdout;
    assert_eq!(text.matches("tfi            not measurable in any of them").count(), 2, "{text}");
    assert!(text.contains("span 5"), "{text}");
}

fn no_word_but_numbers(ran: &Ran) {
    let text = ran.stdout.to_lowercase();
    for word in ["nan", "inf", "null"] {
        assert!(!text.contains(word), "{}", ran.stdout);
    }
}

/// One readout, nothing but silence, nothing but spikes, silence for longer than is searched, fewer pixels than
/// an estimate of noise needs.
#[test]
fn whatever_the_stream_all_figures_are_finite() {
    let frame = PIXELS / 8;
    let streams = [("one", 1, 0x55), ("dark", 50, 0), ("all", 50, 0xff), ("long", 700, 0), ("two", 2, 0xff)];
    let place = Place::new();
    place.picture("white.png", 96, 64, 255);
    for (name, readouts, byte) in streams {
        place.write(&format!("{name}.dat"), vec![byte; frame * readouts]);
        for more in [
            "",
            "--clear white.png --full 1 --clear-transfer linear",
            "--window 1 --at 0",
            "--window 4294967295",
        ] {
            for json in ["", "--json"] {
                no_word_but_numbers(&place.good(&format!("evaluate {name}.dat {SIZE} {more} {json}")));
            }
        }
        for method in ["tfp", "span", "tfi", "isi"] {
            let line = format!("reconstruct {name}.dat {SIZE} --method {method} --force --json -o");
            no_word_but_numbers(&place.good(&format!("{line} p.png")));
            place.good(&format!("{line} p.npy --window 4294967295"));
            let npy = place.read("p.npy");
            let values = npy[npy.len() - 4 * PIXELS..].chunks_exact(4);
            assert!(values.map(|b| f32::from_le_bytes(b.try_into().unwrap())).all(f32::is_finite), "{line}");
        }
    }
    // Equal pictures differ by less than can be said.
    let told = place.good(&format!("evaluate all.dat {SIZE} --clear white.png --full 1 --json")).events();
    assert_eq!(named(&told[0], "span 33")["marks"]["psnr_db_above"], 144.5);
    place.write("small.dat", vec![0x5a; 2 * 50]);
    no_word_but_numbers(&place.good("evaluate small.dat --width 8 --height 2 --json"));
    place.write("none.dat", b"");
    assert_ne!(place.run(&format!("evaluate none.dat {SIZE}")).code, 0);
}

/// The fourth field of the sheet is TFI of the noisy stream, where there is no clean one.
#[test]
fn the_first_look_shows_only_what_can_be_made() {
    let place = Place::new();
    place.picture("grey.png", 96, 64, 120);
    let mut seen = [3, 300].map(|readouts| {
        place.good(&format!("simulate grey.png {SIZE} --readouts {readouts} --force -o a"));
        let sheet = image::open(place.path("a.png")).unwrap().into_luma8();
        let (w, h) = sheet.dimensions();
        (h / 2..h)
            .flat_map(|y| (w / 2..w).map(move |x| (x, y)))
            .filter(|(x, y)| sheet.get_pixel(*x, *y).0[0] != 24)
            .count()
    });
    seen.sort_unstable();
    assert!(seen[0] < 96 && seen[1] > PIXELS / 2, "{seen:?}");
}

/// A drifting scene with a clear image at every 40th readout, of the run and its sidecar.
fn drive(place: &Place) {
    place.good("simulate --camera physical --width 96 --height 64 --readouts 200 --images-every 40 -o run");
}

fn moments(told: &[Value]) -> Vec<&Value> {
    told.iter().filter(|event| event["event"] == "moment").collect()
}

const AGAINST_LIGHT: &str = "evaluate s.dat --width 96 --height 64 --clear gt.png --clear-transfer linear --full 0.6 --window 41 --json";

/// What is told of every 60th of 240 readouts.
fn four_moments(place: &Place) -> Vec<Value> {
    field(place, 240);
    place.good(&format!("{AGAINST_LIGHT} --every 60")).events()
}

#[test]
fn every_moment_is_told_as_it_is_alone() {
    let place = Place::new();
    let told = four_moments(&place);
    let all = moments(&told);
    let at: Vec<_> = all.iter().map(|moment| moment["readout"].as_u64().unwrap()).collect();
    assert_eq!(at, [30, 90, 150, 210]);
    for moment in all {
        let alone =
            place.good(&format!("{AGAINST_LIGHT} --at {}", moment["readout"])).events().pop().unwrap();
        assert_eq!(moment["pictures"], alone["pictures"]);
    }
}

#[test]
fn the_means_of_moments_are_their_means() {
    let place = Place::new();
    let told = four_moments(&place);
    let all = moments(&told);
    let means = told.last().unwrap();
    for name in ["tfp 41", "tfp 41 blurred", "span 41", "tfi", "clear image"] {
        for key in ["psnr_db", "ssim", "detail_slope", "high_pass_noise"] {
            let values: Vec<f64> =
                all.iter().filter_map(|moment| named(moment, name)["marks"][key].as_f64()).collect();
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            let of = named(means, name)["marks"][key].as_f64();
            assert!(values.is_empty() == of.is_none(), "{name} {key}");
            assert!(of.is_none_or(|of| (of - mean).abs() < 1e-9), "{name} {key}: {of:?} for {mean}");
        }
    }
}

#[test]
fn images_named_by_their_readouts_say_where_to_look() {
    let place = Place::new();
    drive(&place);
    let told = place.good("evaluate run.dat --clear run.images --window 41 --json").events();
    let all = moments(&told);
    let at: Vec<_> = all.iter().map(|moment| moment["readout"].as_u64().unwrap()).collect();
    assert_eq!(at, [40, 80, 120, 160]);
    for moment in all {
        let at = moment["readout"].as_u64().unwrap();
        let line = format!("evaluate run.dat --clear run.images/{at:06}.png --at {at} --window 41 --json");
        assert_eq!(moment["pictures"], place.good(&line).events().pop().unwrap()["pictures"]);
    }
    let text = place.good("evaluate run.dat --clear run.images --window 41").stdout;
    assert!(text.contains("means over 4 readouts, 40 to 160"), "{text}");
    assert!(text.contains("left out: 1 of 5, whose windows reach beyond"), "{text}");
}

#[test]
fn only_the_kinds_that_are_asked_for_are_made() {
    let place = Place::new();
    field(&place, 120);
    let told = evaluate(&place, "--method span --method tfi --window 21");
    let names: Vec<_> = told["pictures"].as_array().unwrap().iter().map(|p| p["picture"].clone()).collect();
    assert_eq!(names, ["span 21", "tfi"]);
}

#[test]
fn moments_that_cannot_be_are_refused() {
    let place = Place::new();
    drive(&place);
    std::fs::create_dir(place.path("none")).unwrap();
    place.refused("evaluate run.dat --clear none", 4, &["none", "000100.png"]);
    place.refused("evaluate run.dat --clear run.images --every 40", 2, &["--every", "run.images"]);
    place.refused("evaluate run.dat --clear run.images --at 40", 2, &["--at", "run.images"]);
    place.refused("evaluate run.dat --every 40 --at 3", 2, &["--at"]);
    place.write("dark.dat", vec![0; 200 * PIXELS / 8]);
    let line = format!("evaluate dark.dat {SIZE} --still --every 40 --window 21");
    place.refused(&line, 4, &["dark.dat", "without detail"]);
    place.refused("evaluate run.dat --every 300 --window 401", 4, &["run.dat", "--window"]);
    std::fs::copy(place.path("run.images/000040.png"), place.path("run.images/40.png")).unwrap();
    place.refused("evaluate run.dat --clear run.images", 4, &["two images of readout 40"]);
    std::fs::rename(place.path("run.images/40.png"), place.path("run.images/900.png")).unwrap();
    place.refused("evaluate run.dat --clear run.images", 4, &["900", "200"]);
}
