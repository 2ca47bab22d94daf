//! Every kind of file goes in as known numbers and comes out as the right light.
#![cfg(feature = "files")]

use std::fs;
use std::io::Cursor;
use std::path::{Path, PathBuf};

use image::{DynamicImage, GrayImage, ImageBuffer, Luma, Rgb, RgbImage, Rgba};
use spikelane::light::{Fit, Frame, Motion, Moving, Options, Rate, Samples, Source, Transfer};
use spikelane::light::{open, open_reader};
use spikelane::{Error, Geometry, Kind};
use tempfile::TempDir;

fn camera(w: u32, h: u32) -> Options {
    Options::new(Geometry::new(w, h).unwrap())
}

fn frames(source: &mut dyn Source) -> Result<Vec<Frame>, Error> {
    let mut all = Vec::new();
    let mut frame = Frame::dark(source.geometry());
    while source.next_frame(&mut frame)? {
        all.push(frame.clone());
    }
    Ok(all)
}

fn read(path: &Path, options: &Options) -> Result<Vec<Frame>, Error> {
    frames(&mut *open(path, options)?)
}

/// The error of opening and reading; it must name the file.
fn refused(path: &Path, options: &Options) -> (Kind, String) {
    let error = read(path, options).unwrap_err();
    let text = error.to_string();
    let name = path.file_name().unwrap().to_string_lossy();
    assert!(text.contains(&*name), "{text}");
    (error.kind(), text)
}

fn put(folder: &TempDir, name: &str, image: impl Into<DynamicImage>) -> PathBuf {
    let path = folder.path().join(name);
    image.into().save(&path).unwrap();
    path
}

fn grey(w: u32, h: u32, light: u8) -> GrayImage {
    GrayImage::from_pixel(w, h, Luma([light]))
}

#[test]
fn grey_png_of_8_bits_goes_through_srgb_or_stays() {
    let dir = TempDir::new().unwrap();
    let path = put(&dir, "a.png", GrayImage::from_raw(3, 1, vec![0, 128, 255]).unwrap());
    // sRGB 128: ((128/255 + 0.055) / 1.055)^2.4 = 0.2158605.
    let srgb = read(&path, &camera(3, 1)).unwrap();
    assert_eq!(srgb[0].samples(), &Samples::U16(vec![0, 14146, 65535]));
    let mut options = camera(3, 1);
    options.transfer = Some(Transfer::Linear);
    let linear = read(&path, &options).unwrap();
    assert_eq!(linear[0].samples(), &Samples::U8(vec![0, 128, 255]));
}

#[test]
fn colours_become_luminance_after_linearising() {
    let dir = TempDir::new().unwrap();
    let pixels = vec![255, 0, 0, 0, 255, 0, 0, 0, 255, 188, 188, 188];
    let path = put(&dir, "c.tiff", RgbImage::from_raw(4, 1, pixels).unwrap());
    let light = read(&path, &camera(4, 1)).unwrap()[0].to_f32();
    // sRGB 188 is 0.5028865; one 16-bit rounding is 8e-6.
    for (got, wanted) in light.iter().zip([0.2126, 0.7152, 0.0722, 0.502_886_5]) {
        assert!((got - wanted).abs() < 2e-5, "{got} {wanted}");
    }
}

#[test]
fn grey_16_bit_files_keep_their_depth() {
    let dir = TempDir::new().unwrap();
    let raw: ImageBuffer<Luma<u16>, _> = ImageBuffer::from_raw(2, 2, vec![0_u16, 1, 32768, 65535]).unwrap();
    for name in ["d.png", "d.tif"] {
        let path = put(&dir, name, raw.clone());
        let mut options = camera(2, 2);
        // 32768 through sRGB is 0.2140468; code 1 is 1 / 65535 / 12.92.
        let light = read(&path, &options).unwrap()[0].to_f32();
        assert!((light[1] - 1.181_04e-6).abs() < 1e-10 && (light[2] - 0.214_05).abs() < 1e-5);
        options.transfer = Some(Transfer::Linear);
        let same = read(&path, &options).unwrap();
        assert_eq!(same[0].samples(), &Samples::U16(vec![0, 1, 32768, 65535]));
    }
}

#[test]
fn alpha_is_ignored() {
    let dir = TempDir::new().unwrap();
    let clear = ImageBuffer::from_pixel(2, 2, Rgba([255_u8, 255, 255, 0]));
    let path = put(&dir, "e.png", clear);
    assert_eq!(read(&path, &camera(2, 2)).unwrap()[0].max(), 1.0);
}

#[test]
fn a_jpeg_is_read_near_its_light() {
    let dir = TempDir::new().unwrap();
    let path = put(&dir, "f.jpg", grey(16, 16, 188));
    let light = read(&path, &camera(16, 16)).unwrap()[0].get(8, 8);
    // A flat JPEG may be off by a code or two; a code is 0.006 of light here.
    assert!((light - 0.5029).abs() < 0.013, "{light}");
}

