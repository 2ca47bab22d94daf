//! Shared code of the fuzz targets: a temporary folder, and slow but simple oracles of the stream formats.

use std::path::PathBuf;

use spikelane::spikes::bit;
use spikelane::{ErrorKind, Geometry};
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
