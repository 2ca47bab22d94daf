//! Data sets.

mod asked;
mod make;
mod truth;
mod views;
