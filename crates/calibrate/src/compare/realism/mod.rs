//! Whether a discriminator tells a camera's recordings from a real one, and by what.
//!
//! Every pixel of a simulated camera gets the light that gives it its measured rate; its own fixed pattern is off, since the measured
//! rates hold the real one. Small windows of both are measured and told apart ([`Realism`]).

mod discriminator;
mod matched;
mod motion;
mod numbers;
mod page;
mod times;
mod windows;

use serde::Serialize;

pub use discriminator::Auc;
use discriminator::{Seen, auc, scores};
use matched::Matched;
use motion::Motion;
pub use motion::still_pixels;
pub use numbers::Numbers;
use times::Times;
pub use windows::Window;
use windows::{Cutter, Sample, lags, names, seen};

use crate::compare::check_memory;
use spikelane::effects::Camera;
use spikelane::error::{Error, Kind, Result};
use spikelane::unstable::draws::Seeds;
use spikelane_io::formats::Reader;

/// Fewest places of which a comparison is made.
const LEAST_PLACES: usize = 12;

/// Half an interval of more than this decides nothing.
const DECIDED: f64 = 0.07;

/// How cameras are compared with a recording.
#[derive(Clone, Debug)]
pub struct RealismOptions {
    /// What is measured at a time.
    pub window: Window,
    /// Recordings simulated by each camera.
    pub simulated: usize,
    /// Readouts of the recording at most.
    pub longest: usize,
    /// Rows of the upright picture, or all.
    pub rows: Option<std::ops::Range<usize>>,
    /// Whether simulated light drifts as the recording's does in the mean of 11x11 pixels. Without it a camera answers for the scene's slow
    /// changes; with it slow changes that a camera makes itself are the scene's.
    pub drifting: bool,
    /// Seeds of the simulated cameras.
    pub seeds: Seeds,
    /// Rates of a real camera's pixels in the dark, in spikes per readout, to be listed beside those of the cameras.
    pub dark: Option<Vec<f64>>,
}

impl Default for RealismOptions {
    fn default() -> Self {
        let window = Window::default();
        let (rows, dark, seeds) = (None, None, Seeds::default());
        Self { window, simulated: 10, longest: 2000, rows, drifting: false, seeds, dark }
    }
}

/// One value of windows, and how well it alone tells a camera from the recording.
#[derive(Clone, Debug, Serialize)]
pub struct Tell {
    /// What is measured.
    pub name: String,
    /// Its mean over windows of the recording.
    pub real: f64,
    /// Its mean over simulated windows.
    pub simulated: f64,
    /// Chance that a real window has the more telling value, 0.5 to 1.
    pub alone: f64,
}

/// A camera on a part of the windows.
#[derive(Clone, Debug, Serialize)]
pub struct Part {
    /// Which part: rows, or rates.
    pub name: String,
    /// Real windows in it.
    pub windows: usize,
    /// By all values; absent where the part has too few places.
    pub auc: Option<Auc>,
    /// What tells most there.
    pub tell: Option<Tell>,
}

/// How well one camera passes.
#[derive(Clone, Debug, Serialize)]
pub struct RealismRow {
    /// The camera.
    pub name: String,
    /// Against the recording.
    pub auc: Auc,
    /// One of its recordings against its others: what chance makes of so many windows.
    pub floor: Auc,
    /// Values by how much they tell, the most telling first.
    pub tells: Vec<Tell>,
    /// By bands of rows and classes of rate.
    pub parts: Vec<Part>,
}

impl RealismRow {
    /// Whether the interval is narrow enough to decide by.
    #[must_use]
    pub fn is_decided(&self) -> bool {
        (self.auc.high - self.auc.low) / 2.0 <= DECIDED
    }
}

/// Cameras against a recording.
#[derive(Clone, Debug, Serialize)]
pub struct Realism {
    /// What was measured at a time.
    pub window: Window,
    /// Windows of the recording, and places that they lie at.
    pub windows: usize,
    /// See `windows`.
    pub places: usize,
    /// Share of pixels that were left out: around them something moved, or they have no rate.
    pub left_out: f64,
    /// Mean rate of the windows in spikes per readout.
    pub rate: f64,
    /// Whether simulated light drifted as the recording's did.
    pub drifting: bool,
    /// Cameras, the least easily told first.
    pub rows: Vec<RealismRow>,
    /// Numbers of the whole recording, then of each camera's.
    pub numbers: Vec<Numbers>,
    /// Rate of every pixel that counts, in spikes per readout; NaN of those left out. Row by row from the top.
    #[serde(skip)]
    pub rates: Vec<f64>,
    /// Pixels of a row.
    #[serde(skip)]
    pub width: usize,
    /// Every window, for a discriminator of your own: camera or `real`, place, row, rate, values.
    #[serde(skip)]
    pub features: String,
}

