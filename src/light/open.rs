//! One door for every kind of input.

use std::io::{BufRead, BufReader, Read};
use std::path::Path;

use crate::error::{Error, Kind, Result};
use crate::light::ffmpeg::Decoded;
use crate::light::folder::Folder;
use crate::light::npy::{self, Array};
use crate::light::still::Still;
use crate::light::y4m::{self, Video};
use crate::light::{Fit, Motion, Rate, Source, Transfer, npz, picture};
use crate::spikes::Geometry;

/// Endings of files that are handed to ffmpeg.
const VIDEO: [&str; 16] = [
    "mp4", "mkv", "mov", "avi", "webm", "m4v", "mpg", "mpeg", "ts", "mts", "wmv", "flv", "ogv", "3gp", "gif",
    "mxf",
];

const SUPPORTED: &str = "a folder of images, a PNG, JPEG, TIFF or EXR image, .npy, .npz, .y4m, \
                         a video that ffmpeg knows by its ending, or - for y4m or npy on standard input";

/// How an input is read.
#[derive(Clone, Debug)]
pub struct Options {
    /// The camera's size, to which every frame is brought.
    pub camera: Geometry,
    /// How it is brought there.
    pub fit: Fit,
    /// The declared transfer function; `None` for sRGB in images and video, linear in arrays and EXR.
    pub transfer: Option<Transfer>,
    /// A motion over a single image.
    pub moving: Option<Moving>,
}

impl Options {
    /// Everything by default, for a camera of this size.
    #[must_use]
    pub const fn new(camera: Geometry) -> Self {
        Self { camera, fit: Fit::Resize, transfer: None, moving: None }
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
/// # Errors
/// [`Kind::Io`] when it cannot be opened; [`Kind::Usage`] when its kind is not known, or a motion is asked of
/// anything but one image; otherwise as the source of its kind.
pub fn open(path: &Path, options: &Options) -> Result<Box<dyn Source>> {
    let (camera, fit, transfer) = (options.camera, options.fit, options.transfer);
    if path.as_os_str() == "-" {
        return open_reader(Box::new(std::io::stdin()), "standard input", options);
    }
    let about = std::fs::metadata(path).map_err(|e| Error::io(path.display(), e))?;
    if picture::is_picture(path) && !about.is_dir() {
        return Ok(Box::new(match options.moving {
            None => Still::open(path, camera, fit, transfer)?,
            Some(m) => {
                let motion = (m.motion, m.rate, m.frames);
                Still::open_moving(path, camera, fit, transfer, motion)?
            }
        }));
    }
    no_motion(path.display(), options)?;
    if about.is_dir() {
        return Ok(Box::new(Folder::open(path, camera, fit, transfer)?));
    }
    let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase());
    match ending.as_deref() {
        Some("npy") => Ok(Box::new(Array::open(path, camera, fit, transfer)?)),
        Some("npz") => Ok(Box::new(npz::open(path, camera, fit, transfer)?)),
        Some("y4m") => Ok(Box::new(Video::open(path, camera, fit, transfer)?)),
        Some(e) if VIDEO.contains(&e) => Ok(Box::new(Decoded::open(path, camera, fit, transfer)?)),
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
pub fn open_reader(reader: Box<dyn Read + Send>, name: &str, options: &Options) -> Result<Box<dyn Source>> {
    no_motion(name, options)?;
    let (camera, fit, transfer) = (options.camera, options.fit, options.transfer);
    let mut reader = BufReader::new(reader);
    // A pipe may hand over a single byte at first, and one is enough to decide.
    let first = reader.fill_buf().map_err(|e| Error::io(name, e))?.first().copied();
    if first == npy::MAGIC.first().copied() {
        let array = Array::from_reader(Box::new(reader), name, camera, fit, transfer)?;
        return Ok(Box::new(array));
    }
    if first == y4m::MAGIC.first().copied() {
        let video = Video::from_reader(Box::new(reader), name, camera, fit, transfer)?;
        return Ok(Box::new(video));
    }
    Err(Error::new(Kind::Input, name)
        .found(if first.is_none() { "nothing" } else { "other data" })
        .expected("a y4m video or a NumPy array")
        .remedy("pipe a video through ffmpeg -i FILE -pix_fmt yuv444p -f yuv4mpegpipe -"))
}

fn no_motion(name: impl std::fmt::Display, options: &Options) -> Result<()> {
    if options.moving.is_none() {
        return Ok(());
    }
    Err(Error::new(Kind::Usage, name)
        .found("a motion")
        .expected("one image to move over")
        .remedy("leave the motion out, or give a single image"))
}
