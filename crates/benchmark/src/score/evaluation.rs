//! The scores of the output of one sequence.

use std::collections::BTreeMap;

use spikelane::Geometry;
use spikelane::error::{Error, ErrorKind, Result};
use spikelane::reconstruct::DetailReference;
#[cfg(feature = "ssimulacra2")]
use spikelane::sensor::Transfer;
use spikelane::unstable::Count;
use spikelane::unstable::inputs::read_bytes;
use spikelane::unstable::npy::{self, Element};

use super::boxes;
use super::dense;
use super::output_units::{OtherUnit, other_unit};
use crate::detection::ImageMatches;
use crate::generated::{GeneratedGroup, GeneratedSequence, GeneratedSuite};
use crate::run::Baseline;
use crate::suite::Task;
use crate::tracking::TrackingCounts;
use crate::{Metric, MetricError, image};

/// Maximum size of a reference in bytes.
pub(super) const MAX_REFERENCE_BYTES: u64 = 1 << 30;

/// The scores of one sequence.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Evaluation {
    /// The score of each metric. A metric that is not defined for the reference has no score.
    pub scores: BTreeMap<String, f64>,
    /// Why the sequence has the scores of the trivial answer, in one line.
    pub fault: Option<String>,
    /// The counts from which the scores of several sequences follow.
    pub(super) counts: Counts,
    /// The unit of an image that is not linear light of 0 to 1.
    pub(super) other_unit: Option<OtherUnit>,
}

/// The counts of metrics that are not means over sequences.
#[derive(Clone, Debug)]
pub(super) enum Counts {
    None,
    Detection(ImageMatches),
    Tracking(Box<TrackingCounts>),
}

/// The scores of an output, and its counts.
pub(super) type Scored = (BTreeMap<String, f64>, Counts);

/// Scores the output of a sequence.
///
/// `output` contains the bytes of the output file, or is `None` if there is no file. `fault` is the failure of the
/// method. If the method failed or the output is faulty, the scores are those of the trivial answer.
///
/// # Errors
/// [`ErrorKind::Corrupt`] if the stream or the reference was changed, and errors of the reference.
pub fn evaluate_output(
    data: &GeneratedSuite,
    group: &GeneratedGroup,
    sequence: &GeneratedSequence,
    output: Option<&[u8]>,
    fault: Option<&str>,
) -> Result<Evaluation> {
    let metrics = &data.suite.metrics;
    let paths = sequence
        .files
        .iter()
        .map(|file| data.verified_path(&group.name, &sequence.id, file))
        .collect::<Result<Vec<_>>>()?;
    let geometry = Geometry::new(sequence.width, sequence.height)?;
    let attempt = Attempt { output, fault };
    let mut evaluation = match data.suite.task {
        Task::Reconstruction => {
            let reference = reference_image(data, group, sequence, geometry)?;
            attempt
                .evaluate(
                    |bytes| decode_image(bytes, geometry, false),
                    |image| Ok((image_scores(metrics, image, &reference, geometry)?, Counts::None)),
                    || Baseline::Tfp.image(&paths[0], sequence),
                )
                .map(|scored| scored.with_unit(output, geometry, false, &reference))
        }
        Task::Color => {
            let reference = reference_image(data, group, sequence, geometry)?;
            attempt
                .evaluate(
                    |bytes| decode_image(bytes, geometry, true),
                    |image| Ok((color_scores(image, &reference, geometry)?, Counts::None)),
                    || Baseline::TfpBilinear.color_image(&paths[0], sequence),
                )
                .map(|scored| scored.with_unit(output, geometry, true, &reference))
        }
        Task::Flow => {
            let reference = dense::FlowLabels::read(&paths[1], &paths[2], sequence)?;
            attempt.evaluate(
                |bytes| dense::decode_flow(bytes, geometry),
                |flow| Ok((reference.scores(flow)?, Counts::None)),
                || Ok(vec![[0.0; 2]; geometry.pixels()]),
            )
        }
        Task::Depth => {
            let reference = dense::read_depth(&paths[1], geometry)?;
            attempt.evaluate(
                |bytes| dense::decode_depth(bytes, geometry),
                |depth| Ok((dense::depth_metrics(depth, &reference)?, Counts::None)),
                || Ok(vec![crate::suite::TRIVIAL_DEPTH_M; geometry.pixels()]),
            )
        }
        Task::Detection => {
            let labels = boxes::read_labels(&paths[1])?;
            let truth = boxes::detection_truth(&labels, sequence.reference_readout);
            attempt.evaluate(
                boxes::decode_detections,
                |found| boxes::score_detections(&truth, found),
                || Ok(Vec::new()),
            )
        }
        Task::Tracking => {
            let labels = boxes::read_labels(&paths[1])?;
            attempt.evaluate(
                |bytes| boxes::decode_tracks(bytes, &labels),
                |tracks| boxes::score_tracks(&labels, tracks),
                || Ok(BTreeMap::new()),
            )
        }
    }
    .map_err(|e| e.with_context(format_args!("{}/{}", group.name, sequence.id)))?;
    evaluation.scores.retain(|name, _| metrics.iter().any(|metric| metric.name == name));
    Ok(evaluation)
}

