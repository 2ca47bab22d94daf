//! Arrays of NumPy as light.

pub mod npy;
pub mod npz;
