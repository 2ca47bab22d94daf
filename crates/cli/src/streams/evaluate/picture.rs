//! The pictures of a moment, and what is said of them.

use std::ops::Range;

use crate::shared::picture::around;
use clap::ValueEnum;
use serde_json::{Value, json};
use spikelane::reconstruct::{Tfi, blurred, span, tfi_at, tfp};
use spikelane::spikes::Packed;
use spikelane::{Geometry, Result};
use spikelane_io::formats::Reader;

use super::marks::{DETAIL, HEADER, Marks};
use super::still::Still;
use super::truth::Truth;

/// Readouts on either side that TFI searches.
const SEARCH: usize = 300;

/// Readouts on either side that are taken for those of a TFI picture: intervals are rarely longer.
pub(super) const INTERVAL: usize = 20;

/// Deviation of the Gaussian, in pixels, of the picture that only looks better.
const BLUR: f64 = 1.0;

/// The pictures that are asked for.
#[derive(clap::Args, Debug)]
pub(super) struct Wanted {
    /// Kinds of pictures; may be repeated [default: all]
    #[arg(long, value_enum, value_name = "METHOD", default_values_t = Method::ALL, hide_default_value = true)]
    pub method: Vec<Method>,
    /// Readouts in the window of TFP and span; may be repeated
    #[arg(long, value_name = "READOUTS", default_values_t = [33, 129],
          value_parser = clap::value_parser!(u32).range(1..))]
    pub window: Vec<u32>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Method {
    Tfp,
    Span,
    Tfi,
}

impl Method {
    const ALL: [Self; 3] = [Self::Tfp, Self::Span, Self::Tfi];
}

/// A picture of a stream, or why there is none.
pub(super) struct Picture {
    pub name: String,
    pub marks: Result<Marks, String>,
    /// What the reader should know of it.
    pub note: Option<String>,
}

impl Picture {
    pub(super) fn json(&self) -> Value {
        let mut all = json!({ "picture": self.name, "measurable": self.marks.is_ok() });
        match &self.marks {
            Ok(marks) => all["marks"] = marks.json(),
            Err(reason) => all["reason"] = json!(reason),
        }
        if let Some(note) = &self.note {
            all["note"] = json!(note);
        }
        all
    }

    pub(super) fn text(&self) -> String {
        match &self.marks {
            Ok(marks) => marks.row(&self.name),
            Err(reason) => format!("{:<14} not measurable here: {reason}\n", self.name),
        }
    }

    /// The row of the second table, where there is something to compare with.
    pub(super) fn detail(&self) -> Option<String> {
        self.marks.as_ref().ok()?.detail_row(&self.name)
    }
}

/// What pictures are compared with.
#[derive(Clone, Copy)]
pub(super) enum Beside<'a> {
    Nothing,
    Clear(&'a Truth),
    Others(&'a Still),
}

impl Beside<'_> {
    /// The truth of a picture made of the readouts `own`.
    fn marks(self, rates: &[f32], geometry: Geometry, own: Range<usize>) -> Result<Marks> {
        match self {
            Self::Nothing => Marks::of(rates, geometry, None, None),
            Self::Clear(truth) => Marks::of(rates, geometry, Some(truth), Some(&truth.reference())),
            // A window that leaves too few readouts has its first table alone.
            Self::Others(still) => Marks::of(rates, geometry, None, still.reference(own).ok().as_ref()),
        }
    }

    fn is_something(self) -> bool {
        !matches!(self, Self::Nothing)
    }
}

