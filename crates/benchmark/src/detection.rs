//! Metrics of object detection: the average precision and recall of COCO.
//!
//! Two steps allow resampling: [`match_image`] compares the boxes of one image, and [`detection_scores`] combines any
//! selection of images. The values equal those of `COCOeval` in pycocotools for boxes.

use std::cmp::Ordering;
use std::collections::BTreeMap;

use crate::{BoundingBox, MetricError, Result};

/// Number of thresholds of the intersection over union: 0.50 to 0.95 in steps of 0.05.
const THRESHOLDS: usize = 10;

/// Number of recall points: 0 to 1 in steps of 0.01.
const RECALL_POINTS: usize = 101;

/// Largest numbers of detections per image and class.
const MAX_DETECTIONS: [usize; 3] = [1, 10, 100];

/// Ranges of the area in square pixels: all, small, medium, large. Both ends belong to a range.
const AREA_RANGES: [[f64; 2]; 4] = [[0.0, 1e10], [0.0, 1024.0], [1024.0, 9216.0], [9216.0, 1e10]];

/// An object in an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GroundTruth {
    /// Class of the object.
    pub class: u32,
    /// The box of the object.
    pub bounds: BoundingBox,
    /// Area in square pixels, which selects the area range. COCO uses the area of the object's mask.
    pub area: f64,
    /// Whether the box is a region to ignore.
    ///
    /// Detections in such a region are neither correct nor false. A detection matches the region if the intersection is a
    /// sufficient share of the detection, and several detections can match one region.
    pub is_crowd: bool,
}

/// A detection of a method.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Detection {
    /// Class of the detected object.
    pub class: u32,
    /// The box of the detected object.
    pub bounds: BoundingBox,
    /// Confidence. Only the order of the scores matters.
    pub score: f64,
}

/// The result for a detection.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Outcome {
    Correct,
    False,
    Ignored,
}

/// The matches of one class in one image.
#[derive(Clone, Debug)]
struct ClassMatches {
    /// Scores, from large to small.
    scores: Vec<f64>,
    /// Number of objects in each area range that are not ignored.
    objects: [usize; AREA_RANGES.len()],
    /// The outcome of each detection for each area range and threshold.
    outcomes: [[Vec<Outcome>; THRESHOLDS]; AREA_RANGES.len()],
}

/// The matches between the objects and the detections of one image.
#[derive(Clone, Debug)]
pub struct ImageMatches {
    classes: BTreeMap<u32, ClassMatches>,
}

/// The scores of COCO, 0 to 1. A score is `None` if no image contains an object of its area range.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct DetectionScores {
    /// Average precision: the mean over classes, thresholds 0.50 to 0.95, and 101 recall points.
    pub ap: Option<f64>,
    /// Average precision at the threshold 0.50.
    pub ap_50: Option<f64>,
    /// Average precision at the threshold 0.75.
    pub ap_75: Option<f64>,
    /// Average precision of areas up to 32^2 square pixels.
    pub ap_small: Option<f64>,
    /// Average precision of areas from 32^2 to 96^2 square pixels.
    pub ap_medium: Option<f64>,
    /// Average precision of areas from 96^2 square pixels.
    pub ap_large: Option<f64>,
    /// Average recall with 1 detection per image and class: the mean over classes and thresholds.
    pub ar_1: Option<f64>,
    /// Average recall with 10 detections per image and class.
    pub ar_10: Option<f64>,
    /// Average recall with 100 detections per image and class.
    pub ar_100: Option<f64>,
    /// Average recall of areas up to 32^2 square pixels.
    pub ar_small: Option<f64>,
    /// Average recall of areas from 32^2 to 96^2 square pixels.
    pub ar_medium: Option<f64>,
    /// Average recall of areas from 96^2 square pixels.
    pub ar_large: Option<f64>,
}

