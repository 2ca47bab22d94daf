//! A folder of images. The images are sorted by the numbers in the file names.

use std::path::{Path, PathBuf};

use super::image_file::{self, ImageFile};
use super::linearization::Linearization;
use super::names::{missing_numbers_note, name_order_note, natural_cmp, sort_by_name};
use crate::light::resize_mode::ResizeMode;
use crate::light::timestamps::{self, FrameTimes};
use spikelane::error::{Error, ErrorKind, Result, Setting};
use spikelane::light::Rate;
use spikelane::light::Transfer;
use spikelane::light::{Frame, Source};
use spikelane::sensor::{FrontEnd, FullScale};
use spikelane::spikes::Geometry;
use spikelane::unstable::Count;
use spikelane::unstable::inputs::{Access, check_link};

/// The images of a folder. Each image is one frame. Subfolders are ignored.
#[derive(Debug)]
pub struct ImageFolder {
    folder: PathBuf,
    files: Vec<PathBuf>,
    /// Names of the visible entries that are not images.
    ignored_names: Vec<String>,
    /// Number of all entries that are not images, including hidden entries.
    ignored_entries: usize,
    times: Option<FrameTimes>,
    size: Geometry,
    camera: Geometry,
    resize_mode: ResizeMode,
    linear: Linearization,
    front_end: FrontEnd,
    /// Notes about statements of the files that are not used.
    file_notes: Vec<String>,
    accept_damage: bool,
    next: usize,
}

impl ImageFolder {
    /// Lists the folder and reads the header of every image. If `accept_damage` is set, the decoded parts of damaged
    /// images are used, and notes name these images. `access` states whether links may leave the folder.
    ///
    /// # Errors
    /// * [`ErrorKind::Io`] if the folder cannot be listed.
    /// * [`ErrorKind::Input`] if the folder contains no image, if an image cannot be read, or if `access` forbids a link.
    /// * [`ErrorKind::Input`] if image sizes differ, or if some images have float pixels and some have integer pixels.
    /// * [`ErrorKind::Input`] if the mode is [`ResizeMode::Crop`] and the images are smaller than the camera.
    /// * [`ErrorKind::Input`] if a `timestamps.txt` in the folder does not contain a time for each image.
    pub fn open(
        folder: &Path,
        camera: Geometry,
        resize_mode: ResizeMode,
        linear: Linearization,
        accept_damage: bool,
        access: Access,
    ) -> Result<Self> {
        let (files, mut ignored, others) = list_images(folder, access)?;
        let Some(first) = files.first() else {
            return Err(Error::new(ErrorKind::Input, folder.display())
                .found(format_args!("no image among {}", Count(others, "entry")))
                .expected(format_args!("files named {}", image_file::EXTENSIONS.join(", "))));
        };
        let mut first_file = ImageFile::open(first)?;
        let (size, floats) = (first_file.size, first_file.has_float_pixels());
        let transfer = linear.for_encoding(&first_file.encoding).integers().transfer();
        let mut multipage = usize::from(first_file.pages > 1);
        for file in &files[1..] {
            let header = ImageFile::open(file)?;
            check_same_size(file, header.size, first, size)?;
            check_same_kind(file, header.has_float_pixels(), first, floats)?;
            let found = linear.for_encoding(&header.encoding).integers().transfer();
            check_same_transfer(file, found, first, transfer)?;
            check_same_white(&header, &first_file)?;
            multipage += usize::from(header.pages > 1);
        }
        resize_mode.check(size, camera).map_err(|e| e.with_context(folder.display()))?;
        let scanned = first_file.scanned_indices(files.len());
        // A note about damage is added when the frame is read.
        let scanned = scanned.iter().map(|&i| {
            let file = ImageFile::open(&files[i])?.with_accept_damage(accept_damage);
            file.read_page(0, &mut Vec::new())
        });
        let scanned = scanned.collect::<Result<Vec<_>>>()?;
        first_file.complete_notes(&linear, &scanned, "of the first, middle and last image");
        if multipage > 0 {
            first_file.notes.push(format!(
                "{} with several pages: only the first page is used",
                Count(multipage, "file"),
            ));
        }
        let linear = linear.for_encoding(&first_file.encoding);
        let times = timestamps::read_beside(folder, &files, access, &mut first_file.notes)?;
        let used = times.as_ref().filter(|t| t.path.parent() == Some(folder)).map(|t| name(&t.path));
        ignored.retain(|name| Some(name) != used.as_ref());
        Ok(Self {
            folder: folder.to_owned(),
            files,
            ignored_names: ignored,
            ignored_entries: others,
            times,
            size,
            camera,
            resize_mode,
            front_end: linear.front_end_for(floats),
            linear,
            file_notes: first_file.notes,
            accept_damage,
            next: 0,
        })
    }

