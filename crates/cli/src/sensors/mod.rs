//! Commands that analyze the recordings of a sensor.

pub(super) mod calibrate;
pub(super) mod compare;
pub(super) mod diagnose;
pub(super) mod measure;
pub(super) mod record;
pub(super) mod template;