/// The output and the failure of a method.
struct Attempt<'a> {
    output: Option<&'a [u8]>,
    fault: Option<&'a str>,
}

impl Attempt<'_> {
    /// Scores the output, or the trivial answer if the output is faulty.
    fn evaluate<T>(
        &self,
        decode: impl Fn(&[u8]) -> std::result::Result<T, String>,
        score: impl Fn(&T) -> std::result::Result<Scored, MetricError>,
        trivial: impl Fn() -> Result<T>,
    ) -> Result<Evaluation> {
        let decoded = match (self.fault, self.output) {
            (Some(fault), _) => Err(fault.to_owned()),
            (None, None) => Err(MetricError::Missing.to_string()),
            (None, Some(bytes)) => decode(bytes),
        };
        let fault = match decoded {
            Err(fault) => fault,
            Ok(output) => match score(&output) {
                Ok((scores, counts)) => {
                    return Ok(Evaluation { scores, fault: None, counts, other_unit: None });
                }
                Err(error) if error.is_output_fault() => error.to_string(),
                Err(error) => return Err(error.into()),
            },
        };
        let (scores, counts) = score(&trivial()?)?;
        Ok(Evaluation { scores, fault: Some(fault), counts, other_unit: None })
    }
}

impl Evaluation {
    /// Adds the unit of the image, if its output is not faulty.
    fn with_unit(self, output: Option<&[u8]>, geometry: Geometry, is_color: bool, reference: &[f32]) -> Self {
        let shape = image_shape(geometry, is_color);
        let values =
            output.filter(|_| self.fault.is_none()).and_then(|bytes| decode_array(bytes, &shape).ok());
        Self { other_unit: values.and_then(|values| other_unit(&values, reference)), ..self }
    }
}

/// Reads the reference image of a sequence: linear light, clipped to 1. The image of a color camera has red, green and blue
/// of each pixel.
///
/// # Errors
/// [`ErrorKind::Corrupt`] if the file was changed.
pub(crate) fn reference_image(
    data: &GeneratedSuite,
    group: &GeneratedGroup,
    sequence: &GeneratedSequence,
    geometry: Geometry,
) -> Result<Vec<f32>> {
    let file = sequence.files.get(1).ok_or_else(|| {
        Error::new(ErrorKind::Config, sequence.id.as_str())
            .found("no reference")
            .expected("a reference image")
    })?;
    let path = data.verified_path(&group.name, &sequence.id, file)?;
    let bytes = read_bytes(&path, "a reference", MAX_REFERENCE_BYTES)?;
    let (_, values) = npy::read_values(&path.display().to_string(), &bytes)?;
    let expected = geometry.pixels() * if sequence.mosaic.is_some() { 3 } else { 1 };
    if values.len() != expected {
        return Err(Error::new(ErrorKind::Input, path.display())
            .found(Count(values.len(), "value"))
            .expected(expected));
    }
    Ok(values.into_iter().map(|v| v.min(1.0) as f32).collect())
}