    /// Returns the image files in the order in which they are read.
    #[must_use]
    pub fn files(&self) -> &[PathBuf] {
        &self.files
    }
}

pub(in crate::light) fn check_same_size(
    file: &Path,
    found: Geometry,
    first: &Path,
    size: Geometry,
) -> Result<()> {
    if found == size {
        return Ok(());
    }
    Err(Error::new(ErrorKind::Input, file.display())
        .found(found)
        .expected(format_args!("{size}, the size of {}", first.display()))
        .remedy(
            "resize the images to one size if they are the frames of a video, or simulate each image alone",
        ))
}

/// Rejects a mixture of integer and float images, because their transfer functions differ.
fn check_same_kind(file: &Path, found: bool, first: &Path, floats: bool) -> Result<()> {
    if found == floats {
        return Ok(());
    }
    let name = |floats| if floats { "float pixels" } else { "integer pixels" };
    Err(Error::new(ErrorKind::Input, file.display())
        .found(name(found))
        .expected(format_args!("{}, as in {}", name(floats), first.display()))
        .remedy("put the images into separate folders"))
}

/// Rejects images whose transfer functions differ, because one transfer function is used for all frames.
fn check_same_transfer(file: &Path, found: Transfer, first: &Path, transfer: Transfer) -> Result<()> {
    if found == transfer {
        return Ok(());
    }
    Err(Error::new(ErrorKind::Input, file.display())
        .found(format_args!("the transfer function {found}, as the file states"))
        .expected(format_args!("{transfer}, as in {}", first.display()))
        .remedy(format_args!("put the images into separate folders, or set {}", Setting("transfer"))))
}

/// Rejects images whose largest codes or codes of white differ.
fn check_same_white(file: &ImageFile, first: &ImageFile) -> Result<()> {
    let white = |f: &ImageFile| f.encoding.white_code.or(f.encoding.largest_code);
    let (found, expected) = (white(file), white(first));
    // The full scale of 8-bit and 16-bit codes is 1.0 in both cases.
    let is_largest = |f: &ImageFile| f.encoding.white_code.is_none();
    if found == expected || (is_largest(file) && is_largest(first)) {
        return Ok(());
    }
    Err(Error::new(ErrorKind::Input, file.path().display())
        .found(format_args!("white at code {}", found.unwrap_or_default()))
        .expected(format_args!("code {}, as in {}", expected.unwrap_or_default(), first.path().display()))
        .remedy("put the images into separate folders"))
}

/// Returns the images in a folder in the order of the numbers in their names. Hidden files are not listed.
///
/// # Examples
/// ```
/// # let folder = tempfile::tempdir().map_err(|e| spikelane::Error::io("a folder", e))?;
/// # let folder = folder.path();
/// for name in ["img10.png", "img2.png", "notes.txt"] {
///     std::fs::write(folder.join(name), "").map_err(|e| spikelane::Error::io(name, e))?;
/// }
/// let images = spikelane_io::light::image_files(folder, false)?;
/// assert_eq!(images, [folder.join("img2.png"), folder.join("img10.png")]);
/// # Ok::<(), spikelane::Error>(())
/// ```
///
/// # Errors
/// * [`ErrorKind::Io`] if the folder cannot be listed.
/// * [`ErrorKind::Input`] if an image is a link to a file outside the folder, and `follow_links` is false.
pub fn image_files(folder: &Path, follow_links: bool) -> Result<Vec<PathBuf>> {
    list_images(folder, Access::for_reading(follow_links)).map(|(files, ..)| files)
}

