//! Benchmarks driving scenes: the time to render a keyframe and its labels, compared with a path tracer.

use std::time::Duration;

use serde::Serialize;
use serde_json::{Value, json};
use spikelane::Result;
use spikelane::spikes::Geometry;
use spikelane_io::simulate::ImageFormat;
use spikelane_scene::{Lighting, SamplesPerPixel, Scene, SceneOptions, Warp};

use super::timing::best_rate;

/// Milliseconds per 400x250 frame of Blender Cycles on a comparable CPU, with the 64 samples per pixel of SPCS. A
/// frame takes 32 to 36 s.
const BLENDER_FRAME_MS: f64 = 34_000.0;

/// The time to render one row of the table.
#[derive(Serialize)]
pub(crate) struct RenderTime {
    pub name: String,
    /// Number of threads. It is zero for times that were not measured here.
    pub threads: usize,
    pub ms: f64,
}

impl RenderTime {
    fn from_benchmark(what: String, threads: usize, budget: Duration, run: impl FnMut()) -> Self {
        Self { name: what, threads, ms: 1e3 / best_rate(budget, 1.0, run) }
    }
}

/// The lightings for which stages are measured.
pub(crate) const STAGE_LIGHTINGS: [Lighting; 3] = [Lighting::Noon, Lighting::Overcast, Lighting::Night];

/// The time of one stage of rendering a keyframe, or of a step after rendering.
pub(crate) struct RenderStage {
    pub name: &'static str,
    /// Time in milliseconds for each of [`STAGE_LIGHTINGS`].
    pub ms: [f64; 3],
}

impl RenderStage {
    pub(crate) fn json(&self) -> Value {
        let ms: serde_json::Map<_, _> =
            STAGE_LIGHTINGS.iter().zip(self.ms).map(|(l, ms)| (l.name().to_owned(), json!(ms))).collect();
        json!({"name": self.name, "ms": ms})
    }
}

/// Benchmarks each stage of rendering at 1 s in the drive with seed 1. Uses one thread and 2x2 samples.
pub(crate) fn benchmark_stages(budget: Duration) -> Result<Vec<RenderStage>> {
    let mut all: Vec<RenderStage> = Vec::new();
    for (i, lighting) in STAGE_LIGHTINGS.into_iter().enumerate() {
        let options = SceneOptions { lighting: Some(lighting), ..SceneOptions::default() };
        let scene = Scene::from_seed(1, &options)?;
        let mut list: Vec<(&str, f64)> =
            scene.stage_times(1.0, &mut |run| 1e3 / best_rate(budget / 4, 1.0, run)).into();
        list.extend(post_render_times(&scene, budget / 4)?);
        for (k, (what, ms)) in list.into_iter().enumerate() {
            if i == 0 {
                all.push(RenderStage { name: what, ms: [0.0; 3] });
            }
            all[k].ms[i] = ms;
        }
    }
    Ok(all)
}

/// Benchmarks the steps after rendering: warping light, computing labels, and encoding images.
fn post_render_times(scene: &Scene, budget: Duration) -> Result<[(&'static str, f64); 4]> {
    let (a, b) =
        (scene.render(1.0, SamplesPerPixel::Four, 1)?, scene.render(1.0005, SamplesPerPixel::Four, 1)?);
    let warp = Warp::new(scene, &a, &b)?;
    let white = scene.white_cd_m2(1.0, 1)?;
    let light: Vec<f32> = a.light.iter().map(|l| l / white).collect();
    let size = Geometry::new(a.labels.width as u32, a.labels.height as u32)?;
    let ms = |run: &mut dyn FnMut() -> bool| {
        1e3 / best_rate(budget, 1.0, || {
            std::hint::black_box(run());
        })
    };
    Ok([
        ("light carried from two renders", ms(&mut || warp.light(1.0002).is_ok())),
        ("flow and occlusion, one direction", ms(&mut || scene.flow(&a.labels, &b.labels, 1).is_ok())),
        ("boxes", ms(&mut || scene.boxes(&a.labels).is_ok())),
        ("PNG of a reference image", ms(&mut || ImageFormat::U8.encode(&light, size).is_ok())),
    ])
}

/// Benchmarks 400x250 frames of one scene by day and by night. The frames show the scene at 1 s.
pub(crate) fn benchmark_scenes(threads: usize, budget: Duration) -> Result<Vec<RenderTime>> {
    let blender = "Blender Cycles, 64 samples per pixel as in SPCS".to_owned();
    let mut rows = vec![RenderTime { name: blender, threads: 0, ms: BLENDER_FRAME_MS }];
    for lighting in [Lighting::Noon, Lighting::Night] {
        let options = SceneOptions { lighting: Some(lighting), ..SceneOptions::default() };
        let scene = Scene::from_seed(1, &options)?;
        let what = format!("key frame and labels, {}, 2x2 samples", lighting.name());
        rows.push(RenderTime::from_benchmark(what, threads, budget, || {
            std::hint::black_box(scene.render(1.0, SamplesPerPixel::Four, threads).is_ok());
        }));
        if lighting == Lighting::Noon {
            rows.extend(label_times(&scene, threads, budget)?);
        }
    }
    Ok(rows)
}

/// Benchmarks other work for a readout or a labeled image.
fn label_times(scene: &Scene, threads: usize, budget: Duration) -> Result<Vec<RenderTime>> {
    let (a, b) = (
        scene.render(1.0, SamplesPerPixel::Four, threads)?,
        scene.render(1.0005, SamplesPerPixel::Four, threads)?,
    );
    let row = |what: &str, threads, run: &mut dyn FnMut() -> bool| {
        RenderTime::from_benchmark(what.to_owned(), threads, budget, || {
            std::hint::black_box(run());
        })
    };
    Ok(vec![
        row("optical flow to another instant", threads, &mut || {
            scene.flow(&a.labels, &b.labels, threads).is_ok()
        }),
        row("boxes of all vehicles", 1, &mut || scene.boxes(&a.labels).is_ok()),
    ])
}
