//! Every command on odd inputs: whatever it says or leaves holds finite numbers only.
#![cfg(feature = "cli")]

mod finite;
mod program_support;

use program_support::{Place, npy_f32};

/// A stream of which something is odd: size, readouts, and whether a pixel fires at a readout.
struct Odd {
    name: &'static str,
    width: usize,
    height: usize,
    readouts: usize,
    fires: fn(usize, usize) -> bool,
}

const fn odd(
    name: &'static str,
    [width, height, readouts]: [usize; 3],
    fires: fn(usize, usize) -> bool,
) -> Odd {
    Odd { name, width, height, readouts, fires }
}

const ODD: [Odd; 10] = [
    odd("one_readout", [16, 12, 1], |p, _| p % 5 == 0),
    odd("two_readouts", [16, 12, 2], |p, t| (p + t) % 3 == 0),
    odd("dark", [16, 12, 300], |_, _| false),
    odd("saturated", [16, 12, 300], |_, _| true),
    odd("one_pixel", [1, 1, 300], |_, t| t % 7 == 3),
    odd("one_row", [64, 1, 300], |p, t| (p + t) % 6 == 0),
    odd("one_column", [1, 48, 300], |p, t| (7 * p + t) % 6 == 0),
    odd("one_spike", [16, 12, 300], |p, t| p == 17 && t == 4),
    odd("all_together", [16, 12, 300], |_, t| t % 4 == 2),
    odd("half_dead_half_saturated", [16, 12, 300], |p, _| p % 16 < 8),
];

impl Odd {
    /// The bits, the upper row first, each readout padded to whole bytes.
    fn bytes(&self) -> Vec<u8> {
        let pixels = self.width * self.height;
        let mut bytes = vec![0; pixels.div_ceil(8) * self.readouts];
        for t in 0..self.readouts {
            for p in (0..pixels).filter(|p| (self.fires)(*p, t)) {
                bytes[t * pixels.div_ceil(8) + p / 8] |= 1 << (p % 8);
            }
        }
        bytes
    }

    /// A place with the stream, a set that names it four times, and a clear image of its size.
    fn place(&self) -> Place {
        let place = Place::new();
        place.write("odd.dat", self.bytes());
        place.write("flat.npy", npy_f32([1, self.height, self.width], &vec![0.2; self.width * self.height]));
        place.picture("clear.png", self.width as u32, self.height as u32, 128);
        let recording = |light: f64| {
            format!("[[recording]]\nfile = \"odd.dat\"\nlayout = \"dat-top\"\nlight = {light:?}\n")
        };
        let set: String = [0.0, 0.1, 0.3, 0.6].map(recording).concat();
        let size = format!("width = {}\nheight = {}\nreadout_hz = 20000.0\n", self.width, self.height);
        place.write("set.toml", size + &set);
        place
    }
}

/// Runs commands for people and for programs; what is wrong in what they say and leave.
fn wrong(place: &Place, commands: &[String]) -> Vec<String> {
    let mut wrong = Vec::new();
    for command in commands {
        for line in [command.clone(), format!("{command} --json")] {
            let ran = place.run(&line);
            assert!((0..=9).contains(&ran.code), "{line}: exit {}", ran.code);
            let json = line.ends_with("--json");
            let said = if json { finite::json_text(&ran.stdout) } else { finite::text(&ran.stdout) };
            wrong.extend(said.into_iter().chain(finite::text(&ran.stderr)).map(|f| format!("{line}: {f}")));
        }
    }
    wrong.extend(finite::folder(&place.path("")));
    wrong
}

fn all_finite(wrong: &[String]) {
    assert!(wrong.is_empty(), "{} places, the first: {:#?}", wrong.len(), &wrong[..wrong.len().min(40)]);
}

#[test]
#[ignore = "measure, labels and sidecars still leave numbers that are not finite"]
fn of_odd_streams_every_reader_says_finite_numbers() {
    let mut found = Vec::new();
    for odd in &ODD {
        let place = odd.place();
        let size = format!("--width {} --height {} --layout dat-top", odd.width, odd.height);
        let commands = [
            format!("inspect odd.dat {size} --png look.png --force"),
            format!("convert odd.dat out.npy {size} --force"),
            format!("measure odd.dat {size} --report measure.html --force"),
            format!("reconstruct odd.dat -o tfp.npy {size} --force"),
            format!("reconstruct odd.dat -o tfi.npy {size} --method tfi --force"),
            format!("reconstruct odd.dat -o isi.npy {size} --method isi --force"),
            format!("evaluate odd.dat {size}"),
            format!("evaluate odd.dat {size} --clear clear.png --full 0.6"),
            format!("compare odd.dat {size} --longest 50 -o compared --force"),
        ];
        found.extend(wrong(&place, &commands).into_iter().map(|w| format!("{}: {w}", odd.name)));
    }
    all_finite(&found);
}

