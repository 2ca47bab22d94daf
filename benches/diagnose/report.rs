//! The study's tables.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use serde_json::Value;

/// Upper end of the 95 % interval of Clopper and Pearson: the share at which `found` or fewer of `n` has chance 2.5 %.
fn upper(found: usize, n: usize) -> f64 {
    if found >= n {
        return 1.0;
    }
    let chance = |p: f64| {
        let mut term = (1.0 - p).powi(n as i32);
        let mut sum = term;
        for i in 0..found {
            term *= (n - i) as f64 / (i + 1) as f64 * p / (1.0 - p);
            sum += term;
        }
        sum
    };
    let (mut low, mut high) = (found as f64 / n as f64, 1.0 - 1e-12);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if chance(middle) > 0.025 { low = middle } else { high = middle }
    }
    high
}

/// The held-out gap before anything was added and at the end, the floor, and the floor's deviation.
fn gap(record: &Value) -> Option<[f64; 4]> {
    let gap = &record["said"]["gap"];
    let last = gap["heldout"].as_array()?.last()?.as_f64()?;
    Some([gap["heldout"][0].as_f64()?, last, gap["floor"].as_f64()?, gap["floor_sd"].as_f64()?])
}

/// Sets called explained, and those of them with a held-out excess within the limit.
#[derive(Clone, Copy)]
struct Gaps {
    explained: usize,
    shrunk: usize,
}

impl Gaps {
    fn of(records: &[&Value]) -> Self {
        let mut gaps = Self { explained: 0, shrunk: 0 };
        records.iter().for_each(|r| gaps.add(r));
        gaps
    }

    fn add(&mut self, record: &Value) {
        let ("explained", Some([first, last, floor, sd])) =
            (record["score"]["verdict"].as_str().unwrap_or(""), gap(record))
        else {
            return;
        };
        self.explained += 1;
        self.shrunk += usize::from(last - floor <= f64::max(0.01 * (first - floor), 2.0 * sd));
    }
}

struct Row {
    n: usize,
    exact: usize,
    tied: usize,
    silent: usize,
    covered: usize,
    intervals: usize,
    gaps: Gaps,
    said: BTreeMap<String, usize>,
}

const EMPTY: Row = Row {
    n: 0,
    exact: 0,
    tied: 0,
    silent: 0,
    covered: 0,
    intervals: 0,
    gaps: Gaps { explained: 0, shrunk: 0 },
    said: BTreeMap::new(),
};

fn add(row: &mut Row, record: &Value) {
    let score = &record["score"];
    let name = record["hidden"][0]["name"].as_str().unwrap_or("clean");
    row.n += 1;
    row.exact += usize::from(score["exact"] == 1);
    row.tied += usize::from(score["tied"] == 1);
    let names: Vec<&str> =
        score["names"].as_array().into_iter().flatten().filter_map(Value::as_str).collect();
    row.silent += usize::from(score["verdict"] == "agrees");
    for said in names.iter().filter(|n| **n != name) {
        *row.said.entry((*said).to_owned()).or_default() += 1;
    }
    row.gaps.add(record);
    if let (Some(covered), true) = (covers(record, name), score["exact"] == 1) {
        row.intervals += 1;
        row.covered += usize::from(covered);
    }
}

