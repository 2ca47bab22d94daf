//! Which sensors a study has.

use spikelane::unstable::draws::hash::mix64;

use super::hidden_sensor::{INSIDE, Kind, OUTSIDE};

/// What is hidden in a sensor.
pub(crate) struct Job {
    pub class: &'static str,
    pub kinds: Vec<&'static Kind>,
    pub index: usize,
}

impl Job {
    pub(crate) fn id(&self) -> String {
        let names: Vec<String> = self.kinds.iter().map(|k| k.name.replace(' ', "_")).collect();
        format!("{}-{}-{:03}", self.class, names.join("+"), self.index)
    }

    pub(crate) fn seed(&self) -> u64 {
        // FNV-1a of the name: a sensor is the same in every run of the study.
        self.id()
            .bytes()
            .fold(0xcbf2_9ce4_8422_2325, |h, b| (h ^ u64::from(b)).wrapping_mul(0x0000_0100_0000_01B3))
    }
}

/// Effects that came when pairs were drawn already.
const LATER: [&str; 2] = ["correlated_shot_noise", "readout_jitter"];

/// All sensors that are asked for, in the order in which they run: so many clean ones, of each single effect, of each from outside,
/// of doubles and of triples, of the effects in `names` or of all.
pub(crate) fn jobs(counts: [usize; 5], names: &[String]) -> Vec<Job> {
    let [nulls, singles, unknown, doubles, triples] = counts;
    let wanted = |k: &&Kind| names.is_empty() || names.iter().any(|n| n == k.name);
    let chosen = |k: &&&'static Kind| spikelane::effects::find(k.name).is_ok() && wanted(k);
    // Other numbers of the base model are what calibration fits: nothing to find.
    let base = ["thermal_noise", "prnu", "dark_current"];
    let all: Vec<&'static Kind> = INSIDE.iter().collect();
    let inside: Vec<&'static Kind> =
        all.iter().filter(chosen).copied().filter(|k| !base.contains(&k.name)).collect();
    // Pairs and triples are drawn from those that were there first, so that an index keeps its sensor.
    let paired: Vec<&'static Kind> = inside.iter().copied().filter(|k| !LATER.contains(&k.name)).collect();
    let most = counts.into_iter().max().unwrap_or(0);
    let mut jobs = Vec::new();
    for index in 0..most {
        if index < nulls {
            jobs.push(Job { class: "null", kinds: Vec::new(), index });
        }
        // Side by side, so that a run that is cut short has some of each.
        let outside = OUTSIDE.iter().filter(|k| index < unknown && wanted(k)).map(|k| Job {
            class: "outside",
            kinds: vec![k],
            index,
        });
        let mut outside = outside.collect::<Vec<_>>().into_iter();
        for (i, kind) in inside.iter().enumerate().filter(|_| index < singles) {
            jobs.push(Job { class: "single", kinds: vec![*kind], index });
            if i % 3 == 2 {
                jobs.extend(outside.next());
            }
        }
        jobs.extend(outside);
        if index < doubles {
            jobs.push(Job { class: "double", kinds: several(&paired, 2, index), index });
        }
        if index < triples {
            jobs.push(Job { class: "triple", kinds: several(&paired, 3, index), index });
        }
    }
    jobs
}

/// Different effects, any with any other.
fn several(inside: &[&'static Kind], count: usize, index: usize) -> Vec<&'static Kind> {
    let mut left = inside.to_vec();
    let seed = (count * 1_000_000 + index) as u64;
    let draw =
        |k: usize| left.swap_remove((uniform(seed, k as u64) * left.len() as f64) as usize % left.len());
    (0..count).map(draw).collect()
}

/// A number from 0 to 1, a function of both.
pub(crate) fn uniform(seed: u64, place: u64) -> f64 {
    mix64(seed.wrapping_add(0x9E37_79B9_7F4A_7C15_u64.wrapping_mul(place + 1))) as f64 / u64::MAX as f64
}
