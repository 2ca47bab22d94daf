//! Pictures for people: rates as gray levels, and the contact sheet of a simulation.

use std::io::Cursor;

use image::{
    DynamicImage, EncodableLayout, GrayImage, ImageBuffer, ImageFormat, Luma, Pixel, PixelWithColorType, Rgb,
    RgbImage, imageops,
};
use spikelane::light::srgb_code;
use spikelane::reconstruct::{ColorMatrix, Demosaic, demosaic, tfp};
use spikelane::sensor::Mosaic;
use spikelane::spikes::bit;
use spikelane::unstable::light::srgb_byte;
use spikelane::{Error, ErrorKind, Geometry, Result};
use spikelane_io::formats::StreamReader;
use spikelane_io::light::exr_image;
use spikelane_io::simulate::LightSample;

/// Number of readouts before and after the center of the TFP window on the contact sheet. At 20 kHz the window lasts 8
/// ms. In this time a bar of the chart moves a quarter of its width.
const HALF_WINDOW_READOUTS: usize = 80;

/// Number of readouts before and after the center in which TFI searches spikes.
const SEARCH_READOUTS: usize = 200;

/// Distance between the panels, and height of the strip that contains the name of a panel.
const PANEL_GAP_PX: u32 = 6;
const LABEL_STRIP_PX: u32 = 14;

/// Gray levels of the background and of the text.
const BACKGROUND_LEVEL: u8 = 24;
const TEXT_LEVEL: u8 = 220;

/// Converts linear values to 8-bit sRGB. Values of at least `white` become white.
pub(crate) fn gray_image(values: &[f32], white: f32, geometry: Geometry) -> GrayImage {
    let level = |v: f32| srgb_byte(v / white);
    image_from_levels(values.iter().map(|&v| level(v)), geometry)
}

/// File format of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PictureFormat {
    /// 8-bit PNG in sRGB. Values of at least `white` are the largest code.
    Png8,
    /// 16-bit PNG in sRGB. Values of at least `white` are the largest code.
    Png16,
    /// OpenEXR of 32-bit floats. The values are divided by `white` and not clipped.
    Exr,
}

impl PictureFormat {
    /// Encodes linear values: a gray picture of one value per pixel, or a color picture of red, green and blue of each
    /// pixel.
    pub(crate) fn encode(self, values: &[f32], white: f32, geometry: Geometry) -> Result<Vec<u8>> {
        let is_color = values.len() == 3 * geometry.pixels();
        match (self, is_color) {
            (Self::Png8, true) => encode_png(&color_image(values, white, geometry)),
            (Self::Png8, false) => encode_png(&gray_image(values, white, geometry)),
            (Self::Png16, true) => encode_png(&deep_image::<Rgb<u16>>(values, white, geometry)),
            (Self::Png16, false) => encode_png(&deep_image::<Luma<u16>>(values, white, geometry)),
            (Self::Exr, _) => exr_image(&values.iter().map(|v| v / white).collect::<Vec<_>>(), geometry),
        }
    }
}

/// Returns the 8-bit sRGB codes of linear values: one code per pixel, or red, green and blue of each pixel. Values of at least
/// `white` are the largest code.
pub(crate) fn picture_levels(values: &[f32], white: f32, geometry: Geometry) -> Vec<u8> {
    if values.len() == 3 * geometry.pixels() {
        color_image(values, white, geometry).into_raw()
    } else {
        gray_image(values, white, geometry).into_raw()
    }
}

/// Converts linear red, green and blue of each pixel to 8-bit sRGB. Values of at least `white` are the largest code.
fn color_image(values: &[f32], white: f32, geometry: Geometry) -> RgbImage {
    let mut image = RgbImage::new(geometry.width() as u32, geometry.height() as u32);
    image.iter_mut().zip(values).for_each(|(code, v)| *code = srgb_byte(v / white));
    image
}