/// Compares cameras with a recording by windows of both. `tell` hears which camera is next.
///
/// # Errors
/// When the recording has fewer than twelve places of still, firing pixels, or a camera cannot be simulated.
pub fn realism(
    recording: &Reader,
    cameras: &[Camera],
    options: &RealismOptions,
    tell: &mut dyn FnMut(&str, f64),
) -> Result<Realism> {
    let real = Times::of_reader(recording, options.longest)?;
    check_memory(real.geometry)?;
    let lines = real.lines();
    let motion = Motion::of(&real);
    let used: Vec<bool> =
        motion.still.iter().zip(&lines).map(|(still, line)| *still && line.rate.is_finite()).collect();
    let drift = if options.drifting { motion.drift } else { vec![0.0; lines.len()] };
    let height = real.geometry.height();
    let rows = options.rows.clone().unwrap_or(0..height);
    let mean = mean_rate(&lines, &used);
    let lags = lags(options.window, mean);
    let cutter =
        Cutter { window: options.window, lags: &lags, used: &used, rows: rows.start..rows.end.min(height) };
    let own = cutter.samples(&real, &lines);
    let places = count_places(&own);
    if places < LEAST_PLACES {
        return Err(too_few(recording, options.window, places));
    }
    let names = names(&lags);
    let mut found = Realism {
        window: options.window,
        windows: own.len(),
        places,
        left_out: used.iter().filter(|u| !**u).count() as f64 / used.len() as f64,
        rate: own.iter().map(|s| s.rate).sum::<f64>() / own.len() as f64,
        drifting: options.drifting,
        rows: Vec::new(),
        numbers: Vec::new(),
        rates: lines.iter().zip(&used).map(|(line, used)| if *used { line.rate } else { f64::NAN }).collect(),
        width: real.geometry.width(),
        features: head(&names),
    };
    add_features(&mut found.features, "real", &own);
    let counted: Vec<bool> = used
        .iter()
        .enumerate()
        .map(|(p, used)| *used && cutter.rows.contains(&(p / real.geometry.width())))
        .collect();
    let dark = options.dark.clone().map(numbers::quantiles);
    found.numbers.push(Numbers::of("real", std::slice::from_ref(&real), &counted, dark));
    for (i, camera) in cameras.iter().enumerate() {
        tell(&camera.name, i as f64 / cameras.len() as f64);
        let matched = Matched::new(camera, &lines, &drift, &real, options.seeds)?;
        let recordings = matched.recordings(options.simulated.max(2), options.seeds)?;
        let simulated: Vec<Vec<Sample>> =
            recordings.iter().map(|times| cutter.samples(times, &times.lines())).collect();
        simulated.iter().for_each(|samples| add_features(&mut found.features, &camera.name, samples));
        let dark = options.dark.as_ref().map(|_| numbers::dark_of(camera, options.seeds)).transpose()?;
        found.numbers.push(Numbers::of(&camera.name, &recordings, &counted, dark));
        found.rows.push(row(&camera.name, &names, &own, &simulated));
    }
    found.rows.sort_by(|a, b| a.auc.value.total_cmp(&b.auc.value));
    Ok(found)
}

fn too_few(recording: &Reader, window: Window, places: usize) -> Error {
    Error::new(Kind::Input, recording.name())
        .found(format_args!(
            "{places} places of {0}x{0} still pixels that fire in {1} readouts",
            window.side, window.readouts
        ))
        .expected(format_args!("{LEAST_PLACES} or more"))
        .remedy(
            "record a scene with less motion or more light, or take smaller windows (--window SIDE,READOUTS)",
        )
}

fn mean_rate(lines: &[times::Line], used: &[bool]) -> f64 {
    let all = || lines.iter().zip(used).filter(|(_, u)| **u);
    all().map(|(l, _)| l.rate).sum::<f64>() / all().count().max(1) as f64
}

fn count_places(samples: &[Sample]) -> usize {
    samples.iter().map(|s| s.place).collect::<std::collections::BTreeSet<_>>().len()
}

fn head(names: &[(String, bool)]) -> String {
    let names: Vec<String> = names.iter().map(|(name, _)| name.replace(',', "")).collect();
    format!("camera,place,row,rate,{}\n", names.join(","))
}

