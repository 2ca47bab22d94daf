//! The channels of an OpenEXR file that contain its picture.

use std::io::{BufRead, Seek};
use std::path::Path;

use exr::block;
use exr::meta::header::Header;
use exr::prelude::*;
use image::{DynamicImage, ImageBuffer};
use spikelane::error::{Error, ErrorKind, Result};
use spikelane::spikes::Geometry;
use spikelane::unstable::Count;
use spikelane::unstable::inputs::{self, MAX_PICTURE_BYTES};
use spikelane::unstable::light::declared_geometry;

use super::linearization::Pixels;

/// Maximum number of channels that an error lists.
const MAX_LISTED_CHANNELS: usize = 12;

/// The value of samples that no chunk of the file contains. It is not a number, which no light is.
const MISSING_SAMPLE: u32 = 0x7FC0_5A5A;

/// The picture of a file: red, green and blue, or the luminance.
#[derive(Clone, Debug)]
pub(super) struct ExrPicture {
    /// Three names of colors, or one name of the luminance.
    channels: Vec<Text>,
    /// The size of the display window.
    pub size: Geometry,
    /// The width of a pixel divided by its height.
    pub pixel_aspect: f64,
    /// Names of other pictures in the file.
    pub ignored_layers: Vec<String>,
}

/// A layer with a picture.
struct Candidate<'a> {
    header: &'a Header,
    layer: String,
    channels: Vec<Text>,
}

/// Returns the picture of a file.
///
/// A picture has the channels `R`, `G` and `B`, or `Y` (OpenEXR's name of the luminance). In a file with layers, the
/// names of the channels start with the name of the layer. Of several layers, the function selects the layer without a
/// name, or else the layer `Combined`, which is the picture in files of Blender.
///
/// # Errors
/// [`ErrorKind::Input`] if the file is damaged, or has no such picture or several.
pub(super) fn read_header(file: impl BufRead + Seek, path: &Path) -> Result<ExrPicture> {
    let reader = block::read(file, false).map_err(|e| damaged_error(path, &e))?;
    let candidates: Vec<Candidate<'_>> = reader.headers().iter().flat_map(candidates).collect();
    let is_plain = |c: &Candidate<'_>| c.layer.is_empty();
    let is_combined = |c: &Candidate<'_>| c.layer == "Combined" || c.layer.ends_with(".Combined");
    let combined = candidates.iter().filter(|c| is_combined(c)).count() == 1;
    let selected = candidates
        .iter()
        .position(is_plain)
        .or_else(|| candidates.iter().position(is_combined).filter(|_| combined))
        .or((candidates.len() == 1).then_some(0))
        .ok_or_else(|| no_picture_error(path, reader.headers(), &candidates))?;
    let others = candidates.iter().enumerate().filter(|(i, _)| *i != selected);
    let ignored_layers = others.map(|(_, c)| c.display_name()).collect();
    let chosen = &candidates[selected];
    let window = chosen.header.shared_attributes.display_window.size;
    let size = declared_geometry(window.width() as u64, window.height() as u64, &path.display().to_string())?;
    let pixel_aspect = f64::from(chosen.header.shared_attributes.pixel_aspect);
    Ok(ExrPicture { channels: chosen.channels.clone(), size, pixel_aspect, ignored_layers })
}

impl Candidate<'_> {
    fn display_name(&self) -> String {
        let part = self.header.own_attributes.layer_name.as_ref().map(ToString::to_string);
        if self.layer.is_empty() {
            part.unwrap_or_else(|| "without a name".to_owned())
        } else {
            self.layer.clone()
        }
    }
}

/// Returns the pictures of a part of the file.
fn candidates(header: &Header) -> Vec<Candidate<'_>> {
    let names: Vec<String> = header.channels.list.iter().map(|c| c.name.to_string()).collect();
    let split = |name: &str| {
        name.rsplit_once('.').map_or((String::new(), name.to_owned()), |(l, c)| (l.to_owned(), c.to_owned()))
    };
    let mut layers: Vec<String> = names.iter().map(|n| split(n).0).collect();
    layers.sort_unstable();
    layers.dedup();
    let channel = |layer: &str, base: &str| {
        let wanted = (layer.to_owned(), base.to_owned());
        let at = names.iter().position(|n| split(n) == wanted)?;
        Some(header.channels.list[at].name.clone())
    };
    layers
        .into_iter()
        .filter(|_| !header.deep)
        .filter_map(|layer| {
            let colors: Option<Vec<Text>> =
                ["R", "G", "B"].iter().map(|base| channel(&layer, base)).collect();
            let channels = colors.or_else(|| Some(vec![channel(&layer, "Y")?]))?;
            Some(Candidate { header, layer, channels })
        })
        .collect()
}

