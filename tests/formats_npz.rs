//! Archives as two data sets have them.
#![cfg(feature = "files")]

use std::io::{Cursor, Write as _};

use spikelane::formats::{Layout, Reader};
use spikelane::npy::{Element, to_bytes};
use spikelane::spikes::bit;
use spikelane::{Geometry, Kind};

/// An archive of one deflated array of `u8`.
fn archive(name: &str, shape: &[u64], values: Vec<u8>) -> Vec<u8> {
    let mut zip = zip::ZipWriter::new(Cursor::new(Vec::new()));
    zip.start_file(format!("{name}.npy"), zip::write::SimpleFileOptions::default()).unwrap();
    zip.write_all(&to_bytes(Element::U8, shape, values.iter().map(|&v| [v])).unwrap()).unwrap();
    zip.finish().unwrap().into_inner()
}

fn fires(t: usize, row: usize, col: usize) -> bool {
    (t * 7 + row * 5 + col * 3) % 11 < 4
}

fn check(bytes: Vec<u8>) {
    let reader = Reader::from_bytes("a.npz", bytes, None, None).unwrap();
    assert_eq!(reader.geometry(), Geometry::new(13, 5).unwrap());
    assert_eq!((reader.readouts(), reader.layout()), (6, Layout::NpyBytes));
    let mut frame = vec![0; reader.geometry().frame_bytes()];
    for t in 0..6 {
        reader.read_frame(t, &mut frame).unwrap();
        for p in 0..65 {
            assert_eq!(bit(&frame, p), fires(t, p / 13, p % 13), "{t} {p}");
        }
    }
}

#[test]
fn spk_has_readouts_first() {
    let values = (0..6 * 65).map(|i| fires(i / 65, i % 65 / 13, i % 13).into());
    check(archive("spk", &[6, 5, 13], values.collect()));
}

#[test]
fn arr_0_has_readouts_last() {
    let values = (0..6 * 65).map(|i| fires(i % 6, i / 6 / 13, i / 6 % 13).into());
    check(archive("arr_0", &[5, 13, 6], values.collect()));
}

#[test]
fn other_arrays_other_values_and_cut_archives_are_refused() {
    let good = archive("spk", &[2, 1, 8], vec![1; 16]);
    for (bytes, text) in [
        (archive("seq", &[2, 1, 8], vec![1; 16]), "seq"),
        (archive("spk", &[2, 1, 8], vec![2; 16]), "value 2"),
        (archive("arr_0", &[2, 1, 8], vec![2; 16]), "value 2"),
        (archive("spk", &[2, 8], vec![1; 16]), "[2, 8]"),
        (archive("spk", &[0, 1, 8], vec![]), "[0, 1, 8]"),
        (good[..good.len() - 30].to_vec(), "a.npz"),
    ] {
        let error = Reader::from_bytes("a.npz", bytes, None, None).unwrap_err();
        assert_eq!(error.kind(), Kind::Input, "{error}");
        assert!(error.to_string().contains(text), "{error}");
    }
}