/// Matches the detections of one image with its objects.
///
/// For each class, only the 100 detections with the largest scores are used. From the largest to the smallest score, a
/// detection matches the free object of its class with the largest intersection over union, if this is at least the
/// threshold. Objects outside the area range and crowd regions are ignored, and other objects have priority over them. A
/// detection without a match is ignored if its own area is outside the area range.
///
/// # Examples
/// ```
/// use spikelane_benchmark::BoundingBox;
/// use spikelane_benchmark::detection::{Detection, GroundTruth, detection_scores, match_image};
/// let bounds = BoundingBox { x: 0.0, y: 0.0, width: 20.0, height: 20.0 };
/// let object = GroundTruth { class: 1, bounds, area: 400.0, is_crowd: false };
/// let crowd = GroundTruth { bounds: BoundingBox { x: 50.0, width: 200.0, ..bounds }, is_crowd: true, ..object };
/// let found = Detection { class: 1, bounds, score: 0.5 };
/// // A detection in a crowd region is not a false detection, although its score is larger.
/// let ignored = Detection { bounds: BoundingBox { x: 100.0, ..bounds }, score: 0.9, ..found };
/// let scores = detection_scores([&match_image(&[object, crowd], &[found, ignored])?]);
/// assert!((scores.ap.unwrap() - 1.0).abs() < 1e-9);
/// # Ok::<(), spikelane_benchmark::MetricError>(())
/// ```
///
/// # Errors
/// [`MetricError`] if a box or a score is not finite, if a side is negative, or if an area of an object is negative.
pub fn match_image(truth: &[GroundTruth], detections: &[Detection]) -> Result<ImageMatches> {
    check(truth, detections)?;
    let mut by_class: BTreeMap<u32, (Vec<&GroundTruth>, Vec<&Detection>)> = BTreeMap::new();
    for object in truth {
        by_class.entry(object.class).or_default().0.push(object);
    }
    for detection in detections {
        by_class.entry(detection.class).or_default().1.push(detection);
    }
    let matches = by_class.into_iter().map(|(class, (objects, mut detections))| {
        // The sort is stable: detections with equal scores keep their order.
        detections.sort_by(|a, b| descending(a.score, b.score));
        detections.truncate(MAX_DETECTIONS[2]);
        (class, match_class(&objects, &detections))
    });
    Ok(ImageMatches { classes: matches.collect() })
}

/// Returns the scores of images.
///
/// For each class, the detections of all images are sorted by their scores. With `t` correct and `f` false detections so
/// far and `n` objects, the recall is `t / n` and the precision is `t / (t + f)`. The precision at a recall point is the
/// largest precision at this recall or above, and 0 if the recall is not reached. Classes without objects are skipped.
///
/// # Examples
/// ```
/// use spikelane_benchmark::BoundingBox;
/// use spikelane_benchmark::detection::{Detection, GroundTruth, detection_scores, match_image};
/// let bounds = BoundingBox { x: 10.0, y: 10.0, width: 40.0, height: 20.0 };
/// let object = GroundTruth { class: 1, bounds, area: bounds.area(), is_crowd: false };
/// // The intersection over union is 36/44 = 0.82, which reaches the thresholds 0.50 to 0.80.
/// let detection = Detection { class: 1, bounds: BoundingBox { x: 14.0, ..bounds }, score: 0.9 };
/// let scores = detection_scores([&match_image(&[object], &[detection])?]);
/// assert!((scores.ap.unwrap() - 0.7).abs() < 1e-9);
/// assert_eq!(scores.ap_large, None);
/// // Without a detection, the score is 0.
/// assert_eq!(detection_scores([&match_image(&[object], &[])?]).ap, Some(0.0));
/// # Ok::<(), spikelane_benchmark::MetricError>(())
/// ```
#[must_use]
pub fn detection_scores<'a>(images: impl IntoIterator<Item = &'a ImageMatches>) -> DetectionScores {
    let mut by_class: BTreeMap<u32, Vec<&ClassMatches>> = BTreeMap::new();
    for (class, matches) in images.into_iter().flat_map(|image| &image.classes) {
        by_class.entry(*class).or_default().push(matches);
    }
    let curves = |area: usize, max_detections: usize| -> Vec<Curve> {
        by_class.values().filter_map(|images| class_curve(images, area, max_detections)).collect()
    };
    let [all, small, medium, large] = [0, 1, 2, 3].map(|area| curves(area, MAX_DETECTIONS[2]));
    let precision = |curves: &[Curve], thresholds: std::ops::Range<usize>| {
        mean(curves.iter().flat_map(|c| c.precision[thresholds.clone()].iter().flatten().copied()))
    };
    let recall = |curves: &[Curve]| mean(curves.iter().flat_map(|c| c.recall));
    DetectionScores {
        ap: precision(&all, 0..THRESHOLDS),
        ap_50: precision(&all, 0..1),
        ap_75: precision(&all, 5..6),
        ap_small: precision(&small, 0..THRESHOLDS),
        ap_medium: precision(&medium, 0..THRESHOLDS),
        ap_large: precision(&large, 0..THRESHOLDS),
        ar_1: recall(&curves(0, MAX_DETECTIONS[0])),
        ar_10: recall(&curves(0, MAX_DETECTIONS[1])),
        ar_100: recall(&all),
        ar_small: recall(&small),
        ar_medium: recall(&medium),
        ar_large: recall(&large),
    }
}

