//! One test for each cell of the tables of containers in `docs/reference/inputs.md`.
//!
//! A cell states what a property of a file changes, or that a warning reports the property (R).

use std::fs;
use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::process::Command;

use exr::meta::attribute::Text;
use exr::prelude::{
    AnyChannel, AnyChannels, Encoding as ExrEncoding, FlatSamples, Image as ExrImage, ImageAttributes,
    IntegerBounds, Layer, LayerAttributes, WritableImage, f16,
};
use image::codecs::jpeg::JpegEncoder;
use image::codecs::png::PngEncoder;
use image::codecs::webp::WebPEncoder;
use image::{DynamicImage, ExtendedColorType, GrayImage, ImageEncoder, Luma, Rgb, RgbImage, Rgba, RgbaImage};
use moxcms::ColorProfile;
use spikelane::sensor::FullScale;
use spikelane_io::light::{InputOptions, Rate, Transfer, open};
use tempfile::TempDir;

use crate::containers::{
    animated_webp, apng, apng_of, exr, file, gray8, gray16, linear, near, options, png, png_with, read,
    refusal, spikelane_array,
};

/// Defines a test for each cell, and the list of all cells: container, property and text.
macro_rules! cells {
    ($($name:ident: $container:literal, $property:literal, $text:literal => $body:block)*) => {
        $(
            #[test]
            fn $name() $body
        )*
        const CELLS: &[[&str; 3]] = &[$([$container, $property, $text]),*];
    };
}

#[test]
fn every_cell_of_the_page_has_a_test() {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/reference/inputs.md");
    // A published package does not contain the page.
    let Ok(page) = fs::read_to_string(page) else { return };
    let mut properties: Vec<String> = Vec::new();
    let mut stated: Vec<[String; 3]> = Vec::new();
    let cells = |line: &str| -> Vec<String> {
        let inner = line.strip_prefix('|').and_then(|line| line.strip_suffix('|')).unwrap_or_default();
        inner.split('|').map(|cell| cell.trim().to_owned()).collect()
    };
    for line in page.lines() {
        if line.starts_with("|container|") {
            properties = cells(line);
        } else if !line.starts_with('|') {
            properties.clear();
        } else if !properties.is_empty() && !line.starts_with("|---") {
            let row = cells(line);
            assert_eq!(row.len(), properties.len(), "{line}");
            let filled = properties.iter().zip(&row).skip(1).filter(|(_, text)| !text.is_empty());
            stated.extend(filled.map(|(property, text)| [row[0].clone(), property.clone(), text.clone()]));
        }
    }
    assert!(stated.len() > 50, "{stated:?}");
    for cell in &stated {
        assert!(CELLS.iter().any(|tested| tested == cell), "no test for {cell:?}");
    }
    assert_eq!(stated.len(), CELLS.len(), "a test has no cell");
}

/// The lights of the first row and the notes of a file.
fn row(path: &Path, options: &InputOptions) -> (Vec<f32>, String) {
    let mut source = open(path, options).unwrap();
    let mut frame = spikelane_io::light::Frame::dark(source.geometry());
    source.next_frame(&mut frame).unwrap();
    let width = source.geometry().width();
    ((0..width).map(|col| frame.get(0, col)).collect(), source.notes().join("\n"))
}

fn sized(options: InputOptions, width: u32, height: u32) -> InputOptions {
    options.with_camera(spikelane::Geometry::new(width, height).unwrap())
}

fn full_scale(path: &Path, options: &InputOptions) -> String {
    open(path, options).unwrap().full_scale().to_string()
}

/// The luminance of a color by the weights of BT.709.
fn luminance([r, g, b]: [f32; 3]) -> f32 {
    0.2126 * r + 0.7152 * g + 0.0722 * b
}

/// A color with a different code in each channel, and its light if codes are linear.
const COLOR: [u8; 3] = [51, 102, 204];

fn color_light() -> f32 {
    luminance([0.2, 0.4, 0.8])
}

fn color() -> DynamicImage {
    RgbImage::from_pixel(4, 2, Rgb(COLOR)).into()
}

/// A black image of 4x2 pixels whose first pixel is white.
fn corner() -> GrayImage {
    let mut image = GrayImage::new(4, 2);
    image.put_pixel(0, 0, Luma([255]));
    image
}

/// Checks that `path` shows [`corner`] rotated clockwise by 90 degrees, so its last column begins with white.
fn assert_is_rotated(path: &Path) {
    near(&row(path, &sized(linear(), 2, 4)).0, &[0.0, 1.0]);
}

fn translucent() -> DynamicImage {
    RgbaImage::from_pixel(4, 2, Rgba([255, 255, 255, 128])).into()
}

/// Checks that alpha is reported and that the light is the stored color.
fn assert_alpha_is_reported(path: &Path) {
    let (lights, notes) = read(path, &options());
    near(&lights[..1], &[1.0]);
    assert!(notes.contains("alpha is not used"), "{notes}");
}

/// Checks that pixels twice as wide as high are reported and read as square pixels.
fn assert_aspect_is_reported(path: &Path) {
    assert_eq!(
        open(path, &linear()).unwrap().stored_geometry(),
        Some(spikelane::Geometry::new(4, 2).unwrap())
    );
    let notes = read(path, &linear()).1;
    assert!(notes.contains("is not used") && notes.contains("scale the image to 8x2"), "{notes}");
}

/// A linear gray profile.
fn profile() -> Vec<u8> {
    ColorProfile::new_gray_with_gamma(1.0).encode().unwrap()
}

/// An EXIF block with the orientation 6, which is a clockwise rotation by 90 degrees.
fn exif() -> Vec<u8> {
    b"II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x06\0\0\0\0\0\0\0".to_vec()
}

/// Returns a PNG of 4x1 pixels with samples of any depth. `kind` is the color type.
fn raw_png(bits: u8, kind: u8, row: &[u8], chunks: &[(&[u8; 4], &[u8])]) -> Vec<u8> {
    use crate::containers::chunk;
    let header = [&4_u32.to_be_bytes()[..], &1_u32.to_be_bytes(), &[bits, kind, 0, 0, 0]].concat();
    let data = [&[0], row].concat();
    let (mut a, mut b) = (1_u32, 0);
    for byte in &data {
        a = (a + u32::from(*byte)) % 65521;
        b = (b + a) % 65521;
    }
    let len = data.len() as u16;
    // A zlib stream of one stored block.
    let stream =
        [&[0x78, 1, 1][..], &len.to_le_bytes(), &(!len).to_le_bytes(), &data, &(b << 16 | a).to_be_bytes()];
    let mut bytes = [b"\x89PNG\r\n\x1a\n", &chunk(b"IHDR", &header)[..]].concat();
    chunks.iter().for_each(|(kind, data)| bytes.extend(chunk(kind, data)));
    bytes.extend(chunk(b"IDAT", &stream.concat()));
    bytes.extend(chunk(b"IEND", &[]));
    bytes
}

/// A tag of a TIFF: its number and its values of 16 bits.
type TiffTag<'a> = (u16, &'a [u16]);

