//! What a calibration leaves behind: camera file, maps, JSON and a page.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::page::page;
use crate::population::mean_and_sd;
use crate::result::{Calibration, Lamp, Redrawn};
use crate::snee::{Snee, SneeMaps};
use spikelane::error::{Error, Kind, Result};
use spikelane::unstable::npy;
use spikelane_measure::report::with_known;
use spikelane_measure::{Estimate, median};

/// The files of a calibration.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Files {
    /// `camera.toml`, which `simulate` takes.
    pub camera: PathBuf,
    /// `calibration.json`.
    pub json: PathBuf,
    /// `report.html`.
    pub report: PathBuf,
}

/// Value and error as far as they are known.
fn number(e: Estimate) -> Value {
    let parts = [("value", e.value), ("error", e.error)];
    parts.into_iter().filter(|(_, x)| x.is_finite()).map(|(key, x)| (key.to_owned(), json!(x))).collect()
}

fn lamp(l: &Lamp) -> Value {
    let about = json!({
        "file": l.file, "stated": l.stated, "stated_uncertainty": l.uncertainty, "found": l.found(),
        "deviation": number(l.deviation), "wrong": l.wrong, "saturated": l.saturated, "drifts": l.drifts,
        "readouts": l.readouts, "rate": l.rate, "scatter": l.scatter,
    });
    with_known(about, [("change", l.change.map(number))])
}

impl Calibration {
    /// Everything but the maps, as JSON. Numbers that are not known are left out.
    #[must_use]
    pub fn to_json(&self) -> Value {
        let p = &self.population;
        let whole = json!({
            "width": self.sensor.geometry.width(),
            "height": self.sensor.geometry.height(),
            "readout_hz": self.sensor.readout_hz,
            "population": {
                "mean_a": number(p.mean_a), "sd_a": number(p.sd_a),
                "mean_d": number(p.mean_d), "sd_d": number(p.sd_d),
                "covariance": number(p.covariance), "sigma_phi": number(p.sigma_phi),
            },
            "sigma_t": number(self.sigma_t),
            "electrons_per_spike": number(self.electrons),
            "dark_shot_noise": self.dark_shot,
            "redraw_told": self.redrawn_told,
            "redraw": if self.redrawn == Redrawn::EveryReadout { "every-readout" } else { "every-reset" },
            "bias_share": number(self.bias_share),
            "lost_increment": self.lost_increment,
            "light_scale_error": self.light_scale_error,
            "bends": self.bends,
            "levels": self.levels.iter().map(lamp).collect::<Vec<_>>(),
            "unknown_pixels": self.unknown(),
            "dead": self.dead, "hot": self.hot, "misfits": self.misfits,
            "verdict": self.verdict(), "cautions": self.cautions(),
            "notes": self.notes,
        });
        let further = [
            ("bend", self.bend.map(number)),
            ("chi2_per_freedom", self.chi2_per_freedom().map(Into::into)),
            ("snee", self.paper.as_ref().map(|paper| self.paper_json(paper))),
        ];
        with_known(whole, further)
    }

    /// Pixels that tell nothing: of these the files hold the population's means.
    #[must_use]
    pub fn unknown(&self) -> Vec<usize> {
        (0..self.fits.len()).filter(|p| !self.fits[*p].a.is_finite()).collect()
    }

    fn paper_json(&self, paper: &SneeMaps) -> Value {
        let moments = |of: fn(&Snee) -> f64| {
            let (mean, sd) = mean_and_sd(&paper.map(of));
            json!({ "mean": mean, "sd": sd })
        };
        json!({
            "box": paper.box_width,
            "pixels_on": paper.edges(),
            "share_on_edge": paper.edges().share(),
            "light_scale": paper.light_scale,
            "a": moments(|s| s.alpha / s.phi), "d": moments(|s| s.dark / s.phi),
            "phi": moments(|s| s.phi), "c_s": moments(|s| s.c_s), "v_s": moments(|s| s.v_s),
        })
    }