fn no_picture_error(path: &Path, headers: &[Header], candidates: &[Candidate<'_>]) -> Error {
    let names = headers.iter().flat_map(|h| h.channels.list.iter().map(|c| c.name.to_string()));
    let mut names: Vec<String> = names.take(MAX_LISTED_CHANNELS + 1).collect();
    if names.len() > MAX_LISTED_CHANNELS {
        names[MAX_LISTED_CHANNELS] = "...".to_owned();
    }
    let layers: Vec<String> = candidates.iter().map(Candidate::display_name).collect();
    let deep = if headers.iter().any(|h| h.deep) { " (deep data)" } else { "" };
    let found = if layers.is_empty() {
        format!("the channels {}{deep}", names.join(", "))
    } else {
        format!("several pictures: {}", layers.join(", "))
    };
    Error::new(ErrorKind::Input, path.display())
        .found(found)
        .expected("one picture with the channels R, G and B, or Y, without deep data")
        .remedy("save the layer of the picture as a file of its own")
}

fn damaged_error(path: &Path, error: &exr::error::Error) -> Error {
    match error {
        exr::error::Error::Io(e) if e.kind() != std::io::ErrorKind::UnexpectedEof => {
            Error::new(ErrorKind::Io, path.display()).found(e)
        }
        other => Error::new(ErrorKind::Input, path.display())
            .found(other)
            .expected("a complete OpenEXR image of full resolution")
            .remedy("save the image without deep data, subsampled channels and DWA compression"),
    }
}

/// Reads the samples of a picture. Pixels outside the data window are dark, and pixels outside the display window are
/// not read.
///
/// # Errors
/// [`ErrorKind::Input`] if the file is damaged or a picture is too large.
pub(super) fn read(file: impl BufRead + Seek, path: &Path, picture: &ExrPicture) -> Result<Pixels> {
    let (size, count) = (picture.size, picture.channels.len());
    let bytes = size.pixels() as u64 * 4 * count as u64;
    if bytes > MAX_PICTURE_BYTES {
        return Err(Error::new(ErrorKind::Input, path.display())
            .found(format_args!("{} of samples", Count(bytes, "byte")))
            .expected(format_args!("at most {MAX_PICTURE_BYTES} bytes")));
    }
    inputs::check_memory(path.display(), 2 * bytes as usize)?;
    let reader = block::read(file, false).map_err(|e| damaged_error(path, &e))?;
    let has_channels = |h: &&Header| {
        !h.deep && picture.channels.iter().all(|name| h.channels.list.iter().any(|c| c.name == *name))
    };
    let (offset, stored_size) =
        reader.headers().iter().find(has_channels).map_or_else(Default::default, |h| {
            let offset = h.own_attributes.layer_position - h.shared_attributes.display_window.position;
            (offset, h.layer_size)
        });
    let (width, height) = (size.width(), size.height());
    let stored_range = |start: i32, len: usize, limit: usize| {
        let end = i64::from(start) + len as i64;
        i64::from(start).clamp(0, limit as i64) as usize..end.clamp(0, limit as i64) as usize
    };
    let rows = stored_range(offset.y(), stored_size.y(), height);
    let columns = stored_range(offset.x(), stored_size.x(), width);
    let index = move |at: Vec2<usize>| {
        let at = at.to_i32() + offset;
        let (x, y) = (usize::try_from(at.x()).ok()?, usize::try_from(at.y()).ok()?);
        (x < width && y < height).then_some(y * width + x)
    };
    let samples = move |_: Vec2<usize>| {
        let mut samples = vec![0_f32; width * height * count];
        for row in rows.clone() {
            let start = row * width;
            samples[(start + columns.start) * count..(start + columns.end) * count]
                .fill(f32::from_bits(MISSING_SAMPLE));
        }
        samples
    };
    let selection = exr::prelude::read().no_deep_data().largest_resolution_level().specific_channels();
    let values = match &picture.channels[..] {
        [red, green, blue] => selection
            .required(red.clone())
            .required(green.clone())
            .required(blue.clone())
            .collect_pixels(
                move |size, _| samples(size),
                move |all: &mut Vec<f32>, at, (r, g, b): (f32, f32, f32)| {
                    if let Some(p) = index(at) {
                        all[3 * p..3 * p + 3].copy_from_slice(&[r, g, b]);
                    }
                },
            )
            .first_valid_layer()
            .all_attributes()
            .from_chunks(reader)
            .map(|image| image.layer_data.channel_data.pixels),
        gray => selection
            .required(gray[0].clone())
            .collect_pixels(
                move |size, _| samples(size),
                move |all: &mut Vec<f32>, at, (y,): (f32,)| {
                    if let Some(p) = index(at) {
                        all[p] = y;
                    }
                },
            )
            .first_valid_layer()
            .all_attributes()
            .from_chunks(reader)
            .map(|image| image.layer_data.channel_data.pixels),
    }
    .map_err(|e| damaged_error(path, &e))?;
    let missing = values.chunks(count).filter(|pixel| pixel[0].to_bits() == MISSING_SAMPLE).count();
    if missing > 0 {
        return Err(Error::new(ErrorKind::Input, path.display())
            .found(format_args!("{} without samples", Count(missing, "pixel")))
            .expected("a complete OpenEXR image")
            .remedy("render or copy the image again"));
    }
    Ok(if count == 1 {
        Pixels::GrayFloats { size, values }
    } else {
        let image =
            ImageBuffer::from_raw(width as u32, height as u32, values).expect("a color has three samples");
        Pixels::Image(DynamicImage::ImageRgb32F(image))
    })
}