#[test]
fn exr_is_linear_and_may_exceed_full_scale() {
    let dir = TempDir::new().unwrap();
    let bright = ImageBuffer::from_pixel(4, 4, Rgb([3.5_f32, 3.5, 3.5]));
    let path = put(&dir, "g.exr", bright);
    for size in [4, 2] {
        let light = read(&path, &camera(size, size)).unwrap()[0].get(1, 1);
        // Scaling must not clip; f32 sums of weights that add to 1 within 1e-6.
        assert!((light - 3.5).abs() < 1e-5, "{light}");
    }
}

#[test]
fn negative_light_in_an_exr_is_named_by_pixel() {
    let dir = TempDir::new().unwrap();
    let mut picture = ImageBuffer::from_pixel(4, 4, Rgb([0.5_f32; 3]));
    picture.put_pixel(3, 2, Rgb([-1.0; 3]));
    let path = put(&dir, "h.exr", picture);
    let (kind, text) = refused(&path, &camera(4, 4));
    assert_eq!(kind, Kind::Input);
    assert!(text.contains("row 2, col 3"), "{text}");
}

#[test]
fn scaling_averages_light_and_not_codes() {
    let dir = TempDir::new().unwrap();
    let board = GrayImage::from_fn(64, 64, |x, y| Luma([if (x + y) % 2 == 0 { 255 } else { 0 }]));
    let path = put(&dir, "i.png", board);
    let light = read(&path, &camera(16, 16)).unwrap()[0].get(8, 8);
    // Codes would average to 0.214. The tent spans 8 pixels of a balanced board.
    assert!((light - 0.5).abs() < 1e-3, "{light}");
}

#[test]
fn resize_shows_the_middle_stretch_all_and_crop_pixels() {
    let dir = TempDir::new().unwrap();
    // Three squares side by side: 0, 255, 0.
    let thirds = GrayImage::from_fn(48, 16, |x, _| Luma([if x / 16 == 1 { 255 } else { 0 }]));
    let path = put(&dir, "j.png", thirds);
    let mean = |fit| {
        let mut options = camera(8, 8);
        options.fit = fit;
        let light = read(&path, &options).unwrap()[0].to_f32();
        light.iter().sum::<f32>() / 64.0
    };
    assert_eq!(mean(Fit::Resize), 1.0);
    assert_eq!(mean(Fit::Crop), 1.0);
    assert!((mean(Fit::Stretch) - 1.0 / 3.0).abs() < 0.01);
}

#[test]
fn a_crop_larger_than_the_picture_is_refused() {
    let dir = TempDir::new().unwrap();
    let path = put(&dir, "k.png", grey(8, 8, 1));
    let mut options = camera(9, 8);
    options.fit = Fit::Crop;
    assert_eq!(refused(&path, &options).0, Kind::Input);
}

#[test]
fn a_folder_is_read_in_the_order_of_its_numbers() {
    let dir = TempDir::new().unwrap();
    for (name, light) in [("img10.png", 30), ("img2.png", 20), ("img1.PNG", 10)] {
        put(&dir, name, grey(4, 4, light));
    }
    fs::write(dir.path().join("notes.txt"), "x").unwrap();
    put(&dir, ".hidden.png", grey(9, 9, 1));
    let mut options = camera(4, 4);
    options.transfer = Some(Transfer::Linear);
    let mut source = open(dir.path(), &options).unwrap();
    assert_eq!(source.frames(), Some(3));
    assert!(source.describe().contains("2 other entries ignored"), "{}", source.describe());
    let light: Vec<_> = frames(&mut *source).unwrap().iter().map(|f| f.get(0, 0) * 255.0).collect();
    assert_eq!(light, [10.0, 20.0, 30.0]);
}

#[test]
fn images_of_mixed_size_are_named_with_both_sizes() {
    let dir = TempDir::new().unwrap();
    put(&dir, "a1.png", grey(4, 4, 1));
    put(&dir, "a2.png", grey(5, 4, 1));
    let error = open(dir.path(), &camera(4, 4)).err().unwrap();
    let text = error.to_string();
    assert_eq!(error.kind(), Kind::Input);
    assert!(["a2.png", "5x4", "4x4"].iter().all(|s| text.contains(s)), "{text}");
}

