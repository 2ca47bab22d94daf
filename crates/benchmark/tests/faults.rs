//! A faulty output is a typed error and never a number. The trivial answers have finite scores.

use spikelane::Geometry;
use spikelane::reconstruct::DetailReference;
use spikelane_benchmark::aggregate::{Bootstrap, bootstrap, summarize, summarize_differences};
use spikelane_benchmark::depth::depth_scores;
use spikelane_benchmark::detection::{Detection, GroundTruth, detection_scores, match_image};
use spikelane_benchmark::flow::{FlowField, FlowReference, flow_scores};
use spikelane_benchmark::tracking::{TrackedBox, TrackingFrame, count_matches};
use spikelane_benchmark::{BoundingBox, MetricError, Result, image};

const WIDTH: u32 = 48;
const HEIGHT: u32 = 40;
const PIXELS: usize = (WIDTH * HEIGHT) as usize;

fn geometry() -> Geometry {
    Geometry::new(WIDTH, HEIGHT).unwrap()
}

fn scene() -> Vec<f32> {
    (0..PIXELS).map(|p| 0.3 + (p * p % 1009) as f32 / 2000.0).collect()
}

/// Scores an output with every metric of images that compares with a reference.
fn image_scores(output: &[f32], reference: &[f32], geometry: Geometry) -> Vec<Result<f64>> {
    let detail = DetailReference {
        observations: [reference.to_vec(), reference.to_vec()],
        mask: None,
        is_scene: true,
    };
    vec![
        image::psnr(output, reference, geometry),
        image::ssim(output, reference, geometry),
        image::psnr_as_spike_zoo(output, reference, geometry),
        image::ssim_as_spike_zoo(output, reference, geometry),
        image::psnr_as_spikecv(output, reference, geometry),
        image::ssim_as_spikecv(output, reference, geometry),
        image::detail(output, &detail, geometry).map(|scores| scores.slope),
        #[cfg(feature = "ssimulacra2")]
        image::ssimulacra2(output, reference, geometry),
    ]
}

fn blind_scores(output: &[f32], geometry: Geometry) -> Vec<Result<f64>> {
    vec![
        image::noise_chen(output, geometry),
        image::noise_liu(output, geometry),
        image::blind_snr(output, geometry),
    ]
}

#[test]
fn images_of_a_wrong_size_have_no_score() {
    let short = &scene()[1..];
    let mut scores = image_scores(short, &scene(), geometry());
    scores.extend(blind_scores(short, geometry()));
    for score in scores {
        let error = score.unwrap_err();
        let size = MetricError::WrongSize { found: PIXELS - 1, expected: PIXELS };
        assert_eq!(error.to_string(), size.to_string());
        assert!(error.is_output_fault());
    }
}

#[test]
fn an_error_of_the_library_has_the_text_of_the_fault() {
    for fault in [
        MetricError::Missing,
        MetricError::WrongSize { found: 3, expected: 4 },
        MetricError::WrongInterval { found_seconds: 0.1, expected_seconds: 0.2 },
        MetricError::NonFinite { index: 2 },
        MetricError::OutOfRange { index: 0, requirement: "positive depths" },
        MetricError::Undefined { cause: "a flat image" },
    ] {
        let text = fault.to_string();
        let error = spikelane::Error::from(fault);
        assert_eq!((error.to_string(), error.kind()), (text, spikelane::ErrorKind::Input));
    }
}

#[test]
fn images_with_a_value_that_is_not_finite_have_no_score() {
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let mut output = scene();
        output[77] = bad;
        let mut scores = image_scores(&output, &scene(), geometry());
        scores.extend(blind_scores(&output, geometry()));
        for score in scores {
            assert!(matches!(score, Err(MetricError::NonFinite { index: 77 })), "{score:?}");
        }
    }
}

#[test]
fn faults_of_a_reference_are_not_faults_of_the_output() {
    let mut broken = scene();
    broken[5] = f32::NAN;
    let tiny = Geometry::new(5, 4).unwrap();
    let mut scores = image_scores(&scene(), &broken, geometry());
    scores.extend(image_scores(&scene(), &scene()[1..], geometry()));
    scores.extend(image_scores(&scene(), &vec![0.5; PIXELS], geometry()).into_iter().skip(6).take(1));
    // PSNR is defined for every size.
    scores.extend(image_scores(&[0.5; 20], &[0.5; 20], tiny).into_iter().filter(Result::is_err));
    scores.extend(blind_scores(&[0.5; 20], tiny));
    for score in scores {
        let error = score.unwrap_err();
        assert!(matches!(error, MetricError::Reference(_)) && !error.is_output_fault(), "{error}");
    }
}

