//! Tests of stream files. The tests cover round trips, rejected files, and files that remain after errors.

use std::fs;
use std::path::{Path, PathBuf};

use proptest::prelude::*;
use spikelane::spikes::{bit, set_bit};
use spikelane::{Error, ErrorKind, Geometry, Result};
use spikelane_io::formats::{
    Crop, GeometryOrigin, Layout, MissingFrames, OpenOptions, StreamReader, StreamWriter, convert,
    write_events,
};
use spikelane_io::storage::{Digest, write_small};
use tempfile::TempDir;

fn geometry(width: u32, height: u32) -> Geometry {
    Geometry::new(width, height).unwrap()
}

/// Returns `readouts` packed frames of pseudorandom spikes. The padding bits are zero.
fn stream(g: Geometry, readouts: usize, seed: u64) -> Vec<u8> {
    let mut state = seed | 1;
    let mut frames = vec![0; readouts * g.frame_bytes()];
    for frame in frames.chunks_exact_mut(g.frame_bytes()) {
        for p in 0..g.pixels() {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            if state >> 63 == 1 {
                set_bit(frame, p);
            }
        }
    }
    frames
}

fn write(path: &Path, layout: Layout, g: Geometry, packed: &[u8]) {
    let readouts = (packed.len() / g.frame_bytes()) as u64;
    let mut writer = StreamWriter::create(path, layout, g, readouts, false).unwrap();
    writer.write_frames(0, packed).unwrap();
    let done = writer.finish().unwrap();
    assert_eq!(done.digest, Digest::hash_bytes(&fs::read(path).unwrap()));
    assert_eq!(done.bytes, layout.file_bytes(g, readouts).unwrap());
    assert_eq!(done.path, path);
}

fn read(reader: &StreamReader) -> Vec<u8> {
    let mut packed = vec![0; reader.readouts() * reader.geometry().frame_bytes()];
    reader.read_frames(0, &mut packed).unwrap();
    packed
}

fn open(path: &Path, layout: Layout, g: Geometry) -> Result<StreamReader> {
    StreamReader::open(path, Some(layout), Some(g))
}

fn path(dir: &TempDir, name: &str) -> PathBuf {
    dir.path().join(name)
}

fn failure<T>(result: Result<T>) -> Error {
    result.err().expect("an error")
}

fn any_layout() -> impl Strategy<Value = Layout> {
    let all = Layout::ALL.into_iter().filter(|layout| layout.fixed_geometry().is_none());
    prop::sample::select(all.collect::<Vec<_>>())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn a_stream_comes_back_through_any_two_layouts(
        (a, b) in (any_layout(), any_layout()),
        (w, h) in (1u32..70, 1u32..12),
        readouts in 1usize..6,
        seed: u64,
    ) {
        let dir = TempDir::new().unwrap();
        let (g, n) = (geometry(w, h), readouts as u64);
        let packed = stream(g, readouts, seed);
        let paths = ["a", "b", "c"].map(|name| path(&dir, name));
        write(&paths[0], a, g, &packed);
        for (from, to, (la, lb)) in [(0, 1, (a, b)), (1, 2, (b, a))] {
            let reader = open(&paths[from], la, g).unwrap();
            let writer = StreamWriter::create(&paths[to], lb, g, n, false).unwrap();
            convert(&reader, 0..readouts, None, writer, |_| Ok(())).unwrap();
        }
        prop_assert_eq!(read(&open(&paths[1], b, g).unwrap()), packed);
        prop_assert_eq!(fs::read(&paths[0]).unwrap(), fs::read(&paths[2]).unwrap());
    }

    #[test]
    fn a_crop_of_a_range_holds_those_pixels(
        (layout, seed) in (any_layout(), any::<u64>()),
        (w, h) in (1usize..60, 1usize..12),
        cut in prop::array::uniform4(0.0..1.0f64),
    ) {
        let dir = TempDir::new().unwrap();
        let g = geometry(w as u32, h as u32);
        let readouts = 5;
        let packed = stream(g, readouts, seed);
        let (x, y) = ((cut[0] * w as f64) as usize, (cut[1] * h as f64) as usize);
        let width = 1 + (cut[2] * (w - x) as f64) as usize;
        let crop = Crop { row: y, col: x, width: width.min(w - x), height: h - y };
        let to = crop.geometry(g).unwrap();
        let range = (cut[3] * 4.0) as usize..5;
        write(&path(&dir, "a"), layout, g, &packed);
        let reader = open(&path(&dir, "a"), layout, g).unwrap();
        let out = path(&dir, "b");
        let writer =
            StreamWriter::create(&out, Layout::Dat, to, range.len() as u64, false).unwrap();
        convert(&reader, range.clone(), Some(crop), writer, |_| Ok(())).unwrap();
        let content = read(&open(&out, Layout::Dat, to).unwrap());
        for (i, t) in range.enumerate() {
            for (r, c) in (0..to.height()).flat_map(|r| (0..to.width()).map(move |c| (r, c))) {
                let old = &packed[t * g.frame_bytes()..];
                let new = &content[i * to.frame_bytes()..];
                prop_assert_eq!(bit(old, (y + r) * w + x + c), bit(new, r * to.width() + c));
            }
        }
    }
}

