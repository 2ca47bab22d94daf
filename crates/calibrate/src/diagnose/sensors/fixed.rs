//! Lost and repeated readouts in a simulation: where a set has them instead of by chance.

use std::hash::{DefaultHasher, Hash, Hasher};
use std::sync::Arc;

use crate::diagnose::events::located::Located;
use crate::diagnose::events::places::{KINDS, kind};
use spikelane::effects::Definition;
use spikelane::pixel::Op;

/// Events that a simulation has at the readouts at which a set has them.
#[derive(Clone, Debug, Default)]
pub(in crate::diagnose) struct Pinned {
    located: Arc<Located>,
    kinds: [bool; KINDS],
}

impl Pinned {
    /// Those of `located` that a model with these effects has.
    pub(crate) fn new<'a>(
        located: &Arc<Located>,
        effects: impl Iterator<Item = &'a Definition> + Clone,
    ) -> Self {
        let has = |k: usize| effects.clone().any(|effect| kind(effect) == Some(k));
        Self { located: located.clone(), kinds: std::array::from_fn(has) }
    }

    /// The same events of another set.
    pub(crate) fn of(&self, located: &Arc<Located>) -> Self {
        Self { located: located.clone(), kinds: self.kinds }
    }

    pub(crate) fn is_any(&self) -> bool {
        self.kinds.contains(&true)
    }

    /// A number that tells two apart; zero where there are none.
    pub(crate) fn id(&self) -> u64 {
        if !self.is_any() {
            return 0;
        }
        let mut hasher = DefaultHasher::new();
        (&self.located, self.kinds).hash(&mut hasher);
        hasher.finish()
    }

    /// Lost and repeated readouts of recording `k`; `None` for those that are left to chance.
    pub(crate) fn places(&self, k: usize) -> [Option<&[usize]>; KINDS] {
        let of = |kind: usize| self.located.0.get(k).filter(|_| self.kinds[kind])?[kind].as_deref();
        std::array::from_fn(of)
    }
}

/// Whether an operation makes at random what stands in `places`.
pub(in crate::diagnose) fn replaced(op: &Op, places: &[Option<&[usize]>; KINDS]) -> bool {
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
    fn a_simulation_has_the_events_of_its_effects_and_no_others() {
        let located = Arc::new(Located(vec![[Some(vec![3]), Some(vec![8])], [Some(vec![5]), None]]));
        let of = |effects: &[&'static Definition]| Pinned::new(&located, effects.iter().copied());
        let both = of(&[&flicker::EFFECT, &repeated_readouts::EFFECT, &dropped_readouts::EFFECT]);
        assert_eq!(both.places(0), [Some([3].as_slice()), Some([8].as_slice())]);
        assert_eq!(both.places(1), [Some([5].as_slice()), None], "left to chance");
        assert_eq!(of(&[&repeated_readouts::EFFECT]).places(0), [None, Some([8].as_slice())]);
        assert!(!of(&[&flicker::EFFECT]).is_any() && of(&[&flicker::EFFECT]).id() == 0);
        assert_ne!(both.id(), of(&[&repeated_readouts::EFFECT]).id());
    }
}
