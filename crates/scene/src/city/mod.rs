//! Generates all static objects of a city from a road and a seed.
//!
//! The road is built first, with its curbs and sidewalks. Then the blocks between junctions are divided into lots, and
//! each lot contains a building, a garden or a gap. Trees, lamps, signs and traffic lights are placed on the sidewalk.
//! The foot of every object is at the height of the ground below the object.

mod build;
mod buildings;
pub(super) mod district;
pub(super) mod facade;
mod furniture;
mod ground;
pub(super) mod static_city;
mod trees;

pub(super) use static_city::{City, Lamp};
