//! Comparisons of simulated pixels with independent loops and closed forms.

#[path = "../common_oracle/mod.rs"]
mod common_oracle;

mod correlated_quanta;
mod fixed_point;
mod ideal;
mod intervals;
mod moments;
mod poisson;
mod scsim;
mod simulators;
mod ties;
