//! Shared code of the fuzz targets: temporary folders, valid archives and suites, and slow but simple oracles of the
//! stream formats.

use std::path::PathBuf;

use spikelane::spikes::bit;
use spikelane::{ErrorKind, Geometry};
use spikelane_benchmark::generated::{self, GenerateOptions, GeneratedSuite};
use spikelane_benchmark::suite::Suite;
use spikelane_io::formats::{Layout, StreamReader};

/// Returns the folder for the files of a target. No other process uses this folder.
pub fn temp_folder(name: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("spikelane-fuzz-{name}-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a temporary folder");
    folder
}

/// Reads a small geometry from the first two bytes, and returns it with the other bytes. The geometry is small because
/// then a few bytes contain a frame.
pub fn geometry(data: &[u8]) -> Option<(Geometry, &[u8])> {
    let (&[w, h], rest) = data.split_first_chunk()?;
    let geometry = Geometry::new(u32::from(w % 80) + 1, u32::from(h % 16) + 1).ok()?;
    Some((geometry, rest))
}

/// Checks that an error has a message. Its kind must be one that damaged bytes can cause, `Input` or `Usage`.
pub fn check_error(error: &spikelane::Error) {
    assert!(matches!(error.kind(), ErrorKind::Input | ErrorKind::Usage), "{:?}: {error}", error.kind());
    assert!(error.to_string().len() > 10);
}

/// Decodes every frame, compares each pixel with `pixel(readout, row, col)`, and checks that padding bits are zero.
///
/// Also reads all frames in one call and each frame in its own call, and checks that the frames are equal.
pub fn check_pixels(reader: &StreamReader, pixel: impl Fn(usize, usize, usize) -> bool) {
    let g = reader.geometry();
    let size = g.frame_bytes();
    let mut all = vec![0xa5; reader.readouts() * size];
    reader.read_frames(0, &mut all).unwrap();
    let mut frame = vec![0x5a; size];
    for (t, together) in all.chunks_exact(size).enumerate() {
        reader.read_frame(t, &mut frame).unwrap();
        assert_eq!(frame, together);
        for p in 0..size * 8 {
            let expected = p < g.pixels() && pixel(t, p / g.width(), p % g.width());
            assert_eq!(bit(&frame, p), expected, "readout {t}, pixel {p} of {g}");
        }
    }
}

/// Encodes every decoded frame, decodes the result, and compares it with the frame.
///
/// The encoded bytes must also equal the bytes of the file. The comparison uses only the bits that are set in `mask`.
pub fn check_encoding(reader: &StreamReader, layout: Layout, file: &[u8], mask: impl Fn(usize) -> u8) {
    let g = reader.geometry();
    let frame_bytes = layout.frame_bytes(g).unwrap();
    let mut packed = vec![0; g.frame_bytes()];
    let mut again = vec![0xa5; frame_bytes];
    let mut back = vec![0x5a; g.frame_bytes()];
    for (t, original) in file.chunks_exact(frame_bytes).enumerate() {
        reader.read_frame(t, &mut packed).unwrap();
        layout.encode_frame(g, &packed, &mut again).unwrap();
        for (i, (a, b)) in again.iter().zip(original).enumerate() {
            assert_eq!(a & mask(i), b & mask(i), "byte {i} of readout {t}");
        }
        layout.decode_frame(g, &again, &mut back).unwrap();
        assert_eq!(packed, back);
    }
}

/// Returns an `.npy` file of the type `descr`, such as `|u1`, with the shape `shape`, such as `(2, 3)`.
pub fn npy(descr: &str, shape: &str, body: &[u8]) -> Vec<u8> {
    let text = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}\n");
    let mut array = b"\x93NUMPY\x01\x00".to_vec();
    array.extend((text.len() as u16).to_le_bytes());
    array.extend(text.as_bytes());
    array.extend(body);
    array
}

/// Returns a zip archive of stored files: for each file a local header and the bytes, then the directory and the end
/// record.
pub fn zip_archive(files: &[(&str, &[u8])]) -> Vec<u8> {
    let (mut zip, mut directory) = (Vec::new(), Vec::new());
    for (name, bytes) in files {
        let sizes = (bytes.len() as u32).to_le_bytes();
        let mut common = vec![20, 0, 0, 0, 0, 0, 0, 0, 0, 0];
        common.extend(crc32(bytes).to_le_bytes());
        common.extend(sizes);
        common.extend(sizes);
        common.extend((name.len() as u16).to_le_bytes());
        let offset = zip.len() as u32;
        zip.extend(b"PK\x03\x04");
        zip.extend(&common);
        zip.extend([0, 0]);
        zip.extend(name.as_bytes());
        zip.extend(*bytes);
        directory.extend(b"PK\x01\x02\x14\x00");
        directory.extend(&common);
        directory.extend([0; 12]);
        directory.extend(offset.to_le_bytes());
        directory.extend(name.as_bytes());
    }
    let (start, count) = (zip.len() as u32, files.len() as u16);
    zip.extend(&directory);
    zip.extend(b"PK\x05\x06\x00\x00\x00\x00");
    zip.extend(count.to_le_bytes());
    zip.extend(count.to_le_bytes());
    zip.extend((directory.len() as u32).to_le_bytes());
    zip.extend(start.to_le_bytes());
    zip.extend([0, 0]);
    zip
}

fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0, |crc, &b| {
        (0..8).fold(crc ^ u32::from(b), |c, _| c >> 1 ^ 0xedb8_8320 & (c & 1).wrapping_neg())
    })
}

/// Returns the text of a suite with one sequence of 64x48 pixels. `task` is the name of a task, and `metrics` is a TOML
/// array of metrics of the task.
pub fn suite_text(task: &str, metrics: &str) -> String {
    format!(
        r#"format_version = 1
name = "tiny"
version = "0.1.0"
description = "Does the program read hostile files?"
scene_version = 3
release = "0.1.0"
task = "{task}"
metrics = {metrics}
[dataset.scenes]
images_per_scene = 41
label_every = 10
samples = 4
[dataset.images]
every = 20
format = "f32"
[dataset.camera]
preset = "physical"
sensor = {{ thresholds_at_full_scale = 0.6, width = 64, height = 48 }}
[[splits]]
name = "test"
seed = 7001
sequences = 1
"#
    )
}

/// Generates the suite of [`suite_text`] in a new folder `name`.
pub fn generate_suite(name: &str, task: &str, metrics: &str) -> GeneratedSuite {
    let output = temp_folder(name);
    let suite = Suite::parse(&suite_text(task, metrics)).expect("a valid suite");
    let options = GenerateOptions { output: output.clone(), splits: Vec::new(), threads: 1, resume: true };
    generated::generate(&suite, &options, &mut |_| Ok(())).expect("a generated suite");
    GeneratedSuite::open(&output).expect("a generated suite")
}

/// Checks that an error has a message and a kind that a damaged file can cause.
pub fn check_file_error(error: &spikelane::Error) {
    let kinds = [ErrorKind::Config, ErrorKind::Input, ErrorKind::Io, ErrorKind::Corrupt, ErrorKind::Usage];
    assert!(kinds.contains(&error.kind()), "{:?}: {error}", error.kind());
    assert!(error.to_string().len() > 10);
}
