//! What became of detail and noise: pictures of 41 readouts of simulated and of real scenes that stand still.

use std::fmt::Write as _;
use std::ops::Range;
use std::path::Path;

use spikelane::reconstruct::{Reference, blurred, detail, span, tfi_at, tfp};
use spikelane::{Geometry, Packed};
use spikelane_io::formats::{Layout, Reader};

use super::real::STILL;
use super::simulated;

/// Readouts on either side: 41 together.
const HALF: usize = 20;

/// Deviation of the blur in pixels.
const BLUR: f64 = 1.0;

struct Scene {
    name: &'static str,
    geometry: Geometry,
    bytes: Vec<u8>,
    /// The light, where it is known.
    light: Option<Vec<f32>>,
    rows: Range<usize>,
}

/// The table of all scenes; the real ones lie in `folder`.
pub(crate) fn table(folder: &Path) -> String {
    let mut scenes = simulated_scenes();
    scenes.extend(recorded(folder));
    let mut text = String::from(
        "| scene | picture | aligned, dB | detail | noise, % | stand out |\n|---|---|--:|--:|--:|--:|\n",
    );
    for scene in &scenes {
        text += &rows(scene);
    }
    text
}

fn simulated_scenes() -> Vec<Scene> {
    let [(ideal, light), (physical, _), (dim, _)] = simulated::still_scenes();
    let geometry = simulated::geometry();
    let rows = 0..geometry.height();
    let scene = |name, bytes, light| Scene { name, geometry, bytes, light, rows: rows.clone() };
    vec![
        scene("simulated, no noise", ideal, Some(light)),
        scene("simulated, `physical`", physical, None),
        scene("simulated, `physical`, a tenth of the light", dim, None),
    ]
}

fn recorded(folder: &Path) -> Vec<Scene> {
    let size = Geometry::new(400, 250).unwrap();
    let still = Reader::open(&folder.join("static_400x250x300.dat"), Some(Layout::Dat), Some(size)).unwrap();
    let dim = Reader::open(&folder.join("lowlight_250x250x120.npz"), None, None).unwrap();
    let read = |reader: &Reader| {
        let mut bytes = vec![0; reader.readouts() * reader.geometry().frame_bytes()];
        reader.read_frames(0, &mut bytes).unwrap();
        bytes
    };
    let (name, light) = ("real, outdoors, still rows, 300 readouts", None);
    let outdoors = Scene { name, geometry: size, bytes: read(&still), light, rows: STILL };
    let (geometry, name) = (dim.geometry(), "real, low light, 120 readouts");
    vec![outdoors, Scene { name, geometry, bytes: read(&dim), light: None, rows: 0..geometry.height() }]
}

fn rows(scene: &Scene) -> String {
    let packed = Packed::new(scene.geometry, &scene.bytes).unwrap();
    let at = packed.readouts() / 2;
    let counted = (0..scene.geometry.pixels()).map(|p| scene.rows.contains(&(p / scene.geometry.width())));
    let counted = Some(counted.collect::<Vec<bool>>());
    let reference = match &scene.light {
        Some(light) => Reference { observed: [light.clone(), light.clone()], counted, is_scene: true },
        None => Reference { counted, ..Reference::of_others(packed, at - HALF..at + HALF + 1).unwrap() },
    };
    let counts = tfp(packed, at, HALF).unwrap();
    let soft = blurred(&counts, scene.geometry, BLUR);
    let interval = tfi_at(packed, at, packed.readouts()).unwrap();
    let mut text = String::new();
    let pictures = [
        ("TFP 41", Some(counts)),
        ("TFP 41, blurred by a pixel", Some(soft)),
        ("span 41", Some(span(packed, at, HALF).unwrap())),
        ("TFI", interval.is_measurable().then_some(interval.rates)),
    ];
    for (name, picture) in pictures {
        let Some(found) = picture.and_then(|p| detail(&p, &reference, scene.geometry).ok()) else {
            writeln!(text, "| {} | {name} | not measurable | | | |", scene.name).unwrap();
            continue;
        };
        let (db, slope, noise) = (found.aligned_psnr_db, found.slope, 100.0 * found.noise);
        writeln!(
            text,
            "| {} | {name} | {db:.1} | {slope:.2} | {noise:.1} | {} |",
            scene.name, found.outliers
        )
        .unwrap();
    }
    text
}