#[test]
fn flat_images_have_finite_scores_or_none() {
    for level in [0.0, 0.5] {
        let flat = vec![level; PIXELS];
        let mut scores = image_scores(&flat, &scene(), geometry());
        scores.extend(blind_scores(&flat, geometry()));
        for score in scores {
            match score {
                Ok(value) => assert!(value.is_finite()),
                Err(error) => assert!(matches!(error, MetricError::Undefined { .. }), "{error}"),
            }
        }
    }
}

#[test]
fn equal_images_have_finite_scores() {
    for score in image_scores(&scene(), &scene(), geometry()) {
        assert!(score.unwrap().is_finite());
    }
}

fn field(displacements: &[[f32; 2]], interval_seconds: f64) -> FlowField<'_> {
    FlowField { displacements, interval_seconds }
}

#[test]
fn faulty_flow_has_no_score_and_zero_flow_has_one() {
    let truth = vec![[3.0, 4.0]; 6];
    let reference = FlowReference { field: field(&truth, 0.1), is_valid: None, is_occluded: None };
    let score = |displacements: &[[f32; 2]], interval| flow_scores(field(displacements, interval), reference);
    assert!(matches!(score(&truth[1..], 0.1), Err(MetricError::WrongSize { found: 5, expected: 6 })));
    let mut broken = truth.clone();
    broken[4][1] = f32::NAN;
    assert!(matches!(score(&broken, 0.1), Err(MetricError::NonFinite { index: 4 })));
    assert!(matches!(score(&truth, 0.2), Err(MetricError::WrongInterval { .. })));
    let zero = score(&[[0.0; 2]; 6], 0.1).unwrap();
    assert_eq!(zero.visible.unwrap().epe_px, 5.0);
    assert_eq!((zero.visible.unwrap().outlier_percent, zero.occluded), (100.0, None));

    let invalid = [false; 6];
    for reference in [
        FlowReference { is_valid: Some(&invalid), ..reference },
        FlowReference { is_valid: Some(&invalid[1..]), ..reference },
        FlowReference { is_occluded: Some(&invalid[1..]), ..reference },
        FlowReference { field: field(&truth, 0.0), ..reference },
        FlowReference { field: field(&broken, 0.1), ..reference },
    ] {
        let error = flow_scores(field(&truth, 0.1), reference).unwrap_err();
        assert!(!error.is_output_fault(), "{error}");
    }
    // Displacements at invalid pixels are not used.
    let valid = [true, true, true, true, false, true];
    let reference = FlowReference { field: field(&broken, 0.1), is_valid: Some(&valid), is_occluded: None };
    assert_eq!(flow_scores(field(&truth, 0.1), reference).unwrap().visible.unwrap().pixels, 5);
}

#[test]
fn faulty_depth_has_no_score_and_the_mean_depth_has_one() {
    let truth = [5.0, 10.0, f32::INFINITY, 0.0];
    assert!(matches!(depth_scores(&[1.0; 3], &truth), Err(MetricError::WrongSize { .. })));
    let nan = depth_scores(&[5.0, f32::NAN, 1.0, 1.0], &truth);
    assert!(matches!(nan, Err(MetricError::NonFinite { index: 1 })));
    let negative = depth_scores(&[5.0, -1.0, 1.0, 1.0], &truth);
    assert!(matches!(negative, Err(MetricError::OutOfRange { index: 1, .. })));
    assert_eq!(depth_scores(&[5.0, 10.0, -1.0, 0.0], &truth).unwrap().pixels, 2);
    assert!((depth_scores(&[7.5; 4], &truth).unwrap().abs_rel - 0.375).abs() < 1e-12);
    assert!(!depth_scores(&[1.0], &[0.0]).unwrap_err().is_output_fault());
}