/// Reads an image from the bytes of an `.npy` file, or returns the fault in one line. Values are clipped to 0..1.
///
/// The shape is (height, width), or (height, width, 3) for a color image.
pub(crate) fn decode_image(
    bytes: &[u8],
    geometry: Geometry,
    is_color: bool,
) -> std::result::Result<Vec<f32>, String> {
    Ok(clipped(&decode_array(bytes, &image_shape(geometry, is_color))?))
}

fn image_shape(geometry: Geometry, is_color: bool) -> Vec<u64> {
    let size = [geometry.height() as u64, geometry.width() as u64];
    size.into_iter().chain(is_color.then_some(3)).collect()
}

fn clipped(image: &[f32]) -> Vec<f32> {
    image.iter().map(|v| v.clamp(0.0, 1.0)).collect()
}

/// Checks the type, the order and the number of the stored elements.
fn check_storage(header: &npy::Header, bytes: &[u8]) -> std::result::Result<(), String> {
    let fault = |found: String, expected: &str| {
        Err(format!("output of the method: found {found}, expected {expected}"))
    };
    if !matches!(header.element, Element::F32 | Element::F64) {
        return fault(
            format!("elements of type {}", header.element),
            "f32 or f64, which is f4 or f8 in NumPy",
        );
    }
    if header.is_fortran_order {
        return fault("an array in Fortran order".into(), "C order; save numpy.ascontiguousarray(array)");
    }
    let end = header.data_bytes().map(|n| n + header.data_offset as u64);
    match (bytes.len() as u64).checked_sub(end.unwrap_or(0)) {
        Some(excess @ 1..) => {
            fault(format!("{} after the array", Count(excess, "byte")), "the end of the file")
        }
        _ => Ok(()),
    }
}

/// Reads the finite values of an array of floats. The shape may contain further sides of length 1.
pub(super) fn decode_array(bytes: &[u8], expected: &[u64]) -> std::result::Result<Vec<f32>, String> {
    let (header, values) = npy::read_values("output of the method", bytes).map_err(|e| e.to_string())?;
    check_storage(&header, bytes)?;
    let sides = |shape: &[u64]| -> Vec<u64> { shape.iter().copied().filter(|side| *side != 1).collect() };
    if sides(&header.shape) != sides(expected) {
        return Err(format!(
            "output of the method: found the shape {}, expected {}",
            npy::shape_text(&header.shape),
            npy::shape_text(expected)
        ));
    }
    let values: Vec<f32> = values.into_iter().map(|v| v as f32).collect();
    match values.iter().position(|v| !v.is_finite()) {
        Some(index) => Err(MetricError::NonFinite { index }.to_string()),
        None => Ok(values),
    }
}

/// The score of a metric that is not defined for an output: a flat image has no detail, and its noise counts as 100 %.
fn undefined_score(name: &str) -> Option<f64> {
    match name {
        "detail_slope" | "blind_snr" => Some(0.0),
        "high_pass_noise" => Some(1.0),
        _ => None,
    }
}

