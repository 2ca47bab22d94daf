//! Light: pictures, video, arrays, and what is made of them.

mod files;
mod insertion;
mod pure;
mod streams;
mod front_ends;
