//! Ground truth. The module determines which light the images of the ground truth show, and which codes represent this
//! light.

use std::path::Path;

use crate::labels::write_label_file;
use crate::{DatasetLayout, DatasetOptions};
use spikelane::effects::Camera;
use spikelane::error::Result;
use spikelane::sensor::{FrontEnd, FullScale};
use spikelane::spikes::Geometry;
use spikelane_io::light::{Frame, OwnedSamples, Rate, Source, Timeline};
use spikelane_io::simulate::{ImageFormat, light_at, linear_png};

/// Maximum fraction of pixels that have code 255 although the sensor resolves their light.
///
/// The documented limit is 1e-3. This constant is a tenth lower, because warping slightly changes a rendered image.
const MAX_CLIPPED_SHARE: f64 = 0.9e-3;

/// Lowest light whose code is rounded to 255.
const WHITE_LIGHT: f32 = 254.5 / 255.0;

/// Factor between one exposure and the next shorter exposure.
const EXPOSURE_STEP: f32 = 0.99;

/// Returns the camera of `options` with an adjusted exposure. With this exposure, the rate at light 1.0 does not
/// exceed the rate of code 255.
///
/// For SpikeCV and SSL-CSC, code 255 is the highest possible rate, so the camera is unchanged.
pub(super) fn exposed_camera(options: &DatasetOptions) -> Camera {
    let mut camera = options.camera.clone();
    if options.dataset_layout == DatasetLayout::SpikeZoo {
        let full = &mut camera.sensor.thresholds_at_full_scale;
        *full = full.min(options.dataset_layout.rate_at_255());
    }
    camera
}

/// Writes `reference.png` and `gt.png`. `light` is the light of the middle readout.
pub(super) fn write_reference_images(options: &DatasetOptions, light: &Frame, folder: &Path) -> Result<()> {
    let (values, geometry) = (light.image_values(), light.geometry());
    write_label_file(folder, "reference.png", &ImageFormat::U8.encode(&values, geometry)?)?;
    let full = exposed_camera(options).sensor.thresholds_at_full_scale / options.dataset_layout.rate_at_255();
    let codes: Vec<f32> = values.iter().map(|&x| x * full as f32).collect();
    write_label_file(folder, "gt.png", &linear_png(&codes, geometry)?)
}

/// Returns the largest exposure factor, at most 1, for which at most [`MAX_CLIPPED_SHARE`] of the pixels are clipped
/// to code 255.
///
/// Pixels with lamps that saturate the sensor itself are not counted. An exposure that resolves such lamps would make
/// all other pixels too dark.
pub(super) fn exposure_factor(options: &DatasetOptions, light: &Frame) -> f32 {
    let integers = !matches!(light.samples(), OwnedSamples::F32(_));
    if options.dataset_layout != DatasetLayout::SpikeZoo || integers {
        // For SpikeCV and SSL-CSC, code 255 is the saturation rate of the pixel. Integer light never exceeds white. With them or
        // integer light, no code is therefore clipped.
        return 1.0;
    }
    let values = light.to_f32();
    let rate = exposed_camera(options).sensor.thresholds_at_full_scale as f32;
    let white = WHITE_LIGHT * options.dataset_layout.rate_at_255() as f32;
    let max_clipped = (values.len() as f64 * MAX_CLIPPED_SHARE) as usize;
    let cut = |by: f32| values.iter().filter(|&&x| (white..1.0).contains(&(x * rate * by))).count();
    let mut by = 1.0;
    // The loop ends, because each iteration reduces the light. The light is finite, and light that is less than white
    // is not clipped.
    while cut(by) > max_clipped {
        by *= EXPOSURE_STEP;
    }
    by
}

/// Returns the light of the middle readout of the source that `open` returns. Returns `None` if the source has no
/// readouts.
///
/// If the length of the source is unknown, the source is read to its end and then opened again.
pub(super) fn middle_frame(
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

/// A source that multiplies the light of another source by a factor of at most 1.
pub(super) struct ScaledSource<'a> {
    pub source: &'a mut dyn Source,
    pub factor: f32,
    /// The path of the source, and the name of the source in the dataset.
    ///
    /// Descriptions and notes contain the name instead of the path, so that records neither depend on the location of the
    /// input folder nor publish it.
    pub path_and_name: Option<(&'a Path, &'a str)>,
}

impl ScaledSource<'_> {
    fn with_name(&self, text: &str) -> String {
        match self.path_and_name {
            Some((path, name)) => text.replace(&*path.to_string_lossy(), name),
            None => text.to_owned(),
        }
    }

    /// Multiplies the light of a frame by `by`. If `by` is 1 or more, the frame is returned unchanged.
    pub(crate) fn scale_frame(frame: &Frame, by: f32) -> Result<Frame> {
        if by >= 1.0 {
            return Ok(frame.clone());
        }
        let scaled = |light: &[f32]| light.iter().map(|x| x * by).collect::<Vec<f32>>();
        let light = Frame::new(frame.geometry(), OwnedSamples::F32(scaled(&frame.to_f32())))?;
        match frame.rgb() {
            Some(rgb) => light.with_rgb(scaled(rgb)),
            None => Ok(light),
        }
    }
}

impl Source for ScaledSource<'_> {
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
    fn full_scale(&self) -> FullScale {
        self.source.full_scale()
    }
    fn describe(&self) -> String {
        let text = self.with_name(&self.source.describe());
        if self.factor >= 1.0 { text } else { format!("{text}, exposure times {}", self.factor) }
    }
    fn stored_geometry(&self) -> Option<Geometry> {
        self.source.stored_geometry()
    }
    fn frame_times(&self) -> Option<&[u64]> {
        self.source.frame_times()
    }
    fn notes(&self) -> Vec<String> {
        self.source.notes().iter().map(|note| self.with_name(note)).collect()
    }
    fn next_frame(&mut self, into: &mut Frame) -> Result<bool> {
        let has_frame = self.source.next_frame(into)?;
        if has_frame && self.factor < 1.0 {
            *into = Self::scale_frame(into, self.factor)?;
        }
        Ok(has_frame)
    }
}
