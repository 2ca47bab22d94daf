//! The images that both simulators read.

use std::path::{Path, PathBuf};

use image::{DynamicImage, ImageReader};
use spikelane::light::Frame;
use spikelane::{Camera, Error, ErrorKind, Geometry, Result, presets};
use spikelane_io::light::{InputOptions, ResizeMode, Transfer, image_file, image_files, open};

use super::{Args, Peer};

/// Largest size that scsim simulates by default. Its code simulates about 30,000 pixel-readouts per
/// second.
const SCSIM_SIZE: (usize, usize) = (64, 48);

/// A folder with one 8-bit PNG per readout, or with a single PNG for all readouts.
pub(super) struct FrameFolder {
    pub folder: PathBuf,
    pub geometry: Geometry,
    pub readouts: usize,
    is_still: bool,
}

/// Writes the images of the input to the folder `frames` in `folder`.
pub(super) fn write(args: &Args, folder: &Path) -> Result<FrameFolder> {
    let frames = folder.join("frames");
    std::fs::create_dir(&frames).map_err(|e| Error::io(frames.display(), e))?;
    let mut writer = Writer { args, folder: frames, count: 0, geometry: None };
    let readouts = usize::from(args.readouts);
    let input = &args.input;
    let is_image = image_file::is_image(input);
    if input.is_dir() {
        for path in image_files(input, false)?.iter().take(readouts) {
            writer.add(&read_image(path)?, path)?;
        }
    } else if is_image {
        writer.add(&read_image(input)?, input)?;
    } else {
        writer.add_source(input, readouts)?;
    }
    let is_still = is_image && !input.is_dir();
    let Some(geometry) = writer.geometry else {
        return Err(Error::new(ErrorKind::Input, input.display())
            .found("no image")
            .expected("an image, a folder of images or a video"));
    };
    if args.simulator == Peer::SpikecvImage && !is_still {
        return Err(Error::new(ErrorKind::Usage, input.display())
            .found("several images")
            .expected("one image, because img_to_spike of SpikeCV converts one image")
            .remedy("name an image, or compare with spikecv"));
    }
    if !is_still && writer.count < 20 {
        return Err(Error::new(ErrorKind::Input, input.display())
            .found(format_args!("{} images", writer.count))
            .expected("at least 20 images, one per readout, or a single image"));
    }
    let readouts = if is_still { readouts } else { writer.count };
    Ok(FrameFolder { folder: writer.folder, geometry, readouts, is_still })
}

fn read_image(path: &Path) -> Result<DynamicImage> {
    let wrong = |e: &dyn std::fmt::Display| {
        Error::new(ErrorKind::Input, path.display()).found(e).expected("an image of 8 bits per channel")
    };
    let reader = ImageReader::open(path).map_err(|e| Error::io(path.display(), e))?;
    let reader = reader.with_guessed_format().map_err(|e| Error::io(path.display(), e))?;
    let image = reader.decode().map_err(|e| wrong(&e))?;
    match image.color().bytes_per_pixel() / image.color().channel_count() {
        1 => Ok(image),
        bytes => Err(wrong(&format_args!("{} bits per channel", 8 * u32::from(bytes)))
            .remedy("the other simulators read 8-bit images; convert the image to 8 bits")),
    }
}

struct Writer<'a> {
    args: &'a Args,
    folder: PathBuf,
    count: usize,
    /// Size of the first image after the crop.
    geometry: Option<Geometry>,
}

