//! Lost and repeated readouts of a recording set, found one by one.
//!
//! How many a recording happens to hold moves all of its statistics together and further than most effects do. A model that
//! only knows their probability strays as far: whatever stands beside it is within its noise, and it takes in what is
//! something else. Where they are found, a simulation has them at the same readouts, and nothing of that is left to chance.

use std::sync::Arc;

use super::lost_readouts::{completed, lost, periods};
use super::places::KINDS;
use super::places::Places;
use super::places::kind;
use super::repeated::repeated;
use crate::diagnose::protocol::recorded::RecordedScene;
use crate::diagnose::recording::bits::PixelBits;
use crate::diagnose::recording::scan::Scan;
use spikelane::effects::Definition;
use spikelane::spikes::SpikeFramesRef;

/// Events from which on the name is tried whatever its signature promises, and those that are said one by one.
const SEVERAL: usize = 3;
const SAID: usize = 4;

/// Those of a recording.
pub(in crate::diagnose) fn places(
    frames: SpikeFramesRef<'_>,
    bits: &PixelBits,
    scan: &Scan,
    scene: &RecordedScene,
) -> Places {
    if scene.static_scene.is_some() {
        return [None, None];
    }
    let periods = periods(scene, &scan.stretches, bits.readouts);
    let repeated = repeated(frames, bits, scan, &periods);
    let lost = lost(bits, &periods, repeated.as_deref().unwrap_or(&[]));
    let half = scene.half_period().unwrap_or(0);
    [lost.map(|lost| completed(lost, &scan.stretches, half)), repeated]
}

/// Those of a set.
#[derive(Clone, Debug, Default, Hash)]
pub(in crate::diagnose) struct Located(pub Vec<Places>);

/// How many there are in as many readouts.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(in crate::diagnose) struct Count {
    pub events: usize,
    pub readouts: usize,
}

impl Count {
    pub(crate) fn rate(self) -> f64 {
        self.events as f64 / self.readouts as f64
    }

    /// The deviation of the rate.
    pub(crate) fn deviation(self) -> f64 {
        (self.events as f64 + 1.0).sqrt() / self.readouts as f64
    }

    /// Ends of the rate's 95 % interval by the root of Poisson's law, which deviates by a half (Anscombe): within 4 % of the exact ones from
    /// five events on.
    pub(crate) fn interval(self) -> [f64; 2] {
        let root = |events: f64, by: f64| (events.sqrt() + by).max(0.0).powi(2) / self.readouts as f64;
        [root(self.events as f64, -0.98), root(self.events as f64 + 1.0, 0.98)]
    }

    fn and(self, other: Self) -> Self {
        Self { events: self.events + other.events, readouts: self.readouts + other.readouts }
    }
}

impl Located {
    fn count(&self, kind: usize, scenes: &[RecordedScene]) -> Count {
        let of = |(places, scene): (&Places, &RecordedScene)| match &places[kind] {
            Some(found) => Count { events: found.len(), readouts: scene.readouts },
            None => Count::default(),
        };
        self.0.iter().zip(scenes).map(of).fold(Count::default(), Count::and)
    }
}

/// What the sets at hand hold.
#[derive(Clone, Debug, Default)]
pub(in crate::diagnose) struct Events {
    pub fitted: Arc<Located>,
    pub judging: Arc<Located>,
    counts: [Count; KINDS],
}

impl Events {
    /// Of the fitted set and of the one that judges, which counts where it is another.
    pub(crate) fn new(fitted: Located, judging: Located, held_out: bool, scenes: &[RecordedScene]) -> Self {
        let count = |kind| {
            let own = fitted.count(kind, scenes);
            if held_out { own.and(judging.count(kind, scenes)) } else { own }
        };
        Self { counts: std::array::from_fn(count), fitted: Arc::new(fitted), judging: Arc::new(judging) }
    }

    /// How many there are of `effect`; nothing where it does not happen to whole readouts, or they cannot be told.
    pub(crate) fn of(&self, effect: &Definition) -> Option<Count> {
        kind(effect).map(|kind| self.counts[kind]).filter(|count| count.readouts > 0)
    }

    /// How many there are and where the first ones of the fitted set are, in words; nothing where they cannot be told.
    pub(crate) fn words(&self, effect: &Definition, scenes: &[RecordedScene]) -> String {
        let (Some(kind), Some(count)) = (kind(effect), self.of(effect)) else { return String::new() };
        let place = |(scene, places): (&RecordedScene, &Places)| {
            let of = |t: &usize| format!("{t} of {}", scene.file_name());
            places[kind].iter().flatten().map(of).collect::<Vec<String>>()
        };
        let first: Vec<String> = scenes.iter().zip(&self.fitted.0).flat_map(place).take(SAID).collect();
        let first = if first.is_empty() {
            "all of them held out".to_owned()
        } else {
            format!("the first at {}", first.join(", "))
        };
        format!("; {} found in {} readouts, {first}", count.events, count.readouts)
    }

    /// Whether the sets can have the effect at all.
    pub(crate) fn allow(&self, effect: &Definition) -> bool {
        self.of(effect).is_none_or(|count| count.events > 0)
    }

    /// Whether they plainly have it.
    pub(crate) fn demand(&self, effect: &Definition) -> bool {
        self.of(effect).is_some_and(|count| count.events >= SEVERAL)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use spikelane::effects::{dropped_readouts, flicker, repeated_readouts};

    #[test]
    fn rates_are_known_as_poissons_law_says() {
        // Exact ends (Garwood) of 5, 20 and 100 events.
        for (events, low, high) in [(5, 1.62, 11.67), (20, 12.22, 30.89), (100, 81.36, 121.63)] {
            let [found_low, found_high] = Count { events, readouts: 1 }.interval();
            assert!(
                (found_low / low - 1.0).abs() < 0.04 && (found_high / high - 1.0).abs() < 0.04,
                "{events}"
            );
        }
        assert_eq!(Count { events: 0, readouts: 10 }.interval()[0], 0.0);
    }

    #[test]
    fn only_what_was_found_can_be_named_and_what_was_not_looked_for_can() {
        let scene = |readouts| RecordedScene {
            name: String::new(),
            light: crate::Stimulus::Level(0.1),
            readouts,
            first_readout: 0,
            static_scene: None,
            light_uncertainty: 0.01,
            sources: crate::recordings::sources::Sources::default(),
            light_offset: 0.0,
        };
        let scenes = [scene(400), scene(600)];
        let set = |lost: &[usize]| Located(vec![[None, None], [Some(lost.to_vec()), None]]);
        let events = Events::new(set(&[7, 9]), set(&[5]), true, &scenes);
        assert_eq!(events.of(&dropped_readouts::EFFECT), Some(Count { events: 3, readouts: 1200 }));
        assert!(events.demand(&dropped_readouts::EFFECT) && events.allow(&dropped_readouts::EFFECT));
        assert_eq!(
            Events::new(set(&[7, 9]), set(&[7, 9]), false, &scenes)
                .of(&dropped_readouts::EFFECT)
                .unwrap()
                .events,
            2
        );
        let none = Events::new(set(&[]), set(&[]), true, &scenes);
        assert!(!none.allow(&dropped_readouts::EFFECT), "none was lost");
        assert!(
            none.allow(&repeated_readouts::EFFECT) && !none.demand(&repeated_readouts::EFFECT),
            "cannot be told"
        );
        assert!(none.allow(&flicker::EFFECT) && none.of(&flicker::EFFECT).is_none());
    }
}
