//! The verdict on a calibration and the cautions for its user.

use crate::recordings::observations::Flicker;
use crate::result::{Calibration, Lamp};
use spikelane_measure::Estimate;
use spikelane_measure::report::without_error;

/// If the typical chi-square per degree of freedom exceeds this ratio, a caution about nonlinear pixel responses is
/// issued. For a hundred pixels the error of the typical chi-square is about 10 %.
const CHI2_CAUTION_RATIO: f64 = 1.5;

/// If the share of unfitted pixels exceeds this value, a caution is issued.
const UNFITTED_CAUTION_SHARE: f64 = 0.01;

impl Calibration {
    /// Returns one sentence. It reports whether the camera agrees with its recordings, the relative error of its mean
    /// gain, and the number of cautions.
    #[must_use]
    pub fn verdict(&self) -> String {
        let gain = self.population.mean_a;
        let known =
            format!("the relative error of the mean gain is {:.2} %", 100.0 * gain.error / gain.value);
        match self.cautions().len() {
            0 => format!("The camera agrees with the recordings; {known}."),
            1 => format!("The camera is usable with one caution; {known}."),
            n => format!("The camera is usable with {n} cautions; {known}."),
        }
    }

    /// Returns the cautions for users of this camera. They concern wrong or drifting lamps, assumed nominal values, and
    /// unfitted pixels.
    #[must_use]
    pub fn cautions(&self) -> Vec<String> {
        let mut cautions = self.lamp_cautions();
        if self.is_nonlinear {
            cautions.push("The estimated levels deviate from a line: the camera file is linear, but the response of the measured camera may not be linear.".to_owned());
        }
        if let Some(chi2) = self.reduced_chi2().filter(|x| *x > CHI2_CAUTION_RATIO) {
            cautions.push(format!("The pixel responses are not linear: the typical chi-square per degree of freedom is {chi2:.1}."));
        }
        if let Some(field) = &self.light_field {
            cautions.push(format!(
                "The light falls off by {:.1} % toward the corners: the gains of the camera file are relative to this shape.",
                100.0 * field.corner_falloff.value
            ));
        }
        if self.mosaic.is_some() && !self.is_mosaic_declared {
            cautions.push(
                "The pixels of a 2x2 cell receive different light, as behind a mosaic of color filters: the colors of the filters in the camera file are unknown."
                    .to_owned(),
            );
        } else if self.mosaic.is_none() && !self.class_gains.is_empty() {
            cautions.push("The pixels of a 2x2 cell have different mean gains.".to_owned());
        }
        for channel in &self.channels {
            if let Some(deviation) = channel.largest_light_deviation() {
                cautions.push(format!(
                    "The color of the lamps changes with the level: in the channel {}, the light of a level deviates by {:+.1} % +- {:.1} %.",
                    channel.name,
                    100.0 * deviation.value,
                    100.0 * deviation.error
                ));
            }
        }
        if !self.is_noise_sampling_identified {
            cautions.push("The recordings do not show when threshold noise is redrawn: the camera file uses the nominal setting, every reset.".to_owned());
        }
        let assumed = |what: &str, e: Estimate| {
            (!e.error.is_finite()).then(|| {
                format!(
                    "{what} could not be estimated: the camera file has the nominal {}.",
                    without_error(e.value)
                )
            })
        };
        cautions.extend(assumed("The number of electrons per threshold", self.electrons_per_threshold));
        cautions.extend(assumed("The threshold noise", self.sigma_t));
        let (unknown, all) = (self.unfitted_pixels().len(), self.fits.len());
        if unknown as f64 > UNFITTED_CAUTION_SHARE * all as f64 {
            cautions.push(format!(
                "{unknown} of {all} pixels provide no estimate: the camera file has the population means for these pixels."
            ));
        }
        cautions
    }

    fn lamp_cautions(&self) -> Vec<String> {
        let lit = || self.lamps.iter().filter(|l| l.stated_light > 0.0);
        let all = lit().count();
        let mut cautions = Vec::new();
        let mut add = |lamps: Vec<&Lamp>, what: &str| {
            if !lamps.is_empty() {
                let files: Vec<&str> = lamps.iter().map(|l| l.file.as_str()).collect();
                cautions.push(format!("{} of {all} lit levels {what}: {}.", files.len(), files.join(", ")));
            }
        };
        add(lit().filter(|l| l.is_outlier).collect(), "deviate from their stated light");
        for is_removed in [false, true] {
            let changed = || lit().filter(|l| l.is_light_change_removed == is_removed);
            let result = if is_removed { ", and this change is removed" } else { "" };
            add(changed().filter(|l| l.drifts).collect(), &format!("drift{result}"));
            let flickering: Vec<&Lamp> = changed().filter(|l| l.flicker.is_some()).collect();
            let deepest =
                flickering.iter().filter_map(|l| l.flicker).max_by(|a, b| a.depth.total_cmp(&b.depth));
            if let Some(Flicker { frequency_hz, depth, .. }) = deepest {
                let depth = 100.0 * depth;
                add(flickering, &format!("flicker by up to {depth:.2} % at {frequency_hz:.1} Hz{result}"));
            }
        }
        add(lit().filter(|l| l.is_saturated).collect(), "saturate the camera");
        for dark in self.lamps.iter().filter(|l| l.stated_light == 0.0) {
            if dark.drifts {
                cautions.push("The dark current drifts within the dark recording.".to_owned());
            }
            if let Some(Flicker { frequency_hz, depth, .. }) = dark.flicker {
                cautions.push(format!(
                    "The dark recording {} oscillates at {frequency_hz:.1} Hz by {:.2} %: light reaches the sensor, and its intervals are not used.",
                    dark.file,
                    100.0 * depth
                ));
            }
        }
        cautions
    }
}
