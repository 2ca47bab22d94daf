//! Streams, light and recording sets of which something is odd.

use super::super::program_support::{Place, npy_f32};

/// A stream of which something is odd: size, readouts, and whether a pixel fires at a readout.
pub(crate) struct Odd {
    pub name: &'static str,
    pub width: usize,
    pub height: usize,
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

pub(crate) const ODD: [Odd; 10] = [
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
    pub(crate) fn place(&self) -> Place {
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

pub(crate) type Light = (&'static str, [usize; 3], fn(usize) -> f32);

/// Light of which something is odd, as an array of f32: frames, height, width, and a value.
pub(crate) const ODD_LIGHT: [Light; 10] = [
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

/// A recording of a set that is replaced by one of which something is odd: its file, and every byte of it; and whether the set still gives a
/// camera.
pub(crate) type OddRecording = (&'static str, &'static [(&'static str, u8)], bool);

pub(crate) const ODD_RECORDINGS: [OddRecording; 4] = [
    ("as_recorded", &[], true),
    ("dark_without_a_spike", &[("dark.dat", 0x00)], true),
    ("brightest_saturated", &[("flat_9000.dat", 0xff)], true),
    ("half_of_the_columns_fire", &[("flat_6000.dat", 0x55)], false),
];

/// A place with a small recorded set, one recording of it replaced.
pub(crate) fn recorded((_, files, _): OddRecording) -> Place {
    let place = Place::new();
    place.good("record physical -o recorded --width 16 --height 12 --readouts 1500");
    for (name, byte) in files {
        let name = format!("recorded/{name}");
        let length = place.read(&name).len();
        place.write(&name, vec![*byte; length]);
    }
    place
}
