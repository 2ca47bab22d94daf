//! The page of a comparison by windows.

use super::numbers::{LAGS, SHARES, variance};
use super::{Auc, Realism, RealismRow};
use spikelane::error::Result;
use spikelane_measure::report::{Part, Row, Table, heat_map, page, ranked};

/// Values listed of each camera.
const LISTED: usize = 6;

impl Auc {
    fn text(self) -> String {
        format!("{:.3} ({:.2} to {:.2})", self.value, self.low, self.high)
    }
}

impl Realism {
    /// A sentence on the camera that is told least easily.
    #[must_use]
    pub fn verdict(&self) -> String {
        let Some(best) = self.rows.first() else { return String::new() };
        let over = best.auc.value - best.floor.value;
        let decided = if best.is_decided() {
            String::new()
        } else {
            " Not decided with this much data: the interval is wider than 0.07 either way.".to_owned()
        };
        let tell = best.tells.first().map_or(String::new(), |t| {
            format!(
                " What gives it away most is {}: {:.3e} real, {:.3e} simulated.",
                t.name, t.real, t.simulated
            )
        });
        format!(
            "{} passes best: {} where two recordings of its own give {}, {over:+.2}.{tell}{decided}",
            best.name,
            best.auc.text(),
            best.floor.text()
        )
    }

    /// The page of this comparison.
    ///
    /// # Errors
    /// When a plot cannot be made.
    pub fn page(&self) -> Result<String> {
        let mut parts = vec![
            Part::text(self.verdict()),
            Part::text(format!(
                "{} windows of {side}x{side} pixels and {} readouts at {} places of the recording, mean rate {:.4} spikes per readout; {:.1} % of the pixels are left out, since something moved around them or they hardly fire. Every camera got the light that gives each pixel its measured rate{drifting}, and none of its own fixed pattern.",
                self.windows,
                self.window.readouts,
                self.places,
                self.rate,
                100.0 * self.left_out,
                side = self.window.side,
                drifting = if self.drifting { ", drifting as that around it does" } else { "" },
            )),
            Part::Table(self.cameras()),
            Part::text(
                "Told: chance that a real window scores above a simulated one, by a logistic regression that has not seen their place, with the interval of 95 % over places; 0.5 would be a camera that nobody tells from the real one. Floor: the same between recordings of one simulated camera.",
            ),
        ];
        let still = heat_map(&self.rates, self.width, "spikes per readout")?;
        parts.push(Part::figure(still, "Rates of the pixels that count; those that are left out are red."));
        parts.push(Part::heading("Whole recordings"));
        parts.push(Part::Table(self.whole()));
        for row in &self.rows {
            parts.push(Part::heading(&row.name));
            parts.push(Part::Table(tells(row)));
            parts.push(Part::figure(picture(row)?, "Value of simulated windows over that of real ones."));
            parts.push(Part::Table(by_part(row)));
        }
        Ok(page("Comparison with a real recording, window by window", &parts))
    }

    /// Numbers of whole recordings.
    fn whole(&self) -> Table {
        let mut head = vec!["".to_owned()];
        head.extend(LAGS.iter().map(|n| format!("D({n}), readouts squared")));
        head.extend(["early intervals, ppm", "late intervals, ppm"].map(str::to_owned));
        if self.numbers.iter().any(|n| n.dark.is_some()) {
            head.extend(SHARES.iter().map(|s| format!("dark rate, {} %", 100.0 * s)));
        }
        let mut table = Table::new(&head.iter().map(String::as_str).collect::<Vec<_>>());
        for n in &self.numbers {
            let mut cells = vec![n.name.clone()];
            cells.extend(n.d.iter().map(|d| variance(*d)));
            cells.extend([n.early, n.late].map(|share| format!("{:.0}", 1e6 * share)));
            cells.extend(n.dark.iter().flatten().map(|rate| format!("{rate:.4}")));
            table.row(cells);
        }
        table
    }

    fn cameras(&self) -> Table {
        let mut table = Table::new(&["camera", "told", "floor", "decided", "what gives it away most"]);
        for row in &self.rows {
            let tell = row.tells.first().map_or(String::new(), |t| format!("{} ({:.2})", t.name, t.alone));
            let decided = if row.is_decided() { "yes" } else { "not with this much data" };
            table.row([row.name.clone(), row.auc.text(), row.floor.text(), decided.to_owned(), tell]);
        }
        table
    }
}

fn tells(row: &RealismRow) -> Table {
    let mut table = Table::new(&["value of a window", "real", "simulated", "alone tells"]);
    for t in row.tells.iter().take(LISTED) {
        table.row([
            t.name.clone(),
            format!("{:.3e}", t.real),
            format!("{:.3e}", t.simulated),
            format!("{:.2}", t.alone),
        ]);
    }
    table
}

fn by_part(row: &RealismRow) -> Table {
    let mut table = Table::new(&["part", "windows", "told", "what gives it away most there"]);
    for part in &row.parts {
        let told = part.auc.map_or("too few places".to_owned(), Auc::text);
        let tell = part.tell.as_ref().map_or(String::new(), |t| format!("{} ({:.2})", t.name, t.alone));
        table.row([part.name.clone(), part.windows.to_string(), told, tell]);
    }
    table
}

/// Ratios of values that are not negative.
fn picture(row: &RealismRow) -> Result<String> {
    let usable = row.tells.iter().filter(|t| t.real > 0.0 && t.simulated > 0.0).take(2 * LISTED);
    let rows: Vec<Row> =
        usable.map(|t| Row { name: t.name.clone(), values: vec![t.simulated / t.real] }).collect();
    ranked("simulated over real", &["simulated over real"], &rows, Some((1.0, "alike")))
}
