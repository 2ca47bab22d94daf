//! Compares the statistics of streams with random noise.

use serde_json::{Value, json};
use spikelane::SpikeFrames;
use spikelane::unstable::Count;

use super::{Conclusion, Verdict};

/// Largest accepted difference in standard errors. With 20 runs of the preset, equal simulators exceed it in one of ten
/// statistics with a probability below 0.1 % (distribution of Student).
const MAX_STANDARD_ERRORS: f64 = 5.0;

/// Largest printed difference in standard errors.
const MAX_PRINTED_ERRORS: f64 = 1e6;

/// Readouts at the start whose rate shows the start charges.
const EARLY_READOUTS: usize = 10;

/// Smallest light of a pixel whose gain is measured, in full scales.
const MIN_LIGHT: f64 = 0.1;

/// Longest interval of the histogram in readouts. Longer intervals count as this interval.
const MAX_INTERVAL_READOUTS: usize = 64;

/// The statistics of one stream.
struct StreamStatistics {
    /// Values in the order of [`names`]. A value that the light does not allow is not a number.
    values: Vec<f64>,
    /// Shares of the intervals of 1, 2 and so on readouts.
    histogram: Vec<f64>,
}

/// Compares runs of another simulator with runs of the preset, each with a new sensor and new noise. `light` is the mean
/// light of the pixels in full scales.
pub(super) fn compare(peer: &[SpikeFrames], own: &[SpikeFrames], light: &[f64]) -> Verdict {
    let groups = light_groups(light);
    let measure = |runs: &[SpikeFrames]| -> Vec<StreamStatistics> {
        runs.iter().map(|run| StreamStatistics::measure(run, light, &groups)).collect()
    };
    let (mut peer, mut own) = (measure(peer), measure(own));
    add_histogram_distances(&mut peer, &mut own);
    let mut text = format!(
        "{} of the code, {} of the preset, each with a new sensor\n{:<30}{:>12}{:>12}{:>12}{:>10}\n",
        Count(peer.len(), "run"),
        Count(own.len(), "run"),
        "statistic",
        "code",
        "preset",
        "difference",
        "std. err."
    );
    let (mut rows, mut conclusion) = (Vec::new(), Conclusion::NoSignificantDifference);
    for (i, name) in names(&groups).iter().enumerate() {
        let column =
            |runs: &[StreamStatistics]| -> Vec<f64> { runs.iter().map(|run| run.values[i]).collect() };
        let (a, b) = (column(&peer), column(&own));
        if a.iter().chain(&b).any(|value| !value.is_finite()) {
            continue;
        }
        let (code, preset) = (mean(&a), mean(&b));
        // Under the hypothesis that both simulators are equal, the runs of the preset also scatter like those of the code.
        let error = standard_deviation(&b) * (1.0 / a.len() as f64 + 1.0 / b.len() as f64).sqrt();
        let difference = code - preset;
        // If the runs of the preset do not scatter, every difference is significant.
        let errors = if difference == 0.0 {
            0.0
        } else {
            (difference / error).clamp(-MAX_PRINTED_ERRORS, MAX_PRINTED_ERRORS)
        };
        if errors.abs() > MAX_STANDARD_ERRORS {
            conclusion = Conclusion::Different;
        }
        text += &format!("{name:<30}{code:>12.5}{preset:>12.5}{difference:>+12.5}{errors:>+10.1}\n");
        rows.push(json!({
            "name": name, "code": code, "preset": preset, "standard_error": error, "standard_errors": errors,
        }));
    }
    text += &format!("a difference of up to {MAX_STANDARD_ERRORS} standard errors is accepted\n");
    let details = json!({"statistics": Value::Array(rows), "max_standard_errors": MAX_STANDARD_ERRORS});
    Verdict { conclusion, json: details, text }
}

/// Returns the ranges of light of up to four groups with about equal numbers of pixels.
fn light_groups(light: &[f64]) -> Vec<[f64; 2]> {
    let mut sorted = light.to_vec();
    sorted.sort_by(f64::total_cmp);
    let mut edges: Vec<f64> = (0..=4).map(|k| sorted[(sorted.len() - 1) * k / 4]).collect();
    edges.dedup();
    if edges.len() == 1 {
        return vec![[edges[0], edges[0]]];
    }
    edges.windows(2).map(|pair| [pair[0], pair[1]]).collect()
}

/// Returns the names of the values of [`StreamStatistics`].
fn names(groups: &[[f64; 2]]) -> Vec<String> {
    let fixed =
        ["rate", "rate of the first 10 readouts", "gain spread", "gain correlation", "interval variance"];
    let of_groups = groups.iter().map(|[low, high]| format!("rate at light {low:.2} to {high:.2}"));
    let distance = "interval histogram distance".to_owned();
    fixed.map(str::to_owned).into_iter().chain(of_groups).chain([distance]).collect()
}

