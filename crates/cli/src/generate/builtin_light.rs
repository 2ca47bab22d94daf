//! Built-in light: driving scenes, objects, the test chart, and the motion of a camera across an image.

use spikelane::{Camera, Error, ErrorKind, Result};
use spikelane_dataset::Drive;
use spikelane_io::light::open;
use spikelane_io::light::{
    CameraMotion, Chart, InputOptions, Interpolation, MotionClip, Objects, Rate, Timeline,
};
use spikelane_scene::{self as scene, KeyframePlan, Lighting, Scene, SceneOptions};

use super::light::{LightArgs, RunLight};
use crate::common::lighting::LightingArg;

/// Default frames per second of the chart, the objects and a camera motion. At 20 kHz a frame lasts 20 readouts. In this
/// time the fastest bar of a 400-pixel chart moves one pixel.
const CHART_FRAMES_PER_S: u64 = 1000;

/// Default number of readouts of the chart and the objects. It is 0.2 s at 20 kHz.
const CHART_READOUTS: u64 = 4000;

/// Default frames per second of a drive. At 20 kHz a frame lasts eight readouts. Most of the street moves less than half a
/// pixel between two frames.
pub(crate) const DRIVE_FRAMES_PER_S: u64 = 2500;

/// Default interpolation of built-in light between its frames.
pub(crate) const BUILTIN_INTERPOLATION: Interpolation = Interpolation::Hold;

/// Color samples per pixel of a drive. Sixteen samples are affordable, because one rendered frame is warped to many frames.
pub(crate) const DRIVE_SAMPLES: scene::SamplesPerPixel = scene::SamplesPerPixel::Sixteen;

/// Default number of readouts of a drive. It is 25 ms at 20 kHz.
const DRIVE_READOUTS: u64 = 500;

/// Default seed and lighting of a drive.
const DEFAULT_SCENE_SEED: u64 = 0;
const DEFAULT_LIGHTING: Lighting = Lighting::Noon;

/// Number of objects in front of the background.
const OBJECT_COUNT: u32 = 12;

impl LightArgs {
    /// Returns the interpolation between frames of built-in light.
    pub(super) fn builtin_interpolation(&self) -> Interpolation {
        self.interpolation.unwrap_or(BUILTIN_INTERPOLATION)
    }

    pub(super) fn input_options(&self, camera: &Camera, motion: Option<MotionClip>) -> InputOptions {
        InputOptions {
            resize_mode: self.resize_mode,
            transfer: self.transfer,
            motion_clip: motion,
            scale: self.full_scale,
            ..InputOptions::from_camera(camera)
        }
    }

    /// Returns the frame rate and the timeline of built-in light. The flags determine the frame rate, and
    /// `frames_per_s` is the default.
    pub(super) fn builtin_timeline(&self, readout: Rate, frames_per_s: u64) -> Result<(Rate, Timeline)> {
        if let Some(n) = self.readouts_per_frame {
            let (num, den) = readout.as_fraction();
            let rate = Rate::new(num, den.saturating_mul(n))?;
            return Ok((rate, Timeline::from_readouts_per_frame(n, self.builtin_interpolation())?));
        }
        let rate = match self.input_fps {
            Some(rate) => rate,
            None => Rate::new(frames_per_s, 1)?,
        };
        Ok((rate, Timeline::from_rates(rate, readout, self.builtin_interpolation())?))
    }

    /// Returns the number of frames that `readouts` readouts need. Interpolation needs one more frame after the last
    /// readout.
    pub(super) fn frame_count(&self, timeline: &Timeline, readouts: u64) -> u64 {
        timeline.position(readouts - 1).frame
            + 1
            + u64::from(self.builtin_interpolation() != Interpolation::Hold)
    }

    /// Returns an error if a flag is set that has no effect on built-in light.
    pub(super) fn refuse_unused_flags(&self, scene: bool) -> Result<()> {
        let unused = [
            ("--transfer", self.transfer.is_some()),
            ("--motion", self.motion.is_some()),
            ("--full-scale", self.full_scale.is_some()),
            ("--scene-seed", self.scene_seed.is_some() && !scene),
            ("--lighting", self.lighting.is_some() && !scene),
        ];
        if let Some((flag, _)) = unused.iter().find(|(_, is_set)| *is_set) {
            return Err(Error::new(ErrorKind::Usage, flag)
                .found("no input to which this flag applies")
                .expected(if scene { "an image or video" } else { "--builtin-light drive" })
                .remedy("omit this flag; built-in light is linear and has its own motion"));
        }
        Ok(())
    }

