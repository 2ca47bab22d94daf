//! A run whose readouts are asked for as they are needed.

use crate::light::Source;
use crate::simulate::feed::{Feeder, Piece};
use crate::simulate::run::{HELD, Start};
use crate::simulate::{Run, Simulator};
use spikelane::error::Result;
use spikelane::spikes::Geometry;
use spikelane::unstable::kernels::Segment;

/// The readouts of a [`Run`] in memory, some at a time; the bits are those of [`crate::simulate::run`].
///
/// Time goes on in readouts that the camera drops: they are missing, and nothing is made up for them.
pub struct Readouts<'a> {
    feeder: Feeder<'a>,
    simulator: Simulator,
}

impl<'a> Readouts<'a> {
    /// Plans the camera and reads the first frame. Without [`Run::readouts`] a still picture has no end.
    ///
    /// # Errors
    /// `Kind::Input` when the source has no frame; otherwise those of the plan and the source.
    pub fn new(job: &Run, source: &'a mut dyn Source) -> Result<Self> {
        let Start { feeder, noisy: simulator, .. } = job.start(source, false)?;
        Ok(Self { feeder, simulator })
    }

    /// Width and height.
    #[must_use]
    pub fn geometry(&self) -> Geometry {
        self.simulator.plan().geometry()
    }

    /// Simulates up to `readouts` readouts into `packed`, whose length becomes that of the frames that came out.
    /// `kept` receives the index of each, counted from 0. Returns how many readouts passed, dropped ones
    /// included; 0 at the end.
    ///
    /// # Errors
    /// Those of the source.
    pub fn fill(&mut self, readouts: usize, packed: &mut Vec<u8>, kept: &mut Vec<u64>) -> Result<usize> {
        let first = self.feeder.at();
        let pieces = self.feeder.fill(readouts, HELD)?;
        let passed: usize = pieces.iter().map(|p| p.readouts).sum();
        let plan = self.simulator.plan();
        kept.clear();
        kept.extend((first..first + passed as u64).filter(|&readout| !plan.is_dropped(readout)));
        let bytes = plan.geometry().frame_bytes();
        packed.resize(passed * bytes, 0);
        let segments: Vec<Segment<'_>> = pieces.iter().map(Piece::segment).collect();
        let frames = self.simulator.run(&segments, packed);
        packed.truncate(frames * bytes);
        Ok(passed)
    }
}
