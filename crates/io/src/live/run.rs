//! Runs a live camera. One thread simulates readouts before they are due, and a second thread delivers the readouts.

use crate::formats::Codec;
use crate::live::clock::Clock;
use crate::live::deliver::{BurstChannel, Deliverer};
use crate::live::delivery_rate::{DeliveryRate, LiveSummary};
use crate::live::lookahead::Lookahead;
use crate::live::sink::{Sink, StopFlag};
use crate::simulate::ReadoutStream;
use spikelane::error::{Result, bail};
use spikelane::unstable::threads;

/// Encodes the readouts of `source` with `codec` and passes them to `sink` at the rate of a camera.
///
/// The run ends when the source ends, the consumer disconnects or `stop` is raised. A separate thread delivers the
/// readouts. If a core is free, deliveries therefore do not wait for the simulation.
///
/// `clock` is called when the first readouts have been simulated, and returns a clock that starts at 0. The first
/// readout begins at time 0 of this clock. The calling thread calls `progress` with the number of elapsed readouts.
///
/// # Errors
/// * [`ErrorKind::Usage`](spikelane::ErrorKind::Usage) if the rate is invalid.
/// * Errors of the source, the sink and `progress`.
/// * An error if the system cannot start a thread.
pub fn run<C: Clock + Clone + Send>(
    source: &mut ReadoutStream<'_>,
    codec: &Codec,
    rate: DeliveryRate,
    sink: &mut dyn Sink,
    clock: impl FnOnce() -> C,
    stop: &StopFlag,
    progress: &mut dyn FnMut(u64) -> Result<()>,
) -> Result<LiveSummary> {
    if !(rate.readout_hz.is_finite() && rate.readout_hz > 0.0) || rate.burst_readouts == 0 {
        bail!(Usage, "delivery_rate";
            found "{} readouts per second, {} at a time", rate.readout_hz, rate.burst_readouts;
            expected "positive numbers");
    }
    let (there, back) = BurstChannel::new();
    let mut ahead = Lookahead::new(source, codec, rate, there);
    ahead.fill(stop)?;
    let clock = clock();
    std::thread::scope(|scope| {
        let deliverer = Deliverer::new(rate, sink, clock.clone(), stop, back);
        let thread = threads::spawn_scoped(scope, "deliver", deliverer, Deliverer::run);
        let thread = thread.map_err(|_| threads::no_thread_error("deliver readouts"))?;
        let result = ahead.run(&clock, stop, progress);
        let delivered = thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        result.and(delivered)
    })
}
