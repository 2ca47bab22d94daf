//! Driving scenes: what a key frame and its labels cost, beside a path tracer.

use std::time::Duration;

use serde_json::{Value, json};
use spikelane::Result;
use spikelane::spikes::Geometry;
use spikelane_io::simulate::ImageForm;
use spikelane_scene::{Lighting, SamplesPerPixel, Scene, SceneOptions, Warp};

use super::timing::rate;

/// Milliseconds of a 400x250 frame of Blender Cycles on a CPU like that of the first measurements, with
/// the samples of a pixel that SPCS publishes (64: 32 to 36 s) and with an eighth of them.
const BLENDER: [(&str, f64); 2] =
    [("Blender, 64 samples (SPCS's setting)", 34_000.0), ("Blender, 8 samples", 2_800.0)];

/// Something drawn.
pub(crate) struct Drawn {
    pub what: String,
    /// Zero for figures that were not measured here.
    pub threads: usize,
    pub ms: f64,
}

impl Drawn {
    fn measured(what: String, threads: usize, budget: Duration, run: impl FnMut()) -> Self {
        Self { what, threads, ms: 1e3 / rate(budget, 1.0, run) }
    }

    pub(crate) fn json(&self) -> Value {
        json!({"what": self.what, "threads": self.threads, "ms": self.ms})
    }
}

/// The lights under which stages are told apart.
pub(crate) const STAGED: [Lighting; 3] = [Lighting::Noon, Lighting::Overcast, Lighting::Night];

/// One stage of a key frame, or of what follows one.
pub(crate) struct Stage {
    pub what: &'static str,
    /// Under each light of [`STAGED`].
    pub ms: [f64; 3],
}

impl Stage {
    pub(crate) fn json(&self) -> Value {
        let ms: serde_json::Map<_, _> =
            STAGED.iter().zip(self.ms).map(|(l, ms)| (l.name().to_owned(), json!(ms))).collect();
        json!({"what": self.what, "ms": ms})
    }
}

/// What each stage takes at 1 s of the drive of seed 1, one thread, 2x2 samples.
pub(crate) fn stages(budget: Duration) -> Result<Vec<Stage>> {
    let mut all: Vec<Stage> = Vec::new();
    for (i, lighting) in STAGED.into_iter().enumerate() {
        let options = SceneOptions { lighting: Some(lighting), ..SceneOptions::default() };
        let scene = Scene::random(1, &options)?;
        let mut list: Vec<(&str, f64)> =
            scene.stages(1.0, &mut |run| 1e3 / rate(budget / 4, 1.0, run)).into();
        list.extend(after(&scene, budget / 4)?);
        for (k, (what, ms)) in list.into_iter().enumerate() {
            if i == 0 {
                all.push(Stage { what, ms: [0.0; 3] });
            }
            all[k].ms[i] = ms;
        }
    }
    Ok(all)
}

/// What follows renders: light that is carried, labels, pictures.
fn after(scene: &Scene, budget: Duration) -> Result<[(&'static str, f64); 4]> {
    let (a, b) =
        (scene.render(1.0, SamplesPerPixel::Four, 1)?, scene.render(1.0005, SamplesPerPixel::Four, 1)?);
    let warp = Warp::new(scene, &a, &b)?;
    let white = scene.white_cd_m2();
    let light: Vec<f32> = a.light.iter().map(|l| l / white).collect();
    let size = Geometry::new(a.labels.width as u32, a.labels.height as u32)?;
    let ms = |run: &mut dyn FnMut() -> bool| {
        1e3 / rate(budget, 1.0, || {
            std::hint::black_box(run());
        })
    };
    Ok([
        ("light carried from two renders", ms(&mut || warp.light(1.0002).is_ok())),
        ("flow and its occlusion, one way", ms(&mut || scene.flow(&a.labels, &b.labels, 1).is_ok())),
        ("boxes", ms(&mut || scene.boxes(&a.labels).is_ok())),
        ("PNG of a clear image", ms(&mut || ImageForm::U8.encode(&light, size).is_ok())),
    ])
}

/// 400x250 frames of one scene under several lights, at 1 s of its drive.
pub(crate) fn measure(all_threads: usize, budget: Duration) -> Result<Vec<Drawn>> {
    let mut rows: Vec<Drawn> =
        BLENDER.iter().map(|(what, ms)| Drawn { what: (*what).into(), threads: 0, ms: *ms }).collect();
    let mut threads = vec![1, all_threads];
    threads.dedup();
    for lighting in [Lighting::Noon, Lighting::Overcast, Lighting::Night] {
        let options = SceneOptions { lighting: Some(lighting), ..SceneOptions::default() };
        let scene = Scene::random(1, &options)?;
        for &n in &threads {
            let what = format!("key frame and labels, {}, 2x2 samples", lighting.name());
            rows.push(Drawn::measured(what, n, budget, || {
                std::hint::black_box(scene.render(1.0, SamplesPerPixel::Four, n).is_ok());
            }));
        }
        if lighting == Lighting::Noon {
            rows.extend(beside(&scene, all_threads, budget)?);
        }
    }
    Ok(rows)
}

/// What else a readout or a labelled image costs.
fn beside(scene: &Scene, threads: usize, budget: Duration) -> Result<Vec<Drawn>> {
    let (a, b) = (
        scene.render(1.0, SamplesPerPixel::Four, threads)?,
        scene.render(1.0005, SamplesPerPixel::Four, threads)?,
    );
    let warp = Warp::new(scene, &a, &b)?;
    let row = |what: &str, threads, run: &mut dyn FnMut() -> bool| {
        Drawn::measured(what.to_owned(), threads, budget, || {
            std::hint::black_box(run());
        })
    };
    Ok(vec![
        row("key frame and labels, noon, 4x4 samples", threads, &mut || {
            scene.render(1.0, SamplesPerPixel::Sixteen, threads).is_ok()
        }),
        row("readout between key frames", 1, &mut || warp.light(1.0002).is_ok()),
        row("flow to another moment", threads, &mut || scene.flow(&a.labels, &b.labels, threads).is_ok()),
        row("boxes of all vehicles", 1, &mut || scene.boxes(&a.labels).is_ok()),
    ])
}