/// Returns a TIFF with one page of 4x1 pixels. `tags` replaces or adds tags of the directory.
fn raw_tiff(is_big_endian: bool, bits: u16, channels: u16, data: &[u8], tags: &[TiffTag<'_>]) -> Vec<u8> {
    let u16_bytes = |v: u16| if is_big_endian { v.to_be_bytes() } else { v.to_le_bytes() };
    let u32_bytes = |v: u32| if is_big_endian { v.to_be_bytes() } else { v.to_le_bytes() };
    let depths = vec![bits; channels.into()];
    let photometric = [if channels >= 3 { 2 } else { 1 }];
    let byte_count = [data.len() as u16];
    let defaults: [TiffTag<'_>; 9] = [
        (256, &[4]),
        (257, &[1]),
        (258, &depths),
        (259, &[1]),
        (262, &photometric),
        (273, &[8]),
        (277, &[channels]),
        (278, &[1]),
        (279, &byte_count),
    ];
    let mut all: Vec<TiffTag<'_>> =
        defaults.into_iter().filter(|(tag, _)| tags.iter().all(|(other, _)| tag != other)).collect();
    all.extend(tags);
    all.sort_by_key(|(tag, _)| *tag);
    // The values of long tags are stored between the samples and the directory.
    let mut bytes = [if is_big_endian { b"MM" } else { b"II" }, &u16_bytes(42)[..], &[0; 4], data].concat();
    bytes.resize(bytes.len().next_multiple_of(2), 0);
    let mut directory = u16_bytes(all.len() as u16).to_vec();
    for (tag, values) in all {
        let stored: Vec<u8> = values.iter().flat_map(|v| u16_bytes(*v)).collect();
        directory.extend([u16_bytes(tag), u16_bytes(3)].concat());
        directory.extend(u32_bytes(values.len() as u32));
        if stored.len() <= 4 {
            directory.extend([&stored[..], &[0; 4]].concat()[..4].iter());
        } else {
            directory.extend(u32_bytes(bytes.len() as u32));
            bytes.extend(stored);
        }
    }
    directory.extend([0; 4]);
    let at = u32_bytes(bytes.len() as u32);
    bytes[4..8].copy_from_slice(&at);
    [bytes, directory].concat()
}

/// Packs samples of `bits` bits without padding, the highest bit first.
fn packed(bits: u32, codes: &[u32]) -> Vec<u8> {
    let stream: Vec<bool> =
        codes.iter().flat_map(|code| (0..bits).rev().map(move |bit| code >> bit & 1 == 1)).collect();
    stream
        .chunks(8)
        .map(|byte| (0..8).fold(0, |all, i| all << 1 | u8::from(byte.get(i) == Some(&true))))
        .collect()
}

fn jpeg(image: &DynamicImage, set: impl Fn(&mut JpegEncoder<&mut Vec<u8>>)) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = JpegEncoder::new_with_quality(&mut bytes, 100);
    set(&mut encoder);
    encoder.write_image(image.as_bytes(), image.width(), image.height(), image.color().into()).unwrap();
    bytes
}

fn webp(image: &DynamicImage, set: impl Fn(&mut WebPEncoder<&mut Vec<u8>>)) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = WebPEncoder::new_lossless(&mut bytes);
    set(&mut encoder);
    encoder.write_image(image.as_bytes(), image.width(), image.height(), image.color().into()).unwrap();
    bytes
}

/// Returns a bitmap of 4x1 pixels with `bits` bits per pixel. `header` has 40 or more bytes after its first four.
fn bmp(bits: u16, height: i32, palette: &[u8], data: &[u8]) -> Vec<u8> {
    let offset = 14 + 40 + palette.len() as u32;
    let mut bytes = b"BM".to_vec();
    bytes.extend((offset + data.len() as u32).to_le_bytes());
    bytes.extend([0; 4]);
    bytes.extend(offset.to_le_bytes());
    bytes.extend([40, 4].map(u32::to_le_bytes).concat());
    bytes.extend(height.to_le_bytes());
    bytes.extend([1, bits].map(u16::to_le_bytes).concat());
    bytes.extend([0, data.len() as u32, 0, 0, (palette.len() / 4) as u32, 0].map(u32::to_le_bytes).concat());
    [&bytes, palette, data].concat()
}

/// Writes a video with ffmpeg from raw frames of 4x4 pixels. Returns `None` if ffmpeg is not installed.
fn video(dir: &TempDir, name: &str, pixels: &str, raw: &[u8], flags: &[&str]) -> Option<PathBuf> {
    if Command::new("ffmpeg").arg("-version").output().is_err() {
        println!("skipped: no ffmpeg on PATH");
        return None;
    }
    let source = file(dir, "video.raw", raw);
    let path = dir.path().join(name);
    let input = ["-y", "-v", "error", "-f", "rawvideo", "-s", "4x4", "-r", "25", "-pix_fmt", pixels, "-i"];
    let status = Command::new("ffmpeg").args(input).arg(source).args(flags).arg(&path).status().unwrap();
    assert!(status.success(), "{name} {flags:?}");
    Some(path)
}

/// Returns a QuickTime or MP4 file of a PNG stream with a box of 32-bit numbers at the end of the description of its
/// samples. The sizes of the boxes around it grow.
fn with_sample_box(mut bytes: Vec<u8>, kind: &[u8; 4], numbers: &[u32]) -> Vec<u8> {
    let data: Vec<u8> = numbers.iter().copied().flat_map(u32::to_be_bytes).collect();
    let added = [&(data.len() as u32 + 8).to_be_bytes()[..], kind, &data].concat();
    let mut insert_at = 0;
    let entry = if bytes.windows(4).any(|part| part == b"mp4v") { b"mp4v" } else { b"png " };
    for name in [b"moov", b"trak", b"mdia", b"minf", b"stbl", b"stsd", entry] {
        let at = bytes.windows(4).position(|part| part == name).unwrap() - 4;
        let size = u32::from_be_bytes(bytes[at..at + 4].try_into().unwrap());
        insert_at = at + size as usize;
        bytes[at..at + 4].copy_from_slice(&(size + added.len() as u32).to_be_bytes());
    }
    bytes.splice(insert_at..insert_at, added);
    bytes
}

/// Returns a FITS unit of 4x1 pixels. `cards` follow the size.
fn fits(bits: i32, frames: usize, cards: &[&str], data: &[u8]) -> Vec<u8> {
    let mut lines = vec![
        format!("SIMPLE  = {:>20}", "T"),
        format!("BITPIX  = {bits:>20}"),
        format!("NAXIS   = {:>20}", 3),
        format!("NAXIS1  = {:>20} / width", 4),
        format!("NAXIS2  = {:>20}", data.len() / frames / (4 * bits.unsigned_abs() as usize / 8)),
        format!("NAXIS3  = {frames:>20}"),
    ];
    lines.extend(cards.iter().map(|card| (*card).to_owned()));
    lines.push("END".to_owned());
    let mut bytes = lines.iter().map(|line| format!("{line:<80}")).collect::<String>().into_bytes();
    bytes.resize(bytes.len().next_multiple_of(2880), b' ');
    bytes.extend(data);
    bytes.resize(bytes.len().next_multiple_of(2880), 0);
    bytes
}

