//! Shot noise that becomes charge gradually during several readouts.

use super::prelude::*;

/// The effect `correlated_shot_noise`.
///
/// The correlation applies to the quanta of light and of the dark current, because one photodiode collects both. The
/// effect does not delay the mean of the light. The effect `image_lag` delays the mean.
#[rustfmt::skip]
pub static EFFECT: Definition = Definition::new(
    "correlated_shot_noise",
    "The photodiode has a limited bandwidth: the shot noise of light and dark current becomes charge with an exponential delay. The noise of neighboring readouts is correlated. The variance over many readouts does not change.",
    "shot noise through a first-order low-pass (Schottky noise of the photocurrent, filtered by the resistance and capacitance of the diode); 12 readouts in the static rows of a recording of a 400x250 camera",
    &[Param::number("time_constant", Unit::Readout, (0.0, 100.0), 0.0, 12.0, "time after which 1/e of the noise has not become charge yet; requires `shot_noise` or `dark_shot_noise`")
        .with_search(SearchSpec::amplitude((0.0, 100.0), &[2.0, 8.0, 30.0]))],
)
.with_ops(|v, _| vec![Op::CorrelatedQuanta { time_constant: v[0] }])
// The effect delays noise but loses no charge, so neither the mean rate nor the variance of the charge over many
// readouts changes.
.with_moments(|_, _| Some(Moments::default()));
