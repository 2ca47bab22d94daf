//! The light that single readouts saw.

use crate::light::{Frame, Source, Timeline};
use crate::simulate::feed::{Feeder, Piece, next_frame};
use spikelane::error::{Error, Kind, Result};

/// The light of one readout near the middle of a run, to show beside what was made of it.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Glance {
    /// The readout: half of all, rounded down, counted from 0, where their number was known at the start;
    /// otherwise one within a third of it.
    pub readout: u64,
    /// The light that it saw.
    pub frame: Frame,
}

/// Hears the light of every `every`-th readout of a run, from readout 0 on.
pub struct Looks<'a> {
    /// Readouts from one to the next; at least 1.
    pub every: u64,
    /// What is done with readout and light; its error stops the run.
    pub keep: &'a mut dyn FnMut(u64, &Frame) -> Result<()>,
}

impl Looks<'_> {
    /// Passes on the readouts wanted of a batch that began with readout `first`.
    pub(in crate::simulate) fn batch(&mut self, first: u64, pieces: &[Piece]) -> Result<()> {
        let mut start = first;
        for piece in pieces {
            let end = start + piece.readouts as u64;
            let mut readout = start.next_multiple_of(self.every.max(1));
            while readout < end {
                (self.keep)(readout, &piece.light((readout - start) as usize)?)?;
                readout += self.every.max(1);
            }
            start = end;
        }
        Ok(())
    }
}

/// The light that readout `readout` sees when `source`, which has given no frame yet, is shown by `timeline`.
///
/// # Errors
/// [`Kind::Input`] when the source ends before it; those of the source.
pub fn light_at(source: &mut dyn Source, timeline: Timeline, readout: u64) -> Result<Frame> {
    let about = source.describe();
    let ended = || {
        Error::new(Kind::Input, &about)
            .found("an end")
            .expected(format_args!("light for readout {readout}, counted from 0"))
    };
    let first = next_frame(source)?.ok_or_else(ended)?;
    let mut feeder = Feeder::new(source, first, timeline, readout.saturating_add(1), 1.0);
    feeder.skip_to(readout);
    let pieces = feeder.fill(1, 1)?;
    pieces.first().ok_or_else(ended)?.light(0)
}

/// Keeps the light in the middle of a run. Where the end is not known, of the readouts at powers of two
/// the last two are enough, since one lies within a third of the middle.
pub(in crate::simulate) struct Glances {
    wanted: u64,
    known: bool,
    kept: [Glance; 2],
}

impl Glances {
    pub(crate) fn new(total: Option<u64>, first: &Frame) -> Self {
        let start = Glance { readout: 0, frame: first.clone() };
        Self { wanted: total.map_or(1, |n| n / 2), known: total.is_some(), kept: [start.clone(), start] }
    }

    /// Looks at a batch that began with readout `first`.
    pub(crate) fn look(&mut self, first: u64, pieces: &[Piece]) -> Result<()> {
        let mut start = first;
        for piece in pieces {
            let end = start + piece.readouts as u64;
            while (start..end).contains(&self.wanted) {
                let frame = piece.light((self.wanted - start) as usize)?;
                self.kept.swap(0, 1);
                self.kept[1] = Glance { readout: self.wanted, frame };
                self.wanted = if self.known { u64::MAX } else { self.wanted.saturating_mul(2) };
            }
            start = end;
        }
        Ok(())
    }

    pub(crate) fn middle(self, readouts: u64) -> Glance {
        let [a, b] = self.kept;
        let distance = |g: &Glance| g.readout.abs_diff(readouts / 2);
        if distance(&a) < distance(&b) { a } else { b }
    }
}
