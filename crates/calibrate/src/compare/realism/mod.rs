//! Compares simulated cameras with a real recording by means of a discriminator.
//!
//! Every pixel of a simulated camera receives the light that reproduces the measured rate of this pixel. The fixed
//! pattern of the simulated camera is removed, because the measured rates contain the pattern of the real camera. A
//! discriminator compares features of small windows of the real recording with features of small windows of the
//! simulated recordings ([`RealismComparison`]).

mod discriminator;
mod html_report;
mod matched_simulation;
mod motion;
mod recording_statistics;
mod spike_times;
mod windows;

use serde::Serialize;

pub use discriminator::Auc;
use discriminator::{LabeledWindow, auc_with_interval, out_of_fold_scores};
use matched_simulation::MatchedSimulation;
use motion::Motion;
pub use motion::static_pixels;
pub use recording_statistics::RecordingStatistics;
use spike_times::SpikeTimes;
pub use windows::WindowSize;
use windows::{WindowSample, WindowSampler, discriminator_value, feature_names, usable_lags};

use crate::compare::check_comparison_memory;
use spikelane::effects::Camera;
use spikelane::error::{Error, ErrorKind, Result, Setting};
use spikelane::unstable::draws::Seeds;
use spikelane_io::formats::StreamReader;

/// Smallest number of places that a comparison requires.
const MIN_PLACES: usize = 12;

/// Largest half width of the 95 % interval of the AUC at which a comparison is conclusive.
const MAX_DECISIVE_HALF_INTERVAL: f64 = 0.07;

/// Options of a comparison with a recording.
#[derive(Clone, Debug)]
pub struct RealismOptions {
    /// Size of the compared windows.
    pub window: WindowSize,
    /// Number of simulated recordings per camera.
    pub recordings_per_camera: usize,
    /// Largest number of readouts that are read from the recording.
    pub max_readouts: usize,
    /// Rows of the upright image that are compared. `None` selects all rows.
    pub rows: Option<std::ops::Range<usize>>,
    /// Whether the simulated light drifts like the light of the recording. The drift is the mean over 11x11 pixels.
    ///
    /// If false, slow changes of the scene count as differences between a camera and the recording. If true, slow
    /// changes that the real camera causes are attributed to the scene.
    pub drifting_light: bool,
    /// Seeds of the simulated cameras.
    pub seeds: Seeds,
    /// Dark rates of the pixels of a real camera, in spikes per readout. The report lists them beside the dark rates of
    /// the simulated cameras.
    pub dark_rates: Option<Vec<f64>>,
}

impl Default for RealismOptions {
    fn default() -> Self {
        let window = WindowSize::default();
        let (rows, dark, seeds) = (None, None, Seeds::default());
        Self {
            window,
            recordings_per_camera: 10,
            max_readouts: 2000,
            rows,
            drifting_light: false,
            seeds,
            dark_rates: dark,
        }
    }
}

/// AUC and means of a single feature, for one camera and the recording.
#[derive(Clone, Debug, Serialize)]
pub struct FeatureSeparation {
    /// Name of the feature.
    pub name: String,
    /// Mean of the feature over the windows of the recording.
    pub real_mean: f64,
    /// Mean of the feature over the simulated windows.
    pub simulated_mean: f64,
    /// AUC of this feature alone, 0.5 to 1.
    pub auc: f64,
}

/// Result for one camera, for a subset of the windows.
#[derive(Clone, Debug, Serialize)]
pub struct WindowSubset {
    /// Name of the subset, which is a range of rows or of rates.
    pub name: String,
    /// Number of real windows in the subset.
    pub windows: usize,
    /// AUC of all features together. `None` if the subset has too few places.
    pub auc: Option<Auc>,
    /// The feature with the highest AUC in the subset.
    pub best_feature: Option<FeatureSeparation>,
}

