//! The study of `calibrate` in random laboratories of known truth, simulated without the library.
//!
//! `cargo run --release --example study-labs -- [--labs N] [--report FILE]` prints a row for each kind of fault, and writes the tables
//! between the marks of FILE.

#[path = "../../tests/calibrate_support/mod.rs"]
mod calibrate_support;
mod judge;
mod lab;
#[path = "../diagnose/share.rs"]
#[allow(dead_code, reason = "the study of diagnose uses more of it")]
mod share;

use std::fmt::Write as _;
use std::path::Path;

use judge::{Compared, QUANTITIES, Verdict, judge};
use lab::{FAULTS, Lab};
use rayon::prelude::*;
use share::Share;

const MARKS: [&str; 2] = ["<!-- begin: study-labs -->\n", "<!-- end: study-labs -->"];

fn main() {
    let (mut labs, mut report) = (300_u64, None);
    let mut all = std::env::args().skip(1);
    while let Some(arg) = all.next() {
        let value = all.next().unwrap_or_else(|| panic!("{arg} needs a value"));
        match arg.as_str() {
            "--labs" => labs = value.parse().expect("a number of laboratories"),
            "--report" => report = Some(value),
            _ => panic!("{arg}: give --labs N or --report FILE"),
        }
    }
    let verdicts: Vec<(&str, Verdict)> = (0..labs)
        .into_par_iter()
        .map(|index| {
            let lab = Lab::new(index);
            let verdict = judge(&lab);
            match &verdict {
                Verdict::Refused(why) => println!("laboratory {index}, {}: refused, {why}", lab.fault),
                Verdict::Said(_) => verdict.wrong().iter().for_each(|c| {
                    let name = QUANTITIES[c.quantity];
                    println!(
                        "laboratory {index}, {}: {name} {:+.1} errors off, error {:.3} %",
                        lab.fault,
                        c.z,
                        100.0 * c.relative
                    );
                }),
            }
            (lab.fault, verdict)
        })
        .collect();
    let tables = tables(&verdicts);
    print!("{tables}");
    if let Some(file) = report {
        write(Path::new(&file), &tables);
    }
}

fn tables(verdicts: &[(&str, Verdict)]) -> String {
    let mut text = String::from("| fault | labs | refused | right | wrong |\n|---|--:|--:|--:|--:|\n");
    for fault in FAULTS {
        let of: Vec<&Verdict> = verdicts.iter().filter(|v| v.0 == fault).map(|v| &v.1).collect();
        let refused = of.iter().filter(|v| matches!(v, Verdict::Refused(_))).count();
        let wrong = of.iter().filter(|v| !v.wrong().is_empty()).count();
        writeln!(text, "| {fault} | {} | {refused} | {} | {wrong} |", of.len(), of.len() - refused - wrong)
            .unwrap();
    }
    let said = |fault: Option<&str>| -> Vec<Compared> {
        let of = verdicts.iter().filter(|v| fault.is_none_or(|f| f == v.0));
        of.flat_map(|v| if let Verdict::Said(all) = &v.1 { all.clone() } else { Vec::new() }).collect()
    };
    text += "\nShare of the 95 % intervals that hold the truth, with its own 95 % interval, and the median half width.\n\n";
    text += "| quantity | intervals | hold the truth | standard error, median |\n|---|--:|---|--:|\n";
    let everything = said(None);
    for (q, name) in QUANTITIES.iter().enumerate() {
        let of: Vec<&Compared> = everything.iter().filter(|c| c.quantity == q).collect();
        let held = of.iter().filter(|c| c.z.abs() <= 1.96).count();
        let mut widths: Vec<f64> = of.iter().map(|c| c.relative).collect();
        widths.sort_by(f64::total_cmp);
        let width = widths.get(widths.len() / 2).copied().unwrap_or(0.0);
        writeln!(
            text,
            "| {name} | {} | {} | {:.3} % |",
            of.len(),
            Share { hits: held, of: of.len() },
            100.0 * width
        )
        .unwrap();
    }
    text += "\nThe same by kind of fault, in per cent.\n\n| fault |";
    QUANTITIES.iter().for_each(|q| text += &format!(" {q} |"));
    text += &format!("\n|---|{}\n", "--:|".repeat(QUANTITIES.len()));
    for fault in FAULTS {
        let of = said(Some(fault));
        text += &format!("| {fault} |");
        for q in 0..QUANTITIES.len() {
            let mine: Vec<&Compared> = of.iter().filter(|c| c.quantity == q).collect();
            let held = mine.iter().filter(|c| c.z.abs() <= 1.96).count();
            text += &if mine.is_empty() {
                " |".to_owned()
            } else {
                format!(" {:.0} |", 100.0 * held as f64 / mine.len() as f64)
            };
        }
        text.push('\n');
    }
    text
}

fn write(path: &Path, tables: &str) {
    let page = std::fs::read_to_string(path).unwrap();
    let (start, rest) = page.split_once(MARKS[0]).expect("the page's first mark");
    let (_, end) = rest.split_once(MARKS[1]).expect("the page's last mark");
    std::fs::write(path, format!("{start}{}{tables}{}{end}", MARKS[0], MARKS[1])).unwrap();
}
