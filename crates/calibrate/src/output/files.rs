//! The files of a calibration: camera file, maps, JSON and HTML report.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::emva_1288::sheet_json;
use crate::population::mean_and_sd;
use crate::result::{AdditiveSum, Additivity, Calibration, ChannelFit, Lamp, LightField};
use crate::snee::{SneeMaps, SneePixel};
use spikelane::error::{Error, ErrorKind, Result};
use spikelane::pixel::NoiseSampling;
use spikelane::sensor::Mosaic;
use spikelane::unstable::npy;
use spikelane_measure::report::{RunRecord, insert_present};
use spikelane_measure::{Estimate, median};

/// The paths of the files of a calibration.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct CalibrationFiles {
    /// Path of `camera.toml`. It is an input of `simulate`.
    pub camera: PathBuf,
    /// Path of `calibration.json`.
    pub calibration_json: PathBuf,
    /// Path of `report.html`.
    pub report: PathBuf,
}

/// Returns an estimate as JSON. Value and error are omitted if they are not finite.
fn estimate_json(e: Estimate) -> Value {
    let parts = [("value", e.value), ("error", e.error)];
    parts.into_iter().filter(|(_, x)| x.is_finite()).map(|(key, x)| (key.to_owned(), json!(x))).collect()
}

fn lamp_json(l: &Lamp) -> Value {
    let fields = json!({
        "file": l.file, "stated_light": l.stated_light, "stated_uncertainty": l.stated_uncertainty, "found_light": l.found_light(),
        "deviation": estimate_json(l.deviation), "is_outlier": l.is_outlier, "is_saturated": l.is_saturated, "drifts": l.drifts,
        "is_light_change_removed": l.is_light_change_removed,
        "readouts": l.readouts, "mean_rate": l.mean_rate, "rate_scatter": l.rate_scatter,
    });
    let pull = l.pull().filter(|x| x.is_finite()).map(Into::into);
    let flicker = l.flicker.map(|f| json!(f));
    insert_present(
        fields,
        [("light_change", l.light_change.map(estimate_json)), ("flicker", flicker), ("pull", pull)],
    )
}

fn additivity_json(a: &Additivity) -> Value {
    let sum = |s: &AdditiveSum| json!({ "file": s.file, "sources": s.sources, "residual": estimate_json(s.residual) });
    json!({ "sums": a.sums.iter().map(sum).collect::<Vec<_>>(), "curvature": estimate_json(a.curvature) })
}

impl Calibration {
    /// Returns the calibration without the maps as JSON. Unknown numbers are omitted.
    #[must_use]
    pub fn to_json(&self) -> Value {
        let p = &self.population;
        let document = json!({
            "width": self.sensor.geometry.width(),
            "height": self.sensor.geometry.height(),
            "readout_hz": self.sensor.readout_hz,
            "population": {
                "mean_a": estimate_json(p.mean_a), "sd_a": estimate_json(p.sd_a),
                "mean_d": estimate_json(p.mean_d), "sd_d": estimate_json(p.sd_d),
                "covariance": estimate_json(p.covariance), "sigma_phi": estimate_json(p.sigma_phi),
            },
            "sigma_t": estimate_json(self.sigma_t),
            "electrons_per_threshold": estimate_json(self.electrons_per_threshold),
            "photons_at_full_light": estimate_json(self.photons_at_full_light),
            "dark_shot_noise": self.dark_shot_noise,
            "is_noise_sampling_identified": self.is_noise_sampling_identified,
            "noise_sampling": if self.noise_sampling == NoiseSampling::EveryReadout { "every-readout" } else { "every-reset" },
            "redraw_share": estimate_json(self.redraw_share),
            "class_gains": self.class_gains.iter().copied().map(estimate_json).collect::<Vec<_>>(),
            "dead_time_fraction": self.dead_time_fraction,
            "light_scale_error": self.light_scale_error,
            "is_nonlinear": self.is_nonlinear,
            "lamps": self.lamps.iter().map(lamp_json).collect::<Vec<_>>(),
            "unfitted_pixels": self.unfitted_pixels(),
            "dead_pixels": self.dead_pixels, "hot_pixels": self.hot_pixels, "poor_fit_pixels": self.poor_fit_pixels,
            "verdict": self.verdict(), "cautions": self.cautions(),
            "notes": self.notes,
        });
        let field =
            |f: &LightField| json!({ "corner_falloff": estimate_json(f.corner_falloff), "terms": f.terms });
        let optional_fields = [
            ("emva_1288", Some(sheet_json(self))),
            ("mosaic", self.mosaic.as_ref().map(|mosaic| self.mosaic_json(mosaic))),
            ("light_field", self.light_field.as_ref().map(field)),
            ("camera", self.recorded_camera.as_ref().map(|camera| json!(camera))),
            ("additivity", self.additivity.as_ref().map(additivity_json)),
            ("nonlinearity", self.nonlinearity.map(estimate_json)),
            ("reduced_chi2", self.reduced_chi2().map(Into::into)),
            ("snee", self.snee.as_ref().map(|paper| self.snee_json(paper))),
        ];
        insert_present(document, optional_fields)
    }

    /// Returns the pixels that have no fit. The files contain the means of the population for these pixels.
    #[must_use]
    pub fn unfitted_pixels(&self) -> Vec<usize> {
        (0..self.fits.len()).filter(|p| !self.fits[*p].a.is_finite()).collect()
    }

