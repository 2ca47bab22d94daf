//! The cases. Each backend has a separate function for each case.
//!
//! A single kernel function for all plans would have fifty thousand instructions. In such a function, the compiler
//! stops inlining and stores register values in memory.

use crate::kernels::body::dynamics::dynamics;
use crate::kernels::body::noiseless::noiseless;
use crate::kernels::body::noisy::noisy;
use crate::kernels::body::{
    CORRELATED, NOISE_NONE, NOISE_READOUT, NOISE_RESET, STORE_CLAMPED, STORE_FREE, STORE_SURPLUS,
};
use crate::kernels::isa::lanes::Lanes;
use crate::kernels::{Job, Samples, SegmentLight};
use crate::pixel::NoiseSampling;
use crate::plan::{NoiseTable, StateTile};

const CORRELATED_READOUT: u8 = CORRELATED | NOISE_READOUT;
const CORRELATED_RESET: u8 = CORRELATED | NOISE_RESET;

/// The properties of a job that select its case.
#[derive(Clone, Copy, Debug)]
struct CaseKey {
    /// Whether the plan has dynamics that do more than change the light of a frame.
    is_dynamic: bool,
    /// Whether the plan has any dynamics, which may change the light of a frame.
    changes_light: bool,
    /// Whether quanta are drawn.
    has_shot_noise: bool,
    /// Kind of the threshold noise.
    ///
    /// The value is `None` if the noise is not in whole steps, or if resets lose a part of the remainder. The value
    /// includes the flag [`CORRELATED`] if noise of the quanta can be pending or pixels have jitter.
    noise: Option<u8>,
    /// Storage of charge.
    store: u8,
    /// Whether the plan has a dead time, flipped bits or a lost remainder.
    has_extras: bool,
    /// Whether all light consists of held 8-bit frames and every increment is a whole number of steps.
    is_whole: bool,
}

impl CaseKey {
    fn from_job(job: &Job<'_>) -> Self {
        let (tables, rules) = (job.plan.tables(), job.plan.rules());
        let noise = match (&tables.noise, rules.noise_sampling) {
            (None, _) => Some(NOISE_NONE),
            (Some(NoiseTable::Whole(_)), NoiseSampling::EveryReadout) => Some(NOISE_READOUT),
            (Some(NoiseTable::Whole(_)), NoiseSampling::EveryReset) => Some(NOISE_RESET),
            (Some(NoiseTable::Fine(_)), _) => None,
        };
        let late = if rules.release_share != 0 || !tables.jitter_width.is_empty() { CORRELATED } else { 0 };
        let gray = |light: &SegmentLight<'_>| matches!(light, SegmentLight::Hold(Samples::U8(_)));
        Self {
            is_dynamic: job.plan.dynamics().is_some_and(|dynamics| !dynamics.only_changes_light()),
            changes_light: job.plan.dynamics().is_some(),
            has_shot_noise: tables.shot.is_some(),
            noise: noise.filter(|_| rules.keeps_remainder()).map(|noise| noise | late),
            store: match (rules.counts_surplus, tables.ceiling.is_empty()) {
                (true, _) => STORE_SURPLUS,
                (false, true) => STORE_FREE,
                (false, false) => STORE_CLAMPED,
            },
            has_extras: rules.has_extras(),
            is_whole: !tables.whole_gain.is_empty() && job.batch.segments().iter().all(|(_, l)| gray(l)),
        }
    }
}

/// A kernel call that is compiled for an instruction set.
pub(in crate::kernels) trait Entry {
    /// Calls [`run`] with this case.
    fn enter<const CASE: u8>(self);
}

