//! The study of the program's own path: laboratories whose cameras, lamps and protocols differ, and what `diagnose` says of them.
//!
//! `cargo run --release -p spikelane-studies --bin study-program -- RECORDS.jsonl.gz [--nulls N] [--singles N] [--doubles N] [--outside N] [--minutes M]
//! [--attempt K] [--only ID] [--keep FOLDER] [--table FILE]` adds sensors to RECORDS, one a line, and leaves those alone that are there. The simulator of the truth is
//! that of the tests and imports nothing from the library. Seeds are functions of a sensor's name and of the attempt. Clean sensors, single
//! effects, doubles and what the catalogue does not hold come side by side. `--times [N]` prints how long clean, single and double
//! sensors of 96x64 pixels take instead, of the first N cases, without a cache, with that of the ones before, and with their own.

mod factors;
#[path = "../../../crates/calibrate/tests/hidden_sensor/mod.rs"]
#[allow(unreachable_pub, reason = "shared with the tests")]
mod hidden_sensor;
#[path = "../diagnose/jobs.rs"]
mod jobs;
mod judged;
mod lab;
mod made;
#[path = "../diagnose/score.rs"]
mod score;
#[path = "../diagnose/share.rs"]
mod share;
mod table;
mod times;

use std::path::PathBuf;
use std::time::Instant;

use jobs::{Job, jobs};
use judged::{judged, smallest};
use serde_json::Value;

/// Processor seconds of a sensor in which nothing is found, and of one in which something is, as first measured.
const SECONDS: [f64; 2] = [45.0, 120.0];

struct Args {
    records: PathBuf,
    counts: [usize; 5],
    minutes: f64,
    attempt: u64,
    only: Option<String>,
    /// Where the sets of the sensors that run stay.
    keep: Option<PathBuf>,
    table: Option<PathBuf>,
}

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    if let [word, cases @ ..] = words.as_slice()
        && word == "--times"
    {
        return times::print(cases.first().map_or(usize::MAX, |n| n.parse().expect("how many cases")));
    }
    let args = args();
    let jobs = side_by_side(jobs(args.counts, &[]));
    let known = known(&args.records);
    let wanted = |j: &&Job| args.only.as_ref().is_none_or(|only| *only == j.id());
    let left = |j: &&Job| !known.iter().any(|r| r["id"] == j.id().as_str());
    let open: Vec<&Job> = jobs.iter().filter(wanted).filter(left).collect();
    let seconds: f64 = open.iter().map(|j| SECONDS[usize::from(j.class != "null")]).sum();
    println!(
        "{} sensors asked for, {} open: about {:.1} h of processor time",
        jobs.len(),
        open.len(),
        seconds / 3600.0
    );
    let strengths = smallest();
    let start = Instant::now();
    for job in open {
        let next = SECONDS[usize::from(job.class != "null")];
        if start.elapsed().as_secs_f64() + next > 60.0 * args.minutes {
            println!("stopped after {} minutes; the same command goes on", args.minutes);
            break;
        }
        let begun = Instant::now();
        let record = judged(job, args.attempt, &strengths, args.keep.as_deref());
        let seconds = begun.elapsed().as_secs_f64();
        println!("{}: {} {} ({seconds:.0} s)", job.id(), record["said"]["verdict"], record["score"]["names"]);
        spikelane_studies::lines::append(&args.records, &record.to_string());
    }
    if let Some(path) = args.table {
        put(&path, &(made::by() + &table::table(&self::known(&args.records))));
    }
}

/// A run that is cut short has the same part of every class.
fn side_by_side(jobs: Vec<Job>) -> Vec<Job> {
    let of = |class: &str| jobs.iter().filter(|j| j.class == class).count();
    let counts: Vec<(&str, usize)> =
        ["null", "single", "double", "outside"].map(|class| (class, of(class))).to_vec();
    let mut taken: Vec<usize> = vec![0; counts.len()];
    let place = |job: &Job| {
        let class = counts.iter().position(|c| c.0 == job.class).unwrap();
        taken[class] += 1;
        (2 * taken[class] - 1) as f64 / (2 * counts[class].1) as f64
    };
    let places: Vec<f64> = jobs.iter().map(place).collect();
    let mut placed: Vec<(f64, Job)> = places.into_iter().zip(jobs).collect();
    placed.sort_by(|a, b| a.0.total_cmp(&b.0));
    placed.into_iter().map(|(_, job)| job).collect()
}

fn args() -> Args {
    let mut words = std::env::args().skip(1);
    let records = words.next().expect("a file for the records");
    let mut args = Args {
        records: records.into(),
        counts: [0; 5],
        minutes: f64::INFINITY,
        attempt: 1,
        only: None,
        keep: None,
        table: None,
    };
    while let Some(word) = words.next() {
        let value = words.next().unwrap_or_else(|| panic!("{word} needs a value"));
        let number = || value.parse::<f64>().unwrap_or_else(|_| panic!("{word} {value}: a number"));
        match word.as_str() {
            "--nulls" => args.counts[0] = number() as usize,
            "--singles" => args.counts[1] = number() as usize,
            "--outside" => args.counts[2] = number() as usize,
            "--doubles" => args.counts[3] = number() as usize,
            "--minutes" => args.minutes = number(),
            "--attempt" => args.attempt = number() as u64,
            "--only" => args.only = Some(value),
            "--keep" => args.keep = Some(value.into()),
            "--table" => args.table = Some(value.into()),
            _ => panic!("{word}: unknown"),
        }
    }
    args
}

/// Puts the table between the marks of a page; a file that is not there becomes the table alone.
fn put(path: &std::path::Path, table: &str) {
    let (begin, end) = ("<!-- program: begin -->\n", "<!-- program: end -->");
    let page = std::fs::read_to_string(path).unwrap_or_else(|_| format!("{begin}{end}\n"));
    let (before, rest) = page.split_once(begin).expect("a page with the marks of the program's table");
    let (_, after) = rest.split_once(end).expect("a second mark");
    std::fs::write(path, format!("{before}{begin}{table}{end}{after}")).unwrap();
}

fn known(path: &std::path::Path) -> Vec<Value> {
    let text = spikelane_studies::lines::read(path);
    text.lines().filter_map(|l| serde_json::from_str(l).ok()).collect()
}
