//! A source whose light is divided by the full scale of a front end.

use super::images::linearization::with_colors;
use spikelane::error::Result;
use spikelane::light::Rate;
use spikelane::light::Transfer;
use spikelane::light::{Frame, OwnedSamples, Source};
use spikelane::sensor::{FrontEnd, FullScale};
use spikelane::spikes::Geometry;

/// Returns `source` scaled to the full scale of its front end. If full scale is the largest code, returns `source`
/// unchanged.
pub(super) fn scale_source(source: Box<dyn Source>) -> Box<dyn Source> {
    let front_end = source.front_end();
    if front_end.full_scale == FullScale::MAX_CODE {
        source
    } else {
        Box::new(ScaledSource { source, front_end })
    }
}

struct ScaledSource {
    source: Box<dyn Source>,
    front_end: FrontEnd,
}

impl ScaledSource {
    /// Returns the light that is scaled to 1.0, as a fraction of the largest code.
    fn unit(&self, frame: &Frame) -> f64 {
        match self.front_end.full_scale {
            FullScale::Code(code) => self.front_end.transfer.unwrap_or(Transfer::Linear).light(code / 255.0),
            FullScale::Peak => match frame.rgb() {
                Some(rgb) => f64::from(rgb.iter().copied().fold(0.0, f32::max)),
                None => f64::from(frame.max()),
            },
        }
    }
}

impl Source for ScaledSource {
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
        if !self.source.next_frame(into)? {
            return Ok(false);
        }
        let unit = self.unit(into);
        // In a frame without light, the peak is 0, so the frame is not divided.
        if unit > 0.0 {
            let scaled =
                |light: &[f32]| light.iter().map(|&x| (f64::from(x) / unit) as f32).collect::<Vec<f32>>();
            let frame = Frame::new(into.geometry(), OwnedSamples::F32(scaled(&into.to_f32())))?;
            *into = with_colors(frame, into.rgb().map(scaled))?;
        }
        Ok(true)
    }

    fn rate(&self) -> Option<Rate> {
        self.source.rate()
    }

    fn front_end(&self) -> FrontEnd {
        self.front_end
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
        self.source.notes()
    }
}
