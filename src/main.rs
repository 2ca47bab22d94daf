//! The `spikelane` program.

fn main() {}
