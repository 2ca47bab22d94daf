//! Opens any supported light input.

use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use super::mosaic_source::MosaicSource;
use super::resize_mode::ResizeMode;
use super::scaled_source::scale_source;
use super::video_folder::check_is_video;
use crate::Stdin;
use crate::light::camera_motion::CameraMotion;
use crate::light::images::folder::ImageFolder;
use crate::light::images::image_file::{self, ImageFile};
use crate::light::images::image_pages::ImagePages;
use crate::light::images::linearization::Linearization;
use crate::light::images::still_image::StillImage;
use crate::light::npy;
use crate::light::npy::ArraySource;
use crate::light::npz;
use crate::light::video::ffmpeg::FfmpegSource;
use crate::light::video::y4m;
use crate::light::video::y4m::Y4mSource;
use spikelane::effects::Camera;
use spikelane::error::{Error, ErrorKind, Result, Setting};
use spikelane::light::Rate;
use spikelane::light::Source;
use spikelane::light::Transfer;
use spikelane::sensor::{FrontEnd, Mosaic};
use spikelane::spikes::Geometry;
use spikelane::unstable::inputs::Access;

/// Extensions of files that ffmpeg decodes.
const VIDEO_EXTENSIONS: [&str; 16] = [
    "mp4", "mkv", "mov", "avi", "webm", "m4v", "mpg", "mpeg", "ts", "mts", "wmv", "flv", "ogv", "3gp", "gif",
    "mxf",
];

const SUPPORTED_INPUTS: &str = "a folder of images, a PNG, JPEG, TIFF, EXR, HDR, PFM, BMP, PNM, WEBP or FITS image, .npy, .npz, .y4m, a video with an extension that ffmpeg reads, or - for y4m or npy on standard input";

/// Options for reading a light input.
///
/// # Examples
/// ```
/// use spikelane::{Camera, Geometry, Sensor};
/// use spikelane_io::light::{InputOptions, ResizeMode, Transfer};
/// let camera = Camera::ideal(Sensor::new(400, 250, 20_000.0)?);
/// let options = InputOptions::from_camera(&camera)
///     .with_resize_mode(ResizeMode::Stretch)
///     .with_transfer(Some(Transfer::Gamma(2.2)));
/// assert_eq!(options.camera, Geometry::new(400, 250)?);
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct InputOptions {
    /// The camera's size. Every frame is converted to this size.
    pub camera: Geometry,
    /// How frames are resized or cropped.
    pub resize_mode: ResizeMode,
    /// How the camera's front end converts codes to light.
    pub front_end: FrontEnd,
    /// The color filters of the camera's pixels. If `mosaic` is `None`, color becomes luminance.
    pub mosaic: Option<Mosaic>,
    /// The declared transfer function. It overrides the transfer function of the front end and also applies to EXR.
    ///
    /// If `transfer` is `None`, the transfer function of the front end applies. If the front end has no transfer
    /// function either, the transfer function that the file states applies. If the file states none, images and videos are sRGB, and
    /// arrays and float images are linear.
    pub transfer: Option<Transfer>,
    /// A camera motion across a single image.
    pub motion_clip: Option<MotionClip>,
    /// The code or value that represents full scale. If `scale` is `None`, full scale is the code of white that the file
    /// states, the largest code, or 1.0 for floats.
    ///
    /// Codes of video are counted from 0 to the largest code of its depth, after a limited range has been expanded.
    pub scale: Option<f64>,
    /// Whether the images of a folder are the frames of a video, whatever their names and contents are. If false,
    /// [`check_is_video`] examines the folder.
    pub is_video: bool,
    /// Whether the part of a damaged image or video that can be decoded is used. Notes of the source then describe the
    /// damage. Otherwise, damage is an error.
    pub accept_damage: bool,
    /// Whether the images of a folder and the file with their times may be links to files outside the folder. Otherwise,
    /// such a link is an error.
    pub follow_links: bool,
    /// If this flag becomes true, waiting for standard input is interrupted. If `stop` is `None`, the wait cannot be
    /// interrupted.
    pub stop: Option<Arc<AtomicBool>>,
}

