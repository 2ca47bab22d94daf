//! How far the light of a drive is from true renders of the same instants.
//!
//! A true render has sixteen samples a pixel, and so has what a drive draws. At the edges of things an error is
//! that of a place, inside them one of light; edges are therefore told apart. Nothing here is timed.

use std::fmt::Write as _;

use serde_json::{Value, json};
use spikelane::Result;
use spikelane_dataset::Drive;
use spikelane_io::light::{Frame, Insertion, Rate, Source, Timeline};
use spikelane_scene::{Labels, Lighting, SamplesPerPixel, Scene, SceneOptions};

use crate::making::drawn;

const LIGHTS: [Lighting; 3] = [Lighting::Noon, Lighting::Overcast, Lighting::Night];
const SEEDS: [u64; 3] = [1, 2, 3];
const READOUT_HZ: u64 = 20_000;
/// Readouts of each drive, and those that are compared: every thirteenth.
const READOUTS: u64 = 200;
const FIRST: u64 = 6;
const EVERY: u64 = 13;
/// Light beyond this many times white is as good as white: a pixel fires at every readout there.
const MOST: f32 = 2.0;
/// Depths of neighbours that differ by more than this share lie on two things.
const STEP: f32 = 0.1;

/// How often light is drawn.
#[derive(Clone, Copy)]
enum Cadence {
    /// A frame for every readout, as data sets have it.
    EveryReadout,
    /// As the first command has it.
    Default,
}

impl Cadence {
    const ALL: [Self; 2] = [Self::EveryReadout, Self::Default];

    fn plan(self) -> Result<(Rate, Timeline, String)> {
        let readout = Rate::new(READOUT_HZ, 1)?;
        Ok(match self {
            Self::EveryReadout => {
                (readout, Timeline::per_frame(1, Insertion::Hold)?, "one a readout".to_owned())
            }
            Self::Default => {
                let (rate, insertion) = (Rate::new(drawn::DRIVE_FRAMES_PER_S, 1)?, drawn::DRAWN_INSERTION);
                let name = format!("{} a second, {insertion}", drawn::DRIVE_FRAMES_PER_S);
                (rate, Timeline::rates(rate, readout, insertion)?, name)
            }
        })
    }
}

/// Errors of one light and cadence, in per cent of white.
pub(crate) struct Row {
    lighting: Lighting,
    drawn: String,
    edges: bool,
    pixels: usize,
    mean: f64,
    /// 99th and 99.9th percentile, and the greatest.
    tail: [f32; 3],
}

impl Row {
    fn of(lighting: Lighting, drawn: &str, edges: bool, mut errors: Vec<f32>) -> Self {
        let n = errors.len().max(1);
        let mean = errors.iter().map(|&e| f64::from(e)).sum::<f64>() / n as f64;
        errors.sort_unstable_by(f32::total_cmp);
        let at = |share: f64| errors.get(((n - 1) as f64 * share) as usize).copied().unwrap_or(0.0);
        let tail = [at(0.99), at(0.999), at(1.0)];
        Self { lighting, drawn: drawn.to_owned(), edges, pixels: errors.len(), mean, tail }
    }

    pub(crate) fn json(&self) -> Value {
        json!({"lighting": self.lighting.name(), "drawn": self.drawn, "edges": self.edges,
            "pixels": self.pixels, "mean_percent": self.mean,
            "p99_percent": self.tail[0], "p999_percent": self.tail[1], "greatest_percent": self.tail[2]})
    }
}

/// The table.
///
/// # Errors
/// As scenes and drives have them.
pub(crate) fn measure(threads: usize) -> Result<Vec<Row>> {
    let mut rows = Vec::new();
    for lighting in LIGHTS {
        // Per cadence: inside and at edges.
        let mut errors: [[Vec<f32>; 2]; 2] = Default::default();
        for seed in SEEDS {
            one(lighting, seed, threads, &mut errors)?;
        }
        for (cadence, errors) in Cadence::ALL.into_iter().zip(errors) {
            let name = cadence.plan()?.2;
            for (edges, errors) in [false, true].into_iter().zip(errors) {
                rows.push(Row::of(lighting, &name, edges, errors));
            }
        }
    }
    Ok(rows)
}