#[test]
fn damaged_images_and_empty_folders_are_input_errors() {
    let dir = TempDir::new().unwrap();
    assert_eq!(open(dir.path(), &camera(4, 4)).err().unwrap().kind(), Kind::Input);
    let whole = put(&dir, "whole.png", RgbImage::from_fn(64, 64, |x, y| Rgb([x as u8, y as u8, 7])));
    let bytes = fs::read(&whole).unwrap();
    fs::write(dir.path().join("cut.png"), &bytes[..bytes.len() / 2]).unwrap();
    fs::write(dir.path().join("text.png"), "no image").unwrap();
    for name in ["cut.png", "text.png"] {
        assert_eq!(refused(&dir.path().join(name), &camera(4, 4)).0, Kind::Input);
    }
}

#[test]
fn a_missing_file_is_an_io_error_and_an_unknown_one_lists_what_is_read() {
    let dir = TempDir::new().unwrap();
    assert_eq!(refused(&dir.path().join("none.png"), &camera(4, 4)).0, Kind::Io);
    fs::write(dir.path().join("table.csv"), "1,2").unwrap();
    let (kind, text) = refused(&dir.path().join("table.csv"), &camera(4, 4));
    assert_eq!(kind, Kind::Usage);
    assert!(text.contains(".npy") && text.contains("EXR"), "{text}");
}

fn moving(motion: &str, frames: u64) -> Option<Moving> {
    let motion: Motion = motion.parse().unwrap();
    let rate = Rate::new(10, 1).unwrap();
    Some(Moving { motion, rate, frames })
}

#[test]
fn a_pan_moves_by_whole_pixels_and_mirrors_beyond_the_edge() {
    let dir = TempDir::new().unwrap();
    let ramp = GrayImage::from_fn(6, 1, |x, _| Luma([10 * x as u8]));
    let path = put(&dir, "ramp.png", ramp);
    let mut options = camera(6, 1);
    options.transfer = Some(Transfer::Linear);
    // 20 px/s at 10 frames per second: two pixels a frame.
    for spec in ["pan=20,0", "pan=2,0/frame"] {
        options.moving = moving(spec, 2);
        let seen = read(&path, &options).unwrap();
        let codes = |f: &Frame| f.to_f32().iter().map(|x| (x * 255.0).round()).collect::<Vec<_>>();
        assert_eq!(codes(&seen[0]), [0.0, 10.0, 20.0, 30.0, 40.0, 50.0]);
        assert_eq!(codes(&seen[1]), [20.0, 30.0, 40.0, 50.0, 50.0, 40.0]);
    }
}

#[test]
fn a_quarter_turn_is_clockwise_and_zoom_magnifies() {
    let dir = TempDir::new().unwrap();
    let corner = GrayImage::from_fn(8, 8, |x, y| Luma([if x < 4 && y < 4 { 255 } else { 0 }]));
    let path = put(&dir, "turn.png", corner);
    let mut options = camera(8, 8);
    // 900 degrees a second at 10 frames per second: 90 a frame.
    options.moving = moving("rotate=900", 2);
    let turned = &read(&path, &options).unwrap()[1];
    assert!(turned.get(1, 6) > 0.99 && turned.get(1, 1) < 0.01 && turned.get(6, 6) < 0.01);
    // 1024 per second is 2 after a tenth: the bright quarter still meets the middle.
    let dot = GrayImage::from_fn(8, 8, |x, y| {
        Luma([if (3..5).contains(&x) && (3..5).contains(&y) { 255 } else { 0 }])
    });
    let path = put(&dir, "dot.png", dot);
    options.moving = moving("zoom=1000:pan=0,0", 2);
    let near = read(&path, &options).unwrap();
    let sum = |f: &Frame| f.to_f32().iter().sum::<f32>();
    // The area grows by 1000^0.2 = 3.98; bilinear edges on an 8x8 grid cost a few per cent.
    assert!((sum(&near[1]) / sum(&near[0]) - 3.98).abs() < 0.4, "{}", sum(&near[1]));
}

#[test]
fn motions_that_make_no_sense_are_usage_errors() {
    for bad in ["", "pan=1", "pan=1,2:pan=3,4", "zoom=0", "zoom=-1", "spin=3", "rotate=nan"] {
        assert_eq!(bad.parse::<Motion>().unwrap_err().kind(), Kind::Usage, "{bad}");
    }
    let dir = TempDir::new().unwrap();
    put(&dir, "a.png", grey(4, 4, 1));
    let mut options = camera(4, 4);
    options.moving = moving("pan=1,1", 2);
    assert_eq!(open(dir.path(), &options).err().unwrap().kind(), Kind::Usage);
}

#[test]
fn a_stream_that_is_neither_y4m_nor_npy_is_refused() {
    for bytes in [&b""[..], b"hello", b"Y", b"\x93NUM"] {
        let error = open_reader(Box::new(Cursor::new(bytes)), "pipe", &camera(4, 4)).err().unwrap();
        assert_eq!(error.kind(), Kind::Input);
        assert!(error.to_string().starts_with("pipe"), "{error}");
    }
}