/// Result for one camera.
#[derive(Clone, Debug, Serialize)]
pub struct RealismRow {
    /// Name of the camera.
    pub name: String,
    /// AUC of the simulated windows against the windows of the recording.
    pub auc: Auc,
    /// AUC of one recording of the camera against the other recordings of the camera. The true value is 0.5, so this
    /// AUC shows the effect of chance with this number of windows.
    pub self_auc: Auc,
    /// Features in descending order of AUC.
    pub features: Vec<FeatureSeparation>,
    /// Results for ranges of rows and for ranges of rates.
    pub subsets: Vec<WindowSubset>,
}

impl RealismRow {
    /// Returns whether the interval of the AUC is narrow enough for a conclusion.
    #[must_use]
    pub fn is_conclusive(&self) -> bool {
        (self.auc.high - self.auc.low) / 2.0 <= MAX_DECISIVE_HALF_INTERVAL
    }
}

/// Result of a comparison of cameras with a recording.
#[derive(Clone, Debug, Serialize)]
pub struct RealismComparison {
    /// Size of the compared windows.
    pub window: WindowSize,
    /// Number of windows of the recording.
    pub windows: usize,
    /// Number of places that these windows cover.
    pub places: usize,
    /// Share of the pixels that were excluded, because something moved around them or because they have no rate.
    pub excluded_share: f64,
    /// Mean rate of the windows in spikes per readout.
    pub mean_rate: f64,
    /// Whether the simulated light drifted like the light of the recording.
    pub drifting_light: bool,
    /// Results in ascending order of AUC. The first camera is most similar to the recording.
    pub cameras: Vec<RealismRow>,
    /// Statistics of the whole recording, followed by the statistics of each camera's simulated recordings.
    pub recording_statistics: Vec<RecordingStatistics>,
    /// Rate of every compared pixel in spikes per readout, row by row from the top. NaN for pixels that are not compared.
    #[serde(skip)]
    pub rates: Vec<f64>,
    /// Pixels in a row.
    #[serde(skip)]
    pub width: usize,
    /// All windows as CSV, for use with another discriminator. The columns are the camera name or `real`, the place, the
    /// row, the rate and the features.
    #[serde(skip)]
    pub features_csv: String,
}

/// Compares windows of simulated recordings with windows of a real recording. Calls `progress` with the name of the next
/// camera.
///
/// # Errors
/// If the recording has fewer than twelve places of static, firing pixels, or if a camera cannot be simulated.
pub fn compare_realism(
    recording: &StreamReader,
    cameras: &[Camera],
    options: &RealismOptions,
    progress: &mut dyn FnMut(&str, f64),
) -> Result<RealismComparison> {
    let real = SpikeTimes::from_reader(recording, options.max_readouts)?;
    check_comparison_memory(real.geometry)?;
    let lines = real.fit_rates();
    let motion = Motion::from_times(&real);
    let used: Vec<bool> =
        motion.is_static.iter().zip(&lines).map(|(still, line)| *still && line.rate.is_finite()).collect();
    let drift = if options.drifting_light { motion.drift } else { vec![0.0; lines.len()] };
    let height = real.geometry.height();
    let rows = options.rows.clone().unwrap_or(0..height);
    let mean = mean_rate(&lines, &used);
    let lags = usable_lags(options.window, mean);
    let cutter = WindowSampler {
        window: options.window,
        lags: &lags,
        used_pixels: &used,
        rows: rows.start..rows.end.min(height),
    };
    let real_samples = cutter.samples(&real, &lines);
    let places = count_places(&real_samples);
    if places < MIN_PLACES {
        return Err(too_few_places_error(recording, options.window, places));
    }
    let names = feature_names(&lags);
    let mut comparison = RealismComparison {
        window: options.window,
        windows: real_samples.len(),
        places,
        excluded_share: used.iter().filter(|u| !**u).count() as f64 / used.len() as f64,
        mean_rate: real_samples.iter().map(|s| s.mean_rate).sum::<f64>() / real_samples.len() as f64,
        drifting_light: options.drifting_light,
        cameras: Vec::new(),
        recording_statistics: Vec::new(),
        rates: lines.iter().zip(&used).map(|(line, used)| if *used { line.rate } else { f64::NAN }).collect(),
        width: real.geometry.width(),
        features_csv: csv_header(&names),
    };
    add_csv_rows(&mut comparison.features_csv, "real", &real_samples);
    let counted: Vec<bool> = used
        .iter()
        .enumerate()
        .map(|(p, used)| *used && cutter.rows.contains(&(p / real.geometry.width())))
        .collect();
    let dark = options.dark_rates.clone().map(recording_statistics::quantiles);
    comparison.recording_statistics.push(RecordingStatistics::from_recordings(
        "real",
        std::slice::from_ref(&real),
        &counted,
        dark,
    ));
    for (i, camera) in cameras.iter().enumerate() {
        progress(&camera.name, i as f64 / cameras.len() as f64);
        let matched = MatchedSimulation::new(camera, &lines, &drift, &real, options.seeds)?;
        let recordings = matched.simulate_recordings(options.recordings_per_camera.max(2), options.seeds)?;
        let simulated: Vec<Vec<WindowSample>> =
            recordings.iter().map(|times| cutter.samples(times, &times.fit_rates())).collect();
        simulated
            .iter()
            .for_each(|samples| add_csv_rows(&mut comparison.features_csv, &camera.name, samples));
        let dark = options
            .dark_rates
            .as_ref()
            .map(|_| recording_statistics::dark_rate_quantiles(camera, options.seeds))
            .transpose()?;
        comparison.recording_statistics.push(RecordingStatistics::from_recordings(
            &camera.name,
            &recordings,
            &counted,
            dark,
        ));
        comparison.cameras.push(compare_camera(&camera.name, &names, &real_samples, &simulated));
    }
    comparison.cameras.sort_by(|a, b| a.auc.value.total_cmp(&b.auc.value));
    Ok(comparison)
}

