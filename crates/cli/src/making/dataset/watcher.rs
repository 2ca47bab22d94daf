//! How far a dataset or a shard is, and the request to stop it.

use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};
use serde_json::json;

use crate::shared::output::Out;
use crate::shared::progress::{Stop, left, stop_flag};
use spikelane::error::printable;
use spikelane::{Error, Kind, Result};
use spikelane_dataset::Progress;
use spikelane_measure::report::with_known;

/// Between two JSON events.
const PERIOD: Duration = Duration::from_millis(500);

/// A bar over all sequences on a terminal, events when asked for JSON.
pub(super) struct Watcher {
    out: Out,
    stop: Stop,
    pub bar: ProgressBar,
    start: Instant,
    said: Instant,
}

impl Watcher {
    pub(crate) fn new(out: &Out) -> Result<Self> {
        let bar = ProgressBar::new(1000);
        if let Ok(style) = ProgressStyle::with_template("{wide_bar} {msg}") {
            bar.set_style(style);
        }
        let now = Instant::now();
        Ok(Self { out: *out, stop: stop_flag()?, bar, start: now, said: now })
    }

    /// Refuses to go on when that was asked for.
    pub(super) fn go_on(&self) -> Result<()> {
        if self.stop.load(Ordering::Relaxed) {
            return Err(Error::new(Kind::Interrupted, "stopped on request")
                .remedy("finished sequences are kept; go on with --resume"));
        }
        Ok(())
    }

    pub(super) fn step(&mut self, p: Progress<'_>) -> Result<()> {
        self.go_on()?;
        let inside = p.total.map_or(0.0, |n| p.readouts as f64 / n.max(1) as f64);
        let share = (p.index as f64 + inside) / p.of as f64;
        let what = if p.verifying { "verify" } else { p.id };
        let (what, left) = (printable(what), left(share, self.start.elapsed()));
        self.bar.set_message(format!("{what} {}/{}, {:.0} %{left}", p.index + 1, p.of, 100.0 * share));
        self.bar.set_position((share * 1000.0) as u64);
        if self.said.elapsed() < PERIOD {
            return Ok(());
        }
        self.said = Instant::now();
        let about = json!({
            "event": "progress", "sequence": p.id, "index": p.index, "of": p.of, "readouts": p.readouts,
            "verifying": p.verifying,
        });
        self.out.event(&with_known(about, [("total", p.total.map(Into::into))]))
    }
}
