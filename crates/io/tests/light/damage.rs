//! Tests that damaged images and videos are errors, and that their decoded parts are used if damage is accepted.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use exr::prelude::{
    AnyChannel, AnyChannels, Encoding as ExrEncoding, FlatSamples, Image as ExrImage, Layer, LayerAttributes,
    WritableImage as _,
};
use image::codecs::jpeg::JpegEncoder;
use image::{DynamicImage, GrayImage, ImageFormat, Luma};
use spikelane::{Error, ErrorKind, Geometry};
use spikelane_io::light::image_file::{self, Linearization};
use spikelane_io::light::{Frame, InputOptions, open};
use tempfile::TempDir;

use crate::containers::{exr, file, linear};

const SIDE: u32 = 64;

fn options() -> InputOptions {
    linear().with_camera(Geometry::new(SIDE, SIDE).unwrap())
}

/// An image in which every block and every row differ.
fn image() -> DynamicImage {
    GrayImage::from_fn(SIDE, SIDE, |x, y| Luma([(x * 7 + y * 13 + x * y % 31) as u8])).into()
}

fn encoded(format: ImageFormat) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    let image = if format == ImageFormat::WebP { image().to_rgb8().into() } else { image() };
    image.write_to(&mut bytes, format).unwrap();
    bytes.into_inner()
}

fn jpeg() -> Vec<u8> {
    let mut bytes = Vec::new();
    JpegEncoder::new_with_quality(&mut bytes, 95).encode_image(&image()).unwrap();
    bytes
}

/// The mean light of each frame, and the notes after the last frame.
fn read(path: &Path, options: &InputOptions) -> Result<(Vec<f32>, String), Error> {
    let mut source = open(path, options)?;
    let mut frame = Frame::dark(source.geometry());
    let mut means = Vec::new();
    while source.next_frame(&mut frame)? {
        let light = frame.to_f32();
        means.push(light.iter().sum::<f32>() / light.len() as f32);
    }
    Ok((means, source.notes().join("\n")))
}

fn refusal(path: &Path) -> String {
    let error = read(path, &options()).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Input, "{error}");
    error.to_string()
}

#[test]
fn a_jpeg_of_which_a_part_is_missing_is_an_error() {
    let dir = TempDir::new().unwrap();
    let whole = jpeg();
    let half = whole.len() / 2;
    let cut = whole[..half].to_vec();
    let zeros = [&whole[..half], &vec![0; whole.len() - half]].concat();
    assert_eq!(read(&file(&dir, "whole.jpg", &whole), &options()).unwrap().1, "");
    for (name, bytes) in [("cut.jpg", cut), ("zeros.jpg", zeros)] {
        let path = file(&dir, name, bytes);
        let text = refusal(&path);
        assert!(text.contains("end marker") && text.contains("accept_damage"), "{text}");
        // The truth of an evaluation is read by this function, which has no setting to accept damage.
        let error = image_file::read(&path, &Linearization::new(None)).unwrap_err();
        assert!(error.kind() == ErrorKind::Input && !error.to_string().contains("accept_damage"), "{error}");
        let (lights, notes) = read(&path, &options().with_accept_damage(true)).unwrap();
        assert!(lights.len() == 1 && notes.contains("damaged"), "{notes}");
    }
    let folder = dir.path().join("clip");
    fs::create_dir(&folder).unwrap();
    fs::write(folder.join("1.jpg"), &whole).unwrap();
    fs::write(folder.join("2.jpg"), &whole[..half]).unwrap();
    assert!(refusal(&folder).contains("2.jpg"));
    let (lights, notes) = read(&folder, &options().with_accept_damage(true)).unwrap();
    assert!(lights.len() == 2 && notes.contains("2.jpg: damaged"), "{notes}");
}

#[test]
fn an_invalid_code_in_a_jpeg_is_an_error() {
    let dir = TempDir::new().unwrap();
    let mut bytes = jpeg();
    // A run of ones is the prefix of no code.
    let at = bytes.len() / 2;
    bytes[at..at + 8].copy_from_slice(&[0xFF, 0, 0xFF, 0, 0xFF, 0, 0xFF, 0]);
    assert!(refusal(&file(&dir, "bad.jpg", bytes)).contains("Huffman"));
}