/// The pictures of `reader` around `at`.
pub(super) fn pictures(
    wanted: &Wanted,
    reader: &Reader,
    at: usize,
    beside: Beside<'_>,
) -> Result<Vec<Picture>> {
    type Make = fn(Packed, usize, usize) -> Result<Vec<f32>>;
    let asked = |method| wanted.method.contains(&method);
    let geometry = reader.geometry();
    let near = |half: usize| at.saturating_sub(half)..(at + half + 1).min(reader.readouts());
    let mut all = Vec::new();
    let windowed = [(Method::Tfp, "tfp", tfp as Make), (Method::Span, "span", span as Make)];
    for (_, kind, make) in windowed.into_iter().filter(|w| asked(w.0)) {
        for window in &wanted.window {
            let half = (*window / 2) as usize;
            let (bytes, centre) = around(reader, at, half)?;
            let packed = Packed::new(geometry, &bytes)?;
            let (wanted, there) = (2 * half + 1, packed.readouts());
            let rates = make(packed, centre, half)?;
            let note = (there < wanted).then(|| format!("the stream holds {there} of the {wanted} readouts"));
            let marks = Ok(beside.marks(&rates, geometry, near(half))?);
            all.push(Picture { name: format!("{kind} {wanted}"), marks, note });
            if kind == "tfp" && beside.is_something() {
                let rates = blurred(&rates, geometry, BLUR);
                let marks = Ok(beside.marks(&rates, geometry, near(half))?);
                all.push(Picture { name: format!("{kind} {wanted} blurred"), marks, note: None });
            }
        }
    }
    if asked(Method::Tfi) {
        let (bytes, centre) = around(reader, at, SEARCH)?;
        let tfi = tfi_at(Packed::new(geometry, &bytes)?, centre, SEARCH)?;
        let marks = match open(&tfi) {
            Some(reason) => Err(reason),
            None => Ok(beside.marks(&tfi.rates, geometry, near(INTERVAL))?),
        };
        all.push(Picture { name: "tfi".into(), marks, note: None });
    }
    if let Beside::Clear(truth) = beside {
        // What the estimates take for noise in a picture that has none.
        let marks = Marks::of(&truth.light, geometry, None, None)?;
        all.push(Picture { name: "clear image".into(), marks: Ok(marks), note: None });
    }
    Ok(all)
}

/// Why a TFI picture cannot be judged.
fn open(tfi: &Tfi) -> Option<String> {
    let (open, all) = (tfi.open_pixels, tfi.rates.len());
    (!tfi.is_measurable())
        .then(|| format!("the stream begins or ends within the interval of {open} of {all} pixels"))
}

/// The second table, if it has a row.
pub(super) fn details(rows: impl Iterator<Item = Option<String>>) -> String {
    let rows: String = rows.flatten().collect();
    if rows.is_empty() { rows } else { format!("{DETAIL}{rows}") }
}

/// The mean over several pictures of one kind.
pub(super) struct Mean {
    name: String,
    /// How many there are, and in how many there is something to judge.
    of: usize,
    measured: usize,
    average: Option<Marks>,
}

impl Mean {
    fn new(all: &[&Picture]) -> Self {
        let marks: Vec<Marks> = all.iter().filter_map(|p| p.marks.as_ref().ok().copied()).collect();
        let average = (!marks.is_empty()).then(|| Marks::average(&marks));
        Self { name: all[0].name.clone(), of: all.len(), measured: marks.len(), average }
    }

    fn label(&self) -> String {
        if self.measured == self.of {
            return self.name.clone();
        }
        format!("{} ({} of {})", self.name, self.measured, self.of)
    }

    fn text(&self) -> String {
        let reason = "not measurable in any of them: their streams end too near the readout";
        match &self.average {
            Some(average) => average.row(&self.label()),
            None => format!("{:<14} {reason}\n", self.name),
        }
    }

    /// Whether the second table has a row of it.
    pub(super) fn has_detail(&self) -> bool {
        self.average.is_some_and(|average| average.has_detail())
    }

    /// Noise is a share of each picture's mean.
    pub(super) fn json(&self) -> Value {
        let mut all = json!({ "picture": self.name, "pictures": self.of, "measurable": self.measured });
        if let Some(average) = &self.average {
            all["marks"] = average.json();
        }
        all
    }
}

/// The means over several moments or sequences, all with the same kinds of pictures.
pub(super) fn means(all: &[Vec<Picture>]) -> Vec<Mean> {
    let kinds = all.first().map_or(0, Vec::len);
    (0..kinds).map(|i| Mean::new(&all.iter().map(|pictures| &pictures[i]).collect::<Vec<_>>())).collect()
}

/// Both tables of means.
pub(super) fn tables(means: &[Mean]) -> String {
    let rows: String = means.iter().map(Mean::text).collect();
    let second = means.iter().map(|mean| mean.average.as_ref()?.detail_row(&mean.label()));
    format!("{HEADER}{rows}{}", details(second))
}
