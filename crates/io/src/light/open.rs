//! One door for every kind of input.

use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use super::fit::Fit;
use super::scaled::scaled;
use crate::Stdin;
use crate::light::arrays::npy;
use crate::light::arrays::npy::Array;
use crate::light::arrays::npz;
use crate::light::motion::Motion;
use crate::light::pictures::folder::Folder;
use crate::light::pictures::picture;
use crate::light::pictures::picture::Linear;
use crate::light::pictures::still::Still;
use crate::light::video::ffmpeg::Decoded;
use crate::light::video::y4m;
use crate::light::video::y4m::Video;
use spikelane::effects::Camera;
use spikelane::error::{Error, Kind, Result};
use spikelane::light::Rate;
use spikelane::light::Source;
use spikelane::light::Transfer;
use spikelane::sensor::FrontEnd;
use spikelane::spikes::Geometry;

/// Endings of files that are handed to ffmpeg.
const VIDEO: [&str; 16] = [
    "mp4", "mkv", "mov", "avi", "webm", "m4v", "mpg", "mpeg", "ts", "mts", "wmv", "flv", "ogv", "3gp", "gif",
    "mxf",
];

const SUPPORTED: &str = "a folder of images, a PNG, JPEG, TIFF, EXR, BMP, PNM or WEBP image, .npy, .npz, .y4m, \
                         a video that ffmpeg knows by its ending, or - for y4m or npy on standard input";

/// How an input is read.
#[derive(Clone, Debug)]
pub struct InputOptions {
    /// The camera's size, to which every frame is brought.
    pub camera: Geometry,
    /// How it is brought there.
    pub fit: Fit,
    /// How the camera takes codes as light.
    pub front_end: FrontEnd,
    /// The declared transfer function, in place of the front end's and for EXR too; `None` for the front
    /// end's, else sRGB in images and video, linear in arrays and EXR.
    pub transfer: Option<Transfer>,
    /// A motion over a single image.
    pub moving: Option<Moving>,
    /// The number in an array that is full scale; `None` for 255, 65535, true or 1.0.
    pub scale: Option<f64>,
    /// A request to stop, which ends the wait for standard input; `None` waits for its end.
    pub stop: Option<Arc<AtomicBool>>,
}

spikelane::unstable::with_methods!(InputOptions {
    with_camera: camera: Geometry,
    with_fit: fit: Fit,
    with_front_end: front_end: FrontEnd,
    with_transfer: transfer: Option<Transfer>,
    with_moving: moving: Option<Moving>,
    with_scale: scale: Option<f64>,
    with_stop: stop: Option<Arc<AtomicBool>>,
});

impl InputOptions {
    /// Everything by default, for a camera of this size that knows nothing of codes.
    #[must_use]
    pub fn new(camera: Geometry) -> Self {
        let front_end = FrontEnd::default();
        Self { camera, fit: Fit::Resize, front_end, transfer: None, moving: None, scale: None, stop: None }
    }

    /// The size and the front end of `camera`, everything else by default.
    #[must_use]
    pub fn of(camera: &Camera) -> Self {
        Self { front_end: camera.light, ..Self::new(camera.sensor.geometry) }
    }

    fn linear(&self) -> Linear {
        Linear::of(&self.front_end, self.transfer)
    }
}

/// A motion and how long it lasts.
#[derive(Clone, Copy, Debug)]
pub struct Moving {
    /// The motion.
    pub motion: Motion,
    /// Frames per second at which it is drawn.
    pub rate: Rate,
    /// Number of frames; at least 1.
    pub frames: u64,
}

/// Opens a folder, a file, or standard input (`-`).
///
/// # Examples
/// ```
/// use spikelane_io::light::{InputOptions, open};
/// let options = InputOptions::new(spikelane::Geometry::new(400, 250)?);
/// let missing = open(std::path::Path::new("nowhere/lake.png"), &options);
/// assert!(missing.is_err());
/// # Ok::<(), spikelane::Error>(())
/// ```
///
/// # Errors
/// [`Kind::Io`] when it cannot be opened; [`Kind::Usage`] when its kind is not known, or a motion is asked of
/// anything but one image; otherwise as the source of its kind.
pub fn open(path: &Path, options: &InputOptions) -> Result<Box<dyn Source>> {
    if path.as_os_str() == "-" {
        let stdin = Stdin::new(options.stop.clone().unwrap_or_default());
        let stdin = stdin.map_err(|e| Error::io("standard input", e))?;
        return open_reader(Box::new(stdin), "standard input", options);
    }
    by_kind(path, options).map(scaled)
}

