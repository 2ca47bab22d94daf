//! Study of diagnoses with the whole program. Laboratories differ in their cameras, lamps and protocols.
//!
//! `cargo run --release -p spikelane-studies --bin study-program -- RECORDS.jsonl.gz [--clean N] [--singles N]
//! [--doubles N] [--outside N] [--minutes M] [--attempt K] [--filter ID] [--keep FOLDER] [--table FILE]` adds sensors to
//! RECORDS, one per line. Sensors that are already in RECORDS are skipped.
//!
//! The simulator of the hidden sensors belongs to the tests and imports nothing from the library. The seed of a sensor
//! is computed from its name and from the number K of the attempt. The four classes alternate: clean sensors, single
//! effects, two effects, and effects outside the catalog.
//!
//! `--times [N]` prints a table of run times instead. Its rows are clean sensors and sensors with one or two effects,
//! each of 96x64 pixels. With N, the table has only the first N rows. Each diagnosis runs three times: without a cache,
//! with the cache of the preceding rows, and with a cache that contains its own simulations.

mod diagnose_job;
mod factors;
#[path = "../../../crates/diagnose/tests/hidden_sensor/mod.rs"]
#[allow(unreachable_pub, reason = "shared with the tests")]
mod hidden_sensor;
#[path = "../diagnose/jobs.rs"]
mod jobs;
mod laboratory;
#[path = "../diagnose/score.rs"]
mod score;
#[path = "../diagnose/share.rs"]
mod share;
mod table;
mod times;

use std::path::PathBuf;
use std::time::Instant;

use diagnose_job::{diagnose_job, smallest_strengths};
use jobs::{SensorJob, jobs};
use serde_json::Value;
use spikelane_studies::page::write_between_markers;
use spikelane_studies::provenance::provenance;

/// Measured processor seconds per sensor: without a finding, and with a finding.
const SECONDS_PER_SENSOR: [f64; 2] = [10.0, 49.0];

struct Args {
    records: PathBuf,
    counts: [usize; 5],
    minutes: f64,
    attempt: u64,
    id_filter: Option<String>,
    /// Folder to which the recordings of the sensors are written permanently.
    kept_sets_folder: Option<PathBuf>,
    table: Option<PathBuf>,
}

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    if let [word, cases @ ..] = words.as_slice()
        && word == "--times"
    {
        return times::print_table(cases.first().map_or(usize::MAX, |n| n.parse().expect("how many cases")));
    }
    let args = args();
    let jobs = interleave_classes(jobs(args.counts, &[]));
    let known = read_records(&args.records);
    let wanted = |j: &&SensorJob| args.id_filter.as_ref().is_none_or(|only| *only == j.id());
    let left = |j: &&SensorJob| !known.iter().any(|r| r["id"] == j.id().as_str());
    let open: Vec<&SensorJob> = jobs.iter().filter(wanted).filter(left).collect();
    let seconds: f64 = open.iter().map(|j| SECONDS_PER_SENSOR[usize::from(j.class != "null")]).sum();
    println!(
        "{} sensors requested, {} not diagnosed yet: about {:.1} h of processor time",
        jobs.len(),
        open.len(),
        seconds / 3600.0
    );
    let strengths = smallest_strengths();
    let start = Instant::now();
    for job in open {
        let next = SECONDS_PER_SENSOR[usize::from(job.class != "null")];
        if start.elapsed().as_secs_f64() + next > 60.0 * args.minutes {
            println!("stopped after {} minutes; run the same command again to continue", args.minutes);
            break;
        }
        let begun = Instant::now();
        let record = diagnose_job(job, args.attempt, &strengths, args.kept_sets_folder.as_deref());
        let seconds = begun.elapsed().as_secs_f64();
        println!(
            "{}: {} {} ({seconds:.0} s)",
            job.id(),
            record["diagnosis"]["verdict"],
            record["score"]["names"]
        );
        spikelane_studies::lines::append(&args.records, &record.to_string());
    }
    if let Some(path) = args.table {
        write_between_markers(
            &path,
            ["<!-- program: begin -->\n", "<!-- program: end -->"],
            &format!("Made on {}.\n\n{}", provenance(), table::table(&self::read_records(&args.records))),
        );
    }
}

/// Interleaves the classes, so that a run that is stopped early has the same share of every class.
fn interleave_classes(jobs: Vec<SensorJob>) -> Vec<SensorJob> {
    let class_count = |class: &str| jobs.iter().filter(|j| j.class == class).count();
    let counts: Vec<(&str, usize)> =
        ["null", "single", "double", "outside"].map(|class| (class, class_count(class))).to_vec();
    let mut assigned: Vec<usize> = vec![0; counts.len()];
    let place = |job: &SensorJob| {
        let class = counts.iter().position(|c| c.0 == job.class).unwrap();
        assigned[class] += 1;
        (2 * assigned[class] - 1) as f64 / (2 * counts[class].1) as f64
    };
    let places: Vec<f64> = jobs.iter().map(place).collect();
    let mut placed: Vec<(f64, SensorJob)> = places.into_iter().zip(jobs).collect();
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
        id_filter: None,
        kept_sets_folder: None,
        table: None,
    };
    while let Some(word) = words.next() {
        let value = words.next().unwrap_or_else(|| panic!("{word} needs a value"));
        let number = || value.parse::<f64>().unwrap_or_else(|_| panic!("{word} {value}: a number"));
        match word.as_str() {
            "--clean" => args.counts[0] = number() as usize,
            "--singles" => args.counts[1] = number() as usize,
            "--outside" => args.counts[2] = number() as usize,
            "--doubles" => args.counts[3] = number() as usize,
            "--minutes" => args.minutes = number(),
            "--attempt" => args.attempt = number() as u64,
            "--filter" => args.id_filter = Some(value),
            "--keep" => args.kept_sets_folder = Some(value.into()),
            "--table" => args.table = Some(value.into()),
            _ => panic!("{word}: unknown"),
        }
    }
    args
}

fn read_records(path: &std::path::Path) -> Vec<Value> {
    let text = spikelane_studies::lines::read(path);
    text.lines().filter_map(|l| serde_json::from_str(l).ok()).collect()
}
