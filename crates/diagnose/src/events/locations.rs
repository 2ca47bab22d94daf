//! Locations of lost and repeated readouts, in recordings and in simulations.
//!
//! The number of events in a recording is random, and it changes many statistics together. Most other effects
//! change the statistics by less than this randomness does. If a model contained only the probability of the
//! events, the randomness would hide these effects. Simulations therefore have their events at the readouts that
//! were located in the recordings.

use std::hash::{DefaultHasher, Hash, Hasher};
use std::sync::Arc;

use crate::events::lost_readouts::{complete_waves, constant_periods, locate_lost};
use crate::events::repeated_readouts::locate_repeated;
use crate::recordings::bits::PixelBits;
use crate::recordings::recorded_scene::RecordedScene;
use crate::recordings::scan::Scan;
use crate::thresholds::{MAX_LISTED_EVENTS, MIN_CERTAIN_EVENTS};
use spikelane::effects::{Definition, EventKind};
use spikelane::pixel::Op;
use spikelane::spikes::SpikeFramesRef;

/// Number of event kinds: lost readouts, repeated readouts.
pub(crate) const KIND_COUNT: usize = 2;

/// Locations of the events of each kind in one recording. `None` means that the events cannot be located. The
/// location of a lost readout is the first readout after it. The location of a repeated readout is the repetition.
pub(crate) type EventLocations = [Option<Vec<usize>>; KIND_COUNT];

/// Returns the event kind of an effect that changes whole readouts.
pub(crate) fn kind_index(effect: &Definition) -> Option<usize> {
    match effect.event_kind? {
        EventKind::DroppedReadouts => Some(0),
        EventKind::RepeatedReadouts => Some(1),
        EventKind::Pixels => None,
    }
}

/// Removes and repeats readouts of a simulated recording. `places` contains the locations of lost and of repeated
/// readouts, and `skip` is the number of readouts before the first judged one. `frames` must still contain the
/// readouts that are removed.
pub(crate) fn apply_events(
    frames: &mut Vec<u8>,
    bytes: usize,
    places: &[Option<&[usize]>; KIND_COUNT],
    skip: usize,
) {
    let lost = places[0].unwrap_or(&[]);
    for (before, place) in lost.iter().enumerate().rev() {
        let at = (skip + place + before) * bytes;
        frames.drain(at..at + bytes);
    }
    for place in places[1].unwrap_or(&[]) {
        let at = (skip + place) * bytes;
        frames.copy_within(at - bytes..at, at);
    }
}

/// Returns the located events of a recording.
pub(crate) fn locate_events(
    frames: SpikeFramesRef<'_>,
    bits: &PixelBits,
    scan: &Scan,
    scene: &RecordedScene,
) -> EventLocations {
    if scene.static_scene.is_some() {
        return [None, None];
    }
    let periods = constant_periods(scene, &scan.stretches, bits.readouts);
    let repeated = locate_repeated(frames, bits, scan, &periods);
    let lost = locate_lost(bits, &periods, repeated.as_deref().unwrap_or(&[]));
    let half = scene.half_period().unwrap_or(0);
    [lost.map(|lost| complete_waves(lost, &scan.stretches, half)), repeated]
}

/// The located events of a recording set. Each element belongs to one recording.
#[derive(Clone, Debug, Default, Hash)]
pub(crate) struct LocatedEvents(pub Vec<EventLocations>);

/// A number of counted events, and the number of readouts in which they were counted.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct EventCount {
    pub events: usize,
    pub readouts: usize,
}

impl EventCount {
    /// Returns the number of events per readout.
    pub(crate) fn rate(self) -> f64 {
        self.events as f64 / self.readouts as f64
    }

    /// Returns the standard deviation of the rate. One event is added to the count, so it is not zero without
    /// events.
    pub(crate) fn deviation(self) -> f64 {
        (self.events as f64 + 1.0).sqrt() / self.readouts as f64
    }

    /// Returns the 95 % interval of the rate. It is computed from the square root of the count, because the square
    /// root of a Poisson count has a standard deviation of 1/2 (Anscombe). For five or more events, both ends are
    /// within 4 % of the exact interval.
    pub(crate) fn interval(self) -> [f64; 2] {
        let root = |events: f64, by: f64| (events.sqrt() + by).max(0.0).powi(2) / self.readouts as f64;
        [root(self.events as f64, -0.98), root(self.events as f64 + 1.0, 0.98)]
    }

    /// Returns the upper limit of the rate with 95 % confidence, by the formula of [`EventCount::interval`].
    /// Without any event, the limit corresponds to 3.3 events. The exact limit is 3.0.
    pub(crate) fn upper_limit(self) -> f64 {
        ((self.events as f64 + 1.0).sqrt() + 0.8225).powi(2) / self.readouts as f64
    }

    fn add(self, other: Self) -> Self {
        Self { events: self.events + other.events, readouts: self.readouts + other.readouts }
    }
}

