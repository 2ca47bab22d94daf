//! Seconds of every phase of a diagnosis.

use std::time::Instant;

/// Prints how long each phase took, if asked to.
pub(crate) struct Phases {
    on: bool,
    now: Option<(String, Instant)>,
}

impl Phases {
    pub(crate) fn new(on: bool) -> Self {
        Self { on, now: None }
    }

    pub(crate) fn enter(&mut self, what: &str) {
        if self.now.as_ref().is_some_and(|n| n.0 == what) {
            return;
        }
        if let (true, Some((before, since))) = (self.on, &self.now) {
            println!("    {before:<24} {:.2} s", since.elapsed().as_secs_f64());
        }
        self.now = (!what.is_empty()).then(|| (what.to_owned(), Instant::now()));
    }
}
