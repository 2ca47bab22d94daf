//! Delivers readouts at the rate of a camera, so that consumers can be developed without hardware.
//!
//! [`run`] simulates readouts before they are due, and passes each readout to a [`Sink`] when a camera would have
//! finished the readout. [`run`] also reports how late the readouts are. [`PipeSink`] writes to a pipe or socket, and
//! [`RingWriter`] writes to shared memory.

mod clock;
mod deliver;
mod delivery_rate;
mod lateness;
mod lookahead;
mod pipe;
mod ring;
mod run;
mod sink;
#[cfg(test)]
mod tests;

pub use clock::{Clock, SystemClock};
pub use delivery_rate::{DeliveryRate, LiveSummary};
pub use lateness::Lateness;
pub use pipe::PipeSink;
pub use ring::{RingRead, RingReader, RingWriter};
pub use run::run;
pub use sink::{Delivery, OverflowPolicy, Sink, StopFlag};
