//! Tests of arrays and videos. The tests cover round trips, damaged files, pipes and ffmpeg.

use std::fs;
use std::io::{Cursor, Write as _};
use std::path::{Path, PathBuf};
use std::process::Command;

use spikelane::unstable::npy::Element;
use spikelane::{Error, ErrorKind, Geometry};
use spikelane_io::light::ffmpeg::FfmpegSource;
use spikelane_io::light::image_file::Linearization;
use spikelane_io::light::{
    Frame, InputOptions, OwnedSamples, Rate, ResizeMode, Source, Transfer, open, open_reader,
};
use tempfile::TempDir;

fn camera(w: u32, h: u32) -> InputOptions {
    InputOptions::new(Geometry::new(w, h).unwrap())
}

fn frames(source: &mut dyn Source) -> Result<Vec<Frame>, Error> {
    let mut all = Vec::new();
    let mut frame = Frame::dark(source.geometry());
    while source.next_frame(&mut frame)? {
        all.push(frame.clone());
    }
    Ok(all)
}

fn read(path: &Path, options: &InputOptions) -> Result<Vec<Frame>, Error> {
    frames(&mut *open(path, options)?)
}

fn open_error(path: &Path, options: &InputOptions) -> (ErrorKind, String) {
    let error = read(path, options).unwrap_err();
    let text = error.to_string();
    let name = path.file_name().unwrap().to_string_lossy();
    assert!(text.contains(&*name), "{text}");
    (error.kind(), text)
}

/// A number type and its encoding in a file.
trait Number: Copy {
    const ELEMENT: Element;
    fn bytes(self) -> Vec<u8>;
}

macro_rules! number {
    ($($t:ty: $element:ident),*) => {
        $(impl Number for $t {
            const ELEMENT: Element = Element::$element;
            fn bytes(self) -> Vec<u8> {
                self.to_le_bytes().into()
            }
        })*
    };
}

number!(u8: U8, u16: U16, f32: F32);

fn npy<T: Number>(shape: &[u64], values: &[T]) -> Vec<u8> {
    let mut bytes = spikelane::unstable::npy::header_bytes(T::ELEMENT, shape);
    bytes.extend(values.iter().flat_map(|v| v.bytes()));
    bytes
}

/// Returns an `.npy` file of version 1 with the header text `header`.
fn npy_of(header: &str, data: &[u8]) -> Vec<u8> {
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.extend(data);
    bytes
}

fn put(dir: &TempDir, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
    let path = dir.path().join(name);
    fs::write(&path, bytes).unwrap();
    path
}

#[test]
fn arrays_of_every_type_come_back_as_they_were() {
    let dir = TempDir::new().unwrap();
    let (b, h): (Vec<u8>, Vec<u16>) = ((0..12).collect(), (0..12).map(|x| x * 5000).collect());
    let f: Vec<f32> = (0..12).map(|x| x as f32 / 4.0).collect();
    let files = [
        put(&dir, "b.npy", npy(&[2, 2, 3], &b)),
        put(&dir, "h.npy", npy(&[2, 2, 3], &h)),
        put(&dir, "f.npy", npy(&[2, 2, 3], &f)),
    ];
    let wanted = |i: usize| {
        let at = 6 * i..6 * (i + 1);
        [
            OwnedSamples::U8(b[at.clone()].into()),
            OwnedSamples::U16(h[at.clone()].into()),
            OwnedSamples::F32(f[at].into()),
        ]
    };
    for (k, file) in files.iter().enumerate() {
        let got = read(file, &camera(3, 2)).unwrap();
        assert_eq!(got.len(), 2);
        for (i, frame) in got.iter().enumerate() {
            assert_eq!(frame.samples(), &wanted(i)[k]);
        }
    }
}

#[test]
fn two_axes_are_one_frame_and_big_endian_is_read() {
    let header = "{'descr': '>u2', 'fortran_order': False, 'shape': (1, 2), }";
    let dir = TempDir::new().unwrap();
    let path = put(&dir, "big.npy", npy_of(header, &[1, 2, 255, 0]));
    let got = read(&path, &camera(2, 1)).unwrap();
    assert_eq!(got.len(), 1);
    assert_eq!(got[0].samples(), &OwnedSamples::U16(vec![0x0102, 0xff00]));
}