impl LocatedEvents {
    /// Counts the events of a kind in all recordings.
    fn count(&self, kind: usize, scenes: &[RecordedScene]) -> EventCount {
        let of = |(places, scene): (&EventLocations, &RecordedScene)| match &places[kind] {
            Some(found) => EventCount { events: found.len(), readouts: scene.readouts },
            None => EventCount::default(),
        };
        self.0.iter().zip(scenes).map(of).fold(EventCount::default(), EventCount::add)
    }
}

/// The located events of the fitted set and of the judging set. The judging set is the held-out set, or the fitted
/// set if nothing is held out.
#[derive(Clone, Debug, Default)]
pub(crate) struct Events {
    pub fitted: Arc<LocatedEvents>,
    pub judging: Arc<LocatedEvents>,
    counts: [EventCount; KIND_COUNT],
}

impl Events {
    /// Creates the events of both sets. If `held_out` is set, the counts include the events of the judging set.
    pub(crate) fn new(
        fitted: LocatedEvents,
        judging: LocatedEvents,
        held_out: bool,
        scenes: &[RecordedScene],
    ) -> Self {
        let count = |kind| {
            let own = fitted.count(kind, scenes);
            if held_out { own.add(judging.count(kind, scenes)) } else { own }
        };
        Self { counts: std::array::from_fn(count), fitted: Arc::new(fitted), judging: Arc::new(judging) }
    }

    /// Returns the number of events of `effect`. Returns `None` if the effect does not change whole readouts, or if
    /// its events cannot be located.
    pub(crate) fn of(&self, effect: &Definition) -> Option<EventCount> {
        kind_index(effect).map(|kind| self.counts[kind]).filter(|count| count.readouts > 0)
    }

    /// Describes the number of events in both sets and the first locations in the fitted set. The text is empty if
    /// the events cannot be located.
    pub(crate) fn describe(&self, effect: &Definition, scenes: &[RecordedScene]) -> String {
        let (Some(kind), Some(count)) = (kind_index(effect), self.of(effect)) else { return String::new() };
        let place = |(scene, places): (&RecordedScene, &EventLocations)| {
            let of = |t: &usize| format!("{t} of {}", scene.file_name());
            places[kind].iter().flatten().map(of).collect::<Vec<String>>()
        };
        let first: Vec<String> =
            scenes.iter().zip(&self.fitted.0).flat_map(place).take(MAX_LISTED_EVENTS).collect();
        let first = if first.is_empty() {
            "all of them held out".to_owned()
        } else {
            format!("the first at {}", first.join(", "))
        };
        format!("; {} found in {} readouts, {first}", count.events, count.readouts)
    }

    /// Returns whether the recordings can contain `effect`: its events cannot be located, or at least one event was
    /// located.
    pub(crate) fn allow(&self, effect: &Definition) -> bool {
        self.of(effect).is_none_or(|count| count.events > 0)
    }

    /// Returns whether the recordings certainly contain `effect`: at least [`MIN_CERTAIN_EVENTS`] events were
    /// located.
    pub(crate) fn demand(&self, effect: &Definition) -> bool {
        self.of(effect).is_some_and(|count| count.events >= MIN_CERTAIN_EVENTS)
    }
}

/// Events that a simulation has at the located readouts instead of at random readouts.
#[derive(Clone, Debug, Default)]
pub(crate) struct PinnedEvents {
    located: Arc<LocatedEvents>,
    kinds: [bool; KIND_COUNT],
}

impl PinnedEvents {
    /// Creates the pinned events of those kinds that belong to one of `effects`.
    pub(crate) fn new<'a>(
        located: &Arc<LocatedEvents>,
        effects: impl Iterator<Item = &'a Definition> + Clone,
    ) -> Self {
        let has = |k: usize| effects.clone().any(|effect| kind_index(effect) == Some(k));
        Self { located: located.clone(), kinds: std::array::from_fn(has) }
    }

    /// Returns pinned events of the same kinds at the locations `located` of another set.
    pub(crate) fn of(&self, located: &Arc<LocatedEvents>) -> Self {
        Self { located: located.clone(), kinds: self.kinds }
    }

    /// Returns whether any kind of events is pinned.
    pub(crate) fn is_any(&self) -> bool {
        self.kinds.contains(&true)
    }

    /// Returns a hash of the events, or 0 if there are none.
    pub(crate) fn id(&self) -> u64 {
        if !self.is_any() {
            return 0;
        }
        let mut hasher = DefaultHasher::new();
        (&self.located, self.kinds).hash(&mut hasher);
        hasher.finish()
    }

    /// Returns the locations of the lost and of the repeated readouts in recording `k`. `None` means that the
    /// simulation draws the locations at random.
    pub(crate) fn places(&self, k: usize) -> [Option<&[usize]>; KIND_COUNT] {
        let of = |kind: usize| self.located.0.get(k).filter(|_| self.kinds[kind])?[kind].as_deref();
        std::array::from_fn(of)
    }
}

