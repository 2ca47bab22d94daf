//! Tests that what an image file states about its pages, codes, curve, channels and times is used or reported.

use std::fs;
use std::io::Cursor;
use std::path::{Path, PathBuf};

use exr::prelude::{AnyChannel, AnyChannels, FlatSamples, Image as ExrImage, Layer, WritableImage};
use exr::prelude::{Encoding as ExrEncoding, LayerAttributes, SmallVec};
use image::codecs::png::PngEncoder;
use image::codecs::webp::WebPEncoder;
use image::{DynamicImage, ExtendedColorType, GrayImage, ImageBuffer, ImageEncoder, Luma, Rgb, RgbaImage};
use moxcms::ColorProfile;
use spikelane::{ErrorKind, Geometry, Seeds};
use spikelane_io::light::{Frame, InputOptions, Interpolation, Rate, Source, Timeline, Transfer, open};
use spikelane_io::simulate::RunOptions;
use tempfile::TempDir;
use tiff::encoder::colortype::{ColorType, Gray8, Gray16, Gray32Float, GrayI16};
use tiff::encoder::{TiffEncoder, TiffValue};
use tiff::tags::Tag;

pub(crate) const SIZE: (u32, u32) = (4, 2);

pub(crate) fn options() -> InputOptions {
    InputOptions::new(Geometry::new(SIZE.0, SIZE.1).unwrap())
}

pub(crate) fn linear() -> InputOptions {
    options().with_transfer(Some(Transfer::Linear))
}

/// The lights of the first pixel of all frames, and the notes.
pub(crate) fn read(path: &Path, options: &InputOptions) -> (Vec<f32>, String) {
    let mut source = open(path, options).unwrap();
    let notes = source.notes().join("\n");
    (first_pixels(&mut *source), notes)
}

pub(crate) fn first_pixels(source: &mut dyn Source) -> Vec<f32> {
    let mut frame = Frame::dark(source.geometry());
    let mut lights = Vec::new();
    while source.next_frame(&mut frame).unwrap() {
        lights.push(frame.get(0, 0));
    }
    lights
}

pub(crate) fn refusal(path: &Path, options: &InputOptions) -> String {
    let mut frame = Frame::dark(options.camera);
    let error = open(path, options).and_then(|mut source| source.next_frame(&mut frame)).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Input, "{error}");
    error.to_string()
}

pub(crate) fn near(lights: &[f32], wanted: &[f32]) {
    assert_eq!(lights.len(), wanted.len(), "{lights:?}");
    assert!(lights.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-4), "{lights:?} {wanted:?}");
}

pub(crate) fn file(folder: &TempDir, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
    let path = folder.path().join(name);
    fs::write(&path, bytes).unwrap();
    path
}

/// Returns a TIFF with one page per value.
pub(crate) fn tiff<C: ColorType>(pages: &[C::Inner], tags: &[(Tag, &str, u16)]) -> Vec<u8>
where
    [C::Inner]: TiffValue,
    C::Inner: Copy,
{
    let mut bytes = Cursor::new(Vec::new());
    let mut encoder = TiffEncoder::new(&mut bytes).unwrap();
    for value in pages {
        let mut page = encoder.new_image::<C>(SIZE.0, SIZE.1).unwrap();
        for (tag, text, number) in tags {
            let directory = page.encoder();
            if text.is_empty() {
                directory.write_tag(*tag, *number).unwrap();
            } else {
                directory.write_tag(*tag, *text).unwrap();
            }
        }
        page.write_data(&vec![*value; (SIZE.0 * SIZE.1) as usize]).unwrap();
    }
    bytes.into_inner()
}

pub(crate) fn png(image: &DynamicImage) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    image.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
    bytes.into_inner()
}

pub(crate) fn gray8(code: u8) -> DynamicImage {
    GrayImage::from_pixel(SIZE.0, SIZE.1, Luma([code])).into()
}

pub(crate) fn gray16(code: u16) -> DynamicImage {
    ImageBuffer::<Luma<u16>, _>::from_pixel(SIZE.0, SIZE.1, Luma([code])).into()
}

fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0_u32, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |c, _| if c & 1 == 1 { c >> 1 ^ 0xEDB8_8320 } else { c >> 1 })
    })
}

pub(crate) fn chunk(kind: &[u8; 4], data: &[u8]) -> Vec<u8> {
    let body = [&kind[..], data].concat();
    [&(data.len() as u32).to_be_bytes()[..], &body, &crc32(&body).to_be_bytes()].concat()
}

/// Returns a PNG with additional chunks after the header.
pub(crate) fn png_with(image: &DynamicImage, chunks: &[(&[u8; 4], &[u8])]) -> Vec<u8> {
    let bytes = png(image);
    // The signature has 8 bytes, and the chunk IHDR has 25 bytes.
    let chunks = chunks.iter().flat_map(|(kind, data)| chunk(kind, data));
    bytes[..33].iter().copied().chain(chunks).chain(bytes[33..].iter().copied()).collect()
}

/// Returns the compressed samples of a PNG.
pub(crate) fn samples_of(png: &[u8]) -> Vec<u8> {
    let (mut at, mut samples) = (8, Vec::new());
    while at < png.len() {
        let len = u32::from_be_bytes(png[at..at + 4].try_into().unwrap()) as usize;
        if &png[at + 4..at + 8] == b"IDAT" {
            samples.extend(&png[at + 8..at + 8 + len]);
        }
        at += 12 + len;
    }
    samples
}

/// Returns an animated PNG of gray frames with 8 bits. A frame has a code and a duration in milliseconds.
pub(crate) fn apng(frames: &[(u8, u16)]) -> Vec<u8> {
    let frames: Vec<_> = frames.iter().map(|(code, time)| (gray8(*code), [0; 2], [0; 2], *time)).collect();
    apng_of(SIZE, &frames)
}

/// Returns an animated PNG. A frame has a picture, its offset, its disposal and blending, and a duration in milliseconds.
pub(crate) fn apng_of(size: (u32, u32), frames: &[(DynamicImage, [u32; 2], [u8; 2], u16)]) -> Vec<u8> {
    let mut sequence = 0_u32;
    let mut number = || {
        sequence += 1;
        (sequence - 1).to_be_bytes()
    };
    let mut bytes = png(&frames[0].0)[..33].to_vec();
    bytes.extend(chunk(b"acTL", &[(frames.len() as u32).to_be_bytes(), [0; 4]].concat()));
    assert_eq!((frames[0].0.width(), frames[0].0.height()), size, "the first frame is the canvas");
    for (i, (image, offset, operations, milliseconds)) in frames.iter().enumerate() {
        let [w, h, x, y] = [image.width(), image.height(), offset[0], offset[1]].map(u32::to_be_bytes);
        let times = [milliseconds.to_be_bytes(), 1000_u16.to_be_bytes()].concat();
        let control = [&number()[..], &w, &h, &x, &y, &times, operations];
        bytes.extend(chunk(b"fcTL", &control.concat()));
        let samples = samples_of(&png(image));
        bytes.extend(if i == 0 {
            chunk(b"IDAT", &samples)
        } else {
            chunk(b"fdAT", &[&number()[..], &samples].concat())
        });
    }
    bytes.extend(chunk(b"IEND", &[]));
    bytes
}

/// Returns an animated WebP. A frame has a code and a duration in milliseconds.
pub(crate) fn animated_webp(frames: &[(u8, u8)]) -> Vec<u8> {
    let riff_chunk = |kind: &[u8; 4], data: &[u8]| {
        let padding = vec![0; data.len() % 2];
        [&kind[..], &(data.len() as u32).to_le_bytes(), data, &padding].concat()
    };
    let (w, h) = ([SIZE.0 as u8 - 1, 0, 0], [SIZE.1 as u8 - 1, 0, 0]);
    let mut chunks = riff_chunk(b"VP8X", &[&[2, 0, 0, 0][..], &w, &h].concat());
    chunks.extend(riff_chunk(b"ANIM", &[0; 6]));
    for (code, milliseconds) in frames {
        let mut still = Vec::new();
        let rgb = gray8(*code).into_rgb8();
        WebPEncoder::new_lossless(&mut still)
            .write_image(&rgb, SIZE.0, SIZE.1, ExtendedColorType::Rgb8)
            .unwrap();
        // The picture follows the 12 bytes of the header of the file.
        let frame = [&[0; 6][..], &w, &h, &[*milliseconds, 0, 0, 0], &still[12..]].concat();
        chunks.extend(riff_chunk(b"ANMF", &frame));
    }
    let body = [b"WEBP", &chunks[..]].concat();
    [b"RIFF", &(body.len() as u32).to_le_bytes()[..], &body].concat()
}

