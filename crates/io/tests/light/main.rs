//! Tests of light sources. The sources are images, videos, arrays and interpolated frames.

mod cells;
mod containers;
mod damage;
mod files;
mod frames_and_timeline;
mod front_ends;
mod interpolation;
mod streams;
