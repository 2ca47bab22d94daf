//! What a record says of its gap and its interval.

use serde_json::Value;

/// The held-out gap before anything was added and at the end, the floor, and the floor's deviation.
pub(crate) fn gap(record: &Value) -> Option<[f64; 4]> {
    let gap = &record["said"]["gap"];
    let last = gap["heldout"].as_array()?.last()?.as_f64()?;
    Some([gap["heldout"][0].as_f64()?, last, gap["floor"].as_f64()?, gap["floor_sd"].as_f64()?])
}

/// Sets called explained, and those of them with a held-out excess within the limit.
#[derive(Clone, Copy)]
pub(crate) struct Gaps {
    pub explained: usize,
    pub shrunk: usize,
}

impl Gaps {
    pub(crate) fn of(records: &[&Value]) -> Self {
        let mut gaps = Self { explained: 0, shrunk: 0 };
        records.iter().for_each(|r| gaps.add(r));
        gaps
    }

    pub(crate) fn add(&mut self, record: &Value) {
        let ("explained", Some([first, last, floor, sd])) =
            (record["score"]["verdict"].as_str().unwrap_or(""), gap(record))
        else {
            return;
        };
        self.explained += 1;
        self.shrunk += usize::from(last - floor <= f64::max(0.01 * (first - floor), 2.0 * sd));
    }
}

/// Whether the interval of the amplitude holds the hidden strength.
pub(crate) fn covers(record: &Value, name: &str) -> Option<bool> {
    let strength = record["hidden"][0]["strength"].as_f64()?;
    let effects = record["said"]["effects"].as_array()?;
    let misfits = record["said"]["misfits"].as_array()?;
    let of_effect = effects.iter().find(|e| e["name"] == name).map(|e| &e["parameters"][0]);
    let of_misfit =
        misfits.iter().find(|m| m["parameter"].as_str().is_some_and(|p| p.split('.').next() == Some(name)));
    let interval = of_effect.or(of_misfit)?;
    let (low, high) = (interval["low"].as_f64()?, interval["high"].as_f64()?);
    let truth = match name {
        "dead_time" => 0.002 + strength,
        "saturation_clamp" => 2.0 - strength,
        "edge_columns" => 1.0 + strength,
        _ => strength,
    };
    let held = |x: f64| low <= x && x <= high;
    // Effects of either sign are hidden with either.
    let signed =
        ["response_nonlinearity", "gain_drift", "spike_coupling", "supply_droop", "gain_dark_correlation"];
    Some(held(truth) || signed.contains(&name) && held(-truth))
}