fn too_few_places_error(recording: &StreamReader, window: WindowSize, places: usize) -> Error {
    Error::new(ErrorKind::Input, recording.name())
        .found(format_args!(
            "{places} places of {0}x{0} static pixels that fire within {1} readouts",
            window.side, window.readouts
        ))
        .expected(format_args!("at least {MIN_PLACES}"))
        .remedy(format_args!(
            "record a scene with less motion or more light, or reduce {}",
            Setting("window")
        ))
}

fn mean_rate(lines: &[spike_times::RateFit], used: &[bool]) -> f64 {
    let all = || lines.iter().zip(used).filter(|(_, u)| **u);
    all().map(|(l, _)| l.rate).sum::<f64>() / all().count().max(1) as f64
}

fn count_places(samples: &[WindowSample]) -> usize {
    samples.iter().map(|s| s.place).collect::<std::collections::BTreeSet<_>>().len()
}

fn csv_header(names: &[(String, bool)]) -> String {
    let names: Vec<String> = names.iter().map(|(name, _)| name.replace(',', "")).collect();
    format!("camera,place,row,rate,{}\n", names.join(","))
}

fn add_csv_rows(text: &mut String, camera: &str, samples: &[WindowSample]) {
    for s in samples {
        let values: Vec<String> = s.values.iter().map(|v| format!("{v:e}")).collect();
        *text += &format!("{camera},{},{},{:.5},{}\n", s.place, s.row, s.mean_rate, values.join(","));
    }
}