fn add_features(text: &mut String, camera: &str, samples: &[Sample]) {
    for s in samples {
        let values: Vec<String> = s.values.iter().map(|v| format!("{v:e}")).collect();
        *text += &format!("{camera},{},{},{:.5},{}\n", s.place, s.row, s.rate, values.join(","));
    }
}

fn row(name: &str, names: &[(String, bool)], own: &[Sample], simulated: &[Vec<Sample>]) -> RealismRow {
    let others: Vec<&Sample> = simulated.iter().flatten().collect();
    let pair = |real: Vec<&Sample>, others: &[&Sample]| -> Vec<Seen> {
        let seen_of = |is: bool, s: &Sample| Seen {
            place: s.place,
            real: is,
            values: s.values.iter().zip(names).map(|(v, (_, log))| seen(*v, *log)).collect(),
        };
        real.into_iter().map(|s| seen_of(true, s)).chain(others.iter().map(|s| seen_of(false, s))).collect()
    };
    let all = pair(own.iter().collect(), &others);
    let against_itself: Vec<&Sample> = simulated[1..].iter().flatten().collect();
    let floor = pair(simulated[0].iter().collect(), &against_itself);
    let part = |name: String, within: &dyn Fn(&Sample) -> bool| {
        let here: Vec<&Sample> = own.iter().filter(|s| within(s)).collect();
        let others: Vec<&Sample> = others.iter().copied().filter(|s| within(s)).collect();
        let enough =
            here.iter().map(|s| s.place).collect::<std::collections::BTreeSet<_>>().len() >= LEAST_PLACES;
        let windows = here.len();
        let all = pair(here, &others);
        Part {
            name,
            windows,
            auc: (enough && !others.is_empty()).then(|| auc(&all, &scores(&all))),
            tell: tells(names, &all).into_iter().next().filter(|tell| tell.alone.is_finite()),
        }
    };
    let parts = cuts(own).into_iter().map(|(name, within)| part(name, &*within)).collect();
    RealismRow {
        name: name.to_owned(),
        auc: auc(&all, &scores(&all)),
        floor: auc(&floor, &scores(&floor)),
        tells: tells(names, &all),
        parts,
    }
}

type Cut = (String, Box<dyn Fn(&Sample) -> bool>);

/// Thirds of the rows and of the rates.
fn cuts(own: &[Sample]) -> Vec<Cut> {
    let mut rows: Vec<usize> = own.iter().map(|s| s.row).collect();
    let mut rates: Vec<f64> = own.iter().map(|s| s.rate).collect();
    rows.sort_unstable();
    rates.sort_by(f64::total_cmp);
    let third = |k: usize, n: usize| (k * n / 3).min(n - 1);
    let mut all: Vec<Cut> = Vec::new();
    for k in 0..3 {
        let (from, to) = (rows[third(k, rows.len())], rows[third(k + 1, rows.len())]);
        // A row that both thirds share belongs to the upper one, the last to the last.
        let last = k == 2;
        let name = format!("windows from row {from} to {to}");
        all.push((name, Box::new(move |s| s.row >= from && (s.row < to || last))));
    }
    for k in 0..3 {
        let (from, to) = (rates[third(k, rates.len())], rates[third(k + 1, rates.len())]);
        let (first, last) = (k == 0, k == 2);
        let name = format!("rates {from:.3} to {to:.3}");
        all.push((name, Box::new(move |s| (first || s.rate >= from) && (last || s.rate < to))));
    }
    all
}

/// Values by how much each alone tells.
fn tells(names: &[(String, bool)], all: &[Seen]) -> Vec<Tell> {
    let mean = |i: usize, real: bool| {
        let of = all.iter().filter(|s| s.real == real);
        let n = of.clone().count().max(1) as f64;
        of.map(|s| s.values[i]).sum::<f64>() / n
    };
    let mut found: Vec<Tell> = (0..names.len())
        .map(|i| {
            let (name, logarithm) = &names[i];
            let scores: Vec<f64> = all.iter().map(|s| s.values[i]).collect();
            let back = |x: f64| if *logarithm { x.exp() } else { x };
            let alone = discriminator::plain(all, &scores);
            Tell {
                name: name.clone(),
                real: back(mean(i, true)),
                simulated: back(mean(i, false)),
                alone: alone.max(1.0 - alone),
            }
        })
        .collect();
    found.sort_by(|a, b| b.alone.total_cmp(&a.alone));
    found
}
