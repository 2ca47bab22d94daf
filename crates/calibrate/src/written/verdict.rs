//! What a calibration may be used for, in a sentence with its cautions.

use crate::result::{Calibration, Lamp};
use spikelane_measure::Estimate;

/// A typical chi-square per degree of freedom from which lines are doubted; with some hundred pixels it is known to ten per cent.
const DOUBTED: f64 = 1.5;

/// Share of pixels that tell nothing from which that is a caution.
const MANY: f64 = 0.01;

impl Calibration {
    /// Whether the camera follows its recordings, how well its gain is known, and how many cautions there are.
    #[must_use]
    pub fn verdict(&self) -> String {
        let gain = self.population.mean_a;
        let known = format!("the mean gain is known to {:.2} %", 100.0 * gain.error / gain.value);
        match self.cautions().len() {
            0 => format!("The camera follows its recordings; {known}."),
            1 => format!("The camera may be used with one caution; {known}."),
            n => format!("The camera may be used with {n} cautions; {known}."),
        }
    }

    /// What a user of this camera has to know: lamps that are off or drift, what was left nominal, pixels without a line.
    #[must_use]
    pub fn cautions(&self) -> Vec<String> {
        let mut said = self.cautions_of_lamps();
        if self.bends {
            said.push("The levels found bend against the stated ones: the camera is linear, a measured response may not be.".to_owned());
        }
        if let Some(chi2) = self.chi2_per_freedom().filter(|x| *x > DOUBTED) {
            said.push(format!("Pixels do not follow the light in straight lines: the typical chi-square per degree of freedom is {chi2:.1}."));
        }
        if !self.redrawn_told {
            said.push("When threshold noise is redrawn could not be told: the camera file has the nominal rule, at every reset.".to_owned());
        }
        let assumed = |what: &str, e: Estimate| {
            let digits = if e.value >= 100.0 { 0 } else { 6 };
            (!e.error.is_finite()).then(|| {
                format!("{what} could not be told: the camera file has the nominal {:.digits$}.", e.value)
            })
        };
        said.extend(assumed("The electrons of a spike", self.electrons));
        said.extend(assumed("The threshold noise", self.sigma_t));
        let (unknown, all) = (self.unknown().len(), self.fits.len());
        if unknown as f64 > MANY * all as f64 {
            said.push(format!(
                "{unknown} of {all} pixels tell nothing: the camera file has the population's means there."
            ));
        }
        said
    }

    fn cautions_of_lamps(&self) -> Vec<String> {
        let lit = self.levels.iter().filter(|l| l.stated > 0.0).count();
        let named = |of: fn(&&Lamp) -> bool| -> Vec<&str> {
            self.levels.iter().filter(of).map(|l| l.file.as_str()).collect()
        };
        let mut said = Vec::new();
        let mut add = |files: Vec<&str>, what: &str| {
            if !files.is_empty() {
                said.push(format!("{} of {lit} lit levels {what}: {}.", files.len(), files.join(", ")));
            }
        };
        add(named(|l| l.wrong), "lie off their stated light");
        add(named(|l| l.drifts && l.stated > 0.0), "drift");
        add(named(|l| l.saturated), "saturate the camera");
        if self.levels.iter().any(|l| l.drifts && l.stated == 0.0) {
            said.push("The dark current drifts within its recording.".to_owned());
        }
        said
    }
}
