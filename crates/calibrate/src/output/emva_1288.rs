//! The summary sheet of EMVA 1288 Release 4.0 for a spike camera.

use serde_json::{Value, json};

use crate::result::Calibration;
use spikelane_measure::Estimate;
use spikelane_measure::report::{Cell, Table, insert_present, row};

/// The release of the standard whose items the sheet lists.
pub(super) const RELEASE: &str = "EMVA 1288 Release 4.0";

/// An item of the summary sheet.
pub(super) struct SheetItem {
    /// Name of the item in the standard.
    item: &'static str,
    /// Value with its standard error; `None` if the item does not apply or was not determined.
    value: Option<Estimate>,
    unit: &'static str,
    /// The quantity of a spike camera that corresponds to the item, or the reason why none does.
    note: &'static str,
}

/// Returns the product of independent estimates.
fn product(factors: &[Estimate]) -> Estimate {
    let value: f64 = factors.iter().map(|f| f.value).product();
    let relative = factors.iter().map(|f| (f.error / f.value).powi(2)).sum::<f64>().sqrt();
    Estimate {
        value,
        error: value.abs() * relative,
        samples: factors.iter().map(|f| f.samples).min().unwrap_or(0),
    }
}

fn scaled(e: Estimate, factor: f64) -> Estimate {
    Estimate { value: factor * e.value, error: factor * e.error, ..e }
}

/// Returns the items in the order of the summary sheet.
pub(super) fn summary_sheet(c: &Calibration) -> Vec<SheetItem> {
    let p = &c.population;
    // An assumed number of electrons has no error and gives no measured quantity.
    let electrons = Some(c.electrons_per_threshold).filter(|e| e.value > 0.0 && e.error.is_finite());
    let in_electrons = |e: Estimate| electrons.map(|n| product(&[e, n]));
    let noise = Some(c.sigma_t).filter(|e| e.value > 0.0 && e.error.is_finite());
    let inverse = |e: Estimate| Estimate { value: 1.0 / e.value, error: e.error / e.value.powi(2), ..e };
    let known = |e: Estimate| Some(e).filter(|e| e.value.is_finite() && e.error.is_finite());
    let item = |item, value: Option<Estimate>, unit, note| SheetItem {
        item,
        value: value.and_then(known),
        unit,
        note,
    };
    vec![
        item(
            "quantum efficiency",
            None,
            "",
            "Not determined: the light is relative to saturation, so the number of photons is unknown.",
        ),
        item(
            "overall system gain K",
            electrons.map(inverse),
            "spikes per electron",
            "A spike is the digital unit. K is one divided by the number of electrons per threshold.",
        ),
        item(
            "temporal dark noise",
            noise.and_then(in_electrons),
            "electrons per spike",
            "A spike camera reads no dark signal. The threshold noise, in electrons, is the noise of one reset.",
        ),
        item(
            "saturation capacity",
            electrons,
            "electrons per readout",
            "A pixel saturates at one spike per readout, so the capacity is the number of electrons per threshold.",
        ),
        item(
            "maximum signal-to-noise ratio",
            None,
            "",
            "Does not apply: a readout has one bit. The ratio of a reconstructed image depends on its window.",
        ),
        item(
            "absolute sensitivity threshold",
            None,
            "",
            "Does not apply: the smallest visible light falls with the length of the window.",
        ),
        item(
            "dynamic range",
            None,
            "",
            "Does not apply: the range is one spike per window to one spike per readout, so it grows with the window.",
        ),
        item(
            "DSNU",
            in_electrons(p.sd_d).map(|e| scaled(e, c.sensor.readout_hz)),
            "electrons per second",
            "Standard deviation of the dark rates over the pixels without defects. The standard states it in electrons of one exposure.",
        ),
        item(
            "PRNU",
            (p.mean_a.value > 0.0).then(|| scaled(p.sd_a, 100.0 / p.mean_a.value)),
            "%",
            "Standard deviation of the gains over the pixels without defects, relative to the mean gain.",
        ),
        item(
            "linearity error",
            linearity_error(c),
            "%",
            "Mean absolute deviation of the lit levels below saturation from the line. It includes the errors of the stated light.",
        ),
        item(
            "dark current",
            in_electrons(p.mean_d).map(|e| scaled(e, c.sensor.readout_hz)),
            "electrons per second",
            "Mean dark rate, multiplied by the number of electrons per threshold and by the readouts per second.",
        ),
        item(
            "dark current doubling temperature",
            None,
            "",
            "Not determined: the recordings have one temperature.",
        ),
    ]
}

/// Returns the mean absolute relative deviation of the lit levels in percent.
fn linearity_error(c: &Calibration) -> Option<Estimate> {
    let all: Vec<[f64; 2]> = c
        .lamps
        .iter()
        .filter(|l| !l.is_outlier)
        .filter_map(crate::result::Lamp::relative_deviation)
        .collect();
    let n = all.len() as f64;
    let error = all.iter().map(|d| d[1].powi(2)).sum::<f64>().sqrt() / n;
    let value = all.iter().map(|d| d[0].abs()).sum::<f64>() / n;
    (all.len() > 2).then_some(Estimate { value: 100.0 * value, error: 100.0 * error, samples: all.len() })
}

/// Returns the sheet as a table.
pub(super) fn sheet_table(c: &Calibration) -> Table {
    let row = |item: SheetItem| {
        row![item.item, item.value.map_or(Cell::from("\u{2013}"), Cell::from), item.unit, item.note]
    };
    Table::new(format!("Summary sheet of {RELEASE}"), &["item", "value", "unit", "quantity of this camera"])
        .with_note(
            "A spike camera emits one bit per pixel and readout, so some items of the standard do not apply.",
        )
        .with_rows(summary_sheet(c).into_iter().map(row))
}

/// Returns the sheet as JSON. An item without a value has no keys `value`, `error` and `unit`.
pub(super) fn sheet_json(c: &Calibration) -> Value {
    let item = |i: SheetItem| {
        let keys = [
            ("value", i.value.map(|e| json!(e.value))),
            ("error", i.value.map(|e| json!(e.error))),
            ("unit", i.value.map(|_| json!(i.unit))),
        ];
        insert_present(json!({ "item": i.item, "note": i.note }), keys)
    };
    json!({ "release": RELEASE, "items": summary_sheet(c).into_iter().map(item).collect::<Vec<_>>() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn relative_errors_of_a_product_add_in_squares() {
        let estimate = |value, error| Estimate { value, error, samples: 9 };
        let all = product(&[estimate(10.0, 0.3), estimate(5.0, 0.2)]);
        // Relative errors of 3 % and 4 % give 5 %.
        assert!((all.value - 50.0).abs() < 1e-12 && (all.error - 2.5).abs() < 1e-12);
    }
}
