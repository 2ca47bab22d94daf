//! The charge of the pixels when the recording starts.

use super::prelude::*;

/// The effect `start_phase`.
#[rustfmt::skip]
pub static EFFECT: Definition = Definition::new(
    "start_phase",
    "Every pixel has a random charge before the first readout. Without this effect, all pixels of a uniform scene fire at the same readouts.",
    "uniform in real recordings; U[0,1) fC in the published code of SCSim",
    &[
        Param::number("share", Unit::Dimensionless, (0.0, 1.0), 0.0, 1.0, "the start charge is drawn uniformly from 0 to this share of the threshold of the pixel"),
        Param::number("charge", Unit::Femtocoulomb, (0.0, 1e3), 0.0, 0.0, "a second start charge is drawn uniformly from 0 to this value. The pixel starts with the sum of both start charges"),
    ],
)
.with_ops(|v, _| vec![Op::Phase { share: v[0], charge_fc: v[1] }])
.with_moments(|_, _| Some(Moments::default()));
