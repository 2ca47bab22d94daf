//! Light that the program makes: scenes, objects, the chart, and motion over a picture.

use spikelane::{Camera, Error, Kind, Result};
use spikelane_dataset::Drive;
use spikelane_io::light::open;
use spikelane_io::light::{Chart, InputOptions, Insertion, Motion, Moving, Objects, Rate, Timeline};
use spikelane_scene::{self as scene, KeyPlan, Lighting, Scene, SceneOptions};

use super::light::{Light, LightArgs};

/// Frames per second of the chart, and of a motion, when nobody says otherwise: at 20 kHz a
/// frame for 20 readouts, in which the fastest bar of a 400-pixel chart moves one pixel.
const FRAMES_PER_S: u64 = 1000;

/// Readouts of the chart when nobody says otherwise: a fifth of a second at 20 kHz.
const CHART_READOUTS: u64 = 4000;

/// Frames per second of a drive when nobody says otherwise: every eighth readout at 20 kHz. Most of
/// the street moves less than half a pixel from one to the next.
pub(crate) const DRIVE_FRAMES_PER_S: u64 = 2500;

/// What the light of anything drawn does between its frames when nobody says otherwise.
pub(crate) const DRAWN_INSERTION: Insertion = Insertion::Hold;

/// Colour samples of a drive's pixels: what is rendered is carried over many frames.
pub(crate) const DRIVE_SAMPLES: scene::SamplesPerPixel = scene::SamplesPerPixel::Sixteen;

/// Readouts of a drive when nobody says otherwise: a fortieth of a second at 20 kHz.
const DRIVE_READOUTS: u64 = 500;

/// The scene that is drawn when nobody names one.
const DEFAULT_SCENE: u64 = 0;
const DEFAULT_LIGHTING: Lighting = Lighting::Noon;

/// Objects before the backdrop.
const OBJECTS: u32 = 12;

impl LightArgs {
    /// What the light does between frames that are drawn.
    pub(super) fn drawn_insertion(&self) -> Insertion {
        self.insertion.unwrap_or(DRAWN_INSERTION)
    }

    pub(super) fn options(&self, camera: &Camera, moving: Option<Moving>) -> InputOptions {
        InputOptions {
            fit: self.fit,
            transfer: self.transfer,
            moving,
            scale: self.scale,
            ..InputOptions::of(camera)
        }
    }

    /// Rate and timeline of light that is drawn at any rate.
    pub(super) fn drawn(&self, readout: Rate, frames_per_s: u64) -> Result<(Rate, Timeline)> {
        if let Some(n) = self.readouts_per_frame {
            let (num, den) = readout.parts();
            let rate = Rate::new(num, den.saturating_mul(n))?;
            return Ok((rate, Timeline::per_frame(n, self.drawn_insertion())?));
        }
        let rate = match self.source_hz {
            Some(rate) => rate,
            None => Rate::new(frames_per_s, 1)?,
        };
        Ok((rate, Timeline::rates(rate, readout, self.drawn_insertion())?))
    }

    /// Frames that `readouts` readouts see, and the one behind them for linear insertion.
    pub(super) fn frames(&self, timeline: &Timeline, readouts: u64) -> u64 {
        timeline.at(readouts - 1).frame + 1 + u64::from(self.drawn_insertion() != Insertion::Hold)
    }

    /// Refuses flags that would change nothing.
    pub(super) fn built_in(&self, scene: bool) -> Result<()> {
        let unused = [
            ("--transfer", self.transfer.is_some()),
            ("--motion", self.motion.is_some()),
            ("--scale", self.scale.is_some()),
            ("--scene-seed", self.scene_seed.is_some() && !scene),
            ("--lighting", self.lighting.is_some() && !scene),
        ];
        if let Some((flag, _)) = unused.iter().find(|(_, given)| *given) {
            return Err(Error::new(Kind::Usage, flag)
                .found("no input that it could apply to")
                .expected(if scene { "an image or video" } else { "--source drive" })
                .remedy("leave it out; built-in light is linear and has a motion of its own"));
        }
        Ok(())
    }

