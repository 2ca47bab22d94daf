//! Joins the statistics of bands of rows.

use super::Statistics;
use spikelane::error::{Error, ErrorKind, Result};
use spikelane::unstable::Count;

impl Statistics {
    /// Joins the statistics of several bands of rows of one stream.
    ///
    /// The bands of `parts` must cover adjacent rows. The parts must be measured with the same options and over the
    /// same readouts. At most one part can contain statistics of whole readouts, and this part can omit all other
    /// statistics.
    ///
    /// The result equals the statistics of one accumulator for all rows.
    ///
    /// # Examples
    /// ```
    /// use spikelane::{Geometry, SpikeFramesRef};
    /// use spikelane_measure::{Accumulator, MeasureOptions, Statistics};
    /// let geometry = Geometry::new(8, 2)?;
    /// let frames = SpikeFramesRef::new(geometry, &[1, 3, 0, 2])?;
    /// let measure = |rows| {
    ///     let options = MeasureOptions::default().with_frames(false).with_rows(Some(rows));
    ///     let mut sums = Accumulator::new(geometry, &options)?;
    ///     sums.push(frames)?;
    ///     Ok::<_, spikelane::Error>(sums.finish())
    /// };
    /// assert_eq!(Statistics::join(vec![measure(0..1)?, measure(1..2)?])?, measure(0..2)?);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`ErrorKind::Usage`] if `parts` is empty, or if the bands or the options of the parts do not match.
    pub fn join(parts: Vec<Self>) -> Result<Self> {
        let (mut bands, frames): (Vec<Self>, Vec<Self>) =
            parts.into_iter().partition(|p| p.counts.is_some() || p.intervals.is_some());
        bands.sort_by_key(|band| band.rows.start);
        let mut all = bands.into_iter().chain(frames);
        let Some(mut joined) = all.next() else {
            return Err(Error::new(ErrorKind::Usage, "statistics to join").found("none"));
        };
        for part in all {
            joined.add(part)?;
        }
        Ok(joined)
    }

    fn add(&mut self, part: Self) -> Result<()> {
        if part.geometry != self.geometry || part.readouts != self.readouts {
            return Err(Error::new(ErrorKind::Usage, "statistics to join")
                .found(format_args!("{} over {}", part.geometry, Count(part.readouts, "readout")))
                .expected(format_args!("{} over {}", self.geometry, Count(self.readouts, "readout"))));
        }
        if part.frames.is_some() && self.frames.is_some() {
            return Err(Error::new(ErrorKind::Usage, "statistics to join")
                .found("two parts with statistics of whole readouts")
                .expected("one such part"));
        }
        self.frames = self.frames.take().or(part.frames);
        if part.counts.is_none() && part.intervals.is_none() {
            return Ok(());
        }
        if part.rows.start != self.rows.end {
            return Err(Error::new(ErrorKind::Usage, "rows of statistics to join")
                .found(format_args!("rows from {}", part.rows.start))
                .expected(format_args!("rows from {}", self.rows.end)));
        }
        let fits = self.counts_before_split.is_some() == part.counts_before_split.is_some()
            && self.counts.is_some() == part.counts.is_some()
            && match (&self.intervals, &part.intervals) {
                (Some(a), Some(b)) => a.has_same_options(b),
                (None, None) => true,
                _ => false,
            };
        if !fits {
            return Err(Error::new(ErrorKind::Usage, "statistics to join")
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
        if let (Some(all), Some(more)) = (&mut self.counts_before_split, part.counts_before_split) {
            all.extend(more);
        }
        Ok(())
    }
}