#[test]
fn all_pages_of_a_tiff_are_frames() {
    let dir = TempDir::new().unwrap();
    let path = file(&dir, "s.tif", tiff::<Gray8>(&[51, 102, 255], &[]));
    near(&read(&path, &linear()).0, &[0.2, 0.4, 1.0]);
    let source = open(&path, &linear()).unwrap();
    assert_eq!((source.frames(), source.rate()), (Some(3), None));
}

#[test]
fn the_interval_of_imagej_is_the_rate_of_a_tiff() {
    let dir = TempDir::new().unwrap();
    let description = "ImageJ=1.53k\nimages=2\nfinterval=0.02\n";
    let path = file(&dir, "s.tif", tiff::<Gray8>(&[1, 2], &[(Tag::ImageDescription, description, 0)]));
    assert_eq!(open(&path, &linear()).unwrap().rate().map(Rate::hz), Some(50.0));
}

#[test]
fn pages_that_are_thumbnails_are_reported() {
    let dir = TempDir::new().unwrap();
    let path = file(&dir, "s.tif", tiff::<Gray8>(&[51, 102], &[(Tag::NewSubfileType, "", 1)]));
    let (lights, notes) = read(&path, &linear());
    near(&lights, &[0.2]);
    // A single page is read as a still picture, whose notes are those of its file.
    assert!(notes.contains("not used: 1 page (thumbnails"), "{notes}");
}

#[test]
fn all_frames_of_an_animation_are_frames_with_their_times() {
    let dir = TempDir::new().unwrap();
    let codes = [51, 102, 255];
    let uneven = [(51, 10), (102, 30), (255, 10)];
    let files = [
        file(&dir, "a.png", apng(&codes.map(|c| (c, 20)))),
        file(&dir, "a.webp", animated_webp(&codes.map(|c| (c, 20)))),
        file(&dir, "b.png", apng(&uneven.map(|(c, t)| (c, t.into())))),
        file(&dir, "b.webp", animated_webp(&uneven)),
    ];
    for (path, is_uneven) in files.iter().zip([false, false, true, true]) {
        let mut source = open(path, &linear()).unwrap();
        near(&first_pixels(&mut *source), &[0.2, 0.4, 1.0]);
        assert_eq!(source.frames(), Some(3));
        let times = [0, 10_000_000, 40_000_000];
        assert_eq!(source.frame_times(), is_uneven.then_some(&times[..]), "{}", path.display());
        assert_eq!(source.rate().map(Rate::hz), (!is_uneven).then_some(50.0));
    }
}

#[test]
fn a_duration_of_zero_is_reported() {
    let dir = TempDir::new().unwrap();
    let path = file(&dir, "a.png", apng(&[(1, 0), (2, 10)]));
    let source = open(&path, &linear()).unwrap();
    assert!(
        source.rate().is_none() && source.notes()[0].contains("durations of the frames"),
        "{:?}",
        source.notes()
    );
}

#[test]
fn a_truncated_animation_is_an_error() {
    let dir = TempDir::new().unwrap();
    let webp = animated_webp(&[(1, 9), (2, 9)]);
    let last_frame = webp.windows(4).rposition(|bytes| bytes == b"ANMF").unwrap();
    let apng = apng(&[(1, 9), (2, 9)]);
    for (name, bytes) in [
        ("a.png", &apng[..apng.len() - 40]),
        ("a.webp", &webp[..webp.len() - 40]),
        ("whole frames.webp", &webp[..last_frame]),
    ] {
        let path = file(&dir, name, bytes);
        let result = open(&path, &linear()).and_then(|mut source| {
            let mut frame = Frame::dark(source.geometry());
            while source.next_frame(&mut frame)? {}
            Ok(())
        });
        assert_eq!(result.unwrap_err().kind(), ErrorKind::Input, "{name}");
    }
}