#[test]
fn a_transfer_function_applies_to_integers_and_is_refused_for_floats() {
    let dir = TempDir::new().unwrap();
    let mut options = camera(2, 1);
    options.transfer = Some(Transfer::Srgb);
    let path = put(&dir, "i.npy", npy(&[1, 2], &[128_u8, 255]));
    assert_eq!(read(&path, &options).unwrap()[0].samples(), &OwnedSamples::U16(vec![14146, 65535]));
    let path = put(&dir, "x.npy", npy(&[1, 2], &[0.5_f32, 1.0]));
    assert_eq!(open_error(&path, &options).0, ErrorKind::Usage);
}

#[test]
fn arrays_that_are_not_frames_are_refused_with_a_reason() {
    let dir = TempDir::new().unwrap();
    let header = |descr: &str, order: &str, shape: &str| {
        npy_of(&format!("{{'descr': {descr}, 'fortran_order': {order}, 'shape': {shape}, }}"), &[0; 64])
    };
    for (name, bytes, says) in [
        ("signed", header("'|i1'", "False", "(2, 2)"), "i8"),
        ("fortran", header("'|u1'", "True", "(2, 2, 2)"), "ascontiguousarray"),
        ("channels", header("'|u1'", "False", "(2, 2, 2, 4)"), "(2, 2, 2, 4)"),
        ("empty", header("'|u1'", "False", "(0, 2, 2)"), "at least one frame"),
        ("huge", header("'|u1'", "False", "(9999999999, 9999999999, 9)"), "pixels"),
        ("wide", header("'|u1'", "False", "(1, 99999, 99999)"), "pixels"),
        ("record", header("[('a', '<f4'), ('b', '<f4')]", "False", "(2, 2)"), "structured"),
        ("nested", npy_of(&"(".repeat(9000), &[]), "not a dictionary"),
        ("broken", npy_of("{'descr': ", &[]), "NumPy"),
        ("magic", b"\x93NUMPX\x01\x00".to_vec(), "no .npy header"),
        ("short", b"\x93NUMPY\x01".to_vec(), "header"),
        ("long", b"\x93NUMPY\x02\x00\xff\xff\xff\xff".to_vec(), "header of"),
    ] {
        let path = put(&dir, &format!("{name}.npy"), bytes);
        let (kind, text) = open_error(&path, &camera(2, 2));
        assert_eq!(kind, ErrorKind::Input, "{text}");
        assert!(text.contains(says), "{name}: {text}");
    }
}

#[test]
fn a_truncated_array_is_refused_from_a_file_and_from_a_pipe() {
    let dir = TempDir::new().unwrap();
    let complete = npy(&[3, 2, 2], &[7_u8; 12]);
    let cut = &complete[..complete.len() - 3];
    let path = put(&dir, "cut.npy", cut);
    assert_eq!(open(&path, &camera(2, 2)).err().unwrap().kind(), ErrorKind::Input);
    let pipe = Box::new(Cursor::new(cut.to_vec()));
    let mut source = open_reader(pipe, "pipe", &camera(2, 2)).unwrap();
    let error = frames(&mut *source).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Input);
    assert!(error.to_string().contains("frame 2"), "{error}");
}

#[test]
fn a_bad_float_in_an_array_is_named_by_frame_and_pixel() {
    let dir = TempDir::new().unwrap();
    let mut values = [0.5_f32; 12];
    values[9] = f32::NAN;
    let path = put(&dir, "nan.npy", npy(&[3, 2, 2], &values));
    let (kind, text) = open_error(&path, &camera(2, 2));
    assert_eq!(kind, ErrorKind::Input);
    assert!(text.contains("frame 2") && text.contains("row 0, col 1"), "{text}");
}

fn npz(path: &Path, arrays: &[&str], values: &[u8], shape: &[u64]) {
    let mut archive = zip::ZipWriter::new(fs::File::create(path).unwrap());
    for name in arrays {
        let options = zip::write::SimpleFileOptions::default();
        archive.start_file(format!("{name}.npy"), options).unwrap();
        archive.write_all(&npy(shape, values)).unwrap();
    }
    archive.finish().unwrap();
}

#[test]
fn an_archive_of_one_array_is_read_and_of_two_is_refused() {
    let dir = TempDir::new().unwrap();
    // The data are larger than one block of the thread, so that a block boundary is inside the data.
    let values: Vec<u8> = (0..200_000_u32).map(|i| (i % 251) as u8).collect();
    let path = dir.path().join("one.npz");
    npz(&path, &["light"], &values, &[5, 200, 200]);
    let got = read(&path, &camera(200, 200)).unwrap();
    assert_eq!(got.len(), 5);
    for (frame, wanted) in got.iter().zip(values.chunks(40_000)) {
        assert_eq!(frame.samples(), &OwnedSamples::U8(wanted.to_vec()));
    }
    let path = dir.path().join("two.npz");
    npz(&path, &["a", "b"], &[1; 4], &[2, 2]);
    let (kind, text) = open_error(&path, &camera(2, 2));
    assert!(kind == ErrorKind::Input && text.contains("2 arrays"), "{text}");
    let path = put(&dir, "none.npz", "not an archive");
    assert_eq!(open_error(&path, &camera(2, 2)).0, ErrorKind::Input);
}

