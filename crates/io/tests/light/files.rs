//! Every kind of file goes in as known numbers and comes out as the right light.

use std::fs;
use std::io::Cursor;
use std::path::{Path, PathBuf};

use image::{DynamicImage, GrayImage, ImageBuffer, Luma, Rgb, RgbImage, Rgba};
use spikelane::{Error, Geometry, Kind};
use spikelane_io::light::{Fit, Frame, InputOptions, Motion, Moving, OwnedSamples, Rate, Source, Transfer};
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

/// The error of opening and reading; it must name the file.
fn refused(path: &Path, options: &InputOptions) -> (Kind, String) {
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
    assert_eq!(srgb[0].samples(), &OwnedSamples::U16(vec![0, 14146, 65535]));
    let mut options = camera(3, 1);
    options.transfer = Some(Transfer::Linear);
    let linear = read(&path, &options).unwrap();
    assert_eq!(linear[0].samples(), &OwnedSamples::U8(vec![0, 128, 255]));
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
fn what_is_not_finite_in_an_exr_or_becomes_so_is_named_by_pixel() {
    let dir = TempDir::new().unwrap();
    for (value, transfer) in [(f32::NAN, None), (f32::INFINITY, None), (1e30, Some(Transfer::Gamma(10.0)))] {
        let mut picture = ImageBuffer::from_pixel(4, 4, Rgb([0.5_f32; 3]));
        picture.put_pixel(1, 3, Rgb([value; 3]));
        let path = put(&dir, "n.exr", picture);
        for size in [4, 2] {
            let options = camera(size, size).with_transfer(transfer);
            let (kind, text) = refused(&path, &options);
            assert!(kind == Kind::Input && text.contains("row 3, col 1"), "{value}: {text}");
        }
    }
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

/// A motion that does not move is a still picture, whatever is cut and scaled for the camera.
#[test]
fn a_motion_at_rest_is_the_still_picture_for_every_size() {
    let dir = TempDir::new().unwrap();
    let sizes = [(1, 1), (2, 3), (5, 4), (7, 7), (8, 5), (13, 31), (33, 12)];
    for (w, h) in sizes {
        let path =
            put(&dir, "m.png", RgbImage::from_fn(w, h, |x, y| Rgb([(37 * x) as u8, (53 * y) as u8, 9])));
        for ((cw, ch), fit) in
            sizes.iter().flat_map(|s| [(*s, Fit::Resize), (*s, Fit::Stretch), (*s, Fit::Crop)])
        {
            let mut options = camera(cw, ch);
            options.fit = fit;
            if fit == Fit::Crop && (cw > w || ch > h) {
                continue;
            }
            let still = read(&path, &options).unwrap();
            for spec in ["pan=0,0", "pan=0,0/frame", "zoom=1:rotate=0", "rotate=3600"] {
                options.moving = moving(spec, 3);
                let moved = read(&path, &options).unwrap();
                assert!(moved.iter().all(|f| *f == still[0]), "{w}x{h} to {cw}x{ch}, {fit:?}, {spec}");
            }
        }
    }
}

/// Frame 1 of a slow pan must not jump from the still picture of frame 0: a thousandth of a pixel changes
/// a ramp of a code per pixel by a thousandth of a code, and the whole picture, scaled by itself, was half a pixel away.
#[test]
fn a_slow_pan_leaves_the_still_picture_without_a_jump() {
    let dir = TempDir::new().unwrap();
    for (w, h) in [(41, 27), (64, 48), (63, 90)] {
        let path = put(&dir, "s.png", GrayImage::from_fn(w, h, |x, y| Luma([(2 * x + y) as u8])));
        let mut options = camera(20, 15);
        options.transfer = Some(Transfer::Linear);
        let step = f64::from(w).max(f64::from(h)) / 15.0;
        options.moving = moving("pan=0.001,0/frame", 2);
        let seen = read(&path, &options).unwrap();
        for (row, col) in [(4, 5), (7, 10), (10, 14)] {
            let jump = 255.0 * f64::from(seen[1].get(row, col) - seen[0].get(row, col));
            // Tents of other widths agree on a ramp but for their sampling, a tenth of a pixel here.
            assert!(jump.abs() < 0.3 * step, "{w}x{h} at {row}, {col}: {jump} codes");
        }
    }
}

/// A 3x2 picture whose pixels are told apart, stored for each of the eight orientations of EXIF.
fn oriented(orientation: u16) -> (u32, u32, Vec<u8>) {
    let shown = |row: u32, col: u32| (40 * (3 * row + col) + 20) as u8;
    // Where the stored pixel (row, col) is shown, by the definition of the tag.
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

/// The TIFF block that EXIF is, with nothing but the tag of orientation.
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
        let grey = image::ExtendedColorType::L8;
        let mut png = Vec::new();
        let mut encoder = PngEncoder::new(&mut png);
        encoder.set_exif_metadata(exif(orientation)).unwrap();
        encoder.write_image(&pixels, w, h, grey).unwrap();
        // Blocks of 16x16 for each pixel, which JPEG keeps flat.
        let mut jpeg = Vec::new();
        let large = GrayImage::from_fn(16 * w, 16 * h, |x, y| Luma([pixels[(y / 16 * w + x / 16) as usize]]));
        let mut encoder = JpegEncoder::new_with_quality(&mut jpeg, 100);
        encoder.set_exif_metadata(exif(orientation)).unwrap();
        encoder.write_image(large.as_raw(), 16 * w, 16 * h, grey).unwrap();
        let mut tiff = Cursor::new(Vec::new());
        TiffEncoder::new(&mut tiff).write_image(&pixels, w, h, grey).unwrap();
        for (name, bytes) in
            [("o.png", png), ("o.jpg", jpeg), ("o.tif", with_tag(tiff.into_inner(), orientation))]
        {
            let folder = TempDir::new_in(dir.path()).unwrap();
            let path = folder.path().join(name);
            fs::write(&path, bytes).unwrap();
            for path in [path.as_path(), folder.path()] {
                // JPEG is not scaled, which would blur: its blocks are looked at in their middles.
                let block = if name == "o.jpg" { 16 } else { 1 };
                options.camera = Geometry::new(3 * block, 2 * block).unwrap();
                let light = &read(path, &options).unwrap()[0];
                for (row, col) in (0..2).flat_map(|r| (0..3).map(move |c| (r, c))) {
                    let middle = |i: usize| i * block as usize + block as usize / 2;
                    let code = light.get(middle(row), middle(col)) * 255.0;
                    // JPEG may round by a code.
                    let wanted = (40 * (3 * row + col) + 20) as f32;
                    assert!((code - wanted).abs() < 1.5, "{orientation} {name} {row} {col}: {code}");
                }
            }
        }
    }
}

/// `tiff` (little-endian, one directory at the end of a list of tags) with the tag of orientation in its place.
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
    // A new directory behind everything, so that no offset moves.
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
    put(&dir, "a1.png", grey(4, 4, 1));
    put(&dir, "a2.exr", ImageBuffer::from_pixel(4, 4, Rgb([0.5_f32; 3])));
    let error = open(dir.path(), &camera(4, 4)).err().unwrap();
    let text = error.to_string();
    assert!(error.kind() == Kind::Input && text.contains("a2.exr") && text.contains("a1.png"), "{text}");
}