#[test]
fn several_pages_in_the_files_of_a_folder_are_reported() {
    let dir = TempDir::new().unwrap();
    file(&dir, "1.tif", tiff::<Gray8>(&[51, 102], &[]));
    file(&dir, "2.tif", tiff::<Gray8>(&[102], &[]));
    let (lights, notes) = read(dir.path(), &linear());
    near(&lights, &[0.2, 0.4]);
    assert!(notes.contains("1 file with several pages"), "{notes}");
}

#[test]
fn full_scale_applies_to_pictures() {
    let dir = TempDir::new().unwrap();
    let paths = [
        file(&dir, "g.png", png(&gray16(2048))),
        file(&dir, "g.tif", tiff::<Gray16>(&[2048], &[])),
        file(&dir, "r.png", png(&gray16(2048).into_rgb16().into())),
    ];
    for path in paths {
        near(&read(&path, &linear().with_scale(Some(4096.0))).0, &[0.5]);
        let srgb = read(&path, &options().with_scale(Some(4096.0))).0;
        near(&srgb, &[Transfer::Srgb.light(0.5) as f32]);
    }
    let small = file(&dir, "s.png", png(&gray8(100)));
    near(&read(&small, &linear().with_scale(Some(50.0))).0, &[2.0]);
    let error = open(&small, &linear().with_scale(Some(0.0))).err().unwrap();
    assert_eq!(error.kind(), ErrorKind::Usage);
}

#[test]
fn full_scale_of_a_video_is_a_code_of_its_depth() {
    let dir = TempDir::new().unwrap();
    let header = "YUV4MPEG2 W4 H2 F25:1 Cmono10 XCOLORRANGE=FULL\nFRAME\n";
    let samples: Vec<u8> = [512_u16; 8].iter().flat_map(|c| c.to_le_bytes()).collect();
    let path = file(&dir, "v.y4m", [header.as_bytes(), &samples].concat());
    near(&read(&path, &linear().with_scale(Some(256.0))).0, &[2.0]);
}

#[test]
fn codes_of_fewer_bits_are_reported_with_the_full_scale_that_fits() {
    let dir = TempDir::new().unwrap();
    let array = spikelane_array(&[2048; 8]);
    let paths = [
        file(&dir, "g.png", png(&gray16(2048))),
        file(&dir, "g.tif", tiff::<Gray16>(&[2048], &[])),
        file(&dir, "s.tif", tiff::<Gray16>(&[0, 2048, 4095, 7], &[])),
        file(&dir, "g.npy", array),
    ];
    for path in &paths {
        let notes = read(path, &linear()).1;
        assert!(notes.contains("16 times too small") && notes.contains("to 4095"), "{notes}");
        assert!(!read(path, &linear().with_scale(Some(4095.0))).1.contains("too dark"));
    }
    let bright = file(&dir, "b.tif", tiff::<Gray16>(&[0, 2048, 5000], &[]));
    assert_eq!(read(&bright, &linear()).1, "");
}

/// Returns a `.npy` with one 16-bit frame.
pub(crate) fn spikelane_array(codes: &[u16]) -> Vec<u8> {
    let header = "{'descr': '<u2', 'fortran_order': False, 'shape': (1, 2, 4), }";
    let header = format!("{header:<117}\n");
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.extend(codes.iter().flat_map(|c| c.to_le_bytes()));
    bytes
}

