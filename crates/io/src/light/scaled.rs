//! Light in units of what a front end counts as full scale.

use spikelane::error::Result;
use spikelane::light::Rate;
use spikelane::light::Transfer;
use spikelane::light::{Frame, OwnedSamples, Source};
use spikelane::sensor::{FrontEnd, FullScale};
use spikelane::spikes::Geometry;

/// `source` with full scale where its front end has it; itself where that is at the greatest code.
pub(super) fn scaled(source: Box<dyn Source>) -> Box<dyn Source> {
    let front_end = source.front_end();
    if front_end.full_scale == FullScale::WHOLE { source } else { Box::new(Scaled { source, front_end }) }
}

struct Scaled {
    source: Box<dyn Source>,
    front_end: FrontEnd,
}

impl Scaled {
    /// Light, in that of the greatest code, that counts as 1.0.
    fn unit(&self, frame: &Frame) -> f64 {
        match self.front_end.full_scale {
            FullScale::Code(code) => self.front_end.transfer.unwrap_or(Transfer::Linear).light(code / 255.0),
            FullScale::Peak => f64::from(frame.max()),
        }
    }
}

impl Source for Scaled {
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
        // A frame without light has no peak.
        if unit > 0.0 {
            let light = into.to_f32().into_iter().map(|x| (f64::from(x) / unit) as f32).collect();
            *into = Frame::new(into.geometry(), OwnedSamples::F32(light))?;
        }
        Ok(true)
    }

    fn rate(&self) -> Option<Rate> {
        self.source.rate()
    }

    fn front_end(&self) -> FrontEnd {
        self.front_end
    }

    fn describe(&self) -> String {
        self.source.describe()
    }

    fn stored(&self) -> Option<Geometry> {
        self.source.stored()
    }

    fn times(&self) -> Option<&[u64]> {
        self.source.times()
    }

    fn notes(&self) -> Vec<String> {
        self.source.notes()
    }
}
