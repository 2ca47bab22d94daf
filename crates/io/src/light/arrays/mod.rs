//! NumPy arrays as light.

pub mod npy;
pub mod npz;
