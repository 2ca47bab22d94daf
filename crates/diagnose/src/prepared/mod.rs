//! What is given to a diagnosis, before anything is judged: recordings without what is no part of the camera, and the model.

pub(super) mod base_model;
pub(super) mod found_light;
pub(super) mod negative;
pub(super) mod phases;
pub(super) mod prepared_set;
pub(super) mod provenance;
mod reduced;
