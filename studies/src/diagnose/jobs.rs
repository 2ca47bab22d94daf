//! The sensors of a study.

use spikelane::unstable::draws::hash::mix64;

use super::hidden_sensor::{CATALOG_KINDS, Kind, OUTSIDE_KINDS};

/// A sensor of the study and the effects that are hidden in it.
pub(crate) struct SensorJob {
    pub class: &'static str,
    pub kinds: Vec<&'static Kind>,
    pub index: usize,
}

impl SensorJob {
    pub(crate) fn id(&self) -> String {
        let names: Vec<String> = self.kinds.iter().map(|k| k.name.replace(' ', "_")).collect();
        format!("{}-{}-{:03}", self.class, names.join("+"), self.index)
    }

    pub(crate) fn seed(&self) -> u64 {
        // The seed is the FNV-1a hash of the name, so that a sensor is the same in every run of the study.
        self.id()
            .bytes()
            .fold(0xcbf2_9ce4_8422_2325, |h, b| (h ^ u64::from(b)).wrapping_mul(0x0000_0100_0000_01B3))
    }
}

/// Effects that were added after the pairs had been drawn.
const LATER_EFFECTS: [&str; 2] = ["correlated_shot_noise", "readout_jitter"];

/// Returns all requested sensors in the order in which they run.
///
/// `counts` has five numbers: of clean sensors, of sensors for each single effect, of sensors for each effect outside
/// the catalog, of sensors with two effects, and of sensors with three effects. If `names` is not empty, only the
/// effects in `names` are used.
pub(crate) fn jobs(counts: [usize; 5], names: &[String]) -> Vec<SensorJob> {
    let [nulls, singles, unknown, doubles, triples] = counts;
    let wanted = |k: &&Kind| names.is_empty() || names.iter().any(|n| n == k.name);
    let chosen = |k: &&&'static Kind| spikelane::effects::find(k.name).is_ok() && wanted(k);
    // The base model contains these effects. Calibration fits their parameters, so a diagnosis has nothing to find.
    let base = ["thermal_noise", "prnu", "dark_current"];
    let all: Vec<&'static Kind> = CATALOG_KINDS.iter().collect();
    let inside: Vec<&'static Kind> =
        all.iter().filter(chosen).copied().filter(|k| !base.contains(&k.name)).collect();
    // Pairs and triples exclude effects that were added later, so that each index keeps its sensor.
    let paired: Vec<&'static Kind> =
        inside.iter().copied().filter(|k| !LATER_EFFECTS.contains(&k.name)).collect();
    let max_count = counts.into_iter().max().unwrap_or(0);
    let mut jobs = Vec::new();
    for index in 0..max_count {
        if index < nulls {
            jobs.push(SensorJob { class: "null", kinds: Vec::new(), index });
        }
        // The classes are interleaved, so that a run that is cut short has some sensors of each class.
        let outside = OUTSIDE_KINDS.iter().filter(|k| index < unknown && wanted(k)).map(|k| SensorJob {
            class: "outside",
            kinds: vec![k],
            index,
        });
        let mut outside = outside.collect::<Vec<_>>().into_iter();
        for (i, kind) in inside.iter().enumerate().filter(|_| index < singles) {
            jobs.push(SensorJob { class: "single", kinds: vec![*kind], index });
            if i % 3 == 2 {
                jobs.extend(outside.next());
            }
        }
        jobs.extend(outside);
        if index < doubles {
            jobs.push(SensorJob { class: "double", kinds: choose_kinds(&paired, 2, index), index });
        }
        if index < triples {
            jobs.push(SensorJob { class: "triple", kinds: choose_kinds(&paired, 3, index), index });
        }
    }
    jobs
}

/// Returns `count` different effects. Every combination is possible.
fn choose_kinds(inside: &[&'static Kind], count: usize, index: usize) -> Vec<&'static Kind> {
    let mut left = inside.to_vec();
    let seed = (count * 1_000_000 + index) as u64;
    let draw =
        |k: usize| left.swap_remove((uniform_hash(seed, k as u64) * left.len() as f64) as usize % left.len());
    (0..count).map(draw).collect()
}

/// Returns a pseudo-random number from 0 to 1, which is a hash of `seed` and `place`. Different values of `place` give
/// independent numbers.
pub(crate) fn uniform_hash(seed: u64, place: u64) -> f64 {
    mix64(seed.wrapping_add(0x9E37_79B9_7F4A_7C15_u64.wrapping_mul(place + 1))) as f64 / u64::MAX as f64
}
