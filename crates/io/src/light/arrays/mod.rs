//! Arrays of NumPy as light.

pub mod npy;
pub(super) mod npy_reader;
pub mod npz;
