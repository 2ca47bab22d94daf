//! Study of near-duplicate scenes.
//!
//! `cargo run --release -p spikelane-studies --bin study-duplicates -- [--seeds N] [--first SEED]` renders one thumbnail of
//! each of N scenes. The similarity of two scenes is the correlation coefficient of the logarithms of their luminance, after
//! the mean thumbnail of all scenes is subtracted: every street has a bright sky above a dark road. The study prints the
//! most similar pairs and the distribution of the largest similarity of each scene. A scene that repeats another scene has
//! the similarity 1.

use rayon::prelude::*;
use spikelane_scene::{SamplesPerPixel, Scene, SceneOptions};

/// Size of a thumbnail in pixels.
const WIDTH: u32 = 40;
const HEIGHT: u32 = 25;

/// Smallest luminance in cd/m2, which limits the logarithm.
const MIN_LUMINANCE: f32 = 1e-4;

/// Number of pairs in the list.
const LISTED_PAIRS: usize = 10;

fn main() {
    let (mut count, mut first) = (10_000_u64, 0_u64);
    let mut all = std::env::args().skip(1);
    while let Some(arg) = all.next() {
        let value = all.next().unwrap_or_else(|| panic!("{arg} needs a value"));
        match arg.as_str() {
            "--seeds" => count = value.parse().expect("a number of seeds"),
            "--first" => first = value.parse().expect("a seed"),
            _ => panic!("{arg}: give --seeds N or --first SEED"),
        }
    }
    let mut thumbnails: Vec<Vec<f32>> = (first..first + count).into_par_iter().map(thumbnail).collect();
    normalize(&mut thumbnails);
    let pairs = nearest(&thumbnails);
    let mut sorted: Vec<f32> = pairs.iter().map(|pair| pair.similarity).collect();
    sorted.sort_by(f32::total_cmp);
    let at = |share: f64| sorted[((sorted.len() - 1) as f64 * share) as usize];
    println!("{count} scenes from seed {first}, thumbnails of {WIDTH}x{HEIGHT} pixels");
    println!(
        "largest similarity of a scene to another scene: median {:.3}, 90 % {:.3}, 99 % {:.3}, maximum {:.3}",
        at(0.5),
        at(0.9),
        at(0.99),
        at(1.0)
    );
    let mut listed: Vec<&Pair> = pairs.iter().filter(|pair| pair.one < pair.other).collect();
    listed.sort_by(|a, b| b.similarity.total_cmp(&a.similarity));
    for pair in listed.iter().take(LISTED_PAIRS) {
        println!(
            "seeds {} and {}: {:.4}",
            first + pair.one as u64,
            first + pair.other as u64,
            pair.similarity
        );
    }
}

/// Returns the logarithms of the luminance of the first instant of a scene.
fn thumbnail(seed: u64) -> Vec<f32> {
    let options = SceneOptions { width: WIDTH, height: HEIGHT, duration_s: 2e-3, ..SceneOptions::default() };
    let scene = Scene::from_seed(seed, &options).unwrap_or_else(|e| panic!("seed {seed}: {e}"));
    let frame = scene.render(0.0, SamplesPerPixel::Four, 1).unwrap_or_else(|e| panic!("seed {seed}: {e}"));
    frame.light.iter().map(|v| v.max(MIN_LUMINANCE).ln()).collect()
}

/// Removes the brightness of each thumbnail and the mean thumbnail, and scales each thumbnail to the norm 1.
fn normalize(thumbnails: &mut [Vec<f32>]) {
    let pixels = (WIDTH * HEIGHT) as usize;
    let remove_mean = |image: &mut Vec<f32>| {
        let mean = image.iter().sum::<f32>() / pixels as f32;
        image.iter_mut().for_each(|v| *v -= mean);
    };
    thumbnails.par_iter_mut().for_each(remove_mean);
    let mut mean = vec![0.0; pixels];
    for image in thumbnails.iter() {
        mean.iter_mut().zip(image).for_each(|(sum, v)| *sum += f64::from(*v));
    }
    let count = thumbnails.len() as f64;
    thumbnails.par_iter_mut().for_each(|image| {
        image.iter_mut().zip(&mean).for_each(|(v, sum)| *v -= (sum / count) as f32);
        let norm = image.iter().map(|v| v * v).sum::<f32>().sqrt().max(f32::MIN_POSITIVE);
        image.iter_mut().for_each(|v| *v /= norm);
    });
}

/// A scene and the most similar other scene.
struct Pair {
    one: usize,
    other: usize,
    similarity: f32,
}

/// Returns the most similar other scene of each scene.
fn nearest(thumbnails: &[Vec<f32>]) -> Vec<Pair> {
    (0..thumbnails.len())
        .into_par_iter()
        .map(|one| {
            let mut best = Pair { one, other: one, similarity: f32::NEG_INFINITY };
            for (other, image) in thumbnails.iter().enumerate().filter(|(other, _)| *other != one) {
                let similarity = product(&thumbnails[one], image);
                if similarity > best.similarity {
                    best = Pair { one, other, similarity };
                }
            }
            best
        })
        .collect()
}

/// Returns the scalar product. Eight partial sums let the compiler use vectors.
fn product(a: &[f32], b: &[f32]) -> f32 {
    let mut sums = [0.0_f32; 8];
    for (a, b) in a.chunks_exact(8).zip(b.chunks_exact(8)) {
        for k in 0..8 {
            sums[k] += a[k] * b[k];
        }
    }
    sums.iter().sum()
}