/// Returns the threshold with index `k`, with the rounding of `numpy.linspace(0.5, 0.95, 10)`.
fn threshold(k: usize) -> f64 {
    let step = (0.95 - 0.5) / (THRESHOLDS - 1) as f64;
    if k + 1 == THRESHOLDS { 0.95 } else { k as f64 * step + 0.5 }
}

/// Returns the recall point with index `k`, with the rounding of `numpy.linspace(0, 1, 101)`.
fn recall_point(k: usize) -> f64 {
    if k + 1 == RECALL_POINTS { 1.0 } else { k as f64 * 0.01 }
}

fn descending(a: f64, b: f64) -> Ordering {
    b.partial_cmp(&a).unwrap_or(Ordering::Equal)
}

fn is_outside(area: f64, range: [f64; 2]) -> bool {
    area < range[0] || area > range[1]
}

/// Matches the objects of one class with its detections, which are sorted by score.
fn match_class(objects: &[&GroundTruth], detections: &[&Detection]) -> ClassMatches {
    let overlap = |detection: &Detection, object: &GroundTruth| {
        if object.is_crowd {
            let shared = detection.bounds.intersection(object.bounds);
            if shared > 0.0 { shared / detection.bounds.area() } else { 0.0 }
        } else {
            detection.bounds.intersection_over_union(object.bounds)
        }
    };
    let overlaps: Vec<Vec<f64>> =
        detections.iter().map(|d| objects.iter().map(|o| overlap(d, o)).collect()).collect();
    let is_ignored =
        |object: &GroundTruth, area: usize| object.is_crowd || is_outside(object.area, AREA_RANGES[area]);
    let outcomes = std::array::from_fn(|area| {
        let ignored: Vec<bool> = objects.iter().map(|o| is_ignored(o, area)).collect();
        // Objects that are not ignored come first. Otherwise the order stays.
        let mut order: Vec<usize> = (0..objects.len()).collect();
        order.sort_by_key(|i| ignored[*i]);
        std::array::from_fn(|k| {
            let mut is_taken = vec![false; objects.len()];
            let outcome = |(detection, overlaps): (&&Detection, &Vec<f64>)| {
                let found = best_object(overlaps, threshold(k), &order, |i| {
                    (is_taken[i] && !objects[i].is_crowd, ignored[i])
                });
                if let Some(i) = found {
                    is_taken[i] = true;
                }
                match found {
                    Some(i) if ignored[i] => Outcome::Ignored,
                    Some(_) => Outcome::Correct,
                    None if is_outside(detection.bounds.area(), AREA_RANGES[area]) => Outcome::Ignored,
                    None => Outcome::False,
                }
            };
            detections.iter().zip(&overlaps).map(outcome).collect()
        })
    });
    ClassMatches {
        scores: detections.iter().map(|d| d.score).collect(),
        objects: std::array::from_fn(|area| objects.iter().filter(|o| !is_ignored(o, area)).count()),
        outcomes,
    }
}

