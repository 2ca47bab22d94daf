//! Scores detail and noise in images of simulated and real static scenes. Each image is computed from 41 readouts.

use std::fmt::Write as _;
use std::ops::Range;
use std::path::Path;

use spikelane::reconstruct::{
    DetailReference, gaussian_blur, score_detail, span_rates, tfi_with_open_pixels, tfp,
};
use spikelane::{Geometry, SpikeFramesRef};
use spikelane_io::formats::{Layout, StreamReader};

use super::real_scenes::STATIC_ROWS;
use super::simulated_scenes;

/// Number of readouts before and after the center. The window has 41 readouts in total.
const HALF_WINDOW_READOUTS: usize = 20;

/// Standard deviation of the blur in pixels.
const BLUR_SIGMA_PX: f64 = 1.0;

struct Scene {
    name: &'static str,
    geometry: Geometry,
    bytes: Vec<u8>,
    rows: Range<usize>,
}

/// Returns the table of all scenes. The files of the real recordings are in `folder`.
pub(crate) fn table(folder: &Path) -> String {
    let mut scenes = simulated_scenes();
    scenes.push(recorded_scene(folder));
    let mut text =
        String::from("| scene | image | aligned, dB | detail | noise, % |\n|---|---|--:|--:|--:|\n");
    for scene in &scenes {
        text += &rows(scene);
    }
    text
}

fn simulated_scenes() -> Vec<Scene> {
    let [physical, dim] = simulated_scenes::static_streams();
    let geometry = simulated_scenes::geometry();
    let rows = 0..geometry.height();
    let scene = |name, bytes| Scene { name, geometry, bytes, rows: rows.clone() };
    vec![scene("simulated, `physical`", physical), scene("simulated, `physical`, a tenth of the light", dim)]
}

fn recorded_scene(folder: &Path) -> Scene {
    let geometry = Geometry::new(400, 250).unwrap();
    let path = folder.join("static_400x250x300.dat");
    let reader = StreamReader::open(&path, Some(Layout::Dat), Some(geometry)).unwrap();
    let mut bytes = vec![0; reader.readouts() * geometry.frame_bytes()];
    reader.read_frames(0, &mut bytes).unwrap();
    Scene { name: "real, outdoors, still rows, 300 readouts", geometry, bytes, rows: STATIC_ROWS }
}

fn rows(scene: &Scene) -> String {
    let packed = SpikeFramesRef::new(scene.geometry, &scene.bytes).unwrap();
    let at = packed.readouts() / 2;
    let counted = (0..scene.geometry.pixels()).map(|p| scene.rows.contains(&(p / scene.geometry.width())));
    let counted = Some(counted.collect::<Vec<bool>>());
    let window = at - HALF_WINDOW_READOUTS..at + HALF_WINDOW_READOUTS + 1;
    let reference =
        DetailReference { mask: counted, ..DetailReference::from_surrounding(packed, window).unwrap() };
    let counts = tfp(packed, at, HALF_WINDOW_READOUTS).unwrap();
    let soft = gaussian_blur(&counts, scene.geometry, BLUR_SIGMA_PX);
    let interval = tfi_with_open_pixels(packed, at, packed.readouts()).unwrap();
    let mut text = String::new();
    let pictures = [
        ("TFP 41", Some(counts)),
        ("TFP 41, blurred by 1 pixel", Some(soft)),
        ("span 41", Some(span_rates(packed, at, HALF_WINDOW_READOUTS).unwrap())),
        ("TFI", interval.is_measurable().then_some(interval.rates)),
    ];
    for (name, picture) in pictures {
        let Some(detail) = picture.and_then(|p| score_detail(&p, &reference, scene.geometry).ok()) else {
            writeln!(text, "| {} | {name} | not measurable | | |", scene.name).unwrap();
            continue;
        };
        let (db, slope, noise) = (detail.aligned_psnr_db, detail.slope, 100.0 * detail.noise);
        writeln!(text, "| {} | {name} | {db:.1} | {slope:.2} | {noise:.1} |", scene.name).unwrap();
    }
    text
}