    pub(super) fn drive_light(&self, camera: &Camera, readout: Rate) -> Result<RunLight> {
        self.refuse_unused_flags(true)?;
        let (rate, timeline) = self.builtin_timeline(readout, DRIVE_FRAMES_PER_S)?;
        let readouts = self.readouts.unwrap_or(DRIVE_READOUTS);
        let frames = self.frame_count(&timeline, readouts);
        let options = SceneOptions {
            width: camera.sensor.geometry.width() as u32,
            height: camera.sensor.geometry.height() as u32,
            lighting: self.lighting.unwrap_or(LightingArg::Fixed(DEFAULT_LIGHTING)).fixed(),
            duration_s: (frames as f64 / rate.hz()).max(2e-3),
            ..SceneOptions::default()
        };
        let scene = Scene::from_seed(self.scene_seed.unwrap_or(DEFAULT_SCENE_SEED), &options)?;
        let threads = std::thread::available_parallelism().map_or(1, usize::from);
        let drive = Drive::new(scene, rate, frames, None, DRIVE_SAMPLES, threads)?;
        let warnings = self.motion_warning(drive.plan(), rate, readout).into_iter().collect();
        let source = Box::new(drive);
        Ok(RunLight { source, timeline, readouts: Some(readouts), frame_rate: Some(rate), warnings })
    }

    /// Returns a warning with a remedy if the image moves by more than half a pixel between two frames.
    pub(super) fn motion_warning(&self, plan: &KeyframePlan, rate: Rate, readout: Rate) -> Option<String> {
        // The limit is exceeded only at the fastest point of the drive, so an excess of up to 10 % is ignored.
        let needed = plan.required_readout_hz(rate.hz());
        if needed <= 1.1 * rate.hz() || self.builtin_interpolation() != Interpolation::Hold {
            return None;
        }
        let px_per_frame = plan.max_px_per_readout;
        let remedy = if needed <= readout.hz() {
            format!("set --input-fps to {needed}")
        } else {
            format!("set --readout-hz to {needed}, or use a smaller image")
        };
        Some(format!(
            "the fastest point of the scene moves by {px_per_frame:.2} pixels from one frame to the next, more than half a pixel; {remedy}"
        ))
    }

    pub(super) fn objects_light(&self, camera: &Camera, readout: Rate) -> Result<RunLight> {
        if self.lighting.is_some() {
            self.refuse_unused_flags(false)?;
        }
        self.refuse_unused_flags(true)?;
        let (rate, timeline) = self.builtin_timeline(readout, CHART_FRAMES_PER_S)?;
        let readouts = self.readouts.unwrap_or(CHART_READOUTS);
        let frames = self.frame_count(&timeline, readouts);
        let seed = self.scene_seed.unwrap_or(DEFAULT_SCENE_SEED);
        let source = Objects::new(camera.sensor.geometry, rate, frames, seed, OBJECT_COUNT)?;
        Ok(RunLight {
            source: Box::new(source),
            timeline,
            readouts: Some(readouts),
            frame_rate: Some(rate),
            warnings: Vec::new(),
        })
    }

    pub(super) fn chart_light(&self, camera: &Camera, readout: Rate) -> Result<RunLight> {
        self.refuse_unused_flags(false)?;
        let (rate, timeline) = self.builtin_timeline(readout, CHART_FRAMES_PER_S)?;
        let readouts = self.readouts.unwrap_or(CHART_READOUTS);
        let frames = self.frame_count(&timeline, readouts);
        let source = Box::new(Chart::new(camera.sensor.geometry, rate, Some(frames))?);
        Ok(RunLight {
            source,
            timeline,
            readouts: Some(readouts),
            frame_rate: Some(rate),
            warnings: Vec::new(),
        })
    }

    pub(super) fn moving_image_light(&self, camera: &Camera, readout: Rate) -> Result<RunLight> {
        let path = self.input.clone().unwrap_or_default();
        let motion: CameraMotion = self.motion.as_deref().unwrap_or_default().parse()?;
        let Some(readouts) = self.readouts else {
            return Err(Error::new(ErrorKind::Usage, "--motion")
                .found("no number of readouts")
                .expected("the duration of the motion")
                .remedy("set --readouts"));
        };
        let (rate, timeline) = self.builtin_timeline(readout, CHART_FRAMES_PER_S)?;
        let frames = self.frame_count(&timeline, readouts);
        let source = open(&path, &self.input_options(camera, Some(MotionClip { motion, rate, frames })))?;
        Ok(RunLight {
            source,
            timeline,
            readouts: Some(readouts),
            frame_rate: Some(rate),
            warnings: Vec::new(),
        })
    }
}