#[test]
fn camera_rows_come_back_through_files() {
    let dir = TempDir::new().unwrap();
    for (layout, g) in [(Layout::Rows416, geometry(400, 250)), (Layout::Rows1024, geometry(1000, 1000))] {
        let packed = stream(g, 3, 11);
        let path = path(&dir, layout.name());
        write(&path, layout, g, &packed);
        // The layout determines the geometry, so no geometry is given.
        let reader = StreamReader::open(&path, Some(layout), None).unwrap();
        assert_eq!(reader.geometry(), g);
        assert_eq!(reader.partial_frame_bytes(), (0, 0));
        assert!(read(&reader) == packed, "{layout}");
    }
}

#[test]
fn batches_of_any_size_make_the_same_file() {
    let dir = TempDir::new().unwrap();
    let g = geometry(400, 250);
    let packed = stream(g, 40, 3);
    write(&path(&dir, "whole"), Layout::Dat, g, &packed);
    let pieces = path(&dir, "pieces");
    let mut writer = StreamWriter::create(&pieces, Layout::Dat, g, 40, false).unwrap();
    let mut first = 0;
    for frames in [1, 2, 17, 20] {
        let bytes = &packed[first * 12_500..(first + frames) * 12_500];
        writer.write_frames(first as u64, bytes).unwrap();
        first += frames;
    }
    assert_eq!(writer.finish().unwrap().digest, Digest::hash_file(&path(&dir, "whole")).unwrap());
}

#[test]
fn a_recording_that_starts_mid_frame_is_synchronized() {
    let dir = TempDir::new().unwrap();
    let g = geometry(1000, 1000);
    let packed = stream(g, 3, 21);
    write(&path(&dir, "whole"), Layout::Rows1024, g, &packed);
    let bytes = fs::read(path(&dir, "whole")).unwrap();
    // The recordings start inside the first half row, at a half row, just before the end of a frame, and in the middle
    // of a frame.
    for lost in [16, 64, 127_936, 50_000] {
        let cut = bytes[lost..bytes.len() - 1000].to_vec();
        let reader = StreamReader::from_bytes("cut", cut, Some(Layout::Rows1024), None).unwrap();
        assert_eq!(reader.readouts(), 1);
        assert_eq!(reader.partial_frame_bytes(), (128_000 - lost, 127_000));
        assert!(read(&reader) == packed[125_000..250_000], "lost {lost}");
    }
}

#[test]
fn pixels_that_look_like_a_tag_do_not_mislead_the_frame_search() {
    let g = geometry(1000, 1000);
    // In every row, bits 112 to 127 have the value of the first tag. The first tag of the file is cut off, so the
    // search meets these bits before a real first tag.
    let mut packed = vec![0; 2 * 125_000];
    for row in packed.chunks_exact_mut(125) {
        row[14..16].copy_from_slice(&(500u16 << 4).to_le_bytes());
    }
    let mut bytes = vec![0; 2 * 128_000];
    let codec = spikelane_io::formats::Codec::new(Layout::Rows1024, g).unwrap();
    codec.encode(&packed, &mut bytes).unwrap();
    bytes.drain(..112);
    let reader = StreamReader::from_bytes("tags", bytes, Some(Layout::Rows1024), None).unwrap();
    assert_eq!(reader.partial_frame_bytes(), (127_888, 0));
    assert!(read(&reader) == packed[..125_000]);
}