fn by_kind(path: &Path, options: &InputOptions) -> Result<Box<dyn Source>> {
    let (camera, fit, linear) = (options.camera, options.fit, options.linear());
    let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase());
    if options.scale.is_some() && !matches!(ending.as_deref(), Some("npy" | "npz")) {
        return Err(no_scale(&path.display()));
    }
    let about = std::fs::metadata(path).map_err(|e| Error::io(path.display(), e))?;
    if picture::is_picture(path) && !about.is_dir() {
        return Ok(Box::new(match options.moving {
            None => Still::open(path, camera, fit, &linear)?,
            Some(m) => {
                let motion = (m.motion, m.rate, m.frames);
                Still::open_moving(path, camera, fit, &linear, motion)?
            }
        }));
    }
    no_motion(path.display(), options)?;
    if about.is_dir() {
        return Ok(Box::new(Folder::open(path, camera, fit, linear)?));
    }
    match ending.as_deref() {
        Some("npy") => coded(Array::open(path, camera, fit, options.transfer)?, options),
        Some("npz") => coded(npz::open(path, camera, fit, options.transfer)?, options),
        Some("y4m") => Ok(Box::new(Video::open(path, camera, fit, linear)?)),
        Some(e) if VIDEO.contains(&e) => Ok(Box::new(Decoded::open(path, camera, fit, linear)?)),
        _ => Err(Error::new(Kind::Usage, path.display())
            .found("a kind of file that is not known")
            .expected(SUPPORTED)
            .remedy("convert it, or rename it if its ending is wrong")),
    }
}

/// Opens a stream of y4m or npy; its first byte tells which.
///
/// # Errors
/// [`Kind::Input`] when it is neither; [`Kind::Usage`] when a motion is asked of it; otherwise as the source
/// of its kind.
pub fn open_reader(
    reader: Box<dyn Read + Send>,
    name: &str,
    options: &InputOptions,
) -> Result<Box<dyn Source>> {
    no_motion(name, options)?;
    let (camera, fit) = (options.camera, options.fit);
    let mut reader = BufReader::new(reader);
    // A pipe may hand over a single byte at first, and one is enough to decide.
    let first = reader.fill_buf().map_err(|e| Error::io(name, e))?.first().copied();
    if first == npy::MAGIC.first().copied() {
        let array = Array::from_reader(Box::new(reader), name, camera, fit, options.transfer)?;
        return Ok(scaled(coded(array, options)?));
    }
    if options.scale.is_some() {
        return Err(no_scale(&name));
    }
    if first == y4m::MAGIC.first().copied() {
        let video = Video::from_reader(Box::new(reader), name, camera, fit, options.linear())?;
        return Ok(scaled(Box::new(video)));
    }
    Err(Error::new(Kind::Input, name)
        .found(if first.is_none() { "nothing" } else { "other data" })
        .expected("a y4m video or a NumPy array")
        .remedy("pipe a video through ffmpeg -i FILE -pix_fmt yuv444p -f yuv4mpegpipe -"))
}

fn coded(array: Array, options: &InputOptions) -> Result<Box<dyn Source>> {
    let array = array.with_front_end(&options.front_end, options.transfer);
    Ok(Box::new(array.with_scale(options.scale)?))
}

fn no_scale(name: &dyn std::fmt::Display) -> Error {
    Error::new(Kind::Usage, name)
        .found("a number of full scale for what is no array")
        .expected("none: pictures and video have their own, the greatest code")
        .remedy("leave --scale out")
}

fn no_motion(name: impl std::fmt::Display, options: &InputOptions) -> Result<()> {
    if options.moving.is_none() {
        return Ok(());
    }
    Err(Error::new(Kind::Usage, name)
        .found("a motion")
        .expected("one image to move over")
        .remedy("leave the motion out, or give a single image"))
}
