//! Light: pictures, video, arrays, and what is made of them.

#[cfg(feature = "files")]
mod files;
mod insertion;
mod pure;
#[cfg(feature = "files")]
mod streams;
