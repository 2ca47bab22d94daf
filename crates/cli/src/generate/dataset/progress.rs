//! The progress display of `dataset`.

use std::sync::atomic::Ordering;

use serde_json::json;
use spikelane::error::printable;
use spikelane::{Error, ErrorKind, Result};
use spikelane_dataset::SequenceProgress;
use spikelane_measure::report::insert_present;

use crate::common::{Console, FileProgress, StopSignal, stop_flag};

/// A bar that counts sequences on a terminal, and JSON events with `--json`.
pub(super) struct DatasetProgress {
    out: Console,
    stop: StopSignal,
    pub bar: FileProgress,
}

impl DatasetProgress {
    pub(crate) fn new(out: &Console) -> Result<Self> {
        Ok(Self { out: *out, stop: stop_flag()?, bar: FileProgress::new(out) })
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
        let what = printable(if p.is_verifying { "verify" } else { p.id });
        let count = format!("{}/{}", p.index + 1, p.sequence_count);
        if !self.bar.show(share, |left| format!("{what} {count}, {:.0} %{left}", 100.0 * share)) {
            return Ok(());
        }
        let event = json!({
            "event": "progress", "sequence": p.id, "index": p.index, "sequence_count": p.sequence_count, "readouts": p.readouts,
            "is_verifying": p.is_verifying,
        });
        self.out.print_event(&insert_present(event, [("total", p.total_readouts.map(Into::into))]))
    }
}