#[test]
fn a_jpeg_with_missing_or_superfluous_codes_is_an_error() {
    let dir = TempDir::new().unwrap();
    let whole = jpeg();
    let middle = whole.len() / 2;
    for missing in [16, 64, 100, 128, 256] {
        let hole = [&whole[..middle], &whole[middle + missing..]].concat();
        let text = refusal(&file(&dir, "hole.jpg", hole));
        assert!(text.contains("last block") || text.contains("Huffman"), "{missing}: {text}");
    }
    let (data, end) = whole.split_at(whole.len() - 2);
    let text = refusal(&file(&dir, "more.jpg", [data, b"superfluous", end].concat()));
    assert!(text.contains("11 bytes behind the last block"), "{text}");
    // Cameras write such bytes.
    for padding in [&[0; 64][..], &[7; 2]] {
        assert_eq!(read(&file(&dir, "padded.jpg", [data, padding, end].concat()), &options()).unwrap().1, "");
    }
}

#[test]
fn missing_bytes_of_a_progressive_jpeg_are_found() {
    let dir = TempDir::new().unwrap();
    let whole = include_bytes!("fixtures/progressive.jpg");
    assert_eq!(read(&file(&dir, "whole.jpg", whole), &options()).unwrap().1, "");
    // Codes without the missing bytes sometimes end at the same place by chance.
    let starts: Vec<usize> = (200..whole.len() - 10).step_by(5).collect();
    let is_refused = |start: &usize| {
        let hole = [&whole[..*start], &whole[start + 8..]].concat();
        read(&file(&dir, "hole.jpg", hole), &options()).is_err()
    };
    let refused = starts.iter().filter(|start| is_refused(start)).count();
    assert!(refused * 100 >= starts.len() * 85, "{refused} of {}", starts.len());
}

#[test]
fn bytes_after_the_end_of_a_jpeg_are_not_damage() {
    let dir = TempDir::new().unwrap();
    // Phones store a video or a depth map behind the image.
    let path = file(&dir, "motion.jpg", [&jpeg()[..], &[0; 9], b"ftyp"].concat());
    assert_eq!(read(&path, &options()).unwrap().1, "");
}

#[test]
fn truncated_images_are_errors_and_their_first_rows_are_used_if_damage_is_accepted() {
    let dir = TempDir::new().unwrap();
    for (name, format, is_partly_read) in [
        ("a.png", ImageFormat::Png, true),
        ("a.webp", ImageFormat::WebP, true),
        ("a.bmp", ImageFormat::Bmp, true),
        ("a.pgm", ImageFormat::Pnm, true),
        ("a.tif", ImageFormat::Tiff, false),
    ] {
        let whole = encoded(format);
        let path = file(&dir, name, &whole[..whole.len() * 6 / 10]);
        let text = refusal(&path);
        assert_eq!(text.contains("accept_damage"), is_partly_read, "{text}");
        let accepted = read(&path, &options().with_accept_damage(true));
        match accepted {
            Ok((lights, notes)) => {
                assert!(is_partly_read && lights.len() == 1 && notes.contains("damaged"), "{name}: {notes}");
            }
            Err(e) => assert!(!is_partly_read, "{e}"),
        }
    }
    let whole = fs::read(exr(&dir, "a.exr", &[("Y", 0.5)])).unwrap();
    for len in [whole.len() / 2, whole.len() - 3] {
        refusal(&file(&dir, "cut.exr", &whole[..len]));
    }
}

