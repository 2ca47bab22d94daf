//! Compares the light of a drive with true renders of the same instants.
//!
//! A true render has sixteen samples per pixel, like the frames of a drive. The tables list edges of objects
//! separately. At edges, errors come from wrong positions. Inside objects, errors come from wrong light. This module
//! measures no times.

use std::fmt::Write as _;

use serde_json::{Value, json};
use spikelane::Result;
use spikelane_dataset::Drive;
use spikelane_io::light::{Frame, Interpolation, Rate, Source};
use spikelane_scene::{Labels, Lighting, SamplesPerPixel, Scene, SceneOptions};

use crate::generate::builtin_light;

const LIGHTINGS: [Lighting; 3] = [Lighting::Noon, Lighting::Dusk, Lighting::Night];
const SEEDS: [u64; 3] = [1, 2, 3];
const READOUT_HZ: u64 = 20_000;
/// Number of readouts of each drive. Every thirteenth readout is compared.
const READOUTS: u64 = 200;
const FIRST_COMPARED_READOUT: u64 = 6;
const COMPARED_READOUT_STEP: u64 = 13;
/// Light above this multiple of white is clipped, because a pixel then fires at every readout.
const MAX_LIGHT: f32 = 2.0;
/// Two adjacent pixels belong to different surfaces if their depths differ by more than this share of the smaller
/// depth.
const DEPTH_STEP_SHARE: f32 = 0.1;

/// Errors of the light for one lighting, in percent of white.
pub(crate) struct ErrorRow {
    lighting: Lighting,
    is_edge: bool,
    mean: f64,
    p99: f32,
    p999: f32,
    max: f32,
}

impl ErrorRow {
    fn from_errors(lighting: Lighting, edges: bool, mut errors: Vec<f32>) -> Self {
        let n = errors.len().max(1);
        let mean = errors.iter().map(|&e| f64::from(e)).sum::<f64>() / n as f64;
        errors.sort_unstable_by(f32::total_cmp);
        let at = |share: f64| errors.get(((n - 1) as f64 * share) as usize).copied().unwrap_or(0.0);
        Self { lighting, is_edge: edges, mean, p99: at(0.99), p999: at(0.999), max: at(1.0) }
    }

    pub(crate) fn json(&self) -> Value {
        json!({"lighting": self.lighting.name(), "is_edge": self.is_edge, "mean_percent": self.mean,
            "p99_percent": self.p99, "p999_percent": self.p999, "max_percent": self.max})
    }
}

/// Returns the errors for all lightings.
///
/// # Errors
/// If a scene or a drive cannot be created or rendered.
pub(crate) fn scene_error_table(threads: usize) -> Result<Vec<ErrorRow>> {
    let mut rows = Vec::new();
    for lighting in LIGHTINGS {
        // The first list contains errors inside objects, and the second list errors at edges.
        let mut errors: [Vec<f32>; 2] = Default::default();
        for seed in SEEDS {
            add_scene_errors(lighting, seed, threads, &mut errors)?;
        }
        for (edges, errors) in [false, true].into_iter().zip(errors) {
            rows.push(ErrorRow::from_errors(lighting, edges, errors));
        }
    }
    Ok(rows)
}

/// Adds the errors of the drive with the seed `seed`.
fn add_scene_errors(lighting: Lighting, seed: u64, threads: usize, errors: &mut [Vec<f32>; 2]) -> Result<()> {
    let options = SceneOptions {
        lighting: Some(lighting),
        duration_s: READOUTS as f64 / READOUT_HZ as f64,
        ..SceneOptions::default()
    };
    let scene = Scene::from_seed(seed, &options)?;
    let mut drive = Drive::new(
        Scene::from_seed(seed, &options)?,
        Rate::new(READOUT_HZ, 1)?,
        READOUTS,
        builtin_light::DRIVE_SAMPLES,
        threads,
    )?;
    let timeline = drive.timeline(Interpolation::Linear)?;
    let mut frame = Frame::dark(drive.geometry());
    let mut frames = Vec::new();
    while drive.next_frame(&mut frame)? {
        frames.push(frame.to_f32());
    }
    for readout in (FIRST_COMPARED_READOUT..READOUTS).step_by(COMPARED_READOUT_STEP as usize) {
        let t = readout as f64 / READOUT_HZ as f64;
        let truth = scene.render(t, SamplesPerPixel::Sixteen, threads)?;
        let edges = edge_mask(&truth.labels);
        let white = scene.white_cd_m2(t, threads)?;
        let at = timeline.position_within(readout, frames.len() as u64)?;
        let now = &frames[at.frame as usize];
        let next = frames.get(at.frame as usize + 1).unwrap_or(now);
        let light = now.iter().zip(next).map(|(a, b)| a + (b - a) * at.weight());
        for ((x, &y), &edge) in light.zip(&truth.light).zip(&edges) {
            let error = 100.0 * (x.min(MAX_LIGHT) - (y / white).min(MAX_LIGHT)).abs();
            errors[usize::from(edge)].push(error);
        }
    }
    Ok(())
}

/// Returns whether each pixel is beside another object, or beside another depth of the same object.
fn edge_mask(labels: &Labels) -> Vec<bool> {
    let (w, h) = (labels.width, labels.height);
    let differ = |a: usize, b: usize| {
        let (z, y) = (labels.depth_m[a], labels.depth_m[b]);
        (labels.part[a], labels.semantic[a]) != (labels.part[b], labels.semantic[b])
            || (z.is_finite() && (z - y).abs() > DEPTH_STEP_SHARE * z.min(y))
    };
    (0..w * h)
        .map(|i| {
            let (x, y) = (i % w, i / w);
            (y.saturating_sub(1)..(y + 2).min(h))
                .any(|ny| (x.saturating_sub(1)..(x + 2).min(w)).any(|nx| differ(i, ny * w + nx)))
        })
        .collect()
}

/// Returns the table as Markdown.
pub(crate) fn markdown(rows: &[ErrorRow]) -> String {
    let mut text = format!(
        "Absolute difference from a render of the same instant with 16 samples per pixel, in percent of white. \
         Light above {MAX_LIGHT} times white is clipped. Edge pixels adjoin another object or another depth. \
         400x250 pixels at {READOUT_HZ} Hz, scene seeds {}, readouts {FIRST_COMPARED_READOUT}, {}, ... below {READOUTS}.\n\n",
        SEEDS.map(|seed| seed.to_string()).join(", "),
        FIRST_COMPARED_READOUT + COMPARED_READOUT_STEP
    );
    text += "| light | mean | 99th percentile | 99.9th percentile | maximum |\n|---|--:|--:|--:|--:|\n";
    for r in rows {
        let _ = writeln!(
            text,
            "| {}, {} | {:.4} | {:.3} | {:.2} | {:.1} |",
            r.lighting.name(),
            if r.is_edge { "edges" } else { "inside" },
            r.mean,
            r.p99,
            r.p999,
            r.max
        );
    }
    text
}
