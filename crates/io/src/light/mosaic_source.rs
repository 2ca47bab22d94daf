//! A source whose light passes the color filters of a camera.

use spikelane::error::{Error, ErrorKind, Result};
use spikelane::light::{Frame, Rate, Source};
use spikelane::sensor::{FrontEnd, FullScale, Mosaic};
use spikelane::spikes::Geometry;

/// A source whose frames contain the light of each pixel behind its color filter. The frames keep their colors
/// ([`Frame::rgb`]).
///
/// # Examples
/// ```
/// use spikelane::Geometry;
/// use spikelane::light::{Chart, Frame, Rate, Source};
/// use spikelane_io::light::MosaicSource;
/// let chart = Chart::new(Geometry::new(64, 48)?, Rate::new(1000, 1)?, Some(3))?;
/// let mut source = MosaicSource::new(Box::new(chart), "RGGB".parse()?)?;
/// assert!(source.notes()[0].contains("gray"));
/// let mut frame = Frame::dark(source.geometry());
/// assert!(source.next_frame(&mut frame)?);
/// # Ok::<(), spikelane::Error>(())
/// ```
pub struct MosaicSource {
    source: Box<dyn Source>,
    mosaic: Mosaic,
    /// The first frame, until it is returned.
    first: Option<Frame>,
    is_gray: bool,
}

impl MosaicSource {
    /// Reads the first frame of `source`, and prepares to filter all frames with `mosaic`.
    ///
    /// Gray frames have equal red, green and blue light. If the first frame is gray, [`Source::notes`] reports it.
    ///
    /// # Errors
    /// [`ErrorKind::Input`] if the source has no frame. Also errors of the source.
    pub fn new(mut source: Box<dyn Source>, mosaic: Mosaic) -> Result<Self> {
        let mut first = Frame::dark(source.geometry());
        if !source.next_frame(&mut first)? {
            return Err(Error::new(ErrorKind::Input, source.describe())
                .found("no frame")
                .expected("at least one frame"));
        }
        let is_gray = first.rgb().is_none();
        Ok(Self { source, mosaic, first: Some(first), is_gray })
    }
}

impl Source for MosaicSource {
    fn geometry(&self) -> Geometry {
        self.source.geometry()
    }

    fn frames(&self) -> Option<u64> {
        self.source.frames()
    }

    fn announced_frames(&self) -> Option<u64> {
        self.source.announced_frames()
    }

    fn next_frame(&mut self, into: &mut Frame) -> Result<bool> {
        if let Some(first) = self.first.take() {
            *into = self.mosaic.light(&first)?;
            return Ok(true);
        }
        if !self.source.next_frame(into)? {
            return Ok(false);
        }
        *into = self.mosaic.light(into)?;
        Ok(true)
    }

    fn rate(&self) -> Option<Rate> {
        self.source.rate()
    }

    fn front_end(&self) -> FrontEnd {
        self.source.front_end()
    }

    fn full_scale(&self) -> FullScale {
        self.source.full_scale()
    }

    fn describe(&self) -> String {
        self.source.describe()
    }

    fn stored_geometry(&self) -> Option<Geometry> {
        self.source.stored_geometry()
    }

    fn frame_times(&self) -> Option<&[u64]> {
        self.source.frame_times()
    }

    fn notes(&self) -> Vec<String> {
        let mut notes = self.source.notes();
        if self.is_gray {
            notes.push(format!(
                "{}: the light is gray, so red, green and blue are equal in the mosaic {}",
                self.source.describe(),
                self.mosaic
            ));
        }
        notes
    }
}