fn with_front_end(table: &str, w: u32, h: u32) -> InputOptions {
    let mut camera = spikelane::presets::parse(&format!("[light]\n{table}"), None).unwrap();
    camera.sensor.geometry = Geometry::new(w, h).unwrap();
    InputOptions::of(&camera)
}

#[test]
fn a_cameras_front_end_holds_until_a_transfer_function_is_declared() {
    let dir = TempDir::new().unwrap();
    let path = put(&dir, "f.png", grey(2, 1, 128));
    let mut options = with_front_end("transfer = \"linear\"", 2, 1);
    assert_eq!(read(&path, &options).unwrap()[0].samples(), &OwnedSamples::U8(vec![128; 2]));
    options.transfer = Some(Transfer::Srgb);
    assert_eq!(read(&path, &options).unwrap()[0].samples(), &OwnedSamples::U16(vec![14146; 2]));
    assert_eq!(open(&path, &options).unwrap().front_end().transfer, Some(Transfer::Srgb));
}

#[test]
fn grey_codes_are_rounded_before_the_curve() {
    let dir = TempDir::new().unwrap();
    let path = put(&dir, "c.png", RgbImage::from_pixel(1, 1, Rgb([10, 20, 200])));
    let light = |table: &str| read(&path, &with_front_end(table, 1, 1)).unwrap()[0].get(0, 0) * 255.0;
    let weights = "transfer = \"linear\"\nluminance = [0.25, 0.5, 0.25]";
    // 2.5 + 10 + 50 = 62.5, which rounds up. A 16-bit sample is 0.004 codes.
    assert!((light(&format!("{weights}\ngrey_codes = true")) - 63.0).abs() < 0.01);
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
    // The code is full scale behind the curve too.
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
