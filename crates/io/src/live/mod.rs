//! Readouts at the pace of a camera: a virtual one, for consumers that are developed without hardware.
//!
//! [`run`] simulates ahead, hands readouts to a [`Sink`] when a camera would have finished them, and says how late
//! they were. [`Pipe`] writes to a pipe or socket, [`Ring`] to shared memory.

mod ahead;
mod clock;
mod deliver;
mod lateness;
mod pace;
mod pipe;
mod ring;
mod run;
mod sink;
#[cfg(test)]
mod tests;

pub use clock::{Clock, SystemClock};
pub use lateness::Lateness;
pub use pace::{Pace, Report};
pub use pipe::Pipe;
pub use ring::{Ring, RingReader, Slot};
pub use run::run;
pub use sink::{Delivery, Policy, Sink, Stop};
