//! A folder of images, in the order of their numbers.

use std::path::{Path, PathBuf};

use super::gaps;
use super::natural::natural_cmp;
use super::picture;
use super::picture::{Header, Linear};
use crate::light::fit::Fit;
use crate::light::times;
use spikelane::error::{Error, Kind, Result};
use spikelane::light::Rate;
use spikelane::light::{Frame, Source};
use spikelane::sensor::FrontEnd;
use spikelane::spikes::Geometry;

/// The images of one folder (not of folders inside it), one frame each.
#[derive(Debug)]
pub struct Folder {
    folder: PathBuf,
    files: Vec<PathBuf>,
    /// Names of other entries that are not hidden, and how many there are with those that are.
    ignored: Vec<String>,
    others: usize,
    /// The file of times and what it says.
    times: Option<(PathBuf, Vec<u64>)>,
    size: Geometry,
    camera: Geometry,
    fit: Fit,
    linear: Linear,
    front_end: FrontEnd,
    next: usize,
}

impl Folder {
    /// Lists the folder and reads the header of every image in it.
    ///
    /// # Errors
    /// [`Kind::Io`] when it cannot be listed; [`Kind::Input`] when there is no image, one cannot be
    /// read, their sizes differ, floats are among integers, [`Fit::Crop`] finds them too small, or a
    /// `timestamps.txt` does not give a time for each.
    pub fn open(folder: &Path, camera: Geometry, fit: Fit, linear: Linear) -> Result<Self> {
        let (files, mut ignored, others) = list(folder)?;
        let Some(first) = files.first() else {
            return Err(Error::new(Kind::Input, folder.display())
                .found(format_args!("no image among {others} entries"))
                .expected(format_args!("files named {}", picture::EXTENSIONS.join(", "))));
        };
        let Header { size, floats } = picture::header(first)?;
        for file in &files[1..] {
            let header = picture::header(file)?;
            same_size(file, header.size, first, size)?;
            same_kind(file, header.floats, first, floats)?;
        }
        fit.check(size, camera).map_err(|e| e.within(folder.display()))?;
        // The file beside the folder may belong to something else; the one in it does not.
        let times = match times::beside(folder) {
            Some(path) if path.parent() == Some(folder) => {
                let starts = times::read(&path, files.len())?;
                Some((path, starts))
            }
            Some(path) => times::read(&path, files.len()).ok().map(|starts| (path, starts)),
            None => None,
        };
        ignored.retain(|name| name != times::NAME);
        Ok(Self {
            folder: folder.to_owned(),
            files,
            ignored,
            others,
            times,
            size,
            camera,
            fit,
            front_end: linear.used(floats),
            linear,
            next: 0,
        })
    }

    /// The image files in the order in which they are read.
    #[must_use]
    pub fn files(&self) -> &[PathBuf] {
        &self.files
    }
}

fn same_size(file: &Path, found: Geometry, first: &Path, size: Geometry) -> Result<()> {
    if found == size {
        return Ok(());
    }
    Err(Error::new(Kind::Input, file.display())
        .found(found)
        .expected(format_args!("{size} as {}", first.display()))
        .remedy("give the images one size, or put them into folders of their own"))
}

/// Codes and floats become light by different curves, which one sequence cannot have.
fn same_kind(file: &Path, found: bool, first: &Path, floats: bool) -> Result<()> {
    if found == floats {
        return Ok(());
    }
    let name = |floats| if floats { "pixels of floats" } else { "pixels of integer codes" };
    Err(Error::new(Kind::Input, file.display())
        .found(name(found))
        .expected(format_args!("{} as {}", name(floats), first.display()))
        .remedy("put the images into folders of their own"))
}

/// The images in natural order, the names of other entries that are not hidden, and the number of all others.
fn list(folder: &Path) -> Result<(Vec<PathBuf>, Vec<String>, usize)> {
    let refused = |e| Error::io(folder.display(), e);
    let (mut files, mut ignored, mut hidden) = (Vec::new(), Vec::new(), 0);
    for entry in std::fs::read_dir(folder).map_err(refused)? {
        let path = entry.map_err(refused)?.path();
        if name(&path).starts_with('.') {
            hidden += 1;
        } else if picture::is_picture(&path) && std::fs::metadata(&path).is_ok_and(|about| !about.is_dir()) {
            files.push(path);
        } else {
            ignored.push(name(&path));
        }
    }
    ignored.sort_by(|a, b| natural_cmp(a, b));
    files.sort_by(|a, b| natural_cmp(&name(a), &name(b)));
    let others = ignored.len() + hidden;
    Ok((files, ignored, others))
}

/// A line about entries that are no pictures.
fn skipped(names: &[String]) -> Option<String> {
    const LISTED: usize = 3;
    let listed = names.iter().take(LISTED).map(String::as_str).collect::<Vec<_>>().join(", ");
    let (entries, are) =
        if names.len() == 1 { ("entry", "is no picture") } else { ("entries", "are no pictures") };
    let more = if names.len() > LISTED { ", ..." } else { "" };
    (!names.is_empty()).then(|| format!("{} {entries} {are} and left out: {listed}{more}", names.len()))
}

fn name(path: &Path) -> String {
    path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default()
}

impl Source for Folder {
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
        let frame = picture::read(file, &self.linear)?;
        // The folder may have changed since it was listed.
        same_size(file, frame.geometry(), &self.files[0], self.size)?;
        *into = self.fit.apply(frame, self.camera)?;
        self.next += 1;
        Ok(true)
    }

    fn rate(&self) -> Option<Rate> {
        None
    }

    fn front_end(&self) -> FrontEnd {
        self.front_end
    }

    fn describe(&self) -> String {
        format!(
            "{}: {} images of {}, {} other entries ignored",
            self.folder.display(),
            self.files.len(),
            self.size,
            self.others
        )
    }

    fn stored(&self) -> Option<Geometry> {
        Some(self.size)
    }

    fn times(&self) -> Option<&[u64]> {
        self.times.as_ref().map(|(_, starts)| starts.as_slice())
    }

    fn notes(&self) -> Vec<String> {
        let place = self.folder.display();
        let gap = gaps::note(&self.files).map(|text| format!("{place}: {text}"));
        let skipped = skipped(&self.ignored).map(|text| format!("{place}: {text}"));
        gap.into_iter().chain(skipped).collect()
    }
}