impl StreamStatistics {
    fn measure(run: &SpikeFrames, light: &[f64], groups: &[[f64; 2]]) -> Self {
        let (pixels, readouts) = (light.len(), run.readouts() as f64);
        let width = run.geometry().width();
        let mut times = vec![Vec::new(); pixels];
        for (readout, frame) in run.iter().enumerate() {
            frame.firing_pixels().for_each(|p| times[p].push(readout));
        }
        let rates: Vec<f64> = times.iter().map(|t| t.len() as f64 / readouts).collect();
        let early: usize = times.iter().map(|t| t.partition_point(|at| *at < EARLY_READOUTS)).sum();
        // The gain of a pixel is its rate divided by its light.
        let gain = |p: usize| (light[p] >= MIN_LIGHT).then(|| rates[p] / light[p]);
        let gains: Vec<f64> = (0..pixels).filter_map(gain).collect();
        let neighbors = (0..pixels).filter(|p| (p + 1) % width != 0);
        let pairs: Vec<[f64; 2]> = neighbors.filter_map(|p| Some([gain(p)?, gain(p + 1)?])).collect();
        let mut histogram = vec![0.0; MAX_INTERVAL_READOUTS];
        let mut variances = Vec::new();
        for times in &times {
            let intervals: Vec<f64> = times.windows(2).map(|pair| (pair[1] - pair[0]) as f64).collect();
            for interval in &intervals {
                histogram[(*interval as usize).min(MAX_INTERVAL_READOUTS) - 1] += 1.0;
            }
            if intervals.len() >= 3 {
                variances.push(standard_deviation(&intervals).powi(2));
            }
        }
        let count: f64 = histogram.iter().sum();
        histogram.iter_mut().for_each(|share| *share /= count);
        let mut values = vec![
            mean(&rates),
            early as f64 / (pixels * EARLY_READOUTS) as f64,
            standard_deviation(&gains) / mean(&gains),
            correlation(&pairs),
            mean(&variances),
        ];
        for [low, high] in groups {
            let inside = light.iter().zip(&rates).filter(|(light, _)| (low..=high).contains(light));
            values.push(mean(&inside.map(|(_, rate)| *rate).collect::<Vec<_>>()));
        }
        Self { values, histogram }
    }
}

/// Appends to each run the total variation distance between its histogram and the mean histogram of the preset's other
/// runs.
fn add_histogram_distances(peer: &mut [StreamStatistics], own: &mut [StreamStatistics]) {
    let sum: Vec<f64> =
        (0..MAX_INTERVAL_READOUTS).map(|k| own.iter().map(|run| run.histogram[k]).sum()).collect();
    let distance = |a: &[f64], b: Vec<f64>| a.iter().zip(b).map(|(a, b)| (a - b).abs()).sum::<f64>() / 2.0;
    let runs = own.len() as f64;
    for run in peer {
        let mean = sum.iter().map(|sum| sum / runs).collect();
        run.values.push(distance(&run.histogram, mean));
    }
    for run in own {
        let others =
            sum.iter().zip(&run.histogram).map(|(sum, share)| (sum - share) / (runs - 1.0)).collect();
        run.values.push(distance(&run.histogram, others));
    }
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

fn standard_deviation(values: &[f64]) -> f64 {
    let mean = mean(values);
    (values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (values.len() as f64 - 1.0)).sqrt()
}

fn correlation(pairs: &[[f64; 2]]) -> f64 {
    let column = |k: usize| -> Vec<f64> { pairs.iter().map(|pair| pair[k]).collect() };
    let (a, b) = (column(0), column(1));
    let (mean_a, mean_b) = (mean(&a), mean(&b));
    let product: f64 = pairs.iter().map(|[a, b]| (a - mean_a) * (b - mean_b)).sum();
    product / (pairs.len() as f64 - 1.0) / (standard_deviation(&a) * standard_deviation(&b))
}

#[cfg(test)]
mod tests {
    use super::*;
    use spikelane::{Geometry, Seeds, Simulator, presets};

    fn runs(first_seed: u64, count: u64, change: impl Fn(&mut spikelane::Camera)) -> Vec<SpikeFrames> {
        let mut camera = presets::builtin("scsim-code").unwrap();
        camera.sensor.geometry = Geometry::new(40, 30).unwrap();
        change(&mut camera);
        let light = light();
        let run = |seed| {
            let seeds = Seeds { camera: seed, shot: seed, sequence: 0 };
            let light: Vec<f32> = light.iter().map(|x| *x as f32).collect();
            Simulator::new(&camera, seeds).unwrap().run(&light, 200).unwrap()
        };
        (first_seed..first_seed + count).map(run).collect()
    }

    fn light() -> Vec<f64> {
        (0..1200).map(|p| f64::from(p % 200) / 250.0).collect()
    }

    #[test]
    fn other_seeds_of_a_simulator_agree() {
        let verdict = compare(&runs(100, 3, |_| {}), &runs(0, 20, |_| {}), &light());
        assert_eq!(verdict.conclusion, Conclusion::NoSignificantDifference, "{}", verdict.text);
        assert_eq!(verdict.json["statistics"].as_array().unwrap().len(), 10);
    }

    fn set(camera: &mut spikelane::Camera, effect: &str, key: &str, value: &str) {
        let changed = camera.effect(effect).unwrap().clone().with_text(key, value).unwrap();
        *camera = camera.clone().with_effect(changed);
    }

    #[test]
    fn each_changed_property_of_a_camera_is_a_difference() {
        let own = runs(0, 20, |_| {});
        type Change = (&'static str, fn(&mut spikelane::Camera));
        let changes: [Change; 4] = [
            ("sensitivity", |camera| camera.sensor.thresholds_at_full_scale *= 1.02),
            ("gain spread", |camera| set(camera, "prnu", "sigma", "0.04")),
            ("threshold noise", |camera| set(camera, "thermal_noise", "sigma", "20 mV")),
            ("start charges", |camera| set(camera, "start_phase", "charge", "4.7 fC")),
        ];
        for (name, change) in changes {
            let verdict = compare(&runs(100, 3, change), &own, &light());
            assert_eq!(verdict.conclusion, Conclusion::Different, "{name}: {}", verdict.text);
        }
    }
}