cells! {
    png_pages: "PNG", "pages", "APNG" => {
        let dir = TempDir::new().unwrap();
        near(&read(&file(&dir, "a.png", apng(&[(51, 9), (102, 9), (255, 9)])), &linear()).0, &[0.2, 0.4, 1.0]);
        let deep = [13107, 26214, 65535].map(|code| (gray16(code), [0; 2], [0; 2], 9));
        near(&read(&file(&dir, "b.png", apng_of((4, 2), &deep)), &linear()).0, &[0.2, 0.4, 1.0]);
    }
    png_depth: "PNG", "bit depth", "1 to 16; sBIT" => {
        let dir = TempDir::new().unwrap();
        // The largest code, code 0 and, from 2 bits on, code 1 of each depth.
        for bits in [1_u8, 2, 4, 8, 16] {
            let largest = (1_u32 << bits) - 1;
            let codes = [largest, 0, 1, largest];
            let path = file(&dir, "d.png", raw_png(bits, 0, &packed(bits.into(), &codes), &[]));
            let wanted = codes.map(|code| code as f32 / largest as f32);
            near(&row(&path, &sized(linear(), 4, 1)).0, &wanted);
        }
        let path = file(&dir, "s.png", png_with(&gray16(2047), &[(b"sBIT", &[12])]));
        near(&read(&path, &linear()).0, &[2047.0 / 4095.0]);
        assert_eq!(full_scale(&path, &options()), "4095");
    }
    png_curve: "PNG", "curve", "cICP, ICC, sRGB, gAMA" => {
        let dir = TempDir::new().unwrap();
        let gamma = 55_556_u32.to_be_bytes();
        let mut with_profile = Vec::new();
        let mut encoder = PngEncoder::new(&mut with_profile);
        encoder.set_icc_profile(profile()).unwrap();
        encoder.write_image(gray8(128).as_bytes(), 4, 2, ExtendedColorType::L8).unwrap();
        let chunks = |chunks: &[(&[u8; 4], &[u8])]| png_with(&gray8(128), chunks);
        for (bytes, transfer) in [
            (chunks(&[(b"cICP", &[9, 16, 0, 1]), (b"gAMA", &gamma)]), Transfer::Pq),
            (with_profile, Transfer::Linear),
            (chunks(&[(b"sRGB", &[0]), (b"gAMA", &gamma)]), Transfer::Srgb),
            (chunks(&[(b"gAMA", &gamma)]), Transfer::Gamma(1.8)),
        ] {
            let lights = read(&file(&dir, "c.png", bytes), &options()).0;
            near(&lights, &[transfer.light(128.0 / 255.0) as f32]);
        }
    }
    png_channels: "PNG", "channels", "gray, color, palette" => {
        let dir = TempDir::new().unwrap();
        near(&read(&file(&dir, "g.png", png(&gray8(51))), &linear()).0, &[0.2]);
        near(&read(&file(&dir, "c.png", png(&color())), &linear()).0, &[color_light()]);
        let palette = [[0; 3], COLOR].concat();
        let path = file(&dir, "p.png", raw_png(1, 3, &[0b0100_0000], &[(b"PLTE", &palette)]));
        near(&row(&path, &sized(linear(), 4, 1)).0, &[0.0, color_light(), 0.0, 0.0]);
    }
    png_times: "PNG", "times", "delays; 0: R" => {
        let dir = TempDir::new().unwrap();
        let rate = |bytes| open(&file(&dir, "a.png", bytes), &options()).unwrap().rate().map(Rate::hz);
        assert_eq!(rate(apng(&[(1, 20), (2, 20)])), Some(50.0));
        let deep = [1, 2].map(|code| (gray16(code), [0; 2], [0; 2], 20));
        assert_eq!(rate(apng_of((4, 2), &deep)), Some(50.0));
        let source = open(&file(&dir, "z.png", apng(&[(1, 0), (2, 20)])), &options()).unwrap();
        assert!(source.rate().is_none() && source.notes()[0].contains("durations"), "{:?}", source.notes());
    }
    png_alpha: "PNG", "alpha", "R" => {
        let dir = TempDir::new().unwrap();
        assert_alpha_is_reported(&file(&dir, "a.png", png(&translucent())));
        let deep = DynamicImage::ImageRgba16(translucent().into_rgba16());
        assert_alpha_is_reported(&file(&dir, "d.png", png(&deep)));
        let frames = [(deep.clone(), [0; 2], [0; 2], 9), (deep, [0; 2], [0; 2], 9)];
        assert_alpha_is_reported(&file(&dir, "e.png", apng_of((4, 2), &frames)));
    }
    png_orientation: "PNG", "orientation", "EXIF" => {
        let dir = TempDir::new().unwrap();
        assert_is_rotated(&file(&dir, "o.png", png_with(&corner().into(), &[(b"eXIf", &exif())])));
    }

    tiff_pages: "TIFF", "pages", "of one size; others R" => {
        use crate::containers::tiff;
        use tiff::encoder::{TiffEncoder, colortype::Gray8};
        let dir = TempDir::new().unwrap();
        near(&read(&file(&dir, "s.tif", tiff::<Gray8>(&[51, 102], &[])), &linear()).0, &[0.2, 0.4]);
        let mut bytes = Cursor::new(Vec::new());
        let mut encoder = TiffEncoder::new(&mut bytes).unwrap();
        encoder.write_image::<Gray8>(4, 2, &[51; 8]).unwrap();
        encoder.write_image::<Gray8>(2, 1, &[255; 2]).unwrap();
        encoder.write_image::<Gray8>(4, 2, &[102; 8]).unwrap();
        let (lights, notes) = read(&file(&dir, "t.tif", bytes.into_inner()), &linear());
        near(&lights, &[0.2, 0.4]);
        assert!(notes.contains("1 page "), "{notes}");
    }
    tiff_depth: "TIFF", "bit depth", "1 to 16, 32, floats; MaxSampleValue" => {
        let dir = TempDir::new().unwrap();
        for bits in (1..=15).filter(|bits| *bits != 8) {
            let largest = (1_u32 << bits) - 1;
            let codes = [largest, 1, largest / 2, largest / 3];
            for (is_big_endian, channels) in [(false, 1), (true, 1), (false, 3), (true, 3)] {
                // The channels of a color have the same code, so the light of color is the light of gray.
                let samples: Vec<u32> = codes.iter().flat_map(|code| vec![*code; channels.into()]).collect();
                let bytes = raw_tiff(is_big_endian, bits, channels, &packed(bits.into(), &samples), &[]);
                let path = file(&dir, "p.tif", bytes);
                let wanted = codes.map(|code| code as f32 / largest as f32);
                near(&row(&path, &sized(linear(), 4, 1)).0, &wanted);
            }
        }
        let white_is_zero = raw_tiff(false, 12, 1, &packed(12, &[0, 4095, 1000, 4094]), &[(262, &[0])]);
        let lights = row(&file(&dir, "w.tif", white_is_zero), &sized(linear(), 4, 1)).0;
        near(&lights, &[4095.0, 0.0, 3095.0, 1.0].map(|code: f32| code / 4095.0));
        let predicted = raw_tiff(false, 12, 1, &[0; 6], &[(317, &[2])]);
        assert!(refusal(&file(&dir, "r.tif", predicted), &options()).contains("predictor 2"));
        let twelve = raw_tiff(false, 16, 1, &[0xFF, 0x07].repeat(4), &[(281, &[4095])]);
        let path = file(&dir, "m.tif", twelve);
        near(&row(&path, &sized(linear(), 4, 1)).0, &[2047.0 / 4095.0; 4]);
        assert_eq!(full_scale(&path, &options()), "4095");
        let long = file(&dir, "l.tif", raw_tiff(false, 32, 1, &1000_u32.to_le_bytes().repeat(4), &[]));
        near(&row(&long, &sized(linear(), 4, 1).with_scale(Some(4000.0))).0, &[0.25; 4]);
        let float = raw_tiff(false, 32, 1, &1.5_f32.to_le_bytes().repeat(4), &[(339, &[3])]);
        let path = file(&dir, "f.tif", float);
        near(&row(&path, &sized(linear(), 4, 1)).0, &[1.5; 4]);
        assert_eq!(full_scale(&path, &options()), "1");
    }
    tiff_curve: "TIFF", "curve", "ICC; TransferFunction: R" => {
        let dir = TempDir::new().unwrap();
        let table: Vec<u16> = (0..256).map(|i| i * 257).collect();
        let path = file(&dir, "t.tif", raw_tiff(false, 8, 1, &[128; 4], &[(301, &table)]));
        let (lights, notes) = row(&path, &sized(options(), 4, 1));
        near(&lights[..1], &[Transfer::Srgb.light(128.0 / 255.0) as f32]);
        assert!(notes.contains("TransferFunction"), "{notes}");
        let mut bytes = Cursor::new(Vec::new());
        let mut encoder = tiff::encoder::TiffEncoder::new(&mut bytes).unwrap();
        let mut page = encoder.new_image::<tiff::encoder::colortype::Gray8>(4, 2).unwrap();
        page.encoder().write_tag(tiff::tags::Tag::IccProfile, &profile()[..]).unwrap();
        page.write_data(&[128; 8]).unwrap();
        near(&read(&file(&dir, "i.tif", bytes.into_inner()), &options()).0, &[128.0 / 255.0]);
    }
    tiff_channels: "TIFF", "channels", "gray, RGB, CMYK" => {
        let dir = TempDir::new().unwrap();
        let size = sized(linear(), 4, 1);
        near(&row(&file(&dir, "g.tif", raw_tiff(false, 8, 1, &[51; 4], &[])), &size).0, &[0.2; 4]);
        let rgb = raw_tiff(false, 8, 3, &COLOR.repeat(4), &[]);
        near(&row(&file(&dir, "c.tif", rgb), &size).0, &[color_light(); 4]);
        // Without black ink, a color is the complement of its inks.
        let inks = [COLOR.map(|code| 255 - code).to_vec(), vec![0]].concat();
        let cmyk = raw_tiff(false, 8, 4, &inks.repeat(4), &[(262, &[5])]);
        near(&row(&file(&dir, "k.tif", cmyk), &size).0, &[color_light(); 4]);
    }
    tiff_times: "TIFF", "times", "ImageJ" => {
        use crate::containers::tiff;
        let dir = TempDir::new().unwrap();
        let tag = (tiff::tags::Tag::ImageDescription, "ImageJ=1.53k\nimages=2\nfinterval=0.02\n", 0);
        let path = file(&dir, "s.tif", tiff::<tiff::encoder::colortype::Gray8>(&[1, 2], &[tag]));
        assert_eq!(open(&path, &options()).unwrap().rate().map(Rate::hz), Some(50.0));
    }
    tiff_alpha: "TIFF", "alpha", "R" => {
        let dir = TempDir::new().unwrap();
        let rgba = raw_tiff(false, 8, 4, &[255, 255, 255, 128].repeat(4), &[(338, &[2])]);
        let (lights, notes) = row(&file(&dir, "a.tif", rgba), &sized(options(), 4, 1));
        near(&lights, &[1.0; 4]);
        assert!(notes.contains("alpha is not used"), "{notes}");
    }
    tiff_orientation: "TIFF", "orientation", "tag" => {
        let dir = TempDir::new().unwrap();
        let tags: [TiffTag<'_>; 3] = [(274, &[6]), (257, &[2]), (278, &[2])];
        assert_is_rotated(&file(&dir, "o.tif", raw_tiff(false, 8, 1, corner().as_raw(), &tags)));
    }

    png_pixel_aspect: "PNG", "pixel aspect", "pHYs: R" => {
        let dir = TempDir::new().unwrap();
        // 50 pixels per unit in x and 100 in y, so a pixel is twice as wide as high.
        let wide = [50_u32.to_be_bytes(), 100_u32.to_be_bytes()].concat();
        assert_aspect_is_reported(&file(&dir, "a.png", png_with(&gray8(51), &[(b"pHYs", &[&wide[..], &[0]].concat())])));
        let square = [2835_u32.to_be_bytes(); 2].concat();
        let path = file(&dir, "b.png", png_with(&gray8(51), &[(b"pHYs", &[&square[..], &[1]].concat())]));
        assert_eq!(read(&path, &linear()).1, "");
    }
    tiff_pixel_aspect: "TIFF", "pixel aspect", "resolutions: R" => {
        use tiff::encoder::{Rational, TiffEncoder, colortype::Gray8};
        use tiff::tags::Tag;
        let dir = TempDir::new().unwrap();
        let mut bytes = Cursor::new(Vec::new());
        let mut encoder = TiffEncoder::new(&mut bytes).unwrap();
        let mut page = encoder.new_image::<Gray8>(4, 2).unwrap();
        page.encoder().write_tag(Tag::XResolution, Rational { n: 98, d: 1 }).unwrap();
        page.encoder().write_tag(Tag::YResolution, Rational { n: 196, d: 1 }).unwrap();
        page.write_data(&[51; 8]).unwrap();
        assert_aspect_is_reported(&file(&dir, "a.tif", bytes.into_inner()));
    }
    jpeg_pixel_aspect: "JPEG", "pixel aspect", "JFIF: R" => {
        let dir = TempDir::new().unwrap();
        let mut bytes = jpeg(&gray8(51), |_| {});
        assert_eq!(&bytes[6..11], b"JFIF\0");
        // The unit, and the densities in x and y.
        bytes[13..18].copy_from_slice(&[1, 0, 72, 0, 144]);
        assert_aspect_is_reported(&file(&dir, "a.jpg", bytes));
    }
    exr_pixel_aspect: "EXR", "pixel aspect", "pixelAspectRatio: R" => {
        let dir = TempDir::new().unwrap();
        let channels = AnyChannels::sort([AnyChannel::new("Y", FlatSamples::F32(vec![0.2; 8]))].into_iter().collect());
        let layer = Layer::new((4, 2), LayerAttributes::default(), ExrEncoding::UNCOMPRESSED, channels);
        let mut image = ExrImage::from_layer(layer);
        image.attributes.pixel_aspect = 2.0;
        let path = dir.path().join("a.exr");
        image.write().to_file(&path).unwrap();
        assert_aspect_is_reported(&path);
    }
    video_pixel_aspect: "GIF, video", "pixel aspect", "used; a note names it" => {
        let dir = TempDir::new().unwrap();
        let raw = [[255, 255, 0, 0], [255, 255, 0, 0], [255, 255, 0, 0], [255, 255, 0, 0]].concat();
        let y4m = [&b"YUV4MPEG2 W4 H4 F25:1 A2:1 Cmono\nFRAME\n"[..], &raw].concat();
        let files = [
            Some(file(&dir, "v.y4m", y4m)),
            video(&dir, "v.mkv", "gray", &raw, &["-c:v", "ffv1", "-vf", "setsar=2/1"]),
        ];
        for path in files.into_iter().flatten() {
            let source = open(&path, &linear()).unwrap();
            assert_eq!(source.stored_geometry(), Some(spikelane::Geometry::new(8, 4).unwrap()));
            assert!(source.notes()[0].contains("2:1 is used"), "{:?}", source.notes());
            let lights = row(&path, &sized(linear(), 8, 4)).0;
            near(&[lights[0], lights[2], lights[5], lights[7]], &[1.0, 1.0, 0.0, 0.0]);
        }
    }

    mp4_capture_rate: "MP4, MOV", "capture rate", "Android, Sony: used; time lapse: R" => {
        let dir = TempDir::new().unwrap();
        let tagged = |hz: &str| {
            let tag = format!("com.android.capture.fps={hz}");
            let flags = ["-c:v", "mpeg4", "-metadata", &tag, "-movflags", "use_metadata_tags"];
            video(&dir, "v.mp4", "gray", &[51; 48], &flags)
        };
        let Some(path) = tagged("200") else { return };
        let source = open(&path, &options()).unwrap();
        assert_eq!(source.rate().map(Rate::hz), Some(200.0));
        assert!(source.notes()[0].contains("slow motion"), "{:?}", source.notes());
        let lapse = open(&tagged("2").unwrap(), &options()).unwrap();
        assert_eq!(lapse.rate().map(Rate::hz), Some(25.0));
        assert!(lapse.notes()[0].contains("time lapse"), "{:?}", lapse.notes());
        assert_eq!(open(&tagged("25").unwrap(), &options()).unwrap().notes(), Vec::<String>::new());
        let plain = video(&dir, "s.mp4", "gray", &[51; 48], &["-c:v", "mpeg4"]).unwrap();
        let xml = br#"<VideoFrame videoCodec="AVC" captureFps="100.00p" formatFps="25.00p"/>"#;
        let meta = [&(xml.len() as u32 + 8).to_be_bytes()[..], b"meta", xml].concat();
        let sony = file(&dir, "s2.mp4", [fs::read(plain).unwrap(), meta].concat());
        assert_eq!(open(&sony, &options()).unwrap().rate().map(Rate::hz), Some(100.0));
    }
    mp4_edit_list: "MP4, MOV", "edit list", "used" => {
        let dir = TempDir::new().unwrap();
        let raw = [[0; 16], [0; 16], [255; 16], [255; 16]].concat();
        let Some(whole) = video(&dir, "v.mp4", "gray", &raw, &["-c:v", "mpeg4", "-q:v", "1"]) else { return };
        // The copy contains all frames, and its edit list starts at the third.
        let path = dir.path().join("c.mp4");
        let cut = Command::new("ffmpeg").args(["-v", "error", "-ss", "0.08", "-i"]).arg(whole).args(["-c", "copy"]).arg(&path).status();
        assert!(cut.unwrap().success());
        let lights = read(&path, &linear()).0;
        assert!(lights.len() == 2 && lights[0] > 0.9, "{lights:?}");
    }
    mp4_stereo: "MP4, MOV", "stereo", "R" => {
        let dir = TempDir::new().unwrap();
        let flags = ["-c:v", "mpeg4", "-metadata:s:v", "stereo_mode=left_right"];
        let Some(matroska) = video(&dir, "v.mkv", "gray", &[51; 16], &flags) else { return };
        let path = dir.path().join("v.mp4");
        let copied = Command::new("ffmpeg").args(["-v", "error", "-i"]).arg(matroska).args(["-c", "copy", "-strict", "-2"]).arg(&path).status();
        assert!(copied.unwrap().success());
        let notes = read(&path, &linear()).1;
        assert!(notes.contains("stereo"), "{notes}");
    }
    mp4_clean_aperture: "MP4, MOV", "visible part", "`clap`: R" => {
        let dir = TempDir::new().unwrap();
        let Some(path) = video(&dir, "v.mov", "gray", &[51; 16], &["-c:v", "png"]) else { return };
        let path = file(&dir, "c.mov", with_sample_box(fs::read(path).unwrap(), b"clap", &[2, 1, 4, 1, 0, 1, 0, 1]));
        let source = open(&path, &linear()).unwrap();
        // ffmpeg 7.1 and later crop the frames.
        let is_cropped = source.stored_geometry() == Some(spikelane::Geometry::new(2, 4).unwrap());
        assert!(is_cropped || source.notes()[0].contains("2x4"), "{:?}", source.notes());
    }
    matroska_crop: "Matroska, WebM", "visible part", "`PixelCrop`: R" => {
        let dir = TempDir::new().unwrap();
        let colors = ["-c:v", "ffv1", "-color_primaries", "bt709", "-color_trc", "bt709", "-colorspace", "bt709"];
        let Some(path) = video(&dir, "v.mkv", "gray", &[51; 16], &colors) else { return };
        // The place of the element of the colors receives the crop of one column at each side, and an element without a
        // meaning, which has the rest of the place.
        let mut bytes = fs::read(path).unwrap();
        let at = bytes.windows(2).position(|part| part == [0x55, 0xB0]).unwrap();
        let rest = 3 + (bytes[at + 2] & 0x7F) - 8 - 2;
        let crop = [0x54, 0xCC, 0x81, 1, 0x54, 0xDD, 0x81, 1, 0xEC, 0x80 | rest];
        bytes[at..at + crop.len()].copy_from_slice(&crop);
        let path = file(&dir, "c.mkv", bytes);
        let source = open(&path, &linear()).unwrap();
        // ffmpeg 7.1 and later crop the frames.
        let is_cropped = source.stored_geometry() == Some(spikelane::Geometry::new(2, 4).unwrap());
        assert!(is_cropped || source.notes().join("").contains("2x4"), "{:?}", source.notes());
    }
    video_mastering_display: "any video", "mastering display", "R" => {
        let dir = TempDir::new().unwrap();
        let Some(path) = video(&dir, "v.mp4", "gray", &[51; 16], &["-c:v", "png"]) else { return };
        // Eight chromaticities of 16 bits, and the largest and the smallest luminance in units of 0.0001 cd/m2.
        let display = [0x33C2_86C4, 0x1D4C_0BB8, 0x84D0_3E80, 0x3D13_4042, 10_000_000, 50];
        let path = file(&dir, "m.mp4", with_sample_box(fs::read(path).unwrap(), b"mdcv", &display));
        let notes = read(&path, &linear()).1;
        assert!(notes.contains("mastering display is not used"), "{notes}");
    }
    matroska_capture_rate: "Matroska, WebM", "capture rate", "Android: used" => {
        let dir = TempDir::new().unwrap();
        let flags = ["-c:v", "ffv1", "-metadata", "com.android.capture.fps=200"];
        let Some(path) = video(&dir, "v.mkv", "gray", &[51; 48], &flags) else { return };
        assert_eq!(open(&path, &options()).unwrap().rate().map(Rate::hz), Some(200.0));
    }
    matroska_stereo: "Matroska, WebM", "stereo", "R" => {
        let dir = TempDir::new().unwrap();
        let flags = ["-c:v", "ffv1", "-metadata:s:v", "stereo_mode=left_right"];
        let Some(path) = video(&dir, "v.mkv", "gray", &[51; 16], &flags) else { return };
        let notes = read(&path, &linear()).1;
        assert!(notes.contains("stereo"), "{notes}");
    }
    video_new_size: "any video", "new size or format", "error" => {
        let dir = TempDir::new().unwrap();
        let codec = ["-c:v", "mpeg1video", "-f", "mpeg1video"];
        let Some(small) = video(&dir, "a.m1v", "gray", &[51; 32], &codec) else { return };
        let large = [&codec[..], &["-vf", "scale=32:32"]].concat();
        let large = video(&dir, "b.m1v", "gray", &[51; 32], &large).unwrap();
        let path = file(&dir, "c.mpg", [fs::read(small).unwrap(), fs::read(large).unwrap()].concat());
        let mut source = open(&path, &linear()).unwrap();
        let mut frame = spikelane_io::light::Frame::dark(source.geometry());
        let error = std::iter::repeat_with(|| source.next_frame(&mut frame)).find_map(|next| match next {
            Ok(true) => None,
            Ok(false) => Some("no error".to_owned()),
            Err(e) => Some(e.to_string()),
        });
        assert!(error.as_ref().is_some_and(|e| e.contains("frames of 32x32")), "{error:?}");
    }

    webp_pages: "WebP", "pages", "animation" => {
        let dir = TempDir::new().unwrap();
        let path = file(&dir, "a.webp", animated_webp(&[(51, 9), (102, 9)]));
        near(&read(&path, &linear()).0, &[0.2, 0.4]);
    }
    webp_depth: "WebP", "bit depth", "8" => {
        let dir = TempDir::new().unwrap();
        let path = file(&dir, "d.webp", webp(&gray8(51).into_rgb8().into(), |_| {}));
        near(&read(&path, &linear()).0, &[0.2]);
        assert_eq!(full_scale(&path, &options()), "255");
    }
    webp_curve: "WebP", "curve", "ICC" => {
        let dir = TempDir::new().unwrap();
        let bytes = webp(&gray8(128).into_rgb8().into(), |e| e.set_icc_profile(profile()).unwrap());
        near(&read(&file(&dir, "c.webp", bytes), &options()).0, &[128.0 / 255.0]);
    }
    webp_channels: "WebP", "channels", "color" => {
        let dir = TempDir::new().unwrap();
        near(&read(&file(&dir, "c.webp", webp(&color(), |_| {})), &linear()).0, &[color_light()]);
    }
    webp_times: "WebP", "times", "delays; 0: R" => {
        let dir = TempDir::new().unwrap();
        let uniform = file(&dir, "a.webp", animated_webp(&[(1, 20), (2, 20)]));
        assert_eq!(open(&uniform, &options()).unwrap().rate().map(Rate::hz), Some(50.0));
        let source = open(&file(&dir, "z.webp", animated_webp(&[(1, 0), (2, 20)])), &options()).unwrap();
        assert!(source.rate().is_none() && source.notes()[0].contains("durations"), "{:?}", source.notes());
    }
    webp_alpha: "WebP", "alpha", "R" => {
        let dir = TempDir::new().unwrap();
        assert_alpha_is_reported(&file(&dir, "a.webp", webp(&translucent(), |_| {})));
    }
    webp_orientation: "WebP", "orientation", "EXIF" => {
        let dir = TempDir::new().unwrap();
        let image = corner();
        let image = DynamicImage::from(image).into_rgb8().into();
        let bytes = webp(&image, |e| e.set_exif_metadata(exif()).unwrap());
        assert_is_rotated(&file(&dir, "o.webp", bytes));
    }

    jpeg_depth: "JPEG", "bit depth", "8" => {
        let dir = TempDir::new().unwrap();
        let path = file(&dir, "d.jpg", jpeg(&gray8(128), |_| {}));
        // The quantization of quality 100 changes a uniform code by at most 1.
        assert!((read(&path, &linear()).0[0] - 128.0 / 255.0).abs() < 1.01 / 255.0);
        assert_eq!(full_scale(&path, &options()), "255");
    }
    jpeg_curve: "JPEG", "curve", "ICC" => {
        let dir = TempDir::new().unwrap();
        let path = file(&dir, "c.jpg", jpeg(&gray8(128), |e| e.set_icc_profile(profile()).unwrap()));
        assert_eq!(open(&path, &options()).unwrap().front_end().transfer, Some(Transfer::Linear));
    }
    jpeg_channels: "JPEG", "channels", "gray, color, CMYK" => {
        let dir = TempDir::new().unwrap();
        // A code of a uniform color differs by at most 2 after the conversion to YCbCr and back.
        let is_near = |path: &Path, wanted: f32| {
            let found = read(path, &linear()).0[0];
            assert!((found - wanted).abs() < 2.01 / 255.0, "{}: {found} {wanted}", path.display());
        };
        is_near(&file(&dir, "g.jpg", jpeg(&gray8(51), |_| {})), 0.2);
        is_near(&file(&dir, "c.jpg", jpeg(&color(), |_| {})), color_light());
        // convert -size 4x2 xc:'rgb(64,128,191)' -colorspace CMYK -define jpeg:optimize-coding=true -strip
        //   -quality 90 cmyk.jpg
        let codes = [64.0, 128.0, 191.0].map(|code: f32| code / 255.0);
        is_near(&file(&dir, "k.jpg", include_bytes!("fixtures/cmyk.jpg")), luminance(codes));
    }
    jpeg_orientation: "JPEG", "orientation", "EXIF" => {
        let dir = TempDir::new().unwrap();
        // A picture of two blocks, because a block of 8x8 pixels is stored without mixing.
        let image = GrayImage::from_fn(16, 8, |x, _| Luma([if x < 8 { 255 } else { 0 }]));
        let path = file(&dir, "o.jpg", jpeg(&image.into(), |e| e.set_exif_metadata(exif()).unwrap()));
        let source = open(&path, &options()).unwrap();
        assert_eq!(source.stored_geometry(), Some(spikelane::Geometry::new(8, 16).unwrap()));
        // The left block becomes the top block.
        let top = row(&path, &sized(linear(), 8, 16)).0;
        assert!(top.iter().all(|light| *light > 0.95), "{top:?}");
    }

    exr_pages: "EXR", "pages", "first part; others R" => {
        let dir = TempDir::new().unwrap();
        let layer = |name: &str, value: f32| {
            let channel = AnyChannel::new("Y", FlatSamples::F32(vec![value; 8]));
            let attributes = LayerAttributes::named(Text::from(name));
            let channels = AnyChannels::sort([channel].into_iter().collect());
            Layer::new((4, 2), attributes, ExrEncoding::UNCOMPRESSED, channels)
        };
        let window = ImageAttributes::new(IntegerBounds::from_dimensions((4, 2)));
        let image = ExrImage::empty(window).with_layer(layer("first", 0.25)).with_layer(layer("second", 0.75));
        let path = dir.path().join("p.exr");
        image.write().to_file(&path).unwrap();
        let (lights, notes) = read(&path, &options());
        near(&lights, &[0.25]);
        assert!(notes.contains("second"), "{notes}");
    }
    exr_depth: "EXR", "bit depth", "16, 32" => {
        let dir = TempDir::new().unwrap();
        near(&read(&exr(&dir, "f.exr", &[("Y", 0.3)]), &options()).0, &[0.3]);
        let channel = AnyChannel::new("Y", FlatSamples::F16(vec![f16::from_f32(0.25); 8]));
        let channels = AnyChannels::sort([channel].into_iter().collect());
        let layer = Layer::new((4, 2), LayerAttributes::default(), ExrEncoding::UNCOMPRESSED, channels);
        let path = dir.path().join("h.exr");
        ExrImage::from_layer(layer).write().to_file(&path).unwrap();
        near(&read(&path, &options()).0, &[0.25]);
    }
    exr_curve: "EXR", "curve", "linear" => {
        let dir = TempDir::new().unwrap();
        let path = exr(&dir, "c.exr", &[("Y", 2.0)]);
        near(&read(&path, &options()).0, &[2.0]);
        assert_eq!(open(&path, &options()).unwrap().front_end().transfer, Some(Transfer::Linear));
    }
    exr_channels: "EXR", "channels", "R, G, B or Y; other layers R" => {
        let dir = TempDir::new().unwrap();
        let path = exr(&dir, "c.exr", &[("R", 0.2), ("G", 0.4), ("B", 0.8), ("depth.Z", 9.0), ("id.Y", 1.0)]);
        let (lights, notes) = read(&path, &options());
        near(&lights, &[color_light()]);
        assert!(notes.contains("id"), "{notes}");
    }

    hdr_depth: "HDR", "bit depth", "8" => {
        let dir = TempDir::new().unwrap();
        let mut bytes = Vec::new();
        // A mantissa of 8 bits and an exponent: 100 / 256 * 2^2.
        image::codecs::hdr::HdrEncoder::new(&mut bytes).encode(&[Rgb([1.5625_f32; 3]); 8], 4, 2).unwrap();
        near(&read(&file(&dir, "d.hdr", bytes), &options()).0, &[1.5625]);
    }
    hdr_curve: "HDR", "curve", "linear; EXPOSURE: R" => {
        let dir = TempDir::new().unwrap();
        let mut bytes = Vec::new();
        image::codecs::hdr::HdrEncoder::new(&mut bytes).encode(&[Rgb([0.25_f32; 3]); 8], 4, 2).unwrap();
        let at = bytes.iter().position(|b| *b == b'\n').unwrap() + 1;
        let exposed = [&bytes[..at], b"EXPOSURE=2.0\n", &bytes[at..]].concat();
        let (lights, notes) = read(&file(&dir, "e.hdr", exposed), &options());
        near(&lights, &[0.25]);
        assert!(notes.contains("EXPOSURE=2.0"), "{notes}");
    }
    hdr_channels: "HDR", "channels", "color" => {
        let dir = TempDir::new().unwrap();
        let mut bytes = Vec::new();
        let pixel = Rgb([0.25_f32, 0.5, 0.125]);
        image::codecs::hdr::HdrEncoder::new(&mut bytes).encode(&[pixel; 8], 4, 2).unwrap();
        near(&read(&file(&dir, "c.hdr", bytes), &options()).0, &[luminance(pixel.0)]);
    }

    pfm_depth: "PFM", "bit depth", "32" => {
        let dir = TempDir::new().unwrap();
        let path = file(&dir, "d.pfm", [&b"Pf 4 2 -1\n"[..], &0.3_f32.to_le_bytes().repeat(8)].concat());
        near(&read(&path, &options()).0, &[0.3]);
    }
    pfm_curve: "PFM", "curve", "linear; scale: R" => {
        let dir = TempDir::new().unwrap();
        let path = file(&dir, "s.pfm", [&b"Pf 4 2 2.5\n"[..], &0.3_f32.to_be_bytes().repeat(8)].concat());
        let (lights, notes) = read(&path, &options());
        near(&lights, &[0.3]);
        assert!(notes.contains("scale 2.5"), "{notes}");
    }
    pfm_channels: "PFM", "channels", "gray, color" => {
        let dir = TempDir::new().unwrap();
        let pixel = [0.2_f32, 0.4, 0.8];
        let bytes = pixel.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>().repeat(8);
        let path = file(&dir, "c.pfm", [&b"PF 4 2 -1\n"[..], &bytes].concat());
        near(&read(&path, &options()).0, &[luminance(pixel)]);
    }

    pnm_depth: "PNM", "bit depth", "maxval" => {
        let dir = TempDir::new().unwrap();
        for (header, samples, wanted) in [
            ("P4 4 2\n", vec![0, 0], 1.0),
            ("P5 4 2 100\n", vec![40; 8], 0.4),
            ("P5 4 2 4095\n", [7, 0xFF].repeat(8), 2047.0 / 4095.0),
            ("P5 4 2 65535\n", [0x33, 0x33].repeat(8), 0.2),
        ] {
            let path = file(&dir, "d.pgm", [header.as_bytes(), &samples].concat());
            near(&read(&path, &linear()).0, &[wanted]);
        }
    }
    pnm_channels: "PNM", "channels", "gray, color" => {
        let dir = TempDir::new().unwrap();
        near(&read(&file(&dir, "g.pgm", [&b"P5 4 2 255\n"[..], &[51; 8]].concat()), &linear()).0, &[0.2]);
        let path = file(&dir, "c.ppm", [&b"P6 4 2 255\n"[..], &COLOR.repeat(8)].concat());
        near(&read(&path, &linear()).0, &[color_light()]);
    }
    pnm_alpha: "PNM", "alpha", "R" => {
        let dir = TempDir::new().unwrap();
        let header = b"P7\nWIDTH 4\nHEIGHT 2\nDEPTH 4\nMAXVAL 255\nTUPLTYPE RGB_ALPHA\nENDHDR\n";
        let path = file(&dir, "a.pnm", [&header[..], &[255, 255, 255, 128].repeat(8)].concat());
        assert_alpha_is_reported(&path);
    }

    bmp_depth: "BMP", "bit depth", "8" => {
        let dir = TempDir::new().unwrap();
        let path = file(&dir, "d.bmp", bmp(24, 1, &[], &[51; 12]));
        near(&row(&path, &sized(linear(), 4, 1)).0, &[0.2; 4]);
        assert_eq!(full_scale(&path, &options()), "255");
    }
    bmp_curve: "BMP", "curve", "not read" => {
        let dir = TempDir::new().unwrap();
        // A header of version 4 with calibrated colors and an exponent of 1.0 for each channel.
        let mut bytes = b"BM".to_vec();
        bytes.extend([134_u32, 0, 122, 108, 4, 1].map(u32::to_le_bytes).concat());
        bytes.extend([1_u16, 24].map(u16::to_le_bytes).concat());
        bytes.extend([0_u32, 12, 0, 0, 0, 0].map(u32::to_le_bytes).concat());
        // Masks of the channels, the color space, the end points and the exponents.
        bytes.extend([0; 4 * 4 + 4 + 36]);
        bytes.extend([0x1_0000_u32; 3].map(u32::to_le_bytes).concat());
        bytes.extend([128; 12]);
        let (lights, notes) = row(&file(&dir, "c.bmp", bytes), &sized(options(), 4, 1));
        near(&lights, &[Transfer::Srgb.light(128.0 / 255.0) as f32; 4]);
        assert_eq!(notes, "");
    }
    bmp_channels: "BMP", "channels", "color, palette" => {
        let dir = TempDir::new().unwrap();
        let size = sized(linear(), 4, 1);
        // Colors are stored as blue, green and red.
        let [r, g, b] = COLOR;
        near(&row(&file(&dir, "c.bmp", bmp(24, 1, &[], &[b, g, r].repeat(4))), &size).0, &[color_light(); 4]);
        let path = file(&dir, "p.bmp", bmp(8, 1, &[0, 0, 0, 0, b, g, r, 0], &[0, 1, 1, 0]));
        near(&row(&path, &size).0, &[0.0, color_light(), color_light(), 0.0]);
    }
    bmp_alpha: "BMP", "alpha", "R" => {
        let dir = TempDir::new().unwrap();
        let mut bytes = Cursor::new(Vec::new());
        translucent().write_to(&mut bytes, image::ImageFormat::Bmp).unwrap();
        assert_alpha_is_reported(&file(&dir, "a.bmp", bytes.into_inner()));
    }
    bmp_orientation: "BMP", "orientation", "rows" => {
        let dir = TempDir::new().unwrap();
        let data = [[255; 12], [0; 12]].concat();
        // Rows are stored from bottom to top, unless the height is negative.
        for (height, wanted) in [(2, 0.0), (-2, 1.0)] {
            near(&row(&file(&dir, "o.bmp", bmp(24, height, &[], &data)), &linear()).0, &[wanted; 4]);
        }
    }

    fits_pages: "FITS", "pages", "third axis; other units R" => {
        let dir = TempDir::new().unwrap();
        let path = file(&dir, "p.fits", fits(8, 2, &[], &[[51; 8], [102; 8]].concat()));
        near(&read(&path, &options()).0, &[0.2, 0.4]);
        // An empty primary unit and a table before the image.
        let card = |text: &str| format!("{text:<80}");
        let unit = |cards: &[&str]| {
            let mut bytes = cards.iter().map(|text| card(text)).collect::<String>().into_bytes();
            bytes.resize(2880, b' ');
            bytes
        };
        let empty = unit(&["SIMPLE  = T", "BITPIX  = 8", "NAXIS   = 0", "END"]);
        let table = unit(&[
            "XTENSION= 'BINTABLE'", "BITPIX  = 8", "NAXIS   = 2", "NAXIS1  = 4", "NAXIS2  = 3", "PCOUNT  = 0",
            "GCOUNT  = 1", "END",
        ]);
        let mut image = fits(-32, 1, &[], &0.25_f32.to_be_bytes().repeat(8));
        image[..80].copy_from_slice(card("XTENSION= 'IMAGE   '").as_bytes());
        let (lights, notes) = read(&file(&dir, "x.fits", [empty, table, vec![0; 2880], image].concat()), &options());
        near(&lights, &[0.25]);
        assert!(notes.contains("BINTABLE"), "{notes}");
    }
    fits_depth: "FITS", "bit depth", "8 to 64, floats; BZERO, BSCALE; SATURATE: R" => {
        let dir = TempDir::new().unwrap();
        let value = |bits: i32, data: Vec<u8>, cards: &[&str], scale: Option<f64>| {
            let path = file(&dir, "d.fits", fits(bits, 1, cards, &data.repeat(8)));
            let options = options().with_scale(scale);
            (read(&path, &options), full_scale(&path, &options))
        };
        let zero = "BZERO   = 32768.0";
        for (bits, data, cards, scale, wanted, full) in [
            (8, vec![51], &[][..], None, 0.2, "255"),
            (16, (-19_661_i16).to_be_bytes().to_vec(), &[zero], None, 0.2, "65535"),
            (16, 1000_i16.to_be_bytes().to_vec(), &[], Some(4000.0), 0.25, "4000"),
            (16, 100_i16.to_be_bytes().to_vec(), &["BSCALE  = 5.0D-3", "BZERO   = 0.25"], None, 0.75, "1"),
            (32, 1000_i32.to_be_bytes().to_vec(), &[], Some(4000.0), 0.25, "4000"),
            (64, 1000_i64.to_be_bytes().to_vec(), &[], Some(4000.0), 0.25, "4000"),
            (-32, 0.3_f32.to_be_bytes().to_vec(), &[], None, 0.3, "1"),
            (-64, 0.3_f64.to_be_bytes().to_vec(), &[], None, 0.3, "1"),
        ] {
            let ((lights, notes), unit) = value(bits, data, cards, scale);
            near(&lights, &[wanted]);
            assert_eq!((notes.as_str(), unit.as_str()), ("", full), "{bits} bits, {cards:?}");
        }
        let ((_, notes), _) = value(8, vec![1], &["SATURATE=                  200 / level"], None);
        assert!(notes.contains("SATURATE 200"), "{notes}");
        let blank = file(&dir, "b.fits", fits(8, 1, &["BLANK   = 7"], &[7; 8]));
        assert!(refusal(&blank, &options()).contains("BLANK"));
        let integers = file(&dir, "i.fits", fits(32, 1, &[], &1000_i32.to_be_bytes().repeat(8)));
        assert!(refusal(&integers, &options()).contains("1000"));
    }
    fits_curve: "FITS", "curve", "linear" => {
        let dir = TempDir::new().unwrap();
        let path = file(&dir, "c.fits", fits(8, 1, &[], &[51; 8]));
        near(&read(&path, &options()).0, &[0.2]);
        near(&read(&path, &options().with_transfer(Some(Transfer::Srgb))).0, &[Transfer::Srgb.light(0.2) as f32]);
    }
    fits_channels: "FITS", "channels", "gray; 3 or 4 planes: R" => {
        let dir = TempDir::new().unwrap();
        let (lights, notes) = read(&file(&dir, "c.fits", fits(8, 3, &[], &[51; 24])), &options());
        near(&lights, &[0.2; 3]);
        assert!(notes.contains("3 planes"), "{notes}");
    }
    fits_orientation: "FITS", "orientation", "ROWORDER" => {
        let dir = TempDir::new().unwrap();
        let data = [[255; 4], [0; 4]].concat();
        for (cards, wanted) in [
            (&[][..], 0.0),
            (&["ROWORDER= 'BOTTOM-UP'"], 0.0),
            (&["ROWORDER= 'TOP-DOWN'           / first row is at the top"], 1.0),
        ] {
            near(&row(&file(&dir, "o.fits", fits(8, 1, cards, &data)), &linear()).0, &[wanted; 4]);
        }
    }

    video_pages: "GIF, video", "pages", "all" => {
        let dir = TempDir::new().unwrap();
        let raw = [[51; 16], [102; 16], [255; 16]].concat();
        for name in ["v.mkv", "v.gif"] {
            let codec = if name == "v.mkv" { &["-c:v", "ffv1"][..] } else { &[] };
            let Some(path) = video(&dir, name, "gray", &raw, codec) else { return };
            near(&read(&path, &linear()).0, &[0.2, 0.4, 1.0]);
        }
    }
    video_depth: "GIF, video", "bit depth", "8 to 16" => {
        let dir = TempDir::new().unwrap();
        for (pixels, largest) in [("gray", 255_u16), ("gray10le", 1023), ("gray12le", 4095), ("gray16le", 65535)] {
            let sample = if largest == 255 { vec![255] } else { largest.to_le_bytes().to_vec() };
            let Some(path) = video(&dir, "v.mkv", pixels, &sample.repeat(16), &["-c:v", "ffv1"]) else { return };
            near(&read(&path, &linear()).0, &[1.0]);
            assert_eq!(full_scale(&path, &options()), largest.to_string());
        }
    }
    video_curve: "GIF, video", "curve", "tag; others R" => {
        let dir = TempDir::new().unwrap();
        let tagged = |curve: &str| video(&dir, "v.mkv", "gray", &[128; 16], &["-c:v", "ffv1", "-color_trc", curve]);
        let Some(path) = tagged("linear") else { return };
        near(&read(&path, &options()).0, &[128.0 / 255.0]);
        let path = tagged("log").unwrap();
        assert!(read(&path, &options()).1.contains("log"));
    }
    video_channels: "GIF, video", "channels", "all" => {
        let dir = TempDir::new().unwrap();
        // Three planes: green, blue and red.
        let [r, g, b] = COLOR;
        let raw = [[g; 16], [b; 16], [r; 16]].concat();
        let Some(path) = video(&dir, "v.mkv", "gbrp", &raw, &["-c:v", "ffv1"]) else { return };
        near(&read(&path, &linear()).0, &[color_light()]);
    }
    video_times: "GIF, video", "times", "yes" => {
        let dir = TempDir::new().unwrap();
        for name in ["v.mkv", "v.gif"] {
            let codec = if name == "v.mkv" { &["-c:v", "ffv1"][..] } else { &[] };
            let Some(path) = video(&dir, name, "gray", &[51; 48], codec) else { return };
            assert_eq!(open(&path, &options()).unwrap().rate().map(Rate::hz), Some(25.0), "{name}");
        }
    }
    video_alpha: "GIF, video", "alpha", "R; GIF: not read" => {
        let dir = TempDir::new().unwrap();
        let raw = [255, 255, 255, 128].repeat(16);
        let Some(path) = video(&dir, "v.mov", "rgba", &raw, &["-c:v", "png"]) else { return };
        let notes = read(&path, &linear()).1;
        assert!(notes.contains("alpha is not used"), "{notes}");
        let gif = video(&dir, "v.gif", "rgba", &raw, &[]).unwrap();
        assert!(!read(&gif, &linear()).1.contains("alpha"));
    }
    video_orientation: "GIF, video", "orientation", "rotation, mirroring; other angles: R" => {
        let dir = TempDir::new().unwrap();
        // Each pixel has its own value.
        let image = GrayImage::from_fn(4, 4, |x, y| Luma([(17 * (4 * y + x)) as u8]));
        let Some(path) = video(&dir, "v.mov", "gray", image.as_raw(), &["-c:v", "png"]) else { return };
        let one = 0x1_0000_i32;
        let read_with = |[a, b, c, d]: [i32; 4]| {
            let mut bytes = fs::read(&path).unwrap();
            // The matrix of the track header is 40 bytes after the name of its box.
            let at = bytes.windows(4).position(|name| name == b"tkhd").unwrap() + 4 + 40;
            let shift = |sum: i32| if sum < 0 { 4 * one } else { 0 };
            let matrix = [a, b, 0, c, d, 0, shift(a + c), shift(b + d), 0x4000_0000];
            bytes[at..at + 36].copy_from_slice(&matrix.map(i32::to_be_bytes).concat());
            row(&file(&dir, "r.mov", bytes), &sized(linear(), 4, 4))
        };
        // The matrix maps the stored column x and row y to the column a x + c y and the row b x + d y. The first row
        // shows these stored columns and rows.
        for (matrix, stored) in [
            ([one, 0, 0, one], [0, 1, 2, 3]),
            ([0, one, -one, 0], [12, 8, 4, 0]),
            ([-one, 0, 0, -one], [15, 14, 13, 12]),
            ([0, -one, one, 0], [3, 7, 11, 15]),
            ([-one, 0, 0, one], [3, 2, 1, 0]),
            ([one, 0, 0, -one], [12, 13, 14, 15]),
            ([0, one, one, 0], [0, 4, 8, 12]),
            ([0, -one, -one, 0], [15, 11, 7, 3]),
        ] {
            let (lights, notes) = read_with(matrix);
            near(&lights, &stored.map(|n| n as f32 / 15.0));
            assert_eq!(notes, "");
        }
        let diagonal = 46_341;
        let notes = read_with([diagonal, diagonal, -diagonal, diagonal]).1;
        assert!(notes.contains("rotated by 45 degrees"), "{notes}");
    }

    npy_pages: "`.npy`, `.npz`", "pages", "all" => {
        let dir = TempDir::new().unwrap();
        let header = "{'descr': '|u1', 'fortran_order': False, 'shape': (2, 2, 4), }";
        let header = format!("{header:<117}\n");
        let bytes = [b"\x93NUMPY\x01\x00\x76\x00", header.as_bytes(), &[51; 8], &[102; 8]].concat();
        near(&read(&file(&dir, "p.npy", bytes), &options()).0, &[0.2, 0.4]);
    }
    npy_depth: "`.npy`, `.npz`", "bit depth", "element type" => {
        let dir = TempDir::new().unwrap();
        let path = file(&dir, "d.npy", spikelane_array(&[13107; 8]));
        near(&read(&path, &options()).0, &[0.2]);
        assert_eq!(full_scale(&path, &options()), "65535");
        let source = open(&path, &options().with_scale(Some(26214.0))).unwrap();
        assert_eq!(source.full_scale(), FullScale::Code(26214.0));
    }
    npy_channels: "`.npy`, `.npz`", "channels", "gray; (T, H, W, 3)" => {
        let dir = TempDir::new().unwrap();
        let header = "{'descr': '|u1', 'fortran_order': False, 'shape': (2, 2, 4, 3), }";
        let header = format!("{header:<117}\n");
        let samples = [[255, 51, 0]; 16].concat();
        let bytes = [b"\x93NUMPY\x01\x00\x76\x00", header.as_bytes(), &samples].concat();
        // A gray camera receives the luminance of red and of 0.2 green.
        near(&read(&file(&dir, "c.npy", bytes), &options()).0, &[0.2126 + 0.2 * 0.7152; 2]);
    }
}

/// ffmpeg writes the changed rectangle of a frame, and other programs use all operations of the format.
#[test]
fn frames_of_a_deep_animation_are_drawn_on_the_canvas() {
    let dir = TempDir::new().unwrap();
    let [keep, clear, restore] = [0, 1, 2];
    let pixel = |code: u16, alpha: u16| -> DynamicImage {
        image::ImageBuffer::<Rgba<u16>, _>::from_pixel(1, 1, Rgba([code, code, code, alpha])).into()
    };
    let canvas = image::ImageBuffer::<Rgba<u16>, _>::from_pixel(4, 1, Rgba([6_553, 6_553, 6_553, 65_535]));
    let frames = [
        (canvas.into(), [0, 0], [keep, 0], 9),
        (pixel(65_535, 65_535), [1, 0], [restore, 0], 9),
        (pixel(65_535, 65_535), [2, 0], [clear, 0], 9),
        (pixel(65_535, 0), [0, 0], [keep, 1], 9),
        (pixel(65_535, 0), [0, 0], [keep, 0], 9),
    ];
    let path = file(&dir, "a.png", apng_of((4, 1), &frames));
    let mut source = open(&path, &sized(linear(), 4, 1)).unwrap();
    let mut frame = spikelane_io::light::Frame::dark(source.geometry());
    let gray = 0.1;
    for wanted in [
        [gray; 4],
        [gray, 1.0, gray, gray],
        [gray, gray, 1.0, gray],
        // The cleared pixel is transparent black. A transparent pixel does not change the canvas.
        [gray, gray, 0.0, gray],
        [1.0, gray, 0.0, gray],
    ] {
        assert!(source.next_frame(&mut frame).unwrap());
        let found: Vec<f32> = (0..4).map(|col| frame.get(0, col)).collect();
        near(&found, &wanted);
    }
}

#[test]
fn fits_files_without_a_supported_image_are_refused_with_the_cause() {
    let dir = TempDir::new().unwrap();
    let whole = fits(16, 1, &[], &[0; 16]);
    // The card that begins with `keyword` becomes `card`.
    let with = |keyword: &str, card: &str| {
        let text = String::from_utf8_lossy(&whole[..2880]).into_owned();
        let at = text.find(keyword).unwrap();
        [&text.as_bytes()[..at], format!("{card:<80}").as_bytes(), &whole[at + 80..]].concat()
    };
    let table = ["XTENSION= 'BINTABLE'", "BITPIX  = 8", "NAXIS   = 2", "NAXIS1  = 4", "NAXIS2  = 3"];
    let table =
        table.iter().chain(&["ZIMAGE  = T", "END"]).map(|card| format!("{card:<80}")).collect::<String>();
    let empty = &with("NAXIS   ", "NAXIS   = 0")[..2880];
    let compressed = [empty, format!("{table:<2880}").as_bytes(), &[0; 2880]].concat();
    for (bytes, cause) in [
        (compressed, "compressed"),
        (empty.to_vec(), "no image"),
        (with("BITPIX", "BITPIX  = 12"), "samples of 12 bits"),
        (with("BITPIX", "BITPIX  = x"), "`x` of BITPIX"),
        (with("NAXIS3", "NAXIS3  = 18446744073709551615"), "18446744073709551615 frames"),
        (with("NAXIS1", "NAXIS1  = 99999999999"), "99999999999"),
        (whole[..2880 + 8].to_vec(), "2888 bytes"),
        (whole[..80].repeat(36), "no END card"),
    ] {
        let text = refusal(&file(&dir, "f.fits", &bytes), &options());
        assert!(text.contains(cause) && text.contains("f.fits"), "{cause}: {text}");
    }
}