    /// Median over the pixels of chi-square per degree of freedom; `None` without any.
    #[must_use]
    pub fn chi2_per_freedom(&self) -> Option<f64> {
        let of = |f: &crate::formulas::fit::PixelFit| f.chi2 / f64::from(f.freedom);
        let good = self.fits.iter().filter(|f| f.freedom > 0 && f.chi2.is_finite());
        let mut all: Vec<f64> = good.map(of).collect();
        (!all.is_empty()).then(|| median(&mut all))
    }

    /// Maps of the fit, with the population's means and spreads for pixels that tell nothing: `known` is 0 there.
    pub(crate) fn maps(&self) -> [(&'static str, Vec<f64>); 7] {
        let p = &self.population;
        let of_population = crate::formulas::fit::PixelFit {
            a: p.mean_a.value,
            d: p.mean_d.value,
            var_a: p.sd_a.value.powi(2),
            var_d: p.sd_d.value.powi(2),
            chi2: 0.0,
            ..crate::formulas::fit::PixelFit::UNKNOWN
        };
        let known = |f: &crate::formulas::fit::PixelFit| f.a.is_finite();
        let map = |of: fn(&crate::formulas::fit::PixelFit) -> f64| {
            self.fits.iter().map(|f| of(if known(f) { f } else { &of_population })).collect::<Vec<f64>>()
        };
        [
            ("known", self.fits.iter().map(|f| f64::from(u8::from(known(f)))).collect()),
            ("a", map(|f| f.a)),
            ("a_error", map(|f| f.var_a.sqrt())),
            ("d", map(|f| f.d)),
            ("d_error", map(|f| f.var_d.sqrt())),
            ("chi2", map(|f| f.chi2)),
            ("threshold_sd", self.threshold.iter().map(|t| t[1]).collect()),
        ]
    }
}

/// Writes `camera.toml` with its maps, the maps of the fit (and of the paper's), `calibration.json` and
/// `report.html` into `folder`, which is created.
///
/// # Errors
/// When a file exists and `force` is not set, or cannot be written.
pub fn write(calibration: &Calibration, folder: &Path, force: bool) -> Result<Files> {
    std::fs::create_dir_all(folder).map_err(|e| Error::io(folder.display(), e))?;
    let mut group = spikelane_io::storage::FileGroup::new(force);
    let mut put = |name: &str, bytes: &[u8]| group.write(&folder.join(name), bytes);
    let saved = spikelane::presets::to_toml(&calibration.camera()?)?;
    for (name, bytes) in &saved.maps {
        put(name, bytes)?;
    }
    for (name, map) in calibration.maps() {
        put(&format!("fit_{name}.npy"), &npy::map_to_bytes(&map, calibration.sensor.geometry.width())?)?;
    }
    for (name, map) in calibration.paper.iter().flat_map(paper_maps) {
        put(&format!("snee_{name}.npy"), &npy::map_to_bytes(&map, calibration.sensor.geometry.width())?)?;
    }
    put("camera.toml", saved.text.as_bytes())?;
    let text = serde_json::to_string_pretty(&calibration.to_json());
    put("calibration.json", text.map_err(|e| Error::new(Kind::Config, "calibration").found(e))?.as_bytes())?;
    put("report.html", page(calibration)?.as_bytes())?;
    group.commit()?;
    Ok(Files {
        camera: folder.join("camera.toml"),
        json: folder.join("calibration.json"),
        report: folder.join("report.html"),
    })
}

fn paper_maps(paper: &SneeMaps) -> [(&'static str, Vec<f64>); 4] {
    [
        ("c_s", paper.map(|s| s.c_s)),
        ("v_s", paper.map(|s| s.v_s)),
        ("alpha", paper.map(|s| s.alpha)),
        ("dark", paper.map(|s| s.dark)),
    ]
}
