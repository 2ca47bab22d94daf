//! Data sets.

mod asked;
mod hostile;
mod make;
mod strangers;
mod truth;
mod views;
