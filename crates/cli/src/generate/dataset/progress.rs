//! Progress of a dataset or a shard, and requests to stop the command.

use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};
use serde_json::json;

use crate::common::{Console, StopSignal, remaining_text, stop_flag};
use spikelane::error::printable;
use spikelane::{Error, ErrorKind, Result};
use spikelane_dataset::SequenceProgress;
use spikelane_measure::report::insert_present;

/// Shortest time between two JSON events.
const EVENT_INTERVAL: Duration = Duration::from_millis(500);

/// A bar that counts sequences on a terminal, and JSON events with `--json`.
pub(super) struct DatasetProgress {
    out: Console,
    stop: StopSignal,
    pub bar: ProgressBar,
    start: Instant,
    last_event: Instant,
}

impl DatasetProgress {
    pub(crate) fn new(out: &Console) -> Result<Self> {
        let bar = ProgressBar::new(1000);
        if let Ok(style) = ProgressStyle::with_template("{wide_bar} {msg}") {
            bar.set_style(style);
        }
        let now = Instant::now();
        Ok(Self { out: *out, stop: stop_flag()?, bar, start: now, last_event: now })
    }

    /// Returns an error if the stop flag is set.
    pub(super) fn check_stop(&self) -> Result<()> {
        if self.stop.load(Ordering::Relaxed) {
            return Err(Error::new(ErrorKind::Interrupted, "stopped on request")
                .remedy("finished sequences are kept; continue with --resume"));
        }
        Ok(())
    }

    pub(super) fn update(&mut self, p: SequenceProgress<'_>) -> Result<()> {
        self.check_stop()?;
        let inside = p.total_readouts.map_or(0.0, |n| p.readouts as f64 / n.max(1) as f64);
        let share = (p.index as f64 + inside) / p.sequence_count as f64;
        let what = if p.is_verifying { "verify" } else { p.id };
        let (what, left) = (printable(what), remaining_text(share, self.start.elapsed()));
        self.bar.set_message(format!(
            "{what} {}/{}, {:.0} %{left}",
            p.index + 1,
            p.sequence_count,
            100.0 * share
        ));
        self.bar.set_position((share * 1000.0) as u64);
        if self.last_event.elapsed() < EVENT_INTERVAL {
            return Ok(());
        }
        self.last_event = Instant::now();
        let event = json!({
            "event": "progress", "sequence": p.id, "index": p.index, "sequence_count": p.sequence_count, "readouts": p.readouts,
            "is_verifying": p.is_verifying,
        });
        self.out.print_event(&insert_present(event, [("total", p.total_readouts.map(Into::into))]))
    }
}
