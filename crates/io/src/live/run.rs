//! A camera that runs: one thread simulates ahead, another delivers.

use crate::formats::Codec;
use crate::live::ahead::Ahead;
use crate::live::clock::Clock;
use crate::live::deliver::{Bursts, Deliverer};
use crate::live::pace::{Pace, Report};
use crate::live::sink::{Sink, Stop};
use crate::simulate::Readouts;
use spikelane::error::{Error, Kind, Result};
use spikelane::unstable::threads;

/// Hands the readouts of `source`, encoded by `codec`, to `sink` at the pace of a camera whose first readout starts
/// when the first are ready, until the source ends, the consumer leaves, or `stop` is raised.
///
/// A thread of its own delivers, so that no delivery waits for what is being simulated while a core is free. `clock` starts when the first
/// readouts are ready; `watch` hears, on the calling thread, how many readouts have passed.
///
/// # Errors
/// [`Kind::Usage`] for a pace that is none; otherwise those of the source, the sink and `watch`, and of a system that
/// gives no thread.
pub fn run<C: Clock + Clone + Send>(
    source: &mut Readouts<'_>,
    codec: &Codec,
    pace: Pace,
    sink: &mut dyn Sink,
    clock: impl FnOnce() -> C,
    stop: &Stop,
    watch: &mut dyn FnMut(u64) -> Result<()>,
) -> Result<Report> {
    if !(pace.readout_hz.is_finite() && pace.readout_hz > 0.0) || pace.burst == 0 {
        return Err(Error::new(Kind::Usage, "pace")
            .found(format_args!("{} readouts a second, {} at a time", pace.readout_hz, pace.burst))
            .expected("positive numbers"));
    }
    let (there, back) = Bursts::new();
    let mut ahead = Ahead::new(source, codec, pace, there);
    ahead.fill(stop)?;
    let clock = clock();
    std::thread::scope(|scope| {
        let deliverer = Deliverer::new(pace, sink, clock.clone(), stop, back);
        let thread = threads::spawn_scoped(scope, "deliver", deliverer, Deliverer::run);
        let thread = thread.map_err(|_| threads::no_thread("deliver readouts"))?;
        let made = ahead.run(&clock, stop, watch);
        let delivered = thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        made.and(delivered)
    })
}