/// Returns a y4m stream. `header` does not contain the magic word, and `planes` contains the planes of the frames.
fn y4m(header: &str, planes: &[&[u8]]) -> Vec<u8> {
    let mut bytes = format!("YUV4MPEG2 {header}\n").into_bytes();
    for frame in planes {
        bytes.extend(b"FRAME\n");
        bytes.extend(*frame);
    }
    bytes
}

fn light(header: &str, planes: &[u8], size: (u32, u32)) -> Vec<f32> {
    let stream = Box::new(Cursor::new(y4m(header, &[planes])));
    let mut options = camera(size.0, size.1);
    options.transfer = Some(Transfer::Linear);
    let mut source = open_reader(stream, "pipe", &options).unwrap();
    frames(&mut *source).unwrap()[0].to_f32()
}

/// The tolerance is two steps of a 16-bit sample: one for rounding in the table and one for rounding in the output.
const STEP: f32 = 2.0 / 65535.0;

#[test]
fn ranges_of_luma_are_as_declared() {
    let near = |got: &[f32], wanted: &[f32]| {
        assert!(got.iter().zip(wanted).all(|(a, b)| (a - b).abs() < STEP), "{got:?} {wanted:?}");
    };
    let codes = [0_u8, 16, 126, 235, 255];
    let full: Vec<f32> = codes.iter().map(|&c| f32::from(c) / 255.0).collect();
    let limited = [0.0, 0.0, 110.0 / 219.0, 1.0, 1.0];
    near(&light("W5 H1 F25:1 Cmono", &codes, (5, 1)), &full);
    near(&light("W5 H1 Cmono XCOLORRANGE=LIMITED", &codes, (5, 1)), &limited);
    let mut color = codes.to_vec();
    color.extend([128; 10]);
    near(&light("W5 H1 F25:1 C444", &color, (5, 1)), &limited);
    near(&light("W5 H1 C444 XCOLORRANGE=FULL", &color, (5, 1)), &full);
}

#[test]
fn subsampled_chroma_covers_its_pixels() {
    // Red in full-range BT.601 is Y 76, Cb 85, Cr 255, which gives R' 0.996, G' 0.0005, B' -0.0005. The width and
    // height are odd, so the sizes of the chroma planes are rounded up.
    for (header, chroma) in [("C420jpeg", 4), ("C422", 6), ("C444", 9)] {
        let mut planes = vec![76; 9];
        planes.extend(vec![85; chroma]);
        planes.extend(vec![255; chroma]);
        let got = light(&format!("W3 H3 {header} XCOLORRANGE=FULL"), &planes, (3, 3));
        // For 8-bit codes, an error of 1/255 in R' changes luminance by 0.0008, and an error of 1/255 in G' changes
        // luminance by 0.003.
        assert!(got.iter().all(|x| (x - 0.2126).abs() < 0.004), "{header} {got:?}");
    }
}

#[test]
fn ten_and_twelve_bits_are_little_endian() {
    let sample = |x: u16| x.to_le_bytes();
    let planes: Vec<u8> = [502, 512, 512].into_iter().flat_map(sample).collect();
    let got = light("W1 H1 C444p10", &planes, (1, 1));
    // The code of R', G' and B' is (502 - 64) / 876 = 0.5.
    assert!((got[0] - 0.5).abs() < STEP);
    let got = light("W1 H1 Cmono12", &sample(4095), (1, 1));
    assert_eq!(got, [1.0]);
}

#[test]
fn a_y4m_file_knows_its_frames_and_rate() {
    let dir = TempDir::new().unwrap();
    let path = put(&dir, "v.y4m", y4m("W2 H1 F30000:1001 Cmono", &[&[0, 255], &[255, 0], &[9, 9]]));
    let mut source = open(&path, &camera(2, 1)).unwrap();
    assert_eq!(source.frames(), Some(3));
    assert_eq!(source.rate(), Some(Rate::new(30_000, 1001).unwrap()));
    let got = frames(&mut *source).unwrap();
    assert_eq!(got[0].samples(), &OwnedSamples::U16(vec![0, 65535]));
    assert_eq!(got.len(), 3);
}

