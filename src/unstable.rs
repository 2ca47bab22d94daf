//! Internal modules that the sibling packages and the tests of this package use.
//!
//! Any release may change or remove the items of this module. If your program needs an item, ask for a public
//! replacement.

pub use crate::count::Count;
pub use crate::setters::with_methods;
pub use crate::variants::{named_variants, variant_names};

/// Random draws that depend only on seed, stream, pixel and readout.
pub mod draws {
    pub use crate::draws::*;
}
/// Suggestions for misspelled names.
pub mod error {
    pub use crate::error::nearest::nearest;
    #[cfg(feature = "presets")]
    pub use crate::error::quoting::toml_fault;
}
/// Input files, file names from inputs, and allocations whose size depends on an input.
pub mod inputs {
    pub use crate::inputs::*;
}
/// Loops that write and read spike bits.
pub mod kernels {
    pub use crate::kernels::*;
}
/// NumPy arrays.
pub mod npy {
    pub use crate::npy::*;
}
/// Cameras compiled to integer tables.
pub mod plan {
    pub use crate::plan::*;
}
/// Parallel loops, and requests to stop these loops.
pub mod threads {
    pub use crate::threads::*;
}
/// Light of stored images, and interpolation between samples.
pub mod light {
    pub use crate::light::catmull_rom::catmull_rom;
    pub use crate::light::frame::declared_geometry;
    pub use crate::light::transfer::srgb_byte;
}
/// Conversions of single frames, bytes and words of spike bits. These functions do not check lengths.
pub mod spikes {
    pub use crate::spikes::bytes::{pack_frame, set_bits, unpack_byte, unpack_frame};
}
/// The division of a run into segments.
pub mod simulate {
    pub use crate::simulate::segments::ends_batch_before;
}
/// Parts of the built-in test chart.
pub mod chart {
    pub use crate::light::builtin::chart::*;
}
