//! Unusual streams, unusual light and unusual recording sets.

use super::super::program_support::{TestFolder, npy_f32};

/// An unusual stream: its size, its number of readouts, and a function that returns whether a pixel fires at a readout.
pub(crate) struct OddStream {
    pub name: &'static str,
    pub width: usize,
    pub height: usize,
    readouts: usize,
    fires: fn(usize, usize) -> bool,
}

const fn odd_stream(
    name: &'static str,
    [width, height, readouts]: [usize; 3],
    fires: fn(usize, usize) -> bool,
) -> OddStream {
    OddStream { name, width, height, readouts, fires }
}

pub(crate) const ODD_STREAMS: [OddStream; 10] = [
    odd_stream("one_readout", [16, 12, 1], |p, _| p % 5 == 0),
    odd_stream("two_readouts", [16, 12, 2], |p, t| (p + t) % 3 == 0),
    odd_stream("dark", [16, 12, 300], |_, _| false),
    odd_stream("saturated", [16, 12, 300], |_, _| true),
    odd_stream("one_pixel", [1, 1, 300], |_, t| t % 7 == 3),
    odd_stream("one_row", [64, 1, 300], |p, t| (p + t) % 6 == 0),
    odd_stream("one_column", [1, 48, 300], |p, t| (7 * p + t) % 6 == 0),
    odd_stream("one_spike", [16, 12, 300], |p, t| p == 17 && t == 4),
    odd_stream("all_together", [16, 12, 300], |_, t| t % 4 == 2),
    odd_stream("half_dead_half_saturated", [16, 12, 300], |p, _| p % 16 < 8),
];

impl OddStream {
    /// Returns the bits of the stream with the top row first. Each readout is padded to whole bytes.
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

    /// Creates a folder with the stream, a recording set that lists the stream four times, and a reference image of the
    /// same size.
    pub(crate) fn place(&self) -> TestFolder {
        let place = TestFolder::new();
        place.write("odd.dat", self.bytes());
        place.write("flat.npy", npy_f32([1, self.height, self.width], &vec![0.2; self.width * self.height]));
        place.picture("reference.png", self.width as u32, self.height as u32, 128);
        let recording = |light: f64| {
            format!("[[recording]]\nfile = \"odd.dat\"\nlayout = \"dat-top\"\nlight = {light:?}\n")
        };
        let set: String = [0.0, 0.1, 0.3, 0.6].map(recording).concat();
        let size = format!("width = {}\nheight = {}\nreadout_hz = 20000.0\n", self.width, self.height);
        place.write("set.toml", size + &set);
        place
    }
}

pub(crate) type OddLight = (&'static str, [usize; 3], fn(usize) -> f32);

/// Unusual light as an array of f32: name; frames, height and width; and a function of the array index.
pub(crate) const ODD_LIGHT: [OddLight; 10] = [
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

/// A recording set with unusual recordings: its name, the replaced files with the byte that fills them, and whether
/// `calibrate` still returns a camera.
pub(crate) type OddRecording = (&'static str, &'static [(&'static str, u8)], bool);

pub(crate) const ODD_RECORDINGS: [OddRecording; 4] = [
    ("as_recorded", &[], true),
    ("dark_without_a_spike", &[("dark.dat", 0x00)], true),
    ("brightest_saturated", &[("flat_9000.dat", 0xff)], true),
    ("half_of_the_columns_fire", &[("flat_6000.dat", 0x55)], false),
];

/// Creates a folder with a small recording set. Some of its recordings are replaced.
pub(crate) fn place_with_odd_recording((_, files, _): OddRecording) -> TestFolder {
    let place = TestFolder::new();
    place.run_ok("record physical -o recorded --width 16 --height 12 --readouts 1500");
    for (name, byte) in files {
        let name = format!("recorded/{name}");
        let length = place.read(&name).len();
        place.write(&name, vec![*byte; length]);
    }
    place
}