/// Returns whether `op` draws events of a kind whose locations are in `places`. The simulation then omits `op`.
pub(crate) fn is_replaced(op: &Op, places: &[Option<&[usize]>; KIND_COUNT]) -> bool {
    match op {
        Op::DropReadouts { .. } => places[0].is_some(),
        Op::RepeatReadouts { .. } => places[1].is_some(),
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use spikelane::effects::{dropped_readouts, flicker, repeated_readouts};

    #[test]
    fn events_are_applied_at_their_locations() {
        // Readouts of two bytes, of which the first one is skipped. Of the other readouts, numbers 1, 4 and 5 are
        // lost.
        let frames: Vec<u8> = (0..11_u8).flat_map(|t| [t, t]).collect();
        let put = |lost: &[usize], repeated: &[usize]| {
            let mut frames = frames.clone();
            apply_events(&mut frames, 2, &[Some(lost), Some(repeated)], 1);
            frames.chunks(2).map(|f| f[0]).collect::<Vec<u8>>()
        };
        assert_eq!(put(&[1, 3, 3], &[]), [0, 1, 3, 4, 7, 8, 9, 10]);
        // If the repeated readout is itself a repetition, the same readout appears once more.
        assert_eq!(put(&[1, 3, 3], &[1, 2, 5]), [0, 1, 1, 1, 7, 8, 8, 10]);
        assert_eq!(put(&[], &[]).len(), 11);
    }

    #[test]
    fn intervals_of_rates_agree_with_exact_poisson_limits() {
        // Exact limits (Garwood) for 5, 20 and 100 events.
        for (events, low, high) in [(5, 1.62, 11.67), (20, 12.22, 30.89), (100, 81.36, 121.63)] {
            let [found_low, found_high] = EventCount { events, readouts: 1 }.interval();
            assert!(
                (found_low / low - 1.0).abs() < 0.04 && (found_high / high - 1.0).abs() < 0.04,
                "{events}"
            );
        }
        assert_eq!(EventCount { events: 0, readouts: 10 }.interval()[0], 0.0);
        // Exact one-sided limits for 0, 1, 5 and 20 events.
        for (events, limit) in [(0, 3.00), (1, 4.74), (5, 10.51), (20, 29.06)] {
            let ratio = EventCount { events, readouts: 1 }.upper_limit() / limit;
            assert!((1.0..1.12).contains(&ratio), "{events}: {ratio}");
        }
    }

    #[test]
    fn an_effect_without_located_events_is_excluded() {
        let scene = |readouts| RecordedScene {
            name: String::new(),
            light: spikelane_calibrate::Stimulus::Level(0.1),
            readouts,
            first_readout: 0,
            static_scene: None,
            light_uncertainty: 0.01,
            sources: spikelane_calibrate::unstable::Sources::default(),
            light_offset: 0.0,
        };
        let scenes = [scene(400), scene(600)];
        let set = |lost: &[usize]| LocatedEvents(vec![[None, None], [Some(lost.to_vec()), None]]);
        let events = Events::new(set(&[7, 9]), set(&[5]), true, &scenes);
        assert_eq!(events.of(&dropped_readouts::EFFECT), Some(EventCount { events: 3, readouts: 1200 }));
        assert!(events.demand(&dropped_readouts::EFFECT) && events.allow(&dropped_readouts::EFFECT));
        assert_eq!(
            Events::new(set(&[7, 9]), set(&[7, 9]), false, &scenes)
                .of(&dropped_readouts::EFFECT)
                .unwrap()
                .events,
            2
        );
        let none = Events::new(set(&[]), set(&[]), true, &scenes);
        assert!(!none.allow(&dropped_readouts::EFFECT), "no readout is lost");
        assert!(
            none.allow(&repeated_readouts::EFFECT) && !none.demand(&repeated_readouts::EFFECT),
            "the events cannot be located"
        );
        assert!(none.allow(&flicker::EFFECT) && none.of(&flicker::EFFECT).is_none());
    }

    #[test]
    fn pinned_events_belong_to_the_effects_of_the_model() {
        let located = Arc::new(LocatedEvents(vec![[Some(vec![3]), Some(vec![8])], [Some(vec![5]), None]]));
        let of = |effects: &[&'static Definition]| PinnedEvents::new(&located, effects.iter().copied());
        let both = of(&[&flicker::EFFECT, &repeated_readouts::EFFECT, &dropped_readouts::EFFECT]);
        assert_eq!(both.places(0), [Some([3].as_slice()), Some([8].as_slice())]);
        assert_eq!(both.places(1), [Some([5].as_slice()), None], "drawn at random");
        assert_eq!(of(&[&repeated_readouts::EFFECT]).places(0), [None, Some([8].as_slice())]);
        assert!(!of(&[&flicker::EFFECT]).is_any() && of(&[&flicker::EFFECT]).id() == 0);
        assert_ne!(both.id(), of(&[&repeated_readouts::EFFECT]).id());
    }
}