/// A renderer that is stopped, or a computer of a render farm that fails, leaves a file without some of its chunks.
#[test]
fn missing_chunks_of_an_exr_are_damage() {
    let dir = TempDir::new().unwrap();
    // A gray image of eight chunks of one row each.
    let samples = FlatSamples::F32((0..64).map(|n| n as f32 / 64.0).collect());
    let channels = AnyChannels::sort([AnyChannel::new("Y", samples)].into_iter().collect());
    let layer = Layer::new((8, 8), LayerAttributes::default(), ExrEncoding::UNCOMPRESSED, channels);
    let path = dir.path().join("whole.exr");
    ExrImage::from_layer(layer).write().to_file(&path).unwrap();
    let whole = fs::read(&path).unwrap();
    assert!(read(&path, &options()).is_ok());
    // A chunk of a row has the row, the number of bytes, and the samples. The table has the offset of each chunk.
    let chunk = 4 + 4 + 8 * 4;
    let first = whole.len() - 8 * chunk;
    let table = first - 8 * 8;
    assert_eq!(whole[table..table + 8], (first as u64).to_le_bytes());
    for missing in [0, 3, 7] {
        let mut bytes = whole.clone();
        bytes[table + 8 * missing..table + 8 * missing + 8].fill(0);
        bytes.drain(first + missing * chunk..first + (missing + 1) * chunk);
        refusal(&file(&dir, "absent.exr", &bytes));
        // Another chunk is stored twice.
        let mut bytes = whole.clone();
        let other = (missing + 1) % 8;
        bytes.copy_within(first + other * chunk..first + (other + 1) * chunk, first + missing * chunk);
        let text = refusal(&file(&dir, "twice.exr", &bytes));
        assert!(text.contains("8 pixels without samples"), "{text}");
    }
}

#[test]
fn a_wrong_checksum_of_a_png_is_an_error() {
    let dir = TempDir::new().unwrap();
    let mut bytes = encoded(ImageFormat::Png);
    // The checksum of the samples is in front of the last chunk, which has 12 bytes.
    let at = bytes.len() - 13;
    bytes[at] ^= 1;
    let text = refusal(&file(&dir, "crc.png", bytes));
    assert!(text.contains("CRC"), "{text}");
}

/// Returns a video of 20 frames with the encoder `flags`, or `None` if ffmpeg is not installed.
fn video(dir: &TempDir, name: &str, flags: &[&str]) -> Option<PathBuf> {
    let path = dir.path().join(name);
    let run = Command::new("ffmpeg")
        .args(["-y", "-v", "error", "-f", "lavfi", "-i", "testsrc2=s=64x64:r=25", "-frames:v", "20"])
        .args(flags)
        .arg(&path)
        .status();
    let Ok(status) = run else {
        println!("skipped: no ffmpeg on PATH");
        return None;
    };
    assert!(status.success(), "{name}");
    Some(path)
}

fn replaced(path: &Path, change: impl Fn(&mut Vec<u8>)) -> PathBuf {
    let mut bytes = fs::read(path).unwrap();
    change(&mut bytes);
    fs::write(path, bytes).unwrap();
    path.to_owned()
}

const MPEG4: [&str; 6] = ["-c:v", "mpeg4", "-q:v", "2", "-g", "20"];

#[test]
fn a_truncated_video_is_an_error_that_names_the_cause() {
    let dir = TempDir::new().unwrap();
    let motion_jpeg = ["-c:v", "mjpeg", "-q:v", "2"];
    let fast_start = [&MPEG4[..], &["-movflags", "faststart"]].concat();
    for (name, flags, cause) in [
        ("a.avi", &motion_jpeg[..], "of the 20 frames that the header states"),
        ("a.mkv", &MPEG4, "prematurely"),
        ("a.mp4", &fast_start, "partial file"),
        ("a.gif", &[], "trailer of the GIF"),
    ] {
        let Some(path) = video(&dir, name, flags) else { return };
        let whole = read(&path, &options()).unwrap();
        assert_eq!((whole.0.len(), whole.1.as_str()), (20, ""), "{name}");
        let path = replaced(&path, |bytes| bytes.truncate(bytes.len() * 6 / 10));
        let text = refusal(&path);
        assert!(text.contains(cause) && text.contains("accept_damage"), "{text}");
        let (frames, notes) = read(&path, &options().with_accept_damage(true)).unwrap();
        assert!((1..20).contains(&frames.len()) && notes.contains(cause), "{name}: {notes}");
    }
}

