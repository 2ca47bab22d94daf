//! Statistics of bands of rows, put together.

use super::Statistics;
use spikelane::error::{Error, Kind, Result};

impl Statistics {
    /// Joins the statistics of bands of rows of one stream: they must cover
    /// neighbouring rows, and have measured the same things over the same
    /// readouts. Statistics of whole readouts come from at most one of the
    /// parts, which may have nothing else.
    ///
    /// The result equals that of one accumulator for all the rows.
    ///
    /// # Errors
    /// When the parts do not fit together.
    pub fn join(parts: Vec<Self>) -> Result<Self> {
        let (mut bands, frames): (Vec<Self>, Vec<Self>) =
            parts.into_iter().partition(|p| p.counts.is_some() || p.intervals.is_some());
        bands.sort_by_key(|band| band.rows.start);
        let mut all = bands.into_iter().chain(frames);
        let Some(mut joined) = all.next() else {
            return Err(Error::new(Kind::Usage, "statistics to join").found("none"));
        };
        for part in all {
            joined.add(part)?;
        }
        Ok(joined)
    }

    fn add(&mut self, part: Self) -> Result<()> {
        if part.geometry != self.geometry || part.readouts != self.readouts {
            return Err(Error::new(Kind::Usage, "statistics to join")
                .found(format_args!("{} over {} readouts", part.geometry, part.readouts))
                .expected(format_args!("{} over {} readouts", self.geometry, self.readouts)));
        }
        if part.frames.is_some() && self.frames.is_some() {
            return Err(Error::new(Kind::Usage, "statistics to join")
                .found("two parts with statistics of whole readouts")
                .expected("one"));
        }
        self.frames = self.frames.take().or(part.frames);
        if part.counts.is_none() && part.intervals.is_none() {
            return Ok(());
        }
        if part.rows.start != self.rows.end {
            return Err(Error::new(Kind::Usage, "rows of statistics to join")
                .found(format_args!("rows from {}", part.rows.start))
                .expected(format_args!("rows from {}", self.rows.end)));
        }
        let fits = self.early_count.is_some() == part.early_count.is_some()
            && self.counts.is_some() == part.counts.is_some()
            && match (&self.intervals, &part.intervals) {
                (Some(a), Some(b)) => a.fits(b),
                (None, None) => true,
                _ => false,
            };
        if !fits {
            return Err(Error::new(Kind::Usage, "statistics to join")
                .found("bands measured with different options")
                .expected("the same options for all bands"));
        }
        self.rows.end = part.rows.end;
        if let (Some(all), Some(more)) = (&mut self.counts, part.counts) {
            all.append(more);
        }
        if let (Some(all), Some(more)) = (&mut self.intervals, part.intervals) {
            all.append(more);
        }
        if let (Some(all), Some(more)) = (&mut self.early_count, part.early_count) {
            all.extend(more);
        }
        Ok(())
    }
}
