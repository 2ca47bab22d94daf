use crate::draws::Seeds;
use crate::effects::Camera;
use crate::error::{Error, Kind, Result};
use crate::kernels::{self, Backend, Batch, Job, Light, Segment};
use crate::plan::{OTHER_PLAN, Plan, State, StateParts};
use crate::simulate::FrameRef;
use crate::simulate::segments::{batches, between, split};
use crate::simulate::tiles::{gather, tile_of};
use crate::threads;
#[cfg(feature = "threads")]
use crate::threads::Pool;

/// Readouts of a batch: long enough that loading a vector's tables costs
/// nothing, short enough that a tile's bits stay in cache.
pub(super) const BATCH: usize = 128;

/// Readouts that one thread collects at a time.
#[cfg(feature = "threads")]
const GATHERED: usize = 8;

/// A camera at work: push light, receive packed readouts.
///
/// The state is the camera's only memory. It can be cloned with the
/// simulator, saved with [`State::to_bytes`] and put back at any readout.
#[derive(Clone, Debug)]
pub struct Simulator {
    plan: Plan,
    state: State,
    backend: Backend,
    /// Pixels of a tile.
    tile: usize,
    bits: Vec<Vec<u8>>,
    /// Whether the last batch went through the tiles backwards. Every second one of a single frame does: it finds in the caches
    /// what the batch before it used last.
    turned: bool,
    #[cfg(feature = "threads")]
    pool: Option<Pool>,
}

impl Simulator {
    /// The camera before its first readout, on the fastest backend of this CPU, with one thread.
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
    /// See [`Plan::new`].
    pub fn new(camera: &Camera, seeds: Seeds) -> Result<Self> {
        Ok(Self::of_plan(Plan::new(camera, seeds)?))
    }

    /// A plan before its first readout.
    #[must_use]
    pub fn of_plan(plan: Plan) -> Self {
        let tile = tile_of(&plan, 1);
        Self {
            state: kernels::start(&plan),
            backend: Backend::best(),
            bits: vec![Vec::new(); plan.padded().div_ceil(tile)],
            turned: false,
            tile,
            plan,
            #[cfg(feature = "threads")]
            pool: None,
        }
    }

    /// This simulator on another backend; the bits stay the same.
    ///
    /// # Errors
    /// When this CPU lacks it.
    pub fn with_backend(mut self, backend: Backend) -> Result<Self> {
        if !backend.available() {
            return Err(Error::new(Kind::Usage, "backend")
                .found(backend)
                .expected("one that this CPU has")
                .remedy("use auto"));
        }
        self.backend = backend;
        Ok(self)
    }

    /// This simulator on `threads` threads of its own; the bits stay the same.
    ///
    /// # Errors
    /// When the system gives no threads.
    #[cfg(feature = "threads")]
    pub fn with_threads(self, threads: usize) -> Result<Self> {
        Ok(self.with_pool(&Pool::new(threads)?))
    }

    /// This simulator on the threads of `pool`, which others may share; the bits stay the same.
    #[cfg(feature = "threads")]
    #[must_use]
    pub fn with_pool(mut self, pool: &Pool) -> Self {
        self.tile = tile_of(&self.plan, pool.threads());
        self.bits.resize(self.plan.padded().div_ceil(self.tile), Vec::new());
        self.pool = (pool.threads() > 1).then(|| pool.clone());
        self
    }

    /// Starts anew as another recording of the same camera: the simulator of
    /// [`Plan::with_seeds`], which keeps its tables, backend and threads.
    ///
    /// # Examples
    /// ```
    /// # use spikelane::{Camera, Seeds, Sensor, Simulator, simulate::FrameRef};
    /// # let sensor = Sensor::new(32, 24, 20_000.0)?;
    /// # let (geometry, light) = (sensor.geometry, vec![51u8; 32 * 24]);
    /// let mut simulator = Simulator::new(&Camera::ideal(sensor), Seeds::default())?;
    /// let (mut first, mut again) = (vec![0; 96], vec![0; 96]);
    /// simulator.push(FrameRef::u8(&light, geometry), &mut first)?;
    /// simulator.restart(Seeds::default())?;
    /// simulator.push(FrameRef::u8(&light, geometry), &mut again)?;
    /// assert_eq!(first, again);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// When `seeds.camera` is another than the plan's.
    pub fn restart(&mut self, seeds: Seeds) -> Result<()> {
        self.plan.reseed(seeds)?;
        self.state = kernels::start(&self.plan);
        Ok(())
    }

    /// The plan.
    #[must_use]
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// The backend.
    #[must_use]
    pub fn backend(&self) -> Backend {
        self.backend
    }

    /// The state after the last readout.
    #[must_use]
    pub fn state(&self) -> &State {
        &self.state
    }