#[test]
fn a_frame_that_lost_its_tags_is_an_empty_readout() {
    let g = geometry(1000, 1000);
    let mut bytes = vec![0; 2 * 128_000];
    let codec = spikelane_io::formats::Codec::new(Layout::Rows1024, g).unwrap();
    codec.encode(&vec![0; 250_000], &mut bytes).unwrap();
    bytes[128_063] = 0;
    bytes[128_062] = 0;
    let reader = StreamReader::from_bytes("lost", bytes, Some(Layout::Rows1024), None).unwrap();
    assert_eq!((reader.readouts(), reader.missing_frames()), (2, &[1][..]));
    assert_eq!(read(&reader)[125_000..], vec![0; 125_000]);
}

#[test]
fn frames_behind_a_loss_are_found_and_keep_their_numbers() {
    let g = geometry(1000, 1000);
    let packed = stream(g, 5, 31);
    let codec = spikelane_io::formats::Codec::new(Layout::Rows1024, g).unwrap();
    let mut encoded = vec![0; 5 * 128_000];
    codec.encode(&packed, &mut encoded).unwrap();
    // The missing bytes are half a row, an odd number of bytes, and most of a frame. The last missing range includes
    // the end of one frame and the start of the next frame.
    for (start, bytes, lost) in
        [(130_000, 64, &[1][..]), (200_001, 333, &[1]), (128_100, 127_000, &[1]), (250_000, 20_000, &[1, 2])]
    {
        let mut cut = encoded.clone();
        cut.drain(start..start + bytes);
        let opening =
            |policy| OpenOptions::default().with_layout(Some(Layout::Rows1024)).with_missing_frames(policy);
        let marked = opening(MissingFrames::Mark).from_bytes("cut", cut.clone()).unwrap();
        assert_eq!((marked.readouts(), marked.missing_frames()), (5, lost), "{start}");
        let mut expected = packed.clone();
        lost.iter().for_each(|&t| expected[t * 125_000..][..125_000].fill(0));
        assert!(read(&marked) == expected, "{start}");
        assert!(marked.warnings().iter().any(|w| w.contains("missing, number")), "{:?}", marked.warnings());
        let dropped = opening(MissingFrames::Drop).from_bytes("cut", cut).unwrap();
        assert_eq!((dropped.readouts(), dropped.missing_frames()), (5 - lost.len(), lost));
        let remaining = packed.chunks(125_000).enumerate().filter(|(t, _)| !lost.contains(t));
        assert!(read(&dropped) == remaining.flat_map(|(_, f)| f.to_vec()).collect::<Vec<_>>(), "{start}");
    }
}

#[test]
fn empty_and_truncated_files_are_input_errors_that_count_bytes() {
    let dir = TempDir::new().unwrap();
    let path = path(&dir, "s.dat");
    let g = geometry(400, 250);
    for (layout, bytes, texts) in [
        (Layout::Dat, 0, ["0 bytes", "12500"]),
        (Layout::Dat, 12_499, ["12499 bytes", "12500"]),
        (Layout::Rows416, 12_500, ["12500 bytes", "layout dat"]),
        (Layout::NpyBytes, 12_500, ["no .npy header", ".npy"]),
        (Layout::NpyBits, 0, ["no .npy header", ".npy"]),
    ] {
        fs::write(&path, vec![0; bytes]).unwrap();
        let error = failure(open(&path, layout, g));
        assert_eq!(error.kind(), ErrorKind::Input, "{error}");
        for text in texts {
            assert!(error.to_string().contains(text), "{error}");
        }
    }
    fs::write(&path, vec![0; 128_000]).unwrap();
    let error = failure(StreamReader::open(&path, Some(Layout::Rows1024), None));
    assert_eq!(error.kind(), ErrorKind::Input);
}

#[test]
fn a_wrong_geometry_error_suggests_the_likely_one() {
    let bytes = vec![0; 13_000 * 3];
    let result = StreamReader::from_bytes("s", bytes, Some(Layout::Dat), Some(geometry(400, 250)));
    let text = failure(result).to_string();
    assert!(text.contains("13000 bytes per frame match 400x250 in layout rows416"), "{text}");
    let error = failure(StreamReader::from_bytes("s", vec![0; 25_000], None, None));
    assert_eq!(error.kind(), ErrorKind::Usage);
    assert!(error.to_string().contains("12500 bytes per frame"), "{error}");
}