#[test]
fn a_stated_depth_is_used() {
    let dir = TempDir::new().unwrap();
    // Samples of a PNG with sBIT are scaled to 16 bits. Code 2047 of 4095 is not a scaled code, so it is not scaled.
    let paths = [
        (file(&dir, "m.tif", tiff::<Gray16>(&[2047], &[(Tag::MaxSampleValue, "", 4095)])), 2047.0 / 4095.0),
        (file(&dir, "u.png", png_with(&gray16(2047), &[(b"sBIT", &[12])])), 2047.0 / 4095.0),
        (file(&dir, "s.png", png_with(&gray16(2048), &[(b"sBIT", &[12])])), 2048.0 / 65535.0),
        (file(&dir, "p.pgm", [&b"P5 4 2 4095\n"[..], &[0x07, 0xFF].repeat(8)].concat()), 2047.0 / 4095.0),
        (file(&dir, "q.pgm", [&b"P5 4 2 100\n"[..], &[40; 8]].concat()), 0.4),
        (file(&dir, "b.pbm", [&b"P4 4 2\n"[..], &[0, 0]].concat()), 1.0),
    ];
    for (path, wanted) in paths {
        let (lights, notes) = read(&path, &linear());
        near(&lights, &[wanted]);
        assert_eq!(notes, "", "{}", path.display());
    }
    let odd = file(&dir, "o.tif", tiff::<Gray16>(&[65535], &[(Tag::MaxSampleValue, "", 40_000)]));
    let (lights, notes) = read(&odd, &linear());
    near(&lights, &[1.0]);
    assert!(notes.contains("MaxSampleValue 40000"), "{notes}");
}

#[test]
fn codes_of_4_packed_bits_are_read() {
    let dir = TempDir::new().unwrap();
    // A row of four samples has two bytes. BitsPerSample is changed from 8 to 4, and StripByteCounts from 8 to 4.
    let mut bytes = tiff::<Gray8>(&[0x66], &[]);
    let directory = u32::from_le_bytes(bytes[4..8].try_into().unwrap()) as usize;
    let count = usize::from(u16::from_le_bytes([bytes[directory], bytes[directory + 1]]));
    for entry in (0..count).map(|i| directory + 2 + 12 * i) {
        if matches!(u16::from_le_bytes([bytes[entry], bytes[entry + 1]]), 258 | 279) {
            bytes[entry + 8] = 4;
        }
    }
    near(&read(&file(&dir, "p.tif", bytes), &linear()).0, &[0.4]);
}

#[test]
fn gray_floats_of_every_format_are_light() {
    let dir = TempDir::new().unwrap();
    let pfm = |value: f32| [&b"Pf\n4 2\n-1.0\n"[..], &value.to_le_bytes().repeat(8)].concat();
    let paths = |value: f32| {
        [
            file(&dir, "f.tif", tiff::<Gray32Float>(&[value], &[])),
            file(&dir, "f.pfm", pfm(value)),
            exr(&dir, "f.exr", &[("Y", value)]),
        ]
    };
    for path in paths(1.5) {
        near(&read(&path, &options()).0, &[1.5]);
    }
    for path in paths(200.0) {
        assert!(refusal(&path, &options()).contains("200"));
        near(&read(&path, &options().with_scale(Some(400.0))).0, &[0.5]);
    }
    for path in paths(-1.0).into_iter().chain(paths(f32::NAN)) {
        let text = refusal(&path, &options());
        assert!(text.contains("row 0, col 0"), "{text}");
    }
}

#[test]
fn other_integers_of_a_tiff_require_a_full_scale() {
    let dir = TempDir::new().unwrap();
    let path = file(&dir, "i.tif", tiff::<GrayI16>(&[1000], &[]));
    assert!(refusal(&path, &options()).contains("1000"));
    near(&read(&path, &options().with_scale(Some(2000.0))).0, &[0.5]);
}

#[test]
fn the_rows_of_a_pfm_are_stored_from_bottom_to_top() {
    let dir = TempDir::new().unwrap();
    let rows: Vec<u8> = [0.25_f32, 0.75].iter().flat_map(|x| x.to_be_bytes().repeat(12)).collect();
    let path = file(&dir, "c.pfm", [&b"PF 4 2 1.0\n"[..], &rows].concat());
    near(&read(&path, &options()).0, &[0.75]);
    let scaled = file(&dir, "s.pfm", [&b"PF 4 2 2.5\n"[..], &rows].concat());
    assert!(read(&scaled, &options()).1.contains("the scale 2.5"));
    let short = file(&dir, "t.pfm", b"PF 4 2 1.0\n1234");
    assert!(refusal(&short, &options()).contains("truncated"));
}