/// Whether the interval of the amplitude holds the hidden strength.
fn covers(record: &Value, name: &str) -> Option<bool> {
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

/// Replaces what lies between the marks of the page, or makes the page.
pub fn write(folder: &Path, path: &Path) {
    const MARKS: (&str, &str) = ("<!-- tables -->\n", "<!-- end of tables -->");
    let tables = tables(&super::records::all(folder));
    let page =
        std::fs::read_to_string(path).unwrap_or_else(|_| format!("# Diagnosis\n\n{}{}\n", MARKS.0, MARKS.1));
    let (before, rest) = page.split_once(MARKS.0).expect("the page has marks for its tables");
    let (_, after) = rest.split_once(MARKS.1).expect("the tables have an end");
    std::fs::write(path, format!("{before}{}{tables}{}{after}", MARKS.0, MARKS.1)).unwrap();
}

fn tables(records: &[Value]) -> String {
    let of = |class: &str| records.iter().filter(|r| r["class"] == class).collect::<Vec<_>>();
    let mut text = String::new();
    nulls(&mut text, &of("null"));
    singles(&mut text, &of("single"));
    outside(&mut text, &of("outside"));
    several(&mut text, "Two effects at once", &of("double"));
    several(&mut text, "Three effects at once", &of("triple"));
    let seconds: Vec<f64> = records.iter().filter_map(|r| r["said"]["seconds"].as_f64()).collect();
    let longest = seconds.iter().copied().fold(0.0, f64::max);
    let mean = seconds.iter().sum::<f64>() / seconds.len().max(1) as f64;
    writeln!(text, "Seconds a sensor, simulations shared by all sensors left out: mean {mean:.1}, longest {longest:.1}.\n").unwrap();
    text
}

fn nulls(text: &mut String, all: &[&Value]) {
    let alarms = all.iter().filter(|r| r["score"]["verdict"] != "agrees").count();
    let named = all.iter().filter(|r| r["score"]["names"].as_array().is_some_and(|n| !n.is_empty())).count();
    writeln!(
        text,
        "### Clean sensors\n\n{} ran; {alarms} with an alarm, {named} of them with a name. The upper end of the 95 % interval \
         (Clopper and Pearson) of the share with an alarm is {:.1} %.\n",
        all.len(),
        100.0 * upper(alarms, all.len())
    )
    .unwrap();
    let gaps: Vec<[f64; 4]> = all.iter().filter_map(|r| gap(r)).collect();
    let Some([.., floor, sd]) = gaps.first() else { return };
    let mean = gaps.iter().map(|g| g[1]).sum::<f64>() / gaps.len() as f64;
    let square = gaps.iter().map(|g| (g[1] - mean).powi(2)).sum::<f64>() / gaps.len() as f64;
    let above = gaps.iter().filter(|[_, last, floor, sd]| last - floor > 2.0 * sd).count();
    writeln!(
        text,
        "Their held-out gap is {mean:.0} in the mean (deviation {:.0}), the floor of the first is {floor:.0} ({sd:.0}); {above} lie more than two \
         of the floor's deviations above it.\n",
        square.sqrt()
    )
    .unwrap();
}

fn singles(text: &mut String, all: &[&Value]) {
    let mut rows: BTreeMap<&str, Row> = BTreeMap::new();
    for record in all {
        add(rows.entry(record["hidden"][0]["name"].as_str().unwrap_or("?")).or_insert(EMPTY), record);
    }
    let sum = |f: fn(&Row) -> usize| rows.values().map(f).sum::<usize>();
    let (n, exact, tied) = (sum(|r| r.n), sum(|r| r.exact), sum(|r| r.tied));
    let (covered, intervals) = (sum(|r| r.covered), sum(|r| r.intervals));
    let share = |a: usize, b: usize| 100.0 * a as f64 / b.max(1) as f64;
    writeln!(
        text,
        "### Single effects\n\n{n} ran. Exact name: {exact} ({:.0} %); exact or tied: {tied} ({:.0} %). The 95 % interval of the amplitude holds \
         the truth in {covered} of {intervals} ({:.0} %). Of {} sets called explained, {} have a held-out excess within the limit.\n",
        share(exact, n),
        share(tied, n),
        share(covered, intervals),
        sum(|r| r.gaps.explained),
        sum(|r| r.gaps.shrunk)
    )
    .unwrap();
    text.push_str("| effect | sensors | exact | exact or tied | agrees | interval holds | other names said |\n|---|---|---|---|---|---|---|\n");
    for (name, r) in &rows {
        let said: Vec<String> = r.said.iter().map(|(n, k)| format!("{n} {k}")).collect();
        writeln!(
            text,
            "| `{name}` | {} | {} | {} | {} | {}/{} | {} |",
            r.n,
            r.exact,
            r.tied,
            r.silent,
            r.covered,
            r.intervals,
            said.join(", ")
        )
        .unwrap();
    }
    text.push('\n');
}

fn outside(text: &mut String, all: &[&Value]) {
    let mut rows: BTreeMap<&str, [usize; 4]> = BTreeMap::new();
    for r in all {
        let row = rows.entry(r["hidden"][0]["name"].as_str().unwrap_or("?")).or_default();
        let named = r["score"]["names"].as_array().is_some_and(|n| !n.is_empty());
        row[0] += 1;
        row[1] += usize::from(r["score"]["verdict"] == "unknown");
        row[2] += usize::from(named);
        row[3] += usize::from(r["score"]["verdict"] == "agrees");
    }
    text.push_str("### From outside of the catalogue\n\n| effect | sensors | unknown | misnamed | agrees |\n|---|---|---|---|---|\n");
    for (name, r) in rows {
        writeln!(text, "| {name} | {} | {} | {} | {} |", r[0], r[1], r[2], r[3]).unwrap();
    }
    text.push('\n');
}

/// Effects of sensors that have several: those above their smallest nameable strength, and how many were found.
fn several(text: &mut String, title: &str, all: &[&Value]) {
    if all.is_empty() {
        writeln!(text, "### {title}\n\nNone ran.\n").unwrap();
        return;
    }
    let mut rows: BTreeMap<&str, [usize; 2]> = BTreeMap::new();
    let mut wrong: BTreeMap<&str, usize> = BTreeMap::new();
    for record in all {
        for hidden in record["hidden"].as_array().into_iter().flatten() {
            let name = hidden["name"].as_str().unwrap_or("?");
            if hidden["strength"].as_f64() < hidden["nameable"].as_f64() {
                continue;
            }
            let row = rows.entry(name).or_default();
            row[0] += 1;
            row[1] +=
                usize::from(record["score"]["found"].as_array().is_some_and(|f| f.iter().any(|f| f == name)));
        }
        for name in record["score"]["wrong"].as_array().into_iter().flatten().filter_map(Value::as_str) {
            *wrong.entry(name).or_default() += 1;
        }
    }
    let sum = |i: usize| rows.values().map(|r| r[i]).sum::<usize>();
    let (hidden, found, false_names) = (sum(0), sum(1), wrong.values().sum::<usize>());
    let percent = |a: usize, b: usize| 100.0 * a as f64 / b.max(1) as f64;
    writeln!(
        text,
        "### {title}\n\n{} sensors ran, with {hidden} effects above their smallest nameable strength; {found} found, exact or tied \
         ({:.0} %). Of {} names said, {false_names} are wrong (precision {:.0} %).\n",
        all.len(),
        percent(found, hidden),
        found + false_names,
        percent(found, found + false_names)
    )
    .unwrap();
    let list = |names: Vec<String>| if names.is_empty() { "none".to_owned() } else { names.join(", ") };
    let missed = rows.iter().filter(|(_, r)| r[1] < r[0]);
    let missed = list(missed.map(|(n, r)| format!("`{n}` {} of {}", r[0] - r[1], r[0])).collect());
    let wrong = list(wrong.iter().map(|(n, k)| format!("`{n}` {k}")).collect());
    let gaps = Gaps::of(all);
    writeln!(
        text,
        "Missed: {missed}. Said wrongly: {wrong}. Of {} sets called explained, {} have a held-out excess within the limit.\n",
        gaps.explained, gaps.shrunk
    )
    .unwrap();
}
