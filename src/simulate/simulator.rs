use crate::count::Count;
use crate::draws::Seeds;
use crate::effects::Camera;
use crate::error::{Result, bail};
use crate::kernels::{self, Backend, Batch, Job, Segment, SegmentLight};
use crate::light::full_scale::MAX_FLOAT_LIGHT;
use crate::plan::{FOREIGN_STATE, Plan, SimulatorState, StateTile};
use crate::simulate::exposure_meter::{ExposureFault, ExposureMeter};
use crate::simulate::frame_sequence::FrameSequence;
use crate::simulate::light::{Light, ValidLight};
use crate::simulate::segments::batches;
use crate::simulate::tiles::{gather_frame, tile_pixels};
use crate::spikes::SpikeFrames;
use crate::threads;
#[cfg(feature = "threads")]
use crate::threads::Pool;

/// Maximum number of readouts of a batch. In a batch of this length, loading the tables of a vector takes a negligible
/// time. The bits of a tile still fit in the cache.
pub(super) const MAX_BATCH_READOUTS: usize = 128;

/// Number of readouts whose bits one thread collects at a time.
#[cfg(feature = "threads")]
const READOUTS_PER_GATHER: usize = 8;

/// A simulated camera. It converts light to packed readouts.
///
/// Results depend only on the plan, the light and the state. The state can be cloned with the simulator, saved with
/// [`SimulatorState::to_bytes`], and restored at any readout.
///
/// # Examples
/// ```
/// use spikelane::{Camera, Seeds, Sensor, Simulator};
/// let mut simulator = Simulator::new(&Camera::ideal(Sensor::new(8, 1, 20_000.0)?), Seeds::default())?;
/// // A quarter of full scale for 6 readouts, then full scale for 2 readouts. The charge persists.
/// assert_eq!(simulator.run(&[0.25f32; 8], 6)?.spikes(), 8);
/// assert_eq!(simulator.run(&[1.0f32; 8], 2)?.spikes(), 2 * 8);
/// assert_eq!(simulator.state().readout(), 8);
///
/// let error = simulator.run(&[1.0f32; 7], 2).unwrap_err();
/// assert!(error.to_string().contains("found 7 samples, expected 8 samples"));
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Simulator {
    plan: Plan,
    state: SimulatorState,
    backend: Backend,
    /// Number of pixels in a tile.
    tile_pixels: usize,
    bits: Vec<Vec<u8>>,
    /// Whether the last batch visited the tiles in reverse order. For batches with a single segment, the order
    /// alternates. The first tiles of a batch are then the last tiles of the previous batch, which are still in the
    /// caches.
    is_reversed: bool,
    meter: ExposureMeter,
    #[cfg(feature = "threads")]
    pool: Option<Pool>,
}

impl Simulator {
    /// Returns a simulator of `camera` before the first readout. It uses the fastest backend of this CPU and one thread.
    ///
    /// # Examples
    /// ```
    /// use spikelane::{Camera, Seeds, Sensor, Simulator};
    /// let camera = Camera::ideal(Sensor::new(32, 24, 20_000.0)?);
    /// let simulator = Simulator::new(&camera, Seeds::default())?;
    /// assert_eq!(simulator.plan().geometry().pixels(), 768);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns the errors of [`Plan::new`].
    pub fn new(camera: &Camera, seeds: Seeds) -> Result<Self> {
        Ok(Self::from_plan(Plan::new(camera, seeds)?))
    }

    /// Returns a simulator of `plan` before the first readout.
    ///
    /// # Examples
    /// ```
    /// use spikelane::{Camera, Plan, Seeds, Sensor, Simulator};
    /// let plan = Plan::new(&Camera::ideal(Sensor::new(8, 1, 20_000.0)?), Seeds::default())?;
    /// let [mut bright, mut dim] = [plan.clone(), plan].map(Simulator::from_plan);
    /// assert_eq!(bright.run(&[255u8; 8], 5)?.spikes(), 5 * 8);
    /// assert_eq!(dim.run(&[51u8; 8], 5)?.spikes(), 8);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    #[must_use]
    pub fn from_plan(plan: Plan) -> Self {
        let tile = tile_pixels(&plan, 1);
        Self {
            state: kernels::initial_state(&plan),
            backend: Backend::best(),
            bits: vec![Vec::new(); plan.padded_pixels().div_ceil(tile)],
            is_reversed: false,
            meter: ExposureMeter::default(),
            tile_pixels: tile,
            plan,
            #[cfg(feature = "threads")]
            pool: None,
        }
    }