impl Writer<'_> {
    /// Writes the center of an image.
    fn add(&mut self, image: &DynamicImage, path: &Path) -> Result<()> {
        let stored = Geometry::new(image.width(), image.height())?;
        let size = self.size(stored)?;
        if self.geometry.is_some_and(|first| first != size) || !fits(size, stored) {
            return Err(Error::new(ErrorKind::Input, path.display())
                .found(format_args!("an image of {stored} pixels"))
                .expected(format_args!("at least {size} pixels, and one size for all images")));
        }
        self.geometry = Some(size);
        let (width, height) = (size.width() as u32, size.height() as u32);
        let (left, top) = ((image.width() - width) / 2, (image.height() - height) / 2);
        let file = self.folder.join(format!("{:04}.png", self.count));
        let has_color = image.color().has_color();
        let image = image.crop_imm(left, top, width, height);
        // Both programs ignore the opacity.
        let image = if has_color { DynamicImage::from(image.to_rgb8()) } else { image.to_luma8().into() };
        image.save(&file).map_err(|e| Error::new(ErrorKind::Io, file.display()).found(e))?;
        self.count += 1;
        Ok(())
    }

    /// Writes the frames of a video or an array as gray images. The preset's front end computes the gray codes.
    fn add_source(&mut self, path: &Path, frames: usize) -> Result<()> {
        let camera = presets::builtin(self.args.simulator.preset())?;
        let options = |size| {
            InputOptions::from_camera(&camera)
                .with_camera(size)
                .with_transfer(Some(Transfer::Linear))
                .with_resize_mode(ResizeMode::Cover)
                .with_is_video(true)
                .with_scale(self.args.full_scale)
                .with_accept_damage(self.args.accept_damage)
        };
        let stored = open(path, &options(Geometry::new(8, 8)?))?.stored_geometry().ok_or_else(|| {
            Error::new(ErrorKind::Usage, path.display())
                .found("light without a size")
                .expected("an image, a folder of images, a video or an array")
        })?;
        let mut source = open(path, &options(stored))?;
        let mut frame = Frame::dark(stored);
        while self.count < frames && source.next_frame(&mut frame)? {
            let codes = frame.to_f32().iter().map(|light| (255.0 * light).round().min(255.0) as u8).collect();
            let image = image::GrayImage::from_raw(stored.width() as u32, stored.height() as u32, codes);
            self.add(&image.unwrap_or_default().into(), path)?;
        }
        Ok(())
    }

    /// Returns the size after the crop.
    fn size(&self, stored: Geometry) -> Result<Geometry> {
        match self.args.crop {
            Some(size) => Ok(size),
            None if self.args.simulator == Peer::Scsim => {
                let (width, height) = SCSIM_SIZE;
                Geometry::new(width.min(stored.width()) as u32, height.min(stored.height()) as u32)
            }
            None => Ok(stored),
        }
    }
}

fn fits(size: Geometry, stored: Geometry) -> bool {
    size.width() <= stored.width() && size.height() <= stored.height()
}

impl FrameFolder {
    /// Calls `use_frame` with each frame of the light of `camera`, and with the number of readouts that have this light.
    pub(super) fn for_each(
        &self,
        camera: &Camera,
        mut use_frame: impl FnMut(&Frame, usize) -> Result<()>,
    ) -> Result<()> {
        let options = InputOptions::from_camera(camera);
        let still = self.folder.join("0000.png");
        let mut source = open(if self.is_still { &still } else { &self.folder }, &options)?;
        let mut frame = Frame::dark(self.geometry);
        let frames = if self.is_still { 1 } else { self.readouts };
        for _ in 0..frames {
            if !source.next_frame(&mut frame)? {
                return Err(Error::new(ErrorKind::Io, self.folder.display())
                    .found("a missing image")
                    .expected(format_args!("{frames} images that this command wrote")));
            }
            use_frame(&frame, self.readouts / frames)?;
        }
        Ok(())
    }

    /// Returns the sum of the charges that the light adds to the pixels of `camera` at each readout, in thresholds.
    pub(super) fn charges(&self, camera: &Camera) -> Result<Vec<f64>> {
        let full = camera.sensor.thresholds_at_full_scale;
        let mut all = Vec::with_capacity(self.readouts);
        self.for_each(camera, |frame, readouts| {
            let light: f64 = frame.to_f32().iter().map(|light| f64::from(*light)).sum();
            all.extend(std::iter::repeat_n(full * light, readouts));
            Ok(())
        })?;
        Ok(all)
    }

    /// Returns whether SpikeCV's converter of images has a tie in each pixel of the first image.
    ///
    /// The converter adds `(r + g + b) / 1530` thresholds per readout, and a spike empties the pixel. A whole number of
    /// additions is one threshold if the sum of the codes divides 1530.
    pub(super) fn spikecv_image_ties(&self) -> Result<Vec<bool>> {
        let image = read_image(&self.folder.join("0000.png"))?.to_rgb8();
        let sum = |pixel: &image::Rgb<u8>| pixel.0.iter().map(|code| u32::from(*code)).sum::<u32>();
        Ok(image.pixels().map(|pixel| sum(pixel) > 0 && 1530 % sum(pixel) == 0).collect())
    }

    /// Returns the mean light of each pixel over all readouts.
    pub(super) fn mean_light(&self, camera: &Camera) -> Result<Vec<f64>> {
        let mut sum = vec![0.0; self.geometry.pixels()];
        self.for_each(camera, |frame, readouts| {
            let share = readouts as f64 / self.readouts as f64;
            sum.iter_mut().zip(frame.to_f32()).for_each(|(sum, light)| *sum += share * f64::from(light));
            Ok(())
        })?;
        Ok(sum)
    }
}