#[test]
fn a_recording_that_stops_inside_a_readout_is_read_up_to_there() {
    let g = geometry(40, 9);
    let packed = stream(g, 6, 4);
    for (layout, cut) in
        [(Layout::Dat, 13), (Layout::DatTopMsb, 44), (Layout::NpyBytes, 200), (Layout::NpyBits, 1)]
    {
        let codec = spikelane_io::formats::Codec::new(layout, g).unwrap();
        let mut bytes = layout.header(g, 6).unwrap();
        let start = bytes.len();
        bytes.resize(start + 6 * codec.frame_bytes(), 0);
        codec.encode(&packed, &mut bytes[start..]).unwrap();
        bytes.truncate(bytes.len() - cut);
        let reader = StreamReader::from_bytes("cut", bytes, Some(layout), Some(g)).unwrap();
        assert_eq!(
            (reader.readouts(), reader.partial_frame_bytes()),
            (5, (0, codec.frame_bytes() - cut)),
            "{layout}"
        );
        assert!(read(&reader) == packed[..5 * 45], "{layout}");
        assert!(reader.warnings()[0].contains("ends inside readout 5"), "{:?}", reader.warnings());
    }
}

#[test]
fn arrays_of_any_element_and_order_are_streams() {
    let g = geometry(5, 3);
    let packed = stream(g, 4, 8);
    let pixel = |t: usize, p: usize| u8::from(bit(&packed[t * 2..], p));
    let check = |name: &str, bytes: Vec<u8>, size| {
        let reader = StreamReader::from_bytes(name, bytes, None, size).unwrap();
        assert_eq!((reader.geometry(), reader.readouts()), (g, 4), "{name}");
        assert_eq!(read(&reader), packed, "{name}");
    };
    let order: Vec<u8> = (0..60).map(|i| pixel(i / 15, i % 15)).collect();
    let array = |element, shape: &[u64], values: Vec<Vec<u8>>| {
        let mut bytes = spikelane::unstable::npy::header_bytes(element, shape);
        bytes.extend(values.concat());
        bytes
    };
    use spikelane::unstable::npy::Element;
    for shape in [&[4, 3, 5][..], &[4, 1, 3, 5], &[4, 3, 5, 1], &[1, 4, 3, 5]] {
        let all = |f: &dyn Fn(u8) -> Vec<u8>| order.iter().map(|&v| f(v)).collect();
        check("f32", array(Element::F32, shape, all(&|v| f32::from(v).to_le_bytes().into())), None);
        check("f64", array(Element::F64, shape, all(&|v| (255.0 * f64::from(v)).to_le_bytes().into())), None);
        check("i64", array(Element::I64, shape, all(&|v| i64::from(v).to_le_bytes().into())), None);
        check("u16", array(Element::U16, shape, all(&|v| u16::from(v).to_le_bytes().into())), Some(g));
        check("u8", array(Element::U8, shape, all(&|v| vec![255 * v])), None);
        check("bool", array(Element::Bool, shape, all(&|v| vec![v])), None);
    }
    // In Fortran order, the index of the first axis varies fastest.
    let columns: Vec<Vec<u8>> = (0..60).map(|i| vec![pixel(i % 4, i / 4 % 3 * 5 + i / 12)]).collect();
    let mut bytes = array(Element::U8, &[4, 3, 5], columns);
    let at = bytes.windows(5).position(|w| w == b"False").unwrap();
    bytes[at..at + 5].copy_from_slice(b"True ");
    check("fortran", bytes, None);
    let mut values = vec![0f32.to_le_bytes().to_vec(); 60];
    values[4 + 5 + 15] = 0.37f32.to_le_bytes().to_vec();
    let error =
        failure(StreamReader::from_bytes("light", array(Element::F32, &[4, 3, 5], values), None, None));
    assert!(
        error.to_string().contains("0.37") && error.to_string().contains("readout 1, row 1, col 4"),
        "{error}"
    );
}