    /// Continues from `state`, for instance one read by [`State::from_bytes`]
    /// with [`Plan::start`] as its pattern.
    ///
    /// # Examples
    /// ```
    /// # use spikelane::{Camera, Seeds, Sensor, Simulator, simulate::FrameRef};
    /// # let sensor = Sensor::new(32, 24, 20_000.0)?;
    /// # let (geometry, light) = (sensor.geometry, vec![51u8; 32 * 24]);
    /// let mut simulator = Simulator::new(&Camera::ideal(sensor), Seeds::default())?;
    /// let (mut first, mut again) = (vec![0; 96], vec![0; 96]);
    /// let before = simulator.state().clone();
    /// simulator.push(FrameRef::u8(&light, geometry), &mut first)?;
    /// simulator.resume(before)?;
    /// simulator.push(FrameRef::u8(&light, geometry), &mut again)?;
    /// assert_eq!(first, again);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// When the state belongs to another plan, or holds what no run leaves behind.
    pub fn resume(&mut self, state: State) -> Result<()> {
        if !state.fits(&self.state) {
            return Err(State::foreign(OTHER_PLAN));
        }
        if let Some(found) = state.fault(&self.plan) {
            return Err(State::foreign(found));
        }
        self.state = state;
        Ok(())
    }

    /// Holds `frame` for as many readouts as `out` has packed frames
    /// ([`crate::Geometry::frame_bytes`] each, whatever they held before).
    /// A camera that drops readouts holds it until `out` is full; to let the
    /// scene go on instead see [`Simulator::expose`].
    ///
    /// # Examples
    /// ```
    /// # use spikelane::{Camera, Seeds, Sensor, Simulator, simulate::FrameRef};
    /// # let sensor = Sensor::new(32, 24, 20_000.0)?;
    /// # let (geometry, light) = (sensor.geometry, vec![51u8; 32 * 24]);
    /// let mut simulator = Simulator::new(&Camera::ideal(sensor), Seeds::default())?;
    /// // Five readouts of a fifth of full scale: every pixel fires once.
    /// let mut packed = vec![0; 5 * geometry.frame_bytes()];
    /// simulator.push(FrameRef::u8(&light, geometry), &mut packed)?;
    /// assert_eq!(spikelane::spikes::count(&packed), 32 * 24);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// When the frame has another size than the sensor, holds light that is
    /// negative or not a number, or `out` is no whole number of frames.
    pub fn push(&mut self, frame: FrameRef<'_>, out: &mut [u8]) -> Result<()> {
        let dense = frame.checked(self.plan.geometry())?;
        let readouts = self.readouts(out)?;
        let light = Light::Held(dense.samples());
        self.fill(Segment { readouts, light }, out);
        Ok(())
    }

    /// Holds `frame` for `readouts` readouts and returns how many frames of `out` they filled: all
    /// but those that the camera dropped.
    ///
    /// # Errors
    /// See [`Simulator::push`]; `out` must have room for every readout.
    pub fn expose(&mut self, frame: FrameRef<'_>, readouts: usize, out: &mut [u8]) -> Result<usize> {
        let dense = frame.checked(self.plan.geometry())?;
        self.has_room(readouts, out)?;
        let light = Light::Held(dense.samples());
        Ok(self.run(&[Segment { readouts, light }], out))
    }

    /// Goes from one frame to the next: readout `i` sees
    /// `from + (to - from) * weights[i]`, and `out` has a packed frame for each weight.
    /// A camera that drops readouts holds the last light until `out` is full; to let the
    /// scene go on instead see [`Simulator::expose_between`].
    ///
    /// # Examples
    /// ```
    /// # use spikelane::{Camera, Seeds, Sensor, Simulator, simulate::FrameRef};
    /// # let sensor = Sensor::new(32, 24, 20_000.0)?;
    /// # let (geometry, light) = (sensor.geometry, vec![51u8; 32 * 24]);
    /// let mut simulator = Simulator::new(&Camera::ideal(sensor), Seeds::default())?;
    /// let dark = vec![0u8; light.len()];
    /// let (from, to) = (FrameRef::u8(&dark, geometry), FrameRef::u8(&light, geometry));
    /// let mut packed = vec![0; 4 * geometry.frame_bytes()];
    /// simulator.push_between(from, to, &[0.0, 0.25, 0.5, 0.75], &mut packed)?;
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// See [`Simulator::push`]; weights must lie within 0 to 1.
    pub fn push_between(
        &mut self,
        from: FrameRef<'_>,
        to: FrameRef<'_>,
        weights: &[f32],
        out: &mut [u8],
    ) -> Result<()> {
        self.on_the_way(from, to, weights, |simulator, segment| {
            if simulator.readouts(out)? != weights.len() {
                return Err(Error::new(Kind::Usage, "weights")
                    .found(format_args!("{} weights", weights.len()))
                    .expected("one for every packed frame of the output"));
            }
            simulator.fill(segment, out);
            Ok(())
        })
    }