/// Returns the free object with the largest overlap, or `None` if no overlap reaches the threshold.
///
/// `state` returns whether an object is taken and whether it is ignored. `order` lists ignored objects last, and an
/// ignored object is selected only if no other object is.
fn best_object(
    overlaps: &[f64],
    threshold: f64,
    order: &[usize],
    state: impl Fn(usize) -> (bool, bool),
) -> Option<usize> {
    let mut best: Option<(usize, bool)> = None;
    let mut largest = threshold.min(1.0 - 1e-10);
    for i in order {
        let (is_taken, is_ignored) = state(*i);
        if is_taken {
            continue;
        }
        if is_ignored && best.is_some_and(|(_, ignored)| !ignored) {
            break;
        }
        if overlaps[*i] >= largest {
            largest = overlaps[*i];
            best = Some((*i, is_ignored));
        }
    }
    best.map(|(i, _)| i)
}

/// Precision at the recall points and the largest recall, for each threshold.
struct Curve {
    precision: [[f64; RECALL_POINTS]; THRESHOLDS],
    recall: [f64; THRESHOLDS],
}

/// Returns the curve of a class, or `None` if all objects are ignored.
fn class_curve(images: &[&ClassMatches], area: usize, max_detections: usize) -> Option<Curve> {
    let objects: usize = images.iter().map(|image| image.objects[area]).sum();
    if objects == 0 {
        return None;
    }
    let used = |image: &ClassMatches| image.scores.len().min(max_detections);
    let mut order: Vec<(usize, usize)> =
        images.iter().enumerate().flat_map(|(i, image)| (0..used(image)).map(move |d| (i, d))).collect();
    order.sort_by(|a, b| descending(images[a.0].scores[a.1], images[b.0].scores[b.1]));
    let mut curve = Curve { precision: [[0.0; RECALL_POINTS]; THRESHOLDS], recall: [0.0; THRESHOLDS] };
    for k in 0..THRESHOLDS {
        let (mut correct, mut wrong) = (0_usize, 0_usize);
        // An ignored detection adds a point with the values of the detection before it.
        let points: Vec<(f64, f64)> = order
            .iter()
            .map(|(i, d)| {
                match images[*i].outcomes[area][k][*d] {
                    Outcome::Correct => correct += 1,
                    Outcome::False => wrong += 1,
                    Outcome::Ignored => {}
                }
                let found = correct as f64;
                (found / objects as f64, found / (wrong as f64 + found + f64::EPSILON))
            })
            .collect();
        let mut largest = 0.0;
        let envelope: Vec<f64> = points
            .iter()
            .rev()
            .map(|(_, p)| {
                largest = p.max(largest);
                largest
            })
            .collect();
        curve.recall[k] = points.last().map_or(0.0, |(recall, _)| *recall);
        for (r, precision) in curve.precision[k].iter_mut().enumerate() {
            let first = points.partition_point(|(recall, _)| *recall < recall_point(r));
            if first < points.len() {
                *precision = envelope[points.len() - 1 - first];
            }
        }
    }
    Some(curve)
}

fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, count) = values.fold((0.0, 0_usize), |(sum, count), x| (sum + x, count + 1));
    (count > 0).then(|| sum / count as f64)
}

fn check(truth: &[GroundTruth], detections: &[Detection]) -> Result<()> {
    let is_valid = |o: &GroundTruth| {
        o.bounds.is_finite() && o.bounds.has_valid_sides() && o.area.is_finite() && o.area >= 0.0
    };
    if let Some(index) = truth.iter().position(|object| !is_valid(object)) {
        let found = format!("an invalid box at index {index}");
        return Err(MetricError::reference("objects of an image", found, "finite boxes with areas from 0"));
    }
    if let Some(index) = detections.iter().position(|d| !(d.bounds.is_finite() && d.score.is_finite())) {
        return Err(MetricError::NonFinite { index });
    }
    match detections.iter().position(|d| !d.bounds.has_valid_sides()) {
        Some(index) => Err(MetricError::OutOfRange { index, requirement: "sides of at least 0" }),
        None => Ok(()),
    }
}