    /// Makes this simulator run on the threads of `pool`.
    #[cfg(feature = "threads")]
    pub(super) fn set_pool(&mut self, pool: &Pool) {
        self.tile_pixels = tile_pixels(&self.plan, pool.threads());
        self.bits.resize(self.plan.padded_pixels().div_ceil(self.tile_pixels), Vec::new());
        self.pool = (pool.threads() > 1).then(|| pool.clone());
    }

    /// Sets the instruction set of the kernels. The simulated bits do not depend on the instruction set.
    ///
    /// # Errors
    /// Returns [`ErrorKind::Usage`](crate::ErrorKind::Usage) if this CPU cannot run the backend.
    pub fn set_backend(&mut self, backend: Backend) -> Result<()> {
        if !backend.is_available() {
            bail!(Usage, "backend"; found "{backend}"; expected "a backend that this CPU supports";
                remedy "use `Backend::best()`");
        }
        self.backend = backend;
        Ok(())
    }

    /// Returns to the state before the first readout, for another recording of the same camera.
    ///
    /// The result equals a new simulator of [`Plan::with_seeds`]. Tables, backend and threads are reused.
    ///
    /// # Examples
    /// ```
    /// # use spikelane::{Camera, Seeds, Sensor, Simulator};
    /// # let light = vec![51u8; 32 * 24];
    /// let mut simulator = Simulator::new(&Camera::ideal(Sensor::new(32, 24, 20_000.0)?), Seeds::default())?;
    /// let first = simulator.run(&light, 4)?;
    /// simulator.restart(Seeds::default())?;
    /// assert_eq!(simulator.run(&light, 4)?, first);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns [`ErrorKind::Usage`](crate::ErrorKind::Usage) if `seeds.camera` differs from the camera seed of the plan.
    pub fn restart(&mut self, seeds: Seeds) -> Result<()> {
        self.plan.reseed(seeds)?;
        self.meter = ExposureMeter::default();
        self.state = kernels::initial_state(&self.plan);
        Ok(())
    }

    /// Returns the plan.
    #[must_use]
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// Returns the backend.
    #[must_use]
    pub fn backend(&self) -> Backend {
        self.backend
    }

    /// Returns the state after the last readout.
    #[must_use]
    pub fn state(&self) -> &SimulatorState {
        &self.state
    }

    /// Replaces the state, for example by a state that [`SimulatorState::from_bytes`] returned for
    /// [`Plan::initial_state`].
    ///
    /// # Examples
    /// ```
    /// # use spikelane::{Camera, Seeds, Sensor, Simulator};
    /// # let light = vec![51u8; 32 * 24];
    /// let mut simulator = Simulator::new(&Camera::ideal(Sensor::new(32, 24, 20_000.0)?), Seeds::default())?;
    /// let before = simulator.state().clone();
    /// let first = simulator.run(&light, 4)?;
    /// simulator.set_state(before)?;
    /// assert_eq!(simulator.run(&light, 4)?, first);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns an error if the state belongs to another plan, or if the state contains a value that no run can produce.
    pub fn set_state(&mut self, state: SimulatorState) -> Result<()> {
        if !state.fits(&self.state) {
            return Err(SimulatorState::foreign_error(FOREIGN_STATE));
        }
        if let Some(found) = state.fault(&self.plan) {
            return Err(SimulatorState::foreign_error(found));
        }
        self.state = state;
        self.meter = ExposureMeter::default();
        Ok(())
    }

    /// Returns whether the light of the simulated readouts is outside the range of the camera.
    ///
    /// A pixel readout is saturated if the pixel also fires in every readout next to it, so that brighter light would not
    /// change the stream. If more than half of the pixel readouts are saturated, or if no pixel has fired, the result
    /// is `Some`. It covers all readouts since the start, the last [`restart`](Self::restart) or the last
    /// [`set_state`](Self::set_state). Before 32 readouts, the result is `None`.
    ///
    /// The share is a sample: of 256 readouts, 32 are examined, and of a large frame, about 64 parts.
    ///
    /// # Examples
    /// ```
    /// use spikelane::simulate::ExposureFault;
    /// # use spikelane::{Camera, Seeds, Sensor, Simulator};
    /// let mut simulator = Simulator::new(&Camera::ideal(Sensor::new(32, 24, 20_000.0)?), Seeds::default())?;
    /// simulator.run(&vec![230u8; 32 * 24], 100)?;
    /// assert_eq!(simulator.exposure_fault(), None);
    /// simulator.restart(Seeds::default())?;
    /// simulator.run(&vec![255u8; 32 * 24], 100)?;
    /// assert_eq!(simulator.exposure_fault(), Some(ExposureFault::Saturated { share: 1.0 }));
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    #[must_use]
    pub fn exposure_fault(&self) -> Option<ExposureFault> {
        self.meter.fault()
    }