/// Returns the score of each metric. The values of `output` and `reference` are 0 to 1, in linear light.
fn image_scores(
    metrics: &[&'static Metric],
    output: &[f32],
    reference: &[f32],
    geometry: Geometry,
) -> std::result::Result<BTreeMap<String, f64>, MetricError> {
    let output = clipped(output);
    let output = output.as_slice();
    let mut scores = BTreeMap::new();
    for metric in metrics {
        let value = image_score(metric.name, output, reference, geometry);
        let value = match (value, undefined_score(metric.name)) {
            (Ok(value), Some(stated)) if !value.is_finite() => stated,
            (Err(MetricError::Undefined { .. }), Some(stated)) => stated,
            (value, _) => value?,
        };
        scores.insert(metric.name.to_owned(), value);
    }
    Ok(scores)
}

/// Returns all scores of a color image. The values of `output` and `reference` are red, green and blue, 0 to 1, in linear
/// light.
fn color_scores(
    output: &[f32],
    reference: &[f32],
    geometry: Geometry,
) -> std::result::Result<BTreeMap<String, f64>, MetricError> {
    let output = clipped(output);
    let output = output.as_slice();
    let [red, green, blue] = image::color_psnr(output, reference, geometry)?;
    Ok([
        ("cpsnr", image::cpsnr(output, reference, geometry)?),
        ("psnr_red", red),
        ("psnr_green", green),
        ("psnr_blue", blue),
        ("ssim_color", image::color_ssim(output, reference, geometry)?),
        ("ciede2000", image::color_difference(output, reference, geometry)?),
    ]
    .map(|(name, value)| (name.to_owned(), value))
    .into())
}

fn image_score(
    name: &str,
    output: &[f32],
    reference: &[f32],
    geometry: Geometry,
) -> std::result::Result<f64, MetricError> {
    let detail = || {
        let observations = [reference.to_vec(), reference.to_vec()];
        image::detail(output, &DetailReference { observations, mask: None, is_scene: true }, geometry)
    };
    match name {
        "psnr" => image::psnr(output, reference, geometry),
        "ssim" => image::ssim(output, reference, geometry),
        "psnr_as_spike_zoo" => image::psnr_as_spike_zoo(output, reference, geometry),
        "ssim_as_spike_zoo" => image::ssim_as_spike_zoo(output, reference, geometry),
        "psnr_as_spikecv" => image::psnr_as_spikecv(output, reference, geometry),
        "ssim_as_spikecv" => image::ssim_as_spikecv(output, reference, geometry),
        "detail_slope" => detail().map(|scores| scores.slope),
        "high_pass_noise" => detail().map(|scores| scores.noise),
        "noise_chen" => image::noise_chen(output, geometry),
        "noise_liu" => image::noise_liu(output, geometry),
        "blind_snr" => image::blind_snr(output, geometry),
        #[cfg(feature = "ssimulacra2")]
        "ssimulacra2" => {
            let codes = |image: &[f32]| -> Vec<f32> {
                image.iter().map(|v| Transfer::Srgb.code(f64::from(*v)) as f32).collect()
            };
            image::ssimulacra2(&codes(output), &codes(reference), geometry)
        }
        other => Err(MetricError::reference(
            "metrics of the suite",
            format!("`{other}`"),
            "a metric of the task reconstruction",
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faulty_images_have_a_fault_in_one_line() {
        let geometry = Geometry::new(3, 2).unwrap();
        let image = |shape: &[u64], values: &[f32]| {
            npy::to_bytes(Element::F32, shape, values.iter().map(|v| v.to_le_bytes())).unwrap()
        };
        let good = image(&[2, 3], &[0.5, 2.0, -1.0, 0.0, 1.0, 0.25]);
        assert_eq!(decode_image(&good, geometry, false).unwrap(), [0.5, 1.0, 0.0, 0.0, 1.0, 0.25]);
        assert!(decode_image(&image(&[1, 2, 3], &[0.5; 6]), geometry, false).is_ok());
        let nan = image(&[2, 3], &[0.5, f32::NAN, 0.0, 0.0, 0.0, 0.0]);
        let integers = npy::to_bytes(Element::U8, &[2, 3], [[0_u8]; 6].into_iter()).unwrap();
        let half = npy::to_bytes(Element::F16, &[2, 3], [[0_u8; 2]; 6].into_iter()).unwrap();
        let text = String::from_utf8_lossy(&good[10..128]).replace("False", "True ");
        let fortran = [&good[..10], text.as_bytes(), &good[128..]].concat();
        for (bytes, word) in [
            (&good[..good.len() - 4], "truncated"),
            (&nan, "NaN at index 1"),
            (&image(&[3, 2], &[0.5; 6]), "[3, 2]"),
            (&integers, "f4 or f8"),
            (&[&good[..], b"x"].concat(), "1 byte after the array"),
            (&half, "type f16"),
            (&fortran, "Fortran order"),
            (&b"no array"[..], "output of the method"),
        ] {
            let fault = decode_image(bytes, geometry, false).unwrap_err();
            assert!(fault.contains(word) && !fault.contains('\n'), "{fault}");
        }
    }
}
