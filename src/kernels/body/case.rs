//! The cases that have a function of their own in every backend: one function
//! with all of them has fifty thousand instructions, and the compiler then
//! stops to inline and spills what it could keep.

use crate::kernels::body::moving::moving;
use crate::kernels::body::noiseless::noiseless;
use crate::kernels::body::noisy::noisy;
use crate::kernels::body::{CLAMPED, FREE, LATE, NONE, READOUT, RESET, SURPLUS};
use crate::kernels::isa::lanes::Lanes;
use crate::kernels::{Job, Light, Samples};
use crate::pixel::Redraw;
use crate::plan::{NoiseTable, StateParts};

const LATE_READOUT: u8 = LATE | READOUT;
const LATE_RESET: u8 = LATE | RESET;

/// What a job asks of its body.
#[derive(Clone, Copy, Debug)]
struct Asks {
    /// Something moves besides the light that a frame gives.
    moves: bool,
    /// Neighbours or the response bend the light of a frame.
    bends: bool,
    /// Quanta are drawn.
    shot: bool,
    /// Threshold noise in whole steps, or none, where resets keep the remainder; with [`LATE`] where quanta's noise waits or pixels
    /// are undecided.
    noise: Option<u8>,
    /// How charge is stored.
    store: u8,
    /// A dead time, flipped bits, or a lost remainder.
    extra: bool,
    /// 8-bit frames are held, and every increment is a whole number of steps.
    whole: bool,
}

impl Asks {
    fn of(job: &Job<'_>) -> Self {
        let (tables, rules) = (job.plan.tables(), job.plan.rules());
        let noise = match (&tables.noise, rules.redraw) {
            (None, _) => Some(NONE),
            (Some(NoiseTable::Whole(_)), Redraw::EveryReadout) => Some(READOUT),
            (Some(NoiseTable::Whole(_)), Redraw::EveryReset) => Some(RESET),
            (Some(NoiseTable::Fine(_)), _) => None,
        };
        let late = if rules.released != 0 || !tables.undecided.is_empty() { LATE } else { 0 };
        let grey = |light: &Light<'_>| matches!(light, Light::Held(Samples::U8(_)));
        Self {
            moves: job.plan.moving().is_some_and(|moving| !moving.only_bends_light()),
            bends: job.plan.moving().is_some(),
            shot: tables.shot.is_some(),
            noise: noise.filter(|_| rules.keeps_remainder()).map(|noise| noise | late),
            store: match (rules.surplus, tables.ceiling.is_empty()) {
                (true, _) => SURPLUS,
                (false, true) => FREE,
                (false, false) => CLAMPED,
            },
            extra: rules.extras(),
            whole: !tables.whole_gain.is_empty() && job.batch.segments().iter().all(|(_, l)| grey(l)),
        }
    }
}

/// What runs a job in a case: a function that is compiled for an instruction set.
pub(in crate::kernels) trait Entry {
    /// Calls [`run`] with the case.
    fn enter<const CASE: u8>(self);
}