    fn mosaic_json(&self, mosaic: &Mosaic) -> Value {
        let channel = |c: &ChannelFit| {
            let p = &c.population;
            json!({
                "name": c.name, "pixels": c.pixels, "light": estimate_json(c.light),
                "light_deviations": c.light_deviations.iter().copied().map(estimate_json).collect::<Vec<_>>(),
                "mean_a": estimate_json(p.mean_a), "sd_a": estimate_json(p.sd_a),
                "mean_d": estimate_json(p.mean_d), "sd_d": estimate_json(p.sd_d),
            })
        };
        json!({
            "pattern": mosaic.to_string(),
            "is_declared": self.is_mosaic_declared,
            "channels": self.channels.iter().map(channel).collect::<Vec<_>>(),
        })
    }

    fn snee_json(&self, paper: &SneeMaps) -> Value {
        let moments = |value: fn(&SneePixel) -> f64| {
            let (mean, sd) = mean_and_sd(&paper.map(value));
            json!({ "mean": mean, "sd": sd })
        };
        json!({
            "box_half_width": paper.box_half_width,
            "edge_counts": paper.edge_counts(),
            "edge_share": paper.edge_counts().edge_share(),
            "light_scale": paper.light_scale,
            "a": moments(|s| s.alpha / s.phi), "d": moments(|s| s.dark / s.phi),
            "phi": moments(|s| s.phi), "c_s": moments(|s| s.c_s), "v_s": moments(|s| s.v_s),
        })
    }

    /// Returns the median over the pixels of chi-square per degree of freedom. Returns `None` if no pixel has a degree of
    /// freedom.
    #[must_use]
    pub fn reduced_chi2(&self) -> Option<f64> {
        let chi2_ratio = |f: &crate::formulas::fit::PixelFit| f.chi2 / f64::from(f.degrees_of_freedom);
        let good = self.fits.iter().filter(|f| f.degrees_of_freedom > 0 && f.chi2.is_finite());
        let mut all: Vec<f64> = good.map(chi2_ratio).collect();
        (!all.is_empty()).then(|| median(&mut all))
    }

    /// Returns the maps of the fit and their names. Pixels without a fit have the means and spreads of the population. In
    /// the map `known` they have the value 0.
    pub(crate) fn maps(&self) -> [(&'static str, Vec<f64>); 8] {
        let p = &self.population;
        let of_population = crate::formulas::fit::PixelFit {
            a: p.mean_a.value,
            d: p.mean_d.value,
            var_a: p.sd_a.value.powi(2),
            var_d: p.sd_d.value.powi(2),
            chi2: 0.0,
            ..crate::formulas::fit::PixelFit::NAN
        };
        let known = |f: &crate::formulas::fit::PixelFit| f.a.is_finite();
        let map = |value: fn(&crate::formulas::fit::PixelFit) -> f64| {
            self.fits.iter().map(|f| value(if known(f) { f } else { &of_population })).collect::<Vec<f64>>()
        };
        [
            ("fitted_mask", self.fits.iter().map(|f| f64::from(u8::from(known(f)))).collect()),
            ("a", map(|f| f.a)),
            ("a_error", map(|f| f.var_a.sqrt())),
            ("d", map(|f| f.d)),
            ("d_error", map(|f| f.var_d.sqrt())),
            ("chi2", map(|f| f.chi2)),
            ("light_field", self.light_field_map.clone()),
            ("threshold_sd", self.threshold_posteriors.iter().map(|t| t[1]).collect()),
        ]
    }
}

impl Calibration {
    /// Writes the files of a calibration into `folder`, which is created if necessary.
    ///
    /// The files are `camera.toml` with its maps, the maps of the fit, `calibration.json` and `report.html`. If the
    /// estimator of the SCSim paper was run, its maps are written too. The report states the origin `run`.
    ///
    /// # Errors
    /// If a file exists and `force` is not set, or if a file cannot be written.
    pub fn write(&self, folder: &Path, run: &RunRecord, force: bool) -> Result<CalibrationFiles> {
        std::fs::create_dir_all(folder).map_err(|e| Error::io(folder.display(), e))?;
        let mut group = spikelane_io::storage::FileGroup::new(force);
        let mut put = |name: &str, bytes: &[u8]| group.write(&folder.join(name), bytes);
        let saved = spikelane::presets::to_toml(&self.camera()?)?;
        for (name, bytes) in &saved.maps {
            put(name, bytes)?;
        }
        for (name, map) in self.maps() {
            put(&format!("fit_{name}.npy"), &npy::map_to_bytes(&map, self.sensor.geometry.width())?)?;
        }
        for (name, map) in self.snee.iter().flat_map(snee_maps) {
            put(&format!("snee_{name}.npy"), &npy::map_to_bytes(&map, self.sensor.geometry.width())?)?;
        }
        put("camera.toml", saved.text.as_bytes())?;
        let text = serde_json::to_string_pretty(&self.to_json());
        put(
            "calibration.json",
            text.map_err(|e| Error::new(ErrorKind::Config, "calibration").found(e))?.as_bytes(),
        )?;
        put("report.html", self.html_report(run)?.as_bytes())?;
        group.commit()?;
        Ok(CalibrationFiles {
            camera: folder.join("camera.toml"),
            calibration_json: folder.join("calibration.json"),
            report: folder.join("report.html"),
        })
    }
}

fn snee_maps(paper: &SneeMaps) -> [(&'static str, Vec<f64>); 4] {
    [
        ("c_s", paper.map(|s| s.c_s)),
        ("v_s", paper.map(|s| s.v_s)),
        ("alpha", paper.map(|s| s.alpha)),
        ("dark", paper.map(|s| s.dark)),
    ]
}