#[test]
fn damaged_videos_are_input_errors_that_name_the_file() {
    let dir = TempDir::new().unwrap();
    let complete = y4m("W2 H2 Cmono", &[&[1; 4], &[2; 4]]);
    let mut other = complete.clone();
    let second = other.len() - 10;
    other[second] = b'G';
    for (name, bytes) in [
        ("cut", complete[..complete.len() - 1].to_vec()),
        ("cut_word", complete[..complete.len() - 8].to_vec()),
        ("word", other),
        ("none", y4m("W2 H2 Cmono", &[])),
        ("zero", y4m("W0 H2 Cmono", &[])),
        ("overflow", y4m("W4294967295 H4294967295 C444", &[])),
        ("space", y4m("W2 H2 C411", &[])),
        ("interlaced", y4m("W2 H2 It Cmono", &[&[1; 4]])),
        ("line", b"YUV4MPEG2 W2 H2".to_vec()),
    ] {
        let path = put(&dir, &format!("{name}.y4m"), bytes);
        let (kind, text) = open_error(&path, &camera(2, 2));
        assert_eq!(kind, ErrorKind::Input, "{name} {text}");
    }
}

#[test]
fn a_pipe_that_ends_within_a_frame_is_an_error() {
    let complete = y4m("W2 H2 Cmono", &[&[1; 4], &[2; 4]]);
    let count = |bytes: &[u8]| {
        let pipe = Box::new(Cursor::new(bytes.to_vec()));
        frames(&mut *open_reader(pipe, "pipe", &camera(2, 2)).unwrap()).map(|f| f.len())
    };
    assert_eq!(count(&complete).unwrap(), 2);
    assert_eq!(count(&complete[..complete.len() - 10]).unwrap(), 1);
    for less in 1..10 {
        let error = count(&complete[..complete.len() - less]).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Input, "{less}");
    }
}

fn ffmpeg() -> bool {
    let is_installed = Command::new("ffmpeg").arg("-version").output().is_ok();
    if !is_installed {
        println!("skipped: no ffmpeg on PATH");
    }
    is_installed
}

#[test]
fn ffmpeg_decodes_a_color_video_to_the_correct_light() {
    if !ffmpeg() {
        return;
    }
    let dir = TempDir::new().unwrap();
    // ffmpeg must read the whole text as a file name, although it contains a colon and spaces.
    let path = dir.path().join("a: b.mkv");
    let status = Command::new("ffmpeg")
        .args(["-v", "error", "-f", "lavfi", "-i", "color=c=0x00bc00:s=64x48:r=25:d=0.4"])
        .args(["-c:v", "ffv1", "-pix_fmt", "gbrp"])
        .arg(format!("file:{}", path.display()))
        .status()
        .unwrap();
    assert!(status.success());
    let mut source = open(&path, &camera(64, 48)).unwrap();
    assert_eq!(source.rate(), Some(Rate::new(25, 1).unwrap()));
    let got = frames(&mut *source).unwrap();
    assert_eq!(got.len(), 10);
    // The light of code 188 is 0.5029, and the weight of green is 0.7152. The conversion to 8-bit Y'CbCr changes G' by
    // up to two codes. One code of G' is 0.006 in light.
    let light = got[9].get(20, 30);
    assert!((light - 0.7152 * 0.5029).abs() < 0.009, "{light}");
}

/// Writes gray codes from 0 to 1023 in steps of 8 as a lossless video with the pixel format `pixels` and the tags
/// `tags`.
fn ramp(dir: &TempDir, pixels: &str, scale: u16, tags: &[&str]) -> PathBuf {
    let (wide, bytes) = (128, if scale == 0 { 1 } else { 2 });
    let store = |code: u16| match bytes {
        1 => vec![(code / 4) as u8],
        _ => (code * scale).to_le_bytes().to_vec(),
    };
    let luma = || (0..4).flat_map(|_| (0..wide).flat_map(|x| store(8 * x)));
    let middle = (0..if pixels.starts_with("yuv") { 2 * wide } else { 0 }).flat_map(|_| store(512));
    let raw: Vec<u8> = match pixels {
        _ if pixels.starts_with("gbrp") => luma().chain(luma()).chain(luma()).collect(),
        _ => luma().chain(middle).collect(),
    };
    let source = put(dir, "ramp.raw", raw);
    let path = dir.path().join("ramp.mkv");
    let status = Command::new("ffmpeg")
        .args(["-y", "-v", "error", "-f", "rawvideo", "-s", "128x4", "-pix_fmt", pixels, "-i"])
        .arg(source)
        .args(["-c:v", "ffv1"])
        .args(tags)
        .arg(&path)
        .status()
        .unwrap();
    assert!(status.success(), "{pixels} {tags:?}");
    path
}

