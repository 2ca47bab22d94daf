//! Tests that recordings of a calibrated camera have the same statistics as recordings of the original camera.

use std::collections::BTreeMap;

use spikelane::effects::find;
use spikelane::spikes::Geometry;
use spikelane::{Camera, Seeds, presets};
use spikelane_calibrate::{CalibrateOptions, Protocol, RecordingSet, Stimulus, calibrate, measure_levels};
use spikelane_measure::{Estimate, measure_stream, statistics};

const LEVELS: [f64; 6] = [0.0, 0.04, 0.1, 0.3, 0.6, 0.85];

/// Returns the published camera with uniform start phases.
fn camera(width: u32, height: u32) -> Camera {
    let mut camera = presets::builtin("scsim-code").unwrap();
    camera.sensor.geometry = Geometry::new(width, height).unwrap();
    camera.with_effect(find("start_phase").unwrap().neutral().with_value("share", 1.0).unwrap())
}

/// Returns every statistic of every recording of the set.
fn measure_all(set: &RecordingSet) -> BTreeMap<(String, String), Estimate> {
    let mut all = BTreeMap::new();
    for recording in &set.recordings {
        let measured = measure_stream(
            &set.reader(recording).unwrap(),
            &spikelane_measure::MeasureOptions::default(),
            &mut |_| {},
        );
        for statistic in statistics(&measured.unwrap()).unwrap() {
            all.insert((recording.file.clone(), statistic.key), statistic.estimate);
        }
    }
    all
}

/// Records the camera, calibrates it, records the calibrated camera, and measures both recordings. Returns one pair of
/// values per statistic.
fn calibrate_and_resimulate(
    camera: &Camera,
    protocol: &Protocol,
    r: u64,
) -> BTreeMap<(String, String), [Estimate; 2]> {
    let quiet = &mut |_: &str, _: f64| {};
    let folder = tempfile::tempdir().unwrap();
    let seeds = |shot: u64| Seeds { camera: 3 + r, shot, sequence: 0 };
    let path = protocol.record(camera, seeds(100 + r), folder.path(), false, quiet).unwrap().path;
    let set = RecordingSet::open(&path).unwrap();
    let calibration = calibrate(&measure_levels(&set, quiet).unwrap(), &CalibrateOptions::default()).unwrap();
    let first = measure_all(&set);
    let again = calibration.camera().unwrap();
    let path = protocol.record(&again, seeds(900 + r), folder.path(), true, quiet).unwrap().path;
    let second = measure_all(&RecordingSet::open(&path).unwrap());
    first.into_iter().map(|(key, a)| (key.clone(), [a, second[&key]])).collect()
}

/// Compares pairs of cameras: an original camera and its calibration. The rounds have different fixed patterns.
///
/// The result for each statistic is its mean difference divided by the standard error over the rounds. This error
/// includes the noise of both recordings and all errors of the calibrations. If all rounds had the same pattern, the
/// error would not include the effect of the pattern on a calibration. This effect exists because the estimated photons
/// depend on the growth of the interval variance. The growth depends on the fractional parts of the periods of the
/// pixels.
///
/// If there is no true difference, the mean over `n` rounds divided by its error has Student's distribution with `n - 1`
/// degrees of freedom. With five degrees of freedom, 3.0 % of 204 statistics (six) exceed 3, and 0.6 % (one) exceed 4.5.
/// With seven degrees of freedom, 2.0 % exceed 3, and 0.3 % exceed 4.5.
fn compare(width: u32, height: u32, readouts: u32, rounds: u64) -> Compared {
    let flat = |l: &f64| (format!("light_{l}"), Stimulus::Level(*l));
    let protocol =
        Protocol { recordings: LEVELS.iter().map(flat).collect(), ..Protocol::gray_levels(readouts) };
    let camera = camera(width, height);
    let mut pairs: BTreeMap<(String, String), Vec<[Estimate; 2]>> = BTreeMap::new();
    for r in 0..rounds {
        for (key, pair) in calibrate_and_resimulate(&camera, &protocol, r) {
            pairs.entry(key).or_default().push(pair);
        }
    }
    let mut all = Vec::new();
    let mut stated = [0; 2];
    for ((file, key), pairs) in pairs {
        // A user who has a single pair compares the difference with the errors that `measure` reports.
        for [a, b] in &pairs {
            let z = (b.value - a.value) / a.error.hypot(b.error);
            stated[0] += usize::from(z.is_finite());
            stated[1] += usize::from(z.abs() > 3.0);
        }
        let values: Vec<[f64; 2]> = pairs.iter().map(|p| p.map(|e| e.value)).collect();
        // If a statistic is undefined for one camera, it must be undefined for the other camera too.
        assert!(values.iter().all(|[a, b]| a.is_finite() == b.is_finite()), "{file} {key} {values:?}");
        let difference = Estimate::mean(values.iter().map(|[a, b]| b - a));
        if difference.samples < 2 || difference.value == 0.0 {
            continue;
        }
        let first = Estimate::mean(values.iter().map(|v| v[0]));
        let t = difference.value / difference.error;
        let (value, off) = (first.value, difference.value);
        let line = format!("{file:<15} {key:<26} {value:>12.6} {off:>+12.2e} {t:>+7.2}");
        all.push(Row { t_value: t, line });
    }
    all.sort_by(|a, b| b.t_value.abs().total_cmp(&a.t_value.abs()));
    Compared { all, difference_counts: stated }
}

/// The mean difference of one statistic over the rounds.
struct Row {
    t_value: f64,
    line: String,
}

/// Statistics in descending order of `|t|`. `difference_counts` contains the number of differences of single pairs, and
/// the number of these differences that exceed three stated errors.
struct Compared {
    all: Vec<Row>,
    difference_counts: [usize; 2],
}

fn print(Compared { all, difference_counts: stated }: &Compared) {
    println!("recording       statistic                         value   difference       t");
    all.iter().for_each(|row| println!("{}", row.line));
    let beyond = all.iter().filter(|row| row.t_value.abs() > 3.0).count();
    println!("{} statistics, {beyond} beyond t = 3", all.len());
    println!("{} single differences, {} beyond three stated errors", stated[0], stated[1]);
}

#[test]
fn every_statistic_survives_calibration_and_simulation() {
    let comparison = compare(48, 32, 4000, 8);
    print(&comparison);
    let all = comparison.all;
    assert!(all.len() > 120, "{}", all.len());
    // For Student's t with seven degrees of freedom, the largest of 150 statistics exceeds 9.4 for one in 200 sets of
    // seeds. If a bias is 9.4/sqrt(8) = 3.3 standard deviations of one pair, the test detects it half of the time.
    assert!(all[0].t_value.abs() < 9.4, "{}", all[0].line);
}

#[test]
#[ignore = "takes minutes and 1 GB of disk"]
fn long_every_statistic_of_a_whole_sensor_survives() {
    let comparison = compare(400, 250, 10_000, 6);
    print(&comparison);
    // A user compares one pair. By chance 0.3 % of the differences would exceed three stated errors. The actual share is
    // smaller, because the errors of means over pixels include the fixed pattern, which is equal in both cameras.
    let [pairs, beyond] = comparison.difference_counts;
    assert!(beyond * 100 <= pairs, "{beyond} of {pairs}");
    // For five degrees of freedom, the largest of 150 statistics exceeds 15 for one in 280 sets of seeds.
    assert!(comparison.all[0].t_value.abs() < 15.0, "{}", comparison.all[0].line);
}
