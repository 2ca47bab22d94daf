//! What pixels do, beside independent loops and closed forms.

#[path = "../common_oracle/mod.rs"]
mod common_oracle;

mod fixed_point;
mod ideal;
mod intervals;
mod late;
mod moments;
mod poisson;
mod scsim;
mod simulators;
mod ties;