    pub(super) fn drive(&self, camera: &Camera, readout: Rate) -> Result<Light> {
        self.built_in(true)?;
        let (rate, timeline) = self.drawn(readout, DRIVE_FRAMES_PER_S)?;
        let readouts = self.readouts.unwrap_or(DRIVE_READOUTS);
        let frames = self.frames(&timeline, readouts);
        let named = self.lighting.as_deref().and_then(Lighting::from_name);
        let options = SceneOptions {
            width: camera.sensor.geometry.width() as u32,
            height: camera.sensor.geometry.height() as u32,
            lighting: named.or(self.scene_seed.is_none().then_some(DEFAULT_LIGHTING)),
            duration_s: (frames as f64 / rate.hz()).max(2e-3),
            ..SceneOptions::default()
        };
        let scene = Scene::random(self.scene_seed.unwrap_or(DEFAULT_SCENE), &options)?;
        let threads = std::thread::available_parallelism().map_or(1, usize::from);
        let drive = Drive::new(scene, rate, frames, None, DRIVE_SAMPLES, threads)?;
        let warnings = self.too_fast(drive.plan(), rate, readout).into_iter().collect();
        let source = Box::new(drive);
        Ok(Light { source, timeline, readouts: Some(readouts), rate: Some(rate), warnings })
    }

    /// What to say where the picture moves by more than half a pixel: from one frame to the next,
    /// or even from one readout to the next.
    pub(super) fn too_fast(&self, plan: &KeyPlan, rate: Rate, readout: Rate) -> Option<String> {
        // A tenth more is not worth a word: it is the fastest point of the whole drive.
        let needed = plan.needed_hz(rate.hz());
        if needed <= 1.1 * rate.hz() || self.drawn_insertion() != Insertion::Hold {
            return None;
        }
        let px_per_frame = plan.max_px_per_readout;
        let remedy = if needed <= readout.hz() {
            format!("--source-hz {needed} draws it often enough")
        } else {
            format!("it takes {needed} readouts a second (--readout-hz), or a smaller picture")
        };
        Some(format!(
            "the fastest point of the scene moves by {px_per_frame:.2} pixels from one frame to the next, \
             more than half a pixel; {remedy}"
        ))
    }

    pub(super) fn objects(&self, camera: &Camera, readout: Rate) -> Result<Light> {
        if self.lighting.is_some() {
            self.built_in(false)?;
        }
        self.built_in(true)?;
        let (rate, timeline) = self.drawn(readout, FRAMES_PER_S)?;
        let readouts = self.readouts.unwrap_or(CHART_READOUTS);
        let frames = self.frames(&timeline, readouts);
        let seed = self.scene_seed.unwrap_or(DEFAULT_SCENE);
        let source = Objects::new(camera.sensor.geometry, rate, frames, seed, OBJECTS)?;
        Ok(Light {
            source: Box::new(source),
            timeline,
            readouts: Some(readouts),
            rate: Some(rate),
            warnings: Vec::new(),
        })
    }

    pub(super) fn chart(&self, camera: &Camera, readout: Rate) -> Result<Light> {
        self.built_in(false)?;
        let (rate, timeline) = self.drawn(readout, FRAMES_PER_S)?;
        let readouts = self.readouts.unwrap_or(CHART_READOUTS);
        let frames = self.frames(&timeline, readouts);
        let source = Box::new(Chart::new(camera.sensor.geometry, rate, Some(frames))?);
        Ok(Light { source, timeline, readouts: Some(readouts), rate: Some(rate), warnings: Vec::new() })
    }

    pub(super) fn moving(&self, camera: &Camera, readout: Rate) -> Result<Light> {
        let path = self.input.clone().unwrap_or_default();
        let motion: Motion = self.motion.as_deref().unwrap_or_default().parse()?;
        let Some(readouts) = self.readouts else {
            return Err(Error::new(Kind::Usage, "--motion")
                .found("no number of readouts")
                .expected("how long the camera moves")
                .remedy("give --readouts"));
        };
        let (rate, timeline) = self.drawn(readout, FRAMES_PER_S)?;
        let frames = self.frames(&timeline, readouts);
        let source = open(&path, &self.options(camera, Some(Moving { motion, rate, frames })))?;
        Ok(Light { source, timeline, readouts: Some(readouts), rate: Some(rate), warnings: Vec::new() })
    }
}