#[test]
fn of_sets_of_odd_streams_calibration_comparison_and_diagnosis_say_finite_numbers() {
    let mut found = Vec::new();
    for odd in &ODD {
        let place = odd.place();
        let commands = [
            "calibrate set.toml -o calibrated --snee --force",
            "compare set.toml ideal physical --longest 50 -o compared --force",
            "diagnose set.toml -o diagnosed --camera physical --force",
        ];
        let commands = commands.map(str::to_owned);
        found.extend(wrong(&place, &commands).into_iter().map(|w| format!("{}: {w}", odd.name)));
    }
    all_finite(&found);
}

type Light = (&'static str, [usize; 3], fn(usize) -> f32);

/// Light of which something is odd, as an array of f32: frames, height, width, and a value.
const ODD_LIGHT: [Light; 10] = [
    ("black", [3, 12, 16], |_| 0.0),
    ("white", [3, 12, 16], |_| 1.0),
    ("beyond", [3, 12, 16], |_| 1.9),
    ("least", [3, 12, 16], |_| f32::MIN_POSITIVE / 1024.0),
    ("one_pixel", [3, 1, 1], |_| 0.4),
    ("one_row", [3, 1, 64], |i| (i % 64) as f32 / 64.0),
    ("one_column", [3, 48, 1], |i| (i % 48) as f32 / 48.0),
    ("one_frame", [1, 12, 16], |i| (i % 16) as f32 / 16.0),
    ("blinking", [40, 12, 16], |i| ((i / 192) % 2) as f32),
    ("checks", [3, 12, 16], |i| (i % 2) as f32),
];

#[test]
#[ignore = "measure, labels and sidecars still leave numbers that are not finite"]
fn of_odd_light_every_maker_leaves_finite_numbers() {
    let mut found = Vec::new();
    for (name, shape, value) in ODD_LIGHT {
        let place = Place::new();
        let [frames, height, width] = shape;
        let values: Vec<f32> = (0..frames * height * width).map(value).collect();
        std::fs::create_dir(place.path("in")).unwrap();
        place.write("in/light.npy", npy_f32(shape, &values));
        let size = format!("--width {width} --height {height}");
        let commands = [
            format!(
                "simulate in/light.npy -o run --readouts-per-frame 7 {size} --clean --insertion linear --force"
            ),
            format!("simulate in/light.npy -o flow --readouts-per-frame 3 {size} --insertion flow --force"),
            format!(
                "simulate in/light.npy -o one --readouts-per-frame 7 --readouts 1 {size} --camera scsim-code --force"
            ),
            "verify run.json".to_owned(),
            "evaluate run.dat".to_owned(),
            "measure run.dat".to_owned(),
            "inspect run.dat --digest".to_owned(),
        ];
        found.extend(wrong(&place, &commands).into_iter().map(|w| format!("{name}: {w}")));
        let place = Place::new();
        std::fs::create_dir(place.path("in")).unwrap();
        place.write("in/light.npy", npy_f32(shape, &values));
        let commands = [
            format!("dataset --from in -o set {size} --readouts-per-frame 3 --test-share 0"),
            "evaluate set".to_owned(),
        ];
        found.extend(wrong(&place, &commands).into_iter().map(|w| format!("{name}: {w}")));
    }
    all_finite(&found);
}

#[test]
#[ignore = "measure, labels and sidecars still leave numbers that are not finite"]
fn what_is_drawn_recorded_and_printed_holds_finite_numbers() {
    let place = Place::new();
    let commands = [
        "record physical -o recorded --width 8 --height 6 --readouts 300 --force",
        "record scsim-code -o grey --protocol grey --width 8 --height 6 --readouts 20 --force",
        "record physical -o planned --plan",
        "scene -o street --width 32 --height 20 --frames 2 --lighting night --force",
        "dataset -o drives --sequences 1 --images 3 --width 32 --height 20 --label-every 1 --npy --exr --kitti --test-share 0",
        "simulate --source objects -o objects --width 32 --height 20 --readouts 10 --force",
        "simulate --source chart -o chart --width 32 --height 20 --readouts 10 --force",
        "evaluate drives",
        "preset list",
        "preset show physical",
        "effects",
        "effects leak",
        "calibrate recorded/recordings.toml -o calibrated --force",
    ];
    all_finite(&wrong(&place, &commands.map(str::to_owned)));
}

#[test]
fn what_is_not_finite_is_seen() {
    assert_eq!(finite::text("rate NaN +- 1\nrate 1 +- -inf\ninformation").len(), 2);
    assert_eq!(finite::json_text("{\"a\": [1, null], \"b\": \"inf\"}").len(), 2);
    assert_eq!(finite::npy(&npy_f32([1, 1, 2], &[1.0, f32::NAN])).len(), 1);
}
