//! Benchmarks kernels and the simulator for every backend and noise set. The spikes are written to memory, not to a
//! file.

use spikelane::SimulatorOptions;
use std::time::Duration;

use spikelane::spikes::count_spikes;
use spikelane::unstable::kernels::{self, Batch, Job, Samples, Segment, SegmentLight};
use spikelane::{Backend, Plan, Result, Seeds};
use spikelane_io::simulate::FrameRef;

use super::cameras::{NoiseSet, test_frames};
use super::report::{KERNEL_WORK, SpeedRow};
use super::timing::best_rate;

/// Number of readouts per batch and number of pixels per tile. The simulator uses the same numbers.
const BATCH_READOUTS: usize = 128;
const TILE_PIXELS: usize = 4096;

/// How the light changes.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum LightMode {
    /// One frame lasts for all readouts.
    Static,
    /// A new frame at every readout.
    FrameEveryReadout,
    /// The light is interpolated in equal steps between two frames.
    Interpolated,
}

impl LightMode {
    pub(crate) const ALL: [Self; 3] = [Self::Static, Self::FrameEveryReadout, Self::Interpolated];

    const fn name(self) -> &'static str {
        match self {
            Self::Static => "held",
            Self::FrameEveryReadout => "new frame",
            Self::Interpolated => "between frames",
        }
    }
}

/// Benchmarks a kernel on one thread, without the simulator.
pub(crate) fn benchmark_kernel(
    backend: Backend,
    noise: NoiseSet,
    frames: &[Vec<u8>],
    lit: LightMode,
    budget: Duration,
) -> Result<SpeedRow> {
    let plan = Plan::new(&noise.camera()?, Seeds::default())?;
    let mut state = plan.initial_state();
    let mut out = vec![0; BATCH_READOUTS * TILE_PIXELS / 8];
    let (readouts, pixels) = (frames.len(), plan.geometry().pixels());
    let weights: Vec<f32> = (0..BATCH_READOUTS).map(|t| t as f32 / BATCH_READOUTS as f32).collect();
    let long = |light| {
        (0..readouts / BATCH_READOUTS).map(move |_| Segment { readouts: BATCH_READOUTS, light }).collect()
    };
    let segments: Vec<Segment<'_>> = match lit {
        LightMode::Static => long(SegmentLight::Hold(Samples::U8(&frames[0]))),
        LightMode::FrameEveryReadout => frames
            .iter()
            .map(|f| Segment { readouts: 1, light: SegmentLight::Hold(Samples::U8(f)) })
            .collect(),
        LightMode::Interpolated => {
            let [from, to] = [&frames[0], &frames[readouts - 1]].map(|f| Samples::U8(f));
            long(SegmentLight::Linear { from, to, weights: &weights })
        }
    };
    let per_batch = if lit == LightMode::FrameEveryReadout { BATCH_READOUTS } else { 1 };
    let mut first = 0;
    let speed = best_rate(budget, (readouts * pixels) as f64, || {
        for segments in segments.chunks(per_batch) {
            let batch = Batch::new(&plan, first, segments);
            first += batch.readouts() as u64;
            for (i, part) in state.tiles(TILE_PIXELS).iter_mut().enumerate() {
                let job = Job::new(&plan, &batch, i * TILE_PIXELS, TILE_PIXELS);
                kernels::run(backend, &job, part, &mut out[..BATCH_READOUTS * job.tile_bytes()]);
            }
        }
    });
    Ok(SpeedRow::new(KERNEL_WORK, backend.name(), noise.name(), lit.name(), 1, speed))
}

/// Benchmarks the simulator on `threads` threads. It writes whole packed frames to memory.
pub(crate) fn benchmark_simulator(noise: NoiseSet, threads: usize, budget: Duration) -> Result<SpeedRow> {
    let mut simulator =
        SimulatorOptions::new().seeds(Seeds::default()).threads(threads).build(&noise.camera()?)?;
    let geometry = simulator.plan().geometry();
    let light = test_frames(noise, 1);
    let mut packed = vec![0; 2 * BATCH_READOUTS * geometry.frame_bytes()];
    let mut failed = None;
    let work = (2 * BATCH_READOUTS * geometry.pixels()) as f64;
    let speed = best_rate(budget, work, || {
        let pushed = simulator.fill(FrameRef::new(&light[0]), &mut packed);
        failed = pushed.err().or(failed.take());
    });
    std::hint::black_box(count_spikes(&packed));
    let backend = simulator.backend().name();
    failed.map_or(Ok(()), Err)?;
    Ok(SpeedRow::new("frames in memory", backend, noise.name(), "held", threads, speed))
}

/// Benchmarks the scalar loop.
pub(crate) fn benchmark_scalar(budget: Duration) -> SpeedRow {
    let light = test_frames(NoiseSet::AllNoise, 1);
    let mut scalar_camera = super::scalar::ScalarCamera::new(light[0].len());
    let mut packed = vec![0; light[0].len().div_ceil(8)];
    let speed = best_rate(budget, light[0].len() as f64, || scalar_camera.readout(&light[0], &mut packed));
    std::hint::black_box(count_spikes(&packed));
    SpeedRow::new("plain f32 loop", "scalar", NoiseSet::AllNoise.name(), "held", 1, speed)
}
