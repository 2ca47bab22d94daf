//! Tests of `.npz` archives that have the structure of published data sets.

use std::io::{Cursor, Write as _};

use spikelane::spikes::bit;
use spikelane::unstable::npy::{Element, to_bytes};
use spikelane::{ErrorKind, Geometry};
use spikelane_io::formats::{Layout, OpenOptions, StreamReader};

/// Returns an archive with one compressed `u8` array.
fn archive(name: &str, shape: &[u64], values: Vec<u8>) -> Vec<u8> {
    let mut zip = zip::ZipWriter::new(Cursor::new(Vec::new()));
    zip.start_file(format!("{name}.npy"), zip::write::SimpleFileOptions::default()).unwrap();
    zip.write_all(&to_bytes(Element::U8, shape, values.iter().map(|&v| [v])).unwrap()).unwrap();
    zip.finish().unwrap().into_inner()
}

fn fires(t: usize, row: usize, col: usize) -> bool {
    (t * 7 + row * 5 + col * 3) % 11 < 4
}

fn size() -> Geometry {
    Geometry::new(13, 5).unwrap()
}

fn check(bytes: Vec<u8>, size: Option<Geometry>) {
    let reader = StreamReader::from_bytes("a.npz", bytes, None, size).unwrap();
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
    check(archive("spk", &[6, 5, 13], values.clone().collect()), None);
    check(archive("spk", &[6, 5, 13], values.collect()), Some(size()));
}

#[test]
fn the_size_decides_the_order_of_axes() {
    let last: Vec<u8> = (0..6 * 65).map(|i| fires(i % 6, i / 6 / 13, i / 6 % 13).into()).collect();
    let first: Vec<u8> = (0..6 * 65).map(|i| fires(i / 65, i % 65 / 13, i % 13).into()).collect();
    for key in ["arr_0", "spikes", "spk"] {
        check(archive(key, &[5, 13, 6], last.clone()), Some(size()));
        check(archive(key, &[6, 5, 13], first.clone()), Some(size()));
    }
}

#[test]
fn without_a_size_both_axis_orders_are_named() {
    for key in ["arr_0", "spikes"] {
        let error = StreamReader::from_bytes("a.npz", archive(key, &[6, 5, 13], vec![0; 390]), None, None)
            .unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Usage);
        for text in ["6 readouts of 13x5", "13 readouts of 5x6", "set `width` and `height`"] {
            assert!(error.to_string().contains(text), "{error}");
        }
    }
    // If all three axes have the same length, the geometry matches both axis orders. Then only the name of the layout
    // determines the order.
    let cube = archive("arr_0", &[4, 4, 4], vec![1; 64]);
    let size = Geometry::new(4, 4).ok();
    let error = StreamReader::from_bytes("a.npz", cube.clone(), None, size).unwrap_err();
    assert!(error.to_string().contains("set `layout` to npy-bytes"), "{error}");
    assert_eq!(StreamReader::from_bytes("a.npz", cube, Some(Layout::NpyBytes), None).unwrap().readouts(), 4);
}

/// Returns an archive with several arrays.
fn arrays(all: &[(&str, &[u64], Vec<u8>)]) -> Vec<u8> {
    let mut zip = zip::ZipWriter::new(Cursor::new(Vec::new()));
    for (name, shape, values) in all {
        zip.start_file(format!("{name}.npy"), zip::write::SimpleFileOptions::default()).unwrap();
        zip.write_all(&to_bytes(Element::U8, shape, values.iter().map(|&v| [v])).unwrap()).unwrap();
    }
    zip.finish().unwrap().into_inner()
}

#[test]
fn a_key_chooses_among_arrays() {
    let values: Vec<u8> = (0..6 * 65).map(|i| fires(i / 65, i % 65 / 13, i % 13).into()).collect();
    let bytes = arrays(&[("noisy", &[6, 5, 13], vec![0; 390]), ("clean", &[6, 5, 13], values)]);
    let error = StreamReader::from_bytes("a.npz", bytes.clone(), None, Some(size())).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Usage);
    assert!(error.to_string().contains("noisy, clean") && error.to_string().contains("`key`"), "{error}");
    let opening = |key: &str| OpenOptions::default().with_key(Some(key.into())).with_geometry(Some(size()));
    let mut frame = vec![0; size().frame_bytes()];
    opening("clean").from_bytes("a.npz", bytes.clone()).unwrap().read_frame(0, &mut frame).unwrap();
    assert_eq!(bit(&frame, 0), fires(0, 0, 0));
    assert_eq!(opening("none").from_bytes("a.npz", bytes).unwrap_err().kind(), ErrorKind::Usage);
}

#[test]
fn eight_readouts_in_a_byte_are_unpacked() {
    // In RSIR archives, readout i of pixel p is bit i % 8 of byte (i / 8, p). This archive uses 11 of 16 readouts.
    let mut seq = vec![0; 2 * 65];
    for (t, p) in (0..11).flat_map(|t| (0..65).map(move |p| (t, p))) {
        seq[t / 8 * 65 + p] |= u8::from(fires(t, p / 13, p % 13)) << (t % 8);
    }
    let bytes = arrays(&[
        ("seq", &[2, 5, 13], seq.clone()),
        ("tag", &[5, 13], vec![0; 65]),
        ("length", &[], vec![11]),
    ]);
    let reader = StreamReader::from_bytes("a.npz", bytes, None, None).unwrap();
    assert_eq!((reader.readouts(), reader.geometry()), (11, size()));
    let mut frame = vec![0; size().frame_bytes()];
    for t in 0..11 {
        reader.read_frame(t, &mut frame).unwrap();
        assert!((0..65).all(|p| bit(&frame, p) == fires(t, p / 13, p % 13)), "{t}");
    }
    let bytes = arrays(&[("seq", &[2, 5, 13], seq), ("length", &[], vec![17])]);
    assert_eq!(StreamReader::from_bytes("a.npz", bytes, None, None).unwrap_err().kind(), ErrorKind::Input);
}

#[test]
fn other_arrays_other_values_and_cut_archives_are_refused() {
    let good = archive("spk", &[2, 1, 8], vec![1; 16]);
    for (bytes, text) in [
        (archive("spk", &[2, 1, 8], vec![2; 16]), "value 2"),
        (archive("arr_0", &[2, 1, 8], vec![2; 16]), "value 2"),
        (archive("spk", &[2, 8], vec![1; 16]), "(2, 8)"),
        (archive("spk", &[0, 1, 8], vec![]), "(0, 1, 8)"),
        (good[..good.len() - 30].to_vec(), "a.npz"),
    ] {
        let error = StreamReader::from_bytes("a.npz", bytes, Some(Layout::NpyBytes), None).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Input, "{error}");
        assert!(error.to_string().contains(text), "{error}");
    }
}

/// Flips each byte of the compressed array. The archive is then read, or rejected as damaged, and never counts as a fault of
/// the system.
#[test]
fn damage_in_a_compressed_array_is_an_error_of_the_input() {
    let values = (0..6 * 65).map(|i| u8::from(fires(i / 65, i % 65 / 13, i % 13))).collect();
    let bytes = archive("spk", &[6, 5, 13], values);
    let damaged = (30..bytes.len()).filter(|at| {
        let mut bytes = bytes.clone();
        bytes[*at] ^= 0x55;
        match StreamReader::from_bytes("a.npz", bytes, None, None) {
            Ok(_) => false,
            Err(e) => {
                assert!(matches!(e.kind(), ErrorKind::Input | ErrorKind::Usage), "byte {at}: {e}");
                true
            }
        }
    });
    assert!(damaged.count() > 50);
}
