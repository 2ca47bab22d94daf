//! Data sets.

mod make;
mod truth;