#[test]
fn a_radiance_picture_is_read_and_its_exposure_reported() {
    let dir = TempDir::new().unwrap();
    let mut bytes = Vec::new();
    let pixels = [Rgb([1.5_f32; 3]); 8];
    image::codecs::hdr::HdrEncoder::new(&mut bytes).encode(&pixels, 4, 2).unwrap();
    let path = file(&dir, "h.hdr", &bytes);
    near(&read(&path, &options()).0, &[1.5]);
    let at = bytes.iter().position(|b| *b == b'\n').unwrap() + 1;
    let exposed = [&bytes[..at], b"EXPOSURE=2.0\n", &bytes[at..]].concat();
    let path = file(&dir, "e.hdr", exposed);
    assert!(read(&path, &options()).1.contains("EXPOSURE=2.0"));
}

/// Writes an EXR with channels of one value each.
pub(crate) fn exr(folder: &TempDir, name: &str, channels: &[(&str, f32)]) -> PathBuf {
    let path = folder.path().join(name);
    let samples = |value: f32| FlatSamples::F32(vec![value; 8]);
    let list: SmallVec<[AnyChannel<FlatSamples>; 4]> =
        channels.iter().map(|(name, value)| AnyChannel::new(*name, samples(*value))).collect();
    let layer =
        Layer::new((4, 2), LayerAttributes::default(), ExrEncoding::UNCOMPRESSED, AnyChannels::sort(list));
    ExrImage::from_layer(layer).write().to_file(&path).unwrap();
    path
}

#[test]
fn the_picture_of_an_exr_with_layers_is_found() {
    let dir = TempDir::new().unwrap();
    let color = |layer: &'static str, value: f32| {
        ["R", "G", "B"].map(|c| (format!("{layer}{}{c}", if layer.is_empty() { "" } else { "." }), value))
    };
    let cases = [
        (vec![color("ViewLayer.Combined", 0.5).to_vec()], "", 0.5),
        (
            vec![color("View.Combined", 0.5).to_vec(), color("View.Diffuse", 0.25).to_vec()],
            "View.Diffuse",
            0.5,
        ),
        (vec![color("", 0.5).to_vec(), color("left", 0.25).to_vec()], "left", 0.5),
        (vec![vec![("main.Y".to_owned(), 0.5)], vec![("depth.Z".to_owned(), 9.0)]], "", 0.5),
    ];
    for (channels, ignored, light) in cases {
        let channels: Vec<(String, f32)> = channels.concat();
        let channels: Vec<(&str, f32)> =
            channels.iter().map(|(name, value)| (name.as_str(), *value)).collect();
        let (lights, notes) = read(&exr(&dir, "l.exr", &channels), &options());
        near(&lights, &[light]);
        assert!(notes.contains(ignored) && notes.is_empty() == ignored.is_empty(), "{notes}");
    }
}

#[test]
fn an_exr_without_a_picture_or_with_several_is_refused_by_its_channels() {
    let dir = TempDir::new().unwrap();
    let depth = exr(&dir, "z.exr", &[("Z", 1.0), ("mask.A", 1.0)]);
    let text = refusal(&depth, &options());
    assert!(text.contains('Z') && text.contains("mask.A"), "{text}");
    let several = exr(&dir, "s.exr", &[("left.Y", 1.0), ("right.Y", 1.0)]);
    let text = refusal(&several, &options());
    assert!(text.contains("left") && text.contains("right"), "{text}");
}