/// Adds the errors of one drive.
fn one(lighting: Lighting, seed: u64, threads: usize, errors: &mut [[Vec<f32>; 2]; 2]) -> Result<()> {
    let options = SceneOptions {
        lighting: Some(lighting),
        duration_s: READOUTS as f64 / READOUT_HZ as f64 + 2.0 / drawn::DRIVE_FRAMES_PER_S as f64,
        ..SceneOptions::default()
    };
    let scene = Scene::random(seed, &options)?;
    let lights = Cadence::ALL.map(|cadence| light(cadence, seed, &options, threads));
    let lights = lights.into_iter().collect::<Result<Vec<_>>>()?;
    for (k, readout) in (FIRST..READOUTS).step_by(EVERY as usize).enumerate() {
        let t = readout as f64 / READOUT_HZ as f64;
        let truth = scene.render(t, SamplesPerPixel::Sixteen, threads)?;
        let edges = edges(&truth.labels);
        let white = scene.white_cd_m2();
        for (light, errors) in lights.iter().zip(&mut *errors) {
            for ((&x, &y), &edge) in light[k].iter().zip(&truth.light).zip(&edges) {
                let error = 100.0 * (x.min(MOST) - (y / white).min(MOST)).abs();
                errors[usize::from(edge)].push(error);
            }
        }
    }
    Ok(())
}

/// The light of the compared readouts, in units of white.
fn light(cadence: Cadence, seed: u64, options: &SceneOptions, threads: usize) -> Result<Vec<Vec<f32>>> {
    let (rate, timeline, _) = cadence.plan()?;
    let frames = timeline.at(READOUTS - 1).frame + 2;
    let scene = Scene::random(seed, options)?;
    let mut drive = Drive::new(scene, rate, frames, None, drawn::DRIVE_SAMPLES, threads)?;
    let mut frame = Frame::dark(drive.geometry());
    let mut all = Vec::new();
    while drive.next_frame(&mut frame)? {
        all.push(frame.to_f32());
    }
    let wanted = (FIRST..READOUTS).step_by(EVERY as usize).map(|readout| timeline.at(readout));
    Ok(wanted
        .map(|at| {
            let (now, next, w) = (&all[at.frame as usize], &all[at.frame as usize + 1], at.weight());
            now.iter().zip(next).map(|(a, b)| a + (b - a) * w).collect()
        })
        .collect())
}

/// Pixels beside which another thing begins, or the same one at another depth.
fn edges(labels: &Labels) -> Vec<bool> {
    let (w, h) = (labels.width, labels.height);
    let differ = |a: usize, b: usize| {
        let (z, y) = (labels.depth_m[a], labels.depth_m[b]);
        (labels.part[a], labels.semantic[a]) != (labels.part[b], labels.semantic[b])
            || (z.is_finite() && (z - y).abs() > STEP * z.min(y))
    };
    (0..w * h)
        .map(|i| {
            let (x, y) = (i % w, i / w);
            (y.saturating_sub(1)..(y + 2).min(h))
                .any(|ny| (x.saturating_sub(1)..(x + 2).min(w)).any(|nx| differ(i, ny * w + nx)))
        })
        .collect()
}

/// The table as Markdown.
pub(crate) fn text(rows: &[Row]) -> String {
    let mut text = format!(
        "Light of readouts against renders of their instants with 16 samples a pixel, 400x250 at {READOUT_HZ} Hz: scenes of the seeds {SEEDS:?}, \
         readouts {FIRST}, {}, ... below {READOUTS}, in per cent of white (what exceeds {MOST} times white counts as that). \
         \"Edges\" are pixels beside which another thing or depth begins.\n\n",
        FIRST + EVERY
    );
    text += "| light | drawn | pixels | mean | 99 % | 99.9 % | greatest |\n|---|---|--:|--:|--:|--:|--:|\n";
    for r in rows {
        let _ = writeln!(
            text,
            "| {}, {} | {} | {} | {:.4} | {:.3} | {:.2} | {:.1} |",
            r.lighting.name(),
            if r.edges { "edges" } else { "inside" },
            r.drawn,
            r.pixels,
            r.mean,
            r.tail[0],
            r.tail[1],
            r.tail[2]
        );
    }
    text
}
