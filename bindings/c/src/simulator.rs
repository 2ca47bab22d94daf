//! Simulator handles. This module uses no pointers.
#![forbid(unsafe_code)]

use spikelane::unstable::Count;
use spikelane::{Backend, Geometry, Light, Plan, Result, Seeds, presets};
use spikelane_io::light::{Interpolation, Timeline};
use spikelane_io::simulate::FrameRef;

use crate::camera::Camera;
use crate::error::usage;
use crate::types::{SPL_INTERPOLATION_FLOW, SPL_INTERPOLATION_HOLD, SPL_INTERPOLATION_LINEAR, spl_seeds};

/// The content of a simulator handle.
#[derive(Clone)]
pub struct Simulator {
    inner: spikelane::Simulator,
    /// Fingerprint of the camera, for saved states.
    camera: u64,
}

/// Converts the seeds of the caller.
pub fn to_seeds(seeds: spl_seeds) -> Seeds {
    Seeds { camera: seeds.camera, shot: seeds.shot, sequence: seeds.sequence }
}

impl Simulator {
    pub fn new(camera: &Camera, seeds: Seeds, max_light: f64, threads: u32) -> Result<Self> {
        if !(1..=4096).contains(&threads) {
            return Err(usage("threads", threads, "1 to 4096", "give the number of cores"));
        }
        let plan = Plan::with_max_light(&camera.0, seeds, max_light)?;
        Ok(Self {
            inner: spikelane::SimulatorOptions::new().threads(threads as usize).build_from_plan(plan)?,
            camera: presets::fingerprint(&presets::to_bytes(&camera.0)?),
        })
    }

    pub fn set_backend(&mut self, name: &str) -> Result<()> {
        let backend = if name == "auto" { Backend::best() } else { name.parse()? };
        self.inner.set_backend(backend)?;
        Ok(())
    }

    pub fn backend(&self) -> &'static str {
        self.inner.backend().name()
    }

    pub fn geometry(&self) -> Geometry {
        self.inner.plan().geometry()
    }

    pub fn readout(&self) -> u64 {
        self.inner.state().readout()
    }

    pub fn restart(&mut self, seeds: Seeds) -> Result<()> {
        self.inner.restart(seeds)
    }

    pub fn state(&self) -> Vec<u8> {
        self.inner.save(self.camera)
    }

    pub fn restore(&mut self, bytes: &[u8]) -> Result<()> {
        self.inner.restore(self.camera, bytes)
    }

    fn check_room(&self, readouts: usize, packed: &[u8]) -> Result<()> {
        let bytes = self.geometry().frame_bytes();
        if readouts.checked_mul(bytes) == Some(packed.len()) {
            return Ok(());
        }
        Err(usage(
            "packed_bytes",
            packed.len(),
            format_args!("{} of {}", Count(readouts, "readout"), Count(bytes, "byte")),
            "pass a buffer for exactly these readouts",
        ))
    }

    /// Simulates `light` and fills `packed` with exactly `readouts` readouts.
    pub fn run(&mut self, light: &LightSequence<'_>, readouts: usize, packed: &mut [u8]) -> Result<()> {
        self.check_room(readouts, packed)?;
        self.inner.fill(light.light(), packed)
    }

    /// Simulates exactly `readouts` readouts. Returns the number of written readouts, which excludes dropped readouts.
    pub fn advance(
        &mut self,
        light: &LightSequence<'_>,
        readouts: usize,
        packed: &mut [u8],
    ) -> Result<usize> {
        self.check_room(readouts, packed)?;
        self.inner.advance(light.light(), readouts, packed)
    }
}

/// The light of a call.
pub struct LightSequence<'a> {
    frames: Vec<FrameRef<'a>>,
    /// `None` if a single frame lasts for the whole call.
    timeline: Option<Timeline>,
}

impl<'a> LightSequence<'a> {
    pub fn new(frames: Vec<FrameRef<'a>>, readouts_per_frame: u32, interpolation: u32) -> Result<Self> {
        let interpolation = match interpolation {
            SPL_INTERPOLATION_HOLD => Interpolation::Hold,
            SPL_INTERPOLATION_LINEAR => Interpolation::Linear,
            SPL_INTERPOLATION_FLOW => Interpolation::Flow,
            other => {
                return Err(usage(
                    "interpolation",
                    other,
                    "SPL_INTERPOLATION_HOLD, SPL_INTERPOLATION_LINEAR or SPL_INTERPOLATION_FLOW",
                    "set it to one of them",
                ));
            }
        };
        let timeline = match (frames.len(), readouts_per_frame) {
            (0, _) => return Err(usage("count", 0, "at least 1 frame", "pass a frame of light")),
            (1, 0) => None,
            (_, 0) => {
                let remedy = "set it to the readouts that each frame lasts";
                return Err(usage("readouts_per_frame", 0, "at least 1 for several frames", remedy));
            }
            (_, number) => Some(Timeline::from_readouts_per_frame(number.into(), interpolation)?),
        };
        Ok(Self { frames, timeline })
    }

    fn light(&self) -> Light<'_> {
        match &self.timeline {
            None => Light::hold(self.frames[0]),
            Some(timeline) => Light::sequence(&self.frames, timeline),
        }
    }
}
