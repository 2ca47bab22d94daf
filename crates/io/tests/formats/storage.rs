//! Tests that a file is either complete or absent, and that existing files are never lost.

use std::fs;
use std::path::PathBuf;

use spikelane::{Error, ErrorKind, Geometry, Result};
use spikelane_io::formats::{Layout, StreamReader, StreamWriter, convert};
use spikelane_io::storage::{Digest, FileWriter, write_small};
use tempfile::TempDir;

fn geometry(width: u32, height: u32) -> Geometry {
    Geometry::new(width, height).unwrap()
}

fn place(dir: &TempDir, name: &str) -> PathBuf {
    dir.path().join(name)
}

/// Returns all names in a folder, including hidden names.
fn names(dir: &TempDir) -> Vec<String> {
    let entries = fs::read_dir(dir.path()).unwrap();
    let mut names: Vec<String> = entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

fn failure<T>(result: Result<T>) -> Error {
    result.err().expect("an error")
}

#[test]
fn an_existing_output_is_refused_and_kept() {
    let dir = TempDir::new().unwrap();
    let (path, g) = (place(&dir, "s.dat"), geometry(8, 1));
    fs::write(&path, "mine").unwrap();
    let error = failure(StreamWriter::create(&path, Layout::Dat, g, 1, false));
    assert_eq!(error.kind(), ErrorKind::Exists);
    assert_eq!(failure(write_small(&path, b"x", false)).kind(), ErrorKind::Exists);
    assert_eq!(fs::read(&path).unwrap(), b"mine");
    assert_eq!(names(&dir), ["s.dat"]);
    let mut writer = StreamWriter::create(&path, Layout::Dat, g, 1, true).unwrap();
    writer.write_frames(0, &[7]).unwrap();
    assert_eq!(fs::read(&path).unwrap(), b"mine", "until it is finished");
    writer.finish().unwrap();
    assert_eq!(fs::read(&path).unwrap(), [7]);
    assert_eq!(names(&dir), ["s.dat"]);
}

#[test]
fn a_file_that_appears_meanwhile_is_never_lost() {
    let dir = TempDir::new().unwrap();
    let path = place(&dir, "s.dat");
    let mut writer = FileWriter::create(&path, 3, false).unwrap();
    writer.write_all(b"new").unwrap();
    fs::write(&path, "theirs").unwrap();
    assert_eq!(failure(writer.finish()).kind(), ErrorKind::Exists);
    assert_eq!(fs::read(&path).unwrap(), b"theirs");
    assert_eq!(names(&dir), ["s.dat"]);
}

#[test]
fn a_writer_dropped_or_unfinished_leaves_nothing() {
    let dir = TempDir::new().unwrap();
    let (path, g) = (place(&dir, "s.dat"), geometry(8, 1));
    let mut writer = StreamWriter::create(&path, Layout::Dat, g, 2, false).unwrap();
    writer.write_frames(0, &[1]).unwrap();
    let under_way = names(&dir);
    assert_eq!(under_way.len(), 1);
    assert!(under_way[0].starts_with(".s.dat.") && under_way[0].ends_with(".partial"));
    drop(writer);
    assert!(names(&dir).is_empty());
    let writer = StreamWriter::create(&path, Layout::Dat, g, 2, false).unwrap();
    assert_eq!(failure(writer.finish()).kind(), ErrorKind::Usage);
    assert!(names(&dir).is_empty());
}

#[test]
fn a_conversion_that_is_stopped_leaves_nothing() {
    let dir = TempDir::new().unwrap();
    let (path, g) = (place(&dir, "s.dat"), geometry(8, 1));
    let reader = StreamReader::from_bytes("s", vec![5; 4], None, Some(g)).unwrap();
    let writer = StreamWriter::create(&path, Layout::NpyBytes, g, 4, false).unwrap();
    let stop = |_| Err(Error::new(ErrorKind::Interrupted, "conversion"));
    let error = failure(convert(&reader, 0..4, None, writer, stop));
    assert_eq!(error.kind(), ErrorKind::Interrupted);
    assert!(names(&dir).is_empty());
}

#[test]
fn frames_out_of_order_or_too_many_are_refused() {
    let dir = TempDir::new().unwrap();
    let (path, g) = (place(&dir, "s.dat"), geometry(8, 2));
    let mut writer = StreamWriter::create(&path, Layout::Dat, g, 2, false).unwrap();
    for (first, bytes) in [(1, 2), (0, 3), (0, 6)] {
        let error = failure(writer.write_frames(first, &vec![0; bytes]));
        assert_eq!(error.kind(), ErrorKind::Usage, "{first} {bytes}");
    }
    assert_eq!(writer.written(), 0);
    let zero = StreamWriter::create(&place(&dir, "z"), Layout::Dat, g, 0, false);
    assert_eq!(failure(zero).kind(), ErrorKind::Usage);
}

#[test]
fn a_full_disk_is_known_before_the_first_byte() {
    let dir = TempDir::new().unwrap();
    let path = place(&dir, "s.dat");
    // The length is 2^60 bytes, which exceeds the free space of any disk.
    let error = failure(FileWriter::create(&path, 1 << 60, false));
    assert_eq!(error.kind(), ErrorKind::Space);
    let text = error.to_string();
    assert!(text.contains("bytes free") && text.contains(&(1u64 << 60).to_string()));
    assert!(names(&dir).is_empty());
}

#[test]
fn a_missing_directory_is_an_io_error() {
    let dir = TempDir::new().unwrap();
    let path = dir.path().join("no").join("s.dat");
    assert_eq!(failure(FileWriter::create(&path, 1, false)).kind(), ErrorKind::Io);
    assert_eq!(failure(StreamReader::open(&path, None, None)).kind(), ErrorKind::Io);
    let error = failure(StreamReader::open(dir.path(), None, None));
    assert_eq!(error.kind(), ErrorKind::Input);
}

#[test]
fn the_digest_of_a_file_is_that_of_its_bytes() {
    let dir = TempDir::new().unwrap();
    for len in [0, 1, 1 << 19, 1_000_003u32] {
        let path = place(&dir, &len.to_string());
        let bytes: Vec<u8> = (0..len).map(|i| ((i * 7) >> 3) as u8).collect();
        write_small(&path, &bytes, false).unwrap();
        assert_eq!(Digest::hash_file(&path).unwrap(), Digest::hash_bytes(&bytes), "{len}");
    }
}

#[test]
fn a_file_that_is_cut_while_it_is_read_is_an_error_in_every_layout() {
    let g = Geometry::new(400, 250).unwrap();
    let rows1024 = Geometry::new(1000, 1000).unwrap();
    for layout in Layout::ALL {
        let dir = TempDir::new().unwrap();
        let g = if layout == Layout::Rows1024 { rows1024 } else { g };
        let name = if layout.is_array() { "s.npy" } else { "s.dat" };
        let path = place(&dir, name);
        let mut writer = StreamWriter::create(&path, layout, g, 400, false).unwrap();
        writer.write_frames(0, &vec![0; 400 * g.frame_bytes()]).unwrap();
        writer.finish().unwrap();
        let reader = StreamReader::open(&path, Some(layout), Some(g)).unwrap();
        let file = fs::OpenOptions::new().write(true).open(&path).unwrap();
        file.set_len(file.metadata().unwrap().len() / 2).unwrap();
        let mut frame = vec![0; g.frame_bytes()];
        reader.read_frame(0, &mut frame).unwrap();
        let error = failure(reader.read_frame(399, &mut frame));
        assert_eq!(error.kind(), ErrorKind::Input, "{layout}");
        assert!(error.to_string().contains(name), "{layout}: {error}");
        let out = place(&dir, "out.dat");
        let writer = StreamWriter::create(&out, Layout::Dat, g, 400, false).unwrap();
        assert_eq!(
            failure(convert(&reader, 0..400, None, writer, |_| Ok(()))).kind(),
            ErrorKind::Input,
            "{layout}"
        );
        assert_eq!(names(&dir), [name], "{layout}: a part of the output is left");
        // `hash_file` fails if the file is not readable under its final name.
        assert!(Digest::hash_file(&path).is_ok());
    }
}

/// Another process shortens the hidden file, and the writer continues through a mapped window or through calls.
#[cfg(unix)]
#[test]
fn an_output_that_another_process_shortens_is_an_error_and_no_file() {
    for (left, maps) in [(4096, true), (0, true), (4096, false), (0, false)] {
        let dir = TempDir::new().unwrap();
        let path = place(&dir, "s.dat");
        let mut writer = FileWriter::create(&path, 1 << 20, false).unwrap();
        writer.window(0, 1 << 20).unwrap().fill(1);
        let hidden = place(&dir, &names(&dir)[0]);
        let mut write = |first: bool| {
            if maps {
                // The access is beyond the end of the file.
                let window = writer.window(0, 1 << 20)?;
                if first {
                    fs::OpenOptions::new().write(true).open(&hidden).unwrap().set_len(left).unwrap();
                }
                window.fill(2);
                Ok(())
            } else {
                fs::OpenOptions::new().write(true).open(&hidden).unwrap().set_len(left).unwrap();
                writer.write_all(&[2; 1000])
            }
        };
        let written = write(true).and_then(|()| write(false));
        let error = failure(written.and_then(|()| writer.finish()));
        assert_eq!((error.kind(), error.subject()), (ErrorKind::Io, path.display().to_string().into()));
        assert!(error.to_string().contains("shortened"), "{error}");
        assert!(names(&dir).is_empty(), "{:?}", names(&dir));
    }
}
