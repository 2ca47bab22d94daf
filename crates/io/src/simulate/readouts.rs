//! A run that simulates readouts on request.

use crate::light::Source;
use crate::simulate::feed::{LightFeeder, LightPiece};
use crate::simulate::run::{MAX_BUFFER_BYTES, PreparedRun};
use crate::simulate::{RunOptions, Simulator};
use spikelane::error::Result;
use spikelane::simulate::ExposureFault;
use spikelane::spikes::Geometry;
use spikelane::unstable::kernels::Segment;

/// A run whose readouts are returned in memory, a part per call. The readouts equal the readouts of
/// [`crate::simulate::run`].
///
/// A readout that the camera drops still elapses, but produces no frame. Unlike [`crate::simulate::run`], the stream
/// does not add readouts at the end to replace dropped readouts.
///
/// # Examples
/// ```
/// use spikelane::light::{Chart, Interpolation, Rate, Timeline};
/// use spikelane::{Camera, Geometry, Seeds, Sensor};
/// use spikelane_io::simulate::{ReadoutStream, RunOptions};
/// let mut chart = Chart::new(Geometry::new(64, 48)?, Rate::new(1000, 1)?, Some(3))?;
/// let timeline = Timeline::from_readouts_per_frame(20, Interpolation::Hold)?;
/// let options = RunOptions::new(Camera::ideal(Sensor::new(64, 48, 20_000.0)?), Seeds::default(), timeline);
/// let mut stream = ReadoutStream::new(&options, &mut chart)?;
/// let (mut packed, mut indices, mut total) = (Vec::new(), Vec::new(), 0);
/// while stream.fill(25, &mut packed, &mut indices)? > 0 {
///     total += packed.len() / stream.geometry().frame_bytes();
/// }
/// assert_eq!(total, 60);
/// # Ok::<(), spikelane::Error>(())
/// ```
pub struct ReadoutStream<'a> {
    feeder: LightFeeder<'a>,
    simulator: Simulator,
}

impl<'a> ReadoutStream<'a> {
    /// Plans the camera and reads the first frame. If the source is a single image and [`RunOptions::readouts`] is
    /// `None`, the stream never ends.
    ///
    /// # Errors
    /// [`ErrorKind::Input`](spikelane::ErrorKind::Input) if the source has no frame. Also errors of the plan and the
    /// source.
    pub fn new(options: &RunOptions, source: &'a mut dyn Source) -> Result<Self> {
        let PreparedRun { feeder, noisy: simulator, .. } = options.prepare(source, false)?;
        Ok(Self { feeder, simulator })
    }

    /// Returns the width and height.
    #[must_use]
    pub fn geometry(&self) -> Geometry {
        self.simulator.plan().geometry()
    }

    /// Returns whether the light of the readouts so far is outside the range of the camera.
    #[must_use]
    pub fn exposure_fault(&self) -> Option<ExposureFault> {
        self.simulator.exposure_fault()
    }

    /// Simulates up to `readouts` readouts. Returns the number of elapsed readouts, including dropped readouts.
    /// Returns 0 at the end of the stream.
    ///
    /// `packed` is resized to the simulated frames. `indices` receives the readout number of each frame, counted from
    /// 0.
    ///
    /// # Errors
    /// Errors of the source.
    pub fn fill(&mut self, readouts: usize, packed: &mut Vec<u8>, indices: &mut Vec<u64>) -> Result<usize> {
        let first = self.feeder.next_readout();
        let pieces = self.feeder.next_pieces(readouts, MAX_BUFFER_BYTES)?;
        let passed: usize = pieces.iter().map(|p| p.readouts).sum();
        let plan = self.simulator.plan();
        indices.clear();
        indices.extend((first..first + passed as u64).filter(|&readout| !plan.is_dropped(readout)));
        let bytes = plan.geometry().frame_bytes();
        packed.resize(passed * bytes, 0);
        let segments: Vec<Segment<'_>> = pieces.iter().map(LightPiece::segment).collect();
        let frames = self.simulator.run_segments(&segments, packed);
        packed.truncate(frames * bytes);
        Ok(passed)
    }
}