    /// Simulates `readouts` readouts of `light` and returns the spikes.
    ///
    /// The result always has `readouts` frames. If the camera drops readouts, the last light continues until this number
    /// is complete. [`Simulator::advance`] returns fewer frames instead.
    ///
    /// # Examples
    /// ```
    /// use spikelane::{Camera, Seeds, Sensor, Simulator};
    /// let mut simulator = Simulator::new(&Camera::ideal(Sensor::new(32, 24, 20_000.0)?), Seeds::default())?;
    /// // A fifth of full scale: every pixel fires once in five readouts.
    /// let light = vec![51u8; 32 * 24];
    /// let spikes = simulator.run(&light, 5)?;
    /// assert_eq!(spikes.spikes(), 32 * 24);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns the errors of [`Simulator::fill`]. Returns [`ErrorKind::Memory`](crate::ErrorKind::Memory) if the system cannot allocate memory for
    /// the spikes.
    pub fn run<'a>(&mut self, light: impl Into<Light<'a>>, readouts: usize) -> Result<SpikeFrames> {
        let mut frames = SpikeFrames::zeros(self.plan.geometry(), readouts)?;
        self.fill(light, frames.as_bytes_mut())?;
        Ok(frames)
    }

    /// Simulates readouts of `light` until `out` is full of packed frames of [`crate::Geometry::frame_bytes`] bytes.
    ///
    /// If the camera drops readouts, the last light continues until `out` is full. [`Simulator::advance`] writes fewer
    /// frames instead.
    ///
    /// # Examples
    /// ```
    /// use spikelane::{Camera, Light, Seeds, Sensor, Simulator};
    /// let sensor = Sensor::new(32, 24, 20_000.0)?;
    /// let mut simulator = Simulator::new(&Camera::ideal(sensor), Seeds::default())?;
    /// let (dark, light) = (vec![0u8; 32 * 24], vec![51u8; 32 * 24]);
    /// let mut packed = vec![0; 4 * sensor.geometry.frame_bytes()];
    /// simulator.fill(Light::linear(&dark, &light, &[0.0, 0.25, 0.5, 0.75]), &mut packed)?;
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// If the call fails, the state is unchanged. Returns [`ErrorKind::Input`](crate::ErrorKind::Input) if the size of a frame
    /// differs from the sensor, if a sample is negative or not finite, or if the floats of the first readout are probably codes
    /// of 0 to 255 (see [`Light::with_any_brightness`]). Returns [`ErrorKind::Usage`](crate::ErrorKind::Usage) if
    /// * the length of `out` is not a multiple of a frame,
    /// * the number of weights differs from the number of readouts,
    /// * a weight is outside 0 to 1,
    /// * or a sequence has too few frames.
    pub fn fill<'a>(&mut self, light: impl Into<Light<'a>>, out: &mut [u8]) -> Result<()> {
        self.fill_observed(light, out, &mut |_| Ok(()))
    }

    /// Does the same as [`Simulator::fill`] and reports progress to `observe`.
    ///
    /// If the light is a sequence of frames, `observe` is called after each batch. For other light, `observe` is called
    /// once. Its argument is the number of complete readouts.
    ///
    /// # Examples
    /// ```
    /// use spikelane::light::{Interpolation, Timeline};
    /// use spikelane::{Camera, FrameRef, Light, Seeds, Sensor, Simulator};
    /// let mut simulator = Simulator::new(&Camera::ideal(Sensor::new(8, 1, 20_000.0)?), Seeds::default())?;
    /// let light = [51u8; 8];
    /// let frames = [FrameRef::new(&light); 4];
    /// let timeline = Timeline::from_readouts_per_frame(100, Interpolation::Hold)?;
    /// let (mut packed, mut done) = ([0; 400], Vec::new());
    /// simulator.fill_observed(Light::sequence(&frames, &timeline), &mut packed, &mut |readouts| {
    ///     done.push(readouts);
    ///     Ok(())
    /// })?;
    /// assert!(done.is_sorted() && done.last() == Some(&400));
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns the errors of [`Simulator::fill`]. If `observe` returns an error, `fill_observed` stops and returns this
    /// error. `out` and the state then contain all complete readouts.
    pub fn fill_observed<'a>(
        &mut self,
        light: impl Into<Light<'a>>,
        out: &mut [u8],
        observe: &mut dyn FnMut(usize) -> Result<()>,
    ) -> Result<()> {
        let readouts = self.frames_in(out)?;
        let mut light = self.valid_light(light.into(), readouts)?;
        let mut filled = self.run_light(&mut light, readouts, out, observe)?;
        let bytes = self.plan.geometry().frame_bytes();
        while filled < readouts {
            filled += self.run_segments(&[light.last()], &mut out[filled * bytes..]);
        }
        Ok(())
    }

    /// Simulates exactly `readouts` readouts of `light` and returns the number of frames written to `out`.
    ///
    /// Readouts that the camera drops are not written. The light also advances during a dropped readout.
    ///
    /// # Examples
    /// ```
    /// use spikelane::{Camera, Seeds, Sensor, Simulator, effects};
    /// let losses = effects::find("dropped_readouts")?.neutral().with_value("probability", 0.5)?;
    /// let camera = Camera::ideal(Sensor::new(8, 1, 20_000.0)?).with_effect(losses);
    /// let mut simulator = Simulator::new(&camera, Seeds::default())?;
    /// let mut packed = [0; 1000];
    /// let written = simulator.advance(&[255u8; 8], 1000, &mut packed)?;
    /// // Half of the readouts are lost, within five standard deviations of 16 readouts.
    /// assert!((420..580).contains(&written));
    /// assert_eq!(simulator.state().readout(), 1000);
    /// assert_eq!(spikelane::spikes::count_spikes(&packed), 8 * written as u64);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns the errors of [`Simulator::fill`]. `out` must have space for all `readouts` readouts.
    pub fn advance<'a>(
        &mut self,
        light: impl Into<Light<'a>>,
        readouts: usize,
        out: &mut [u8],
    ) -> Result<usize> {
        let room = self.frames_in(out)?;
        if room < readouts {
            bail!(Usage, "output buffer"; found "space for {}", Count(room, "packed frame");
                expected "space for {readouts}");
        }
        let mut light = self.valid_light(light.into(), readouts)?;
        self.run_light(&mut light, readouts, out, &mut |_| Ok(()))
    }

    /// Checks `light`. At the first readout, floats that are probably codes are an error, unless the caller accepts any
    /// brightness or the simulator was created for light above the limit of this check.
    fn valid_light<'a>(&self, light: Light<'a>, readouts: usize) -> Result<ValidLight<'a>> {
        let is_checked = !light.is_any_brightness()
            && self.state().readout() == 0
            && self.plan.max_light() <= f64::from(MAX_FLOAT_LIGHT);
        let light = ValidLight::new(light, self.plan.geometry(), readouts)?;
        if is_checked {
            light.check_codes()?;
        }
        Ok(light)
    }

    fn frames_in(&self, out: &[u8]) -> Result<usize> {
        let bytes = self.plan.geometry().frame_bytes();
        if !out.len().is_multiple_of(bytes) {
            bail!(Usage, "output buffer"; found "{}", Count(out.len(), "byte");
                expected "a multiple of {bytes}, one packed frame");
        }
        Ok(out.len() / bytes)
    }

    /// Simulates `readouts` readouts and returns the number of frames written to `out`.
    fn run_light(
        &mut self,
        light: &mut ValidLight<'_>,
        readouts: usize,
        out: &mut [u8],
        observe: &mut dyn FnMut(usize) -> Result<()>,
    ) -> Result<usize> {
        let light = match light {
            ValidLight::Hold(frame) => SegmentLight::Hold(frame.samples()),
            ValidLight::Linear { from, to, weights } => {
                SegmentLight::Linear { from: from.samples(), to: to.samples(), weights }
            }
            ValidLight::Sequence(frames) => return self.run_sequence(frames, readouts, out, observe),
        };
        let filled = self.run_segments(&[Segment { readouts, light }], out);
        observe(readouts)?;
        Ok(filled)
    }

    fn run_sequence(
        &mut self,
        frames: &mut FrameSequence<'_>,
        readouts: usize,
        out: &mut [u8],
        observe: &mut dyn FnMut(usize) -> Result<()>,
    ) -> Result<usize> {
        let bytes = self.plan.geometry().frame_bytes();
        let (mut done, mut filled) = (0, 0);
        while done < readouts {
            let pieces = frames.pieces(done, MAX_BATCH_READOUTS.min(readouts - done))?;
            let segments: Vec<Segment<'_>> = pieces.iter().map(|piece| frames.segment(piece)).collect();
            filled += self.run_segments(&segments, &mut out[filled * bytes..]);
            done += segments.iter().map(|s| s.readouts).sum::<usize>();
            observe(done)?;
        }
        Ok(filled)
    }

    /// Simulates segments of light and returns the number of frames written to `out`.
    ///
    /// This function is for callers of [`crate::unstable::kernels`] and checks nothing. The light must be valid, and
    /// `out` must have space for every readout.
    #[doc(hidden)]
    pub fn run_segments(&mut self, segments: &[Segment<'_>], out: &mut [u8]) -> usize {
        let bytes = self.plan.geometry().frame_bytes();
        // If coupled pixels are in several tiles, each tile needs the spikes of the other tiles after every readout. A
        // batch then has one readout.
        let alone = self.plan.has_coupled_pixels() && self.tile_pixels < self.plan.padded_pixels();
        let most = if alone { 1 } else { MAX_BATCH_READOUTS };
        let mut kept = 0;
        for batch in batches(segments, most) {
            threads::check_stop();
            let readouts: usize = batch.iter().map(|s| s.readouts).sum();
            let out = &mut out[kept * bytes..][..readouts * bytes];
            let frames = self.run_batch(&batch, out);
            self.meter.add(self.plan.geometry(), &out[..frames * bytes]);
            kept += frames;
        }
        kept
    }

    fn run_batch(&mut self, segments: &[Segment<'_>], out: &mut [u8]) -> usize {
        let batch = Batch::from_state(&self.plan, &self.state, segments);
        let readouts = batch.readouts();
        let (plan, backend, pixels) = (&self.plan, self.backend, self.tile_pixels);
        let tile = |(i, (part, bits)): (usize, (&mut StateTile<'_>, &mut Vec<u8>))| {
            let job = Job::new(plan, &batch, i * pixels, pixels);
            bits.resize(readouts * job.tile_bytes(), 0);
            kernels::run(backend, &job, part, bits);
        };
        let mut parts = self.state.tiles(pixels);
        // If there is a single tile without padding, the bits of the tile already are packed frames.
        if let ([part], true) =
            (&mut parts[..], plan.padded_pixels() == plan.geometry().pixels() && !plan.readout_faults().any())
        {
            kernels::run(backend, &Job::new(plan, &batch, 0, pixels), part, out);
            self.state.advance(readouts);
            return readouts;
        }
        #[cfg(feature = "threads")]
        if let Some(pool) = &self.pool {
            pool.for_each(parts.iter_mut().zip(&mut self.bits).enumerate().collect(), tile);
            if !plan.readout_faults().any() {
                let bytes = plan.geometry().frame_bytes();
                let gather = |(part, frames): (usize, &mut [u8])| {
                    for (i, frame) in frames.chunks_exact_mut(bytes).enumerate() {
                        gather_frame(&self.bits, pixels, part * READOUTS_PER_GATHER + i, plan, frame);
                    }
                };
                pool.for_each(out.chunks_mut(READOUTS_PER_GATHER * bytes).enumerate().collect(), gather);
                self.state.advance(readouts);
                return readouts;
            }
            return self.collect(readouts, out);
        }
        let all = parts.iter_mut().zip(&mut self.bits).enumerate();
        self.is_reversed = segments.len() == 1 && !self.is_reversed;
        if self.is_reversed {
            all.rev().for_each(tile);
        } else {
            all.for_each(tile);
        }
        self.collect(readouts, out)
    }

    /// Collects the bits of the tiles in packed frames and returns the number of frames. Dropped readouts are skipped.
    fn collect(&mut self, readouts: usize, out: &mut [u8]) -> usize {
        let first = self.state.readout();
        let mut frames = out.chunks_exact_mut(self.plan.geometry().frame_bytes());
        let (mut kept, mut scratch) = (0, Vec::new());
        for (t, readout) in (first..).enumerate().take(readouts) {
            let dropped = self.plan.is_dropped(readout);
            let frame = if dropped {
                scratch.resize(self.plan.geometry().frame_bytes(), 0);
                &mut scratch[..]
            } else {
                kept += 1;
                frames.next().unwrap_or_default()
            };
            gather_frame(&self.bits, self.tile_pixels, t, &self.plan, frame);
            self.state.record_or_repeat(self.plan.is_repeated(readout), frame);
        }
        self.state.advance(readouts);
        kept
    }
}
