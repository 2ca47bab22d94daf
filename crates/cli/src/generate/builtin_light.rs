//! Built-in light: driving scenes, objects, the test chart, and the motion of a camera across an image.

use crate::common::LightingArg;
use spikelane::{Camera, Error, ErrorKind, Result};
use spikelane_dataset::Drive;
use spikelane_io::light::open;
use spikelane_io::light::{
    CameraMotion, Chart, InputOptions, Interpolation, MotionClip, Objects, Rate, Source as _, Timeline,
};
use spikelane_scene::{self as scene, Exposure, KeyframePlan, Lens, Lighting, Scene, SceneOptions};

use super::light::{LightArgs, RunLight};

/// Default frames per second of the chart, the objects and a camera motion. At 20 kHz a frame lasts 20 readouts. In this
/// time the fastest bar of a 400-pixel chart moves one pixel.
const CHART_FRAMES_PER_S: u64 = 1000;

/// Default number of readouts of the chart and the objects. It is 0.2 s at 20 kHz.
const CHART_READOUTS: u64 = 4000;

/// Default interpolation of the chart and the objects between their frames.
const CHART_INTERPOLATION: Interpolation = Interpolation::Hold;

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
    pub(super) fn input_options(&self, camera: &Camera, motion: Option<MotionClip>) -> InputOptions {
        InputOptions {
            resize_mode: self.resize_mode,
            transfer: self.transfer,
            motion_clip: motion,
            scale: self.full_scale,
            is_video: self.video,
            accept_damage: self.accept_damage,
            follow_links: self.follow_links,
            ..InputOptions::from_camera(camera)
        }
    }

    /// Returns the frame rate and the timeline that the flags state. Returns `None` if no flag states a frame rate.
    fn stated_timeline(&self, readout: Rate, default: Interpolation) -> Result<Option<(Rate, Timeline)>> {
        let interpolation = self.interpolation.unwrap_or(default);
        if let Some(n) = self.readouts_per_frame {
            let (num, den) = readout.as_fraction();
            let rate = Rate::new(num, den.saturating_mul(n))?;
            return Ok(Some((rate, Timeline::from_readouts_per_frame(n, interpolation)?)));
        }
        let of_rate = |rate| Ok((rate, Timeline::from_rates(rate, readout, interpolation)?));
        self.input_fps.map(of_rate).transpose()
    }

    /// Returns the frame rate and the timeline of the chart, the objects or a camera motion.
    fn chart_timeline(&self, readout: Rate) -> Result<(Rate, Timeline)> {
        if let Some(stated) = self.stated_timeline(readout, CHART_INTERPOLATION)? {
            return Ok(stated);
        }
        let rate = Rate::new(CHART_FRAMES_PER_S, 1)?;
        let interpolation = self.interpolation.unwrap_or(CHART_INTERPOLATION);
        Ok((rate, Timeline::from_rates(rate, readout, interpolation)?))
    }

    /// Returns an error if a flag is set that has no effect on built-in light.
    pub(super) fn refuse_unused_flags(&self, scene: bool) -> Result<()> {
        let unused = [
            ("--transfer", self.transfer.is_some()),
            ("--motion", self.motion.is_some()),
            ("--full-scale", self.full_scale.is_some()),
            ("--scene-seed", self.scene_seed.is_some() && !scene),
            ("--lighting", self.lighting.is_some() && !scene),
            ("--ideal-lens", self.ideal_lens && !scene),
            ("--lock-exposure", self.lock_exposure && !scene),
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
        let readouts = self.readouts.unwrap_or(DRIVE_READOUTS);
        let threads = std::thread::available_parallelism().map_or(1, usize::from);
        let scene = |seconds: f64| {
            let options = SceneOptions {
                width: camera.sensor.geometry.width() as u32,
                height: camera.sensor.geometry.height() as u32,
                lighting: self.lighting.unwrap_or(LightingArg::Fixed(DEFAULT_LIGHTING)).fixed(),
                duration_s: seconds.max(2e-3),
                lens: self.ideal_lens.then_some(Lens::IDEAL),
                exposure: if self.lock_exposure { Exposure::Locked } else { Exposure::Automatic },
                ..SceneOptions::default()
            };
            Scene::from_seed(self.scene_seed.unwrap_or(DEFAULT_SCENE_SEED), &options)
        };
        let (drive, rate, timeline) = match self.stated_timeline(readout, Interpolation::Linear)? {
            Some((rate, timeline)) => {
                let frames = frame_count(&timeline, readouts);
                let scene = scene(frames as f64 / rate.hz())?;
                let drive = Drive::with_frame_per_readout(scene, rate, frames, DRIVE_SAMPLES, threads)?;
                (drive, rate, timeline)
            }
            None => {
                let scene = scene(readouts as f64 / readout.hz())?;
                let drive = Drive::new(scene, readout, readouts, DRIVE_SAMPLES, threads)?;
                let timeline = drive.timeline(self.interpolation.unwrap_or(Interpolation::Linear))?;
                (drive, readout, timeline)
            }
        };
        let warnings = motion_warning(drive.plan(), rate, readout).into_iter().collect();
        let drive = drive.with_mosaic(camera.window_mosaic());
        let frame_rate = drive.rate();
        Ok(RunLight { source: Box::new(drive), timeline, readouts: Some(readouts), frame_rate, warnings })
    }

    pub(super) fn objects_light(&self, camera: &Camera, readout: Rate) -> Result<RunLight> {
        if self.lighting.is_some() {
            self.refuse_unused_flags(false)?;
        }
        self.refuse_unused_flags(true)?;
        let (rate, timeline) = self.chart_timeline(readout)?;
        let readouts = self.readouts.unwrap_or(CHART_READOUTS);
        let frames = frame_count(&timeline, readouts);
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
        let (rate, timeline) = self.chart_timeline(readout)?;
        let readouts = self.readouts.unwrap_or(CHART_READOUTS);
        let frames = frame_count(&timeline, readouts);
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
        let (rate, timeline) = self.chart_timeline(readout)?;
        let frames = frame_count(&timeline, readouts);
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

/// Returns the number of frames that `readouts` readouts need. Interpolation needs one more frame after the last readout.
fn frame_count(timeline: &Timeline, readouts: u64) -> u64 {
    timeline.position(readouts - 1).frame + 1 + u64::from(timeline.interpolation() != Interpolation::Hold)
}

/// Returns a warning with a remedy if the image moves by more than half a pixel between two frames or readouts.
fn motion_warning(plan: &KeyframePlan, rate: Rate, readout: Rate) -> Option<String> {
    // The limit is exceeded only at the fastest point of the drive, so an excess of up to 10 % is ignored.
    let needed = plan.required_readout_hz(rate.hz());
    if needed <= 1.1 * rate.hz() {
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