/// Defines the cases. A job has the first case whose pattern matches its [`CaseKey`].
macro_rules! cases {
    ($($(#[$doc:meta])* $name:ident: $condition:pat => $body:expr;)*) => {
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[repr(u8)]
        #[allow(non_camel_case_types, clippy::upper_case_acronyms, reason = "they are constants to the compiler")]
        enum Case { $($(#[$doc])* $name),* }

        impl Case {
            fn from_key(key: CaseKey) -> Self {
                match key { $($condition => Self::$name),* }
            }
        }

        $(const $name: u8 = Case::$name as u8;)*

        /// Calls the function of the job's case.
        pub(in crate::kernels) fn by_case(job: &Job<'_>, entry: impl Entry) {
            match Case::from_key(CaseKey::from_job(job)) { $(Case::$name => entry.enter::<$name>()),* }
        }

        /// Calls one of four functions that together implement all jobs.
        ///
        /// The four functions are the cases `DYNAMICS` (plans with dynamics), `NOISELESS_FREE` and `NOISELESS_CLAMPED`
        /// (plans without noise), and `GENERAL` (all other plans).
        #[cfg(target_arch = "x86_64")]
        pub(in crate::kernels) fn by_general_case(job: &Job<'_>, entry: impl Entry) {
            match Case::from_key(CaseKey::from_job(job)) {
                Case::DYNAMICS => entry.enter::<DYNAMICS>(),
                Case::NOISELESS_FREE_WHOLE | Case::NOISELESS_FREE => entry.enter::<NOISELESS_FREE>(),
                Case::NOISELESS_CLAMPED => entry.enter::<NOISELESS_CLAMPED>(),
                _ => entry.enter::<GENERAL>(),
            }
        }

        /// Runs a job of case `CASE`.
        #[inline(always)]
        pub(in crate::kernels) fn run<L: Lanes, const CASE: u8>(
            l: L,
            job: &Job<'_>,
            state: &mut StateTile<'_>,
            out: &mut [u8],
        ) {
            match CASE {
                $($name => $body(l, job, state, out),)*
                _ => {}
            }
        }
    };
}

// The parameters of `noiseless` are `STORE` and `WHOLE`; the parameters of `noisy` are `NOISE`, `STORE`, `ANY` and `EXTRA`.
cases! {
    /// Plans with dynamics. The kernel reads the rules at run time and runs one vector and one readout at a time.
    DYNAMICS: CaseKey { is_dynamic: true, .. } => dynamics;
    /// Plans with quanta, threshold noise drawn at readouts, clamped charge, and a dead time or flipped bits. This case
    /// includes the published camera model.
    READOUT_CLAMPED_EXTRA:
        CaseKey { has_shot_noise: true, noise: Some(NOISE_READOUT), store: STORE_CLAMPED, has_extras: true, .. } => noisy::<L, NOISE_READOUT, STORE_CLAMPED, true, true>;
    /// Like `READOUT_CLAMPED_EXTRA`, but with counted surplus instead of a clamp.
    READOUT_SURPLUS_EXTRA:
        CaseKey { has_shot_noise: true, noise: Some(NOISE_READOUT), store: STORE_SURPLUS, has_extras: true, .. } => noisy::<L, NOISE_READOUT, STORE_SURPLUS, true, true>;
    /// Ideal pixels under held 8-bit frames.
    NOISELESS_FREE_WHOLE:
        CaseKey { has_shot_noise: false, noise: Some(NOISE_NONE), store: STORE_FREE, is_whole: true, changes_light: false, has_extras: false, .. } => noiseless::<L, STORE_FREE, true>;
    /// Fixed pattern only. The charge is always below two thresholds.
    NOISELESS_FREE:
        CaseKey { has_shot_noise: false, noise: Some(NOISE_NONE), store: STORE_FREE, changes_light: false, has_extras: false, .. } => noiseless::<L, STORE_FREE, false>;
    /// Fixed pattern and clamped charge.
    NOISELESS_CLAMPED:
        CaseKey { has_shot_noise: false, noise: Some(NOISE_NONE), store: STORE_CLAMPED, changes_light: false, has_extras: false, .. } => noiseless::<L, STORE_CLAMPED, false>;
    /// Quanta without threshold noise, and clamped charge.
    SHOT_CLAMPED:
        CaseKey { has_shot_noise: true, noise: Some(NOISE_NONE), store: STORE_CLAMPED, has_extras: false, .. } => noisy::<L, NOISE_NONE, STORE_CLAMPED, false, false>;
    /// Quanta, noise drawn at readouts, and clamped charge.
    READOUT_CLAMPED:
        CaseKey { has_shot_noise: true, noise: Some(NOISE_READOUT), store: STORE_CLAMPED, has_extras: false, .. } => noisy::<L, NOISE_READOUT, STORE_CLAMPED, false, false>;
    /// Quanta, noise drawn at readouts, and counted surplus.
    READOUT_SURPLUS:
        CaseKey { has_shot_noise: true, noise: Some(NOISE_READOUT), store: STORE_SURPLUS, has_extras: false, .. } => noisy::<L, NOISE_READOUT, STORE_SURPLUS, false, false>;
    /// Quanta, noise frozen between resets, and clamped charge.
    RESET_CLAMPED:
        CaseKey { has_shot_noise: true, noise: Some(NOISE_RESET), store: STORE_CLAMPED, has_extras: false, .. } => noisy::<L, NOISE_RESET, STORE_CLAMPED, false, false>;
    /// Pending noise of quanta or jitter, noise drawn at readouts, and clamped charge.
    CORRELATED_READOUT_CLAMPED:
        CaseKey { has_shot_noise: true, noise: Some(CORRELATED_READOUT), store: STORE_CLAMPED, has_extras: false, .. } => noisy::<L, CORRELATED_READOUT, STORE_CLAMPED, false, false>;
    /// Pending noise of quanta or jitter, noise frozen between resets, and clamped charge.
    CORRELATED_RESET_CLAMPED:
        CaseKey { has_shot_noise: true, noise: Some(CORRELATED_RESET), store: STORE_CLAMPED, has_extras: false, .. } => noisy::<L, CORRELATED_RESET, STORE_CLAMPED, false, false>;
    /// All other plans. The kernel reads the rules at run time.
    GENERAL: _ => noisy::<L, NOISE_NONE, STORE_SURPLUS, true, false>;
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
        let segments = [Segment { readouts: 1, light: SegmentLight::Hold(light) }];
        let batch = Batch::from_state(&plan, &plan.initial_state(), &segments);
        Case::from_key(CaseKey::from_job(&Job::new(&plan, &batch, 0, plan.padded_pixels())))
    }

    #[test]
    fn every_preset_has_the_case_that_is_meant_for_it() {
        // Each row contains the name, the case under held 8-bit light, and the case under other light.
        let expected = [
            ("ideal", Case::NOISELESS_FREE_WHOLE, Case::NOISELESS_FREE),
            ("scsim-paper", Case::READOUT_SURPLUS, Case::READOUT_SURPLUS),
            ("scsim-code", Case::READOUT_SURPLUS_EXTRA, Case::READOUT_SURPLUS_EXTRA),
            ("physical", Case::RESET_CLAMPED, Case::RESET_CLAMPED),
            ("vidar-measured", Case::CORRELATED_RESET_CLAMPED, Case::CORRELATED_RESET_CLAMPED),
            ("vidar-lowlight", Case::RESET_CLAMPED, Case::RESET_CLAMPED),
            ("spcs", Case::NOISELESS_FREE, Case::NOISELESS_FREE),
            ("neuspike", Case::GENERAL, Case::GENERAL),
            ("spikingsim", Case::GENERAL, Case::GENERAL),
            ("spikecv", Case::NOISELESS_FREE, Case::NOISELESS_FREE),
            ("spikecv-image", Case::GENERAL, Case::GENERAL),
            ("spike-zoo", Case::NOISELESS_FREE_WHOLE, Case::NOISELESS_FREE),
        ];
        let (gray, linear) = (vec![51; 64 * 2], vec![0.2; 64 * 2]);
        let mut cases = Vec::new();
        for preset in presets::ALL {
            let mut camera = presets::builtin(preset.name).unwrap();
            camera.sensor.geometry = Geometry::new(64, 2).unwrap();
            let key_for = |light| case_of(&camera, light);
            cases.push((preset.name, key_for(Samples::U8(&gray)), key_for(Samples::F32(&linear))));
        }
        assert_eq!(cases, expected);
    }
}
