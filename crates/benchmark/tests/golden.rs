//! Compares each metric with the values of another program. `golden/make.py` writes the values.

use std::path::Path;

use serde_json::Value;
use spikelane::Geometry;
use spikelane::reconstruct::DetailReference;
use spikelane_benchmark::aggregate::{
    Bootstrap, Summary, ValueWithInterval, summarize, summarize_differences,
};
use spikelane_benchmark::depth::depth_scores;
use spikelane_benchmark::detection::{Detection, GroundTruth, detection_scores, match_image};
use spikelane_benchmark::flow::{FlowField, FlowReference, flow_scores};
use spikelane_benchmark::tracking::{
    TrackedBox, TrackingCounts, TrackingFrame, TrackingScores, count_matches,
};
use spikelane_benchmark::{BoundingBox, METRICS, image};

const FILES: [&str; 9] =
    ["image", "color", "noise", "ssimulacra2", "flow", "depth", "detection", "tracking", "aggregate"];

/// Largest difference between a metric and its golden value. Rounding errors are below 1e-9: the values are at most 100,
/// and the other programs also compute in double precision.
const TOLERANCE: f64 = 1e-6;

fn read(name: &str) -> Value {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden").join(name).with_extension("json");
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

fn cases(file: &Value) -> &Vec<Value> {
    file["cases"].as_array().unwrap()
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
}

/// Returns `code / 1000` for each code, with the rounding of single precision.
fn thousandths(codes: &Value) -> Vec<f32> {
    numbers(codes).into_iter().map(|code| code as f32 / 1000.0).collect()
}

fn flags(value: &Value) -> Vec<bool> {
    value.as_array().unwrap().iter().map(|x| x.as_bool().unwrap()).collect()
}

fn geometry(case: &Value) -> Geometry {
    let side = |key: &str| case[key].as_u64().unwrap() as u32;
    Geometry::new(side("width"), side("height")).unwrap()
}

fn bounds(value: &Value) -> BoundingBox {
    let [x, y, width, height] = numbers(value)[..] else { panic!("{value} is not a box") };
    BoundingBox { x, y, width, height }
}

/// Compares values with the golden values of a case. The case must contain exactly these metrics.
fn compare(case: usize, golden: &Value, values: &[(&str, Option<f64>)]) {
    let golden = golden.as_object().unwrap();
    assert_eq!(golden.len(), values.len(), "case {case}");
    for (name, value) in values {
        match (value, golden[*name].as_f64()) {
            (Some(value), Some(golden)) => {
                assert!((value - golden).abs() < TOLERANCE, "case {case}, {name}: {value} for {golden}");
            }
            (value, golden) => assert_eq!(*value, golden, "case {case}, {name}"),
        }
    }
}

#[test]
fn every_metric_has_golden_vectors_of_its_version() {
    let mut versions = serde_json::Map::new();
    for name in FILES {
        versions.extend(read(name)["metrics"].as_object().unwrap().clone());
    }
    for metric in METRICS {
        let version = versions.remove(metric.name);
        assert_eq!(version, Some(metric.version.into()), "{}", metric.name);
    }
    // The table does not list a metric whose feature is off.
    versions.retain(|name, _| cfg!(feature = "ssimulacra2") || name != "ssimulacra2");
    assert!(versions.is_empty(), "golden vectors without a metric: {versions:?}");
}

#[test]
fn names_of_metrics_are_unique() {
    let names: std::collections::BTreeSet<&str> = METRICS.iter().map(|metric| metric.name).collect();
    assert_eq!(names.len(), METRICS.len());
}

#[test]
fn images_have_the_values_of_scikit_image_spike_zoo_and_spikecv() {
    for (i, case) in cases(&read("image")).iter().enumerate() {
        let g = geometry(case);
        let [x, y, z] = ["output", "reference", "other_observation"].map(|key| thousandths(&case[key]));
        let reference = DetailReference { observations: [y.clone(), z], mask: None, is_scene: true };
        let detail = image::detail(&x, &reference, g).unwrap();
        let values = [
            ("psnr", image::psnr(&x, &y, g)),
            ("ssim", image::ssim(&x, &y, g)),
            ("psnr_as_spike_zoo", image::psnr_as_spike_zoo(&x, &y, g)),
            ("ssim_as_spike_zoo", image::ssim_as_spike_zoo(&x, &y, g)),
            ("psnr_as_spikecv", image::psnr_as_spikecv(&x, &y, g)),
            ("ssim_as_spikecv", image::ssim_as_spikecv(&x, &y, g)),
            ("detail_slope", Ok(detail.slope)),
            ("high_pass_noise", Ok(detail.noise)),
        ];
        compare(i, &case["values"], &values.map(|(name, value)| (name, Some(value.unwrap()))));
    }
}

#[test]
fn color_images_have_the_values_of_scikit_image() {
    for (i, case) in cases(&read("color")).iter().enumerate() {
        let g = geometry(case);
        let [x, y] = ["output", "reference"].map(|key| thousandths(&case[key]));
        let [red, green, blue] = image::color_psnr(&x, &y, g).unwrap();
        let values = [
            ("cpsnr", image::cpsnr(&x, &y, g).unwrap()),
            ("psnr_red", red),
            ("psnr_green", green),
            ("psnr_blue", blue),
            ("ssim_color", image::color_ssim(&x, &y, g).unwrap().iter().sum::<f64>() / 3.0),
            ("ciede2000", image::color_difference(&x, &y, g).unwrap()),
        ];
        compare(i, &case["values"], &values.map(|(name, value)| (name, Some(value))));
    }
}

#[test]
fn blind_noise_levels_have_the_values_of_numpy() {
    for (i, case) in cases(&read("noise")).iter().enumerate() {
        let (g, x) = (geometry(case), thousandths(&case["output"]));
        let values = [
            ("noise_chen", image::noise_chen(&x, g)),
            ("noise_liu", image::noise_liu(&x, g)),
            ("blind_snr", image::blind_snr(&x, g)),
        ];
        compare(i, &case["values"], &values.map(|(name, value)| (name, Some(value.unwrap()))));
    }
}

#[test]
fn flow_has_the_values_of_another_reader() {
    for (i, case) in cases(&read("flow")).iter().enumerate() {
        let field = |key: &str| -> Vec<[f32; 2]> { thousandths(&case[key]).as_chunks().0.to_vec() };
        let (output, truth) = (field("output"), field("truth"));
        let (valid, occluded) = (flags(&case["valid"]), flags(&case["occluded"]));
        let reference = FlowReference {
            field: FlowField { displacements: &truth, interval_seconds: 0.05 },
            is_valid: Some(&valid),
            is_occluded: Some(&occluded),
        };
        let scores =
            flow_scores(FlowField { displacements: &output, interval_seconds: 0.05 }, reference).unwrap();
        let (visible, hidden) = (scores.visible.unwrap(), scores.occluded.unwrap());
        let values = [
            ("flow_epe", visible.epe_px),
            ("flow_outliers", visible.outlier_percent),
            ("flow_epe_occluded", hidden.epe_px),
            ("flow_outliers_occluded", hidden.outlier_percent),
        ];
        compare(i, &case["values"], &values.map(|(name, value)| (name, Some(value))));
    }
}

#[test]
fn depths_have_the_values_of_numpy() {
    for (i, case) in cases(&read("depth")).iter().enumerate() {
        let scores = depth_scores(&thousandths(&case["output"]), &thousandths(&case["truth"])).unwrap();
        let values = [
            ("depth_abs_rel", scores.abs_rel),
            ("depth_rmse_log", scores.rmse_log),
            ("depth_delta_1", scores.delta[0]),
            ("depth_delta_2", scores.delta[1]),
            ("depth_delta_3", scores.delta[2]),
        ];
        compare(i, &case["values"], &values.map(|(name, value)| (name, Some(value))));
    }
}

#[test]
fn detections_have_the_values_of_pycocotools() {
    for (i, case) in cases(&read("detection")).iter().enumerate() {
        let images = case["images"].as_array().unwrap().iter().map(|image| {
            let class = |entry: &Value| entry["class"].as_u64().unwrap() as u32;
            let truth = image["truth"].as_array().unwrap().iter().map(|o| GroundTruth {
                class: class(o),
                bounds: bounds(&o["box"]),
                area: o["area"].as_f64().unwrap(),
                is_crowd: o["is_crowd"].as_bool().unwrap(),
            });
            let detections = image["detections"].as_array().unwrap().iter().map(|d| Detection {
                class: class(d),
                bounds: bounds(&d["box"]),
                score: d["score"].as_f64().unwrap(),
            });
            match_image(&truth.collect::<Vec<_>>(), &detections.collect::<Vec<_>>()).unwrap()
        });
        let s = detection_scores(&images.collect::<Vec<_>>());
        let values = [
            ("ap", s.ap),
            ("ap_50", s.ap_50),
            ("ap_75", s.ap_75),
            ("ap_small", s.ap_small),
            ("ap_medium", s.ap_medium),
            ("ap_large", s.ap_large),
            ("ar_1", s.ar_1),
            ("ar_10", s.ar_10),
            ("ar_100", s.ar_100),
            ("ar_small", s.ar_small),
            ("ar_medium", s.ar_medium),
            ("ar_large", s.ar_large),
        ];
        compare(i, &case["values"], &values);
    }
}

fn compare_tracking(case: usize, golden: &Value, counts: &TrackingCounts) {
    let parts =
        |s: TrackingScores| [("hota", s.hota), ("det_a", s.det_a), ("ass_a", s.ass_a), ("loc_a", s.loc_a)];
    compare(case, &golden["values"], &parts(counts.scores()).map(|(name, value)| (name, Some(value))));
    for (a, scores) in counts.scores_by_threshold().into_iter().enumerate() {
        for (name, value) in parts(scores) {
            let golden = numbers(&golden["by_threshold"][name])[a];
            assert!((value - golden).abs() < TOLERANCE, "case {case}, {name}, {a}: {value} for {golden}");
        }
    }
}

#[test]
fn tracks_have_the_values_of_trackeval() {
    let file = read("tracking");
    let mut sequences = Vec::new();
    for (i, case) in cases(&file).iter().enumerate() {
        let frames = case["frames"].as_array().unwrap().iter().map(|frame| {
            let boxes = |key: &str| -> Vec<TrackedBox> {
                let entry =
                    |b: &Value| TrackedBox { track: b["track"].as_u64().unwrap(), bounds: bounds(&b["box"]) };
                frame[key].as_array().unwrap().iter().map(entry).collect()
            };
            TrackingFrame { truth: boxes("truth"), output: boxes("output") }
        });
        let counts = count_matches(&frames.collect::<Vec<_>>()).unwrap();
        compare_tracking(i, case, &counts);
        sequences.push(counts);
    }
    compare_tracking(sequences.len(), &file["combined"], &TrackingCounts::combine(&sequences));
}

#[test]
fn means_and_intervals_have_the_values_of_numpy() {
    for (i, case) in cases(&read("aggregate")).iter().enumerate() {
        let scores =
            |key: &str| -> Vec<Vec<f64>> { case[key].as_array().unwrap().iter().map(numbers).collect() };
        let (a, b) = (scores("a"), scores("b"));
        let options = Bootstrap {
            seed: case["seed"].as_u64().unwrap(),
            resamples: case["resamples"].as_u64().unwrap() as usize,
        };
        let check = |golden: &Value, summary: &Summary| {
            let value = |golden: &Value, found: ValueWithInterval| {
                let interval = found.interval.unwrap();
                let values = [("value", found.value), ("low", interval.low), ("high", interval.high)];
                compare(i, golden, &values.map(|(name, value)| (name, Some(value))));
            };
            value(&golden["pooled"], summary.pooled);
            value(&golden["sequence_mean"], summary.sequence_mean);
        };
        check(&case["summary"], &summarize(&a, options).unwrap());
        check(&case["difference"], &summarize_differences(&a, &b, options).unwrap());
    }
}

#[cfg(feature = "ssimulacra2")]
mod ssimulacra2 {
    use super::*;

    /// Returns the images of `ssimulacra2_images` in `golden/make.py`.
    fn images(amplitude: usize) -> (Vec<f32>, Vec<f32>, Geometry) {
        let geometry = Geometry::new(264, 256).unwrap();
        let codes = |p: usize| {
            let (x, y) = (p % 264, p / 264);
            let reference = (3 * x + 2 * y) % 256 / 2 + 64 * ((x / 16 + y / 24) % 2);
            let hashed = 7919 * x + 104_729 * y + 12345;
            let noise = hashed * hashed / 7 % 1009 % (2 * amplitude + 1);
            (reference, (reference + noise).saturating_sub(amplitude).min(255))
        };
        let (reference, output) = (0..geometry.pixels())
            .map(codes)
            .map(|(reference, output)| (reference as f32 / 255.0, output as f32 / 255.0))
            .unzip();
        (reference, output, geometry)
    }

    fn score(amplitude: usize) -> f64 {
        let (reference, output, geometry) = images(amplitude);
        image::ssimulacra2(&output, &reference, geometry).unwrap()
    }

    /// The crate approximates the Gaussian of the other program. The approximation changes a score by up to 0.3 of 100
    /// points. A wrong transfer function, border or number of scales changes it by several points.
    #[test]
    fn scores_are_close_to_the_scores_of_a_python_program() {
        for case in cases(&read("ssimulacra2")) {
            let (golden, value) =
                (case["value"].as_f64().unwrap(), score(case["amplitude"].as_u64().unwrap() as usize));
            assert!((value - golden).abs() < 0.5, "{value} for {golden}");
        }
    }

    /// The crate computes in single precision with functions of the platform. Their relative error of 6e-8 is multiplied
    /// by weights of up to 226.
    #[test]
    fn scores_are_those_of_version_0_5_1_of_the_crate() {
        for (amplitude, golden) in [(2, 93.512_169_5), (10, 72.382_991_6), (40, 28.177_102_5)] {
            let value = score(amplitude);
            assert!((value - golden).abs() < 1e-3, "{value} for {golden}");
        }
    }
}
