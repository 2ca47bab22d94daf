//! Ground truth: which light it shows, and in which codes loaders expect it.

use std::path::Path;

use crate::labels::write;
use crate::{DatasetOptions, Structure};
use spikelane::effects::Camera;
use spikelane::error::Result;
use spikelane::sensor::FrontEnd;
use spikelane::spikes::Geometry;
use spikelane_io::light::{Frame, OwnedSamples, Rate, Source, Timeline};
use spikelane_io::simulate::{ImageForm, light_at, linear_png};

/// Share of the pixels that may have code 255 though the sensor still tells their light, less a
/// tenth for what warping changes of a drawn picture.
const CUT_SHARE: f64 = 0.9e-3;

/// Light from which a code rounds to 255.
const WHITE: f32 = 254.5 / 255.0;

/// One exposure and the next shorter one that is tried.
const STEP: f32 = 0.99;

/// The camera of `options`, exposed so that light 1.0 has no greater rate than code 255 can say.
///
/// SpikeCV's code 255 is the greatest rate that there is; nothing needs to change for it.
pub(super) fn exposed(options: &DatasetOptions) -> Camera {
    let mut camera = options.camera.clone();
    if options.structure == Structure::SpikeZoo {
        let full = &mut camera.sensor.thresholds_at_full_scale;
        *full = full.min(options.structure.rate_at_255());
    }
    camera
}

/// Writes `clear.png` and `gt.png` from the light of the middle readout.
pub(super) fn write_both(options: &DatasetOptions, light: &Frame, folder: &Path) -> Result<()> {
    let (values, geometry) = (light.to_f32(), light.geometry());
    write(folder, "clear.png", &ImageForm::U8.encode(&values, geometry)?)?;
    let full = exposed(options).sensor.thresholds_at_full_scale / options.structure.rate_at_255();
    let codes: Vec<f32> = values.iter().map(|&x| x * full as f32).collect();
    write(folder, "gt.png", &linear_png(&codes, geometry)?)
}

/// The greatest factor, at most 1, that light can be exposed with so that code 255 cuts no more than it may.
///
/// Lamps that saturate the sensor itself are not counted: no exposure that shows the rest would save them.
pub(super) fn exposure(options: &DatasetOptions, light: &Frame) -> f32 {
    let integers = !matches!(light.samples(), OwnedSamples::F32(_));
    if options.structure != Structure::SpikeZoo || integers {
        // The greatest rate is as far as the pixel goes; what integers say ends at white.
        return 1.0;
    }
    let values = light.to_f32();
    let rate = exposed(options).sensor.thresholds_at_full_scale as f32;
    let white = WHITE * options.structure.rate_at_255() as f32;
    let most = (values.len() as f64 * CUT_SHARE) as usize;
    let cut = |by: f32| values.iter().filter(|&&x| (white..1.0).contains(&(x * rate * by))).count();
    let mut by = 1.0;
    // Ends: the brightest light is finite, and below white nothing is cut.
    while cut(by) > most {
        by *= STEP;
    }
    by
}

/// The light of the middle readout of `source`, which has given no frame yet; `again` opens it once more
/// where only its end tells how long it is.
pub(super) fn middle(
    open: &dyn Fn() -> Result<Box<dyn Source>>,
    timeline: &Timeline,
    readouts: Option<u64>,
) -> Result<Option<Frame>> {
    let mut source = open()?;
    let readouts = match readouts.or(source.frames().and_then(|n| timeline.readouts(n))) {
        Some(readouts) => readouts,
        None => {
            let mut frame = Frame::dark(source.geometry());
            let mut frames = 0;
            while source.next_frame(&mut frame)? {
                frames += 1;
            }
            source = open()?;
            timeline.readouts(frames).unwrap_or(0)
        }
    };
    if readouts == 0 { Ok(None) } else { light_at(&mut *source, timeline.clone(), readouts / 2).map(Some) }
}

/// Light of a source times a factor of at most 1.
pub(super) struct Dimmed<'a> {
    pub source: &'a mut dyn Source,
    pub by: f32,
    /// Its path, and what it is called in the dataset: where the folder of inputs lies changes no record.
    pub place: Option<(&'a Path, &'a str)>,
}

impl Dimmed<'_> {
    /// Dims a frame; integers at 1.0 stay what they are.
    pub(crate) fn frame(frame: &Frame, by: f32) -> Result<Frame> {
        if by >= 1.0 {
            return Ok(frame.clone());
        }
        Frame::new(frame.geometry(), OwnedSamples::F32(frame.to_f32().into_iter().map(|x| x * by).collect()))
    }
}

impl Source for Dimmed<'_> {
    fn geometry(&self) -> Geometry {
        self.source.geometry()
    }
    fn frames(&self) -> Option<u64> {
        self.source.frames()
    }
    fn rate(&self) -> Option<Rate> {
        self.source.rate()
    }
    fn front_end(&self) -> FrontEnd {
        self.source.front_end()
    }
    fn describe(&self) -> String {
        let mut text = self.source.describe();
        if let Some((path, name)) = self.place.filter(|(_, name)| !name.is_empty()) {
            text = text.replace(&*path.to_string_lossy(), name);
        }
        if self.by >= 1.0 { text } else { format!("{text}, its light exposed by {}", self.by) }
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
    fn next_frame(&mut self, into: &mut Frame) -> Result<bool> {
        let found = self.source.next_frame(into)?;
        if found && self.by < 1.0 {
            *into = Self::frame(into, self.by)?;
        }
        Ok(found)
    }
}
