//! Light: pictures, video, arrays, and what is made of them.

mod files;
mod front_ends;
mod insertion;
mod pure;
mod streams;
