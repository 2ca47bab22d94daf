//! Pictures for people: rates as grey levels, and the contact sheet of a run.

use std::io::Cursor;

use image::{GrayImage, ImageFormat, Luma, imageops};
use spikelane::reconstruct::{tfi_at, tfp};
use spikelane::spikes::{Packed, bit};
use spikelane::unstable::inputs;
use spikelane::unstable::light::srgb_byte;
use spikelane::{Error, Geometry, Kind, Result};
use spikelane_io::formats::Reader;
use spikelane_io::simulate::Glance;

/// Readouts on either side in the sheet's TFP pictures: 8 ms at 20 kHz, in which a bar of the
/// chart moves a quarter of its width.
const HALF_WINDOW: usize = 80;

/// Readouts that TFI searches on either side.
const SEARCH: usize = 200;

/// Pixels between the panels, and of the strip that names them.
const GAP: u32 = 6;
const STRIP: u32 = 14;

/// Grey of the sheet's ground and of its letters.
const GROUND: u8 = 24;
const LETTERS: u8 = 220;

/// Linear values as 8-bit sRGB, `white` and above being white.
pub(crate) fn grey(values: &[f32], white: f32, geometry: Geometry) -> GrayImage {
    let level = |v: f32| srgb_byte(v / white);
    from_levels(values.iter().map(|&v| level(v)), geometry)
}

fn from_levels(levels: impl Iterator<Item = u8>, geometry: Geometry) -> GrayImage {
    let mut image = GrayImage::new(geometry.width() as u32, geometry.height() as u32);
    image.iter_mut().zip(levels).for_each(|(pixel, level)| *pixel = level);
    image
}

/// The value that only one pixel in 500 exceeds: a white that one hot pixel cannot move.
pub(crate) fn bright(values: &[f32]) -> f32 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f32::total_cmp);
    let value = sorted.get(sorted.len() - 1 - sorted.len() / 500).copied().unwrap_or(0.0);
    if value > 0.0 { value } else { 1.0 }
}

pub(crate) fn png(image: &GrayImage) -> Result<Vec<u8>> {
    let mut bytes = Cursor::new(Vec::new());
    image.write_to(&mut bytes, ImageFormat::Png).map_err(|e| Error::new(Kind::Io, "PNG").found(e))?;
    Ok(bytes.into_inner())
}

/// One readout in each step of so many, in its middle.
pub(crate) fn moments(readouts: usize, step: usize) -> Vec<usize> {
    let first = (step / 2).min(readouts / 2);
    (first..readouts).step_by(step).collect()
}

/// Packed frames around a readout, and the place of that readout among them.
pub(crate) fn around(reader: &Reader, at: usize, half: usize) -> Result<(Vec<u8>, usize)> {
    let first = at.saturating_sub(half);
    let end = at.saturating_add(half).saturating_add(1).min(reader.readouts());
    if at >= reader.readouts() {
        return Err(Error::new(Kind::Usage, format_args!("readout {at}")).expected(format_args!(
            "less than {}, the length of {}",
            reader.readouts(),
            reader.name()
        )));
    }
    let mut packed = inputs::zeroed(reader.name(), (end - first) * reader.geometry().frame_bytes())?;
    reader.read_frames(first, &mut packed)?;
    Ok((packed, at - first))
}

fn window(reader: &Reader, at: usize) -> Result<Vec<f32>> {
    let (bytes, centre) = around(reader, at, HALF_WINDOW)?;
    tfp(Packed::new(reader.geometry(), &bytes)?, centre, HALF_WINDOW)
}

/// The spikes of one readout, white.
pub(crate) fn spikes_picture(reader: &Reader, at: usize) -> Result<GrayImage> {
    let geometry = reader.geometry();
    let (spikes, centre) = around(reader, at, 0)?;
    let frame = &spikes[centre * geometry.frame_bytes()..];
    Ok(from_levels((0..geometry.pixels()).map(|p| 255 * u8::from(bit(frame, p))), geometry))
}

/// Panels: the light, one readout of spikes, TFP of the noisy stream, and TFP of the clean one; where there is none,
/// TFI of the noisy one, unless the stream is too short for it. `full` is the rate of full-scale light. White
/// is what one pixel in 500 of the light exceeds, the same for all, so that dark scenes show too.
pub(crate) fn sheet(glance: &Glance, noisy: &Reader, clean: Option<&Reader>, full: f32) -> Result<Vec<u8>> {
    let geometry = noisy.geometry();
    let at = (glance.readout as usize).min(noisy.readouts() - 1);
    let light = glance.frame.to_f32();
    let brightest = bright(&light).min(1.0);
    let white = full * brightest;
    let mut panels = vec![
        ("LIGHT", grey(&light, brightest, geometry)),
        ("SPIKES", spikes_picture(noisy, at)?),
        ("TFP NOISY", grey(&window(noisy, at)?, white, geometry)),
    ];
    if let Some(clean) = clean {
        panels.push(("TFP CLEAN", grey(&window(clean, at)?, white, geometry)));
    } else {
        let (bytes, centre) = around(noisy, at, SEARCH)?;
        let tfi = tfi_at(Packed::new(geometry, &bytes)?, centre, SEARCH)?;
        if tfi.is_measurable() {
            panels.push(("TFI NOISY", grey(&tfi.rates, white, geometry)));
        }
    }
    png(&arrange(&panels, geometry))
}

fn arrange(panels: &[(&str, GrayImage)], geometry: Geometry) -> GrayImage {
    let (w, h) = (geometry.width() as u32 + GAP, geometry.height() as u32 + STRIP + GAP);
    let mut sheet = GrayImage::from_pixel(2 * w + GAP, 2 * h, Luma([GROUND]));
    for (i, (name, panel)) in (0..).zip(panels) {
        let (x, y) = (GAP + i % 2 * w, i / 2 * h + STRIP);
        imageops::replace(&mut sheet, panel, x.into(), y.into());
        write(&mut sheet, name, x, y + 4 - STRIP);
    }
    sheet
}

/// Five columns of seven pixels, the top one in the lowest bit. A font crate for ten letters
/// would outweigh the rest of the picture.
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

fn write(image: &mut GrayImage, text: &str, x: u32, y: u32) {
    for (i, letter) in (0..).zip(text.chars()) {
        let Some((_, columns)) = FONT.iter().find(|(c, _)| *c == letter) else { continue };
        for (col, bits) in (0..).zip(columns) {
            for row in (0..7).filter(|row| bits >> row & 1 != 0) {
                let (x, y) = (x + 6 * i + col, y + row);
                if x < image.width() && y < image.height() {
                    image.put_pixel(x, y, Luma([LETTERS]));
                }
            }
        }
    }
}