/// Converts linear values to 16-bit sRGB. Values of at least `white` are the largest code.
fn deep_image<P: Pixel<Subpixel = u16>>(
    values: &[f32],
    white: f32,
    geometry: Geometry,
) -> ImageBuffer<P, Vec<u16>> {
    let mut image = ImageBuffer::new(geometry.width() as u32, geometry.height() as u32);
    let code = |v: &f32| (srgb_code(v / white) * 65535.0 + 0.5) as u16;
    image.iter_mut().zip(values).for_each(|(sample, v)| *sample = code(v));
    image
}

fn image_from_levels(levels: impl Iterator<Item = u8>, geometry: Geometry) -> GrayImage {
    let mut image = GrayImage::new(geometry.width() as u32, geometry.height() as u32);
    image.iter_mut().zip(levels).for_each(|(pixel, level)| *pixel = level);
    image
}

/// Returns the value that one pixel in 500 exceeds. If it is used as the white level, a few hot pixels do not matter.
pub(crate) fn white_rate(values: &[f32]) -> f32 {
    let mut values = values.to_vec();
    let place = values.len() - 1 - values.len() / 500;
    let value = *values.select_nth_unstable_by(place, f32::total_cmp).1;
    if value > 0.0 { value } else { 1.0 }
}

pub(crate) fn encode_png<P>(image: &ImageBuffer<P, Vec<P::Subpixel>>) -> Result<Vec<u8>>
where
    P: PixelWithColorType,
    [P::Subpixel]: EncodableLayout,
{
    let mut bytes = Cursor::new(Vec::new());
    image.write_to(&mut bytes, ImageFormat::Png).map_err(|e| Error::new(ErrorKind::Io, "PNG").found(e))?;
    Ok(bytes.into_inner())
}

/// Returns the middle readout of each interval of `step` readouts.
pub(crate) fn sample_readouts(readouts: usize, step: usize) -> Vec<usize> {
    let first = (step / 2).min(readouts / 2);
    (first..readouts).step_by(step).collect()
}

fn window_rates(reader: &StreamReader, at: usize) -> Result<Vec<f32>> {
    let (frames, center) = reader.read_around(at, HALF_WINDOW_READOUTS)?;
    tfp(frames.view(), center, HALF_WINDOW_READOUTS)
}

/// Returns an image of one readout. Spikes are white.
pub(crate) fn spikes_picture(reader: &StreamReader, at: usize) -> Result<GrayImage> {
    let geometry = reader.geometry();
    let (frames, _) = reader.read_around(at, 0)?;
    let level = |p| 255 * u8::from(bit(frames.as_bytes(), p));
    Ok(image_from_levels((0..geometry.pixels()).map(level), geometry))
}

/// Returns a PNG of up to four panels: the light, one readout of spikes, TFP of the noisy stream, and TFP of the clean
/// stream.
///
/// Without a clean stream, the last panel is TFI of the noisy stream. This panel is omitted if the stream is too short.
/// `full` is the rate of full-scale light. All panels have the same white level. One pixel in 500 of the light exceeds
/// the white level, so dark scenes are visible too.
pub(crate) fn contact_sheet(
    glance: &LightSample,
    noisy: &StreamReader,
    clean: Option<&StreamReader>,
    full: f32,
    mosaic: Option<&Mosaic>,
) -> Result<Vec<u8>> {
    let geometry = noisy.geometry();
    let at = (glance.readout as usize).min(noisy.readouts() - 1);
    let light = glance.frame.image_values();
    // A picture of rates in color, if the camera has a color matrix.
    let matrix = mosaic.and_then(|mosaic| Some((mosaic, ColorMatrix::from_response(mosaic).ok()?)));
    let colored = |rates: Vec<f32>| match &matrix {
        Some((mosaic, matrix)) => demosaic(&rates, geometry, mosaic, Demosaic::Bilinear)
            .map_or(rates, |colors| matrix.apply(&colors)),
        None => rates,
    };
    let panel = |values: &[f32], white: f32| match values.len() == 3 * geometry.pixels() {
        true => color_image(values, white, geometry),
        false => DynamicImage::from(gray_image(values, white, geometry)).into_rgb8(),
    };
    let brightest = white_rate(&light).min(1.0);
    let white = full * brightest;
    let mut panels = vec![
        ("LIGHT", panel(&light, brightest)),
        ("SPIKES", DynamicImage::from(spikes_picture(noisy, at)?).into_rgb8()),
        ("TFP NOISY", panel(&colored(window_rates(noisy, at)?), white)),
    ];
    if let Some(clean) = clean {
        panels.push(("TFP CLEAN", panel(&colored(window_rates(clean, at)?), white)));
    } else {
        let tfi = noisy.tfi(at, SEARCH_READOUTS)?;
        if tfi.is_measurable() {
            panels.push(("TFI NOISY", panel(&colored(tfi.rates), white)));
        }
    }
    let sheet = arrange_panels(&panels, geometry);
    // The sheet of a gray camera is a gray image.
    if matrix.is_some() {
        return encode_png(&sheet);
    }
    let levels = sheet.pixels().map(|p| p.0[0]).collect();
    let gray = GrayImage::from_raw(sheet.width(), sheet.height(), levels);
    encode_png(&gray.expect("one level per pixel"))
}

