use crate::draws::Seeds;
use crate::effects::Camera;
use crate::error::Result;
use crate::kernels::Backend;
use crate::plan::Plan;
#[cfg(feature = "threads")]
use crate::simulate::Pool;
use crate::simulate::Simulator;

/// Options of a [`Simulator`]. Only the seeds and the maximum light affect the simulated bits.
///
/// # Examples
/// ```
/// use spikelane::{Camera, Seeds, Sensor, SimulatorOptions};
/// let camera = Camera::ideal(Sensor::new(32, 24, 20_000.0)?);
/// let options = SimulatorOptions::new().seeds(Seeds { camera: 1, shot: 2, sequence: 3 }).max_light(2.0);
/// let mut simulator = options.build(&camera)?;
/// // Light of 1.5 full scales stays 1.5: the pixels fire at every readout.
/// let spikes = simulator.run(&[1.5f32; 32 * 24], 8)?;
/// assert_eq!(spikes.spikes(), 8 * 32 * 24);
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct SimulatorOptions {
    seeds: Seeds,
    max_light: f64,
    backend: Backend,
    #[cfg(feature = "threads")]
    threads: Threads,
}

#[cfg(feature = "threads")]
#[derive(Clone, Debug)]
enum Threads {
    Own(usize),
    Shared(Pool),
}

impl Default for SimulatorOptions {
    fn default() -> Self {
        Self::new()
    }
}

impl SimulatorOptions {
    /// Returns the default options: all seeds are 0, the maximum light is full scale, the backend is the fastest of
    /// this CPU, and one thread is used.
    ///
    /// # Examples
    /// ```
    /// use spikelane::{Backend, Camera, Seeds, Sensor, SimulatorOptions};
    /// let simulator = SimulatorOptions::new().build(&Camera::ideal(Sensor::new(32, 24, 20_000.0)?))?;
    /// assert_eq!(simulator.plan().seeds(), Seeds::default());
    /// assert_eq!((simulator.plan().max_light(), simulator.backend()), (1.0, Backend::best()));
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    #[must_use]
    pub fn new() -> Self {
        Self {
            seeds: Seeds::default(),
            max_light: 1.0,
            backend: Backend::best(),
            #[cfg(feature = "threads")]
            threads: Threads::Own(1),
        }
    }

    /// Sets the seeds of the camera's fixed pattern, of the noise and of this recording.
    #[must_use]
    pub fn seeds(mut self, seeds: Seeds) -> Self {
        self.seeds = seeds;
        self
    }

    /// Sets the maximum light of samples, in full scales. Brighter light is clamped to the maximum. The default is 1.
    ///
    /// A larger maximum makes the steps of the fixed-point arithmetic coarser.
    #[must_use]
    pub fn max_light(mut self, max_light: f64) -> Self {
        self.max_light = max_light;
        self
    }

    /// Sets the instruction set of the kernels. The default is [`Backend::best`].
    #[must_use]
    pub fn backend(mut self, backend: Backend) -> Self {
        self.backend = backend;
        self
    }

    /// Sets the number of threads of the simulator, at least 1. With the default 1, the calling thread does all work.
    ///
    /// # Examples
    /// ```
    /// use spikelane::{Camera, Sensor, SimulatorOptions};
    /// let camera = Camera::ideal(Sensor::new(128, 96, 20_000.0)?);
    /// let record = |threads| SimulatorOptions::new().threads(threads).build(&camera)?.run(&[40u8; 128 * 96], 20);
    /// // The bits do not depend on the number of threads.
    /// assert_eq!(record(2)?, record(1)?);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    #[cfg(feature = "threads")]
    #[must_use]
    pub fn threads(mut self, threads: usize) -> Self {
        self.threads = Threads::Own(threads);
        self
    }

    /// Makes the simulator run on the threads of `pool` instead of starting threads. Several simulators may share a pool.
    #[cfg(feature = "threads")]
    #[must_use]
    pub fn pool(mut self, pool: &Pool) -> Self {
        self.threads = Threads::Shared(pool.clone());
        self
    }

    /// Returns a simulator of `camera` before its first readout.
    ///
    /// # Errors
    /// Returns the errors of [`Plan::with_max_light`]. Returns [`crate::ErrorKind::Usage`] if this CPU cannot run the
    /// backend. Returns [`crate::ErrorKind::Io`] if the operating system does not start threads.
    pub fn build(&self, camera: &Camera) -> Result<Simulator> {
        self.build_from_plan(Plan::with_max_light(camera, self.seeds, self.max_light)?)
    }

    /// Returns a simulator of `plan` before its first readout. The plan determines the seeds and the maximum light.
    ///
    /// # Examples
    /// ```
    /// use spikelane::{Backend, Camera, Plan, Seeds, Sensor, SimulatorOptions};
    /// let plan = Plan::new(&Camera::ideal(Sensor::new(8, 1, 20_000.0)?), Seeds::default())?;
    /// let simulator = SimulatorOptions::new().backend(Backend::Portable).build_from_plan(plan)?;
    /// assert_eq!(simulator.backend(), Backend::Portable);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns the errors of [`SimulatorOptions::build`] that concern the backend and the threads.
    pub fn build_from_plan(&self, plan: Plan) -> Result<Simulator> {
        let mut simulator = Simulator::from_plan(plan);
        simulator.set_backend(self.backend)?;
        #[cfg(feature = "threads")]
        match &self.threads {
            Threads::Own(1) => {}
            Threads::Own(threads) => simulator.set_pool(&Pool::new(*threads)?),
            Threads::Shared(pool) => simulator.set_pool(pool),
        }
        Ok(simulator)
    }
}
