//! Cameras at work, without pointers.
#![forbid(unsafe_code)]

use spikelane::{Backend, Geometry, Plan, Result, Seeds, presets};
use spikelane_io::light::{Insertion, Timeline};
use spikelane_io::simulate::FrameRef;

use crate::camera::Camera;
use crate::error::usage;
use crate::types::{SPL_FLOW, SPL_HOLD, SPL_LINEAR, spl_seeds};

/// What a simulator handle holds.
#[derive(Clone)]
pub struct Simulator {
    inner: spikelane::Simulator,
    /// The key of its camera, for saved states.
    camera: u64,
}

/// Seeds as the library has them.
pub fn seeds(seeds: spl_seeds) -> Seeds {
    Seeds { camera: seeds.camera, shot: seeds.shot, sequence: seeds.sequence }
}

impl Simulator {
    pub fn new(camera: &Camera, seeds: Seeds, greatest_light: f64, threads: u32) -> Result<Self> {
        if !(1..=4096).contains(&threads) {
            return Err(usage("threads", threads, "1 to 4096", "give the number of cores"));
        }
        let plan = Plan::with_light(&camera.0, seeds, greatest_light)?;
        Ok(Self {
            inner: spikelane::Simulator::of_plan(plan).with_threads(threads as usize)?,
            camera: presets::key(&presets::to_bytes(&camera.0)?),
        })
    }

    pub fn set_backend(&mut self, name: &str) -> Result<()> {
        let backend = if name == "auto" { Backend::best() } else { Backend::parse(name)? };
        self.inner = self.inner.clone().with_backend(backend)?;
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

    fn check_room(&self, readouts: usize, out: &[u8]) -> Result<()> {
        let bytes = self.geometry().frame_bytes();
        if readouts.checked_mul(bytes) == Some(out.len()) {
            return Ok(());
        }
        Err(usage(
            "out_bytes",
            out.len(),
            format_args!("{readouts} readouts of {bytes} bytes"),
            "give a buffer for whole readouts, as many as are asked for",
        ))
    }

    /// Holds a frame for `readouts` readouts.
    pub fn push(&mut self, frame: FrameRef<'_>, readouts: usize, out: &mut [u8]) -> Result<()> {
        self.check_room(readouts, out)?;
        self.inner.push(frame, out)
    }

    /// Frames along a timeline on which each lasts `per_frame` readouts.
    pub fn push_frames(
        &mut self,
        frames: &[FrameRef<'_>],
        per_frame: u64,
        insertion: u32,
        readouts: usize,
        out: &mut [u8],
    ) -> Result<()> {
        self.check_room(readouts, out)?;
        self.inner.push_frames(frames, &timeline(per_frame, insertion)?, out)
    }

    /// As [`Simulator::push_frames`], but what the camera drops is missing; returns how many readouts came out.
    pub fn expose_frames(
        &mut self,
        frames: &[FrameRef<'_>],
        per_frame: u64,
        insertion: u32,
        readouts: usize,
        out: &mut [u8],
    ) -> Result<usize> {
        self.check_room(readouts, out)?;
        self.inner.expose_frames(frames, &timeline(per_frame, insertion)?, readouts, out)
    }
}

fn timeline(per_frame: u64, insertion: u32) -> Result<Timeline> {
    let insertion = match insertion {
        SPL_HOLD => Insertion::Hold,
        SPL_LINEAR => Insertion::Linear,
        SPL_FLOW => Insertion::Flow,
        other => {
            return Err(usage("insertion", other, "SPL_HOLD, SPL_LINEAR or SPL_FLOW", "give one of them"));
        }
    };
    Timeline::per_frame(per_frame, insertion)
}