#[test]
fn a_packed_array_opened_as_pixels_names_its_layout() {
    let g = geometry(64, 4);
    let mut bytes = Layout::NpyBits.header(g, 3).unwrap();
    bytes.extend(stream(g, 3, 5));
    let error = failure(StreamReader::from_bytes("a.npy", bytes, None, None));
    assert_eq!(error.kind(), ErrorKind::Input);
    assert!(error.to_string().contains("npy-bits-msb"), "{error}");
}

#[test]
fn the_dataset_config_gives_the_geometry() {
    let dir = TempDir::new().unwrap();
    let g = geometry(24, 10);
    let packed = stream(g, 3, 6);
    fs::create_dir_all(path(&dir, "train/spike")).unwrap();
    write(&path(&dir, "train/spike/a.dat"), Layout::Dat, g, &packed);
    write_small(&path(&dir, "config.yaml"), b"filename: x\nspike_w: 24\nspike_h: 10\n", false).unwrap();
    let reader = StreamReader::open(&path(&dir, "train/spike/a.dat"), None, None).unwrap();
    assert_eq!(read(&reader), packed);
    assert!(matches!(reader.origin(), GeometryOrigin::Dataset(path) if path.ends_with("config.yaml")));
    // A sidecar overrides the configuration, and the caller overrides the sidecar.
    write_small(&path(&dir, "train/spike/a.json"), br#"{"width":12,"height":20}"#, false).unwrap();
    let reader = StreamReader::open(&path(&dir, "train/spike/a.dat"), None, None).unwrap();
    assert_eq!(reader.geometry(), geometry(12, 20));
    let reader = StreamReader::open(&path(&dir, "train/spike/a.dat"), None, Some(g)).unwrap();
    assert_eq!((reader.geometry(), reader.origin()), (g, &GeometryOrigin::Caller));
    assert!(reader.warnings()[0].contains("the sidecar"), "{:?}", reader.warnings());
}

#[test]
fn other_files_are_refused_by_name() {
    let g = geometry(16, 10);
    let mut hdf5 = b"\x89HDF\r\n\x1a\n".to_vec();
    hdf5.resize(400, 0);
    for layout in [None, Some(Layout::Dat)] {
        let error = failure(StreamReader::from_bytes("x.dat", hdf5.clone(), layout, Some(g)));
        assert_eq!(error.kind(), ErrorKind::Input);
        assert!(error.to_string().contains("HDF5") && error.to_string().contains("h5py"), "{error}");
    }
    let text = b"x,y,t,p\n12,40,1000,1\n17,9,1001,0\n".repeat(20);
    assert!(
        failure(StreamReader::from_bytes("e.dat", text[..600].to_vec(), None, Some(g)))
            .to_string()
            .contains("text")
    );
    // A layout that the caller names overrides a signature that can occur by chance.
    StreamReader::from_bytes("e.dat", text[..600].to_vec(), Some(Layout::Dat), Some(g)).unwrap();
}

#[test]
fn events_are_the_spikes_in_order() {
    let dir = TempDir::new().unwrap();
    let g = geometry(13, 5);
    let packed = stream(g, 6, 2);
    write(&path(&dir, "s.dat"), Layout::Dat, g, &packed);
    let reader = StreamReader::open(&path(&dir, "s.dat"), Some(Layout::Dat), Some(g)).unwrap();
    let crop = Crop { row: 1, col: 3, width: 9, height: 4 };
    let path = path(&dir, "e.npy");
    let done = write_events(&reader, 2..5, Some(crop), &path, false, |_| Ok(())).unwrap();
    let count = done.spikes;
    let (header, values) = spikelane::unstable::npy::read_values("e", &fs::read(&path).unwrap()).unwrap();
    assert_eq!((header.shape, header.element), (vec![count, 3], spikelane::unstable::npy::Element::I32));
    let inside = |t: usize, y: usize, x: usize| bit(&packed[t * g.frame_bytes()..], y * 13 + x);
    let wanted: Vec<f64> = (2..5)
        .flat_map(|t| (1..5).flat_map(move |y| (3..12).map(move |x| (t, y, x))))
        .filter(|&(t, y, x)| inside(t, y, x))
        .flat_map(|(t, y, x)| [(x - 3) as f64, (y - 1) as f64, (t - 2) as f64])
        .collect();
    assert_eq!(values, wanted);
    assert_eq!(done.digest, Digest::hash_bytes(&fs::read(&path).unwrap()));
}

#[test]
fn the_name_and_the_layout_of_an_output_agree() {
    let layout_for = |name: &str, layout| Layout::for_path(Path::new(name), layout);
    assert_eq!(layout_for("a.npy", None).unwrap(), Layout::NpyBytes);
    assert_eq!(layout_for("a.dat", None).unwrap(), Layout::Dat);
    assert_eq!(layout_for("a", Some(Layout::Rows416)).unwrap(), Layout::Rows416);
    for (name, layout) in [
        ("a.npz", None),
        ("a.h5", Some(Layout::Dat)),
        ("a.npy", Some(Layout::Dat)),
        ("a.dat", Some(Layout::NpyBits)),
    ] {
        assert_eq!(failure(layout_for(name, layout)).kind(), ErrorKind::Usage, "{name}");
    }
}

#[test]
fn frames_that_end_within_a_byte_have_a_caveat() {
    assert!(Layout::Dat.caveat(geometry(61, 45)).unwrap().contains("Spike-Zoo"));
    assert_eq!(Layout::Dat.caveat(geometry(64, 45)), None);
    assert_eq!(Layout::NpyBits.caveat(geometry(61, 45)), None);
}

#[test]
fn an_npy_without_a_whole_frame_is_refused() {
    let dir = TempDir::new().unwrap();
    let (path, g) = (path(&dir, "a.npy"), geometry(9, 4));
    write(&path, Layout::NpyBytes, g, &stream(g, 3, 1));
    let content = fs::read(&path).unwrap();
    for keep in [128 + 35, 128, 127, 60, 9, 1] {
        fs::write(&path, &content[..keep]).unwrap();
        let error = failure(StreamReader::open(&path, Some(Layout::NpyBytes), None));
        assert_eq!(error.kind(), ErrorKind::Input, "{keep}: {error}");
    }
}

#[test]
fn a_value_that_is_no_bit_names_its_pixel() {
    let g = geometry(9, 4);
    let mut bytes = Layout::NpyBytes.header(g, 2).unwrap();
    bytes.extend(vec![1; 72]);
    let at = bytes.len() - 36 + 9 * 2 + 5;
    bytes[at] = 2;
    let reader = StreamReader::from_bytes("a.npy", bytes, None, None).unwrap();
    let mut frame = vec![0; g.frame_bytes()];
    reader.read_frame(0, &mut frame).unwrap();
    let error = failure(reader.read_frame(1, &mut frame));
    assert_eq!(error.kind(), ErrorKind::Input);
    assert!(error.to_string().contains("row 2, col 5"), "{error}");
}

#[test]
fn arrays_of_bool_are_bytes_and_other_types_are_refused() {
    let g = geometry(9, 4);
    let header = |descr: &str| {
        let mut bytes = Layout::NpyBytes.header(g, 1).unwrap();
        let at = bytes.windows(3).position(|w| w == b"|u1").unwrap();
        bytes[at..at + 3].copy_from_slice(descr.as_bytes());
        bytes.extend(vec![1; 36]);
        bytes
    };
    let reader = StreamReader::from_bytes("a", header("|b1"), None, None).unwrap();
    assert_eq!((reader.layout(), reader.geometry()), (Layout::NpyBytes, g));
    for descr in ["|O1", "<c8"] {
        let error = failure(StreamReader::from_bytes("a", header(descr), None, None));
        assert_eq!(error.kind(), ErrorKind::Input, "{descr}");
    }
}

#[test]
fn packed_arrays_are_recognized_by_the_camera_width() {
    let g = geometry(13, 4);
    let mut bytes = Layout::NpyBits.header(g, 2).unwrap();
    bytes.extend(vec![0x1f; 16]);
    let known = StreamReader::from_bytes("a", bytes.clone(), None, Some(g)).unwrap();
    assert_eq!((known.layout(), known.readouts()), (Layout::NpyBits, 2));
    let named = StreamReader::from_bytes("a", bytes, Some(Layout::NpyBits), None).unwrap();
    assert_eq!(named.geometry(), geometry(16, 4));
}

#[test]
fn a_sidecar_tells_layout_and_geometry_and_notices_lost_frames() {
    let dir = TempDir::new().unwrap();
    let g = geometry(13, 4);
    let packed = stream(g, 6, 2);
    for name in ["s.dat", "s.clean.dat"] {
        write(&path(&dir, name), Layout::DatTop, g, &packed);
    }
    let sidecar = br#"{"width":13,"height":4,"layout":"dat-top","readouts":6,"seeds":{}}"#;
    write_small(&path(&dir, "s.json"), sidecar, false).unwrap();
    for name in ["s.dat", "s.clean.dat"] {
        let reader = StreamReader::open(&path(&dir, name), None, None).unwrap();
        assert_eq!(reader.layout(), Layout::DatTop);
        assert_eq!(read(&reader), packed);
    }
    fs::write(path(&dir, "s.dat"), &packed[..5 * 7]).unwrap();
    let reader = StreamReader::open(&path(&dir, "s.dat"), None, None).unwrap();
    assert_eq!(reader.readouts(), 5);
    assert!(reader.warnings()[0].contains("sidecar states 6"), "{:?}", reader.warnings());
    fs::write(path(&dir, "s.dat"), packed.repeat(2)).unwrap();
    let error = failure(StreamReader::open(&path(&dir, "s.dat"), None, None));
    assert_eq!(error.kind(), ErrorKind::Input);
    assert!(error.to_string().contains("expected 6"), "{error}");
    fs::write(path(&dir, "s.json"), "{").unwrap();
    let error = failure(StreamReader::open(&path(&dir, "s.dat"), None, None));
    assert_eq!(error.kind(), ErrorKind::Config);
    // If layout and geometry are given, an invalid sidecar is not an error.
    open(&path(&dir, "s.dat"), Layout::DatTop, g).unwrap();
}

#[test]
fn frames_come_one_by_one_with_clean_padding() {
    // The padding bits in a file may have any value.
    let reader =
        StreamReader::from_bytes("s", vec![0xff; 4], Some(Layout::DatTop), Some(geometry(5, 1))).unwrap();
    let mut frames = reader.frames(1..3).unwrap();
    assert_eq!(frames.next_frame().unwrap().unwrap(), [0x1f]);
    assert_eq!(frames.next_frame().unwrap().unwrap(), [0x1f]);
    assert!(frames.next_frame().is_none());
}

#[test]
fn threads_read_the_same_frames_from_a_file_as_one() {
    let dir = TempDir::new().unwrap();
    // The first stream has frames that are larger than a block. The second stream has many frames per block.
    for (g, readouts) in [(geometry(2500, 2000), 3), (geometry(40, 25), 9000)] {
        for layout in [Layout::Dat, Layout::DatTop, Layout::NpyBits, Layout::NpyBytes] {
            let packed = stream(g, readouts, 5);
            let path = path(&dir, &format!("{}-{layout}", g.width()));
            write(&path, layout, g, &packed);
            let reader = open(&path, layout, g).unwrap();
            let size = g.frame_bytes();
            std::thread::scope(|scope| {
                for part in 0..3 {
                    let (reader, packed) = (&reader, &packed);
                    scope.spawn(move || {
                        let (first, end) = (part * readouts / 3, (part + 1) * readouts / 3);
                        let mut actual = vec![0; (end - first) * size];
                        reader.read_frames(first, &mut actual).unwrap();
                        assert!(actual == packed[first * size..end * size], "{layout} {g}");
                    });
                }
            });
        }
    }
}

#[test]
fn readouts_beyond_the_end_are_refused() {
    let g = geometry(16, 3);
    let reader = StreamReader::from_bytes("s", vec![0; 18], None, Some(g)).unwrap();
    let mut frame = [0; 6];
    assert_eq!(failure(reader.read_frame(3, &mut frame)).kind(), ErrorKind::Usage);
    let last = failure(reader.read_frame(usize::MAX, &mut frame));
    assert_eq!(last.kind(), ErrorKind::Usage);
    assert_eq!(failure(reader.frames(1..4)).kind(), ErrorKind::Usage);
    assert_eq!(failure(reader.read_frame(0, &mut [0; 7])).kind(), ErrorKind::Usage);
}
