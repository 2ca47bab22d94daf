//! Durations of the phases of a diagnosis.

use std::time::Instant;

/// Prints the duration of each phase, if enabled.
pub(crate) struct PhaseTimer {
    is_enabled: bool,
    current_phase: Option<(String, Instant)>,
}

impl PhaseTimer {
    pub(crate) fn new(on: bool) -> Self {
        Self { is_enabled: on, current_phase: None }
    }

    pub(crate) fn enter(&mut self, what: &str) {
        if self.current_phase.as_ref().is_some_and(|n| n.0 == what) {
            return;
        }
        if let (true, Some((before, since))) = (self.is_enabled, &self.current_phase) {
            println!("    {before:<24} {:.2} s", since.elapsed().as_secs_f64());
        }
        self.current_phase = (!what.is_empty()).then(|| (what.to_owned(), Instant::now()));
    }
}
