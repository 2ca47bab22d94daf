//! The discrepancy and the interval in a record.

use serde_json::Value;

/// Returns the held-out discrepancy at the start and at the end, the noise floor, and the floor's standard deviation.
pub(crate) fn discrepancy(record: &Value) -> Option<[f64; 4]> {
    let gap = &record["diagnosis"]["discrepancy"];
    let last = gap["held_out_set"].as_array()?.last()?.as_f64()?;
    Some([
        gap["held_out_set"][0].as_f64()?,
        last,
        gap["noise_floor"].as_f64()?,
        gap["noise_floor_sd"].as_f64()?,
    ])
}

/// Returns whether the interval of the amplitude contains the hidden strength.
pub(crate) fn interval_covers(record: &Value, name: &str) -> Option<bool> {
    let strength = record["hidden"][0]["strength"].as_f64()?;
    let effects = record["diagnosis"]["effects"].as_array()?;
    let misfits = record["diagnosis"]["parameter_mismatches"].as_array()?;
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
    let covers = |x: f64| low <= x && x <= high;
    // These effects are hidden with either sign.
    let signed =
        ["response_nonlinearity", "gain_drift", "spike_coupling", "supply_droop", "gain_dark_correlation"];
    Some(covers(truth) || signed.contains(&name) && covers(-truth))
}
