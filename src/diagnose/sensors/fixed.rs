//! Lost and repeated readouts in a simulation: where a set has them instead of by chance.

use std::hash::{DefaultHasher, Hash, Hasher};
use std::sync::Arc;

use super::model::Model;
use crate::diagnose::events::located::{Count, EVENTS, Located};
use crate::diagnose::fit::fit::Fit;
use crate::diagnose::null::reference::Signature;
use crate::pixel::Op;

/// Events that a simulation has at the readouts at which a set has them.
#[derive(Clone, Debug, Default)]
pub(in crate::diagnose) struct Pinned {
    located: Arc<Located>,
    kinds: [bool; EVENTS.len()],
}

impl Pinned {
    /// Those of `located` that a model with these effects has.
    pub fn new<'a>(located: &Arc<Located>, effects: impl Iterator<Item = &'a str> + Clone) -> Self {
        let has = |kind: usize| effects.clone().any(|name| name == EVENTS[kind]);
        Self { located: located.clone(), kinds: std::array::from_fn(has) }
    }

    /// The same events of another set.
    pub fn of(&self, located: &Arc<Located>) -> Self {
        Self { located: located.clone(), kinds: self.kinds }
    }

    pub fn is_any(&self) -> bool {
        self.kinds.contains(&true)
    }

    /// A number that tells two apart; zero where there are none.
    pub fn id(&self) -> u64 {
        if !self.is_any() {
            return 0;
        }
        let mut hasher = DefaultHasher::new();
        (&self.located, self.kinds).hash(&mut hasher);
        hasher.finish()
    }

    /// Lost and repeated readouts of recording `k`; `None` for those that are left to chance.
    pub fn places(&self, k: usize) -> [Option<&[usize]>; EVENTS.len()] {
        let of = |kind: usize| self.located.0.get(k).filter(|_| self.kinds[kind])?[kind].as_deref();
        std::array::from_fn(of)
    }
}

/// Whether an operation makes at random what stands in `places`.
pub(in crate::diagnose) fn replaced(op: &Op, places: &[Option<&[usize]>; EVENTS.len()]) -> bool {
    match op {
        Op::DropReadouts { .. } => places[0].is_some(),
        Op::RepeatReadouts { .. } => places[1].is_some(),
        _ => false,
    }
}

/// Loses and repeats readouts of a recording that has as many more as are lost.
pub(in crate::diagnose) fn put_in(
    frames: &mut Vec<u8>,
    bytes: usize,
    places: &[Option<&[usize]>; EVENTS.len()],
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

impl Fit {
    /// Has lost and repeated readouts that are its effects' where the fitted set has them, as often as the sets at hand do.
    pub fn pin(&mut self) {
        self.model.pinned = Pinned::new(&self.located.fitted, self.effects.iter().map(|e| e.0));
        for e in 0..self.effects.len() {
            let j = self.knobs_of(e).start;
            if let Some(count) = self.count(j) {
                let knob = self.model.knobs[j];
                self.u[j] = knob.clamped(knob.position(count.rate()));
            }
        }
    }

    /// Its model with the lost and repeated readouts of the set that judges.
    pub fn judging(&self) -> Model {
        Model { pinned: self.model.pinned.of(&self.located.judging), ..self.model.clone() }
    }

    /// How many events a number is the probability of, where they are located: then no fit moves it.
    pub fn count(&self, j: usize) -> Option<Count> {
        let knob = self.model.knobs[j];
        (j >= self.base_knobs()).then(|| self.located.of(knob.effect)).flatten()
    }

    /// Whether a signature is of an effect that the sets at hand can have.
    pub fn allows(&self, signature: &Signature) -> bool {
        self.located.allow(signature.candidate.name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_recording_loses_and_repeats_the_readouts_that_it_is_told_to() {
        // Readouts of two bytes, of which the first is skipped; 1, 4 and 5 of the others are lost.
        let frames: Vec<u8> = (0..11_u8).flat_map(|t| [t, t]).collect();
        let put = |lost: &[usize], repeated: &[usize]| {
            let mut frames = frames.clone();
            put_in(&mut frames, 2, &[Some(lost), Some(repeated)], 1);
            frames.chunks(2).map(|f| f[0]).collect::<Vec<u8>>()
        };
        assert_eq!(put(&[1, 3, 3], &[]), [0, 1, 3, 4, 7, 8, 9, 10]);
        // A readout that repeats one that is a copy itself is the same once more.
        assert_eq!(put(&[1, 3, 3], &[1, 2, 5]), [0, 1, 1, 1, 7, 8, 8, 10]);
        assert_eq!(put(&[], &[]).len(), 11);
    }

    #[test]
    fn a_simulation_has_the_events_of_its_effects_and_no_others() {
        let located = Arc::new(Located(vec![[Some(vec![3]), Some(vec![8])], [Some(vec![5]), None]]));
        let of = |names: &[&'static str]| Pinned::new(&located, names.iter().copied());
        let both = of(&["flicker", "repeated_readouts", "dropped_readouts"]);
        assert_eq!(both.places(0), [Some([3].as_slice()), Some([8].as_slice())]);
        assert_eq!(both.places(1), [Some([5].as_slice()), None], "left to chance");
        assert_eq!(of(&["repeated_readouts"]).places(0), [None, Some([8].as_slice())]);
        assert!(!of(&["flicker"]).is_any() && of(&["flicker"]).id() == 0);
        assert_ne!(both.id(), of(&["repeated_readouts"]).id());
    }
}
