//! Comparison of diagnosed and hidden effects.

use serde_json::{Value, json};

/// A diagnosed effect, and the effects that the diagnosis cannot distinguish from it.
type NamedEffect<'a> = (&'a str, Vec<&'a str>);

/// Compares the effects that `diagnosis` names with those that are `hidden`.
///
/// A name matches a hidden effect if the effect has this name or one of the ambiguous names of the diagnosed effect.
/// Each name matches at most one hidden effect. Equal names are matched first. The other names follow, in ascending
/// order of the number of unmatched hidden effects among their ambiguous names. A name without a match is wrong.
pub(crate) fn score(hidden: &Value, diagnosis: &Value) -> Value {
    if diagnosis["verdict"].is_null() {
        return json!({ "error": true });
    }
    let names = diagnosed_names(diagnosis);
    let mut open: Vec<&str> = array_items(hidden).filter_map(|h| h["name"].as_str()).collect();
    let hidden = open.clone();
    let mut take = |name: &str| open.iter().position(|o| *o == name).map(|i| open.remove(i)).is_some();
    let mut others: Vec<&NamedEffect> = names.iter().filter(|(name, _)| !take(name)).collect();
    let exact = names.len() - others.len();
    others.sort_by_key(|(_, ties)| ties.iter().filter(|t| open.contains(t)).count());
    let mut wrong = Vec::new();
    for (name, ties) in others {
        match open.iter().position(|o| ties.contains(o)) {
            Some(i) => drop(open.remove(i)),
            None => wrong.push(name),
        }
    }
    let identified: Vec<&str> = hidden.into_iter().filter(|h| !open.contains(h)).collect();
    json!({
        "exact": exact,
        "named_or_ambiguous": identified.len(),
        "found": identified,
        "wrong": wrong,
        "verdict": diagnosis["verdict"],
        "names": names.iter().map(|n| n.0).collect::<Vec<_>>(),
    })
}

fn ambiguous_names(effect: &Value) -> Vec<&str> {
    array_items(&effect["ambiguous_with"]).filter_map(Value::as_str).collect()
}

/// Returns the names in a diagnosis, each with its ambiguous names. The names are the effects that are not tentative,
/// and the effects of mismatched camera parameters that are not tentative.
fn diagnosed_names(diagnosis: &Value) -> Vec<NamedEffect<'_>> {
    let effects = array_items(&diagnosis["effects"]).filter(|e| e["is_tentative"] != true);
    let effects = effects.filter_map(|e| Some((e["name"].as_str()?, ambiguous_names(e))));
    let misfits = array_items(&diagnosis["parameter_mismatches"])
        .filter(|m| m["is_tentative"] != true)
        .filter_map(|m| Some((m["parameter"].as_str()?.split('.').next()?, ambiguous_names(m))));
    effects.chain(misfits).collect()
}

fn array_items(value: &Value) -> impl Iterator<Item = &Value> {
    value.as_array().into_iter().flatten()
}
