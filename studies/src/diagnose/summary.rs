//! The study at a glance.

use std::fmt::Write as _;

use serde_json::Value;

use super::judged::{Gaps, covers};
use super::several::Several;
use super::share::Share;

/// A row of the summary: what is asked of how many sensors, and the share that shows it.
struct Asked {
    what: &'static str,
    aim: &'static str,
    share: Share,
}

/// What is asked of the study beside what was found.
pub(crate) fn summary(text: &mut String, records: &[Value]) {
    let of = |class: &str| records.iter().filter(|r| r["class"] == class).collect::<Vec<_>>();
    let share = |of: &[&Value], hit: &dyn Fn(&Value) -> bool| Share {
        hits: of.iter().filter(|r| hit(r)).count(),
        of: of.len(),
    };
    let (clean, singles, strangers) = (of("null"), of("single"), of("outside"));
    let named = |r: &Value| r["score"]["names"].as_array().is_some_and(|n| !n.is_empty());
    let verdict = |r: &Value, word: &str| r["score"]["verdict"] == word;
    let exact: Vec<&Value> = singles.iter().filter(|r| r["score"]["exact"] == 1).copied().collect();
    let held = exact.iter().filter_map(|r| covers(r, r["hidden"][0]["name"].as_str()?));
    let held: Vec<bool> = held.collect();
    let gaps = Gaps::of(&records.iter().filter(|r| r["class"] != "null").collect::<Vec<_>>());
    let mut rows = vec![
        Asked {
            what: "clean sensors with an alarm or a name",
            aim: "at most 1 %",
            share: share(&clean, &|r| !verdict(r, "agrees")),
        },
        Asked {
            what: "single effects, exact or tied",
            aim: "95 %",
            share: share(&singles, &|r| r["score"]["tied"] == 1),
        },
        Asked {
            what: "single effects, exact",
            aim: "85 %",
            share: share(&singles, &|r| r["score"]["exact"] == 1),
        },
    ];
    for (class, found, right) in [
        ("double", "effects of doubles found", "names said of doubles that are right"),
        ("triple", "effects of triples found", "names said of triples that are right"),
    ] {
        let counts = Several::of(&of(class));
        let hits = counts.found();
        rows.push(Asked { what: found, aim: "85 %", share: Share { hits, of: counts.hidden() } });
        rows.push(Asked { what: right, aim: "95 %", share: Share { hits, of: hits + counts.wrong() } });
    }
    rows.extend([
        Asked {
            what: "from outside, unknown",
            aim: "90 %",
            share: share(&strangers, &|r| verdict(r, "unknown")),
        },
        Asked { what: "from outside, misnamed", aim: "none", share: share(&strangers, &named) },
        Asked {
            what: "intervals of single effects that hold the truth",
            aim: "90 to 99 %",
            share: Share { hits: held.iter().filter(|h| **h).count(), of: held.len() },
        },
        Asked {
            what: "sets called explained, held-out excess within its limit",
            aim: "all",
            share: Share { hits: gaps.shrunk, of: gaps.explained },
        },
    ]);
    text.push_str("| what | aim | found, with the 95 % interval of Clopper and Pearson |\n|---|---|---|\n");
    for Asked { what, aim, share } in rows {
        writeln!(text, "| {what} | {aim} | {share} |").unwrap();
    }
    text.push('\n');
}

/// How many ran and how long they took.
pub(crate) fn ran(text: &mut String, records: &[Value]) {
    text.push_str(
        "| sensors | ran | meant | seconds: median | mean | longest | at most 15 |\n|---|--:|--:|--:|--:|--:|--:|\n",
    );
    for (class, meant) in [("null", 300), ("single", 600), ("double", 150), ("triple", 60), ("outside", 80)] {
        let of = records.iter().filter(|r| r["class"] == class);
        let mut seconds: Vec<f64> = of.filter_map(|r| r["said"]["seconds"].as_f64()).collect();
        seconds.sort_by(f64::total_cmp);
        let Some(longest) = seconds.last() else { continue };
        writeln!(
            text,
            "| {class} | {} | {meant} | {:.1} | {:.1} | {longest:.1} | {} |",
            seconds.len(),
            seconds[seconds.len() / 2],
            seconds.iter().sum::<f64>() / seconds.len() as f64,
            seconds.partition_point(|s| *s <= 15.0),
        )
        .unwrap();
    }
    text.push_str("\nSimulations that all sensors of a protocol share are not in the seconds. The aim is 15 s a sensor.\n\n");
}
