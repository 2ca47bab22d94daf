//! What was found of what was hidden.

use serde_json::{Value, json};

/// A name that was said, and the names that were said to be as likely.
type Said<'a> = (&'a str, Vec<&'a str>);

/// Compares what `said` names with what is `hidden`. Each name, with its ties, stands for one effect: first those that are
/// exact, then the others, the one with the fewest open ties first. A name that stands for none is wrong.
pub(crate) fn of(hidden: &Value, said: &Value) -> Value {
    if said["verdict"].is_null() {
        return json!({ "error": true });
    }
    let names = names(said);
    let mut open: Vec<&str> = list(hidden).filter_map(|h| h["name"].as_str()).collect();
    let hidden = open.clone();
    let mut take = |name: &str| open.iter().position(|o| *o == name).map(|i| open.remove(i)).is_some();
    let mut others: Vec<&Said> = names.iter().filter(|(name, _)| !take(name)).collect();
    let exact = names.len() - others.len();
    others.sort_by_key(|(_, ties)| ties.iter().filter(|t| open.contains(t)).count());
    let mut wrong = Vec::new();
    for (name, ties) in others {
        match open.iter().position(|o| ties.contains(o)) {
            Some(i) => drop(open.remove(i)),
            None => wrong.push(name),
        }
    }
    let found: Vec<&str> = hidden.into_iter().filter(|h| !open.contains(h)).collect();
    json!({
        "exact": exact,
        "tied": found.len(),
        "found": found,
        "wrong": wrong,
        "verdict": said["verdict"],
        "names": names.iter().map(|n| n.0).collect::<Vec<_>>(),
    })
}

fn ties(of: &Value) -> Vec<&str> {
    list(&of["tied_with"]).filter_map(Value::as_str).collect()
}

/// Effects that are no likenesses, and wrong numbers of the camera.
fn names(said: &Value) -> Vec<Said<'_>> {
    let effects = list(&said["effects"]).filter(|e| e["resembles"] != true);
    let effects = effects.filter_map(|e| Some((e["name"].as_str()?, ties(e))));
    let misfits =
        list(&said["misfits"]).filter_map(|m| Some((m["parameter"].as_str()?.split('.').next()?, ties(m))));
    effects.chain(misfits).collect()
}

fn list(value: &Value) -> impl Iterator<Item = &Value> {
    value.as_array().into_iter().flatten()
}