/// Returns the images in order, the names of visible entries that are not images, and the number of all
/// entries that are not images.
pub(in crate::light) fn list_images(
    folder: &Path,
    access: Access,
) -> Result<(Vec<PathBuf>, Vec<String>, usize)> {
    let refused = |e| Error::io(folder.display(), e);
    let (mut files, mut ignored, mut hidden) = (Vec::new(), Vec::new(), 0);
    for entry in std::fs::read_dir(folder).map_err(refused)? {
        let path = entry.map_err(refused)?.path();
        if name(&path).starts_with('.') {
            hidden += 1;
        } else if image_file::is_image(&path)
            && !std::fs::metadata(&path).map_err(|e| Error::io(path.display(), e))?.is_dir()
        {
            check_link(folder, &path, access)?;
            files.push(path);
        } else {
            ignored.push(name(&path));
        }
    }
    ignored.sort_by(|a, b| natural_cmp(a, b));
    sort_by_name(&mut files);
    let others = ignored.len() + hidden;
    Ok((files, ignored, others))
}

/// Returns a note that lists the entries that are not images.
fn skipped_note(names: &[String]) -> Option<String> {
    const MAX_LISTED_NAMES: usize = 3;
    let listed = names.iter().take(MAX_LISTED_NAMES).map(String::as_str).collect::<Vec<_>>().join(", ");
    let (entries, are) =
        if names.len() == 1 { ("entry", "is not an image") } else { ("entries", "are not images") };
    let more = if names.len() > MAX_LISTED_NAMES { ", ..." } else { "" };
    (!names.is_empty()).then(|| format!("{} {entries} {are} and ignored: {listed}{more}", names.len()))
}

fn name(path: &Path) -> String {
    path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default()
}

impl Source for ImageFolder {
    fn geometry(&self) -> Geometry {
        self.camera
    }

    fn frames(&self) -> Option<u64> {
        Some(self.files.len() as u64)
    }

    fn next_frame(&mut self, into: &mut Frame) -> Result<bool> {
        let Some(file) = self.files.get(self.next) else {
            return Ok(false);
        };
        let image = ImageFile::open(file)?.with_accept_damage(self.accept_damage);
        let mut damage = Vec::new();
        let frame = image.light(image.read_page(0, &mut damage)?, &self.linear)?;
        self.file_notes.extend(damage.iter().map(|note| format!("{}: {note}", name(file))));
        // The file may have changed since the folder was listed, so the size of the image is checked again.
        check_same_size(file, frame.geometry(), &self.files[0], self.size)?;
        *into = self.resize_mode.apply(frame, self.camera)?;
        self.next += 1;
        Ok(true)
    }

    fn rate(&self) -> Option<Rate> {
        None
    }

    fn front_end(&self) -> FrontEnd {
        self.front_end
    }

    fn full_scale(&self) -> FullScale {
        self.linear.full_scale()
    }

    fn describe(&self) -> String {
        format!(
            "{}: {} of {}, {} ignored{}",
            self.folder.display(),
            Count(self.files.len(), "image"),
            self.size,
            Count(self.ignored_entries, "other entry"),
            self.linear.full_scale_text(),
        )
    }

    fn stored_geometry(&self) -> Option<Geometry> {
        Some(self.size)
    }

    fn frame_times(&self) -> Option<&[u64]> {
        self.times.as_ref().map(|times| times.starts.as_slice())
    }

    fn notes(&self) -> Vec<String> {
        let place = self.folder.display();
        let gap = missing_numbers_note(&self.files).map(|text| format!("{place}: {text}"));
        let order = name_order_note(&self.files, self.times.is_some()).map(|text| format!("{place}: {text}"));
        let skipped = skipped_note(&self.ignored_names).map(|text| format!("{place}: {text}"));
        let of_files = self.file_notes.iter().map(|note| format!("{place}: {note}"));
        gap.into_iter().chain(order).chain(skipped).chain(of_files).collect()
    }
}