spikelane::unstable::with_methods!(InputOptions {
    with_camera: camera: Geometry,
    with_resize_mode: resize_mode: ResizeMode,
    with_front_end: front_end: FrontEnd,
    with_mosaic: mosaic: Option<Mosaic>,
    with_transfer: transfer: Option<Transfer>,
    with_motion_clip: motion_clip: Option<MotionClip>,
    with_scale: scale: Option<f64>,
    with_is_video: is_video: bool,
    with_accept_damage: accept_damage: bool,
    with_follow_links: follow_links: bool,
    with_stop: stop: Option<Arc<AtomicBool>>,
});

impl InputOptions {
    /// Creates default options for a camera of this size with the default front end.
    #[must_use]
    pub fn new(camera: Geometry) -> Self {
        let front_end = FrontEnd::default();
        Self {
            camera,
            resize_mode: ResizeMode::Cover,
            front_end,
            mosaic: None,
            transfer: None,
            motion_clip: None,
            scale: None,
            is_video: false,
            accept_damage: false,
            follow_links: false,
            stop: None,
        }
    }

    /// Creates default options with the geometry, the front end and the mosaic of `camera`.
    #[must_use]
    pub fn from_camera(camera: &Camera) -> Self {
        Self {
            front_end: camera.front_end,
            mosaic: camera.window_mosaic(),
            ..Self::new(camera.sensor.geometry)
        }
    }

    fn linearization(&self) -> Result<Linearization> {
        let linear = Linearization::from_front_end(&self.front_end, self.transfer);
        linear.with_color(self.mosaic.is_some()).with_full_scale(self.scale)
    }
}

/// A camera motion and its duration.
#[derive(Clone, Copy, Debug)]
pub struct MotionClip {
    /// The motion.
    pub motion: CameraMotion,
    /// Frame rate of the motion.
    pub rate: Rate,
    /// Number of frames, at least 1.
    pub frames: u64,
}

/// Opens a folder, a file, or standard input (`-`).
///
/// # Examples
/// ```
/// use spikelane_io::light::{Frame, InputOptions, open};
/// # let folder = tempfile::tempdir().map_err(|e| spikelane::Error::io("a folder", e))?;
/// let path = folder.path().join("white.pgm");
/// std::fs::write(&path, "P2 2 1 255 255 255").map_err(|e| spikelane::Error::io("white.pgm", e))?;
/// let mut source = open(&path, &InputOptions::new(spikelane::Geometry::new(4, 2)?))?;
/// let mut frame = Frame::dark(source.geometry());
/// source.next_frame(&mut frame)?;
/// // The image fills the camera. White has the light 1.
/// assert_eq!((frame.geometry().pixels(), frame.get(1, 3)), (8, 1.0));
/// # Ok::<(), spikelane::Error>(())
/// ```
///
/// # Errors
/// * [`ErrorKind::Io`] if the input cannot be opened.
/// * [`ErrorKind::Usage`] if the format of the input is unknown, or if a motion is requested and the input is not a
///   single image.
/// * Errors of the source that reads the format.
pub fn open(path: &Path, options: &InputOptions) -> Result<Box<dyn Source>> {
    if path.as_os_str() == "-" {
        let stdin = Stdin::new(options.stop.clone().unwrap_or_default());
        let stdin = stdin.map_err(|e| Error::io("standard input", e))?;
        return open_reader(Box::new(stdin), "standard input", options);
    }
    finish_source(open_path(path, options)?, options)
}

fn open_path(path: &Path, options: &InputOptions) -> Result<Box<dyn Source>> {
    let (camera, resize_mode, linear) = (options.camera, options.resize_mode, options.linearization()?);
    let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase());
    let about = std::fs::metadata(path).map_err(|e| Error::io(path.display(), e))?;
    if image_file::is_image(path) && !about.is_dir() {
        let file = ImageFile::open(path)?.with_accept_damage(options.accept_damage);
        if file.pages > 1 {
            refuse_motion(path.display(), options)?;
            return Ok(Box::new(ImagePages::new(file, camera, resize_mode, &linear)?));
        }
        return Ok(Box::new(match options.motion_clip {
            None => StillImage::from_file(file, camera, resize_mode, &linear)?.0,
            Some(m) => {
                let motion = (m.motion, m.rate, m.frames);
                StillImage::moving(file, camera, resize_mode, &linear, motion)?
            }
        }));
    }
    refuse_motion(path.display(), options)?;
    if about.is_dir() {
        if !options.is_video {
            check_is_video(path, options.follow_links)?;
        }
        let access = Access::for_reading(options.follow_links);
        let images = ImageFolder::open(path, camera, resize_mode, linear, options.accept_damage, access)?;
        return Ok(Box::new(images));
    }
    match ending.as_deref() {
        Some("npy") => array_source(ArraySource::open(path, camera, resize_mode, options.transfer)?, options),
        Some("npz") => array_source(npz::open(path, camera, resize_mode, options.transfer)?, options),
        Some("y4m") => Ok(Box::new(Y4mSource::open(path, camera, resize_mode, linear)?)),
        Some(e) if VIDEO_EXTENSIONS.contains(&e) => {
            Ok(Box::new(FfmpegSource::open(path, camera, resize_mode, linear, options.accept_damage)?))
        }
        _ => Err(Error::new(ErrorKind::Usage, path.display())
            .found("an unknown type of file")
            .expected(SUPPORTED_INPUTS)
            .remedy("convert the file; if the extension is wrong, rename the file")),
    }
}