/// The matrix does not affect neutral gray. The codes are decoded without loss, so the only errors are the rounding
/// errors of the 16-bit table and of the 16-bit sample. These two errors are much smaller than half a 10-bit code,
/// which is 5e-4 in light.
#[test]
fn ffmpeg_decodes_gray_of_any_depth_range_and_matrix_within_half_a_code() {
    if !ffmpeg() {
        return;
    }
    let dir = TempDir::new().unwrap();
    let full = &["-color_range", "pc"][..];
    let limited = |c: f32| ((c - 64.0) / 876.0).clamp(0.0, 1.0);
    let ten_bit = |c: f32| c / 1023.0;
    let eight = |c: f32| (((c / 4.0).floor() - 16.0) / 219.0).clamp(0.0, 1.0);
    let eight_full = |c: f32| (c / 4.0).floor() / 255.0;
    let twelve = |c: f32| c * 4.0 / 4095.0;
    let sixteen = |c: f32| c * 64.0 / 65535.0;
    type Case<'a> = (&'a str, u16, &'a [&'a str], &'a dyn Fn(f32) -> f32);
    let cases: [Case<'_>; 16] = [
        ("yuv420p10le", 1, &[], &limited),
        ("yuv420p10le", 1, &["-colorspace", "bt709"], &limited),
        ("yuv420p10le", 1, &["-colorspace", "smpte170m"], &limited),
        ("yuv420p10le", 1, &["-colorspace", "bt2020nc"], &limited),
        ("yuv420p10le", 1, full, &ten_bit),
        ("yuv420p12le", 4, full, &twelve),
        ("yuv420p16le", 64, full, &sixteen),
        ("yuv420p", 0, &[], &eight),
        ("yuv420p", 0, &["-colorspace", "smpte170m"], &eight),
        ("yuv420p", 0, full, &eight_full),
        ("gray", 0, &[], &eight_full),
        ("gray10le", 1, &[], &ten_bit),
        ("gray12le", 4, &[], &twelve),
        ("gray16le", 64, &[], &sixteen),
        ("gbrp10le", 1, &[], &ten_bit),
        ("gbrp16le", 64, &[], &sixteen),
    ];
    for (pixels, scale, tags, light_of) in cases {
        let path = ramp(&dir, pixels, scale, tags);
        let mut options = camera(128, 4);
        options.transfer = Some(Transfer::Linear);
        let light = read(&path, &options).unwrap()[0].to_f32();
        for (x, got) in light.iter().take(128).enumerate() {
            let wanted = light_of(8.0 * x as f32);
            assert!((got - wanted).abs() < 3e-5, "{pixels} {tags:?}, code {}: {got} {wanted}", 8 * x);
        }
    }
}

/// Decodes a saturated color that is encoded according to each standard, with 10 bits and limited range.
///
/// Each code has a rounding error of up to 0.5. Full swing is 876 codes for Y', and 896 codes for Cb and Cr. The
/// largest factor of Cb or Cr in the conversion to R'G'B' is 2 x 0.94. Each of R', G' and B' therefore changes by at
/// most 0.5 / 876 + 2 x 0.94 x 0.5 / 896 = 0.0016. A wrong matrix changes R', G' and B' by at least 0.01.
#[test]
fn ten_bit_colors_are_decoded_with_the_declared_matrix() {
    if !ffmpeg() {
        return;
    }
    let dir = TempDir::new().unwrap();
    let rgb = [0.25_f64, 0.875, 0.125];
    for (tag, kr, kb) in [
        ("smpte170m", 0.299, 0.114),
        ("bt709", 0.2126, 0.0722),
        ("bt2020nc", 0.2627, 0.0593),
        ("smpte240m", 0.212, 0.087),
        ("fcc", 0.30, 0.11),
    ] {
        let y = kr * rgb[0] + (1.0 - kr - kb) * rgb[1] + kb * rgb[2];
        let (cb, cr) = ((rgb[2] - y) / (2.0 - 2.0 * kb), (rgb[0] - y) / (2.0 - 2.0 * kr));
        let codes = [64.0 + 876.0 * y, 512.0 + 896.0 * cb, 512.0 + 896.0 * cr].map(|c| c.round() as u16);
        let raw: Vec<u8> = codes.iter().flat_map(|c| [c.to_le_bytes(); 64].concat()).collect();
        let source = put(&dir, "color.raw", raw);
        let path = dir.path().join("color.mkv");
        let status = Command::new("ffmpeg")
            .args(["-y", "-v", "error", "-f", "rawvideo", "-s", "8x8", "-pix_fmt", "yuv444p10le", "-i"])
            .arg(source)
            .args(["-c:v", "ffv1", "-colorspace", tag])
            .arg(&path)
            .status()
            .unwrap();
        assert!(status.success(), "{tag}");
        let mut options = camera(8, 8);
        options.transfer = Some(Transfer::Linear);
        let got = f64::from(read(&path, &options).unwrap()[0].get(4, 4));
        let wanted = 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2];
        assert!((got - wanted).abs() < 0.0016, "{tag}: {got} {wanted}");
    }
}