fn compare_camera(
    name: &str,
    names: &[(String, bool)],
    measured: &[WindowSample],
    simulated: &[Vec<WindowSample>],
) -> RealismRow {
    let others: Vec<&WindowSample> = simulated.iter().flatten().collect();
    let pair = |real: Vec<&WindowSample>, others: &[&WindowSample]| -> Vec<LabeledWindow> {
        let seen_of = |is: bool, s: &WindowSample| LabeledWindow {
            place: s.place,
            is_real: is,
            values: s.values.iter().zip(names).map(|(v, (_, log))| discriminator_value(*v, *log)).collect(),
        };
        real.into_iter().map(|s| seen_of(true, s)).chain(others.iter().map(|s| seen_of(false, s))).collect()
    };
    let all = pair(measured.iter().collect(), &others);
    let against_itself: Vec<&WindowSample> = simulated[1..].iter().flatten().collect();
    let floor = pair(simulated[0].iter().collect(), &against_itself);
    let part = |name: String, within: &dyn Fn(&WindowSample) -> bool| {
        let here: Vec<&WindowSample> = measured.iter().filter(|s| within(s)).collect();
        let others: Vec<&WindowSample> = others.iter().copied().filter(|s| within(s)).collect();
        let enough =
            here.iter().map(|s| s.place).collect::<std::collections::BTreeSet<_>>().len() >= MIN_PLACES;
        let windows = here.len();
        let all = pair(here, &others);
        WindowSubset {
            name,
            windows,
            auc: (enough && !others.is_empty()).then(|| auc_with_interval(&all, &out_of_fold_scores(&all))),
            best_feature: rank_features(names, &all)
                .into_iter()
                .next()
                .filter(|feature| feature.auc.is_finite()),
        }
    };
    let parts =
        row_and_rate_subsets(measured).into_iter().map(|(name, within)| part(name, &*within)).collect();
    RealismRow {
        name: name.to_owned(),
        auc: auc_with_interval(&all, &out_of_fold_scores(&all)),
        self_auc: auc_with_interval(&floor, &out_of_fold_scores(&floor)),
        features: rank_features(names, &all),
        subsets: parts,
    }
}

type SubsetFilter = (String, Box<dyn Fn(&WindowSample) -> bool>);

/// Returns the name and the condition of six subsets of the windows: three thirds by row and three thirds by rate.
fn row_and_rate_subsets(real: &[WindowSample]) -> Vec<SubsetFilter> {
    let mut rows: Vec<usize> = real.iter().map(|s| s.row).collect();
    let mut rates: Vec<f64> = real.iter().map(|s| s.mean_rate).collect();
    rows.sort_unstable();
    rates.sort_by(f64::total_cmp);
    let third = |k: usize, n: usize| (k * n / 3).min(n - 1);
    let mut all: Vec<SubsetFilter> = Vec::new();
    for k in 0..3 {
        let (from, to) = (rows[third(k, rows.len())], rows[third(k + 1, rows.len())]);
        // A row on the boundary between two thirds belongs to the later third. The last third includes its last row.
        let last = k == 2;
        let name = format!("windows from row {from} to {to}");
        all.push((name, Box::new(move |s| s.row >= from && (s.row < to || last))));
    }
    for k in 0..3 {
        let (from, to) = (rates[third(k, rates.len())], rates[third(k + 1, rates.len())]);
        let (first, last) = (k == 0, k == 2);
        let name = format!("rates {from:.3} to {to:.3}");
        all.push((name, Box::new(move |s| (first || s.mean_rate >= from) && (last || s.mean_rate < to))));
    }
    all
}

/// Returns the features in descending order of the AUC of each single feature.
fn rank_features(names: &[(String, bool)], all: &[LabeledWindow]) -> Vec<FeatureSeparation> {
    let mean = |i: usize, real: bool| {
        let samples = all.iter().filter(|s| s.is_real == real);
        let n = samples.clone().count().max(1) as f64;
        samples.map(|s| s.values[i]).sum::<f64>() / n
    };
    let mut separations: Vec<FeatureSeparation> = (0..names.len())
        .map(|i| {
            let (name, logarithm) = &names[i];
            let scores: Vec<f64> = all.iter().map(|s| s.values[i]).collect();
            let back = |x: f64| if *logarithm { x.exp() } else { x };
            let feature_auc = discriminator::auc_value(all, &scores);
            FeatureSeparation {
                name: name.clone(),
                real_mean: back(mean(i, true)),
                simulated_mean: back(mean(i, false)),
                auc: feature_auc.max(1.0 - feature_auc),
            }
        })
        .collect();
    separations.sort_by(|a, b| b.auc.total_cmp(&a.auc));
    separations
}