#[test]
fn faulty_boxes_have_no_score_and_no_boxes_have_one() {
    let bounds = BoundingBox { x: 1.0, y: 2.0, width: 50.0, height: 50.0 };
    let object = GroundTruth { class: 3, bounds, area: bounds.area(), is_crowd: false };
    let detection = Detection { class: 3, bounds, score: 0.5 };
    let score = |detection| match_image(&[object], &[detection]);
    let nan = Detection { score: f64::NAN, ..detection };
    assert!(matches!(score(nan), Err(MetricError::NonFinite { index: 0 })));
    let infinite = Detection { bounds: BoundingBox { x: f64::INFINITY, ..bounds }, ..detection };
    assert!(matches!(score(infinite), Err(MetricError::NonFinite { index: 0 })));
    let negative = Detection { bounds: BoundingBox { width: -1.0, ..bounds }, ..detection };
    assert!(matches!(score(negative), Err(MetricError::OutOfRange { index: 0, .. })));
    let broken = GroundTruth { area: f64::NAN, ..object };
    assert!(!match_image(&[broken], &[]).unwrap_err().is_output_fault());
    let none = detection_scores([&match_image(&[object], &[]).unwrap()]);
    assert_eq!((none.ap, none.ar_100, none.ap_small), (Some(0.0), Some(0.0), None));
    assert_eq!(detection_scores([]).ap, None);
}

#[test]
fn faulty_tracks_have_no_score_and_no_tracks_have_one() {
    let bounds = BoundingBox { x: 1.0, y: 2.0, width: 50.0, height: 50.0 };
    let tracked = TrackedBox { track: 4, bounds };
    let frame = |output: Vec<TrackedBox>| TrackingFrame { truth: vec![tracked], output };
    let score = |output| count_matches(&[frame(Vec::new()), frame(output)]);
    let nan = TrackedBox { bounds: BoundingBox { y: f64::NAN, ..bounds }, ..tracked };
    assert!(matches!(score(vec![nan]), Err(MetricError::NonFinite { index: 1 })));
    let negative = TrackedBox { bounds: BoundingBox { height: -1.0, ..bounds }, ..tracked };
    assert!(matches!(score(vec![negative]), Err(MetricError::OutOfRange { index: 1, .. })));
    assert!(matches!(score(vec![tracked; 2]), Err(MetricError::OutOfRange { index: 1, .. })));
    let repeated = TrackingFrame { truth: vec![tracked; 2], output: Vec::new() };
    assert!(!count_matches(&[repeated]).unwrap_err().is_output_fault());
    let scores = score(Vec::new()).unwrap().scores();
    assert_eq!((scores.hota, scores.det_a, scores.ass_a, scores.loc_a), (0.0, 0.0, 0.0, 1.0));
}

#[test]
fn scores_that_are_missing_or_not_finite_have_no_mean() {
    let options = Bootstrap::default();
    let none: [Vec<f64>; 0] = [];
    assert!(summarize(&none, options).is_err());
    assert!(summarize(&[vec![1.0], vec![]], options).is_err());
    assert!(summarize(&[vec![1.0, f64::NAN]], options).is_err());
    assert!(summarize(&[vec![1.0]], Bootstrap { resamples: 39, ..options }).is_err());
    assert!(summarize_differences(&[vec![1.0, 2.0]], &[vec![1.0]], options).is_err());
    // The difference of two infinite scores is not a number.
    assert!(summarize_differences(&[vec![f64::INFINITY]], &[vec![1.0]], options).is_err());
    assert!(bootstrap(3, options, |_| f64::NAN).is_err());
    let one = summarize(&[vec![1.0, 2.0]], options).unwrap();
    assert_eq!((one.pooled.value, one.pooled.interval), (1.5, None));
}

/// The mean of 40 normal values has the standard error `1 / sqrt(40)`. A 95 % interval therefore covers the true mean in
/// about 95 % of 400 trials. The standard error of the share is 1.1 %, and percentile intervals of 40 values cover about
/// 1.5 % less than 95 %. The limits are four standard errors around 93.5 %.
#[test]
fn intervals_cover_the_true_mean() {
    let mut state = 3_u64;
    let mut unit = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((state >> 11) as f64 + 0.5) / (1u64 << 53) as f64
    };
    let mut normal = || (-2.0 * unit().ln()).sqrt() * (std::f64::consts::TAU * unit()).cos();
    let covered = (0..400).filter(|seed| {
        let sequences: Vec<Vec<f64>> = (0..40).map(|_| vec![normal()]).collect();
        let options = Bootstrap { seed: *seed, resamples: 400 };
        let interval = summarize(&sequences, options).unwrap().sequence_mean.interval.unwrap();
        (interval.low..=interval.high).contains(&0.0)
    });
    let share = covered.count() as f64 / 400.0;
    assert!((0.891..=0.979).contains(&share), "{share}");
}