/// The counters of two transport streams do not fit together, and the clock of the second one starts again.
#[test]
fn joined_transport_streams_are_reported_and_complete() {
    let dir = TempDir::new().unwrap();
    let Some(path) = video(&dir, "a.ts", &["-c:v", "mpeg2video", "-q:v", "2", "-bf", "2"]) else { return };
    let whole = fs::read(&path).unwrap();
    let one = read(&path, &options()).unwrap();
    assert_eq!((one.0.len(), one.1.as_str()), (20, ""));
    let path = file(&dir, "joined.ts", whole.repeat(2));
    let (frames, notes) = read(&path, &options()).unwrap();
    assert_eq!(frames, one.0.repeat(2));
    assert!(notes.contains("after frame 20, as in joined files"), "{notes}");
    let source = open(&path, &options()).unwrap();
    assert!(source.frame_times().is_none() && source.rate().is_some_and(|rate| rate.hz() == 25.0));
    // The clock jumps forward, so the packets between both files can be missing.
    let later = ["-c:v", "mpeg2video", "-q:v", "2", "-bf", "2", "-output_ts_offset", "10"];
    let later = fs::read(video(&dir, "later.ts", &later).unwrap()).unwrap();
    assert!(refusal(&file(&dir, "gap.ts", [&whole[..], &later].concat())).contains("damaged video"));
    // Packets of 188 bytes are missing inside the first file, or in the last frame, which has 9 packets.
    for missing in [80..84, whole.len() / 188 - 4..whole.len() / 188] {
        let mut bytes = whole.clone();
        bytes.drain(188 * missing.start..188 * missing.end);
        let text = refusal(&file(&dir, "lossy.ts", [&bytes[..], &whole].concat()));
        assert!(text.contains("damaged video"), "{text}");
    }
}

/// The concealed blocks of a damaged frame would be simulated as light.
#[test]
fn wrong_bytes_in_a_video_are_an_error() {
    let dir = TempDir::new().unwrap();
    for name in ["a.mp4", "a.mkv", "a.ts", "a.avi"] {
        let Some(path) = video(&dir, name, &MPEG4) else { return };
        let path = replaced(&path, |bytes| {
            // The bytes are in the samples, and not in a header of the container.
            let at = bytes.len() / 4 + 40;
            bytes[at..at + 60].fill(0x55);
        });
        let text = refusal(&path);
        assert!(text.contains("damaged video"), "{text}");
        let (frames, notes) = read(&path, &options().with_accept_damage(true)).unwrap();
        assert!(!frames.is_empty() && notes.contains("damaged"), "{name}: {notes}");
    }
}

#[test]
fn dropped_frames_and_edit_lists_are_not_damage() {
    let dir = TempDir::new().unwrap();
    let drops = ["-vf", "select='not(between(n,3,5))'", "-fps_mode", "passthrough", "-c:v", "mjpeg"];
    let old = ["-vf", "select='not(between(n,3,5))'", "-vsync", "passthrough", "-c:v", "mjpeg"];
    let newer = Command::new("ffmpeg").args(["-v", "quiet", "-fps_mode", "passthrough", "-version"]).output();
    let Ok(newer) = newer else { return };
    let flags = if newer.status.success() { drops } else { old };
    let path = video(&dir, "drops.avi", &flags).unwrap();
    assert_eq!(read(&path, &options()).unwrap().1, "");
    let whole = video(&dir, "whole.mp4", &["-c:v", "mpeg4", "-bf", "2"]).unwrap();
    let trimmed = dir.path().join("trimmed.mp4");
    let mut copy = Command::new("ffmpeg");
    copy.args(["-v", "error", "-ss", "0.2", "-i"]).arg(&whole);
    assert!(copy.args(["-c", "copy"]).arg(&trimmed).status().unwrap().success());
    let (frames, notes) = read(&trimmed, &options()).unwrap();
    assert_eq!((frames.len(), notes.as_str()), (15, ""));
}