    /// As [`Simulator::push_between`], but returns how many frames of `out` the readouts filled: all
    /// but those that the camera dropped.
    ///
    /// # Errors
    /// See [`Simulator::push_between`]; `out` must have room for every readout.
    pub fn expose_between(
        &mut self,
        from: FrameRef<'_>,
        to: FrameRef<'_>,
        weights: &[f32],
        out: &mut [u8],
    ) -> Result<usize> {
        self.on_the_way(from, to, weights, |simulator, segment| {
            simulator.has_room(weights.len(), out)?;
            Ok(simulator.run(&[segment], out))
        })
    }

    /// Does `work` with the segment of a way between two frames, once these are checked.
    fn on_the_way<T>(
        &mut self,
        from: FrameRef<'_>,
        to: FrameRef<'_>,
        weights: &[f32],
        work: impl FnOnce(&mut Self, Segment<'_>) -> Result<T>,
    ) -> Result<T> {
        let geometry = self.plan.geometry();
        let (from, to) = (from.checked(geometry)?, to.checked(geometry)?);
        work(self, between(&from, &to, weights)?)
    }

    pub(super) fn has_room(&self, readouts: usize, out: &[u8]) -> Result<()> {
        let room = self.readouts(out)?;
        if room < readouts {
            return Err(Error::new(Kind::Usage, "output buffer")
                .found(format_args!("room for {room} packed frames"))
                .expected(format_args!("room for {readouts}")));
        }
        Ok(())
    }

    pub(super) fn readouts(&self, out: &[u8]) -> Result<usize> {
        let bytes = self.plan.geometry().frame_bytes();
        if !out.len().is_multiple_of(bytes) {
            return Err(Error::new(Kind::Usage, "output buffer")
                .found(format_args!("{} bytes", out.len()))
                .expected(format_args!("a multiple of {bytes}, one packed frame")));
        }
        Ok(out.len() / bytes)
    }

    /// Runs a segment, and holds its last light until `out` is full.
    fn fill(&mut self, segment: Segment<'_>, out: &mut [u8]) {
        let bytes = self.plan.geometry().frame_bytes();
        let mut filled = self.run(&[segment], out);
        let last = split(segment, segment.readouts.saturating_sub(1)).1;
        while filled * bytes < out.len() {
            filled += self.run(&[last], &mut out[filled * bytes..]);
        }
    }

    /// Runs whole segments, cut into batches, and returns how many frames were kept; the light
    /// has been checked, and `out` has room for every readout.
    pub fn run(&mut self, segments: &[Segment<'_>], out: &mut [u8]) -> usize {
        let bytes = self.plan.geometry().frame_bytes();
        let alone = self.plan.couples() && self.tile < self.plan.padded();
        let most = if alone { 1 } else { BATCH };
        let mut kept = 0;
        for batch in batches(segments, most) {
            threads::check();
            let readouts: usize = batch.iter().map(|s| s.readouts).sum();
            kept += self.run_batch(&batch, &mut out[kept * bytes..][..readouts * bytes]);
        }
        kept
    }

    fn run_batch(&mut self, segments: &[Segment<'_>], out: &mut [u8]) -> usize {
        let batch = Batch::after(&self.plan, &self.state, segments);
        let readouts = batch.readouts();
        let (plan, backend, pixels) = (&self.plan, self.backend, self.tile);
        let tile = |(i, (part, bits)): (usize, (&mut StateParts<'_>, &mut Vec<u8>))| {
            let job = Job::new(plan, &batch, i * pixels, pixels);
            bits.resize(readouts * job.tile_bytes(), 0);
            kernels::run(backend, &job, part, bits);
        };
        let mut parts = self.state.tiles(pixels);
        // The bits of a single tile without padding are frames already.
        if let ([part], true) =
            (&mut parts[..], plan.padded() == plan.geometry().pixels() && !plan.losses().any())
        {
            kernels::run(backend, &Job::new(plan, &batch, 0, pixels), part, out);
            self.state.advance(readouts);
            return readouts;
        }
        #[cfg(feature = "threads")]
        if let Some(pool) = &self.pool {
            pool.for_each(parts.iter_mut().zip(&mut self.bits).enumerate().collect(), tile);
            if !plan.losses().any() {
                let bytes = plan.geometry().frame_bytes();
                let gather = |(part, frames): (usize, &mut [u8])| {
                    for (i, frame) in frames.chunks_exact_mut(bytes).enumerate() {
                        gather(&self.bits, pixels, part * GATHERED + i, plan, frame);
                    }
                };
                pool.for_each(out.chunks_mut(GATHERED * bytes).enumerate().collect(), gather);
                self.state.advance(readouts);
                return readouts;
            }
            return self.collect(readouts, out);
        }
        let all = parts.iter_mut().zip(&mut self.bits).enumerate();
        self.turned = segments.len() == 1 && !self.turned;
        if self.turned {
            all.rev().for_each(tile);
        } else {
            all.for_each(tile);
        }
        self.collect(readouts, out)
    }

    /// Collects the tiles' bits into packed frames, without the readouts that are lost; returns how many.
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
            gather(&self.bits, self.tile, t, &self.plan, frame);
            self.state.repeat(self.plan.is_repeated(readout), frame);
        }
        self.state.advance(readouts);
        kept
    }
}
