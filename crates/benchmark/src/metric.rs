//! The table of metrics.

/// The direction in which the value of a metric improves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Better {
    /// A larger value is better.
    Larger,
    /// A smaller value is better.
    Smaller,
    /// A value closer to this target is better.
    CloserTo(f64),
}

/// The description of a metric.
///
/// # Examples
/// ```
/// use spikelane_benchmark::{Better, Metric};
/// let psnr = Metric::find("psnr").unwrap();
/// assert_eq!((psnr.unit, psnr.better, psnr.id()), ("dB", Better::Larger, "psnr/1".to_owned()));
/// assert!(Metric::find("sharpness").is_none());
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Metric {
    /// Name, which is the key in results.
    pub name: &'static str,
    /// Version. It increases if a value changes by more than 1e-6.
    pub version: u32,
    /// Unit of the value. A ratio has the unit `1`, and a value in the unit of the image has the unit `image`.
    pub unit: &'static str,
    /// The direction in which the value improves.
    pub better: Better,
    /// Definition in one sentence.
    pub definition: &'static str,
}

impl Metric {
    /// Returns the metric with this name, or `None`.
    #[must_use]
    pub fn find(name: &str) -> Option<&'static Self> {
        METRICS.iter().find(|metric| metric.name == name)
    }

    /// Returns the name and the version, `name/version`, which determine the value.
    #[must_use]
    pub fn id(&self) -> String {
        format!("{}/{}", self.name, self.version)
    }
}

const fn metric(name: &'static str, unit: &'static str, better: Better, definition: &'static str) -> Metric {
    Metric { name, version: 1, unit, better, definition }
}

use Better::{CloserTo, Larger, Smaller};

/// All metrics, sorted by task.
pub const METRICS: &[Metric] = &[
    metric("psnr", "dB", Larger, "peak signal-to-noise ratio for the data range 1, at most 144.5 dB"),
    metric(
        "ssim",
        "1",
        Larger,
        "structural similarity for the data range 1, Gaussian window of 11x11 pixels",
    ),
    metric("psnr_as_spike_zoo", "dB", Larger, "PSNR of Spike-Zoo, whose data range is 1 or 2"),
    metric(
        "ssim_as_spike_zoo",
        "1",
        Larger,
        "SSIM of Spike-Zoo, uniform window of 7x7 pixels, single precision",
    ),
    metric("psnr_as_spikecv", "dB", Larger, "PSNR of SpikeCV from codes of 8 bits"),
    metric("ssim_as_spikecv", "1", Larger, "SSIM of SpikeCV from codes of 8 bits"),
    metric("detail_slope", "1", CloserTo(1.0), "share of the detail of the reference in the output"),
    metric(
        "high_pass_noise",
        "1",
        Smaller,
        "noise of the high-pass image, relative to the mean of the reference",
    ),
    #[cfg(feature = "ssimulacra2")]
    metric("ssimulacra2", "1", Larger, "perceptual score SSIMULACRA 2.1 of sRGB codes, at most 100"),
    metric("noise_chen", "image", Smaller, "blind noise level of Chen et al. 2015"),
    metric("noise_liu", "image", Smaller, "blind noise level of Liu et al. 2013"),
    metric(
        "blind_snr",
        "dB",
        Larger,
        "mean divided by the noise level of Chen et al. 2015, at most 144.5 dB",
    ),
    metric("cpsnr", "dB", Larger, "PSNR over red, green and blue for the data range 1, at most 144.5 dB"),
    metric("psnr_red", "dB", Larger, "PSNR of red for the data range 1, at most 144.5 dB"),
    metric("psnr_green", "dB", Larger, "PSNR of green for the data range 1, at most 144.5 dB"),
    metric("psnr_blue", "dB", Larger, "PSNR of blue for the data range 1, at most 144.5 dB"),
    metric("ssim_color", "1", Larger, "mean of the SSIM of red, green and blue"),
    metric("ciede2000", "1", Smaller, "mean color difference CIEDE2000 of the pixels"),
    metric("flow_epe", "px", Smaller, "mean endpoint error of visible pixels over the stated interval"),
    metric("flow_outliers", "%", Smaller, "visible pixels with an endpoint error above 3 px and above 5 %"),
    metric("flow_epe_occluded", "px", Smaller, "mean endpoint error of occluded pixels"),
    metric("flow_outliers_occluded", "%", Smaller, "occluded pixels with an error above 3 px and above 5 %"),
    metric("depth_abs_rel", "1", Smaller, "mean absolute error divided by the reference"),
    metric("depth_rmse_log", "1", Smaller, "root mean square of the difference of natural logarithms"),
    metric("depth_delta_1", "1", Larger, "share of pixels within the factor 1.25"),
    metric("depth_delta_2", "1", Larger, "share of pixels within the factor 1.25^2"),
    metric("depth_delta_3", "1", Larger, "share of pixels within the factor 1.25^3"),
    metric("ap", "1", Larger, "COCO average precision over IoU 0.50 to 0.95"),
    metric("ap_50", "1", Larger, "COCO average precision at IoU 0.50"),
    metric("ap_75", "1", Larger, "COCO average precision at IoU 0.75"),
    metric("ap_small", "1", Larger, "COCO average precision of areas up to 32^2 square pixels"),
    metric("ap_medium", "1", Larger, "COCO average precision of areas from 32^2 to 96^2 square pixels"),
    metric("ap_large", "1", Larger, "COCO average precision of areas from 96^2 square pixels"),
    metric("ar_1", "1", Larger, "COCO average recall with 1 detection per image and class"),
    metric("ar_10", "1", Larger, "COCO average recall with 10 detections per image and class"),
    metric("ar_100", "1", Larger, "COCO average recall with 100 detections per image and class"),
    metric("ar_small", "1", Larger, "COCO average recall of areas up to 32^2 square pixels"),
    metric("ar_medium", "1", Larger, "COCO average recall of areas from 32^2 to 96^2 square pixels"),
    metric("ar_large", "1", Larger, "COCO average recall of areas from 96^2 square pixels"),
    metric("hota", "1", Larger, "higher order tracking accuracy, mean over IoU 0.05 to 0.95"),
    metric("det_a", "1", Larger, "detection accuracy of HOTA, mean over IoU 0.05 to 0.95"),
    metric("ass_a", "1", Larger, "association accuracy of HOTA, mean over IoU 0.05 to 0.95"),
    metric("loc_a", "1", Larger, "localization accuracy of HOTA, mean over IoU 0.05 to 0.95"),
];
