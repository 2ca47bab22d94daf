//! Parts of this package that its sibling packages and its tests use.
//!
//! Nothing here is a promise: any release may change or remove it. If you need something from here in a program of your own,
//! ask for a public item.

pub use crate::setters::with_methods;

/// Draws of random numbers that have an address.
pub mod draws {
    pub use crate::draws::*;
}
/// Opening inputs, names from files, and memory whose size comes from an input.
pub mod inputs {
    pub use crate::inputs::*;
}
/// Values between samples.
pub mod interpolation {
    pub use crate::interpolation::*;
}
/// The loops that make bits, and those that read them.
pub mod kernels {
    pub use crate::kernels::*;
}
/// Arrays of NumPy.
pub mod npy {
    pub use crate::npy::*;
}
/// A camera as integer tables.
pub mod plan {
    pub use crate::plan::*;
}
/// Parallel work, and requests to stop it.
pub mod threads {
    pub use crate::threads::*;
}
/// Light of stored pictures.
pub mod light {
    pub use crate::light::frame::stored_size;
    pub use crate::light::transfer::srgb_byte;
}
/// Pieces of a run.
pub mod simulate {
    pub use crate::simulate::segments::stops_before;
}
/// The built-in chart in parts.
pub mod chart {
    pub use crate::light::moving::chart::*;
}
