//! Tests that image files of every format with known codes produce the correct light.

use std::fs;
use std::io::Cursor;
use std::path::{Path, PathBuf};

use image::{DynamicImage, GrayImage, ImageBuffer, Luma, Rgb, RgbImage, Rgba};
use spikelane::{Error, ErrorKind, Geometry};
use spikelane_io::light::{
    CameraMotion, Frame, InputOptions, MotionClip, OwnedSamples, Rate, ResizeMode, Source, Transfer,
};
use spikelane_io::light::{open, open_reader};
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

/// Returns the error of opening and reading a file. Checks that the error message contains the file name.
fn open_error(path: &Path, options: &InputOptions) -> (ErrorKind, String) {
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

fn gray(w: u32, h: u32, light: u8) -> GrayImage {
    GrayImage::from_pixel(w, h, Luma([light]))
}

#[test]
fn an_8_bit_gray_png_is_decoded_as_srgb_or_linear() {
    let dir = TempDir::new().unwrap();
    let path = put(&dir, "a.png", GrayImage::from_raw(3, 1, vec![0, 128, 255]).unwrap());
    // The light of sRGB code 128 is ((128/255 + 0.055) / 1.055)^2.4 = 0.2158605.
    let srgb = read(&path, &camera(3, 1)).unwrap();
    assert_eq!(srgb[0].samples(), &OwnedSamples::U16(vec![0, 14146, 65535]));
    let mut options = camera(3, 1);
    options.transfer = Some(Transfer::Linear);
    let linear = read(&path, &options).unwrap();
    assert_eq!(linear[0].samples(), &OwnedSamples::U8(vec![0, 128, 255]));
}

#[test]
fn colors_become_luminance_after_linearization() {
    let dir = TempDir::new().unwrap();
    let pixels = vec![255, 0, 0, 0, 255, 0, 0, 0, 255, 188, 188, 188];
    let path = put(&dir, "c.tiff", RgbImage::from_raw(4, 1, pixels).unwrap());
    let light = read(&path, &camera(4, 1)).unwrap()[0].to_f32();
    // The light of sRGB code 188 is 0.5028865. The rounding error of 16-bit samples is 8e-6.
    for (got, wanted) in light.iter().zip([0.2126, 0.7152, 0.0722, 0.502_886_5]) {
        assert!((got - wanted).abs() < 2e-5, "{got} {wanted}");
    }
}

#[test]
fn gray_16_bit_files_keep_their_depth() {
    let dir = TempDir::new().unwrap();
    let raw: ImageBuffer<Luma<u16>, _> = ImageBuffer::from_raw(2, 2, vec![0_u16, 1, 32768, 65535]).unwrap();
    for name in ["d.png", "d.tif"] {
        let path = put(&dir, name, raw.clone());
        let mut options = camera(2, 2);
        // At 16 bits, the light of sRGB code 32768 is 0.2140468, and the light of code 1 is 1 / 65535 / 12.92.
        let light = read(&path, &options).unwrap()[0].to_f32();
        assert!((light[1] - 1.181_04e-6).abs() < 1e-10 && (light[2] - 0.214_05).abs() < 1e-5);
        options.transfer = Some(Transfer::Linear);
        let same = read(&path, &options).unwrap();
        assert_eq!(same[0].samples(), &OwnedSamples::U16(vec![0, 1, 32768, 65535]));
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
    let path = put(&dir, "f.jpg", gray(16, 16, 188));
    let light = read(&path, &camera(16, 16)).unwrap()[0].get(8, 8);
    // The decoded code of a uniform JPEG may differ by one or two codes. Near this code, a difference of one code is
    // 0.006 in light.
    assert!((light - 0.5029).abs() < 0.013, "{light}");
}

#[test]
fn exr_is_linear_and_may_exceed_full_scale() {
    let dir = TempDir::new().unwrap();
    let bright = ImageBuffer::from_pixel(4, 4, Rgb([3.5_f32, 3.5, 3.5]));
    let path = put(&dir, "g.exr", bright);
    for size in [4, 2] {
        let light = read(&path, &camera(size, size)).unwrap()[0].get(1, 1);
        // Scaling must not clip light above 1. The sum of the f32 weights is 1 within 1e-6.
        assert!((light - 3.5).abs() < 1e-5, "{light}");
    }
}

#[test]
fn negative_light_in_an_exr_is_named_by_pixel() {
    let dir = TempDir::new().unwrap();
    let mut picture = ImageBuffer::from_pixel(4, 4, Rgb([0.5_f32; 3]));
    picture.put_pixel(3, 2, Rgb([-1.0; 3]));
    let path = put(&dir, "h.exr", picture);
    let (kind, text) = open_error(&path, &camera(4, 4));
    assert_eq!(kind, ErrorKind::Input);
    assert!(text.contains("row 2, col 3"), "{text}");
}

#[test]
fn non_finite_exr_values_are_named_by_pixel() {
    let dir = TempDir::new().unwrap();
    for (value, transfer) in [(f32::NAN, None), (f32::INFINITY, None), (1e30, Some(Transfer::Gamma(10.0)))] {
        let mut picture = ImageBuffer::from_pixel(4, 4, Rgb([0.5_f32; 3]));
        picture.put_pixel(1, 3, Rgb([value; 3]));
        let path = put(&dir, "n.exr", picture);
        for size in [4, 2] {
            let options = camera(size, size).with_transfer(transfer);
            let (kind, text) = open_error(&path, &options);
            assert!(kind == ErrorKind::Input && text.contains("row 3, col 1"), "{value}: {text}");
        }
    }
}

#[test]
fn scaling_averages_light_and_not_codes() {
    let dir = TempDir::new().unwrap();
    let board = GrayImage::from_fn(64, 64, |x, y| Luma([if (x + y) % 2 == 0 { 255 } else { 0 }]));
    let path = put(&dir, "i.png", board);
    let light = read(&path, &camera(16, 16)).unwrap()[0].get(8, 8);
    // If the codes were averaged instead of the light, the result would be 0.214. The filter covers 8 pixels of a
    // checkerboard with equally many dark and bright pixels.
    assert!((light - 0.5).abs() < 1e-3, "{light}");
}

#[test]
fn resize_shows_the_middle_stretch_all_and_crop_pixels() {
    let dir = TempDir::new().unwrap();
    // The image consists of three squares side by side, with the codes 0, 255 and 0.
    let thirds = GrayImage::from_fn(48, 16, |x, _| Luma([if x / 16 == 1 { 255 } else { 0 }]));
    let path = put(&dir, "j.png", thirds);
    let mean = |fit| {
        let mut options = camera(8, 8);
        options.resize_mode = fit;
        let light = read(&path, &options).unwrap()[0].to_f32();
        light.iter().sum::<f32>() / 64.0
    };
    assert_eq!(mean(ResizeMode::Cover), 1.0);
    assert_eq!(mean(ResizeMode::Crop), 1.0);
    assert!((mean(ResizeMode::Stretch) - 1.0 / 3.0).abs() < 0.01);
}

#[test]
fn a_crop_larger_than_the_picture_is_refused() {
    let dir = TempDir::new().unwrap();
    let path = put(&dir, "k.png", gray(8, 8, 1));
    let mut options = camera(9, 8);
    options.resize_mode = ResizeMode::Crop;
    assert_eq!(open_error(&path, &options).0, ErrorKind::Input);
}

#[test]
fn a_folder_is_read_in_the_order_of_its_numbers() {
    let dir = TempDir::new().unwrap();
    for (name, light) in [("img10.png", 30), ("img2.png", 20), ("img1.PNG", 10)] {
        put(&dir, name, gray(4, 4, light));
    }
    fs::write(dir.path().join("notes.txt"), "x").unwrap();
    put(&dir, ".hidden.png", gray(9, 9, 1));
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
    put(&dir, "a1.png", gray(4, 4, 1));
    put(&dir, "a2.png", gray(5, 4, 1));
    let error = open(dir.path(), &camera(4, 4)).err().unwrap();
    let text = error.to_string();
    assert_eq!(error.kind(), ErrorKind::Input);
    assert!(["a2.png", "5x4", "4x4"].iter().all(|s| text.contains(s)), "{text}");
}

#[test]
fn damaged_images_and_empty_folders_are_input_errors() {
    let dir = TempDir::new().unwrap();
    assert_eq!(open(dir.path(), &camera(4, 4)).err().unwrap().kind(), ErrorKind::Input);
    let image = put(&dir, "whole.png", RgbImage::from_fn(64, 64, |x, y| Rgb([x as u8, y as u8, 7])));
    let bytes = fs::read(&image).unwrap();
    fs::write(dir.path().join("cut.png"), &bytes[..bytes.len() / 2]).unwrap();
    fs::write(dir.path().join("text.png"), "no image").unwrap();
    for name in ["cut.png", "text.png"] {
        assert_eq!(open_error(&dir.path().join(name), &camera(4, 4)).0, ErrorKind::Input);
    }
}

#[test]
fn a_missing_file_is_an_io_error_and_an_unknown_one_lists_what_is_read() {
    let dir = TempDir::new().unwrap();
    assert_eq!(open_error(&dir.path().join("none.png"), &camera(4, 4)).0, ErrorKind::Io);
    fs::write(dir.path().join("table.csv"), "1,2").unwrap();
    let (kind, text) = open_error(&dir.path().join("table.csv"), &camera(4, 4));
    assert_eq!(kind, ErrorKind::Usage);
    assert!(text.contains(".npy") && text.contains("EXR"), "{text}");
}

fn motion_clip(motion: &str, frames: u64) -> Option<MotionClip> {
    let motion: CameraMotion = motion.parse().unwrap();
    let rate = Rate::new(10, 1).unwrap();
    Some(MotionClip { motion, rate, frames })
}

#[test]
fn a_pan_moves_by_whole_pixels_and_mirrors_beyond_the_edge() {
    let dir = TempDir::new().unwrap();
    let ramp = GrayImage::from_fn(6, 1, |x, _| Luma([10 * x as u8]));
    let path = put(&dir, "ramp.png", ramp);
    let mut options = camera(6, 1);
    options.transfer = Some(Transfer::Linear);
    // A pan of 20 pixels per second at 10 frames per second is two pixels per frame.
    for spec in ["pan=20,0", "pan=2,0/frame"] {
        options.motion_clip = motion_clip(spec, 2);
        let frames = read(&path, &options).unwrap();
        let codes = |f: &Frame| f.to_f32().iter().map(|x| (x * 255.0).round()).collect::<Vec<_>>();
        assert_eq!(codes(&frames[0]), [0.0, 10.0, 20.0, 30.0, 40.0, 50.0]);
        assert_eq!(codes(&frames[1]), [20.0, 30.0, 40.0, 50.0, 50.0, 40.0]);
    }
}

#[test]
fn a_quarter_turn_is_clockwise_and_zoom_magnifies() {
    let dir = TempDir::new().unwrap();
    let corner = GrayImage::from_fn(8, 8, |x, y| Luma([if x < 4 && y < 4 { 255 } else { 0 }]));
    let path = put(&dir, "turn.png", corner);
    let mut options = camera(8, 8);
    // A rotation of 900 degrees per second at 10 frames per second is 90 degrees per frame.
    options.motion_clip = motion_clip("rotate=900", 2);
    let turned = &read(&path, &options).unwrap()[1];
    assert!(turned.get(1, 6) > 0.99 && turned.get(1, 1) < 0.01 && turned.get(6, 6) < 0.01);
    // At 10 frames per second, a zoom of 1000 per second is 1000^0.1 = 2 per frame. The magnified bright square still
    // covers the center.
    let dot = GrayImage::from_fn(8, 8, |x, y| {
        Luma([if (3..5).contains(&x) && (3..5).contains(&y) { 255 } else { 0 }])
    });
    let path = put(&dir, "dot.png", dot);
    options.motion_clip = motion_clip("zoom=1000:pan=0,0", 2);
    let near = read(&path, &options).unwrap();
    let sum = |f: &Frame| f.to_f32().iter().sum::<f32>();
    // In one frame, the area of the square is multiplied by 1000^0.2 = 3.98. Bilinear edges on an 8x8 grid cause an
    // error of a few percent.
    assert!((sum(&near[1]) / sum(&near[0]) - 3.98).abs() < 0.4, "{}", sum(&near[1]));
}

/// A motion without displacement gives the still image, for every part and scale of the image.
#[test]
fn a_motion_at_rest_is_the_still_picture_for_every_size() {
    let dir = TempDir::new().unwrap();
    let sizes = [(1, 1), (2, 3), (5, 4), (7, 7), (8, 5), (13, 31), (33, 12)];
    for (w, h) in sizes {
        let path =
            put(&dir, "m.png", RgbImage::from_fn(w, h, |x, y| Rgb([(37 * x) as u8, (53 * y) as u8, 9])));
        for ((cw, ch), fit) in sizes
            .iter()
            .flat_map(|s| [(*s, ResizeMode::Cover), (*s, ResizeMode::Stretch), (*s, ResizeMode::Crop)])
        {
            let mut options = camera(cw, ch);
            options.resize_mode = fit;
            if fit == ResizeMode::Crop && (cw > w || ch > h) {
                continue;
            }
            let still = read(&path, &options).unwrap();
            for spec in ["pan=0,0", "pan=0,0/frame", "zoom=1:rotate=0", "rotate=3600"] {
                options.motion_clip = motion_clip(spec, 3);
                let moved = read(&path, &options).unwrap();
                assert!(moved.iter().all(|f| *f == still[0]), "{w}x{h} to {cw}x{ch}, {fit:?}, {spec}");
            }
        }
    }
}

/// The pan is slow, so frame 1 must differ little from the still image in frame 0. The image is a ramp of two codes per
/// column and one code per row, so a pan of 0.001 pixels changes a pixel by far less than one code.
#[test]
fn a_slow_pan_leaves_the_still_picture_without_a_jump() {
    let dir = TempDir::new().unwrap();
    for (w, h) in [(41, 27), (64, 48), (63, 90)] {
        let path = put(&dir, "s.png", GrayImage::from_fn(w, h, |x, y| Luma([(2 * x + y) as u8])));
        let mut options = camera(20, 15);
        options.transfer = Some(Transfer::Linear);
        let step = f64::from(w).max(f64::from(h)) / 15.0;
        options.motion_clip = motion_clip("pan=0.001,0/frame", 2);
        let frames = read(&path, &options).unwrap();
        for (row, col) in [(4, 5), (7, 10), (10, 14)] {
            let jump = 255.0 * f64::from(frames[1].get(row, col) - frames[0].get(row, col));
            // Triangle filters of different widths give the same result for a ramp, except for a sampling error of 0.1
            // pixels.
            assert!(jump.abs() < 0.3 * step, "{w}x{h} at {row}, {col}: {jump} codes");
        }
    }
}

/// Returns a 3x2 image with distinct pixels, stored in one of the eight EXIF orientations.
fn oriented(orientation: u16) -> (u32, u32, Vec<u8>) {
    let shown = |row: u32, col: u32| (40 * (3 * row + col) + 20) as u8;
    // `at` returns the displayed position of the stored pixel (row, col), as the EXIF tag defines.
    let (w, h) = if orientation >= 5 { (2, 3) } else { (3, 2) };
    let at = |r: u32, c: u32| match orientation {
        1 => (r, c),
        2 => (r, w - 1 - c),
        3 => (h - 1 - r, w - 1 - c),
        4 => (h - 1 - r, c),
        5 => (c, r),
        6 => (c, h - 1 - r),
        7 => (w - 1 - c, h - 1 - r),
        _ => (w - 1 - c, r),
    };
    let stored = (0..h).flat_map(|r| (0..w).map(move |c| (r, c)));
    (w, h, stored.map(|(r, c)| at(r, c)).map(|(r, c)| shown(r, c)).collect())
}

/// Returns a minimal EXIF block in TIFF format. The block contains only the orientation tag.
fn exif(orientation: u16) -> Vec<u8> {
    let mut block = b"II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0".to_vec();
    block.extend(orientation.to_le_bytes());
    block.extend([0; 6]);
    block
}

#[test]
fn the_orientation_of_png_jpeg_and_tiff_is_obeyed() {
    use image::ImageEncoder;
    use image::codecs::{jpeg::JpegEncoder, png::PngEncoder, tiff::TiffEncoder};
    let dir = TempDir::new().unwrap();
    let mut options = camera(3, 2);
    options.transfer = Some(Transfer::Linear);
    for orientation in 1..=8 {
        let (w, h, pixels) = oriented(orientation);
        let gray = image::ExtendedColorType::L8;
        let mut png = Vec::new();
        let mut encoder = PngEncoder::new(&mut png);
        encoder.set_exif_metadata(exif(orientation)).unwrap();
        encoder.write_image(&pixels, w, h, gray).unwrap();
        // Each pixel becomes a block of 16x16 pixels, because JPEG preserves uniform blocks.
        let mut jpeg = Vec::new();
        let large = GrayImage::from_fn(16 * w, 16 * h, |x, y| Luma([pixels[(y / 16 * w + x / 16) as usize]]));
        let mut encoder = JpegEncoder::new_with_quality(&mut jpeg, 100);
        encoder.set_exif_metadata(exif(orientation)).unwrap();
        encoder.write_image(large.as_raw(), 16 * w, 16 * h, gray).unwrap();
        let mut tiff = Cursor::new(Vec::new());
        TiffEncoder::new(&mut tiff).write_image(&pixels, w, h, gray).unwrap();
        for (name, bytes) in
            [("o.png", png), ("o.jpg", jpeg), ("o.tif", with_tag(tiff.into_inner(), orientation))]
        {
            let folder = TempDir::new_in(dir.path()).unwrap();
            let path = folder.path().join(name);
            fs::write(&path, bytes).unwrap();
            for path in [path.as_path(), folder.path()] {
                // Scaling would blur the JPEG images, so the camera has the size of the enlarged image. Each block is
                // checked at its center.
                let block = if name == "o.jpg" { 16 } else { 1 };
                options.camera = Geometry::new(3 * block, 2 * block).unwrap();
                let light = &read(path, &options).unwrap()[0];
                for (row, col) in (0..2).flat_map(|r| (0..3).map(move |c| (r, c))) {
                    let middle = |i: usize| i * block as usize + block as usize / 2;
                    let code = light.get(middle(row), middle(col)) * 255.0;
                    // The decoded code of a JPEG may differ by one code.
                    let wanted = (40 * (3 * row + col) + 20) as f32;
                    assert!((code - wanted).abs() < 1.5, "{orientation} {name} {row} {col}: {code}");
                }
            }
        }
    }
}

/// Returns `tiff` with the orientation tag added. `tiff` must be little-endian and have a single directory at the end.
fn with_tag(tiff: Vec<u8>, orientation: u16) -> Vec<u8> {
    let u32_at = |at: usize| u32::from_le_bytes(tiff[at..at + 4].try_into().unwrap()) as usize;
    let start = u32_at(4);
    let count = usize::from(u16::from_le_bytes([tiff[start], tiff[start + 1]]));
    let mut tags: Vec<Vec<u8>> =
        tiff[start + 2..start + 2 + 12 * count].chunks(12).map(<[u8]>::to_vec).collect();
    tags.retain(|t| t[..2] != [0x12, 0x01]);
    let mut tag = vec![0x12, 0x01, 3, 0, 1, 0, 0, 0];
    tag.extend(orientation.to_le_bytes());
    tag.extend([0, 0]);
    tags.push(tag);
    tags.sort_by_key(|t| u16::from_le_bytes([t[0], t[1]]));
    // The new directory is appended at the end of the file, so the offsets of the existing data do not change.
    let mut out = tiff.clone();
    let place = (out.len() as u32).to_le_bytes();
    out[4..8].copy_from_slice(&place);
    out.extend((tags.len() as u16).to_le_bytes());
    out.extend(tags.concat());
    out.extend([0; 4]);
    out
}

#[test]
fn floats_among_integer_images_are_refused_by_name() {
    let dir = TempDir::new().unwrap();
    put(&dir, "a1.png", gray(4, 4, 1));
    put(&dir, "a2.exr", ImageBuffer::from_pixel(4, 4, Rgb([0.5_f32; 3])));
    let error = open(dir.path(), &camera(4, 4)).err().unwrap();
    let text = error.to_string();
    assert!(error.kind() == ErrorKind::Input && text.contains("a2.exr") && text.contains("a1.png"), "{text}");
}

fn with_front_end(table: &str, w: u32, h: u32) -> InputOptions {
    let mut camera = spikelane::presets::from_toml(&format!("[light]\n{table}"), None).unwrap();
    camera.sensor.geometry = Geometry::new(w, h).unwrap();
    InputOptions::from_camera(&camera)
}

#[test]
fn a_declared_transfer_function_replaces_the_front_ends() {
    let dir = TempDir::new().unwrap();
    let path = put(&dir, "f.png", gray(2, 1, 128));
    let mut options = with_front_end("transfer = \"linear\"", 2, 1);
    assert_eq!(read(&path, &options).unwrap()[0].samples(), &OwnedSamples::U8(vec![128; 2]));
    options.transfer = Some(Transfer::Srgb);
    assert_eq!(read(&path, &options).unwrap()[0].samples(), &OwnedSamples::U16(vec![14146; 2]));
    assert_eq!(open(&path, &options).unwrap().front_end().transfer, Some(Transfer::Srgb));
}

#[test]
fn gray_codes_are_rounded_before_the_curve() {
    let dir = TempDir::new().unwrap();
    let path = put(&dir, "c.png", RgbImage::from_pixel(1, 1, Rgb([10, 20, 200])));
    let light = |table: &str| read(&path, &with_front_end(table, 1, 1)).unwrap()[0].get(0, 0) * 255.0;
    let weights = "transfer = \"linear\"\nluminance = [0.25, 0.5, 0.25]";
    // The gray code is 0.25 * 10 + 0.5 * 20 + 0.25 * 200 = 2.5 + 10 + 50 = 62.5, which is rounded to 63. One step of a
    // 16-bit sample is 0.004 codes.
    assert!((light(&format!("{weights}\ngray_codes = true")) - 63.0).abs() < 0.01);
    assert!((light(weights) - 62.5).abs() < 0.01);
}

#[test]
fn full_scale_is_a_code_or_the_brightest_pixel_of_each_frame() {
    let dir = TempDir::new().unwrap();
    let put_row =
        |name: &str, codes: [u8; 3]| put(&dir, name, GrayImage::from_raw(3, 1, codes.to_vec()).unwrap());
    put_row("1.png", [0, 50, 100]);
    put_row("2.png", [0, 0, 0]);
    put_row("3.png", [200, 50, 100]);
    let lights = |table: &str| -> Vec<Vec<f32>> {
        read(dir.path(), &with_front_end(table, 3, 1)).unwrap().iter().map(Frame::to_f32).collect()
    };
    let peak = lights("transfer = \"linear\"\nfull_scale = \"peak\"");
    assert_eq!(peak, [[0.0, 0.5, 1.0], [0.0; 3], [1.0, 0.25, 0.5]]);
    assert_eq!(lights("transfer = \"linear\"\nfull_scale = 100")[2], [2.0, 0.5, 1.0]);
    // With a transfer function, full scale is the light of code 100.
    assert!((lights("full_scale = 100")[0][2] - 1.0).abs() < 1e-4);
}

#[test]
fn an_exr_is_light_whatever_the_cameras_front_end() {
    let dir = TempDir::new().unwrap();
    let path = put(&dir, "e.exr", ImageBuffer::from_pixel(2, 2, Rgb([0.5_f32; 3])));
    for table in ["transfer = \"srgb\"", "transfer = \"linear\"\nfull_scale = \"peak\"", "full_scale = 50"] {
        let options = with_front_end(table, 2, 2);
        assert!((read(&path, &options).unwrap()[0].get(0, 0) - 0.5).abs() < 1e-6, "{table}");
        assert_eq!(open(&path, &options).unwrap().front_end().transfer, Some(Transfer::Linear));
    }
}

#[test]
fn motions_that_make_no_sense_are_usage_errors() {
    for bad in ["", "pan=1", "pan=1,2:pan=3,4", "zoom=0", "zoom=-1", "spin=3", "rotate=nan"] {
        assert_eq!(bad.parse::<CameraMotion>().unwrap_err().kind(), ErrorKind::Usage, "{bad}");
    }
    let dir = TempDir::new().unwrap();
    put(&dir, "a.png", gray(4, 4, 1));
    let mut options = camera(4, 4);
    options.motion_clip = motion_clip("pan=1,1", 2);
    assert_eq!(open(dir.path(), &options).err().unwrap().kind(), ErrorKind::Usage);
}

#[test]
fn a_stream_that_is_neither_y4m_nor_npy_is_refused() {
    for bytes in [&b""[..], b"hello", b"Y", b"\x93NUM"] {
        let error = open_reader(Box::new(Cursor::new(bytes)), "pipe", &camera(4, 4)).err().unwrap();
        assert_eq!(error.kind(), ErrorKind::Input);
        assert!(error.to_string().starts_with("pipe"), "{error}");
    }
}