/// The table of cases: the first whose condition holds is taken.
macro_rules! cases {
    ($($(#[$doc:meta])* $name:ident: $condition:pat => $body:expr;)*) => {
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[repr(u8)]
        #[allow(non_camel_case_types, clippy::upper_case_acronyms, reason = "they are constants to the compiler")]
        enum Case { $($(#[$doc])* $name),* }

        impl Case {
            fn of(asks: Asks) -> Self {
                match asks { $($condition => Self::$name),* }
            }
        }

        $(const $name: u8 = Case::$name as u8;)*

        /// Enters the function of the job's case.
        pub(in crate::kernels) fn by_case(job: &Job<'_>, entry: impl Entry) {
            match Case::of(Asks::of(job)) { $(Case::$name => entry.enter::<$name>()),* }
        }

        /// Enters one of four functions that take any job: where something moves, two for plans without noise, and that which asks
        /// for the rules at run time.
        #[cfg(target_arch = "x86_64")]
        pub(in crate::kernels) fn by_general_case(job: &Job<'_>, entry: impl Entry) {
            match Case::of(Asks::of(job)) {
                Case::MOVING => entry.enter::<MOVING>(),
                Case::NOISELESS_FREE_WHOLE | Case::NOISELESS_FREE => entry.enter::<NOISELESS_FREE>(),
                Case::NOISELESS_CLAMPED_WHOLE | Case::NOISELESS_CLAMPED => entry.enter::<NOISELESS_CLAMPED>(),
                _ => entry.enter::<ANY_RULES>(),
            }
        }

        /// Runs a job of case `CASE`.
        #[inline(always)]
        pub(in crate::kernels) fn run<L: Lanes, const CASE: u8>(
            l: L,
            job: &Job<'_>,
            state: &mut StateParts<'_>,
            out: &mut [u8],
        ) {
            match CASE {
                $($name => $body(l, job, state, out),)*
                _ => {}
            }
        }
    };
}

// The parameters of `noiseless`: how charge is stored, whether increments are whole. Those of `noisy`: the noise of the
// threshold, how charge is stored, whether rules are asked at run time, and whether two vectors can run together all the same.
cases! {
    /// Something moves: asked at run time, a vector and a readout at a time.
    MOVING: Asks { moves: true, .. } => moving;
    /// The published model: quanta, noise drawn at readouts, a bound on charge, and a dead time or flipped bits.
    READOUT_CLAMPED_EXTRA:
        Asks { shot: true, noise: Some(READOUT), store: CLAMPED, extra: true, .. } => noisy::<L, READOUT, CLAMPED, true, true>;
    /// The same without a bound.
    READOUT_SURPLUS_EXTRA:
        Asks { shot: true, noise: Some(READOUT), store: SURPLUS, extra: true, .. } => noisy::<L, READOUT, SURPLUS, true, true>;
    /// An ideal pixel in grey levels that are held.
    NOISELESS_FREE_WHOLE:
        Asks { shot: false, noise: Some(NONE), store: FREE, whole: true, bends: false, extra: false, .. } => noiseless::<L, FREE, true>;
    /// A fixed pattern, light that never passes two thresholds.
    NOISELESS_FREE:
        Asks { shot: false, noise: Some(NONE), store: FREE, bends: false, extra: false, .. } => noiseless::<L, FREE, false>;
    /// An ideal pixel with a bound, in grey levels that are held.
    NOISELESS_CLAMPED_WHOLE:
        Asks { shot: false, noise: Some(NONE), store: CLAMPED, whole: true, bends: false, extra: false, .. } => noiseless::<L, CLAMPED, true>;
    /// A fixed pattern and a bound.
    NOISELESS_CLAMPED:
        Asks { shot: false, noise: Some(NONE), store: CLAMPED, bends: false, extra: false, .. } => noiseless::<L, CLAMPED, false>;
    /// Quanta alone, and a bound.
    SHOT_CLAMPED:
        Asks { shot: true, noise: Some(NONE), store: CLAMPED, extra: false, .. } => noisy::<L, NONE, CLAMPED, false, false>;
    /// Quanta, noise drawn at readouts, and a bound.
    READOUT_CLAMPED:
        Asks { shot: true, noise: Some(READOUT), store: CLAMPED, extra: false, .. } => noisy::<L, READOUT, CLAMPED, false, false>;
    /// Quanta, noise drawn at readouts, and no bound.
    READOUT_SURPLUS:
        Asks { shot: true, noise: Some(READOUT), store: SURPLUS, extra: false, .. } => noisy::<L, READOUT, SURPLUS, false, false>;
    /// Quanta, noise frozen from reset to reset, and a bound.
    RESET_CLAMPED:
        Asks { shot: true, noise: Some(RESET), store: CLAMPED, extra: false, .. } => noisy::<L, RESET, CLAMPED, false, false>;
    /// Quanta whose noise waits, or pixels that are undecided, beside noise drawn at readouts and a bound.
    LATE_READOUT_CLAMPED:
        Asks { shot: true, noise: Some(LATE_READOUT), store: CLAMPED, extra: false, .. } => noisy::<L, LATE_READOUT, CLAMPED, false, false>;
    /// The same beside noise frozen from reset to reset.
    LATE_RESET_CLAMPED:
        Asks { shot: true, noise: Some(LATE_RESET), store: CLAMPED, extra: false, .. } => noisy::<L, LATE_RESET, CLAMPED, false, false>;
    /// All that stays, asked at run time.
    ANY_RULES: _ => noisy::<L, NONE, SURPLUS, true, false>;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draws::Seeds;
    use crate::kernels::{Batch, Segment};
    use crate::plan::Plan;
    use crate::presets;
    use crate::spikes::Geometry;

    fn case_of(camera: &crate::Camera, light: Samples<'_>) -> Case {
        let plan = Plan::new(camera, Seeds::default()).unwrap();
        let segments = [Segment { readouts: 1, light: Light::Held(light) }];
        let batch = Batch::after(&plan, &plan.start(), &segments);
        Case::of(Asks::of(&Job::new(&plan, &batch, 0, plan.padded())))
    }

    #[test]
    fn every_preset_has_the_case_that_is_meant_for_it() {
        // Name, case under held 8-bit light, case under other light.
        let expected = [
            ("ideal", Case::NOISELESS_FREE_WHOLE, Case::NOISELESS_FREE),
            ("scsim-paper", Case::READOUT_SURPLUS, Case::READOUT_SURPLUS),
            ("scsim-code", Case::READOUT_SURPLUS_EXTRA, Case::READOUT_SURPLUS_EXTRA),
            ("physical", Case::RESET_CLAMPED, Case::RESET_CLAMPED),
            ("vidar-measured", Case::LATE_RESET_CLAMPED, Case::LATE_RESET_CLAMPED),
            ("vidar-lowlight", Case::RESET_CLAMPED, Case::RESET_CLAMPED),
            ("spcs", Case::NOISELESS_FREE, Case::NOISELESS_FREE),
            ("neuspike", Case::ANY_RULES, Case::ANY_RULES),
            ("spikingsim", Case::ANY_RULES, Case::ANY_RULES),
            ("spikecv", Case::NOISELESS_FREE, Case::NOISELESS_FREE),
            ("spikecv-image", Case::ANY_RULES, Case::ANY_RULES),
            ("spike-zoo", Case::NOISELESS_FREE_WHOLE, Case::NOISELESS_FREE),
        ];
        let (grey, linear) = (vec![51; 64 * 2], vec![0.2; 64 * 2]);
        let mut found = Vec::new();
        for preset in presets::ALL {
            let mut camera = presets::builtin(preset.name).unwrap();
            camera.sensor.geometry = Geometry::new(64, 2).unwrap();
            let of = |light| case_of(&camera, light);
            found.push((preset.name, of(Samples::U8(&grey)), of(Samples::F32(&linear))));
        }
        assert_eq!(found, expected);
    }
}