#[test]
fn mono_of_ten_and_sixteen_bits_has_the_white_of_its_depth() {
    for (space, white) in [("mono10", 1023_u16), ("mono14", 16383), ("mono16", 65535)] {
        let got = light(&format!("W2 H1 C{space}"), &[[0, 0], white.to_le_bytes()].concat(), (2, 1));
        assert_eq!(got, [0.0, 1.0], "{space}");
    }
}

#[test]
fn a_decode_error_quotes_ffmpeg() {
    if !ffmpeg() {
        return;
    }
    let dir = TempDir::new().unwrap();
    let path = put(&dir, "no.mp4", "this is no video");
    let (kind, text) = open_error(&path, &camera(4, 4));
    assert_eq!(kind, ErrorKind::Input);
    assert!(text.contains("Invalid data"), "{text}");
}

#[test]
fn a_missing_ffmpeg_says_how_to_get_it() {
    let dir = TempDir::new().unwrap();
    let path = put(&dir, "v.mp4", "x");
    let size = Geometry::new(4, 4).unwrap();
    let error = FfmpegSource::open_with(
        "no-such-ffmpeg",
        &path,
        size,
        ResizeMode::Cover,
        Linearization::new(None),
        false,
    )
    .err()
    .unwrap();
    assert_eq!(error.kind(), ErrorKind::Tool);
    assert!(error.to_string().contains("install"), "{error}");
}

#[test]
fn a_file_that_is_cut_while_it_is_read_is_an_error_that_names_it() {
    let dir = TempDir::new().unwrap();
    // The data are larger than the buffers of the readers and of the archive thread.
    let (side, count) = (300, 40);
    // The archive cannot compress pseudorandom bytes.
    let values: Vec<u8> = (0..(count * side * side) as u32)
        .map(|i| (i.wrapping_mul(2_654_435_761) >> 21) as u8 ^ (i >> 3) as u8)
        .collect();
    let shape = [count as u64, side as u64, side as u64];
    let [video, array, archive] = ["a.y4m", "a.npy", "a.npz"].map(|name| dir.path().join(name));
    let mut bytes = format!("YUV4MPEG2 W{side} H{side} F25:1 Ip A1:1 Cmono\n").into_bytes();
    values.chunks(side * side).for_each(|frame| bytes.extend([&b"FRAME\n"[..], frame].concat()));
    fs::write(&video, bytes).unwrap();
    let mut bytes = spikelane::unstable::npy::header_bytes(spikelane::unstable::npy::Element::U8, &shape);
    bytes.extend(&values);
    fs::write(&array, bytes).unwrap();
    npz(&archive, &["light"], &values, &shape);
    for path in [video, array, archive] {
        let options = InputOptions::new(Geometry::new(8, 8).unwrap());
        let mut source = open(&path, &options).unwrap();
        let mut frame = Frame::dark(source.geometry());
        assert!(source.next_frame(&mut frame).unwrap());
        let file = fs::OpenOptions::new().write(true).open(&path).unwrap();
        file.set_len(file.metadata().unwrap().len() / 2).unwrap();
        let error = std::iter::repeat_with(|| source.next_frame(&mut frame)).find_map(Result::err).unwrap();
        let text = error.to_string();
        assert!(matches!(error.kind(), ErrorKind::Input | ErrorKind::Io), "{text}");
        assert!(text.contains(&*path.file_name().unwrap().to_string_lossy()), "{text}");
    }
}
