//! Commands that analyze the recordings of a sensor.

pub(super) mod calibrate;
pub(super) mod compare;
pub(super) mod diagnose;
pub(super) mod measure;
pub(super) mod record;
mod static_recording;
pub(super) mod template;
