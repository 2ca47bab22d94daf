//! Conversions from and to types of other crates. Each conversion requires the Cargo feature that is named like the
//! other crate.

#[cfg(feature = "image")]
mod image;
#[cfg(feature = "ndarray")]
mod ndarray;
#[cfg(feature = "serde")]
mod serde;

#[cfg(feature = "image")]
pub use image::gray_image;
