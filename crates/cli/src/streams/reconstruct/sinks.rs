//! Where pictures go: one file, a folder, a video.

use std::path::{Path, PathBuf};

use crate::shared::picture::{grey, png};
use crate::shared::video::Video;
use spikelane::{Error, Geometry, Kind, Result};
use spikelane_io::storage;

/// Where pictures go.
pub(super) trait Sink: Sync {
    /// The bytes of a picture, for any thread.
    fn encode(&self, values: &[f32]) -> Result<Vec<u8>>;
    /// Takes them, one picture after the other.
    fn put(&mut self, at: usize, encoded: &[u8]) -> Result<()>;
    fn finish(self: Box<Self>) -> Result<()>;
}

/// How values become grey levels.
#[derive(Clone, Copy)]
pub(super) struct Shown {
    pub white: f32,
    pub geometry: Geometry,
}

impl Shown {
    fn image(&self, values: &[f32]) -> image::GrayImage {
        grey(values, self.white, self.geometry)
    }
}

pub(super) struct One {
    pub path: PathBuf,
    pub force: bool,
    pub shown: Shown,
}

impl Sink for One {
    fn encode(&self, values: &[f32]) -> Result<Vec<u8>> {
        png(&self.shown.image(values))
    }

    fn put(&mut self, _: usize, encoded: &[u8]) -> Result<()> {
        storage::write_small(&self.path, encoded, self.force)
    }

    fn finish(self: Box<Self>) -> Result<()> {
        Ok(())
    }
}

pub(super) struct Film {
    pub video: Video,
    pub shown: Shown,
}

impl Sink for Film {
    fn encode(&self, values: &[f32]) -> Result<Vec<u8>> {
        Ok(self.shown.image(values).into_raw())
    }

    fn put(&mut self, _: usize, encoded: &[u8]) -> Result<()> {
        self.video.push(encoded)
    }

    fn finish(self: Box<Self>) -> Result<()> {
        self.video.finish()
    }
}

/// A folder of numbered pictures.
pub(super) struct Folder {
    pub path: PathBuf,
    pub force: bool,
    pub shown: Shown,
}

/// Refuses a folder that holds anything, unless its pictures may be replaced.
pub(super) fn refuse_used(folder: &Path, force: bool) -> Result<()> {
    let Ok(mut entries) = std::fs::read_dir(folder) else { return Ok(()) };
    if force || entries.next().is_none() {
        return Ok(());
    }
    Err(Error::new(Kind::Exists, folder.display())
        .found("a folder that is not empty")
        .expected("an empty or new folder")
        .remedy("choose another folder, or allow overwriting with --force"))
}

impl Sink for Folder {
    fn encode(&self, values: &[f32]) -> Result<Vec<u8>> {
        png(&self.shown.image(values))
    }

    fn put(&mut self, at: usize, encoded: &[u8]) -> Result<()> {
        storage::write_small(&self.path.join(format!("{at:09}.png")), encoded, self.force)
    }

    fn finish(self: Box<Self>) -> Result<()> {
        Ok(())
    }
}