#[test]
fn the_curve_that_a_picture_states_is_used() {
    let dir = TempDir::new().unwrap();
    let light = |transfer: Transfer| transfer.light(128.0 / 255.0) as f32;
    let gamma = 55_556_u32.to_be_bytes();
    let cases: [(&[u8; 4], &[u8], Transfer); 6] = [
        (b"gAMA", &gamma, Transfer::Gamma(1.8)),
        (b"gAMA", &100_000_u32.to_be_bytes(), Transfer::Linear),
        (b"gAMA", &45_455_u32.to_be_bytes(), Transfer::Srgb),
        (b"cICP", &[9, 16, 0, 1], Transfer::Pq),
        (b"cICP", &[9, 18, 0, 1], Transfer::Hlg),
        (b"sRGB", &[0], Transfer::Srgb),
    ];
    for (kind, data, transfer) in cases {
        for image in [gray8(128), gray8(128).into_rgb8().into()] {
            let path = file(&dir, "c.png", png_with(&image, &[(kind, data)]));
            near(&read(&path, &options()).0, &[light(transfer)]);
            assert_eq!(open(&path, &options()).unwrap().front_end().transfer, Some(transfer));
            // A declared curve and the curve of a camera override the curve of the file.
            near(&read(&path, &linear()).0, &[128.0 / 255.0]);
        }
    }
}

#[test]
fn the_full_scale_of_hdr_pictures_is_stated() {
    let dir = TempDir::new().unwrap();
    let path = file(&dir, "c.png", png_with(&gray8(128), &[(b"cICP", &[9, 16, 0, 1])]));
    let notes = read(&path, &options()).1;
    assert!(notes.contains("10,000 cd/m2") && notes.contains("to 148"), "{notes}");
    // Code 148 is 203 cd/m2.
    let white = file(&dir, "w.png", png_with(&gray8(148), &[(b"cICP", &[9, 16, 0, 1])]));
    near(&read(&white, &options()).0, &[0.0203]);
    let overridden = read(&path, &linear()).1;
    assert!(overridden.contains("PQ") && overridden.contains("linear"), "{overridden}");
}

#[test]
fn a_curve_that_is_not_supported_is_reported() {
    let dir = TempDir::new().unwrap();
    let path = file(&dir, "c.png", png_with(&gray8(128), &[(b"cICP", &[9, 9, 0, 1])]));
    let notes = read(&path, &options()).1;
    assert!(notes.contains("characteristics 9") && notes.contains("transfer"), "{notes}");
}

#[test]
fn the_tone_curve_of_a_color_profile_is_used() {
    let dir = TempDir::new().unwrap();
    let profile = ColorProfile::new_gray_with_gamma(1.0).encode().unwrap();
    let codes = gray8(128);
    let mut png = Vec::new();
    let mut encoder = PngEncoder::new(&mut png);
    encoder.set_icc_profile(profile.clone()).unwrap();
    encoder.write_image(codes.as_bytes(), 4, 2, ExtendedColorType::L8).unwrap();
    let mut webp = Vec::new();
    let mut encoder = WebPEncoder::new_lossless(&mut webp);
    encoder.set_icc_profile(profile).unwrap();
    encoder.write_image(codes.as_bytes(), 4, 2, ExtendedColorType::L8).unwrap();
    for (name, bytes) in [("p.png", png), ("p.webp", webp)] {
        near(&read(&file(&dir, name, bytes), &options()).0, &[128.0 / 255.0]);
    }
}

#[test]
fn images_of_a_folder_with_different_curves_are_refused() {
    let dir = TempDir::new().unwrap();
    file(&dir, "1.png", png(&gray8(1)));
    file(&dir, "2.png", png_with(&gray8(1), &[(b"gAMA", &100_000_u32.to_be_bytes())]));
    let text = refusal(dir.path(), &options());
    assert!(text.contains("2.png") && text.contains("linear"), "{text}");
    near(&read(dir.path(), &linear()).0, &[1.0 / 255.0; 2]);
}

#[test]
fn transparency_is_reported() {
    let dir = TempDir::new().unwrap();
    let image = |alpha| RgbaImage::from_pixel(4, 2, image::Rgba([255, 255, 255, alpha])).into();
    for (alpha, is_reported) in [(255, false), (254, true)] {
        let path = file(&dir, "a.png", png(&image(alpha)));
        let (lights, notes) = read(&path, &options());
        near(&lights, &[1.0]);
        assert_eq!(notes.contains("alpha is not used"), is_reported, "{notes}");
    }
}

