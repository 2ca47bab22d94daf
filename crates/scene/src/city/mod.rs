//! The city: a grammar that turns a road and a seed into everything that stands still.
//!
//! Road, kerbs and pavements first; the blocks between junctions are cut into
//! lots, each lot gets a house, a garden or a gap; trees, lamps, signs and
//! traffic lights stand on the pavement. Every base is at the height of the
//! ground it stands on.

mod build;
mod buildings;
pub(super) mod district;
pub(super) mod facade;
mod furniture;
mod ground;
pub(super) mod standing;
mod trees;

pub(super) use standing::{City, Lamp};
