//! Kernels that write to memory: every backend, every noise set.

use std::time::Duration;

use spikelane::spikes::count;
use spikelane::unstable::kernels::{self, Batch, Job, Light, Samples, Segment};
use spikelane::{Backend, Plan, Result, Seeds, Simulator};
use spikelane_io::simulate::FrameRef;

use super::cameras::{Noise, frames};
use super::report::Row;
use super::timing::rate;

/// Readouts of a batch, and pixels of a tile, as the simulator has them.
const BATCH: usize = 128;
const TILE: usize = 4096;

/// How light comes.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Lit {
    /// One frame for all readouts.
    Held,
    /// A frame of its own at every readout.
    New,
    /// In even steps from one frame to the next.
    Between,
}

impl Lit {
    pub(crate) const ALL: [Self; 3] = [Self::Held, Self::New, Self::Between];

    const fn name(self) -> &'static str {
        match self {
            Self::Held => "held",
            Self::New => "new frame",
            Self::Between => "between frames",
        }
    }
}

/// One thread, from the kernel's own door.
pub(crate) fn kernel(
    backend: Backend,
    noise: Noise,
    frames: &[Vec<u8>],
    lit: Lit,
    budget: Duration,
) -> Result<Row> {
    let plan = Plan::new(&noise.camera()?, Seeds::default())?;
    let mut state = plan.start();
    let mut out = vec![0; BATCH * TILE / 8];
    let (readouts, pixels) = (frames.len(), plan.geometry().pixels());
    let weights: Vec<f32> = (0..BATCH).map(|t| t as f32 / BATCH as f32).collect();
    let long = |light| (0..readouts / BATCH).map(move |_| Segment { readouts: BATCH, light }).collect();
    let segments: Vec<Segment<'_>> = match lit {
        Lit::Held => long(Light::Held(Samples::U8(&frames[0]))),
        Lit::New => {
            frames.iter().map(|f| Segment { readouts: 1, light: Light::Held(Samples::U8(f)) }).collect()
        }
        Lit::Between => {
            let [from, to] = [&frames[0], &frames[readouts - 1]].map(|f| Samples::U8(f));
            long(Light::Between { from, to, weights: &weights })
        }
    };
    let per_batch = if lit == Lit::New { BATCH } else { 1 };
    let mut first = 0;
    let speed = rate(budget, (readouts * pixels) as f64, || {
        for segments in segments.chunks(per_batch) {
            let batch = Batch::new(&plan, first, segments);
            first += batch.readouts() as u64;
            for (i, part) in state.tiles(TILE).iter_mut().enumerate() {
                let job = Job::new(&plan, &batch, i * TILE, TILE);
                kernels::run(backend, &job, part, &mut out[..BATCH * job.tile_bytes()]);
            }
        }
    });
    Ok(Row::new("kernel", backend.name(), noise.name(), lit.name(), 1, speed))
}

/// Whole packed frames in memory, by the simulator, on `threads` threads.
pub(crate) fn simulator(noise: Noise, threads: usize, budget: Duration) -> Result<Row> {
    let mut simulator = Simulator::new(&noise.camera()?, Seeds::default())?.with_threads(threads)?;
    let geometry = simulator.plan().geometry();
    let light = frames(noise, 1);
    let mut packed = vec![0; 2 * BATCH * geometry.frame_bytes()];
    let mut failed = None;
    let work = (2 * BATCH * geometry.pixels()) as f64;
    let speed = rate(budget, work, || {
        let pushed = simulator.push(FrameRef::u8(&light[0], geometry), &mut packed);
        failed = pushed.err().or(failed.take());
    });
    std::hint::black_box(count(&packed));
    let backend = simulator.backend().name();
    failed.map_or(Ok(()), Err)?;
    Ok(Row::new("frames in memory", backend, noise.name(), "held", threads, speed))
}

/// The plain loop.
pub(crate) fn scalar(budget: Duration) -> Row {
    let light = frames(Noise::Full, 1);
    let mut plain = super::scalar::Loop::new(light[0].len());
    let mut packed = vec![0; light[0].len().div_ceil(8)];
    let speed = rate(budget, light[0].len() as f64, || plain.readout(&light[0], &mut packed));
    std::hint::black_box(count(&packed));
    Row::new("plain f32 loop", "scalar", Noise::Full.name(), "held", 1, speed)
}
