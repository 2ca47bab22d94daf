//! What is known of the base model's numbers before a set is seen.

/// Information that calibration is worth for a number of the base model: how strongly the number is drawn back to its calibrated
/// value, as by a measurement to a half of it. Without that, two that the set hardly tells apart, such as the spreads of gain and of
/// threshold, wander.
pub(crate) const CALIBRATED: f64 = 4.0;