fn arrange_panels(panels: &[(&str, RgbImage)], geometry: Geometry) -> RgbImage {
    let (w, h) =
        (geometry.width() as u32 + PANEL_GAP_PX, geometry.height() as u32 + LABEL_STRIP_PX + PANEL_GAP_PX);
    let mut sheet = RgbImage::from_pixel(2 * w + PANEL_GAP_PX, 2 * h, Rgb([BACKGROUND_LEVEL; 3]));
    for (i, (name, panel)) in (0..).zip(panels) {
        let (x, y) = (PANEL_GAP_PX + i % 2 * w, i / 2 * h + LABEL_STRIP_PX);
        imageops::replace(&mut sheet, panel, x.into(), y.into());
        draw_text(&mut sheet, name, x, y + 4 - LABEL_STRIP_PX);
    }
    sheet
}

/// Letters of five columns and seven rows. The lowest bit of a column is the top pixel. The program needs only these
/// letters, so a font crate would be disproportionate.
const FONT: [(char, [u8; 5]); 16] = [
    ('A', [0x7e, 0x09, 0x09, 0x09, 0x7e]),
    ('C', [0x3e, 0x41, 0x41, 0x41, 0x22]),
    ('E', [0x7f, 0x49, 0x49, 0x49, 0x41]),
    ('F', [0x7f, 0x09, 0x09, 0x09, 0x01]),
    ('G', [0x3e, 0x41, 0x49, 0x49, 0x7a]),
    ('H', [0x7f, 0x08, 0x08, 0x08, 0x7f]),
    ('I', [0x00, 0x41, 0x7f, 0x41, 0x00]),
    ('K', [0x7f, 0x08, 0x14, 0x22, 0x41]),
    ('L', [0x7f, 0x40, 0x40, 0x40, 0x40]),
    ('N', [0x7f, 0x02, 0x0c, 0x10, 0x7f]),
    ('O', [0x3e, 0x41, 0x41, 0x41, 0x3e]),
    ('P', [0x7f, 0x09, 0x09, 0x09, 0x06]),
    ('S', [0x26, 0x49, 0x49, 0x49, 0x32]),
    ('T', [0x01, 0x01, 0x7f, 0x01, 0x01]),
    ('Y', [0x07, 0x08, 0x70, 0x08, 0x07]),
    (' ', [0; 5]),
];

fn draw_text(image: &mut RgbImage, text: &str, x: u32, y: u32) {
    for (i, letter) in (0..).zip(text.chars()) {
        let Some((_, columns)) = FONT.iter().find(|(c, _)| *c == letter) else { continue };
        for (col, bits) in (0..).zip(columns) {
            for row in (0..7).filter(|row| bits >> row & 1 != 0) {
                let (x, y) = (x + 6 * i + col, y + row);
                if x < image.width() && y < image.height() {
                    image.put_pixel(x, y, Rgb([TEXT_LEVEL; 3]));
                }
            }
        }
    }
}