#[test]
fn times_beside_images_are_read_in_the_units_of_their_programs() {
    let wide =
        |text: &str| [0xFEFF].into_iter().chain(text.encode_utf16()).flat_map(u16::to_le_bytes).collect();
    let cases: [(&str, Vec<u8>); 5] = [
        ("timestamps.txt", b"\xEF\xBB\xBF0\r\n0.01\r\n0.03\r\n".to_vec()),
        ("timestamps.txt", b"0,00\n0,01\n0,03\n".to_vec()),
        ("timestamps.txt", wide("0\r\n0.01\r\n0.03\r\n")),
        ("info.txt", b"./f/1.png 000000013767\n./f/2.png 000000023767\n./f/3.png 000000043767\n".to_vec()),
        ("images.csv", b"% time, name\n# by hand\n1,1.png\n10000001,2.png\n30000001,3.png\n".to_vec()),
    ];
    for (name, bytes) in cases {
        let dir = TempDir::new().unwrap();
        for i in 1..=3 {
            file(&dir, &format!("{i}.png"), png(&gray8(i)));
        }
        file(&dir, name, bytes);
        let source = open(dir.path(), &options()).unwrap();
        assert_eq!(source.frame_times(), Some(&[0, 10_000_000, 30_000_000][..]), "{name}");
        assert_eq!(source.notes(), Vec::<String>::new());
    }
}

#[test]
fn decimal_and_negative_numbers_in_names_determine_the_order() {
    for names in [
        ["frame_0", "frame_0.025", "frame_0.05", "frame_0.1"],
        ["-0.5", "-0.25", "0", "0.125"],
        ["t=1s", "t=1.125s", "t=1.25s", "t=1.5s"],
    ] {
        let dir = TempDir::new().unwrap();
        for (name, code) in names.iter().zip([0, 51, 102, 153]) {
            file(&dir, &format!("{name}.png"), png(&gray8(code)));
        }
        let (lights, notes) = read(dir.path(), &linear());
        near(&lights, &[0.0, 0.2, 0.4, 0.6]);
        assert!(notes.contains("not used as times") && notes.contains(names[3]), "{notes}");
        file(&dir, "timestamps.txt", "0\n0.001\n0.002\n0.003\n");
        assert_eq!(read(dir.path(), &linear()).1, "");
    }
}

#[test]
fn a_file_that_is_not_used_for_the_times_is_reported() {
    let dir = TempDir::new().unwrap();
    file(&dir, "1.png", png(&gray8(1)));
    file(&dir, "2.png", png(&gray8(1)));
    file(&dir, "info.txt", "recorded on Monday\nby hand\n");
    let source = open(dir.path(), &options()).unwrap();
    assert!(source.frame_times().is_none() && source.notes().join(" ").contains("info.txt is not used"));
}

#[test]
fn times_of_more_than_ten_million_readouts_are_refused_with_the_unit_that_fits() {
    let camera = spikelane::presets::builtin("ideal").unwrap();
    let readout = Rate::new(20_000, 1).unwrap();
    // The times are 0, 10, 30 and 70 ms in microseconds, but they are read as seconds.
    let starts = [0.0, 1e4, 3e4, 7e4].map(|s| (s * 1e9) as u64);
    let timeline = Timeline::from_times(&starts, readout, Interpolation::Linear).unwrap();
    let options = RunOptions::new(camera, Seeds::default(), timeline);
    let error = options.check_duration(Some(4)).unwrap_err().to_string();
    assert!(error.contains("microseconds (0.11 s in total)") && error.contains("readouts"), "{error}");
    assert!(RunOptions { readouts: Some(100), ..options.clone() }.check_duration(Some(4)).is_ok());
    let short = Timeline::from_times(&[0, 10_000_000], readout, Interpolation::Linear).unwrap();
    assert!(RunOptions { timeline: short, ..options }.check_duration(Some(2)).is_ok());
}