/// Opens a stream in y4m or npy format. The first byte determines the format.
///
/// # Examples
/// ```
/// use spikelane_io::light::{Frame, InputOptions, open_reader};
/// let options = InputOptions::new(spikelane::Geometry::new(4, 2)?);
/// // A gray video of one frame.
/// let mut y4m = b"YUV4MPEG2 W4 H2 F25:1 Cmono\nFRAME\n".to_vec();
/// y4m.extend([255; 8]);
/// let mut source = open_reader(Box::new(std::io::Cursor::new(y4m)), "a pipe", &options)?;
/// let mut frame = Frame::dark(source.geometry());
/// assert!(source.next_frame(&mut frame)?);
/// assert_eq!((frame.get(0, 0), source.rate().map(|rate| rate.hz())), (1.0, Some(25.0)));
/// # Ok::<(), spikelane::Error>(())
/// ```
///
/// # Errors
/// * [`ErrorKind::Input`] if the stream is neither y4m nor npy.
/// * [`ErrorKind::Usage`] if a motion is requested.
/// * Errors of the source that reads the format.
pub fn open_reader(
    reader: Box<dyn Read + Send>,
    name: &str,
    options: &InputOptions,
) -> Result<Box<dyn Source>> {
    refuse_motion(name, options)?;
    let (camera, resize_mode) = (options.camera, options.resize_mode);
    let mut reader = BufReader::new(reader);
    // The first read from a pipe may return only one byte. One byte is sufficient to determine the format.
    let first = reader.fill_buf().map_err(|e| Error::io(name, e))?.first().copied();
    if first == npy::MAGIC.first().copied() {
        let array = ArraySource::from_reader(Box::new(reader), name, camera, resize_mode, options.transfer)?;
        return finish_source(array_source(array, options)?, options);
    }
    if first == y4m::MAGIC.first().copied() {
        let video =
            Y4mSource::from_reader(Box::new(reader), name, camera, resize_mode, options.linearization()?)?;
        return finish_source(Box::new(video), options);
    }
    Err(Error::new(ErrorKind::Input, name)
        .found(if first.is_none() { "nothing" } else { "other data" })
        .expected("a y4m video or a NumPy array")
        .remedy("pipe a video through ffmpeg -i FILE -pix_fmt yuv444p -f yuv4mpegpipe -"))
}

/// Applies the full scale of the front end and the mosaic.
fn finish_source(source: Box<dyn Source>, options: &InputOptions) -> Result<Box<dyn Source>> {
    let scaled = scale_source(source);
    match &options.mosaic {
        Some(mosaic) => Ok(Box::new(MosaicSource::new(scaled, mosaic.clone())?)),
        None => Ok(scaled),
    }
}

fn array_source(array: ArraySource, options: &InputOptions) -> Result<Box<dyn Source>> {
    let array =
        array.with_front_end(&options.front_end, options.transfer).with_color(options.mosaic.is_some());
    Ok(Box::new(array.with_scale(options.scale)?))
}

fn refuse_motion(name: impl std::fmt::Display, options: &InputOptions) -> Result<()> {
    if options.motion_clip.is_none() {
        return Ok(());
    }
    Err(Error::new(ErrorKind::Usage, name)
        .found(format_args!("{} for an input that is not a single image", Setting("motion")))
        .expected("one image")
        .remedy(format_args!("omit {}, or use a single image", Setting("motion"))))
}
