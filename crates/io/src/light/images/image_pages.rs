//! An image file with several pages: a TIFF stack, an animated PNG or an animated WebP.

use std::path::Path;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

use super::image_file::{ImageFile, missing_page_error};
use super::linearization::{Linearization, Pixels};
use super::page_timing::PageTiming;
use crate::light::resize_mode::ResizeMode;
use spikelane::error::Result;
use spikelane::light::{Frame, Rate, Source};
use spikelane::sensor::{FrontEnd, FullScale};
use spikelane::spikes::Geometry;
use spikelane::unstable::Count;
use spikelane::unstable::threads;

/// Number of decoded frames of an animation that wait for their use.
const QUEUED_FRAMES: usize = 2;

/// The pages of an image file as a source of frames at the camera's size.
pub(in crate::light) struct ImagePages {
    file: ImageFile,
    feed: PageFeed,
    linear: Linearization,
    resize_mode: ResizeMode,
    camera: Geometry,
    next: u64,
}

enum PageFeed {
    /// Pages are read by their number.
    RandomAccess,
    /// A thread decodes the frames in order, because the decoder cannot move between threads.
    Thread(Receiver<Result<Pixels>>),
}

impl ImagePages {
    /// Reads the notes of `file` from its first, middle and last page, and starts to decode an animation.
    pub(in crate::light) fn new(
        mut file: ImageFile,
        camera: Geometry,
        resize_mode: ResizeMode,
        linear: &Linearization,
    ) -> Result<Self> {
        resize_mode.check(file.size, camera).map_err(|e| e.with_context(file.path().display()))?;
        let feed = if file.has_random_access() {
            let scanned = file.scanned_indices(file.pages as usize);
            let pages = scanned.into_iter().map(|page| file.read_page(page, &mut Vec::new()));
            let scanned = pages.collect::<Result<Vec<_>>>()?;
            file.complete_notes(linear, &scanned, "of the first, middle and last page");
            PageFeed::RandomAccess
        } else {
            let first = file.read_page(0, &mut Vec::new())?;
            file.complete_notes(linear, &[first], "of the first page");
            let (sender, receiver) = sync_channel(QUEUED_FRAMES);
            threads::spawn("pages", file.clone(), move |file| send_pages(&file, &sender))
                .map_err(|_| threads::no_thread_error("read an animation"))?;
            PageFeed::Thread(receiver)
        };
        let linear = linear.for_encoding(&file.encoding);
        Ok(Self { file, feed, linear, resize_mode, camera, next: 0 })
    }

    fn path(&self) -> &Path {
        self.file.path()
    }
}

/// Sends the frames of an animation. Stops at an error, or when the receiver is dropped.
fn send_pages(file: &ImageFile, sender: &SyncSender<Result<Pixels>>) {
    let frames = match file.animation() {
        Ok(frames) => frames,
        Err(e) => return drop(sender.send(Err(e))),
    };
    for pixels in frames {
        let is_last = pixels.is_err();
        if sender.send(pixels).is_err() || is_last {
            return;
        }
    }
}

impl Source for ImagePages {
    fn geometry(&self) -> Geometry {
        self.camera
    }

    fn frames(&self) -> Option<u64> {
        Some(self.file.pages)
    }

    fn next_frame(&mut self, into: &mut Frame) -> Result<bool> {
        if self.next == self.file.pages {
            return Ok(false);
        }
        let pixels = match &self.feed {
            PageFeed::RandomAccess => self.file.read_page(self.next as usize, &mut Vec::new())?,
            PageFeed::Thread(frames) => {
                frames.recv().map_err(|_| missing_page_error(self.path(), self.next, self.file.pages))??
            }
        };
        let frame = self.file.light(pixels, &self.linear);
        let frame = frame.map_err(|e| e.with_context(format_args!("page {}", self.next)))?;
        *into = self.resize_mode.apply(frame, self.camera)?;
        self.next += 1;
        Ok(true)
    }

    fn rate(&self) -> Option<Rate> {
        match self.file.timing {
            Some(PageTiming::Uniform(rate)) => Some(rate),
            _ => None,
        }
    }

    fn front_end(&self) -> FrontEnd {
        self.linear.front_end_for(self.file.has_float_pixels())
    }

    fn full_scale(&self) -> FullScale {
        self.linear.full_scale()
    }

    fn describe(&self) -> String {
        let scale = self.linear.full_scale_text();
        format!("{}: {} of {}{scale}", self.path().display(), Count(self.file.pages, "page"), self.file.size)
    }

    fn stored_geometry(&self) -> Option<Geometry> {
        Some(self.file.size)
    }

    fn frame_times(&self) -> Option<&[u64]> {
        match &self.file.timing {
            Some(PageTiming::Times(times)) => Some(times),
            _ => None,
        }
    }

    fn notes(&self) -> Vec<String> {
        self.file.named_notes()
    }
}
